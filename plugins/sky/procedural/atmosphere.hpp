// SPDX-License-Identifier: Apache-2.0
// The shaders' own functions in float64: atmosphere.glsl, read as C++. For the sun's light, and for tests.
#pragma once

#include <cmath>
#include <glm/glm.hpp>

namespace sky_float64 {

using namespace glm;
using vec2 = dvec2;
using vec3 = dvec3;

#define float double
#include "sky_mapping.glsl"
#undef float

/// Share of the sun's light that reaches a point `height` km up, with the sun at cosine `mu` to the zenith.
inline vec3 sun_transmittance(double height, double mu, double mie_density) {
  // The sun's centre may be just below the horizon while a part of its disc is above: the ray then grazes the ground.
  const double grazing = max(mu, horizon_mu(height));
  constexpr int kSteps = 1000;
  return exp(-optical_depth(height, grazing, distance_to_top(height, grazing), mie_density, kSteps)) *
         sun_above_horizon(height, mu);
}

}  // namespace sky_float64
