// SPDX-License-Identifier: Apache-2.0
// A kernel's name, how many samples it has and their order -> where each is taken. Pure, in float64; README (2) to (5).
#pragma once

#include "pixel_filter.hpp"
#include "poisson_disk.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace multiframe {

using sampling::Filter;
using sampling::Point;

enum class Kernel : std::uint32_t { kPoisson, kRandom, kGrid, kR2, kHalton };
enum class Order : std::uint32_t { kOwn, kFarthest, kByDistance };

/// All that the points depend on.
struct Design {
  Kernel kernel = Kernel::kPoisson;
  Order order = Order::kOwn;
  Filter filter = Filter::kBox;
  double radius_px = 0;  // 0: the filter's own
  std::uint32_t count = 0;
  std::uint32_t seed = 0;
  bool is_centred = true;
  bool operator==(const Design&) const = default;
};

/// How far a point is from the pixel's centre.
inline double from_centre(const Point& p) {
  return std::hypot(p[0] - 0.5, p[1] - 0.5);
}

/// (3): rows of as many points as go into the others or one more, each in the middle of a rectangle of area 1 / count;
/// for square numbers, the squares. The first is the nearest to the centre.
inline std::vector<Point> grid_points(std::uint32_t count, std::uint32_t seed) {
  std::vector<Point> points;
  const auto rows = static_cast<std::uint32_t>(std::sqrt(static_cast<double>(count)));
  std::uint32_t above = 0;
  for (std::uint32_t row = 0; row < rows; ++row) {
    const std::uint32_t in_row = count / rows + (row < count % rows ? 1 : 0);
    for (std::uint32_t i = 0; i < in_row; ++i) points.push_back({(i + 0.5) / in_row, (above + 0.5 * in_row) / count});
    above += in_row;
  }
  std::iter_swap(points.begin(), std::ranges::min_element(points, {}, from_centre));
  sampling::Random random(seed, 1);
  sampling::shuffle_from(points, 1, random);
  return points;
}

/// (4): after the first, always the one that is farthest from all before it, borders being one with those opposite.
inline void order_by_farthest(std::vector<Point>& points) {
  std::vector<double> distances(points.size(), 2.0);  // squared
  for (std::size_t done = 1; done < points.size(); ++done) {
    std::size_t farthest = done;
    for (std::size_t i = done; i < points.size(); ++i) {
      distances[i] = std::min(distances[i], sampling::toroidal_distance_squared(points[i], points[done - 1]));
      if (distances[i] > distances[farthest]) farthest = i;
    }
    std::swap(points[done], points[farthest]);
    std::swap(distances[done], distances[farthest]);
  }
}

/// In [0, 1)^2.
inline std::vector<Point> unit_points(const Design& design) {
  std::vector<Point> points;
  if (design.kernel == Kernel::kPoisson) points = sampling::poisson_disk(design.count, design.seed);
  if (design.kernel == Kernel::kGrid) points = grid_points(design.count, design.seed);
  for (auto i = static_cast<std::uint32_t>(points.size()); i < design.count; ++i) {
    points.push_back(design.kernel == Kernel::kR2       ? sampling::r2_point(i)
                     : design.kernel == Kernel::kHalton ? sampling::halton_point(i)
                                                        : sampling::random_point(i, std::uint64_t{design.seed} << 40));
  }
  if (design.order == Order::kFarthest) order_by_farthest(points);
  if (design.order == Order::kByDistance) std::ranges::stable_sort(points, {}, from_centre);
  return points;
}

/// (5): moves all points from `first` on, so that all are in the centre on average: else the picture is shifted by
/// their mean, which is as large as the error that they have beyond it.
inline void centre_from(std::size_t first, std::vector<Point>& offsets) {
  const double moved = static_cast<double>(offsets.size()) - static_cast<double>(first);
  for (const std::size_t axis : {std::size_t{0}, std::size_t{1}}) {
    double sum = 0;
    for (const Point& p : offsets) sum += p[axis];
    for (std::size_t i = first; i < offsets.size(); ++i) offsets[i][axis] -= sum / moved;
  }
}

/// In pixels from the centre, x to the right, y down.
inline std::vector<Point> sample_offsets(const Design& design) {
  std::vector<Point> points = unit_points(design);
  const double scale = design.radius_px == 0 ? 1.0 : design.radius_px / sampling::filter_radius(design.filter);
  for (Point& p : points)
    p = {scale * sampling::filter_offset(design.filter, p[0]), scale * sampling::filter_offset(design.filter, p[1])};
  // The first stays in the centre; that of a grid is not there, and a grid stays whole.
  if (design.is_centred && design.count > 1) centre_from(design.kernel == Kernel::kGrid ? 0 : 1, points);
  return points;
}

}  // namespace multiframe
