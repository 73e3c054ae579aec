// SPDX-License-Identifier: Apache-2.0
// 64 x 64 colours: sixteen values of red along x, of green along y, of blue from block to block; 0 and powers of two.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

float value_of(int index) {
  return index == 0 ? 0.0 : exp2(params.lowest + (params.highest - params.lowest) * float(index - 1) / 14.0);
}

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_values()))) return;
  int blue = (pixel.x / 16 + 4 * (pixel.y / 16)) & 15;
  imageStore(values, pixel, vec4(value_of(pixel.x & 15), value_of(pixel.y & 15), value_of(blue), 1.0));
}
