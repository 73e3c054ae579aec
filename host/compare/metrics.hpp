// SPDX-License-Identifier: Apache-2.0
// Differences between two images, formula beside the name. All sums in float64.
#pragma once

#include "compare/picture.hpp"

namespace heddle::compare {

/// Keeps relMSE finite where the reference is black; the value that papers on denoising use.
constexpr double kRelativeEpsilon = 0.01;

struct Metrics {
  double mse = 0;              // mean over pixels and channels of (a - b)^2
  double rmse = 0;             // sqrt(mse)
  double relmse = 0;           // mean of (a - b)^2 / (b^2 + 0.01)
  double psnr = 0;             // 10 log10(1 / mse), peak 1; infinity if mse = 0
  double mean_difference = 0;  // mean of a - b: bias
  double maximum = 0;          // max |a - b|
  std::uint32_t maximum_x = 0, maximum_y = 0, maximum_channel = 0;
  double percentile_99 = 0;  // of |a - b| over all values, nearest rank
  std::uint64_t differing_pixels = 0;
};

/// b is the reference. Throws Error(HEDDLE_BAD_INPUT) if shapes differ, an image is empty, or a value is not finite
/// (names image, pixel and channel).
Metrics measure(const Picture& a, const Picture& b);
/// The value that at least `percent` of 100 of all |a - b| do not exceed, nearest rank; 0 < percent <= 100.
double percentile(const Picture& a, const Picture& b, double percent);
/// |a - b|.
image::Image difference(const Picture& a, const Picture& b);
/// psnr is null where it is infinite.
std::string to_json(const Metrics& metrics);

}  // namespace heddle::compare
