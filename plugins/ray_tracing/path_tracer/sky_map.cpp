// SPDX-License-Identifier: Apache-2.0
#include "sky_map.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace heddle::path_tracer {

using glm::dvec2;
using glm::dvec3;
using std::numbers::pi;

namespace {

/// Draws x in [0, 1] as dense as a + (b - a) x.
double sample_linear(double u, double a, double b) {
  if (!(a + b > 0.0)) return u;
  return std::min(u * (a + b) / std::max(a + std::sqrt(a * a + (b * b - a * a) * u), 1e-300), 1.0);
}

}  // namespace

void SkyMap::set(std::uint32_t width, std::uint32_t height, const float* texels) {
  width_ = width;
  height_ = height;
  texels_.resize(std::size_t{width} * height);
  for (std::size_t i = 0; i < texels_.size(); ++i)
    for (glm::length_t c = 0; c < 3; ++c) {
      const float value = texels[4 * i + static_cast<std::size_t>(c)];
      texels_[i][c] = std::isfinite(value) && value > 0.0F ? value : 0.0F;
    }
  rows_.assign(height + 1, 0.0);
  columns_.assign(std::size_t{width} * (height + 1), 0.0);
  total_ = 0.0;
  for (std::uint32_t row = 0; row <= height; ++row) {
    double sum = 0.0;
    for (std::uint32_t column = 0; column < width; ++column) {
      sum += patch(column, row).weight;
      columns_[std::size_t{row} * width + column] = sum;
    }
    total_ += sum;
    rows_[row] = total_;
  }
}

double SkyMap::node_place(std::uint32_t node) const {
  return std::clamp(node - 0.5, 0.0, static_cast<double>(height_));
}

double SkyMap::brightness(std::uint32_t column, std::uint32_t node) const {
  const auto sum = [](const dvec3& v) { return v.x + v.y + v.z; };
  const std::int64_t row = std::int64_t{node} - 1;
  if (node > 0 && node <= height_) return sum(texel(column, row));
  return 0.5 * (sum(texel(column, row)) + sum(texel(column, row + 1)));  // a pole
}

SkyMap::Patch SkyMap::patch(std::uint32_t column, std::uint32_t row) const {
  const std::uint32_t next = (column + 1) % width_;
  Patch p{brightness(column, row), brightness(next, row), brightness(column, row + 1), brightness(next, row + 1), 0.0};
  const double from = node_place(row) / height_ * pi, to = node_place(row + 1) / height_ * pi;
  // cos - cos without cancellation.
  const double solid_angle = 2.0 * pi / width_ * 2.0 * std::sin(0.5 * (from + to)) * std::sin(0.5 * (to - from));
  p.weight = 0.25 * (p.a + p.b + p.c + p.d) * solid_angle;
  return p;
}

/// Of a place in a patch, 0 to 1 each way, per steradian.
double SkyMap::density(const Patch& p, double s, double t, std::uint32_t row, double sine) const {
  const double mean = 0.25 * (p.a + p.b + p.c + p.d);
  if (!(mean > 0.0)) return 0.0;
  const double value = (p.a + (p.b - p.a) * s) * (1.0 - t) + (p.c + (p.d - p.c) * s) * t;
  const double size = (node_place(row + 1) - node_place(row)) / height_ * pi * (2.0 * pi / width_);
  return p.weight / total_ * value / (mean * size * std::max(sine, 1e-12));
}

dvec3 SkyMap::texel(std::int64_t column, std::int64_t row) const {
  // Beyond a pole the image goes on on the other side.
  if (row < 0 || row >= height_) {
    row = row < 0 ? -1 - row : 2 * std::int64_t{height_} - 1 - row;
    column += width_ / 2;
  }
  const std::int64_t wrapped = ((column % width_) + width_) % width_;
  return texels_[static_cast<std::size_t>(row * width_ + wrapped)];
}

dvec2 SkyMap::place(const dvec3& d) const {
  const double across = std::hypot(d.x, d.z);
  const double azimuth = across > 0.0 ? std::atan2(d.x, -d.z) : 0.0;
  return {(azimuth / (2.0 * pi) + 0.5) * width_, std::atan2(across, d.y) / pi * height_};
}

dvec3 SkyMap::radiance(const dvec3& direction) const {
  if (!shines()) return dvec3(0.0);
  const dvec2 at = place(direction) - 0.5;
  const dvec2 low = glm::floor(at), t = at - low;
  const auto column = static_cast<std::int64_t>(low.x), row = static_cast<std::int64_t>(low.y);
  const dvec3 a = texel(column, row), b = texel(column + 1, row);
  const dvec3 c = texel(column, row + 1), d = texel(column + 1, row + 1);
  const dvec3 above = a + (b - a) * t.x, below = c + (d - c) * t.x;  // of equals exactly the same
  return above + (below - above) * t.y;
}

SkyMap::Drawn SkyMap::sample(const dvec2& u) const {
  // u.y chooses the row of patches and the height in one of them, u.x the column and the place across.
  const double wanted = u.y * total_;
  const auto row = static_cast<std::uint32_t>(
      std::min<std::ptrdiff_t>(std::upper_bound(rows_.begin(), rows_.end(), wanted) - rows_.begin(), height_));
  const double before = row > 0 ? rows_[row - 1] : 0.0;
  const double v = std::clamp((wanted - before) / std::max(rows_[row] - before, 1e-300), 0.0, 1.0);
  const auto first = columns_.begin() + std::ptrdiff_t{row} * width_, last = first + width_;
  const double wanted_column = u.x * *(last - 1);
  const auto column = static_cast<std::uint32_t>(
      std::min<std::ptrdiff_t>(std::upper_bound(first, last, wanted_column) - first, width_ - 1));
  const double left = column > 0 ? *(first + column - 1) : 0.0;
  const double w = std::clamp((wanted_column - left) / std::max(*(first + column) - left, 1e-300), 0.0, 1.0);
  const Patch p = patch(column, row);
  const double t = sample_linear(v, p.a + p.b, p.c + p.d);
  const double s = sample_linear(w, p.a + (p.c - p.a) * t, p.b + (p.d - p.b) * t);
  const double polar = (node_place(row) + t * (node_place(row + 1) - node_place(row))) / height_ * pi;
  const double azimuth = ((column + 0.5 + s) / width_ - 0.5) * 2.0 * pi, sine = std::sin(polar);
  return {{sine * std::sin(azimuth), std::cos(polar), -sine * std::cos(azimuth)}, density(p, s, t, row, sine)};
}

double SkyMap::pdf(const dvec3& direction) const {
  if (!shines()) return 0.0;
  const dvec2 at = place(direction);
  const double across = at.x >= 0.5 ? at.x - 0.5 : at.x - 0.5 + width_;
  const auto column = std::min(static_cast<std::uint32_t>(across), width_ - 1);
  const auto row = static_cast<std::uint32_t>(std::clamp(at.y + 0.5, 0.0, static_cast<double>(height_)));
  const double height = node_place(row + 1) - node_place(row);
  const double t = std::clamp((at.y - node_place(row)) / height, 0.0, 1.0);
  return density(patch(column, row), across - column, t, row, std::hypot(direction.x, direction.z));
}

}  // namespace heddle::path_tracer
