// SPDX-License-Identifier: Apache-2.0
// Transmittance -> light that was scattered twice and more, as an isotropic source. Hillaire 2020, equations (5) to (10);
// README equations (5) and (6).
// out     multiple_scattering_table  x: cosine of the sun to the zenith, -1..1; y: height
// threads 8x8, one a texel; loops over kDirections x kSteps
#include "pass.glsl"
#include "atmosphere.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

const int kDirections = 64;
const int kSteps = 24;

vec3 sun_transmittance(float height, float mu) {
  vec2 size = vec2(size_transmittance());
  vec2 coordinate = transmittance_coordinate(height, mu);
  vec2 uv = vec2(table_coordinate(coordinate.x, size.x), table_coordinate(coordinate.y, size.y));
  return sample_transmittance(uv).rgb * sun_above_horizon(height, mu);
}

void main() {
  ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
  ivec2 size = size_multiple_scattering_table();
  if (texel.x >= size.x || texel.y >= size.y) return;
  float mu_sun = 2.0 * table_fraction(float(texel.x), float(size.x)) - 1.0;
  // Not quite on the ground and not quite at the top, where rays have no length.
  float height = clamp(table_fraction(float(texel.y), float(size.y)) * SKY_THICKNESS, 1e-3, SKY_THICKNESS - 1e-3);
  float sine_sun = sqrt(max(1.0 - mu_sun * mu_sun, 0.0));

  vec3 second_order = vec3(0.0);  // equation (5), mean over directions
  vec3 transfer = vec3(0.0);      // the share that comes back for one more scattering
  for (int d = 0; d < kDirections; ++d) {
    // Fibonacci points: equal areas on the sphere.
    float mu = 1.0 - (2.0 * float(d) + 1.0) / float(kDirections);
    float nu = mu * mu_sun + sqrt(1.0 - mu * mu) * sine_sun * cos(2.39996323 * float(d));
    bool is_ground = mu < horizon_mu(height);
    float end = is_ground ? distance_to_ground(height, mu) : distance_to_top(height, mu);
    vec3 transmittance_so_far = vec3(1.0);
    for (int i = 0; i < kSteps; ++i) {
      float x0 = float(i) / float(kSteps);
      float x1 = float(i + 1) / float(kSteps);
      float t = 0.5 * end * (x0 * x0 + x1 * x1);
      float dt = end * (x1 * x1 - x0 * x0);
      float h = height_along(height, mu, t);
      Medium medium = medium_at(h, params.mie_density);
      vec3 scattering = medium.rayleigh + vec3(medium.mie_scattering);
      vec3 weight = transmittance_so_far * scattering * stretch_weight(medium.extinction, dt);
      second_order += weight * sun_transmittance(h, mu_along(height, mu_sun, nu, t, h)) / (4.0 * kSkyPi);
      transfer += weight;
      transmittance_so_far *= exp(-medium.extinction * dt);
    }
    if (is_ground) {
      float ground_mu = mu_along(height, mu_sun, nu, end, 0.0);
      second_order += transmittance_so_far * params.ground_albedo / kSkyPi * max(ground_mu, 0.0) *
                      sun_transmittance(0.0, ground_mu);
    }
  }
  second_order /= float(kDirections);
  transfer /= float(kDirections);
  imageStore(multiple_scattering_table, texel, vec4(second_order / (vec3(1.0) - transfer), 1.0));
}
