// SPDX-License-Identifier: Apache-2.0
// What radiance.glsl asks for, answered from the images `transmittance` and `multiple_scattering_table`.
#ifndef HEDDLE_SKY_TABLES_GLSL
#define HEDDLE_SKY_TABLES_GLSL

vec3 sun_transmittance(float height, float mu) {
  vec2 size = vec2(size_transmittance());
  vec2 coordinate = transmittance_coordinate(height, mu);
  vec2 uv = vec2(table_coordinate(coordinate.x, size.x), table_coordinate(coordinate.y, size.y));
  return sample_transmittance(uv).rgb * sun_above_horizon(height, mu);
}

vec3 multiple_scattering(float height, float mu_sun) {
  if (params.multiple_scattering == 0u) return vec3(0.0);
  vec2 size = vec2(size_multiple_scattering_table());
  vec2 uv = vec2(table_coordinate(0.5 * mu_sun + 0.5, size.x), table_coordinate(height / SKY_THICKNESS, size.y));
  return sample_multiple_scattering_table(uv).rgb;
}

#endif
