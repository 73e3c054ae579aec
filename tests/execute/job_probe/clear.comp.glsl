// SPDX-License-Identifier: Apache-2.0
// sums[i] = 0
#include "pass.glsl"

layout(local_size_x = 8) in;

void main() {
  if (gl_GlobalInvocationID.x < 8u) sums[gl_GlobalInvocationID.x] = 0u;
}
