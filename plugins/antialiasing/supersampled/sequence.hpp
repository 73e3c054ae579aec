// SPDX-License-Identifier: Apache-2.0
// Number of a sample -> where in its pixel it is taken. Pure functions in float64; README equations (1) to (5).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace supersampled {

using Point = std::array<double, 2>;

enum class Sequence : std::uint32_t { kR2, kHalton, kRandom };
enum class Filter : std::uint32_t { kBox, kTent, kGaussian };

/// The reconstruction filter's standard deviation and where it is cut off, in pixels.
inline constexpr double kGaussianDeviation = 0.5;
inline constexpr double kGaussianRadius = 1.5;

inline double fraction(double x) {
  return x - std::floor(x);
}

/// (1): Roberts 2018. p is the plastic number, the root of p^3 = p + 1; the pair (1/p, 1/p^2) is the plane's analogue
/// of the golden ratio.
inline Point r2_point(std::uint32_t index) {
  constexpr double kPlastic = 1.32471795724474602596;
  const double i = index;
  return {fraction(0.5 + i / kPlastic), fraction(0.5 + i / (kPlastic * kPlastic))};
}

/// Digits of the index in a base, mirrored at the point.
inline double radical_inverse(std::uint32_t index, std::uint32_t base) {
  double result = 0;
  double scale = 1.0 / base;
  for (; index > 0; index /= base, scale /= base) result += scale * (index % base);
  return result;
}

/// (2): Halton 1960 in bases 2 and 3, turned by half a pixel so that sample 0 is the centre.
inline Point halton_point(std::uint32_t index) {
  return {fraction(0.5 + radical_inverse(index, 2)), fraction(0.5 + radical_inverse(index, 3))};
}

/// (3): Steele, Lea and Flood 2014, SplitMix64: the counter's bits, mixed.
inline double random_number(std::uint64_t counter) {
  std::uint64_t z = (counter + 1) * 0x9e3779b97f4a7c15ULL;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  z ^= z >> 31;
  return static_cast<double>(z >> 11) * 0x1p-53;
}

/// Independent points, but for sample 0 at the centre.
inline Point random_point(std::uint32_t index) {
  if (index == 0) return {0.5, 0.5};
  return {random_number(2ULL * index), random_number(2ULL * index + 1)};
}

inline Point unit_point(Sequence sequence, std::uint32_t index) {
  return sequence == Sequence::kR2       ? r2_point(index)
         : sequence == Sequence::kHalton ? halton_point(index)
                                         : random_point(index);
}

/// (5): from a number in [0, 1) to a distance with the filter's density; odd about 1/2, and 0 there.
inline double tent_offset(double u) {
  return u < 0.5 ? std::sqrt(2.0 * u) - 1.0 : 1.0 - std::sqrt(2.0 - 2.0 * u);
}

/// The inverse of a Gaussian's distribution between -radius and radius, by Newton steps kept in a shrinking interval.
inline double gaussian_offset(double u) {
  if (u == 0.5) return 0.0;
  const double to_erf = 1.0 / (kGaussianDeviation * std::numbers::sqrt2);
  const double whole = std::erf(kGaussianRadius * to_erf);
  const double target = (2.0 * u - 1.0) * whole;
  double low = -kGaussianRadius;
  double high = kGaussianRadius;
  double x = 0;
  for (int step = 0; step < 100 && high - low > 1e-15; ++step) {
    const double error = std::erf(x * to_erf) - target;
    (error < 0 ? low : high) = x;
    const double slope = 2.0 * to_erf / std::sqrt(std::numbers::pi) * std::exp(-x * x * to_erf * to_erf);
    const double newton = x - error / slope;
    const double next = newton > low && newton < high ? newton : 0.5 * (low + high);
    if (next == x) break;
    x = next;
  }
  return x;
}

inline double filter_offset(Filter filter, double u) {
  return filter == Filter::kBox ? u - 0.5 : filter == Filter::kTent ? tent_offset(u) : gaussian_offset(u);
}

/// Where sample `index` is taken, in pixels from the centre, x to the right, y down.
inline Point sample_offset(Sequence sequence, Filter filter, std::uint32_t index) {
  const Point u = unit_point(sequence, index);
  return {filter_offset(filter, u[0]), filter_offset(filter, u[1])};
}

}  // namespace supersampled
