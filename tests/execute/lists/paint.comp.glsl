// SPDX-License-Identifier: Apache-2.0
// The frame's index -> column `index` of a canvas that keeps all columns before.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(push_constant) uniform Push { uint frame; } push;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_canvas()))) return;
  if (pixel.x == int(push.frame)) imageStore(canvas, pixel, vec4(float(push.frame) + 1.0));
}
