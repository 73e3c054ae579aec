// SPDX-License-Identifier: Apache-2.0
#include "statistics.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace heddle::bench {

Estimate median_of(std::vector<double> samples) {
  std::sort(samples.begin(), samples.end());
  const std::size_t n = samples.size();
  Estimate estimate;
  estimate.value = n % 2 != 0 ? samples[n / 2] : 0.5 * (samples[n / 2 - 1] + samples[n / 2]);
  estimate.minimum = samples.front();
  estimate.maximum = samples.back();
  // P(B < k), k = 1, 2 ...: the k-th smallest and k-th largest sample miss the median with twice that.
  double probability = std::exp2(-static_cast<double>(n)), below = probability;
  std::size_t k = 1;
  estimate.confidence = 1.0 - 2.0 * below;
  while (2 * (k + 1) <= n) {
    probability *= static_cast<double>(n - k + 1) / static_cast<double>(k);
    if (1.0 - 2.0 * (below + probability) < 0.95) break;
    below += probability;
    estimate.confidence = 1.0 - 2.0 * below;
    ++k;
  }
  estimate.low = samples[k - 1];
  estimate.high = samples[n - k];
  return estimate;
}

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
