// SPDX-License-Identifier: Apache-2.0
// Cameras and directions at random, for tests of geometry.
#pragma once

#include <heddle/records.h>

#include <glm/glm.hpp>

#include <random>

namespace shadow_cameras {

using glm::dvec3;

/// A camera at the frame's origin that looks along `forward`.
inline HeddleView camera_along(const dvec3& forward, double half_height, double aspect) {
  const dvec3 back = -glm::normalize(forward);
  const dvec3 right = glm::normalize(glm::cross(dvec3(0.1, 1, 0.05), back));
  const dvec3 up = glm::cross(back, right);
  HeddleView view{};
  const dvec3 columns[3] = {right, up, back};
  for (int c = 0; c < 3; ++c) {
    for (int r = 0; r < 3; ++r) view.rel_from_view[4 * c + r] = static_cast<float>(columns[c][r]);
  }
  view.rel_from_view[15] = 1.0F;
  view.half_size[0] = static_cast<float>(half_height * aspect);
  view.half_size[1] = static_cast<float>(half_height);
  view.near_distance = 0.01F;
  return view;
}

inline dvec3 random_direction(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return glm::normalize(dvec3(normal(random), normal(random), normal(random)));
}

}  // namespace shadow_cameras
