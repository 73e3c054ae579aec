// SPDX-License-Identifier: Apache-2.0
// Sky map -> radiance averaged over GGX lobes, a layer an alpha. Karis 2013, "Real Shading in Unreal Engine 4": N = V = R,
// weighted by NoL.
// threads 8x8x1, one a texel; loop over `filter_samples`
#include "pass.glsl"
#include "sky_mapping.glsl"
#include "filter.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec3 texel = ivec3(gl_GlobalInvocationID);
  ivec2 size = size_specular().xy;
  if (texel.x >= size.x || texel.y >= size.y) return;
  float horizon = horizon_elevation(params.altitude * 1e-3);
  vec3 N = sky_direction(filtered_angles(texel.xy, true, vec2(size)));
  float alpha = specular_alpha(float(texel.z));
  vec3 sum = vec3(0.0);
  float weights = 0.0;
  uint count = uint(params.filter_samples);
  for (uint i = 0u; i < count; ++i) {
    vec2 u = hammersley(i, count);
    float NoH = ggx_half_cosine(alpha, u.x);
    vec3 H = around(N, NoH, u.y);
    vec3 L = 2.0 * NoH * H - N;
    float NoL = max(2.0 * NoH * NoH - 1.0, 0.0);
    sum += NoL * sample_sky_map(sky_map_coordinate(sky_angles(L, 0.0), horizon, vec2(size_sky_map()))).rgb;
    weights += NoL;
  }
  imageStore(specular, texel, vec4(sum / max(weights, 1e-6), 1.0));
}
