// SPDX-License-Identifier: Apache-2.0
// Sky map -> irradiance on planes of every orientation, over the sun's illuminance.
// threads 8x8, one a texel; loop over sixteen times `filter_samples` (<= 32768)
#include "pass.glsl"
#include "sky_mapping.glsl"
#include "filter.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
  ivec2 size = size_irradiance();
  if (texel.x >= size.x || texel.y >= size.y) return;
  float horizon = horizon_elevation(params.altitude * 1e-3);
  vec3 N = sky_direction(filtered_angles(texel, false, vec2(size)));
  vec3 sum = vec3(0.0);
  uint count = 16u * uint(params.filter_samples);
  for (uint i = 0u; i < count; ++i) {
    vec2 u = hammersley(i, count);
    vec3 L = around(N, sqrt(1.0 - u.x), u.y);
    sum += sample_sky_map(sky_map_coordinate(sky_angles(L, 0.0), horizon, vec2(size_sky_map()))).rgb;
  }
  imageStore(irradiance, texel, vec4(sum * (kSkyPi / float(count)), 1.0));
}
