// SPDX-License-Identifier: Apache-2.0
// Pixels that are worth work -> a list of (x + 65536 y, what is drawn there), and a picture of them.
#include "pass.glsl"
#include "choose.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  uvec2 pixel = gl_GlobalInvocationID.xy;
  if (any(greaterThanEqual(pixel, uvec2(size_color())))) return;
  uint value = hash(pixel, uint(params.salt));
  bool chosen = is_chosen(value, params.share);
  if (chosen) append_pixels(uvec2(pixel.x | pixel.y << 16u, value % 256u + 1u));
  imageStore(color, ivec2(pixel), vec4(chosen ? float(value % 256u + 1u) : 0.0));
}
