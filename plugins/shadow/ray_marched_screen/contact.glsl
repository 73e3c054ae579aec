// SPDX-License-Identifier: Apache-2.0
// Visibility of a light near a point: a ray marched over the main view's depth image. Contact shadows.
// Source  Sousa, Kasyan and Schulz 2011, "Secrets of CryENGINE 3 Graphics Technology" (screen-space shadows); McGuire and Mara
//         2014, "Efficient GPU Screen-Space Ray Tracing" (steps along the image with 1/depth); README equations (1), (2)
// in      depth, camera, lights, shadow_settings_light (component of a light)
// loops   one, over `steps` (<= 128)
#include "view.glsl"
#include "light.glsl"

// Half of a pixel's diagonal: a texel's depth belongs to a point that far from the ray at most, px.
const float kHalfDiagonal = 0.70710678;
// Interpolated normals differ from the facets that were drawn: sine of the largest difference that stays free of acne.
const float kFacetSine = 0.1;
// Rounding of positions and depths, relative to the depth: a few float32 steps.
const float kRoundingSlack = 2e-6;
// Over the last part of the ray, and near the border of the image, the shadow fades instead of ending.
const float kRayFade = 0.25;
const float kBorderFade = 0.05;

// Interleaved gradient noise: Jimenez 2014, "Next Generation Post Processing in Call of Duty: Advanced Warfare".
// [0, 1), from the pixel alone.
float pixel_noise(vec2 pixel) { return fract(52.9829189 * fract(dot(pixel, vec2(0.06711056, 0.00583715)))); }

// README equation (1): how far along the normal the ray starts, so that the depths that it meets on its own plane,
// taken at pixel centres, are never in front of it. `depth`: of the ray's farthest point.
float start_offset(vec3 normal, float depth) {
  float along = dot(normal, view_axis(camera));
  float across = sqrt(max(1.0 - along * along, 0.0));
  return pixel_size_at_depth(camera, depth) * (kHalfDiagonal * min(across + kFacetSine, 1.0)) + kRoundingSlack * depth;
}

// 1 inside of the image, falling to 0 at its border.
float border_weight(vec2 raster_px) {
  vec2 extent = vec2(camera.extent);
  vec2 inside = min(raster_px, extent - raster_px);
  return clamp(min(inside.x, inside.y) / (kBorderFade * min(extent.x, extent.y)), 0.0, 1.0);
}

// How much of the light a ray keeps. Parameters and the camera decide by arithmetic, never by a branch (`if`, `&&`, `?:`
// with more than names): lavapipe 22.3 looks for uniforms in the conditions of branches, and writes past its own table
// for the fourth uniform block and later ones.
float march(vec3 start, vec3 end, float ray_length, float distance_here) {
  float start_depth = depth_from_position_rel(camera, start);
  float end_depth = depth_from_position_rel(camera, end);
  // What is in front of the near plane is not in the image: end there.
  float to_near = (start_depth - camera.near_distance) / max(start_depth - end_depth, 1e-6 * abs(start_depth) + 1e-30);
  float kept = mix(1.0, clamp(to_near, 0.0, 1.0), end_depth < camera.near_distance);
  vec3 from = raster_and_depth_from_rel(camera, start);
  vec3 to = raster_and_depth_from_rel(camera, mix(start, end, kept));
  float parallel = float(camera.is_orthographic);
  float dither = mix(0.5, pixel_noise(floor(from.xy)), float(params.dither));
  vec2 extent = vec2(camera.extent);
  float occlusion = 0.0;
  for (int i = 0; i < constant_steps; ++i) {
    float s = (float(i) + dither) / float(constant_steps);
    // README equation (2): along the image 1/depth is linear in perspective, depth itself in parallel projection.
    vec2 raster_px = mix(from.xy, to.xy, s);
    float inverse_depth = mix(1.0 / from.z, 1.0 / to.z, s);
    float ray_depth = mix(1.0 / inverse_depth, mix(from.z, to.z, s), parallel);
    float t = kept * mix(s / (to.z * inverse_depth), s, parallel);  // fraction of the whole ray's length
    bvec4 is_inside = bvec4(greaterThanEqual(raster_px, vec2(0.0)), lessThan(raster_px, extent));
    float behind = ray_depth - fetch_depth(ivec2(clamp(raster_px, vec2(0.0), extent - 1.0))).x;  // -Inf: no surface
    float ray_weight = clamp((distance_here - t * ray_length) / (kRayFade * max(distance_here, 1e-20)), 0.0, 1.0);
    bool is_hit = all(bvec3(all(is_inside), behind > 0.0, behind < params.thickness));
    occlusion = max(occlusion, ray_weight * border_weight(raster_px) * float(is_hit));
  }
  return 1.0 - occlusion * float(start_depth > camera.near_distance);
}

float shadow(uint light, vec3 position_rel, vec3 normal) {
  if (!has_depth || light >= uint(lights.length())) return 1.0;
  HeddleLight source = lights[light];
  if ((source.flags & HEDDLE_LIGHT_CASTS_SHADOW) == 0u || source.type == HEDDLE_LIGHT_ENVIRONMENT) return 1.0;
  bool is_parallel = source.type == HEDDLE_LIGHT_DIRECTIONAL || source.type == HEDDLE_LIGHT_BOX;
  vec3 to_light = is_parallel ? -source.direction : light_nearest_point(source, position_rel) - position_rel;
  float light_distance = length(to_light);
  if (light_distance <= 0.0) return 1.0;
  vec3 L = to_light / light_distance;
  bool has_extent = source.type == HEDDLE_LIGHT_SPHERE || source.type == HEDDLE_LIGHT_CAPSULE ||
                    source.type == HEDDLE_LIGHT_RECTANGLE || source.type == HEDDLE_LIGHT_WEDGE;
  if (dot(normal, L) <= 0.0) return has_extent ? 1.0 : 0.0;

  // Never past the light, nor into the body that glows.
  float body = source.type == HEDDLE_LIGHT_SPHERE || source.type == HEDDLE_LIGHT_CAPSULE ? source.radius : 0.0;
  float room = is_parallel ? kMaxFloat : light_distance - body;
  if (room <= 0.0) return 1.0;
  HeddleShadowSettings settings = fetch_shadow_settings_light(source.id);
  float own = float((settings.written & HeddleShadowSettings_contact_distance) != 0u);
  float distance_here = mix(params.distance, settings.contact_distance, own);
  float ray_length = min(distance_here, room);
  float depth = depth_from_position_rel(camera, position_rel);
  vec3 start = position_rel + normal * start_offset(normal, depth + distance_here);
  return march(start, start + L * ray_length, ray_length, distance_here);
}
