// SPDX-License-Identifier: Apache-2.0
// in      first, second   neutral where unbound
// out     image           their sum, plus 1
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_image()))) return;
  imageStore(image, pixel, fetch_first(pixel) + fetch_second(pixel) + 1.0);
}
