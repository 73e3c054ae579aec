// SPDX-License-Identifier: Apache-2.0
// Points of the unit square -> directions, and axes around one. Pure, in float64.
#pragma once

#include <glm/glm.hpp>

#include <cmath>
#include <numbers>

namespace sampling {

/// [0,1)^2 -> the hemisphere around +Z with density cos(theta) / pi: the concentric map of Shirley and Chiu 1997, "A
/// Low Distortion Map Between Disk and Square", lifted (Malley's method).
inline glm::dvec3 sample_cosine_hemisphere(const glm::dvec2& u) {
  const double a = 2.0 * u.x - 1.0;
  const double b = 2.0 * u.y - 1.0;
  if (a == 0.0 && b == 0.0) {
    return {0.0, 0.0, 1.0};
  }
  const bool is_a = std::abs(a) > std::abs(b);
  const double r = is_a ? a : b;
  const double phi =
      is_a ? std::numbers::pi / 4.0 * (b / a) : std::numbers::pi / 2.0 - std::numbers::pi / 4.0 * (a / b);
  return {r * std::cos(phi), r * std::sin(phi), std::sqrt(std::fmax(0.0, 1.0 - r * r))};
}

/// Columns: tangent, bitangent, normal. Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
inline glm::dmat3 basis_around(const glm::dvec3& n) {
  const double sign = std::copysign(1.0, n.z);
  const double a = -1.0 / (sign + n.z);
  const double b = n.x * n.y * a;
  return {{1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}, n};
}

}  // namespace sampling
