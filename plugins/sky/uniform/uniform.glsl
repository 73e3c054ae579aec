// SPDX-License-Identifier: Apache-2.0
// The same radiance from every direction: exact in all three functions.

const float kUniformSkyPi = 3.14159265358979324;

vec3 sky_radiance(vec3 direction) { return params.radiance; }

vec3 sky_irradiance(vec3 normal) { return kUniformSkyPi * params.radiance; }

vec3 sky_specular(vec3 direction, float alpha) { return params.radiance; }
