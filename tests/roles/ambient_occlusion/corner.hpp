// SPDX-License-Identifier: Apache-2.0
// Closed forms of a right-angled corner: floor and wall, a point on the floor at distance k radii from the wall.
#pragma once

#include <cmath>
#include <numbers>

namespace corner {

/// Share of points around it that lie in the wall: directions even over the hemisphere, distances even over half a
/// radius to one. A point at distance l in a direction with cosine c to the wall lies in it if l c > k; c is even over
/// [0, 1] for half of the directions, so the share is the mean over l of (1 - k / l) / 2 where l > k.
inline double occlusion(double k) {
  if (k >= 1.0) return 0.0;
  const double from = std::fmax(k, 0.5);
  return 1.0 - from + (k > 0.0 ? k * std::log(from) : 0.0);
}

/// Cosine-weighted share of the hemisphere that the wall covers within the radius: a half disc's segment.
inline double ray_traced_occlusion(double k) {
  return k >= 1.0 ? 0.0 : (std::acos(k) - k * std::sqrt(1.0 - k * k)) / std::numbers::pi;
}

}  // namespace corner
