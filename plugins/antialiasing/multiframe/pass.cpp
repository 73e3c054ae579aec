// SPDX-License-Identifier: Apache-2.0
// antialiasing/multiframe: one sample of each pixel a frame while nothing changes, by a kernel that is made for the
// number of frames; shows the mean so far, and rests when all are in it.
#include <heddle/pass.hpp>

#include <heddle/device.h>

#include "accumulators.hpp"
#include "camera_loop.hpp"
#include "kernel.hpp"

namespace {
using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    port("radiance", HEDDLE_PORT_IMAGE, HEDDLE_INOUT, "one sample in, the mean so far out [cd/m^2]"),
    value_in("camera", "the view through the centres of the pixels"),
    sampling::kSampleCameraPort,
    image_out("mean", VK_FORMAT_R32G32B32A32_SFLOAT, "of the samples so far, as the accumulator holds it",
              HEDDLE_PORT_KEPT),
    image_out("residual", VK_FORMAT_R32G32B32A32_SFLOAT, "what the mean lacks, if it is a pair of floats [cd/m^2]",
              HEDDLE_PORT_KEPT),
    image_out("weight", VK_FORMAT_R32_SFLOAT,
              "of all samples in the mean; their number if each weighs 1; blended: the mean of their weights",
              HEDDLE_PORT_KEPT),
};
constexpr double kSamples[] = {1, 4, 16, 64, 256, 1024};
constexpr double kAccumulatorLadder[] = {0, 1, 2, 3, 4};
constexpr const char* kKernels[] = {"poisson", "random", "grid", "r2", "halton", nullptr};
constexpr const char* kOrders[] = {"own", "farthest", "by_distance", nullptr};
constexpr const char* kFilters[] = {"box", "tent", "gaussian", nullptr};
constexpr const char* kAccumulatorNames[] = {"rgba8", "rgba16f", "rgba16", "rgba32f", "float32_pair", nullptr};
constexpr const char* kAccumulations[] = {"compute", "blend", nullptr};
constexpr std::uint32_t kBlended = 1;
constexpr const char* kRoundings[] = {"nearest", "truncate", nullptr};
constexpr const char* kWeightings[] = {"equal", "compressed", nullptr};
constexpr heddle_parameter kParameters[] = {
    knob(integer("samples", "1", 1, 65536, 16, "of each pixel, when all frames are done"), kSamples),
    integer("samples_per_frame", "1", 0, 65536, 1, "0: all of them in one frame"),
    choice("kernel", kKernels, 0, "where in a pixel the samples are taken"),
    choice("order", kOrders, 0,
           "own: poisson and grid shuffled, r2 and halton as they come; farthest: always far from all before; "
           "by_distance: from the centre outwards, which clusters"),
    toggle("centred", true, "the mean place of all samples is the pixel's centre, so that the picture is not shifted"),
    choice("filter", kFilters, 0, "what a pixel weighs its surroundings with"),
    parameter("radius", "px", 0, 16, 0, "where the filter ends; 0: box 0.5, tent 1, gaussian 1.5 = three deviations"),
    integer("seed", "1", 0, 65535, 0, "of kernels that are drawn: poisson, random, and the order of grid"),
    knob(choice("accumulator", kAccumulatorNames, multiframe::kFloat32Pair,
                "what holds the mean: 8, 12, 12, 20 or 36 bytes a pixel with the weight; blended 5, 10, 10 or 20",
                HEDDLE_PARAMETER_REDECLARE | HEDDLE_PARAMETER_CONSTANT),
         kAccumulatorLadder),
    choice("accumulation", kAccumulations, 0,
           "who adds a sample to the mean; blend: the blending of attachments, which has no float32_pair",
           HEDDLE_PARAMETER_REDECLARE),
    choice("rounding", kRoundings, 0, "of rgba8, rgba16f and rgba16 by compute; truncate: as some hardware stores them",
           HEDDLE_PARAMETER_CONSTANT),
    choice("weighting", kWeightings, 0, "compressed: 1 / (1 + luminance / white), which keeps bright edges smooth",
           HEDDLE_PARAMETER_CONSTANT),
    parameter("exposure", "EV100", -16, 24, 15,
              "as display's: white is 1.2 * 2^exposure cd/m^2, where rgba8 and rgba16 end"),
    sampling::kLodBiasParameter,
};
enum StageIndex : std::uint32_t { kMove, kAccumulate, kBegin, kBlend, kResolve, kResolveBlended };
constexpr heddle_access kAccumulateAccesses[] = {sampled("radiance"), storage_read_write("mean"),
                                                 storage_read_write("residual"), storage_read_write("weight")};
constexpr heddle_access kBeginAccesses[] = {sampled("radiance"), color_target("mean"), color_target("weight")};
constexpr heddle_access kBlendAccesses[] = {sampled("radiance"), color_blended("mean", HEDDLE_BLEND_CONSTANT),
                                            color_blended("weight", HEDDLE_BLEND_CONSTANT)};
