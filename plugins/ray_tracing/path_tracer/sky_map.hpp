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
  /// Lux on a plane, as if the sky were even.
  [[nodiscard]] double mean_irradiance() const { return total_ / 12.0; }
  /// cd/m^2 from a unit direction, bilinear between the centres of texels.
  [[nodiscard]] glm::dvec3 radiance(const glm::dvec3& direction) const;
  struct Drawn {
    glm::dvec3 direction;
    double pdf;  // per steradian
  };
  [[nodiscard]] Drawn sample(const glm::dvec2& u) const;
  [[nodiscard]] double pdf(const glm::dvec3& direction) const;

 private:
  [[nodiscard]] glm::dvec2 place(const glm::dvec3& direction) const;  // in texels
  [[nodiscard]] glm::dvec3 texel(std::int64_t column, std::int64_t row) const;
  /// A piece between four places where brightness is known and between which it is bilinear: texel centres, and the
  /// poles. Pieces of row 0 and of the last are half as high.
  struct Patch {
    double a, b, c, d;  // brightness at the corners: above, left to right, and below
    double weight;      // about the lux that it sends
  };
  [[nodiscard]] Patch patch(std::uint32_t column, std::uint32_t row) const;
  [[nodiscard]] double brightness(std::uint32_t column, std::uint32_t node) const;
  [[nodiscard]] double node_place(std::uint32_t node) const;  // in rows of texels from the top
  [[nodiscard]] double density(const Patch& patch, double s, double t, std::uint32_t row, double sine) const;

  std::uint32_t width_ = 0, height_ = 0;
  std::vector<glm::vec3> texels_;
  std::vector<double> rows_;     // sums of weights up to and with each row of patches
  std::vector<double> columns_;  // the same within each row
  double total_ = 0.0;
};

}  // namespace heddle::path_tracer
