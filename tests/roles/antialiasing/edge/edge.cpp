// SPDX-License-Identifier: Apache-2.0
// edge/half_planes, constants, broken, steps, flips: samples of pixels whose means are known. For tests.
#include <heddle/pass.hpp>

namespace {

using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    value_in("camera", "its jitter is where the sample is"),
    image_out("radiance", VK_FORMAT_R32G32B32A32_SFLOAT, "one sample"),
};
constexpr heddle_access kAccesses[] = {value("camera"), storage_write("radiance")};
constexpr heddle_stage kStages[] = {gpu_stage("shade", kAccesses)};
constexpr heddle_shader kHalfPlanes[] = {compute_shader("shade", "shade", "half_planes.comp.glsl")};
constexpr heddle_shader kConstants[] = {compute_shader("shade", "shade", "constants.comp.glsl")};
constexpr heddle_shader kBroken[] = {compute_shader("shade", "shade", "broken.comp.glsl")};
constexpr heddle_shader kSteps[] = {compute_shader("shade", "shade", "steps.comp.glsl")};
constexpr heddle_shader kFlips[] = {compute_shader("shade", "shade", "flips.comp.glsl")};

struct Edge {
  heddle_status record(const Frame& frame) const {
    return frame.dispatch_over("shade", "radiance", frame.info().iteration);
  }
};

constexpr heddle_technique make(const char* id, const char* title, const heddle_shader (&shaders)[1]) {
  return technique<Edge>(id, title, "definition", kPorts, kStages, shaders);
}
constexpr heddle_technique kHalfPlanesTechnique = make("edge/half_planes", "A half plane in each pixel", kHalfPlanes);
constexpr heddle_technique kConstantsTechnique = make("edge/constants", "The same in all samples", kConstants);
constexpr heddle_technique kBrokenTechnique = make("edge/broken", "Samples that are no numbers", kBroken);
constexpr heddle_technique kStepsTechnique = make("edge/steps", "Numbers that follow from the sample's", kSteps);
constexpr heddle_technique kFlipsTechnique = make("edge/flips", "One of two greys, by chance", kFlips);

}  // namespace

HEDDLE_PLUGIN(kHalfPlanesTechnique, kConstantsTechnique, kBrokenTechnique, kStepsTechnique, kFlipsTechnique)
