// SPDX-License-Identifier: Apache-2.0
// Radiance along a ray through the air, over the sun's illuminance: equation (2) of the README, with what the tables
// answer given by the includer as
//   vec3 sun_transmittance(float height, float mu)       top of the air to a point, 0 behind the ground
//   vec3 multiple_scattering(float height, float mu_sun) equation (6), isotropic source per unit of scattering, 1/sr
// before this file.
#ifndef HEDDLE_SKY_RADIANCE_GLSL
#define HEDDLE_SKY_RADIANCE_GLSL

// nu: cosine between ray and sun; ground_source: radiance of the ground where the ray ends without the sun's own light
// on it (sky light), over the sun's illuminance.
vec3 radiance_along_ray(float height, float mu, float mu_sun, float nu, bool is_ground, vec3 ground_albedo,
                        vec3 ground_source, float mie_density, int steps) {
  float end = is_ground ? distance_to_ground(height, mu) : distance_to_top(height, mu);
  float rayleigh_phase = phase_rayleigh(nu);
  float mie_phase = phase_mie(nu);
  vec3 transmittance = vec3(1.0);
  vec3 radiance = vec3(0.0);
  for (int i = 0; i < steps; ++i) {
    // Stretches grow with the distance: the air is densest near a viewer on the ground.
    float x0 = float(i) / float(steps);
    float x1 = float(i + 1) / float(steps);
    float t = 0.5 * end * (x0 * x0 + x1 * x1);
    float dt = end * (x1 * x1 - x0 * x0);
    float h = height_along(height, mu, t);
    float local_mu_sun = mu_along(height, mu_sun, nu, t, h);
    Medium medium = medium_at(h, mie_density);
    vec3 once = (medium.rayleigh * rayleigh_phase + vec3(medium.mie_scattering * mie_phase)) *
                sun_transmittance(h, local_mu_sun);
    vec3 more = (medium.rayleigh + vec3(medium.mie_scattering)) * multiple_scattering(h, local_mu_sun);
    radiance += transmittance * (once + more) * stretch_weight(medium.extinction, dt);
    transmittance *= exp(-medium.extinction * dt);
  }
  if (is_ground) {
    float ground_mu_sun = mu_along(height, mu_sun, nu, end, 0.0);
    vec3 lit = ground_albedo / kSkyPi * max(ground_mu_sun, 0.0) * sun_transmittance(0.0, ground_mu_sun);
    radiance += transmittance * (lit + ground_source);
  }
  return radiance;
}

#endif
