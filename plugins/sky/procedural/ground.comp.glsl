// SPDX-License-Identifier: Apache-2.0
// Tables -> irradiance of flat ground from the sky without the sun, over the sun's illuminance: one texel.
// threads 64, together over kStrata x kStrata directions
#include "pass.glsl"
#include "atmosphere.glsl"
#include "tables.glsl"
#include "radiance.glsl"

layout(local_size_x = 64) in;

const int kStrata = 16;
const int kSteps = 16;
shared vec3 partial_sums[64];

void main() {
  int thread = int(gl_LocalInvocationID.x);
  float mu_sun = sin(params.sun_elevation);
  float sine_sun = cos(params.sun_elevation);
  vec3 sum = vec3(0.0);
  for (int k = thread; k < kStrata * kStrata; k += 64) {
    // Even in the square of mu: cosine-weighted, so the mean of radiance is irradiance over pi.
    float mu = sqrt((float(k / kStrata) + 0.5) / float(kStrata));
    float azimuth = (float(k % kStrata) + 0.5) / float(kStrata) * kSkyPi;
    float nu = mu * mu_sun + sqrt(1.0 - mu * mu) * sine_sun * cos(azimuth);
    sum += radiance_along_ray(0.0, mu, mu_sun, nu, false, vec3(0.0), vec3(0.0), params.mie_density, kSteps);
  }
  partial_sums[thread] = sum;
  barrier();
  if (thread == 0) {
    vec3 total = vec3(0.0);
    for (int i = 0; i < 64; ++i) total += partial_sums[i];
    imageStore(ground_irradiance, ivec2(0), vec4(total * (kSkyPi / float(kStrata * kStrata)), 1.0));
  }
}
