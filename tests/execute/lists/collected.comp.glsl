// SPDX-License-Identifier: Apache-2.0
// All elements of all frames -> how many, how many of each frame, in the first row and the second.
#include "pass.glsl"

layout(local_size_x = 8) in;

void main() {
  uint frame = gl_GlobalInvocationID.x;
  if (frame >= uint(size_color().x)) return;
  uint count = 0u;
  uint sum = 0u;
  for (uint i = 0u; i < count_pixels(); ++i) {
    if (pixels[i].x != frame) continue;
    ++count;
    sum += pixels[i].y;
  }
  for (int y = 0; y < size_color().y; ++y) imageStore(color, ivec2(frame, y), vec4(count_pixels(), count, sum, capacity_pixels()));
}
