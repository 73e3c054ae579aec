// SPDX-License-Identifier: Apache-2.0
// An image -> its copy.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_color()))) return;
  imageStore(color, pixel, fetch_image(pixel));
}
