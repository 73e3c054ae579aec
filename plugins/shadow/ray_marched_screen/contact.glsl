// SPDX-License-Identifier: Apache-2.0
// Visibility of a light near a point: a ray marched over the main view's depth image. Contact shadows.
// Source  Sousa, Kasyan and Schulz 2011, "Secrets of CryENGINE 3 Graphics Technology" (screen-space shadows); McGuire and Mara
//         2014, "Efficient GPU Screen-Space Ray Tracing" (steps along the image with 1/depth); README equations (1) to (3)
// in      depth, camera, lights, shadow_settings_light (component of a light)
// loops   one, over `steps` (<= 128)
#include "view.glsl"
#include "light.glsl"

// Half of a pixel's diagonal: a texel's depth belongs to a point that far from the ray at most, px.
const float kHalfDiagonal = 0.70710678;
// Normals differ from the facets that were drawn: sine of the largest difference that stays free of acne.
const float kFacetSine = 0.1;
// Depths of three neighbours belong to one facet when they are off a plane by less than this, in widths of a pixel.
// Half of kFacetSine: the facet's normal is then known to within half of what (1) pays for.
const float kFlatness = 0.05;
// Facets that turn farther from the normal (cosine of 45 degrees) are none: thin things, of which the image shows a line.
const float kFacetCosine = 0.70710678;
// Rounding of positions and depths, relative to the depth: a few float32 steps.
const float kRoundingSlack = 2e-6;
// Over the last part of the ray, and near the border of the image, the shadow fades instead of ending.
const float kRayFade = 0.25;
const float kBorderFade = 0.05;

// Interleaved gradient noise: Jimenez 2014, "Next Generation Post Processing in Call of Duty: Advanced Warfare".
// [0, 1), from the pixel alone.
float pixel_noise(vec2 pixel) { return fract(52.9829189 * fract(dot(pixel, vec2(0.06711056, 0.00583715)))); }

// README equation (2): how far along the normal the ray starts, so that the depths that it meets on its own plane,
// taken at pixel centres, are never in front of it. `depth`: of the ray's farthest point.
float start_offset(vec3 normal, float depth) {
  float along = dot(normal, view_axis(camera));
  float across = sqrt(max(1.0 - along * along, 0.0));
  return pixel_size_at_depth(camera, depth) * (kHalfDiagonal * min(across + kFacetSine, 1.0)) + kRoundingSlack * depth;
}

// What is linear in the image on a plane: 1/depth in perspective, depth in parallel projection. Finite for background.
float planar_depth(ivec2 pixel, float parallel) {
  ivec2 inside = clamp(pixel, ivec2(0), ivec2(camera.extent) - 1);
  float depth = clamp(fetch_depth(inside).x, 1e-18, 1e18);
  return mix(1.0 / depth, depth, parallel);
}

// Five texels of a row or column: x change per pixel at the middle one, from those three neighbours of which it is one and
// which are nearest to a line; y how far these are off it.
vec2 slope_in_row(float before_2, float before, float middle, float after, float after_2) {
  vec3 bend = abs(vec3(before_2 - 2.0 * before + middle, before - 2.0 * middle + after, middle - 2.0 * after + after_2));
  float least = min(bend.x, min(bend.y, bend.z));
  float one_sided = mix(after - middle, middle - before, bend.x <= bend.z);
  return vec2(mix(one_sided, 0.5 * (after - before), bend.y <= least), least);
}

