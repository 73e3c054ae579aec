// SPDX-License-Identifier: Apache-2.0
// A hemicube's five faces: where they lie in an element's tile, what they show, and how much of the cosine-weighted
// hemisphere each pixel is, in closed form. Pure, in float64.
//
// Half a cube of side 2 stands on the element, its axes (t, b, n). The tile is `side` pixels wide and three times as
// high: the upper face, then the four sides, of half the height each, their upper rims on top.
#pragma once

#include <glm/glm.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

namespace hemicube {

struct Face {
  glm::dvec3 right, up, forward;    // in the axes (t, b, n)
  std::uint32_t first_row, height;  // in the tile, pixels
};

/// Face 0 looks along the normal, the others along t, b, -t, -b; `side` is even.
inline std::array<Face, 5> faces(std::uint32_t side) {
  const std::uint32_t half = side / 2;
  const glm::dvec3 t(1, 0, 0), b(0, 1, 0), n(0, 0, 1);
  return {{{-t, b, n, 0, side},
           {-b, n, t, side, half},
           {t, n, b, side + half, half},
           {b, n, -t, side + 2 * half, half},
           {-t, n, -b, side + 3 * half, half}}};
}

/// README equation (2): the cosine over the upper face from its middle to (x, y), over pi.
inline double upper_integral(double x, double y) {
  const double a = std::sqrt(1 + x * x), b = std::sqrt(1 + y * y);
  return (x / a * std::atan(y / a) + y / b * std::atan(x / b)) / (2 * std::numbers::pi);
}
/// README equation (3): up to a part that differences leave out, the same over a side face, z above its foot.
inline double side_integral(double x, double z) {
  const double c = std::sqrt(1 + z * z);
  return -std::atan(x / c) / (2 * std::numbers::pi * c);
}

/// Of each pixel of the tile, row by row; their sum is 1.
inline std::vector<double> weights(std::uint32_t side) {
  std::vector<double> all;
  all.reserve(std::size_t{3} * side * side);
  const double step = 2.0 / side;
  const auto add = [&](const auto& integral, std::uint32_t height) {
    for (std::uint32_t j = 0; j < height; ++j)
      for (std::uint32_t i = 0; i < side; ++i) {
        const double x0 = -1 + i * step, x1 = -1 + (i + 1) * step, y1 = 1 - j * step, y0 = 1 - (j + 1) * step;
        all.push_back(integral(x1, y1) - integral(x0, y1) - integral(x1, y0) + integral(x0, y0));
      }
  };
  add(upper_integral, side);
  for (int face = 0; face < 4; ++face) add(side_integral, side / 2);
  return all;
}

/// clip_from_view of a face for points (right, up, -forward): the upper face looks as far to all sides, the others
/// from their foot up. Reversed depth, near / distance.
inline glm::dmat4 projection(bool is_upper, double near_distance) {
  glm::dmat4 clip(0.0);
  clip[0][0] = 1.0;
  clip[1][1] = is_upper ? -1.0 : -2.0;
  clip[2][1] = is_upper ? 0.0 : -1.0;  // y = distance - 2 up: -1 at the upper rim, 1 at the foot
  clip[2][3] = -1.0;
  clip[3][2] = near_distance;
  return clip;
}

/// Orthonormal axes (t, b, n), turned by an angle about n. Pixar's branchless frame: Duff, Burgess, Christensen, Hery,
/// Kensler, Liani and Villemin 2017, "Building an Orthonormal Basis, Revisited", JCGT 6(1).
inline glm::dmat3 axes(const glm::dvec3& n, double angle) {
  const double sign = std::copysign(1.0, n.z), a = -1 / (sign + n.z), b = n.x * n.y * a;
  const glm::dvec3 t(1 + sign * n.x * n.x * a, sign * b, -sign * n.x), s(b, sign + n.y * n.y * a, -n.y);
  return {t * std::cos(angle) + s * std::sin(angle), s * std::cos(angle) - t * std::sin(angle), n};
}

}  // namespace hemicube
