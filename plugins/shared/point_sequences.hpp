// SPDX-License-Identifier: Apache-2.0
// Number of a point -> where it is in [0, 1)^2, number 0 at the centre; and numbers from counters. Pure, in float64.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

namespace sampling {

using Point = std::array<double, 2>;

inline double fraction(double x) {
  return x - std::floor(x);
}

/// Roberts 2018, the additive sequence R2: p is the plastic number, the root of p^3 = p + 1; the pair (1/p, 1/p^2) is
/// the plane's analogue of the golden ratio.
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

/// Halton 1960 in bases 2 and 3, turned by half a pixel so that sample 0 is the centre.
inline Point halton_point(std::uint32_t index) {
  return {fraction(0.5 + radical_inverse(index, 2)), fraction(0.5 + radical_inverse(index, 3))};
}

/// Steele, Lea and Flood 2014, SplitMix64: the counter's bits, mixed.
inline double random_number(std::uint64_t counter) {
  std::uint64_t z = (counter + 1) * 0x9e3779b97f4a7c15ULL;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  z ^= z >> 31;
  return static_cast<double>(z >> 11) * 0x1p-53;
}

/// Independent points, but for number 0 at the centre. `stream` is the counter at which they begin.
inline Point random_point(std::uint32_t index, std::uint64_t stream = 0) {
  if (index == 0) return {0.5, 0.5};
  return {random_number(stream + 2ULL * index), random_number(stream + 2ULL * index + 1)};
}

}  // namespace sampling
