// SPDX-License-Identifier: Apache-2.0
// Nothing is summed yet.
// out     sums   zero
// threads 64, one an element
#include "pass.glsl"
#include "params.h"

layout(local_size_x = BAKE_GROUP_SIZE) in;
layout(push_constant) uniform Push { BakePush push; };

void main() {
  uint element = gl_GlobalInvocationID.x;
  if (element >= push.element_count) return;
  for (uint i = 0u; i < BAKE_VECTORS_PER_SUM; ++i) sums[BAKE_VECTORS_PER_SUM * element + i] = vec4(0.0);
}
