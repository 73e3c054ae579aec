// SPDX-License-Identifier: Apache-2.0
// What profile/statistics.hpp lacks for benchmarks: ratios and a fitted line.
#pragma once

#include "profile/statistics.hpp"

#include <span>
#include <vector>

namespace heddle::bench {

using profile::Estimate;
using profile::median_of;

/// a / b pair by pair: what slows down a machine for a while touches both of a pair. As many of each.
std::vector<double> ratios(std::span<const double> a, std::span<const double> b);

/// Least squares.
struct Line {
  double slope = 0, intercept = 0;
  double residual = 0;  // largest distance of a point from the line, as a part of the range of y
};
/// At least two different x.
Line fit_line(std::span<const double> x, std::span<const double> y);

}  // namespace heddle::bench
