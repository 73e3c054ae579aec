// SPDX-License-Identifier: Apache-2.0
#include "view/pace.hpp"

#include <algorithm>

namespace heddle::view {

std::uint32_t frames_before_picture(const Turn& last, double budget_ms) {
  // Beyond any loop's length, so that doubling does not overflow.
  constexpr double kMost = 1U << 16U;
  const double room_ms = budget_ms - last.show_ms;
  if (last.frames == 0 || !(room_ms > 0)) return 1;
  const double most = std::min(2.0 * last.frames, kMost);
  const double fitting = last.render_ms > 0 ? room_ms / (last.render_ms / last.frames) : most;
  return static_cast<std::uint32_t>(std::clamp(fitting, 1.0, most));
}

}  // namespace heddle::view
