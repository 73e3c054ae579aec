// SPDX-License-Identifier: Apache-2.0
// Each pixel of the list -> what is drawn there; nothing else is touched.
#include "pass.glsl"

layout(local_size_x = 8) in;

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= count_pixels()) return;
  uvec2 found = pixels[i];
  imageStore(color, ivec2(found.x & 0xffffu, found.x >> 16u), vec4(float(found.y)));
}
