// SPDX-License-Identifier: Apache-2.0
// The canvas above last frame's, four rows of each, as far as they reach -> a picture; -1 beyond.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_color()))) return;
  vec4 shown = vec4(-1.0);
  if (pixel.y < 4 && pixel.x < size_canvas().x) shown = fetch_canvas(pixel);
  if (pixel.y >= 4 && pixel.x < size_last_canvas().x) shown = fetch_last_canvas(pixel - ivec2(0, 4));
  imageStore(color, pixel, shown);
}
