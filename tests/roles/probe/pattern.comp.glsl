// SPDX-License-Identifier: Apache-2.0
// Numbers that techniques must survive, a column each: NaN, +Inf, -Inf, -1, 0, `white`, 1e-30, then a ramp to `white`.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_values()))) return;
  float value = params.white * float(pixel.x) / float(size_values().x - 1);
  if (pixel.x == 0) value = uintBitsToFloat(0x7fc00000u);
  if (pixel.x == 1) value = uintBitsToFloat(0x7f800000u);
  if (pixel.x == 2) value = uintBitsToFloat(0xff800000u);
  if (pixel.x == 3) value = -1.0;
  if (pixel.x == 4) value = 0.0;
  if (pixel.x == 5) value = params.white;
  if (pixel.x == 6) value = 1e-30;
  imageStore(values, pixel, vec4(value));
}
