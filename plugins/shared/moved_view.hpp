// SPDX-License-Identifier: Apache-2.0
// A view and a jitter -> the view whose image is moved by it, for all passes alike.
#pragma once

#include <heddle/records.h>

#include <cstddef>

namespace sampling {

/// Every raster position moves by (x, y) pixels, x to the right, y down: clip.xy += 2 (x, y) / extent * clip.w, because
/// clip space is 2 wide. In float64 from the matrices as they are; not a step of the camera, which would bring
/// parallax.
inline HeddleView moved(HeddleView view, double x_px, double y_px) {
  const double x = 2.0 * x_px / view.extent[0];
  const double y = 2.0 * y_px / view.extent[1];
  for (std::size_t i = 0; i < 4; ++i) {
    float* column = view.clip_from_rel + 4 * i;
    column[0] = static_cast<float>(column[0] + x * column[3]);
    column[1] = static_cast<float>(column[1] + y * column[3]);
    float* back = view.rel_from_clip;
    back[12 + i] = static_cast<float>(back[12 + i] - x * back[i] - y * back[4 + i]);
  }
  view.jitter[0] = static_cast<float>(view.jitter[0] + x_px);
  view.jitter[1] = static_cast<float>(view.jitter[1] + y_px);
  return view;
}

}  // namespace sampling