constexpr heddle_access kResolveAccesses[] = {sampled("mean"), color_target("radiance")};
constexpr heddle_access kResolveBlendedAccesses[] = {sampled("mean"), sampled("weight"), color_target("radiance")};
constexpr heddle_stage kStages[] = {
    sampling::kMoveStage,
    only_if("accumulation=compute", in_loop(HEDDLE_LOOP_AFTER, gpu_stage("accumulate", kAccumulateAccesses))),
    only_if("accumulation=blend", in_loop(HEDDLE_LOOP_AFTER, gpu_stage("begin", kBeginAccesses))),
    only_if("accumulation=blend", in_loop(HEDDLE_LOOP_AFTER, gpu_stage("blend", kBlendAccesses))),
    only_if("accumulation=compute", gpu_stage("resolve", kResolveAccesses)),
    only_if("accumulation=blend", gpu_stage("resolve_blended", kResolveBlendedAccesses)),
};
constexpr heddle_shader kShaders[] = {
    compute_shader("accumulate", "accumulate", "accumulate.comp.glsl"),
    fullscreen_shader("begin", "begin", "blend.frag.glsl"),
    fullscreen_shader("blend", "blend", "blend.frag.glsl"),
    fullscreen_shader("resolve", "resolve", "resolve.frag.glsl"),
    fullscreen_shader("resolve_blended", "resolve_blended", "resolve_blended.frag.glsl"),
};

class Multiframe {
 public:
  explicit Multiframe(const PassHost& host) : host_(host) {}

  heddle_status declare(const PassHost& host) const {
    const std::uint32_t accumulator = host.choice("accumulator");
    const bool is_blended = host.choice("accumulation") == kBlended;
    if (is_blended) {
      const std::string problem = multiframe::why_not_blended(accumulator, [&](VkFormat format) {
        const auto* device = host.service<heddle_device_service>(HEDDLE_DEVICE_SERVICE);
        return device != nullptr ? device->format_features(host.raw(), static_cast<std::uint32_t>(format)) : 0;
      });
      if (!problem.empty()) return host.fail(HEDDLE_BAD_INPUT, problem);
    }
    const heddle_shape radiance = host.shape("radiance");
    heddle_shape shape{};
    shape.width = radiance.width;
    shape.height = radiance.height;
    const multiframe::Accumulator& held = multiframe::kAccumulators.at(accumulator);
    if (is_blended) shape.format = static_cast<std::uint32_t>(held.blended_weight);
    if (const heddle_status status = host.set_shape("weight", shape); status != HEDDLE_OK) return status;
    shape.format = static_cast<std::uint32_t>(held.mean);
    if (const heddle_status status = host.set_shape("mean", shape); status != HEDDLE_OK) return status;
    shape.format = 0;
    if (accumulator != multiframe::kFloat32Pair) shape.width = shape.height = 1;
    return host.set_shape("residual", shape);
  }

  heddle_status iterations(const heddle_frame_info& info, heddle_iterations& out) {
    const auto most = static_cast<std::uint32_t>(host_.integer("samples_per_frame"));
    count_.next(info, static_cast<std::uint32_t>(host_.integer("samples")), most == 0 ? UINT32_MAX : most, out);
    return HEDDLE_OK;
  }

  /// The first sample begins a mean, the others are blended into it.
  std::uint32_t activity(const Frame& frame) const {
    const bool is_first = frame.info().iteration == 0;
    return (frame.stage() == kBegin && !is_first) || (frame.stage() == kBlend && is_first) ? HEDDLE_KEEP : HEDDLE_RUN;
  }

  heddle_status execute(const Frame& frame) {
    const multiframe::Design wanted = design();
    if (wanted != design_) {
      offsets_ = multiframe::sample_offsets(wanted);
      design_ = wanted;
    }
    const std::uint32_t index = frame.info().iteration;
    return sampling::set_sample_camera(
        frame, offsets_[index], sampling::sample_lod_bias(index, wanted.count, host_.parameter("texture_lod_bias")));
  }

  heddle_status record(const Frame& frame) const {
    const float white = static_cast<float>(1.2 * std::exp2(host_.parameter("exposure")));
    if (frame.stage() == kResolve) return frame.fullscreen("resolve", 0, white);
    if (frame.stage() == kResolveBlended) return frame.fullscreen("resolve_blended", 0, white);
    const std::uint32_t index = frame.info().iteration;
    if (frame.stage() == kAccumulate) {
      const struct {
        std::uint32_t index;
        float white;
      } push{index, white};
      return frame.dispatch_over("accumulate", "mean", push);
    }
    // Also what could be kept is asked for where the plan has changed.
    if (activity(frame) == HEDDLE_KEEP) return HEDDLE_OK;
    if (frame.stage() == kBegin) return frame.fullscreen("begin", 0, white);
    const auto weight = static_cast<float>(1.0 / (index + 1.0));
    if (const heddle_status status = frame.set_blend_constant(weight); status != HEDDLE_OK) return status;
    return frame.fullscreen("blend", 0, white);
  }

 private:
  [[nodiscard]] multiframe::Design design() const {
    multiframe::Design wanted;
    wanted.kernel = static_cast<multiframe::Kernel>(host_.choice("kernel"));
    wanted.order = static_cast<multiframe::Order>(host_.choice("order"));
    wanted.filter = static_cast<multiframe::Filter>(host_.choice("filter"));
    wanted.radius_px = host_.parameter("radius");
    wanted.count = static_cast<std::uint32_t>(host_.integer("samples"));
    wanted.seed = static_cast<std::uint32_t>(host_.integer("seed"));
    wanted.is_centred = host_.toggle("centred");
    return wanted;
  }

  PassHost host_;
  sampling::SampleCount count_;
  multiframe::Design design_;               // of offsets_; of none before the first frame
  std::vector<multiframe::Point> offsets_;  // of the samples, in pixels
};

constexpr heddle_technique kMultiframe = [] {
  heddle_technique t = technique<Multiframe>(
      "antialiasing/multiframe", "A mean that grows from frame to frame",
      "Limberger, Tausche, Linke and Doellner, 2016, Progressive Rendering Using Multi-frame Sampling", kPorts,
      kParameters, kStages, kShaders);
  t.loop = &sampling::kCameraLoop;
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kMultiframe)
