// SPDX-License-Identifier: Apache-2.0
// Numbers over many powers of two, with all kinds of fractions, the same in every sample.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_radiance()))) return;
  float value = exp2(float(pixel.x) - 40.0) * (1.0 + float(pixel.y) / 97.0);
  imageStore(radiance, pixel, vec4(value, value / 3.0, 0.1, 1.0));
}
