// SPDX-License-Identifier: Apache-2.0
// Samples -> a median with an interval that no assumption about their distribution stands behind.
#pragma once

#include <vector>

namespace heddle::profile {

struct Estimate {
  double value = 0;          // the median
  double low = 0, high = 0;  // order statistics around it
  double confidence = 0;     // that the population's median lies within; 0.95 or more where there are samples enough
  double minimum = 0, maximum = 0;
};

/// The median of independent samples and the narrowest symmetric pair of order statistics that holds the population's
/// median with a probability of at least 95 %: 1 - 2 P(B < k) with B binomial(n, 1/2) (David and Nagaraja 2003, "Order
/// Statistics", 7.1). Of fewer than six samples: all of them, and what that is worth. At least one sample, finite.
Estimate median_of(std::vector<double> samples);

}  // namespace heddle::profile
