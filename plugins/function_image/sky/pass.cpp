// SPDX-License-Identifier: Apache-2.0
// function_image/sky: what the sky of the frame sends along each pixel's ray, surfaces or not.
#include "function_image.hpp"

namespace {

using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    image_in("depth", "gbuffer's"),
    image_in("normal_geometric", "gbuffer's"),
    value_in("camera", "the view that made depth"),
    image_out("image", VK_FORMAT_R32G32B32A32_SFLOAT, "radiance from the pixel's direction, cd/m^2; a 1"),
};
constexpr heddle_access kAccesses[] = {sampled("depth"), sampled("normal_geometric"), value("camera"),
                                       storage_write("image")};
constexpr heddle_stage kStages[] = {gpu_stage("image", kAccesses)};
constexpr heddle_shader kShaders[] = {compute_shader("image", "image", "image.comp.glsl", "sky")};

constexpr heddle_technique kSkyImage =
    technique<function_image::Pass>("function_image/sky", "Radiance of the sky along each pixel's ray",
                                    "definition; README equation (1)", kPorts, kStages, kShaders);

}  // namespace

HEDDLE_PLUGIN(kSkyImage)
