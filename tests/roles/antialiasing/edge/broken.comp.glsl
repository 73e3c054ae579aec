// SPDX-License-Identifier: Apache-2.0
// Column 0: NaN in the left half of the pixel; 1: +Inf; 2: -Inf; 3: NaN in one component; 4: NaN always; 5: Inf always;
// elsewhere 3. The right half of the pixel shows 3 in columns 0 to 3.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_radiance()))) return;
  float nan = uintBitsToFloat(0x7fc00000u);
  float inf = uintBitsToFloat(0x7f800000u);
  bool is_left = -camera.jitter.x < 0.0;
  vec4 value = vec4(3.0);
  if (pixel.x == 0 && is_left) value = vec4(nan);
  if (pixel.x == 1 && is_left) value = vec4(inf);
  if (pixel.x == 2 && is_left) value = vec4(-inf);
  if (pixel.x == 3 && is_left) value = vec4(7.0, nan, 7.0, 7.0);
  if (pixel.x == 4) value = vec4(nan);
  if (pixel.x == 5) value = vec4(inf);
  imageStore(radiance, pixel, value);
}
