// SPDX-License-Identifier: Apache-2.0
// Values of this frame and the last -> a pixel each.
#include "pass.glsl"

layout(local_size_x = 8) in;
layout(push_constant) uniform Push { vec4 moved; } push;

void main() {
  if (gl_GlobalInvocationID.x != 0u) return;
  imageStore(color, ivec2(0, 0), vec4(camera.half_size, last_camera.half_size));
  imageStore(color, ivec2(1, 0), vec4(float(last_lights.length())));
  imageStore(color, ivec2(2, 0), vec4(frames.x, frames.y, last_frames.x, 0.0));
  imageStore(color, ivec2(3, 0), push.moved);
}
