// SPDX-License-Identifier: Apache-2.0
// ambient_occlusion/gtao: depth and normal -> visibility, by the horizons of slices through the depth image.
#include <heddle/contents.hpp>
#include <heddle/pass.hpp>

namespace {

using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    image_in("depth", "distance along the view axis, m; +inf where there is no surface"),
    image_in("normal_geometric", "octahedral, world axes"),
    value_in("camera", "the view that made depth"),
    // 16 bits: one step of 8 would be 8 % of a visibility of 0.05, which the display shows as bands.
    image_out("noisy", VK_FORMAT_R16_UNORM, "visibility before the noise of the 4x4 tile is taken out"),
    image_out("visibility", VK_FORMAT_R16_UNORM, "1 open, 0 closed; 1 where there is no surface"),
};

constexpr const char* kFalloffs[] = {"none", "linear", nullptr};
constexpr double kDirectionLadder[] = {1, 2, 4, 8, 16};
constexpr double kStepLadder[] = {2, 4, 8, 16, 32, 64};
constexpr heddle_parameter kParameters[] = {
    parameter("radius", "m", 1e-6, 1e6, 0.5, "distance from which on a surface no longer occludes"),
    choice("falloff", kFalloffs, 0, "weight of a hit by its distance: none (1 within the radius), linear (down to 0)",
           HEDDLE_PARAMETER_CONSTANT),
    knob(integer("directions", "1", 1, 64, 2,
                 "slices through the line of sight; the tile of the noise has 16 times as many"),
         kDirectionLadder),
    knob(integer("steps", "1", 1, 256, 8, "samples on each side of a slice"), kStepLadder),
    toggle("denoise", true, "takes the noise of the 4x4 tile out", HEDDLE_PARAMETER_CONSTANT),
};

constexpr heddle_access kHorizon[] = {sampled("depth"), sampled("normal_geometric"), value("camera"),
                                      storage_write("noisy")};
constexpr heddle_access kDenoise[] = {sampled("noisy"), sampled("depth"), sampled("normal_geometric"), value("camera"),
                                      storage_write("visibility")};
constexpr heddle_stage kStages[] = {gpu_stage("horizon", kHorizon), gpu_stage("denoise", kDenoise)};
constexpr heddle_shader kShaders[] = {compute_shader("horizon", "horizon", "horizon.comp.glsl"),
                                      compute_shader("denoise", "denoise", "denoise.comp.glsl")};

struct Gtao {
  std::uint32_t activity(const Frame& frame) const {
    return is_neutral(frame, "depth") ? HEDDLE_NOTHING : HEDDLE_RUN;  // nothing in view: all is open
  }
  heddle_status record(const Frame& frame) const {
    return frame.stage() == 0 ? frame.dispatch_over("horizon", "noisy") : frame.dispatch_over("denoise", "visibility");
  }
};

constexpr heddle_technique kGtao =
    technique<Gtao>("ambient_occlusion/gtao", "Ground-truth ambient occlusion from the depth image",
                    "Jimenez, Wu, Pesce and Jarabo 2016, Practical Realtime Strategies for Accurate "
                    "Indirect Occlusion",
                    kPorts, kParameters, kStages, kShaders);

}  // namespace

HEDDLE_PLUGIN(kGtao)
