// SPDX-License-Identifier: Apache-2.0
// Visibility of a light near a point: a ray marched over the main view's depth image. Contact shadows.
// Source  Sousa, Kasyan and Schulz 2011, "Secrets of CryENGINE 3 Graphics Technology" (screen-space shadows); McGuire and Mara
//         2014, "Efficient GPU Screen-Space Ray Tracing" (steps along the image with 1/depth); README equations (1), (2)
// in      depth, camera, lights
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

float march(vec3 start, vec3 end, float ray_length) {
  float start_depth = depth_from_position_rel(camera, start);
  float end_depth = depth_from_position_rel(camera, end);
  // What is in front of the near plane is not in the image: end there.
  float nearest = camera.near_distance;
  if (start_depth <= nearest) return 1.0;
  if (end_depth < nearest) {
    float kept = (start_depth - nearest) / (start_depth - end_depth);
    end = mix(start, end, kept);
    ray_length *= kept;
  }
  vec3 from = raster_and_depth_from_rel(camera, start);
  vec3 to = raster_and_depth_from_rel(camera, end);
  bool is_orthographic = camera.is_orthographic != 0u;
  uint steps = uint(params.steps);
  float dither = params.dither != 0u ? pixel_noise(floor(from.xy)) : 0.5;
  for (uint i = 0u; i < steps; ++i) {
    float s = (float(i) + dither) / float(steps);
    // README equation (2): along the image 1/depth is linear in perspective, depth itself in parallel projection.
    vec2 raster_px = mix(from.xy, to.xy, s);
    float inverse_depth = mix(1.0 / from.z, 1.0 / to.z, s);
    float ray_depth = is_orthographic ? mix(from.z, to.z, s) : 1.0 / inverse_depth;
    float t = is_orthographic ? s : s / (to.z * inverse_depth);  // fraction of the ray's length
    ivec2 pixel = ivec2(floor(raster_px));
    if (any(lessThan(pixel, ivec2(0))) || any(greaterThanEqual(pixel, ivec2(camera.extent)))) break;
    float behind = ray_depth - fetch_depth(pixel).x;  // -Inf where there is no surface
    if (behind > 0.0 && behind < params.thickness) {
      float ray_weight = clamp((params.distance - t * ray_length) / (kRayFade * params.distance), 0.0, 1.0);
      return 1.0 - ray_weight * border_weight(raster_px);
    }
  }
  return 1.0;
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

  float depth = depth_from_position_rel(camera, position_rel);
  vec3 offset = normal * start_offset(normal, depth + params.distance);
  // Never past the light, nor into the body that glows.
  float ray_length = params.distance;
  if (!is_parallel) {
    float body = source.type == HEDDLE_LIGHT_SPHERE || source.type == HEDDLE_LIGHT_CAPSULE ? source.radius : 0.0;
    ray_length = min(ray_length, light_distance - body);
  }
  if (ray_length <= 0.0) return 1.0;
  vec3 start = position_rel + offset;
  return march(start, start + L * ray_length, ray_length);
}
