// SPDX-License-Identifier: Apache-2.0
#include "sky_map.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace heddle::path_tracer {

using glm::dvec2;
using glm::dvec3;
using std::numbers::pi;

void SkyMap::set(std::uint32_t width, std::uint32_t height, const float* texels) {
  width_ = width;
  height_ = height;
  texels_.resize(std::size_t{width} * height);
  for (std::size_t i = 0; i < texels_.size(); ++i)
    for (glm::length_t c = 0; c < 3; ++c) {
      const float value = texels[4 * i + static_cast<std::size_t>(c)];
      texels_[i][c] = std::isfinite(value) && value > 0.0F ? value : 0.0F;
    }
  cosines_.resize(height + 1);
  for (std::uint32_t row = 0; row <= height; ++row) cosines_[row] = std::cos(pi * row / height);
  cosines_.front() = 1.0;
  cosines_.back() = -1.0;

  // The mean of bilinear interpolation over a cell: 1/8, 3/4, 1/8 of texels each way. Nothing that shines weighs 0.
  constexpr std::array<double, 3> kShares{0.125, 0.75, 0.125};
  rows_.assign(height, 0.0);
  columns_.assign(texels_.size(), 0.0);
  total_ = 0.0;
  for (std::uint32_t row = 0; row < height; ++row) {
    double sum = 0.0;
    for (std::uint32_t column = 0; column < width; ++column) {
      double mean = 0.0;
      for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i) {
          const dvec3 t = texel(std::int64_t{column} + i - 1, std::int64_t{row} + j - 1);
          mean += kShares[static_cast<std::size_t>(i)] * kShares[static_cast<std::size_t>(j)] * (t.x + t.y + t.z);
        }
      sum += mean * solid_angle(row);
      columns_[std::size_t{row} * width + column] = sum;
    }
    total_ += sum;
    rows_[row] = total_;
  }
}

double SkyMap::solid_angle(std::uint32_t row) const {
  return 2.0 * pi / width_ * (cosines_[row] - cosines_[row + 1]);
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

double SkyMap::weight(std::uint32_t column, std::uint32_t row) const {
  const std::size_t i = std::size_t{row} * width_ + column;
  return columns_[i] - (column > 0 ? columns_[i - 1] : 0.0);
}

SkyMap::Drawn SkyMap::sample(const dvec2& u) const {
  // u.y chooses the row and the place in it, u.x the column.
  const double wanted = u.y * total_;
  const auto row = static_cast<std::uint32_t>(
      std::min<std::ptrdiff_t>(std::upper_bound(rows_.begin(), rows_.end(), wanted) - rows_.begin(), height_ - 1));
  const double before = row > 0 ? rows_[row - 1] : 0.0;
  const double v = std::clamp((wanted - before) / std::max(rows_[row] - before, 1e-300), 0.0, 1.0);
  const auto first = columns_.begin() + std::ptrdiff_t{row} * width_, last = first + width_;
  const double wanted_column = u.x * *(last - 1);
  const auto column =
      static_cast<std::uint32_t>(std::min<std::ptrdiff_t>(std::upper_bound(first, last, wanted_column) - first, width_ - 1));
  const double cell = weight(column, row);
  const double s =
      std::clamp((wanted_column - (*(first + column) - cell)) / std::max(cell, 1e-300), 0.0, 1.0);
  const double cosine = cosines_[row] + (cosines_[row + 1] - cosines_[row]) * v;
  const double sine = std::sqrt(std::max(1.0 - cosine * cosine, 0.0));
  const double azimuth = ((column + s) / width_ - 0.5) * 2.0 * pi;
  return {{sine * std::sin(azimuth), cosine, -sine * std::cos(azimuth)}, cell / (total_ * solid_angle(row))};
}

double SkyMap::pdf(const dvec3& direction) const {
  if (!shines()) return 0.0;
  const dvec2 at = place(direction);
  const auto column = static_cast<std::uint32_t>(std::clamp(at.x, 0.0, width_ - 1.0));
  // By the cosine, as sample() draws rows.
  const auto below = std::upper_bound(cosines_.begin(), cosines_.end(), direction.y, std::greater<>());
  const auto row = static_cast<std::uint32_t>(
      std::clamp<std::ptrdiff_t>(below - cosines_.begin() - 1, 0, std::ptrdiff_t{height_} - 1));
  return weight(column, row) / (total_ * solid_angle(row));
}

}  // namespace heddle::path_tracer
