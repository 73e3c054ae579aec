// SPDX-License-Identifier: Apache-2.0
// A surface point -> its cosine-weighted visibility within a radius, README equations (1) to (4): Owen-scrambled Sobol
// points, cosine-weighted directions, sums in float64. Knows neither the host nor the ray tracer behind `trace`.
#pragma once

#include <glm/glm.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

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

/// Finalizer of Steele, Lea and Flood 2014, "Fast Splittable Pseudorandom Number Generators" (SplitMix64).
inline std::uint64_t mix_bits(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31U);
}

inline std::uint32_t reverse_bits(std::uint32_t x) {
  x = ((x >> 1U) & 0x55555555U) | ((x & 0x55555555U) << 1U);
  x = ((x >> 2U) & 0x33333333U) | ((x & 0x33333333U) << 2U);
  x = ((x >> 4U) & 0x0f0f0f0fU) | ((x & 0x0f0f0f0fU) << 4U);
  x = ((x >> 8U) & 0x00ff00ffU) | ((x & 0x00ff00ffU) << 8U);
  return (x >> 16U) | (x << 16U);
}

/// Nested uniform (Owen) scrambling by a hash in which a bit changes higher bits only: Burley 2020, "Practical
/// Hash-based Owen Scrambling", with the multipliers of Vegdahl 2021, "Building a Better LK Hash".
inline std::uint32_t scramble_owen(std::uint32_t x, std::uint32_t seed) {
  x = reverse_bits(x);
  x ^= x * 0x3d20adeaU;
  x += seed;
  x *= (seed >> 16U) | 1U;
  x ^= x * 0x05526c56U;
  x ^= x * 0x53a22864U;
  return reverse_bits(x);
}

/// Point `index` of the first two Sobol dimensions, scrambled: in (0, 1)^2. Sobol 1967; the second dimension belongs to
/// the polynomial x + 1, whose direction numbers follow from one another by v ^= v >> 1.
class Sobol2 {
 public:
  explicit Sobol2(std::uint64_t seed)
      : seed_x_(static_cast<std::uint32_t>(mix_bits(seed))),
        seed_y_(static_cast<std::uint32_t>(mix_bits(seed) >> 32U)) {}

  [[nodiscard]] glm::dvec2 point(std::uint32_t index) const {
    std::uint32_t y = 0;
    for (std::uint32_t bits = index, v = 1U << 31U; bits != 0; bits >>= 1U, v ^= v >> 1U) {
      y ^= (bits & 1U) != 0 ? v : 0U;
    }
    return {unit(scramble_owen(reverse_bits(index), seed_x_)), unit(scramble_owen(y, seed_y_))};
  }

 private:
  /// Middle of the interval of 2^-32 that the bits name: never 0, never 1.
  static double unit(std::uint32_t bits) { return (static_cast<double>(bits) + 0.5) * 0x1p-32; }

  std::uint32_t seed_x_, seed_y_;
};

/// Seed of a pixel: a different scrambling for every pixel and every seed of the frame.
inline std::uint64_t pixel_seed(std::uint64_t seed, std::uint32_t x, std::uint32_t y) {
  return mix_bits(mix_bits(seed) ^ ((static_cast<std::uint64_t>(y) << 32U) | x));
}

/// [0,1)^2 -> the hemisphere around +Z with density cos(theta) / pi: the concentric map of Shirley and Chiu 1997, "A
/// Low Distortion Map Between Disk and Square", lifted (Malley's method).
inline glm::dvec3 sample_cosine_hemisphere(const glm::dvec2& u) {
  const double a = 2.0 * u.x - 1.0;
  const double b = 2.0 * u.y - 1.0;
  if (a == 0.0 && b == 0.0) {
    return {0.0, 0.0, 1.0};
  }
  const bool is_a = std::abs(a) > std::abs(b);
  const double r = is_a ? a : b;
  const double phi =
      is_a ? std::numbers::pi / 4.0 * (b / a) : std::numbers::pi / 2.0 - std::numbers::pi / 4.0 * (a / b);
  return {r * std::cos(phi), r * std::sin(phi), std::sqrt(std::fmax(0.0, 1.0 - r * r))};
}

/// Columns: tangent, bitangent, normal. Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
inline glm::dmat3 basis_around(const glm::dvec3& n) {
  const double sign = std::copysign(1.0, n.z);
  const double a = -1.0 / (sign + n.z);
  const double b = n.x * n.y * a;
  return {{1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}, n};
}

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
