// SPDX-License-Identifier: Apache-2.0
// How long frames of a picture that converges took -> how many to render before it is shown again. Pure: fed with
// times.
#pragma once

#include <cstdint>

namespace heddle::view {

/// Frames that were rendered between two pictures, and what showing the second of them took.
struct Turn {
  std::uint32_t frames = 0;  // 0: there was none since something changed
  double render_ms = 0, show_ms = 0;
};

/// As many as fit into `budget_ms` beside one showing, because frames of a scene that stands still take the same time:
/// at least one, and at most twice as many as the last time, so that one measurement that was wrong makes no long wait.
std::uint32_t frames_before_picture(const Turn& last, double budget_ms);

}  // namespace heddle::view
