// SPDX-License-Identifier: Apache-2.0
#include "sky_map.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

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

// Steps of a row's guide, in patches: a few sums are looked at one by one.
constexpr std::uint32_t kPatchesAStep = 4;

/// For each of `guide`'s equal steps of the last sum the first sum above its lower end.
void make_guide(std::span<const double> sums, std::span<std::uint32_t> guide) {
  std::uint32_t at = 0;
  for (std::size_t step = 0; step < guide.size(); ++step) {
    const double low = sums.back() * static_cast<double>(step) / static_cast<double>(guide.size());
    while (at + 1 < sums.size() && sums[at] <= low) ++at;
    guide[step] = at;
  }
}

/// The first sum above u times the last one. Chen and Asau 1974, "On Generating Random Variates from an Empirical
/// Distribution".
std::uint32_t find(std::span<const double> sums, std::span<const std::uint32_t> guide, double u) {
  const double wanted = u * sums.back();
  const auto step = std::min(static_cast<std::size_t>(u * static_cast<double>(guide.size())), guide.size() - 1);
  std::uint32_t at = guide[step];
  // Rounding may have set the step one too far.
  while (at > 0 && sums[at - 1] > wanted) --at;
  while (at + 1 < sums.size() && sums[at] <= wanted) ++at;
  return at;
}

}  // namespace

void SkyMap::set(std::uint32_t width, std::uint32_t height, const float* texels) {
  width_ = width;
  height_ = height;
  texels_.resize(std::size_t{width + 2} * (height + 2));
  is_even_ = true;
  for (std::int64_t row = -1; row <= height; ++row)
    for (std::int64_t column = -1; column <= width; ++column) {
      // Beyond a pole the image goes on on the other side.
      const bool is_beyond = row < 0 || row >= height;
      const std::int64_t from_row = row < 0 ? 0 : std::min<std::int64_t>(row, height - 1);
      const std::int64_t from_column = (column + width + (is_beyond ? width / 2 : 0)) % width;
      glm::vec3& texel = texels_[static_cast<std::size_t>((row + 1) * (std::int64_t{width} + 2) + column + 1)];
      for (glm::length_t c = 0; c < 3; ++c) {
        const float value = texels[4 * (from_row * width + from_column) + c];
        texel[c] = std::isfinite(value) && value > 0.0F ? value : 0.0F;
      }
      is_even_ = is_even_ && texel == texels_.front();
    }
  solid_angles_.resize(height + 1);
  sharpness_.resize(height + 1);
  rows_.assign(height + 1, 0.0);
  columns_.assign(std::size_t{width} * (height + 1), 0.0);
  const std::size_t steps = (width + kPatchesAStep - 1) / kPatchesAStep;
  row_guide_.assign(height + 1, 0);
  column_guide_.assign(steps * (height + 1), 0);
  total_ = 0.0;
  for (std::uint32_t row = 0; row <= height; ++row) {
    const double from = node_place(row) / height * pi, to = node_place(row + 1) / height * pi;
    // cos - cos without cancellation.
    solid_angles_[row] = 2.0 * pi / width * 2.0 * std::sin(0.5 * (from + to)) * std::sin(0.5 * (to - from));
    sharpness_[row] = solid_angles_[row] / ((to - from) * (2.0 * pi / width));
    double sum = 0.0;
    for (std::uint32_t column = 0; column < width; ++column) {
      const Patch p = patch(column, row);
      sum += 0.25 * (p.a + p.b + p.c + p.d) * solid_angles_[row];
      columns_[std::size_t{row} * width + column] = sum;
    }
    make_guide(std::span(columns_).subspan(std::size_t{row} * width, width),
               std::span(column_guide_).subspan(row * steps, steps));
    total_ += sum;
    rows_[row] = total_;
  }
  make_guide(rows_, row_guide_);
}

double SkyMap::node_place(std::uint32_t node) const {
  return std::clamp(node - 0.5, 0.0, static_cast<double>(height_));
}

double SkyMap::brightness(std::uint32_t column, std::uint32_t node) const {
  const auto sum = [](const dvec3& v) { return v.x + v.y + v.z; };
  const std::int64_t row = std::int64_t{node} - 1;
  if (node > 0 && node <= height_) return sum(texel(column, row));
  const std::int64_t above = node == 0 ? -1 : std::int64_t{height_} - 1;
  return 0.5 * (sum(texel(column, above)) + sum(texel(column, above + 1)));  // a pole
}

