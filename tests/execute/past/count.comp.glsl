// SPDX-License-Identifier: Apache-2.0
// Last frame's counts -> this frame's, and their picture.
#include "pass.glsl"

layout(local_size_x = 8) in;

void main() {
  uint i = gl_GlobalInvocationID.x;
  counts[i] = last_counts[i] + i + 1u;
  imageStore(color, ivec2(i, 0), vec4(float(last_counts[i] + i + 1u)));
}
