// SPDX-License-Identifier: Apache-2.0
// A half plane in each pixel, of another direction and distance -> 1 where the sample is in it. g: a vertical edge.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_radiance()))) return;
  vec2 offset = -camera.jitter;  // of the sample from the pixel's centre
  float number = float(pixel.y * size_radiance().x + pixel.x);
  float angle = 6.28318530717958648 * fract(number * 0.61803398875);
  float distance = fract(number * 0.41421356237) - 0.5;
  float edge = (float(pixel.x) + 0.5) / float(size_radiance().x) - 0.5;
  bool is_inside = dot(vec2(cos(angle), sin(angle)), offset) > distance;
  imageStore(radiance, pixel, vec4(is_inside ? 1.0 : 0.0, offset.x > edge ? 1.0 : 0.0, angle, distance));
}
