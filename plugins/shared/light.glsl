// SPDX-License-Identifier: Apache-2.0
// One HeddleLight of any shape and one point -> from where its light comes and how much of it. Used by lighting, shadow
// and everything else that meets lights, so that all agree where a light is 0.
// Source  KHR_lights_punctual 2018 (windowed inverse square, angular fall-off of spots); Lagarde and de Rousiers 2014,
//         "Moving Frostbite to Physically Based Rendering", section 4.7 (sphere cut by the horizon, after Snyder 1996);
//         Lambert 1760, Photometria (polygon); README of this folder, "Lights"
// Exactly 0 at and beyond `range` and outside cone, wedge, box and behind a rectangle; finite at the light itself.
#ifndef HEDDLE_SHARED_LIGHT_GLSL
#define HEDDLE_SHARED_LIGHT_GLSL
#include "constants.glsl"

// Nearest distance of the inverse square law, metres: a candela there is 1e8 lx, still far from overflow, and no
// luminaire that is described as a point is smaller.
const float kLightMinimumDistance = 1e-4;
// KHR_lights_punctual's lower bound of cos_inner - cos_outer.
const float kLightMinimumConeWidth = 1e-3;

struct LightArrival {
  vec3 direction;   // unit, from the point towards the light: its nearest point, or the centre of sphere and rectangle
  float distance;   // metres to that point; kMaxFloat when infinitely far away
  vec3 irradiance;  // lx on a plane that faces `direction`; 0 where the light does not reach
};

vec3 light_bitangent(HeddleLight light) { return cross(light.direction, light.tangent); }

// Nearest point of the light's segment; its centre for lights without one.
vec3 light_nearest_point(HeddleLight light, vec3 position_rel) {
  if (light.type != HEDDLE_LIGHT_CAPSULE && light.type != HEDDLE_LIGHT_WEDGE) return light.position_rel;
  float along = dot(position_rel - light.position_rel, light.tangent);
  return light.position_rel + light.tangent * clamp(along, -0.5 * light.segment_length, 0.5 * light.segment_length);
}

// 1 near the light, 0 at and beyond its range.
float light_window(HeddleLight light, float distance_squared) {
  if (light.range <= 0.0) return 1.0;
  float q = distance_squared / (light.range * light.range);
  return distance_squared >= light.range * light.range ? 0.0 : max(1.0 - q * q, 0.0);
}

// Angular fall-off for light that leaves at this cosine to `direction`.
float light_angular(HeddleLight light, float cos_angle) {
  float width = max(light.cos_inner - light.cos_outer, kLightMinimumConeWidth);
  float t = clamp((cos_angle - light.cos_outer) / width, 0.0, 1.0);
  return light.type == HEDDLE_LIGHT_SPOT ? t * t : t * t * (3.0 - 2.0 * t);
}

// Inside a box 1, fading to 0 at its faces over `radius`.
float light_box_fade(HeddleLight light, vec3 local) {
  vec3 inside = light.half_extent - abs(local);
  if (inside.x <= 0.0 || inside.y <= 0.0 || inside.z <= 0.0) return 0.0;
  if (light.radius <= 0.0) return 1.0;
  vec3 fade = min(inside / light.radius, vec3(1.0));
  return fade.x * fade.y * fade.z;
}

// Irradiance over radiance from a sphere of sin_squared = (radius / distance)^2 <= 1, its centre at cosine `NoL` to the
// plane's normal, cut by the plane's horizon.
float sphere_form_factor(float sin_squared, float NoL) {
  float s2 = clamp(sin_squared, 0.0, 1.0);
  if (NoL * NoL >= s2) return NoL > 0.0 ? kPi * s2 * NoL : 0.0;
  float x = sqrt(max(1.0 / s2 - 1.0, 1e-12));
  float sin_theta = sqrt(max(1.0 - NoL * NoL, 1e-12));
  float y = clamp(-x * NoL / sin_theta, -1.0, 1.0);
  float w = sqrt(max(1.0 - y * y, 0.0));
  // acos(y), as atan: acos is off by 2e-4 on some drivers.
  float angle = atan(w, y);
  return max((NoL * angle - x * sin_theta * w) * s2 + atan(sin_theta * w / x), 0.0);
}

// Angle between unit vectors over the length of their cross product: 1 for small angles.
float angle_over_sine(float cosine, float sine) {
  if (cosine > 0.0 && sine < 0.25) {
    float s2 = sine * sine;  // series of asin(s) / s; the next term is below 3e-8
    return 1.0 + s2 * (0.166666667 + s2 * (0.075 + s2 * (0.0446428571 + s2 * 0.0303819444)));
  }
  return atan(sine, cosine) / max(sine, 1e-20);
}

// One edge of Lambert's formula: a, b unit and on or above the horizon.
float polygon_edge(vec3 a, vec3 b, vec3 N) {
  vec3 c = cross(a, b);
  return angle_over_sine(dot(a, b), length(c)) * dot(c, N);
}

// The part above the horizon of the edge from a to b, heights ha, hb over it.
float polygon_edge_above(vec3 a, vec3 b, float ha, float hb, vec3 N, inout vec3 leave, inout vec3 enter) {
  if (ha <= 0.0 && hb <= 0.0) return 0.0;
  vec3 crossing = a * hb - b * ha;
  crossing /= max(length(crossing), 1e-20) * (hb >= ha ? 1.0 : -1.0);
  if (ha <= 0.0) {
    enter = crossing;
    return polygon_edge(crossing, b, N);
  }
  if (hb <= 0.0) {
    leave = crossing;
    return polygon_edge(a, crossing, N);
  }
  return polygon_edge(a, b, N);
}

