// SPDX-License-Identifier: Apache-2.0
// A number -> that many points of the unit square, none near another, also across its borders: tiles of it fit
// together. Pure, in float64. Source  Bridson 2007, "Fast Poisson Disk Sampling in Arbitrary Dimensions", SIGGRAPH
// sketches: darts around points
#pragma once

#include "point_sequences.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>
#include <vector>

namespace sampling {

/// Numbers in [0, 1) one after another. Streams of other seeds and parts have none in common for 2^28 numbers.
class Random {
 public:
  Random(std::uint32_t seed, std::uint32_t part) : counter_(std::uint64_t{seed} << 40 | std::uint64_t{part} << 28) {}
  double next() { return random_number(counter_++); }
  /// A whole number below `end`.
  std::size_t below(std::size_t end) {
    return std::min(static_cast<std::size_t>(next() * static_cast<double>(end)), end - 1);
  }

 private:
  std::uint64_t counter_;
};

/// Fisher and Yates: what stands from `first` on, in a random order.
inline void shuffle_from(std::vector<Point>& points, std::size_t first, Random& random) {
  for (std::size_t i = points.size(); i > first + 1; --i)
    std::swap(points[i - 1], points[first + random.below(i - first)]);
}

/// The square of the shortest way between two points where opposite borders are one.
inline double toroidal_distance_squared(const Point& a, const Point& b) {
  const double dx = std::abs(a[0] - b[0]);
  const double dy = std::abs(a[1] - b[1]);
  const double x = std::min(dx, 1.0 - dx);
  const double y = std::min(dy, 1.0 - dy);
  return x * x + y * y;
}

/// Points at least `distance` apart, as many as find room in 30 darts around each; the first is the centre. They grow
/// from there: the first ones of many are close to it.
class DartBoard {
 public:
  DartBoard(double distance, Random& random)
      : distance_(distance), side_(cells(distance)), first_(side_ * side_, kEnd) {
    constexpr int kDarts = 30;
    add({0.5, 0.5});
    for (std::vector<std::size_t> growing{0}; !growing.empty();) {
      const std::size_t chosen = random.below(growing.size());
      int dart = 0;
      for (; dart < kDarts; ++dart) {
        // Even over the ring of one to two distances.
        const double radius = distance * std::sqrt(1.0 + 3.0 * random.next());
        const double angle = 2.0 * std::numbers::pi * random.next();
        const Point& from = points_[growing[chosen]];
        const Point to{wrapped(from[0] + radius * std::cos(angle)), wrapped(from[1] + radius * std::sin(angle))};
        if (!has_room(to)) continue;
        growing.push_back(points_.size());
        add(to);
        break;
      }
      if (dart < kDarts) continue;
      growing[chosen] = growing.back();
      growing.pop_back();
    }
  }
  [[nodiscard]] std::vector<Point>&& points() && { return std::move(points_); }

 private:
  static constexpr std::size_t kEnd = SIZE_MAX;

  /// As many cells in a row as leave none narrower than the distance: what is too near is in a cell beside. With less
  /// than three, one: none is met twice.
  static std::size_t cells(double distance) {
    const auto side = static_cast<std::size_t>(1.0 / distance);
    return side < 3 ? 1 : side;
  }
  static double wrapped(double x) {
    const double inside = fraction(x);
    return inside < 1.0 ? inside : 0.0;  // -1e-17 is 1 - 1e-17, which rounds to 1
  }
  [[nodiscard]] std::size_t cell(double x) const {
    return std::min(static_cast<std::size_t>(x * static_cast<double>(side_)), side_ - 1);
  }
  void add(const Point& point) {
    std::size_t& first = first_[cell(point[1]) * side_ + cell(point[0])];
    next_.push_back(first);
    first = points_.size();
    points_.push_back(point);
  }
  [[nodiscard]] bool has_room(const Point& point) const {
    const std::size_t reach = side_ == 1 ? 1 : 3;
    const std::size_t above = cell(point[1]) + side_ - reach / 2;
    const std::size_t left = cell(point[0]) + side_ - reach / 2;
    for (std::size_t y = above; y < above + reach; ++y) {
      for (std::size_t x = left; x < left + reach; ++x) {
        for (std::size_t i = first_[y % side_ * side_ + x % side_]; i != kEnd; i = next_[i])
          if (toroidal_distance_squared(points_[i], point) < distance_ * distance_) return false;
      }
    }
    return true;
  }

  double distance_;
  std::size_t side_;                // cells in a row
  std::vector<std::size_t> first_;  // of each cell: a point in it
  std::vector<std::size_t> next_;   // of each point: another one in its cell
  std::vector<Point> points_;
};

/// The distance that is tried first: 78 % of what a hexagonal grid has.
inline double poisson_distance(std::size_t count) {
  return 1.0 / std::sqrt(static_cast<double>(count) * std::numbers::sqrt2);
}

/// Exactly `count` points, the first in the centre, the others in a random order. Where darts find less, all are thrown
/// again, for a smaller distance.
inline std::vector<Point> poisson_disk(std::size_t count, std::uint32_t seed) {
  // A board is full with a few points more or less than the one before. Most numbers are met in time; else the fullest
  // that came nearest is thinned out, by a few per mille.
  const std::size_t tries = std::clamp<std::size_t>(65536 / count, 16, 64);
  double distance = poisson_distance(count);
  std::vector<Point> best;
  for (std::uint32_t i = 0; best.size() != count && (i < tries || best.empty()); ++i) {
    Random random(seed, 2 * i);
    std::vector<Point> points = DartBoard(distance, random).points();
    // As many as find room are inversely as the square.
    const double share = static_cast<double>(points.size()) / static_cast<double>(count);
    distance *= std::clamp(std::sqrt(share), 0.98, 1.02);
    if (points.size() >= count && (best.empty() || points.size() < best.size())) best = std::move(points);
  }
  Random random(seed, 1);
  shuffle_from(best, 1, random);
  best.resize(count);
  return best;
}

}  // namespace sampling
