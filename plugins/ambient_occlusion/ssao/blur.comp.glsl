// SPDX-License-Identifier: Apache-2.0
// One smoothing of the occlusion: a Gaussian over the neighbours that belong to the same surface.
// Source  Filion and McNaughton 2008, "Effects & Techniques", smart blur; README equations (6) and (7)
// in      depth, normal_geometric  of the pixels that the occlusion stands for
// inout   noisy                    layer push.source -> the other layer
// params  blur, blur_radius, blur_sigma, blur_edges, blur_distance, blur_normal
// push    which way, from which layer
// loops   at most 33 x 33
#include "pass.glsl"
#include "octahedral.glsl"
#include "view.glsl"
#include "ssao.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(push_constant) uniform Push {
  ivec2 reach;  // pixels to each side
  int source;
  int reserved;
} push;

vec3 normal_view(ivec2 full) { return mat3(camera.view_from_rel) * decode_octahedral(fetch_normal_geometric(full).xy); }

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  ivec2 size = size_noisy();
  if (any(greaterThanEqual(pixel, size))) return;
  vec2 center = imageLoad(noisy, ivec3(pixel, push.source)).xy;
  ivec2 full = representative(pixel, constant_evaluate_divisor, size_depth());
  float depth = fetch_depth(full).x;
  bool has_surface = !is_background(depth);
  vec3 position = position_view_from_depth(camera, pixel_center(full), has_surface ? depth : 1.0);
  vec3 n = normal_view(full);
  // A pixel's own plane is known no better than a pixel's size.
  float plane_tolerance =
      max(params.blur_distance * params.radius, pixel_size_at_depth(camera, depth) * float(constant_evaluate_divisor));
  float depth_tolerance = max(params.blur_distance * params.radius, 0.02 * depth);

  vec2 sum = vec2(0.0);
  float weights = 0.0;
  for (int y = -push.reach.y; y <= push.reach.y; ++y) {
    for (int x = -push.reach.x; x <= push.reach.x; ++x) {
      ivec2 neighbour = pixel + ivec2(x, y);
      if (any(lessThan(neighbour, ivec2(0))) || any(greaterThanEqual(neighbour, size))) continue;
      float weight = gaussian(float(x), params.blur_sigma) * gaussian(float(y), params.blur_sigma);
      if (constant_blur != kBlurPlain && (x != 0 || y != 0)) {
        ivec2 neighbour_full = representative(neighbour, constant_evaluate_divisor, size_depth());
        float neighbour_depth = fetch_depth(neighbour_full).x;
        if (is_background(neighbour_depth)) continue;
        vec3 offset = position_view_from_depth(camera, pixel_center(neighbour_full), neighbour_depth) - position;
        weight *= constant_blur_edges == 0u ? is_same_plane(offset, n, plane_tolerance)
                                            : is_same_depth(neighbour_depth - depth, depth_tolerance);
        weight *= is_same_normal(n, normal_view(neighbour_full), params.blur_normal);
      }
      sum += weight * imageLoad(noisy, ivec3(neighbour, push.source)).xy;
      weights += weight;
    }
  }
  // The pixel itself has weight 1.
  vec2 blurred = has_surface ? sum / weights : center;
  imageStore(noisy, ivec3(pixel, 1 - push.source), vec4(blurred, 0.0, 0.0));
}
