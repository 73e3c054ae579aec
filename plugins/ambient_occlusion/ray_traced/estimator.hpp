// SPDX-License-Identifier: Apache-2.0
// A surface point -> its cosine-weighted visibility within a radius, README equations (1) to (4): Owen-scrambled Sobol
// points, cosine-weighted directions, sums in float64. Knows neither the host nor the ray tracer behind `trace`.
#pragma once

#include "hemisphere.hpp"
#include "owen_sobol.hpp"

#include <glm/glm.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

namespace heddle::ambient_occlusion {

/// How much a hit occludes, by its distance. The order is that of the parameter's choices.
enum class Falloff : std::uint32_t { kNone = 0, kLinear = 1 };

/// Weight of a hit, equation (2): 1 = occludes fully. A miss has infinite distance and weight 0.
inline double occlusion_weight(Falloff falloff, double distance, double radius) {
  if (!(distance < radius)) {
    return 0.0;
  }
  return falloff == Falloff::kLinear ? 1.0 - distance / radius : 1.0;
}

using sampling::basis_around;
using sampling::mix_bits;
using sampling::pixel_seed;
using sampling::sample_cosine_hemisphere;
using sampling::Sobol2;

/// Where rays start, and which way is up.
struct SurfacePoint {
  glm::dvec3 origin{0.0};        // moved off the surface already
  glm::dvec3 normal{0.0};        // unit; the hemisphere's pole
  glm::dvec3 facet_normal{0.0};  // unit, on the normal's side; directions below it enter the surface itself
};

/// As many rays as one call of the tracer takes.
inline constexpr std::uint32_t kBatch = 16;
struct RayBatch {
  std::uint32_t count = 0;
  std::array<glm::vec3, kBatch> direction{};  // unit
  std::array<float, kBatch> distance{};       // answer: metres to the hit; infinity = nothing within the radius
};

/// Equation (4). `trace(origin, radius, batch)` fills batch.distance; where fall-off is none any distance < radius will
/// do for a hit. The result depends on the arguments alone and lies in [0, 1].
template <class Trace>
double estimate_visibility(const SurfacePoint& point, double radius, Falloff falloff, std::uint32_t samples,
                           std::uint64_t seed, Trace&& trace) {
  const Sobol2 sobol(seed);
  const glm::dmat3 basis = basis_around(point.normal);
  double occlusion = 0.0;
  RayBatch batch;
  const auto flush = [&] {
    if (batch.count == 0) {
      return;
    }
    trace(point.origin, radius, batch);
    for (std::uint32_t i = 0; i < batch.count; ++i) {
      occlusion += occlusion_weight(falloff, static_cast<double>(batch.distance[i]), radius);
    }
    batch.count = 0;
  };
  for (std::uint32_t i = 0; i < samples; ++i) {
    const glm::dvec3 direction = basis * sample_cosine_hemisphere(sobol.point(i));
    if (glm::dot(direction, point.facet_normal) <= 0.0) {
      occlusion += occlusion_weight(falloff, 0.0, radius);
      continue;
    }
    batch.direction[batch.count++] = glm::vec3(direction);
    if (batch.count == kBatch) {
      flush();
    }
  }
  flush();
  return 1.0 - occlusion / static_cast<double>(samples);
}

}  // namespace heddle::ambient_occlusion
