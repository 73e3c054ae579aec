// SPDX-License-Identifier: Apache-2.0
// Where samples are to be taken so that a pixel's plain mean is a filter's (filter importance sampling): inverse
// distributions of one coordinate, in pixels. Pure, in float64.
// Source  Ernst, Stamminger and Greiner 2006, "Filter Importance Sampling"
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace sampling {

enum class Filter : std::uint32_t { kBox, kTent, kGaussian };

/// From a number in [0, 1) to a distance with the filter's density; odd about 1/2, and 0 there.
inline double tent_offset(double u) {
  return u < 0.5 ? std::sqrt(2.0 * u) - 1.0 : 1.0 - std::sqrt(2.0 - 2.0 * u);
}

/// Its standard deviation and where it is cut off, in pixels.
inline constexpr double kGaussianDeviation = 0.5;
inline constexpr double kGaussianRadius = 1.5;

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

/// Distance beyond which a filter is 0, in pixels.
inline double filter_radius(Filter filter) {
  return filter == Filter::kBox ? 0.5 : filter == Filter::kTent ? 1.0 : kGaussianRadius;
}

inline double filter_offset(Filter filter, double u) {
  return filter == Filter::kBox ? u - 0.5 : filter == Filter::kTent ? tent_offset(u) : gaussian_offset(u);
}

}  // namespace sampling
