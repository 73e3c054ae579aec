// SPDX-License-Identifier: Apache-2.0
// 0.9 or 0.1, by chance, as samples of an edge between two greys are: 0.9 in (x + 1/2) / width of the samples.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(push_constant) uniform Push { uint index; } push;

// Jarzynski and Olano 2020, "Hash Functions for GPU Rendering": PCG.
uint pcg(uint value) {
  uint state = value * 747796405u + 2891336453u;
  uint word = ((state >> ((state >> 28) + 4u)) ^ state) * 277803737u;
  return (word >> 22) ^ word;
}

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_radiance()))) return;
  uint chance = pcg(pcg(push.index) + uint(pixel.y * size_radiance().x + pixel.x)) >> 16;
  uint threshold = uint(pixel.x * 2 + 1) * 65536u / uint(2 * size_radiance().x);
  imageStore(radiance, pixel, vec4(vec3(chance < threshold ? 0.9 : 0.1), 1.0));
}
