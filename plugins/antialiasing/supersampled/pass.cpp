// SPDX-License-Identifier: Apache-2.0
// antialiasing/supersampled: renders everything that makes the radiance n times, with the camera moved within a pixel,
// and shows the mean. The reference of the role.
#include <heddle/pass.hpp>

#include "camera_loop.hpp"
#include "sequence.hpp"

namespace {
using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    port("radiance", HEDDLE_PORT_IMAGE, HEDDLE_INOUT, "one sample in, the mean out [cd/m^2]"),
    value_in("camera", "the view through the centres of the pixels"),
    sampling::kSampleCameraPort,
    image_out("mean", VK_FORMAT_R32G32B32A32_SFLOAT, "of the samples so far [cd/m^2]", HEDDLE_PORT_KEPT),
    image_out("residual", VK_FORMAT_R32G32B32A32_SFLOAT, "what the mean lacks [cd/m^2]", HEDDLE_PORT_KEPT),
    image_out("count", VK_FORMAT_R32_SFLOAT, "samples in the mean", HEDDLE_PORT_KEPT),
};
constexpr double kSamples[] = {1, 2, 4, 8, 16, 32, 64, 256, 1024};
constexpr const char* kModes[] = {"reference", "progressive", nullptr};
constexpr const char* kSequences[] = {"r2", "halton", "random", nullptr};
constexpr const char* kFilters[] = {"box", "tent", "gaussian", nullptr};
constexpr heddle_parameter kParameters[] = {
    knob(integer("samples", "1", 1, 65536, 16, "of each pixel"), kSamples),
    choice("mode", kModes, 0, "reference: all in a frame; progressive: one a frame while nothing changes"),
    choice("sequence", kSequences, 0, "where in a pixel the samples are taken"),
    choice("filter", kFilters, 0, "what a pixel weighs its surroundings with"),
    sampling::kLodBiasParameter,
};
enum StageIndex : std::uint32_t { kMove, kAccumulate, kResolve };
constexpr heddle_access kAccumulateAccesses[] = {sampled("radiance"), storage_read_write("mean"),
                                                 storage_read_write("residual"), storage_read_write("count")};
constexpr heddle_access kResolveAccesses[] = {sampled("mean"), color_target("radiance")};
constexpr heddle_stage kStages[] = {
    sampling::kMoveStage,
    in_loop(HEDDLE_LOOP_AFTER, gpu_stage("accumulate", kAccumulateAccesses)),
    gpu_stage("resolve", kResolveAccesses),
};
constexpr heddle_shader kShaders[] = {
    compute_shader("accumulate", "accumulate", "accumulate.comp.glsl"),
    fullscreen_shader("resolve", "resolve", "resolve.frag.glsl"),
};

class Supersampled {
 public:
  explicit Supersampled(const PassHost& host) : host_(host) {}

  heddle_status declare(const PassHost& host) const {
    const heddle_shape radiance = host.shape("radiance");
    heddle_shape shape{};
    shape.width = radiance.width;
    shape.height = radiance.height;
    for (const char* port : {"mean", "residual", "count"}) {
      if (const heddle_status status = host.set_shape(port, shape); status != HEDDLE_OK) return status;
    }
    return HEDDLE_OK;
  }

  heddle_status iterations(const heddle_frame_info& info, heddle_iterations& out) {
    const bool is_progressive = host_.choice("mode") == 1;
    count_.next(info, static_cast<std::uint32_t>(host_.integer("samples")), is_progressive ? 1 : UINT32_MAX, out);
    return HEDDLE_OK;
  }

  heddle_status execute(const Frame& frame) const {
    const auto sequence = static_cast<supersampled::Sequence>(host_.choice("sequence"));
    const auto filter = static_cast<supersampled::Filter>(host_.choice("filter"));
    const std::uint32_t index = frame.info().iteration;
    const auto count = static_cast<std::uint32_t>(host_.integer("samples"));
    return sampling::set_sample_camera(frame, supersampled::sample_offset(sequence, filter, index),
                                       sampling::sample_lod_bias(index, count, host_.parameter("texture_lod_bias")));
  }

  heddle_status record(const Frame& frame) const {
    if (frame.stage() == kAccumulate) return frame.dispatch_over("accumulate", "mean", frame.info().iteration);
    return frame.fullscreen("resolve");
  }

 private:
  PassHost host_;
  sampling::SampleCount count_;
};

constexpr heddle_technique kSupersampled = [] {
  heddle_technique t = technique<Supersampled>("antialiasing/supersampled", "The mean of n moved cameras",
                                               "Roberts, 2018, The Unreasonable Effectiveness of Quasirandom Sequences",
                                               kPorts, kParameters, kStages, kShaders);
  t.flags = HEDDLE_TECHNIQUE_REFERENCE;
  t.loop = &sampling::kCameraLoop;
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kSupersampled)
