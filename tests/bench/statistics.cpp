// SPDX-License-Identifier: Apache-2.0
#include "statistics.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace heddle::bench {

std::vector<double> ratios(std::span<const double> a, std::span<const double> b) {
  std::vector<double> quotients;
  for (std::size_t i = 0; i < a.size(); ++i) quotients.push_back(a[i] / b[i]);
  return quotients;
}

Line fit_line(std::span<const double> x, std::span<const double> y) {
  const auto n = static_cast<double>(x.size());
  double mean_x = 0, mean_y = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    mean_x += x[i] / n;
    mean_y += y[i] / n;
  }
  double xx = 0, xy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    xx += (x[i] - mean_x) * (x[i] - mean_x);
    xy += (x[i] - mean_x) * (y[i] - mean_y);
  }
  Line line;
  line.slope = xy / xx;
  line.intercept = mean_y - line.slope * mean_x;
  const auto [low, high] = std::minmax_element(y.begin(), y.end());
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double distance = std::abs(y[i] - (line.intercept + line.slope * x[i]));
    line.residual = std::max(line.residual, *high > *low ? distance / (*high - *low) : 0.0);
  }
  return line;
}

}  // namespace heddle::bench
