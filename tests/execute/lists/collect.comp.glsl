// SPDX-License-Identifier: Apache-2.0
// The frame's index -> as many elements as params.share says, behind those of all frames before.
#include "pass.glsl"

layout(local_size_x = 8) in;
layout(push_constant) uniform Push { uint frame; } push;

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i < uint(params.share)) append_pixels(uvec2(push.frame, i));
}
