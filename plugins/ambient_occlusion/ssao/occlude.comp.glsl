// SPDX-License-Identifier: Apache-2.0
// Depth, normal -> occlusion with the noise of the pattern: the share of points around each surface point that the image
// shows something in front of.
// Source  Filion and McNaughton 2008, "Effects & Techniques" (rendering techniques of StarCraft II); README equations
//         (1) to (5)
// in      depth, normal_geometric  of the pixel
//         reduced_depth            of everything else; kNoSurface where there is no surface
//         pattern                  tile of random unit vectors (reflect, basis) or quaternions (rotate)
//         offsets                  xyz in units of the radius: those of the tight set, then those of the wide one
// out     noisy                    layer 0; x wide set, or the darker one; y tight set: 0 open, 1 closed
// push    offsets of the tight and of the wide set
// loops   all rounds together: the offsets, at most 4096
#include "pass.glsl"
#include "octahedral.glsl"
#include "view.glsl"
#include "facing.glsl"
#include "ssao.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(push_constant) uniform Push { ivec2 set_sizes; } push;

// The depth that the image shows at a place, and the place that it was measured at.
float seen_depth(inout vec2 raster) {
  vec2 place = raster / float(params.depth_divisor);
  if (constant_depth_fetch != 0u) return sample_reduced_depth(place / vec2(size_reduced_depth())).x;
  ivec2 texel = min(ivec2(place), size_reduced_depth() - 1);
  vec2 size = vec2(size_depth());
  raster = constant_depth_filter == kDepthPoint
               ? pixel_center(representative(texel, params.depth_divisor, size_depth()))
               : min((vec2(texel) + 0.5) * float(params.depth_divisor), size - 0.5);
  return fetch_reduced_depth(texel).x;
}

float sample_occlusion(vec3 position, vec3 n, vec3 offset, OcclusionCurve curve) {
  vec3 sample_position = position + offset;
  float sample_depth = -sample_position.z;
  // Behind the eye the projection has no meaning: such a sample is open.
  if (camera.is_orthographic == 0u && sample_depth <= camera.near_distance) return 0.0;
  vec2 raster = raster_from_view(camera, sample_position);
  vec2 size = vec2(size_depth());
  bool is_inside = all(greaterThanEqual(raster, vec2(0.0))) && all(lessThan(raster, size));
  // Beyond the border nothing is known, so nothing occludes.
  if (!is_inside && constant_border == 0u) return 0.0;
  raster = clamp(raster, vec2(0.0), size - 0.5);
  float depth = seen_depth(raster);
  if (depth >= (constant_depth_format == 0u ? kNoSurface : kNoSurfaceHalf)) return 0.0;
  if (constant_above_plane &&
      !is_above_plane(position_view_from_depth(camera, raster, depth) - position, n, sample_depth)) {
    return 0.0;
  }
  return occlusion(constant_falloff, sample_depth - depth, curve, params.curve_near, params.curve_far);
}

float set_occlusion(int first, int count, vec3 position, vec3 n, vec4 random, float radius, OcclusionCurve curve) {
  float sum = 0.0;
  for (int i = first; i < first + count; ++i) {
    vec3 offset = offsets[i].xyz;
    if (constant_hemisphere == kHemisphereBasis) {
      offset = basis_offset(offset, n, random.xyz);
    } else {
      if (constant_randomize == kRandomizeReflect) offset = reflect_offset(offset, random.xyz);
      if (constant_randomize == kRandomizeRotate) offset = rotate_offset(offset, random);
      if (constant_hemisphere == kHemisphereFlip) offset = flip_offset(offset, n);
    }
    sum += sample_occlusion(position, n, radius * offset, curve);
  }
  return count > 0 ? sum / float(count) : 0.0;
}

// What is left of a set after the footprint's limit.
float limited_set(int first, int count, float radius, vec3 ratios, vec3 position, vec3 n, vec4 random) {
  float radius_px = radius / pixel_size_at_depth(camera, -position.z);
  float most_px = params.footprint * float(camera.extent.y);
  float scale = constant_limiter == kLimitRadius ? footprint_scale(radius_px, most_px) : 1.0;
  int used = constant_limiter == kLimitSamples ? samples_for_footprint(count, radius_px, most_px) : count;
  float curve_scale = radius * (constant_scale_curve ? scale : 1.0);
  OcclusionCurve curve = OcclusionCurve(ratios.x * curve_scale, ratios.y * curve_scale, ratios.z);
  return set_occlusion(first, used, position, n, random, scale * radius, curve);
}

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_noisy()))) return;
  ivec2 full = representative(pixel, constant_evaluate_divisor, size_depth());
  float depth = fetch_depth(full).x;
  // Nothing that is less than a pixel away can be told from the point itself.
  if (is_background(depth) || params.radius < pixel_size_at_depth(camera, depth)) {
    imageStore(noisy, ivec3(pixel, 0), vec4(0.0));
    return;
  }
  vec3 position = position_view_from_depth(camera, pixel_center(full), depth);
  vec3 v = camera.is_orthographic != 0u ? vec3(0.0, 0.0, 1.0) : normalize(-position);
  vec3 n = face_viewer(mat3(camera.view_from_rel) * decode_octahedral(fetch_normal_geometric(full).xy), v);
  vec4 random = constant_randomize <= kRandomizeRotate ? fetch_pattern(pixel % size_pattern()) : vec4(0.0);

  float tight = limited_set(0, push.set_sizes.x, params.tight_radius * params.radius,
                            vec3(params.tight_full, params.tight_range, params.tight_power), position, n, random);
  // In variable mode each set has four times its offsets in the list.
  int first_wide = constant_limiter == kLimitSamples ? 4 * push.set_sizes.x : push.set_sizes.x;
  float wide = limited_set(first_wide, push.set_sizes.y, params.radius, vec3(params.full, params.range, params.power),
                           position, n, random);
  if (constant_combine == 0u) wide = max(tight, wide);
  imageStore(noisy, ivec3(pixel, 0), vec4(wide, tight, 0.0, 0.0));
}
