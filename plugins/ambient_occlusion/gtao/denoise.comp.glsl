// SPDX-License-Identifier: Apache-2.0
// Noisy visibility -> visibility: the mean of one tile of the noise, over pixels of the same plane; README equation (8).
// in      noisy             r16   visibility, 1 = open
//         depth             r32f  distance along the view axis, metres; +inf where there is no surface
//         normal_geometric  octahedral, world axes
// out     visibility        r16   1 where there is no surface
// params  denoise
// loops   5 x 5
#include "pass.glsl"
#include "octahedral.glsl"
#include "view.glsl"
#include "gtao.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  ivec2 size = size_visibility();
  if (any(greaterThanEqual(pixel, size))) return;
  float depth = fetch_depth(pixel).x;
  float center = fetch_noisy(pixel).x;
  if (!constant_denoise || is_background(depth)) {
    imageStore(visibility, pixel, vec4(center));
    return;
  }
  vec3 position = position_view_from_depth(camera, pixel_center(pixel), depth);
  vec3 n = mat3(camera.view_from_rel) * decode_octahedral(fetch_normal_geometric(pixel).xy);
  float pixel_size = pixel_size_at_depth(camera, depth);

  float sum = 0.0;
  float weights = 0.0;
  for (int y = -2; y <= 2; ++y) {
    for (int x = -2; x <= 2; ++x) {
      ivec2 neighbour = pixel + ivec2(x, y);
      bool is_inside = all(greaterThanEqual(neighbour, ivec2(0))) && all(lessThan(neighbour, size));
      ivec2 inside = clamp(neighbour, ivec2(0), size - 1);
      float neighbour_depth = fetch_depth(inside).x;
      if (!is_inside || is_background(neighbour_depth)) continue;
      vec3 offset = position_view_from_depth(camera, pixel_center(inside), neighbour_depth) - position;
      float weight = denoise_weight(x, y) * plane_weight(offset, n, pixel_size);
      sum += weight * fetch_noisy(inside).x;
      weights += weight;
    }
  }
  // The pixel itself has weight 1.
  imageStore(visibility, pixel, vec4(sum / weights));
}
