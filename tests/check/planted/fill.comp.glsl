// SPDX-License-Identifier: Apache-2.0
// params.value everywhere, or where params.where says; at pixel (5, 3) what params.spot says.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_color()))) return;
  if (params.where == 1u && pixel.x >= size_color().x / 2) return;
  float value = params.value;
  if (pixel == ivec2(5, 3)) {
    if (params.spot == 1u) value = uintBitsToFloat(0x7fc00000u);
    if (params.spot == 2u) value = uintBitsToFloat(0x7f800000u);
    if (params.spot == 3u) value = -1.0;
  }
  imageStore(color, pixel, vec4(value));
}
