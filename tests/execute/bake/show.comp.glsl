// SPDX-License-Identifier: Apache-2.0
// What a cached stage left in its three kinds of outputs -> a picture of one colour.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (all(lessThan(pixel, size_color()))) imageStore(color, pixel, vec4(total.x, texelFetch(table, ivec2(1, 0), 0).x, list[1], list[2]));
}
