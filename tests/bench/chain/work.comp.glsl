// SPDX-License-Identifier: Apache-2.0
// params.iterations steps of the logistic map at every pixel, from what the pass before left there. The parameter's range
// keeps the loop below the 65,535 iterations after which lavapipe ends all loops.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_result()))) return;
  float x = 0.5 + 0.25 * fetch_previous(pixel).r;
  for (int i = 0; i < params.iterations; ++i) x = 3.5 * x * (1.0 - x);
  imageStore(result, pixel, vec4(x));
}
