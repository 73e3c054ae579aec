// SPDX-License-Identifier: Apache-2.0
// function_image/shadow: how much of the light that arrives the shadows of the frame let through.
#include "function_image.hpp"

namespace {

using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    image_in("depth", "gbuffer's"),
    image_in("normal_geometric", "gbuffer's"),
    value_in("camera", "the view that made depth"),
    value_in("lights", "every light of the frame"),
    image_out("image", VK_FORMAT_R32_SFLOAT, "visibility, the mean over lights by what they send; 1 lit, 0 in shadow"),
};
constexpr heddle_access kAccesses[] = {sampled("depth"), sampled("normal_geometric"), value("camera"), value("lights"),
                                       storage_write("image")};
constexpr heddle_stage kStages[] = {gpu_stage("image", kAccesses)};
constexpr heddle_shader kShaders[] = {compute_shader("image", "image", "image.comp.glsl", "shadow")};

constexpr heddle_technique kShadowImage =
    technique<function_image::Pass>("function_image/shadow", "Visibility of the lights that reach a pixel",
                                    "definition; README equation (1)", kPorts, kStages, kShaders);

}  // namespace

HEDDLE_PLUGIN(kShadowImage)
