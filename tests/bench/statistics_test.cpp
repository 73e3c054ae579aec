// SPDX-License-Identifier: Apache-2.0
#include "bench/statistics.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace heddle::bench {
namespace {

TEST(Statistics, MedianIsTheMiddleSampleOrTheMeanOfTheTwo) {
  EXPECT_EQ(median_of({3, 1, 2}).value, 2);
  EXPECT_EQ(median_of({4, 1, 3, 2}).value, 2.5);
  EXPECT_EQ(median_of({7}).value, 7);
}

TEST(Statistics, FewSamplesGiveTheirWholeRangeAndSayWhatItIsWorth) {
  const Estimate estimate = median_of({3, 1, 2});
  EXPECT_EQ(estimate.low, 1);
  EXPECT_EQ(estimate.high, 3);
  EXPECT_DOUBLE_EQ(estimate.confidence, 0.75);  // 1 - 2 / 2^3
  EXPECT_DOUBLE_EQ(median_of({1}).confidence, 0);
}

TEST(Statistics, IntervalIsTheTabulatedPairOfOrderStatistics) {
  // David and Nagaraja's rule gives ranks 6 and 15 of 20, with confidence 0.9586; 40 and 61 of 100, with 0.9648.
  std::vector<double> samples;
  for (int i = 20; i >= 1; --i) samples.push_back(i);
  EXPECT_EQ(median_of(samples).low, 6);
  EXPECT_EQ(median_of(samples).high, 15);
  EXPECT_NEAR(median_of(samples).confidence, 0.9586, 5e-5);
  samples.clear();
  for (int i = 1; i <= 100; ++i) samples.push_back(i);
  EXPECT_EQ(median_of(samples).low, 40);
  EXPECT_EQ(median_of(samples).high, 61);
  EXPECT_NEAR(median_of(samples).confidence, 0.9648, 5e-5);
}

TEST(Statistics, IntervalHoldsTheMedianOfASkewedDistributionAsOftenAsItSays) {
  std::mt19937 engine(1);
  int held = 0;
  constexpr int kRounds = 4000;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<double> samples;
    for (int i = 0; i < 15; ++i)
      samples.push_back(-std::log((static_cast<double>(engine()) + 0.5) / 4294967296.0));  // exponential, median ln 2
    const Estimate estimate = median_of(samples);
    held += estimate.low <= std::log(2.0) && std::log(2.0) <= estimate.high ? 1 : 0;
  }
  // Ranks 4 and 12 of 15 hold it with probability 0.9648; four standard deviations of that many rounds are 0.012.
  EXPECT_NEAR(static_cast<double>(held) / kRounds, 0.9648, 0.012);
}

TEST(Statistics, RatiosArePairedSoThatSlowTimesCancel) {
  const std::array<double, 3> a{2, 20, 4}, b{1, 10, 2};
  EXPECT_EQ(median_of(ratios(a, b)).value, 2);
  EXPECT_EQ(median_of(ratios(a, b)).high, 2);
}

TEST(Statistics, LineGoesThroughPointsOnALine) {
  const std::array<double, 4> x{0, 1, 2, 5}, y{3, 5, 7, 13};
  const Line line = fit_line(x, y);
  EXPECT_DOUBLE_EQ(line.slope, 2);
  EXPECT_DOUBLE_EQ(line.intercept, 3);
  EXPECT_NEAR(line.residual, 0, 1e-15);
}

TEST(Statistics, ResidualIsTheLargestDistanceAsPartOfTheRange) {
  const std::array<double, 3> x{0, 1, 2}, y{0, 3, 0};
  const Line line = fit_line(x, y);
  EXPECT_DOUBLE_EQ(line.slope, 0);
  EXPECT_DOUBLE_EQ(line.intercept, 1);
  EXPECT_DOUBLE_EQ(line.residual, 2.0 / 3.0);
}

}  // namespace
}  // namespace heddle::bench
