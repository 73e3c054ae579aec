// SPDX-License-Identifier: Apache-2.0
// Directions: x azimuth from -Z over +X, 0 to 2 pi; y elevation, pi/2 to -pi/2 -> what the sky answers.
#include "pass.glsl"
#include "role/sky.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_values()))) return;
  vec2 uv = (vec2(pixel) + 0.5) / vec2(size_values());
  float elevation = (0.5 - uv.y) * 3.14159265358979324;
  float azimuth = uv.x * 6.28318530717958648;
  vec3 direction = vec3(sin(azimuth) * cos(elevation), sin(elevation), -cos(azimuth) * cos(elevation));
  vec3 answer = sky_radiance(direction);
  if (params.answer == 1u) answer = sky_irradiance(direction);
  if (params.answer == 2u) answer = sky_specular(direction, params.alpha);
  imageStore(values, pixel, vec4(answer, 1.0));
}
