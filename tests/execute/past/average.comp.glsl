// SPDX-License-Identifier: Apache-2.0
// Last frame's average and a value -> this frame's average.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_color()))) return;
  vec4 history = fetch_history(pixel);
  imageStore(color, pixel, history + params.weight * (vec4(params.value) - history));
}
