// SPDX-License-Identifier: Apache-2.0
// Mie density -> transmittance from a height to the top of the air, for rays that miss the ground.
// out     transmittance   x, y as transmittance_coordinate
// threads 8x8, one a texel; loop of kSteps
#include "pass.glsl"
#include "atmosphere.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

// The longest ray, 1130 km, in stretches of 9 km: small against the 200 km in which the air at the horizon thins out.
const int kSteps = 128;

void main() {
  ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
  ivec2 size = size_transmittance();
  if (texel.x >= size.x || texel.y >= size.y) return;
  vec2 coordinate = vec2(table_fraction(float(texel.x), float(size.x)), table_fraction(float(texel.y), float(size.y)));
  vec2 ray = transmittance_ray(coordinate);
  vec3 depth = optical_depth(ray.x, ray.y, distance_to_top(ray.x, ray.y), params.mie_density, kSteps);
  imageStore(transmittance, texel, vec4(exp(-depth), 1.0));
}
