// SPDX-License-Identifier: Apache-2.0
// What techniques share that repeat all passes behind the camera with moved views of it: the loop, its count over
// frames that stay the same, and the view of a sample. The technique has the ports `camera` and `sample_camera`.
#pragma once

#include <heddle/pass.hpp>

#include "moved_view.hpp"
#include "point_sequences.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>

namespace sampling {

inline constexpr heddle_port kSampleCameraPort =
    heddle::pass::value_out("sample_camera", sizeof(HeddleView), "the view of one sample", "HeddleView sample_camera;");

namespace detail {
inline constexpr heddle_access kMoveAccesses[] = {heddle::pass::value("camera"), heddle::pass::value("sample_camera")};
inline constexpr heddle_override kOverrides[] = {heddle::pass::override_of("camera", "sample_camera")};
}  // namespace detail

/// From cheap to accurate: finer levels are more memory to read.
inline constexpr double kLodBiasLadder[] = {0, 0.5, 1};
inline constexpr heddle_parameter kLodBiasParameter = heddle::pass::knob(
    heddle::pass::parameter("texture_lod_bias", "1", 0, 1, 1,
                            "how much of -log2(samples) / 2 levels textures are taken finer, but in the first sample"),
    kLodBiasLadder);

/// The stage that calls set_sample_camera.
inline constexpr heddle_stage kMoveStage =
    heddle::pass::in_loop(HEDDLE_LOOP_BEFORE, heddle::pass::cpu_stage("move", detail::kMoveAccesses));
inline constexpr heddle_loop kCameraLoop = heddle::pass::loop(detail::kOverrides, "radiance");

/// n samples of a pixel filter textures themselves: each may take them that much finer, log2(sqrt(n)) levels, times
/// `share`, 0 to 1. The first takes them as they are, because it is shown alone while things move.
inline double sample_lod_bias(std::uint32_t index, std::uint32_t count, double share) {
  return index == 0 ? 0.0 : -0.5 * share * std::log2(static_cast<double>(count));
}

/// The view for a sample that is taken `offset` pixels from the centres, x to the right, y down.
inline heddle_status set_sample_camera(const heddle::pass::Frame& frame, const Point& offset, double lod_bias) {
  const auto camera = frame.value<HeddleView>("camera");
  if (camera.empty()) return frame.host().fail(HEDDLE_BUG, "there is no camera");
  HeddleView view = moved(camera[0], -offset[0], -offset[1]);
  view.lod_bias = static_cast<float>(view.lod_bias + lod_bias);
  return frame.set_value("sample_camera", std::span<const HeddleView>(&view, 1));
}

/// Which samples a frame takes: those that are missing, as long as nothing changes; else from the first on.
class SampleCount {
 public:
  void next(const heddle_frame_info& info, std::uint32_t total, std::uint32_t most_in_frame, heddle_iterations& out) {
    if (info.is_still == 0) done_ = 0;
    out.total = total;
    out.first = done_;
    out.count = std::min(total - done_, most_in_frame);
    done_ += out.count;
  }

 private:
  std::uint32_t done_ = 0;  // when the next frame begins, if nothing changes
};

}  // namespace sampling
