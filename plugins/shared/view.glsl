// SPDX-License-Identifier: Apache-2.0
// Pixels and depths to positions and back, for the HeddleView of records.h. `raster_px` is a position in the image in
// pixels, y down, the centre of pixel (i, j) at (i + 0.5, j + 0.5) as in gl_FragCoord; jitter is taken out and put in
// here. `depth` is the distance along the view axis in metres, +Inf where there is no surface.
#ifndef HEDDLE_SHARED_VIEW_GLSL
#define HEDDLE_SHARED_VIEW_GLSL
#include "constants.glsl"

vec2 pixel_center(ivec2 pixel) { return vec2(pixel) + 0.5; }

bool is_background(float depth) { return depth > kMaxFloat; }

vec2 ndc_from_raster(HeddleView view, vec2 raster_px) {
  return (raster_px - view.jitter) * (2.0 / vec2(view.extent)) - 1.0;
}

vec2 raster_from_ndc(HeddleView view, vec2 ndc) { return (ndc * 0.5 + 0.5) * vec2(view.extent) + view.jitter; }

vec3 position_view_from_depth(HeddleView view, vec2 raster_px, float depth) {
  vec2 offset = ndc_from_raster(view, raster_px) * vec2(view.half_size.x, -view.half_size.y);
  return vec3(view.is_orthographic != 0u ? offset : offset * depth, -depth);
}

// The inverse. Where a perspective view has position_view.z >= 0 the point is behind the camera and has no place.
vec2 raster_from_view(HeddleView view, vec3 position_view) {
  float scale = view.is_orthographic != 0u ? 1.0 : -1.0 / position_view.z;
  return raster_from_ndc(view, position_view.xy * scale / vec2(view.half_size.x, -view.half_size.y));
}

// Not for background: Inf has no position.
vec3 position_rel_from_depth(HeddleView view, vec2 raster_px, float depth) {
  return (view.rel_from_view * vec4(position_view_from_depth(view, raster_px, depth), 1.0)).xyz;
}

// The camera's own position; the zero vector for the main camera but for rounding.
vec3 view_origin_rel(HeddleView view) { return view.rel_from_view[3].xyz; }

// Unit, world axes, the way the camera looks.
vec3 view_axis(HeddleView view) { return -view.rel_from_view[2].xyz; }

// Unit, world axes, from the camera through the image position.
vec3 view_ray(HeddleView view, vec2 raster_px) {
  if (view.is_orthographic != 0u) return view_axis(view);
  return normalize(mat3(view.rel_from_view) * position_view_from_depth(view, raster_px, 1.0));
}

// Unit, world axes, from a point towards the camera: V of a BRDF. Finite at the camera itself.
vec3 direction_to_view(HeddleView view, vec3 position_rel) {
  vec3 to_view = view_origin_rel(view) - position_rel;
  float distance_squared = dot(to_view, to_view);
  if (view.is_orthographic != 0u || distance_squared < 1e-30) return -view_axis(view);
  return to_view * inversesqrt(distance_squared);
}

float depth_from_position_rel(HeddleView view, vec3 position_rel) {
  return -(view.view_from_rel * vec4(position_rel, 1.0)).z;
}

// xy: raster_px, jitter included; z: depth. Where z <= 0 of a perspective view the point is behind the camera and xy is
// finite but means nothing.
vec3 raster_and_depth_from_rel(HeddleView view, vec3 position_rel) {
  vec3 position_view = (view.view_from_rel * vec4(position_rel, 1.0)).xyz;
  float depth = -position_view.z;
  float scale = view.is_orthographic != 0u ? 1.0 : 1.0 / (abs(depth) > 1e-20 ? depth : 1e-20);
  vec2 ndc = position_view.xy * scale / vec2(view.half_size.x, -view.half_size.y);
  return vec3(raster_from_ndc(view, ndc), depth);
}

// Metres that one pixel spans at a depth, along the image's y.
float pixel_size_at_depth(HeddleView view, float depth) {
  float size = 2.0 * view.half_size.y / float(view.extent.y);
  return view.is_orthographic != 0u ? size : size * depth;
}

#endif
