// SPDX-License-Identifier: Apache-2.0
// Element i of the list -> pixel i: the order shows.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  uvec2 pixel = gl_GlobalInvocationID.xy;
  if (any(greaterThanEqual(pixel, uvec2(size_color())))) return;
  uint i = pixel.y * uint(size_color().x) + pixel.x;
  vec4 shown = vec4(0.0);
  if (i < count_pixels()) shown = vec4(pixels[i].x & 0xffffu, pixels[i].x >> 16u, pixels[i].y, 1.0);
  imageStore(color, ivec2(pixel), shown);
}
