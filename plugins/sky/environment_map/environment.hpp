// SPDX-License-Identifier: Apache-2.0
// An equirectangular image -> what the technique's functions read: a padded copy, a cube of mean radiance with its
// mips, the brightest texels apart, irradiance, importance tables. Pure functions in float64; equation numbers are the
// README's.
#pragma once

#include <glm/glm.hpp>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace environment_map {

/// Texels of an equirectangular image: rgba, top row (+Y) first, -Z in the middle, +X to the right of it.
struct Equirectangular {
  std::uint32_t width = 0, height = 0;
  std::span<const float> rgba;
};

/// Unit direction at (u, v) of an equirectangular image, v down.
glm::dvec3 direction_from_uv(double u, double v);
glm::dvec2 uv_from_direction(const glm::dvec3& direction);

/// The image with one texel more on each side: the columns go round, and beyond a pole comes its row from the other
/// side. Filtering the copy with clamping is then right at the seam and at the poles. rgba, (width + 2) x (height + 2).
std::vector<float> pad(const Equirectangular& image);

/// Radiance between the centres of four texels, of a padded image.
class Padded {
 public:
  Padded(std::span<const float> rgba, std::uint32_t width, std::uint32_t height)
      : rgba_(rgba), width_(width), height_(height) {}
  [[nodiscard]] glm::dvec3 at(double u, double v) const;
  [[nodiscard]] glm::dvec3 operator()(const glm::dvec3& direction) const {
    const glm::dvec2 uv = uv_from_direction(direction);
    return at(uv.x, uv.y);
  }
  [[nodiscard]] std::uint32_t width() const { return width_; }
  [[nodiscard]] std::uint32_t height() const { return height_; }

 private:
  std::span<const float> rgba_;
  std::uint32_t width_, height_;  // of the image without padding
};

/// Six faces in Vulkan's order, each `size` x `size`.
struct Cube {
  std::uint32_t size = 0;
  std::vector<glm::dvec3> texels;
  [[nodiscard]] std::size_t index(std::uint32_t face, std::uint32_t x, std::uint32_t y) const {
    return (std::size_t{face} * size + y) * size + x;
  }
};
/// Direction, not normalized, of a point (s, t) in [-1, 1]^2 of a face, t down.
glm::dvec3 cube_direction(std::uint32_t face, double s, double t);
/// Unit direction of a texel's centre.
glm::dvec3 texel_direction(std::uint32_t size, std::uint32_t face, std::uint32_t x, std::uint32_t y);
/// Solid angle of the texels of a face's quarter and so of all: by (x, y).
double cube_solid_angle(std::uint32_t size, std::uint32_t x, std::uint32_t y);

/// Mean radiance of each texel, over points of an even grid at least as fine as the image, weighed by solid angle.
Cube cube_from_image(const Padded& image, std::uint32_t size);
/// Halves each side; texels weighed by their solid angles.
Cube half(const Cube& fine);

/// A direction that sends light, without a size.
struct Delta {
  glm::dvec3 direction{0.0};
  glm::dvec3 irradiance{0.0};            // radiance times solid angle, facing it
  std::uint32_t face = 0, x = 0, y = 0;  // the texel that it came from
};
/// (5) Takes from the cube what is above a threshold: four times the mean, or as much more as leaves at most `count`
/// texels. What is taken and what stays add up to what was there.
std::vector<Delta> take_brightest(Cube& cube, std::size_t count);
/// One for each texel of a cube with sides 2^halvings times smaller: what they sum to, from their middle.
std::vector<Delta> merge(std::span<const Delta> deltas, std::uint32_t halvings);

/// (6) Irradiance on planes of all orientations under a cube, each texel one direction, and deltas.
Cube irradiance(const Cube& cube, std::span<const Delta> deltas, std::uint32_t size);

/// Two-step inversion: rows[i] is the share of light in rows 0 to i, columns[i * width + j] of row i's in columns 0 to
/// j. Light is luminance times solid angle; without any, all directions are alike.
struct Importance {
  std::uint32_t width = 0, height = 0;
  std::vector<float> rows, columns;
};
Importance importance(const Padded& image, std::uint32_t width, std::uint32_t height);

}  // namespace environment_map
