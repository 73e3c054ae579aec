// SPDX-License-Identifier: Apache-2.0
// Edges whose share of a pixel is known, and how far techniques and kernels are from it.
#pragma once

#include "roles/antialiasing/samples.hpp"

#include <algorithm>
#include <utility>

namespace antialiasing {

/// Area of the unit square around 0 where dot(normal, p) > distance: the polygon that is left of the square, by the
/// shoelace formula.
inline double covered(double angle, double distance) {
  const double nx = std::cos(angle);
  const double ny = std::sin(angle);
  std::vector<std::array<double, 2>> square{{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}};
  std::vector<std::array<double, 2>> left;
  for (std::size_t i = 0; i < square.size(); ++i) {
    const auto& a = square[i];
    const auto& b = square[(i + 1) % square.size()];
    const double da = nx * a[0] + ny * a[1] - distance;
    const double db = nx * b[0] + ny * b[1] - distance;
    if (da > 0) left.push_back(a);
    if ((da > 0) != (db > 0)) {
      const double t = da / (da - db);
      left.push_back({a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])});
    }
  }
  double area = 0;
  for (std::size_t i = 0; i < left.size(); ++i) {
    const auto& a = left[i];
    const auto& b = left[(i + 1) % left.size()];
    area += 0.5 * (a[0] * b[1] - b[0] * a[1]);
  }
  return area;
}

/// Root mean square over 4096 pixels of what samples say of their half planes, less the truth.
inline double half_plane_error(const std::vector<std::string>& settings) {
  Scene scene;
  Graph graph(edge_text("half_planes"), settings);
  const Image image = graph.image(scene);
  double sum = 0;
  for (std::uint32_t y = 0; y < 64; ++y) {
    for (std::uint32_t x = 0; x < 64; ++x) {
      // The shader hands out its own angle and distance, so that no rounding of fract is in the comparison.
      const double truth = covered(image.at(x, y, 2), image.at(x, y, 3));
      sum += std::pow(image.at(x, y, 0) - truth, 2);
    }
  }
  return std::sqrt(sum / 4096);
}

/// Slope of log error over log count, by least squares.
inline double slope_of(const std::vector<std::pair<int, double>>& errors) {
  double x_mean = 0;
  double y_mean = 0;
  for (const auto& [count, error] : errors) {
    x_mean += std::log(count) / static_cast<double>(errors.size());
    y_mean += std::log(error) / static_cast<double>(errors.size());
  }
  double xy = 0;
  double xx = 0;
  for (const auto& [count, error] : errors) {
    xy += (std::log(count) - x_mean) * (std::log(error) - y_mean);
    xx += std::pow(std::log(count) - x_mean, 2);
  }
  return xy / xx;
}

/// Area of a pixel inside of a convex polygon (counterclockwise where y points up), by clipping the pixel.
inline double covered(const std::vector<std::array<double, 2>>& polygon, double left, double bottom) {
  std::vector<std::array<double, 2>> rest{
      {left, bottom}, {left + 1, bottom}, {left + 1, bottom + 1}, {left, bottom + 1}};
  for (std::size_t e = 0; e < polygon.size(); ++e) {
    const auto& from = polygon[e];
    const auto& to = polygon[(e + 1) % polygon.size()];
    const auto side = [&](const std::array<double, 2>& p) {
      return (to[0] - from[0]) * (p[1] - from[1]) - (to[1] - from[1]) * (p[0] - from[0]);
    };
    std::vector<std::array<double, 2>> clipped;
    for (std::size_t i = 0; i < rest.size(); ++i) {
      const auto& a = rest[i];
      const auto& b = rest[(i + 1) % rest.size()];
      if (side(a) > 0) clipped.push_back(a);
      if ((side(a) > 0) == (side(b) > 0)) continue;
      const double t = side(a) / (side(a) - side(b));
      clipped.push_back({a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])});
    }
    rest = std::move(clipped);
  }
  double area = 0;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const auto& b = rest[(i + 1) % rest.size()];
    area += 0.5 * (rest[i][0] * b[1] - b[0] * rest[i][1]);
  }
  return area;
}