// Irradiance over radiance at the origin on a plane with normal N, from a rectangle of centre c and half axes x, y that
// shines to both sides; cut by the plane's horizon, exact.
float rectangle_form_factor(vec3 c, vec3 x, vec3 y, vec3 N) {
  vec3 p0 = c - x - y, p1 = c + x - y, p2 = c + x + y, p3 = c - x + y;
  p0 /= max(length(p0), 1e-20);
  p1 /= max(length(p1), 1e-20);
  p2 /= max(length(p2), 1e-20);
  p3 /= max(length(p3), 1e-20);
  float h0 = dot(p0, N), h1 = dot(p1, N), h2 = dot(p2, N), h3 = dot(p3, N);
  vec3 leave = vec3(0.0), enter = vec3(0.0);
  float sum = polygon_edge_above(p0, p1, h0, h1, N, leave, enter) +
              polygon_edge_above(p1, p2, h1, h2, N, leave, enter) +
              polygon_edge_above(p2, p3, h2, h3, N, leave, enter) +
              polygon_edge_above(p3, p0, h3, h0, N, leave, enter);
  // The horizon closes the polygon where it cut it.
  if (dot(leave, leave) > 0.0) sum += polygon_edge(leave, enter, N);
  return 0.5 * abs(sum);
}

// Irradiance over radiance from a rectangle light on a plane with normal N.
float light_rectangle_form_factor(HeddleLight light, vec3 position_rel, vec3 N) {
  vec3 center = light.position_rel - position_rel;
  if (dot(center, light.direction) >= 0.0) return 0.0;  // behind it
  vec3 x = light.tangent * light.half_extent.x, y = light_bitangent(light) * light.half_extent.y;
  float distance_squared = dot(center, center);
  // Far away edges cancel in float32, and a small patch is exact to the square of its angular size, 2^-16.
  if (dot(x, x) + dot(y, y) < distance_squared * (1.0 / 65536.0)) {
    vec3 to_light = center * inversesqrt(distance_squared);
    float area = 4.0 * light.half_extent.x * light.half_extent.y;
    return area * max(dot(to_light, N), 0.0) * max(-dot(to_light, light.direction), 0.0) / distance_squared;
  }
  return rectangle_form_factor(center, x, y, N);
}

// What arrives at a point. HEDDLE_LIGHT_ENVIRONMENT arrives from nowhere: the role `sky` answers for it.
LightArrival light_arrival(HeddleLight light, vec3 position_rel) {
  LightArrival arrival = LightArrival(-light.direction, kMaxFloat, vec3(0.0));
  if (light.type == HEDDLE_LIGHT_DIRECTIONAL) {
    arrival.irradiance = light.intensity;
    return arrival;
  }
  if (light.type == HEDDLE_LIGHT_ENVIRONMENT) return arrival;
  vec3 to_light = light_nearest_point(light, position_rel) - position_rel;
  float distance_squared = dot(to_light, to_light);
  if (light.type == HEDDLE_LIGHT_BOX) {
    vec3 local =
        -vec3(dot(to_light, light.tangent), dot(to_light, light_bitangent(light)), dot(to_light, light.direction));
    arrival.distance = max(local.z + light.half_extent.z, 0.0);
    arrival.irradiance = light.intensity * (light_box_fade(light, local) * light_window(light, distance_squared));
    return arrival;
  }
  arrival.distance = sqrt(distance_squared);
  if (distance_squared > 1e-30)
    arrival.direction = to_light / arrival.distance;
  else if (dot(light.direction, light.direction) < 0.5)
    arrival.direction = vec3(0.0, 1.0, 0.0);
  float factor = light_window(light, distance_squared);
  if (light.type == HEDDLE_LIGHT_SPHERE) {
    float radius_squared = light.radius * light.radius;
    factor *= kPi * radius_squared / max(max(distance_squared, radius_squared), 1e-30);
  } else if (light.type == HEDDLE_LIGHT_RECTANGLE) {
    factor *= light_rectangle_form_factor(light, position_rel, arrival.direction);
  } else {
    float nearest = kLightMinimumDistance;
    if (light.type == HEDDLE_LIGHT_CAPSULE) nearest = max(nearest, light.radius);
    factor /= max(distance_squared, nearest * nearest);
    if (light.type == HEDDLE_LIGHT_SPOT || light.type == HEDDLE_LIGHT_CONE || light.type == HEDDLE_LIGHT_WEDGE)
      factor *= light_angular(light, dot(-arrival.direction, light.direction));
  }
  arrival.irradiance = light.intensity * factor;
  return arrival;
}

// Irradiance on a plane with unit normal N, lx: exact for sphere and rectangle, cosine law for the others.
vec3 light_irradiance(HeddleLight light, LightArrival arrival, vec3 position_rel, vec3 N) {
  float NoL = dot(N, arrival.direction);
  if (light.type == HEDDLE_LIGHT_SPHERE) {
    float sin_squared = light.radius * light.radius / max(arrival.distance * arrival.distance, 1e-30);
    return light.intensity * (sphere_form_factor(sin_squared, NoL) *
                              light_window(light, arrival.distance * arrival.distance));
  }
  if (light.type == HEDDLE_LIGHT_RECTANGLE)
    return light.intensity * (light_rectangle_form_factor(light, position_rel, N) *
                              light_window(light, arrival.distance * arrival.distance));
  return arrival.irradiance * max(NoL, 0.0);
}

#endif
