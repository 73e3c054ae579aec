// SPDX-License-Identifier: Apache-2.0
// Air, rays through it, and phase functions: pure functions, no bindings. Kilometres; heights are above the ground and
// not distances from the centre, which would leave half a metre of precision; mu is the cosine to the zenith.
// Equation numbers are the README's.
#ifndef HEDDLE_SKY_ATMOSPHERE_GLSL
#define HEDDLE_SKY_ATMOSPHERE_GLSL
#include "atmosphere_constants.h"

const float kSkyPi = 3.14159265358979324;

struct Medium {
  vec3 rayleigh;          // scattering = extinction, 1/km
  float mie_scattering;   // 1/km
  vec3 extinction;        // all three, 1/km
};

Medium medium_at(float height, float mie_density) {
  float mie = mie_density * exp(-height / SKY_MIE_HEIGHT);
  float ozone = max(1.0 - abs(height - SKY_OZONE_CENTRE) / SKY_OZONE_HALF_WIDTH, 0.0);
  Medium medium;
  medium.rayleigh = vec3(SKY_RAYLEIGH_R, SKY_RAYLEIGH_G, SKY_RAYLEIGH_B) * exp(-height / SKY_RAYLEIGH_HEIGHT);
  medium.mie_scattering = SKY_MIE_SCATTERING * mie;
  medium.extinction = medium.rayleigh + vec3(SKY_MIE_EXTINCTION * mie) +
                      vec3(SKY_OZONE_R, SKY_OZONE_G, SKY_OZONE_B) * ozone;
  return medium;
}

// Distance to the top of the air; from inside it.
float distance_to_top(float height, float mu) {
  float b = (SKY_GROUND_RADIUS + height) * mu;
  float c = (SKY_THICKNESS - height) * (2.0 * SKY_GROUND_RADIUS + SKY_THICKNESS + height);
  float root = sqrt(b * b + c);
  // The form without cancellation for either sign.
  return b > 0.0 ? c / (b + root) : root - b;
}

// Distance to the ground for a ray that is known to go down to it.
float distance_to_ground(float height, float mu) {
  float b = (SKY_GROUND_RADIUS + height) * mu;
  float c = height * (2.0 * SKY_GROUND_RADIUS + height);
  float root = sqrt(max(b * b - c, 0.0));
  return c > 0.0 ? c / (root - b) : 0.0;
}

// Cosine to the zenith of the horizon: below it rays end on the ground.
float horizon_mu(float height) {
  return -sqrt(height * (2.0 * SKY_GROUND_RADIUS + height)) / (SKY_GROUND_RADIUS + height);
}

float horizon_elevation(float height) {
  float mu = horizon_mu(height);
  return atan(mu, sqrt(1.0 - mu * mu));
}

float height_along(float height, float mu, float t) {
  float radius = SKY_GROUND_RADIUS + height;
  float above = height * (2.0 * SKY_GROUND_RADIUS + height) + t * (2.0 * radius * mu + t);
  return max(above / (SKY_GROUND_RADIUS + sqrt(max(SKY_GROUND_RADIUS * SKY_GROUND_RADIUS + above, 0.0))), 0.0);
}

// Cosine to the local zenith, t along a ray, of a direction that has cosine mu_other to the zenith where the ray starts
// and cosine nu to the ray.
float mu_along(float height, float mu_other, float nu, float t, float new_height) {
  return clamp(((SKY_GROUND_RADIUS + height) * mu_other + t * nu) / (SKY_GROUND_RADIUS + new_height), -1.0, 1.0);
}

// Equation (1): extinction summed along a ray, midpoint rule.
vec3 optical_depth(float height, float mu, float end, float mie_density, int steps) {
  float dt = end / float(steps);
  vec3 sum = vec3(0.0);
  for (int i = 0; i < steps; ++i) {
    sum += medium_at(height_along(height, mu, (float(i) + 0.5) * dt), mie_density).extinction;
  }
  return sum * dt;
}

// Share of the sun's disc above the horizon, smoothed.
float sun_above_horizon(float height, float mu_sun) {
  float below = horizon_mu(height);
  float width = SKY_SUN_RADIUS * sqrt(1.0 - below * below);
  float t = clamp((mu_sun - below + width) / (2.0 * width), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

// Equation (3), 1/sr.
float phase_rayleigh(float nu) { return 3.0 / (16.0 * kSkyPi) * (1.0 + nu * nu); }

// Equation (4), 1/sr: Cornette and Shanks 1992.
float phase_mie(float nu) {
  float g = SKY_MIE_ANISOTROPY;
  float base = max(1.0 + g * g - 2.0 * g * nu, 1e-4);
  return 3.0 / (8.0 * kSkyPi) * (1.0 - g * g) * (1.0 + nu * nu) / ((2.0 + g * g) * base * sqrt(base));
}

// Light that a stretch dt of even medium sends on, over its source: (1 - exp(-sigma dt)) / sigma, also for sigma 0.
vec3 stretch_weight(vec3 extinction, float dt) {
  vec3 depth = extinction * dt;
  vec3 exact = (vec3(1.0) - exp(-depth)) / max(extinction, vec3(1e-12));
  vec3 series = dt * (vec3(1.0) - 0.5 * depth);
  return vec3(depth.x < 1e-3 ? series.x : exact.x, depth.y < 1e-3 ? series.y : exact.y,
              depth.z < 1e-3 ? series.z : exact.z);
}

// ---- tables ---------------------------------------------------------------------------------------------------------
// Texture coordinates that put 0 and 1 on the centres of the first and last texel.
float table_coordinate(float x, float size) { return (0.5 + clamp(x, 0.0, 1.0) * (size - 1.0)) / size; }
float table_fraction(float index, float size) { return index / (size - 1.0); }

// Bruneton and Neyret 2008, section 4: height and mu of a ray that misses the ground <-> [0, 1]^2, fine at the horizon.
vec2 transmittance_coordinate(float height, float mu) {
  float rho_top = sqrt(SKY_THICKNESS * (2.0 * SKY_GROUND_RADIUS + SKY_THICKNESS));
  float rho = sqrt(max(height * (2.0 * SKY_GROUND_RADIUS + height), 0.0));
  float shortest = SKY_THICKNESS - height;
  float x = (distance_to_top(height, mu) - shortest) / (rho + rho_top - shortest);
  return clamp(vec2(x, rho / rho_top), vec2(0.0), vec2(1.0));
}
// x: height, y: mu.
vec2 transmittance_ray(vec2 coordinate) {
  float rho_top = sqrt(SKY_THICKNESS * (2.0 * SKY_GROUND_RADIUS + SKY_THICKNESS));
  float rho = rho_top * coordinate.y;
  float radius = sqrt(SKY_GROUND_RADIUS * SKY_GROUND_RADIUS + rho * rho);
  float height = min(rho * rho / (radius + SKY_GROUND_RADIUS), SKY_THICKNESS);
  float shortest = SKY_THICKNESS - height;
  float d = shortest + coordinate.x * (rho + rho_top - shortest);
  float mu = d > 0.0 ? (rho_top * rho_top - rho * rho - d * d) / (2.0 * radius * d) : 1.0;
  return vec2(height, clamp(mu, -1.0, 1.0));
}

#endif
