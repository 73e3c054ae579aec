// SPDX-License-Identifier: Apache-2.0
// The frame's index -> 3 index + i, in a buffer and as a picture.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(push_constant) uniform Push { uint frame; } push;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_numbers()))) return;
  uint number = 3u * push.frame + uint(pixel.x);
  if (pixel.y == 0 && pixel.x < 16) made[pixel.x] = number;
  imageStore(numbers, pixel, vec4(float(number)));
}
