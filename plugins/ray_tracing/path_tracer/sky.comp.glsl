// SPDX-License-Identifier: Apache-2.0
// The graph's sky -> an equirectangular image of it, for the CPU: whatever techniques answer sky_radiance.
// out     sky_map  rgba32f  cd/m^2; -Z in the middle, +X to the right of it, top row +Y
// threads 8x8, one a texel
#include "pass.glsl"
#include "role/sky.glsl"
#include "constants.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
  ivec2 size = size_sky_map();
  if (texel.x >= size.x || texel.y >= size.y) return;
  vec2 uv = (vec2(texel) + 0.5) / vec2(size);
  float azimuth = (uv.x - 0.5) * 2.0 * kPi, polar = uv.y * kPi;
  vec3 direction = vec3(sin(polar) * sin(azimuth), cos(polar), -sin(polar) * cos(azimuth));
  imageStore(sky_map, texel, vec4(sky_radiance(direction), 1.0));
}
