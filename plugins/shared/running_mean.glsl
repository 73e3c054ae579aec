// SPDX-License-Identifier: Apache-2.0
// A running mean in two floats for each component: as exact after a million samples as after one.
//   m_k = m_(k-1) + w_k (x_k - m_(k-1)) / W_k,  W_k = W_(k-1) + w_k
// Source  Welford 1962 (the update), Knuth 1969 and Moller 1965 (the exact sum of two floats)
#ifndef HEDDLE_RUNNING_MEAN_GLSL
#define HEDDLE_RUNNING_MEAN_GLSL

struct RunningMean {
  vec4 high, low;  // the mean is their sum; |low| is at most half a unit in the last place of high
  float weight;    // of all samples in it; where each weighs 1, their number, exact to 2^24
};

// By the bits, because drivers may take comparisons of NaN apart.
bool is_finite(vec4 value) {
  return all(notEqual(floatBitsToUint(value) & 0x7f800000u, uvec4(0x7f800000u)));
}

// Whole samples: where one component is NaN, the others are not to be trusted either. weight > 0.
RunningMean add_sample(RunningMean mean, vec4 value, float weight) {
  if (!is_finite(value)) return mean;
  float total = mean.weight + weight;
  // precise: the bits that are lost are what is computed here. Divided in this order, the first sample is the mean to
  // the last bit, whatever it weighs.
  precise vec4 difference = (value - mean.high) - mean.low;
  precise vec4 rest = mean.low + difference / (total / weight);
  precise vec4 high = mean.high + rest;
  precise vec4 added = high - mean.high;
  precise vec4 low = (mean.high - (high - added)) + (rest - added);
  return RunningMean(high, low, total);
}

#endif
