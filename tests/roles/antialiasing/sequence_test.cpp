// SPDX-License-Identifier: Apache-2.0
// Where samples are taken: sequence.hpp against what is known of its sequences and filters.
#include "antialiasing/supersampled/sequence.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace supersampled {
namespace {

using namespace sampling;

constexpr std::array kSequences{Sequence::kR2, Sequence::kHalton, Sequence::kRandom};
constexpr std::array kFilters{Filter::kBox, Filter::kTent, Filter::kGaussian};

/// Star discrepancy, exactly: the largest of |points in the box - its area| over boxes [0, x) x [0, y), closed and
/// open.
double star_discrepancy(const std::vector<Point>& points) {
  const auto n = static_cast<double>(points.size());
  double worst = 0;
  for (const Point& corner_x : points) {
    for (const Point& corner_y : points) {
      const double x = corner_x[0];
      const double y = corner_y[1];
      double open = 0;
      double closed = 0;
      for (const Point& p : points) {
        open += p[0] < x && p[1] < y ? 1 : 0;
        closed += p[0] <= x && p[1] <= y ? 1 : 0;
      }
      worst = std::max({worst, std::abs(closed / n - x * y), std::abs(x * y - open / n)});
    }
  }
  return worst;
}

std::vector<Point> first_points(Sequence sequence, std::uint32_t count) {
  std::vector<Point> points;
  for (std::uint32_t i = 0; i < count; ++i) points.push_back(unit_point(sequence, i));
  return points;
}

TEST(Sequence, StartsAtTheCentreForEveryFilter) {
  for (const Sequence sequence : kSequences) {
    for (const Filter filter : kFilters) {
      const Point offset = sample_offset(sequence, filter, 0);
      EXPECT_EQ(offset[0], 0.0);
      EXPECT_EQ(offset[1], 0.0);
    }
  }
}

TEST(Sequence, StaysInTheUnitSquareToTheLastSample) {
  for (const Sequence sequence : kSequences) {
    for (std::uint32_t i = 0; i < 65536; ++i) {
      for (const double u : unit_point(sequence, i)) ASSERT_TRUE(u >= 0 && u < 1) << i;
    }
  }
}

TEST(Sequence, OfLowDiscrepancyIsSo) {
  // Halton: D* <= (1/n) prod ((b-1)/(2 log b) log n + (b+1)/2), Niederreiter 1992, theorem 3.6; the turn by half a
  // pixel makes of one box at most four, so at most four times that. R2 has no such constant; it holds Halton's bound
  // here.
  for (const std::uint32_t n : {16U, 64U, 256U}) {
    double halton = 1.0 / n;
    for (const double b : {2.0, 3.0}) halton *= (b - 1) / (2 * std::log(b)) * std::log(n) + (b + 1) / 2;
    EXPECT_LT(star_discrepancy(first_points(Sequence::kHalton, n)), 4 * halton) << n;
    EXPECT_LT(star_discrepancy(first_points(Sequence::kR2, n)), halton) << n;
    EXPECT_LT(star_discrepancy(first_points(Sequence::kR2, n)), star_discrepancy(first_points(Sequence::kRandom, n)));
  }
}

TEST(Filter, HasItsDensity) {
  // Variances: box 1/12, tent 1/6, a Gaussian cut off at c deviations: s^2 (1 - 2 c pdf(c) / (2 cdf(c) - 1)).
  const double c = kGaussianRadius / kGaussianDeviation;
  const double inside = std::erf(c / std::numbers::sqrt2);
  const double pdf = std::exp(-0.5 * c * c) / std::sqrt(2 * std::numbers::pi);
  const double gaussian = kGaussianDeviation * kGaussianDeviation * (1 - 2 * c * pdf / inside);
  constexpr int kSteps = 100000;
  for (const auto& [filter, variance, radius] :
       {std::tuple(Filter::kBox, 1.0 / 12, 0.5), std::tuple(Filter::kTent, 1.0 / 6, 1.0),
        std::tuple(Filter::kGaussian, gaussian, kGaussianRadius)}) {
    double sum = 0;
    double last = -radius;
    for (int i = 0; i < kSteps; ++i) {
      const double x = filter_offset(filter, (i + 0.5) / kSteps);
      EXPECT_GE(x, last);
      last = x;
      sum += x * x;
    }
    EXPECT_LE(last, radius);
    // The midpoint rule's error where the density ends: below radius^2 / steps.
    EXPECT_NEAR(sum / kSteps, variance, radius * radius / kSteps);
  }
}

TEST(Filter, InvertsTheGaussianToTheLastDigits) {
  const double scale = 1.0 / (kGaussianDeviation * std::numbers::sqrt2);
  for (const double u : {0.0, 1e-12, 0.001, 0.25, 0.499999999, 0.5000001, 0.9, 1 - 1e-12}) {
    const double back = 0.5 + 0.5 * std::erf(gaussian_offset(u) * scale) / std::erf(kGaussianRadius * scale);
    EXPECT_NEAR(back, u, 1e-14);
  }
}

}  // namespace
}  // namespace supersampled