// The normal of the facet that the depth image shows at a point, which interpolated normals of coarse models miss by
// many degrees: world axes, towards the viewer. `normal` itself where the image shows no plane, or not this point's.
vec3 facet_normal(vec3 position_rel, vec3 normal) {
  float parallel = float(camera.is_orthographic);
  vec3 place = raster_and_depth_from_rel(camera, position_rel);
  ivec2 pixel = ivec2(clamp(place.xy, vec2(0.0), vec2(camera.extent) - 1.0));
  float middle = planar_depth(pixel, parallel);
  vec2 row = slope_in_row(planar_depth(pixel - ivec2(2, 0), parallel), planar_depth(pixel - ivec2(1, 0), parallel), middle,
                          planar_depth(pixel + ivec2(1, 0), parallel), planar_depth(pixel + ivec2(2, 0), parallel));
  vec2 column =
      slope_in_row(planar_depth(pixel - ivec2(0, 2), parallel), planar_depth(pixel - ivec2(0, 1), parallel), middle,
                   planar_depth(pixel + ivec2(0, 1), parallel), planar_depth(pixel + ivec2(0, 2), parallel));

  // Per unit of the plane at distance 1 (parallel: per metre), y up.
  vec2 per_pixel = 2.0 * camera.half_size / vec2(camera.extent);
  vec2 gradient = vec2(row.x, -column.x) / per_pixel;
  vec2 xy = position_view_from_depth(camera, pixel_center(pixel), 1.0).xy;
  vec3 seen = mix(vec3(-gradient, middle - dot(gradient, xy)), vec3(gradient, 1.0), parallel);
  vec3 facet = normalize(mat3(camera.rel_from_view) * seen);

  // Off the plane, in metres of depth: the neighbours, and the point itself.
  vec2 from_center = place.xy - pixel_center(pixel);
  float here = mix(1.0 / max(place.z, 1e-18), place.z, parallel);
  float off = max(max(row.y, column.y), abs(middle + row.x * from_center.x + column.x * from_center.y - here));
  float metres = off * mix(place.z * place.z, 1.0, parallel);
  float allowed = kFlatness * pixel_size_at_depth(camera, place.z) + kRoundingSlack * abs(place.z);
  return mix(normal, facet, bvec3(all(bvec2(metres <= allowed, dot(facet, normal) >= kFacetCosine))));
}

// 1 inside of the image, falling to 0 at its border.
float border_weight(vec2 raster_px) {
  vec2 extent = vec2(camera.extent);
  vec2 inside = min(raster_px, extent - raster_px);
  return clamp(min(inside.x, inside.y) / (kBorderFade * min(extent.x, extent.y)), 0.0, 1.0);
}

// README equation (1), metres: no longer than asked for, and no step longer than `stride` pixels.
float ray_reach(float longest, float depth) {
  return min(longest, params.stride * float(constant_steps) * pixel_size_at_depth(camera, max(depth, 0.0)));
}

// How much of the light a ray keeps. Parameters and the camera decide by arithmetic, never by a branch (`if`, `&&`, `?:`
// with more than names): lavapipe 22.3 looks for uniforms in the conditions of branches, and writes past its own table
// for the fourth uniform block and later ones.
float march(vec3 start, vec3 end, float ray_length, float reach, float thickness) {
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
    // README equation (3): along the image 1/depth is linear in perspective, depth itself in parallel projection.
    vec2 raster_px = mix(from.xy, to.xy, s);
    float inverse_depth = mix(1.0 / from.z, 1.0 / to.z, s);
    float ray_depth = mix(1.0 / inverse_depth, mix(from.z, to.z, s), parallel);
    float t = kept * mix(s / (to.z * inverse_depth), s, parallel);  // fraction of the whole ray's length
    bvec4 is_inside = bvec4(greaterThanEqual(raster_px, vec2(0.0)), lessThan(raster_px, extent));
    float behind = ray_depth - fetch_depth(ivec2(clamp(raster_px, vec2(0.0), extent - 1.0))).x;  // -Inf: no surface
    float ray_weight = clamp((reach - t * ray_length) / (kRayFade * max(reach, 1e-20)), 0.0, 1.0);
    bool is_hit = all(bvec3(all(is_inside), behind > 0.0, behind < thickness));
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

  // Never past the light, nor into the body that glows.
  float body = source.type == HEDDLE_LIGHT_SPHERE || source.type == HEDDLE_LIGHT_CAPSULE ? source.radius : 0.0;
  float room = is_parallel ? kMaxFloat : light_distance - body;
  if (room <= 0.0) return 1.0;
  HeddleShadowSettings settings = fetch_shadow_settings_light(source.id);
  float own = float((settings.written & HeddleShadowSettings_contact_distance) != 0u);
  float longest = mix(params.distance, settings.contact_distance, own);
  float depth = depth_from_position_rel(camera, position_rel);
  float reach = ray_reach(longest, depth);
  float thickness = params.thickness * (reach / max(longest, 1e-20));
  float ray_length = min(reach, room);
  vec3 facet = facet_normal(position_rel, normal);
  vec3 start = position_rel + facet * start_offset(facet, depth + reach);
  float lit = march(start, start + L * ray_length, ray_length, reach, thickness);
  // A ray from a facet that faces away goes into the body at once, before its first step; of a light with an extent a part
  // may be in sight all the same.
  return mix(float(has_extent), lit, float(any(bvec2(dot(facet, L) > 0.0, reach <= 0.0))));
}
