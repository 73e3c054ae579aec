// SPDX-License-Identifier: Apache-2.0
// What the CPU saw -> a picture of one colour.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (all(lessThan(pixel, size_color()))) imageStore(color, pixel, seen);
}
