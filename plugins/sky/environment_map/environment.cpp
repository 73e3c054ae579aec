// SPDX-License-Identifier: Apache-2.0
// Sampling, resampling and sums over the sphere, in float64 (see environment.hpp).
#include "environment.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <numeric>

namespace environment_map {
namespace {

constexpr double kPi = std::numbers::pi;
/// Samples manage texels up to this many times the mean without help.
constexpr double kLeastContrast = 4.0;

double luminance(const glm::dvec3& color) {
  return glm::dot(color, glm::dvec3(0.2126, 0.7152, 0.0722));  // ITU-R BT.709-6, item 3.2
}

/// Signed solid angle of the rectangle from a face's centre to (s, t).
double corner_solid_angle(double s, double t) {
  return std::atan2(s * t, std::sqrt(s * s + t * t + 1.0));
}

}  // namespace

glm::dvec3 direction_from_uv(double u, double v) {
  const double azimuth = (u - 0.5) * 2.0 * kPi, polar = v * kPi;
  return {std::sin(azimuth) * std::sin(polar), std::cos(polar), -std::cos(azimuth) * std::sin(polar)};
}

glm::dvec2 uv_from_direction(const glm::dvec3& direction) {
  const double across = std::hypot(direction.x, direction.z);
  const double azimuth = across > 0.0 ? std::atan2(direction.x, -direction.z) : 0.0;
  return {azimuth / (2.0 * kPi) + 0.5, std::atan2(across, direction.y) / kPi};
}

std::vector<float> pad(const Equirectangular& image) {
  const auto width = static_cast<std::int64_t>(image.width), height = static_cast<std::int64_t>(image.height);
  std::vector<float> padded(static_cast<std::size_t>((width + 2) * (height + 2) * 4));
  const auto texel = [&](std::int64_t column, std::int64_t row) {
    return image.rgba.data() + (row * width + (column + width) % width) * 4;
  };
  for (std::int64_t row = -1; row <= height; ++row) {
    const bool is_beyond_pole = row < 0 || row >= height;
    const std::int64_t from = std::clamp<std::int64_t>(row, 0, height - 1);
    for (std::int64_t column = -1; column <= width; ++column) {
      float* out = padded.data() + ((row + 1) * (width + 2) + column + 1) * 4;
      // Half a turn is a whole number of columns, or lies between two.
      const float* a = is_beyond_pole ? texel(column + width / 2, from) : texel(column, from);
      const float* b = is_beyond_pole ? texel(column + (width + 1) / 2, from) : a;
      for (int c = 0; c < 4; ++c) out[c] = 0.5F * a[c] + 0.5F * b[c];
    }
  }
  return padded;
}

glm::dvec3 Padded::at(double u, double v) const {
  const double x = u * width_ + 0.5, y = v * height_ + 0.5;
  const auto x0 = std::min(static_cast<std::size_t>(x), std::size_t{width_});
  const auto y0 = std::min(static_cast<std::size_t>(y), std::size_t{height_});
  const double fx = x - static_cast<double>(x0), fy = y - static_cast<double>(y0);
  const float* upper = rgba_.data() + (y0 * (width_ + 2) + x0) * 4;
  const float* lower = upper + (std::size_t{width_} + 2) * 4;
  const auto texel = [](const float* t) { return glm::dvec3(t[0], t[1], t[2]); };
  return (texel(upper) * (1.0 - fx) + texel(upper + 4) * fx) * (1.0 - fy) +
         (texel(lower) * (1.0 - fx) + texel(lower + 4) * fx) * fy;
}

glm::dvec3 cube_direction(std::uint32_t face, double s, double t) {
  switch (face) {
    case 0:
      return {1, -t, -s};
    case 1:
      return {-1, -t, s};
    case 2:
      return {s, 1, t};
    case 3:
      return {s, -1, -t};
    case 4:
      return {s, -t, 1};
    default:
      return {-s, -t, -1};
  }
}

glm::dvec3 texel_direction(std::uint32_t size, std::uint32_t face, std::uint32_t x, std::uint32_t y) {
  return glm::normalize(cube_direction(face, (2.0 * x + 1.0) / size - 1.0, (2.0 * y + 1.0) / size - 1.0));
}

double cube_solid_angle(std::uint32_t size, std::uint32_t x, std::uint32_t y) {
  const double s0 = 2.0 * x / size - 1.0, s1 = 2.0 * (x + 1) / size - 1.0;
  const double t0 = 2.0 * y / size - 1.0, t1 = 2.0 * (y + 1) / size - 1.0;
  return corner_solid_angle(s1, t1) - corner_solid_angle(s0, t1) - corner_solid_angle(s1, t0) +
         corner_solid_angle(s0, t0);
}

namespace {

/// Solid angles of a face's texels, row by row.
std::vector<double> solid_angles(std::uint32_t size) {
  std::vector<double> table;
  table.reserve(std::size_t{size} * size);
  for (std::uint32_t y = 0; y < size; ++y)
    for (std::uint32_t x = 0; x < size; ++x) table.push_back(cube_solid_angle(size, x, y));
  return table;
}

/// A direction's texel; the face by its largest component.
std::size_t texel_of(const Cube& cube, const glm::dvec3& d) {
  const glm::dvec3 size = glm::abs(d);
  std::uint32_t face = 0;
  glm::dvec3 st(0.0);  // s, t, both over z
  if (size.x >= size.y && size.x >= size.z) {
    face = d.x > 0.0 ? 0 : 1;
    st = {d.x > 0.0 ? -d.z : d.z, -d.y, size.x};
  } else if (size.y >= size.z) {
    face = d.y > 0.0 ? 2 : 3;
    st = {d.x, d.y > 0.0 ? d.z : -d.z, size.y};
  } else {
    face = d.z > 0.0 ? 4 : 5;
    st = {d.z > 0.0 ? d.x : -d.x, -d.y, size.z};
  }
  const auto place = [&](double coordinate) {
    const double texel = (coordinate / st.z * 0.5 + 0.5) * cube.size;
    return static_cast<std::uint32_t>(std::clamp(texel, 0.0, cube.size - 0.5));
  };
  return cube.index(face, place(st.x), place(st.y));
}

/// Calls visit(direction, radiance, solid angle, column, row) on an even grid of `columns` x `rows`, which are
/// multiples of the image's.
template <typename Visit>
void visit_grid(const Padded& image, std::uint32_t columns, std::uint32_t rows, Visit visit) {
  std::vector<glm::dvec2> azimuths;  // sine, cosine
  for (std::uint32_t x = 0; x < columns; ++x) {
    const double azimuth = ((x + 0.5) / columns - 0.5) * 2.0 * kPi;
    azimuths.emplace_back(std::sin(azimuth), std::cos(azimuth));
  }
  for (std::uint32_t y = 0; y < rows; ++y) {
    const double polar = kPi * (y + 0.5) / rows, sine = std::sin(polar), cosine = std::cos(polar);
    const double solid_angle = (std::cos(kPi * y / rows) - std::cos(kPi * (y + 1) / rows)) * 2.0 * kPi / columns;
    for (std::uint32_t x = 0; x < columns; ++x)
      visit(glm::dvec3(azimuths[x].x * sine, cosine, -azimuths[x].y * sine),
            image.at((x + 0.5) / columns, (y + 0.5) / rows), solid_angle, x, y);
  }
}

std::uint32_t at_least(std::uint32_t size, std::uint32_t wanted) {
  return size * ((wanted + size - 1) / size);
}

}  // namespace

Cube cube_from_image(const Padded& image, std::uint32_t size) {
  Cube cube{size, std::vector<glm::dvec3>(std::size_t{6} * size * size)};
  std::vector<double> weights(cube.texels.size());
  // The corners' texels are 2 / (3 size) radians long and as much less wide: half of that reaches all.
  visit_grid(
      image, at_least(image.width(), 16 * size), at_least(image.height(), 8 * size),
      [&](const glm::dvec3& direction, const glm::dvec3& radiance, double solid_angle, std::uint32_t, std::uint32_t) {
        const std::size_t texel = texel_of(cube, direction);
        cube.texels[texel] += radiance * solid_angle;
        weights[texel] += solid_angle;
      });
  for (std::size_t i = 0; i < weights.size(); ++i) cube.texels[i] /= weights[i];
  return cube;
}

Cube half(const Cube& fine) {
  const std::uint32_t size = fine.size / 2;
  Cube coarse{size, std::vector<glm::dvec3>(std::size_t{6} * size * size)};
  const std::vector<double> table = solid_angles(fine.size);
  for (std::uint32_t face = 0; face < 6; ++face)
    for (std::uint32_t y = 0; y < size; ++y)
      for (std::uint32_t x = 0; x < size; ++x) {
        glm::dvec3 sum(0.0);
        double weights = 0.0;
        for (const std::uint32_t j : {2 * y, 2 * y + 1})
          for (const std::uint32_t i : {2 * x, 2 * x + 1}) {
            const double weight = table[std::size_t{j} * fine.size + i];
            sum += weight * fine.texels[fine.index(face, i, j)];
            weights += weight;
          }
        coarse.texels[coarse.index(face, x, y)] = sum / weights;
      }
  return coarse;
}

std::vector<Delta> take_brightest(Cube& cube, std::size_t count) {
  if (count == 0 || cube.texels.size() <= count) return {};
  const std::vector<double> table = solid_angles(cube.size);
  std::vector<double> brightness;
  double mean = 0.0;
  for (std::size_t i = 0; i < cube.texels.size(); ++i) {
    brightness.push_back(luminance(cube.texels[i]));
    mean += brightness.back() * table[i % table.size()] / (4.0 * kPi);
  }
  std::vector<double> ranked = brightness;
  std::nth_element(ranked.begin(), ranked.begin() + static_cast<std::ptrdiff_t>(count), ranked.end(), std::greater<>());
  const double threshold = std::max(ranked[count], kLeastContrast * mean);
  std::vector<Delta> deltas;
  for (std::uint32_t face = 0; face < 6; ++face)
    for (std::uint32_t y = 0; y < cube.size; ++y)
      for (std::uint32_t x = 0; x < cube.size; ++x) {
        const std::size_t i = cube.index(face, x, y);
        if (brightness[i] <= threshold) continue;
        glm::dvec3& texel = cube.texels[i];
        const glm::dvec3 stays = texel * (threshold / brightness[i]);
        deltas.push_back({texel_direction(cube.size, face, x, y),
                          (texel - stays) * table[std::size_t{y} * cube.size + x], face, x, y});
        texel = stays;
      }
  return deltas;
}

std::vector<Delta> merge(std::span<const Delta> deltas, std::uint32_t halvings) {
  std::map<std::array<std::uint32_t, 3>, Delta> cells;
  for (const Delta& delta : deltas) {
    Delta& cell = cells[{delta.face, delta.y >> halvings, delta.x >> halvings}];
    cell.direction += delta.direction * luminance(delta.irradiance);
    cell.irradiance += delta.irradiance;
    cell.face = delta.face;
    cell.x = delta.x >> halvings;
    cell.y = delta.y >> halvings;
  }
  std::vector<Delta> merged;
  for (auto& [place, cell] : cells) {
    cell.direction = glm::normalize(cell.direction);
    merged.push_back(cell);
  }
  return merged;
}

Cube irradiance(const Cube& cube, std::span<const Delta> deltas, std::uint32_t size) {
  std::vector<glm::dvec4> directions;  // w: solid angle
  for (std::uint32_t face = 0; face < 6; ++face)
    for (std::uint32_t y = 0; y < cube.size; ++y)
      for (std::uint32_t x = 0; x < cube.size; ++x)
        directions.emplace_back(texel_direction(cube.size, face, x, y), cube_solid_angle(cube.size, x, y));
  Cube out{size, std::vector<glm::dvec3>(std::size_t{6} * size * size)};
  for (std::uint32_t face = 0; face < 6; ++face)
    for (std::uint32_t y = 0; y < size; ++y)
      for (std::uint32_t x = 0; x < size; ++x) {
        const glm::dvec3 normal = texel_direction(size, face, x, y);
        glm::dvec3 sum(0.0);
        double weights = 0.0;
        for (std::size_t i = 0; i < directions.size(); ++i) {
          const double weight = directions[i].w * std::max(glm::dot(glm::dvec3(directions[i]), normal), 0.0);
          sum += weight * cube.texels[i];
          weights += weight;
        }
        // The weights add up to pi but for the size of texels: divided by, they make even light exact.
        glm::dvec3& texel = out.texels[out.index(face, x, y)];
        texel = sum * (kPi / weights);
        for (const Delta& delta : deltas) texel += delta.irradiance * std::max(glm::dot(delta.direction, normal), 0.0);
      }
  return out;
}

Importance importance(const Padded& image, std::uint32_t width, std::uint32_t height) {
  std::vector<double> light(std::size_t{width} * height);
  // A multiple of both the image's and the tables' texels is not needed: each point falls into one of the tables'.
  const std::uint32_t columns = at_least(image.width(), 2 * width), rows = at_least(image.height(), 2 * height);
  visit_grid(image, columns, rows,
             [&](const glm::dvec3&, const glm::dvec3& radiance, double solid_angle, std::uint32_t x, std::uint32_t y) {
               const auto column = static_cast<std::size_t>(std::uint64_t{x} * width / columns);
               const auto row = static_cast<std::size_t>(std::uint64_t{y} * height / rows);
               light[row * width + column] += luminance(radiance) * solid_angle;
             });
  Importance tables{width, height, std::vector<float>(height), std::vector<float>(light.size())};
  std::vector<double> marginal;
  for (std::uint32_t y = 0; y < height; ++y) {
    const auto row = std::span(light).subspan(std::size_t{y} * width, width);
    std::partial_sum(row.begin(), row.end(), row.begin());
    marginal.push_back(row.back());
    for (std::uint32_t x = 0; x < width; ++x)
      tables.columns[std::size_t{y} * width + x] =
          static_cast<float>(row.back() > 0.0 ? row[x] / row.back() : (x + 1.0) / width);
  }
  std::partial_sum(marginal.begin(), marginal.end(), marginal.begin());
  for (std::uint32_t y = 0; y < height; ++y)
    tables.rows[y] = static_cast<float>(marginal.back() > 0.0 ? marginal[y] / marginal.back()
                                                              : 0.5 - 0.5 * std::cos(kPi * (y + 1) / height));
  return tables;
}

}  // namespace environment_map