/// How a triangle drawn by gbuffer/raster differs from the area that it covers of each pixel.
struct TriangleError {
  int edge_pixels = 0;
  double rms = 0;         // of those
  double off_edges = 0;   // the largest of all others
  glm::dvec2 shift{0.0};  // of the centre of gravity, pixels
};
inline TriangleError triangle_error(const std::vector<std::string>& settings) {
  // One unit of the plane z = 0 is half the picture's height. Alpha of radiance is 1 where there is a surface.
  constexpr int kSize = 32;
  const std::vector<std::array<double, 2>> corners{{-0.71, -0.62}, {0.83, -0.21}, {-0.13, 0.77}};
  Scene scene;
  std::vector<float> positions;
  std::vector<std::array<double, 2>> in_pixels;
  for (const auto& corner : corners) {
    for (const double x : {corner[0], corner[1], 0.0}) positions.push_back(static_cast<float>(x));
    in_pixels.push_back({(0.5 + 0.5 * corner[0]) * kSize, (0.5 + 0.5 * corner[1]) * kSize});
  }
  scene.add_mesh(positions, {}, {0, 1, 2}, dmat4(1.0));
  scene.look({0, 0, 2}, {0, 0, 0}, 2 * std::atan(0.5));
  Graph graph(scene_text(kSize), settings);
  const Image image = graph.image(scene);
  TriangleError found;
  double squares = 0;
  double area = 0;
  for (std::uint32_t y = 0; y < kSize; ++y) {
    for (std::uint32_t x = 0; x < kSize; ++x) {
      const double truth = covered(in_pixels, x, kSize - 1.0 - y);
      const double error = image.at(x, y, 3) - truth;
      area += truth;
      found.shift += error * glm::dvec2(x + 0.5 - 0.5 * kSize, y + 0.5 - 0.5 * kSize);
      if (truth <= 0 || truth >= 1) {
        found.off_edges = std::max(found.off_edges, std::abs(error));
        continue;
      }
      ++found.edge_pixels;
      squares += error * error;
    }
  }
  found.rms = std::sqrt(squares / found.edge_pixels);
  found.shift /= area;
  return found;
}

/// Integral of the distance from 0 over the rectangle between 0 and (x, y); odd in both.
inline double corner_integral(double x, double y) {
  const double a = std::abs(x);
  const double b = std::abs(y);
  if (a == 0 || b == 0) return 0;
  const double size =
      a * b * std::hypot(a, b) / 3 + (a * a * a * std::asinh(b / a) + b * b * b * std::asinh(a / b)) / 6;
  return (x < 0) != (y < 0) ? -size : size;
}

/// Mean distance of a point from those of the unit square around 0.
inline double mean_distance(const std::array<double, 2>& p) {
  double sum = 0;
  for (const double x : {-0.5, 0.5}) {
    for (const double y : {-0.5, 0.5}) sum += (x * y < 0 ? -1 : 1) * corner_integral(x - p[0], y - p[1]);
  }
  return sum;
}

/// Of two points of the unit square.
inline const double kMeanDistance = (2.0 + std::numbers::sqrt2 + 5.0 * std::asinh(1.0)) / 15.0;

/// Mean square of what `count` samples say of the part of a pixel beyond a line, less the truth, over all lines that
/// meet the pixel, each as likely as any other. By Crofton: the measure of lines that separate two points is twice
/// their distance, that of lines that meet the pixel its perimeter, 4; so this is half of
/// mean |p - q| - sum |p - p'| / (2 n^2) - mean |q - q'| / 2, p samples, q points of the pixel.
inline double edge_error_squared(const std::vector<std::array<double, 2>>& offsets, std::size_t count) {
  const auto n = static_cast<double>(count);
  double to_pixel = 0;
  double between = 0;
  for (std::size_t i = 0; i < count; ++i) {
    to_pixel += mean_distance(offsets[i]);
    for (std::size_t j = 0; j < i; ++j) {
      const double x = offsets[i][0] - offsets[j][0];
      const double y = offsets[i][1] - offsets[j][1];
      between += std::sqrt(x * x + y * y);
    }
  }
  return 0.5 * (to_pixel / n - between / (n * n) - 0.5 * kMeanDistance);
}

}  // namespace antialiasing
