// SPDX-License-Identifier: Apache-2.0
// Column -> what a text answers that the pass made.
#include "pass.glsl"
#include "generated/expression.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_values()))) return;
  imageStore(values, pixel, vec4(expression(float(pixel.x))));
}
