// SPDX-License-Identifier: Apache-2.0
// A light, a point that it shines on and a place in the unit square -> the ray to one point of the light, and how much of
// the light's irradiance comes along it. README equations (2) to (5). Pure.
#include "constants.glsl"
#include "light.glsl"

struct LightRay {
  vec3 direction;  // unit, from the point to the light
  float reach;     // metres that must be free; <= 0: nothing can be between
  float weight;    // of this ray among those of the light, >= 0
};

// Whether visibility takes more than one ray.
bool has_extent(HeddleLight light) {
  return light.type == HEDDLE_LIGHT_SPHERE || light.type == HEDDLE_LIGHT_RECTANGLE ||
         (light.type == HEDDLE_LIGHT_DIRECTIONAL && light.radius > 0.0);
}

// The unit square to the unit disk, areas kept: Shirley and Chiu 1997.
vec2 disk_point(vec2 u) {
  vec2 at = 2.0 * u - 1.0;
  bool is_x = abs(at.x) > abs(at.y);
  float r = is_x ? at.x : at.y;
  if (r == 0.0) return vec2(0.0);
  float phi = is_x ? 0.25 * kPi * (at.y / at.x) : kHalfPi - 0.25 * kPi * (at.x / at.y);
  return r * vec2(cos(phi), sin(phi));
}

// (3) Even in solid angle within the cone around `axis` whose half angle has the versine (1 - cos) `versine`.
// `sample_versine`: that of the direction.
vec3 cone_direction(vec3 axis, float versine, vec2 u, out float sample_versine) {
  vec2 disk = disk_point(u);
  float squared = dot(disk, disk);
  sample_versine = squared * versine;
  // sin^2 = v (2 - v): no difference of nearly equal numbers for small cones.
  float across = squared > 0.0 ? sqrt(sample_versine * (2.0 - sample_versine) / squared) : 0.0;
  float turn = axis.z < 0.0 ? -1.0 : 1.0;  // Duff et al. 2017, "Building an Orthonormal Basis, Revisited"
  float a = -1.0 / (turn + axis.z), b = axis.x * axis.y * a;
  vec3 x = vec3(1.0 + turn * axis.x * axis.x * a, turn * b, -turn * axis.x);
  vec3 y = vec3(b, turn + axis.y * axis.y * a, -axis.y);
  return normalize(axis * (1.0 - sample_versine) + (disk.x * x + disk.y * y) * across);
}

// `near_distance`: what is nearer than this to the light is not between. `far`: metres beyond which there is nothing.
LightRay light_ray(HeddleLight light, vec3 position_rel, vec3 normal, float near_distance, float far, vec2 u) {
  if (light.type == HEDDLE_LIGHT_DIRECTIONAL) {
    if (light.radius <= 0.0) return LightRay(-light.direction, far, 1.0);
    float half_sine = sin(0.5 * min(light.radius, kHalfPi));
    float unused;
    vec3 direction = cone_direction(-light.direction, 2.0 * half_sine * half_sine, u, unused);
    return LightRay(direction, far, max(dot(normal, direction), 0.0));
  }
  vec3 to_light = light_nearest_point(light, position_rel) - position_rel;
  if (light.type == HEDDLE_LIGHT_BOX) {
    float along = -dot(to_light, light.direction);  // of the point, from the box's middle the way the light goes
    return LightRay(-light.direction, along + light.half_extent.z, 1.0);
  }
  if (light.type == HEDDLE_LIGHT_RECTANGLE) {
    vec2 at = (2.0 * u - 1.0) * light.half_extent.xy;
    vec3 to_point = to_light + at.x * light.tangent + at.y * light_bitangent(light);
    float squared = max(dot(to_point, to_point), 1e-30), distance = sqrt(squared);
    vec3 direction = to_point / distance;
    // (4), times the square of the distance to the middle: a number without unit, whatever the scene's size.
    float weight = max(dot(normal, direction), 0.0) * max(-dot(light.direction, direction), 0.0) *
                   (dot(to_light, to_light) / squared);
    return LightRay(direction, distance - near_distance, weight);
  }
  float distance = length(to_light);
  vec3 axis = distance > 1e-15 ? to_light / distance : normal;
  if (light.type != HEDDLE_LIGHT_SPHERE) {
    // A capsule's own body, as a sphere's, does not shadow it.
    float body = light.type == HEDDLE_LIGHT_CAPSULE ? 1.01 * light.radius : 0.0;
    return LightRay(axis, distance - max(near_distance, body), 1.0);
  }
  // Rays end where they meet the ball round the light in which nothing casts, a hundredth wider than the light.
  float ball = max(near_distance, 1.01 * light.radius);
  if (distance <= ball) return LightRay(axis, 0.0, 1.0);
  float sine = light.radius / distance;
  float versine = sine * sine / (1.0 + sqrt(1.0 - sine * sine)), sample_versine;
  vec3 direction = cone_direction(axis, versine, u, sample_versine);
  float off_axis = distance * distance * sample_versine * (2.0 - sample_versine);
  float reach = distance * (1.0 - sample_versine) - sqrt(max(ball * ball - off_axis, 0.0));
  return LightRay(direction, reach, max(dot(normal, direction), 0.0));
}
