// SPDX-License-Identifier: Apache-2.0
// A surface point, every light and the environment -> radiance towards the viewer: one text for all passes that light
// surfaces, so that they agree. After pass.glsl of a shader that has the port `lights` and calls light_assignment,
// surface_material, shadow and sky. Equations (1) to (6) of lighting/deferred's README.
// One iteration a light that light_assignment lets it meet: without a technique of that role every light. A driver that
// ends loops after 65,535 iterations (lavapipe) allows 65,535 lights less what the shadow techniques loop: with 32 taps a
// light, 1985 lights.
#ifndef HEDDLE_SHARED_SHADE_SURFACE_GLSL
#define HEDDLE_SHARED_SHADE_SURFACE_GLSL
#include "role/light_assignment.glsl"
#include "role/surface_material.glsl"
#include "role/shadow.glsl"
#include "role/sky.glsl"
#include "area_light.glsl"
#include "light.glsl"

// The narrowest lobe that area lights widen: surface_material clamps alpha there as well.
const float kShadeMinimumAlpha = 1e-3;

// (1) A light without size, or with one that only widens the lobe (the sun's disc).
vec3 shade_point_light(HeddleLight light, LightArrival arrival, SurfacePoint point, vec3 N, vec3 V) {
  if (light.type == HEDDLE_LIGHT_DIRECTIONAL && light.radius > 0.0) {
    float sine = sin(min(light.radius, kHalfPi));
    float alpha = max(point.roughness * point.roughness, kShadeMinimumAlpha);
    float VoH = sqrt(max(0.5 + 0.5 * dot(V, arrival.direction), 0.0));
    point.roughness = min(sqrt(alpha * inversesqrt(widening(alpha, sine * sine, VoH))), 1.0);
  }
  return surface_material(point, N, V, arrival.direction) * arrival.irradiance *
         max(dot(N, arrival.direction), 0.0);
}

// (2) to (5) A sphere or rectangle: its exact irradiance on the diffuse lobe, a representative point on the specular.
vec3 shade_area_light(HeddleLight light, LightArrival arrival, vec3 position_rel, SurfacePoint point, vec3 N, vec3 V) {
  vec3 irradiance = light_irradiance(light, arrival, position_rel, N);
  float NoC = dot(N, arrival.direction);
  // Diffuse light comes from the part above the horizon: its middle is never below.
  vec3 L_diffuse = NoC > 0.01 ? arrival.direction : normalize(arrival.direction + N * (0.01 - NoC));
  vec3 sum = surface_material_lobe(point, N, V, L_diffuse, 1u) * irradiance;

  vec3 center = light.position_rel - position_rel;
  vec3 R = reflect(-V, N);
  vec3 L = light.type == HEDDLE_LIGHT_SPHERE
               ? nearest_on_sphere(center, light.radius, R)
               : nearest_on_rectangle(center, light.tangent, light_bitangent(light), light.half_extent.xy, R);
  float facing = luminance(arrival.irradiance) / max(luminance(light.intensity), 1e-20);
  float VoH = sqrt(max(0.5 + 0.5 * dot(V, L), 0.0));
  float alpha = max(point.roughness * point.roughness, kShadeMinimumAlpha);
  float scale = widening(alpha, sin_squared_of_form_factor(facing), VoH);
  return sum + surface_material_lobe(point, N, V, L, 2u) * arrival.irradiance * (scale * max(dot(N, L), 0.0));
}

// (6) Whence the light of a lobe comes on the whole: rough ones look away from the mirror direction R, to the normal.
vec3 dominant_direction(vec3 N, vec3 R, float alpha) {
  float smoothness = max(1.0 - alpha, 0.0);
  return normalize(mix(N, R, smoothness * (sqrt(smoothness) + alpha)));
}

// Interpolated and mapped normals may turn away from the viewer, a surface that is seen does not: the nearest that does
// not, either.
vec3 normal_towards_viewer(vec3 N, vec3 V) {
  float NoV = dot(N, V);
  return NoV < 0.0 ? normalize(N - V * NoV) : N;
}

// Reflected radiance towards V, cd/m^2, without emission. `raster_px`: where the camera sees position_rel. `normal`: the
// geometric one, for shadows. `open`: share of the environment that is not occluded.
vec3 shade_surface(SurfacePoint point, vec2 raster_px, vec3 position_rel, vec3 N, vec3 normal, vec3 V, float open) {
  vec3 sum = vec3(0.0);
  LightIterator iterator = begin_lights(uint(lights.length()), raster_px, position_rel);
  while (next_light(iterator)) {
    uint i = iterator.light;
    HeddleLight light = lights[i];
    LightArrival arrival = light_arrival(light, position_rel);
    if (all(equal(arrival.irradiance, vec3(0.0)))) continue;
    bool has_area = light.type == HEDDLE_LIGHT_SPHERE || light.type == HEDDLE_LIGHT_RECTANGLE;
    if (!has_area && dot(N, arrival.direction) <= 0.0) continue;
    float lit = (light.flags & HEDDLE_LIGHT_CASTS_SHADOW) != 0u ? shadow(i, position_rel, normal) : 1.0;
    sum += lit * (has_area ? shade_area_light(light, arrival, position_rel, point, N, V)
                           : shade_point_light(light, arrival, point, N, V));
  }
  float alpha = max(point.roughness * point.roughness, kShadeMinimumAlpha);
  vec3 specular = sky_specular(dominant_direction(N, reflect(-V, N), alpha), alpha);
  return sum + open * surface_material_environment(point, N, V, sky_irradiance(N), specular);
}

#endif
