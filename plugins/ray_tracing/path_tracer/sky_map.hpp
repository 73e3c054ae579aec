// SPDX-License-Identifier: Apache-2.0
// An equirectangular image of the sky -> radiance by direction, and directions drawn by how bright they are. README
// (6).
#pragma once

#include <glm/glm.hpp>

#include <cstdint>
#include <vector>

namespace heddle::path_tracer {

/// -Z in the middle, +X to the right of it, top row +Y, as HeddleEnvironment.
class SkyMap {
 public:
  /// texels: width x height rgba, borrowed for this call. Values that are not finite or negative count as 0.
  void set(std::uint32_t width, std::uint32_t height, const float* texels);
  void clear() { total_ = 0.0; }

  /// True if it sends light at all.
  [[nodiscard]] bool shines() const { return total_ > 0.0; }
  /// The same from everywhere.
  [[nodiscard]] bool is_even() const { return is_even_; }
  /// Lux on a plane, as if the sky were even.
  [[nodiscard]] double mean_irradiance() const { return total_ / 12.0; }
  /// cd/m^2 from a unit direction, bilinear between the centres of texels.
  [[nodiscard]] glm::dvec3 radiance(const glm::dvec3& direction) const;
  struct Drawn {
    glm::dvec3 direction{0.0};
    double pdf = 0.0;  // per steradian
    glm::dvec3 radiance{0.0};
  };
  [[nodiscard]] Drawn sample(const glm::dvec2& u) const;
  [[nodiscard]] double pdf(const glm::dvec3& direction) const { return look(direction).pdf; }
  /// Both of a direction, for the price of one.
  [[nodiscard]] Drawn look(const glm::dvec3& direction) const;

 private:
  [[nodiscard]] glm::dvec2 place(const glm::dvec3& direction) const;  // in texels
  [[nodiscard]] glm::dvec3 between(const glm::dvec2& place) const;    // bilinear
  /// From -1 to width, and to height: around the seam, and beyond a pole what is on its other side.
  [[nodiscard]] const glm::vec3& texel(std::int64_t column, std::int64_t row) const {
    return texels_[static_cast<std::size_t>((row + 1) * (std::int64_t{width_} + 2) + column + 1)];
  }
  /// A piece between four places where brightness is known and between which it is bilinear: texel centres, and the
  /// poles. Pieces of row 0 and of the last are half as high.
  struct Patch {
    double a, b, c, d;  // brightness at the corners: above, left to right, and below
  };
  [[nodiscard]] Patch patch(std::uint32_t column, std::uint32_t row) const;
  [[nodiscard]] double brightness(std::uint32_t column, std::uint32_t node) const;
  [[nodiscard]] double node_place(std::uint32_t node) const;  // in rows of texels from the top
  [[nodiscard]] double density(const Patch& patch, double s, double t, std::uint32_t row, double sine) const;

  std::uint32_t width_ = 0, height_ = 0;
  bool is_even_ = false;
  std::vector<glm::vec3> texels_;  // with a margin of one
  std::vector<double> rows_;       // sums of weights - about the lux that a patch sends - up to and with each row
  std::vector<double> columns_;    // the same within each row
  // Where to begin to look for a share of a sum: the answer for the lower end of each of a number of equal steps.
  std::vector<std::uint32_t> row_guide_, column_guide_;
  std::vector<double> solid_angles_, sharpness_;  // by row, of a patch; of it over its size in angles
  double total_ = 0.0;
};

}  // namespace heddle::path_tracer
