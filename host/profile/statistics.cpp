// SPDX-License-Identifier: Apache-2.0
#include "profile/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace heddle::profile {

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

}  // namespace heddle::profile