SkyMap::Patch SkyMap::patch(std::uint32_t column, std::uint32_t row) const {
  return {brightness(column, row), brightness(column + 1, row), brightness(column, row + 1),
          brightness(column + 1, row + 1)};
}

/// Of a place in a patch, 0 to 1 each way, per steradian.
double SkyMap::density(const Patch& p, double s, double t, std::uint32_t row, double sine) const {
  const double value = (p.a + (p.b - p.a) * s) * (1.0 - t) + (p.c + (p.d - p.c) * s) * t;
  return value * sharpness_[row] / (total_ * std::max(sine, 1e-12));
}

dvec2 SkyMap::place(const dvec3& d) const {
  const double across = std::sqrt(d.x * d.x + d.z * d.z);
  const double azimuth = across > 0.0 ? std::atan2(d.x, -d.z) : 0.0;
  return {(azimuth / (2.0 * pi) + 0.5) * width_, std::atan2(across, d.y) / pi * height_};
}

dvec3 SkyMap::between(const dvec2& place) const {
  const dvec2 at = place - 0.5;
  const dvec2 low = glm::floor(at), t = at - low;
  const auto column = std::clamp<std::int64_t>(static_cast<std::int64_t>(low.x), -1, std::int64_t{width_} - 1);
  const auto row = std::clamp<std::int64_t>(static_cast<std::int64_t>(low.y), -1, std::int64_t{height_} - 1);
  const dvec3 a = texel(column, row), b = texel(column + 1, row);
  const dvec3 c = texel(column, row + 1), d = texel(column + 1, row + 1);
  const dvec3 above = a + (b - a) * t.x, below = c + (d - c) * t.x;  // of equals exactly the same
  return above + (below - above) * t.y;
}

dvec3 SkyMap::radiance(const dvec3& direction) const {
  if (!shines()) return dvec3(0.0);
  return is_even_ ? dvec3(texels_.front()) : between(place(direction));
}

SkyMap::Drawn SkyMap::sample(const dvec2& u) const {
  // u.y chooses the row of patches and the height in one of them, u.x the column and the place across.
  const std::uint32_t row = find(rows_, row_guide_, u.y);
  const double before = row > 0 ? rows_[row - 1] : 0.0;
  const double v = std::clamp((u.y * total_ - before) / std::max(rows_[row] - before, 1e-300), 0.0, 1.0);
  const std::size_t steps = column_guide_.size() / rows_.size();
  const auto sums = std::span(columns_).subspan(std::size_t{row} * width_, width_);
  const std::uint32_t column = find(sums, std::span(column_guide_).subspan(row * steps, steps), u.x);
  const double left = column > 0 ? sums[column - 1] : 0.0;
  const double w = std::clamp((u.x * sums.back() - left) / std::max(sums[column] - left, 1e-300), 0.0, 1.0);
  const Patch p = patch(column, row);
  const double t = sample_linear(v, p.a + p.b, p.c + p.d);
  const double s = sample_linear(w, p.a + (p.c - p.a) * t, p.b + (p.d - p.b) * t);
  const dvec2 at(column + 0.5 + s, node_place(row) + t * (node_place(row + 1) - node_place(row)));
  const double polar = at.y / height_ * pi, azimuth = (at.x / width_ - 0.5) * 2.0 * pi, sine = std::sin(polar);
  // The last patch of a row goes around the seam, and `between` begins at it.
  const dvec2 within(at.x < width_ + 0.5 ? at.x : at.x - width_, at.y);
  return {{sine * std::sin(azimuth), std::cos(polar), -sine * std::cos(azimuth)},
          density(p, s, t, row, sine),
          between(within)};
}

SkyMap::Drawn SkyMap::look(const dvec3& direction) const {
  if (!shines()) return {direction};
  const dvec2 at = place(direction);
  const double across = at.x >= 0.5 ? at.x - 0.5 : at.x - 0.5 + width_;
  const auto column = std::min(static_cast<std::uint32_t>(across), width_ - 1);
  const auto row = static_cast<std::uint32_t>(std::clamp(at.y + 0.5, 0.0, static_cast<double>(height_)));
  const double height = node_place(row + 1) - node_place(row);
  const double t = std::clamp((at.y - node_place(row)) / height, 0.0, 1.0);
  const double sine = std::sqrt(direction.x * direction.x + direction.z * direction.z);
  return {direction, density(patch(column, row), across - column, t, row, sine), between(at)};
}

}  // namespace heddle::path_tracer
