// SPDX-License-Identifier: Apache-2.0
// Kernels of antialiasing/multiframe: kernel.hpp and the point sets below it, and their errors of edges in closed form.
#include "antialiasing/multiframe/kernel.hpp"
#include "roles/antialiasing/edges.hpp"
#include "roles/readme.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <iostream>
#include <map>
#include <set>
#include <tuple>

namespace {

using antialiasing::edge_error_squared;
using antialiasing::kMeanDistance;
using antialiasing::mean_distance;
using multiframe::Design;
using multiframe::Kernel;
using multiframe::Order;
using sampling::Filter;
using sampling::Point;

constexpr std::array kKernels{Kernel::kPoisson, Kernel::kRandom, Kernel::kGrid, Kernel::kR2, Kernel::kHalton};
constexpr std::array kOrders{Order::kOwn, Order::kFarthest, Order::kByDistance};

Design design_of(Kernel kernel, std::uint32_t count, std::uint32_t seed = 0, bool is_centred = true) {
  Design design;
  design.kernel = kernel;
  design.count = count;
  design.seed = seed;
  design.is_centred = is_centred;
  return design;
}

/// Mean over numbers that were drawn independently, and how far from the truth it is by chance: one standard error.
struct Estimate {
  double mean = 0, error = 0;
};
Estimate estimate(const std::vector<double>& drawn) {
  Estimate found;
  if (drawn.size() == 1) return {drawn[0], 0};
  const auto n = static_cast<double>(drawn.size());
  for (const double x : drawn) found.mean += x / n;
  for (const double x : drawn) found.error += std::pow(x - found.mean, 2) / (n * (n - 1));
  found.error = std::sqrt(found.error);
  return found;
}

/// Where the samples are before they are centred. Each kernel is drawn once: that is what takes time here.
const std::vector<Point>& drawn(Design design) {
  using Key = std::tuple<Kernel, Order, std::uint32_t, std::uint32_t>;
  static std::map<Key, std::vector<Point>> all;
  design.is_centred = false;
  const auto [found, is_new] =
      all.try_emplace(Key{design.kernel, design.order, design.count, design.seed}, std::vector<Point>());
  if (is_new) found->second = sample_offsets(design);
  return found->second;
}

/// Squared errors of edges after the first `prefix` samples of 16 kernels of different seeds; of one where none is
/// drawn.
std::vector<double> edge_errors(Design design, std::size_t prefix, double scale = 1.0) {
  std::vector<double> errors;
  const bool is_drawn = design.kernel == Kernel::kPoisson || design.kernel == Kernel::kRandom;
  for (std::uint32_t seed = 0; seed < (is_drawn ? 16U : 1U); ++seed) {
    design.seed = seed;
    std::vector<Point> offsets = drawn(design);
    if (design.is_centred && design.kernel != Kernel::kGrid && design.count > 1) multiframe::centre_from(1, offsets);
    for (Point& p : offsets) p = {scale * p[0], scale * p[1]};
    errors.push_back(edge_error_squared(offsets, prefix));
  }
  return errors;
}

/// Root of the mean square, by the delta method.
Estimate rmse(const std::vector<double>& squares) {
  const Estimate square = estimate(squares);
  return {std::sqrt(square.mean), 0.5 * square.error / std::sqrt(square.mean)};
}

TEST(EdgeError, IsWhatRandomLinesSay) {
  // Lines through the square's circumcircle, all alike by isotropy; those that miss the pixel are not counted.
  const std::vector<Point> offsets = sample_offsets(design_of(Kernel::kRandom, 5, 3));
  sampling::Random random(1, 0);
  std::vector<double> squares;
  while (squares.size() < 200000) {
    const double angle = 2 * std::numbers::pi * random.next();
    const double distance = std::numbers::sqrt2 * (random.next() - 0.5);
    if (std::abs(distance) > 0.5 * (std::abs(std::cos(angle)) + std::abs(std::sin(angle)))) continue;
    double inside = 0;
    for (const Point& p : offsets) inside += std::cos(angle) * p[0] + std::sin(angle) * p[1] > distance ? 0.2 : 0.0;
    squares.push_back(std::pow(inside - antialiasing::covered(angle, distance), 2));
  }
  const Estimate found = estimate(squares);
  EXPECT_LT(found.error, 0.005 * found.mean);
  EXPECT_NEAR(edge_error_squared(offsets, 5), found.mean, 4 * found.error);
}

TEST(EdgeError, OfTheCentreAndOfChanceIsKnown) {
  // The mean distance of two points of a square, and of one from its corner (Ghosh 1951).
  EXPECT_NEAR(kMeanDistance, 0.5214054331647207, 1e-15);
  EXPECT_NEAR(mean_distance({0.5, 0.5}), (std::numbers::sqrt2 + std::asinh(1.0)) / 3, 1e-15);
  EXPECT_NEAR(mean_distance({0, 0}), (std::numbers::sqrt2 + std::asinh(1.0)) / 6, 1e-15);
  // One sample in the centre, and n - 1 by chance: (A + (n - 1) B) / n^2, where B is the variance of one.
  const double centre = 0.5 * (mean_distance({0, 0}) - 0.5 * kMeanDistance);
  const double chance = kMeanDistance / 4;
  for (const std::uint32_t n : {4U, 16U, 64U}) {
    std::vector<double> squares;
    for (std::uint32_t seed = 0; seed < 400; ++seed)
      squares.push_back(edge_error_squared(sample_offsets(design_of(Kernel::kRandom, n, seed, false)), n));
    const Estimate found = estimate(squares);
    EXPECT_NEAR(found.mean, (centre + (n - 1) * chance) / (n * n), 4 * found.error) << n;
  }
}

TEST(Poisson, HasExactlyAsManyPointsAsWantedAllApart) {
  for (const std::uint32_t n : {1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U, 9U, 13U, 16U, 17U, 31U, 64U, 100U, 257U, 1000U}) {
    const std::vector<Point> points = sampling::poisson_disk(n, 5);
    ASSERT_EQ(points.size(), n);
    EXPECT_EQ(points[0], (Point{0.5, 0.5}));
    double nearest = 2;
    for (std::size_t i = 0; i < points.size(); ++i) {
      for (const double x : points[i]) EXPECT_TRUE(x >= 0 && x < 1) << n;
      for (std::size_t j = 0; j < i; ++j)
        nearest = std::min(nearest, sampling::toroidal_distance_squared(points[i], points[j]));
    }
    // As far as they were wanted to be or, because that many rarely find room, a little less: measured 0.91 to 1.
    EXPECT_GT(std::sqrt(nearest), 0.88 * sampling::poisson_distance(n)) << n;
  }
}

TEST(Poisson, LeavesNoHoles) {
  // No place is farther from all points than they are from one another, but for darts that missed.
  for (const std::uint32_t n : {4U, 16U, 64U, 256U}) {
    const std::vector<Point> points = sampling::poisson_disk(n, 9);
    double farthest = 0;
    for (int y = 0; y < 128; ++y) {
      for (int x = 0; x < 128; ++x) {
        double nearest = 2;
        for (const Point& p : points)
          nearest = std::min(nearest, sampling::toroidal_distance_squared(p, {(x + 0.5) / 128, (y + 0.5) / 128}));
        farthest = std::max(farthest, nearest);
      }
    }
    EXPECT_LT(std::sqrt(farthest), 1.15 * sampling::poisson_distance(n)) << n;
  }
}

TEST(Poisson, IsTheSameForTheSameSeedAlone) {
  EXPECT_EQ(sampling::poisson_disk(33, 4), sampling::poisson_disk(33, 4));
  EXPECT_NE(sampling::poisson_disk(33, 4), sampling::poisson_disk(33, 5));
}

TEST(Grid, SharesThePixelEquallyForAnyNumber) {
  for (const std::uint32_t n : {1U, 2U, 3U, 5U, 7U, 12U, 16U, 50U, 64U}) {
    std::vector<Point> points = multiframe::grid_points(n, 0);
    ASSERT_EQ(points.size(), n);
    std::map<double, int> rows;
    for (const Point& p : points) ++rows[p[1]];
    double above = 0;
    for (const auto& [y, in_row] : rows) {
      EXPECT_NEAR(y, above + 0.5 * in_row / n, 1e-15) << n;
      above += static_cast<double>(in_row) / n;
    }
    EXPECT_NEAR(above, 1.0, 1e-14);
    const double side = std::sqrt(static_cast<double>(n));
    if (side == std::floor(side)) {
      EXPECT_EQ(rows.size(), static_cast<std::size_t>(side));
    }
  }
}

TEST(Kernel, BeginsInTheCentreAndHasItsMeanThere) {
  for (const Kernel kernel : kKernels) {
    for (const Filter filter : {Filter::kBox, Filter::kTent, Filter::kGaussian}) {
      for (const std::uint32_t n : {1U, 2U, 3U, 16U, 61U}) {
        Design design = design_of(kernel, n);
        design.filter = filter;
        const std::vector<Point> offsets = sample_offsets(design);
        ASSERT_EQ(offsets.size(), n);
        if (kernel != Kernel::kGrid || n == 1) {
          EXPECT_EQ(offsets[0], (Point{0.0, 0.0}));
        }
        for (const std::size_t axis : {0U, 1U}) {
          double sum = 0;
          for (const Point& p : offsets) sum += p[axis];
          EXPECT_LT(std::abs(sum / n), 1e-12) << n;
        }
      }
    }
  }
}

TEST(Kernel, WithoutCentringShiftsThePicture) {
  // Points in the centre first are not yet there on average: for less than a few hundred of them the mean is farther
  // off than 0.02 pixels, for chance and for the Poisson disk.
  for (const Kernel kernel : {Kernel::kPoisson, Kernel::kRandom}) {
    for (const std::uint32_t n : {4U, 16U, 64U}) {
      std::vector<double> lengths;
      for (std::uint32_t seed = 0; seed < 16; ++seed) {
        Point sum{};
        for (const Point& p : sample_offsets(design_of(kernel, n, seed, false))) sum = {sum[0] + p[0], sum[1] + p[1]};
        lengths.push_back(std::hypot(sum[0], sum[1]) / n);
      }
      EXPECT_GT(estimate(lengths).mean, n == 64 ? 0.012 : 0.03) << n;
    }
  }
}

TEST(Kernel, OrdersAreOrdersOfTheSamePoints) {
  for (const Kernel kernel : kKernels) {
    Design design = design_of(kernel, 30);
    const std::vector<Point> own = sample_offsets(design);
    for (const Order order : kOrders) {
      design.order = order;
      EXPECT_NEAR(std::hypot(sample_offsets(design)[0][0], sample_offsets(design)[0][1]),
                  std::hypot(own[0][0], own[0][1]), 1e-12);
      if (order == Order::kByDistance) {
        EXPECT_TRUE(std::ranges::is_sorted(unit_points(design), {}, multiframe::from_centre));
      }
      const std::vector<Point> unit = unit_points(design);
      design.order = Order::kOwn;
      const std::vector<Point> unit_own = unit_points(design);
      EXPECT_EQ(std::set(unit.begin(), unit.end()), std::set(unit_own.begin(), unit_own.end()));
      EXPECT_EQ(std::set(unit.begin(), unit.end()).size(), 30U);
    }
  }
}

TEST(Kernel, TakesTheFiltersRadiusOrTheOneGiven) {
  for (const auto& [filter, usual] :
       {std::pair(Filter::kBox, 0.5), std::pair(Filter::kTent, 1.0), std::pair(Filter::kGaussian, 1.5)}) {
    Design design = design_of(Kernel::kR2, 4096, 0, false);
    design.filter = filter;
    const std::vector<Point> offsets = sample_offsets(design);
    design.radius_px = 2 * usual;
    const std::vector<Point> wide = sample_offsets(design);
    double largest = 0;
    for (std::size_t i = 0; i < offsets.size(); ++i) {
      EXPECT_EQ(wide[i], (Point{2 * offsets[i][0], 2 * offsets[i][1]}));
      largest = std::max(largest, std::abs(offsets[i][0]));
    }
    EXPECT_LE(largest, usual);
    EXPECT_GT(largest, 0.8 * usual);
  }
}

/// Numbers of the row of a table that begins with `label`.
std::vector<double> row_of(const std::string& readme, const std::string& label) {
  std::vector<double> numbers;
  const std::size_t start = readme.find("\n| " + label + " |");
  if (start == std::string::npos) return numbers;
  std::istringstream cells(readme.substr(start + label.size() + 5, readme.find('\n', start + 1) - start));
  for (std::string cell; std::getline(cells, cell, '|') && cell.find_first_of("0123456789") != std::string::npos;)
    numbers.push_back(std::stod(cell));
  return numbers;
}

/// The table's row as measured, on the screen and compared with the README's.
void expect_row(const std::string& label, const std::vector<Estimate>& measured) {
  std::string text = "| " + label + " |";
  for (const Estimate& e : measured) {
    std::array<char, 32> number{};
    std::snprintf(number.data(), number.size(), " %.3g |", e.mean);
    text += number.data();
  }
  std::cout << text << '\n';
  const std::vector<double> said = row_of(rendering::readme_of("antialiasing/multiframe"), label);
  ASSERT_EQ(said.size(), measured.size()) << "the README should have " << text;
  // Three digits, and that other machines draw other kernels: a fused product may let a dart in.
  for (std::size_t i = 0; i < said.size(); ++i)
    EXPECT_NEAR(said[i], measured[i].mean, 0.006 * std::abs(measured[i].mean) + 5 * measured[i].error)
        << "column " << i << "; the README should have " << text;
}

TEST(Kernel, ErrorsOfEdgesAreTheReadmes) {
  const auto row = [](const std::string& label, Kernel kernel, bool is_centred) {
    std::vector<Estimate> measured;
    std::vector<std::vector<std::pair<int, double>>> curves;
    for (const std::uint32_t n : {1U, 4U, 16U, 64U, 256U, 1024U}) {
      const std::vector<double> squares = edge_errors(design_of(kernel, n, 0, is_centred), n);
      measured.push_back(rmse(squares));
      curves.resize(squares.size());
      if (n == 1) continue;
      for (std::size_t i = 0; i < squares.size(); ++i)
        curves[i].emplace_back(static_cast<int>(n), std::sqrt(squares[i]));
    }
    // A slope for each seed: they are independent.
    std::vector<double> slopes;
    for (const auto& curve : curves) slopes.push_back(antialiasing::slope_of(curve));
    const Estimate slope = estimate(slopes);
    measured.push_back(slope);
    std::cout << label << ": slope " << slope.mean << " +- " << 2 * slope.error << '\n';
    expect_row(label, measured);
    return measured;
  };
  const auto random = row("random", Kernel::kRandom, false);
  const auto poisson = row("poisson", Kernel::kPoisson, false);
  row("r2", Kernel::kR2, false);
  row("halton", Kernel::kHalton, false);
  const auto grid = row("grid", Kernel::kGrid, false);
  const auto random_centred = row("random, centred", Kernel::kRandom, true);
  const auto poisson_centred = row("poisson, centred", Kernel::kPoisson, true);
  row("r2, centred", Kernel::kR2, true);
  row("halton, centred", Kernel::kHalton, true);

  // Independent samples: -1/2, and a little less steep from 4 to 16, where the first one is in the centre.
  EXPECT_NEAR(random.back().mean, -0.49, 4 * random.back().error);
  // No samples do better than -3/4 for long (Alexander 1990); a grid does that well, for all directions together.
  EXPECT_NEAR(grid.back().mean, -0.75, 0.02);
  EXPECT_LT(poisson.back().mean, -0.6);
  EXPECT_GT(poisson.back().mean, -0.75);
  // 64 frames of a Poisson disk, and of chance.
  EXPECT_LT(poisson[3].mean, 0.025);
  EXPECT_GT(random[3].mean, 0.035);
  EXPECT_LT(random[3].mean, 0.05);
  // As many independent samples as give what 16 of the Poisson disk do: at least 1.3 times as many.
  EXPECT_GT(kMeanDistance / 4 / std::pow(poisson[2].mean, 2), 1.3 * 16);
  // Random packings have a little of chance in them that no number of points removes: they bend towards -1/2.
  const double early = std::log(poisson_centred[3].mean / poisson_centred[1].mean) / std::log(16.0);
  const double late = std::log(poisson_centred[5].mean / poisson_centred[3].mean) / std::log(16.0);
  std::cout << "poisson, centred: slope from 4 to 64 " << early << ", from 64 to 1024 " << late << '\n';
  EXPECT_GT(late, early + 0.06);
  // What centring is worth: 0.69 to 0.79 of the error is left, from 4 frames on.
  for (const std::size_t i : {1U, 2U, 3U, 4U, 5U}) {
    EXPECT_LT(poisson_centred[i].mean, 0.84 * poisson[i].mean);
    EXPECT_LT(random_centred[i].mean, 0.86 * random[i].mean);
  }
}

TEST(Kernel, StoppedEarlyIsAsBadAsTheReadmeSays) {
  const auto row = [](const std::string& label, Kernel kernel, Order order) {
    Design design = design_of(kernel, 64);
    design.order = order;
    std::vector<Estimate> measured;
    for (const std::size_t prefix : {1U, 4U, 16U, 32U, 64U}) measured.push_back(rmse(edge_errors(design, prefix)));
    expect_row(label, measured);
    return measured;
  };
  const auto own = row("own", Kernel::kPoisson, Order::kOwn);
  const auto farthest = row("farthest", Kernel::kPoisson, Order::kFarthest);
  const auto by_distance = row("by_distance", Kernel::kPoisson, Order::kByDistance);
  row("r2: own", Kernel::kR2, Order::kOwn);
  // 16 of 64 are worse than the 16 that were made for 16, those nearest to the centre by far; far ones first help.
  const double made_for_16 = rmse(edge_errors(design_of(Kernel::kPoisson, 16), 16)).mean;
  EXPECT_GT(own[2].mean, 1.5 * made_for_16);
  EXPECT_GT(by_distance[2].mean, 2.5 * made_for_16);
  EXPECT_LT(farthest[2].mean, 0.85 * own[2].mean);
  EXPECT_NEAR(farthest[4].mean, own[4].mean, 1e-12);
  EXPECT_NEAR(by_distance[4].mean, own[4].mean, 1e-12);
}

TEST(Kernel, OfHalfAPixelKeepsAnErrorThatNoFramesRemove) {
  std::vector<Estimate> measured;
  for (const std::uint32_t n : {1U, 4U, 16U, 64U, 256U})
    measured.push_back(rmse(edge_errors(design_of(Kernel::kPoisson, n), n, 0.5)));
  expect_row("half a pixel", measured);
  // Samples all over the inner quarter: half of mean |p - q| - (1/2 + 1) mean |q - q'| / 2.
  double to_pixel = 0;
  constexpr int kSteps = 200;
  for (int y = 0; y < kSteps; ++y) {
    for (int x = 0; x < kSteps; ++x)
      to_pixel += mean_distance({0.5 * ((x + 0.5) / kSteps - 0.5), 0.5 * ((y + 0.5) / kSteps - 0.5)}) / kSteps / kSteps;
  }
  const double limit = std::sqrt(0.5 * (to_pixel - 0.75 * kMeanDistance));
  EXPECT_NEAR(limit, 0.1176, 0.001);
  EXPECT_NEAR(measured[4].mean, limit, 0.002);
  EXPECT_GT(measured[3].mean, 0.1);
}

}  // namespace
