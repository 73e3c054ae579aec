// SPDX-License-Identifier: Apache-2.0
// function_image/surface_material: what the materials of the frame make of its lights.
#include "function_image.hpp"

namespace {

using namespace function_image;

constexpr heddle_port kPorts[] = {
    kDepth,
    kNormalGeometric,
    heddle::pass::image_in("normal", "gbuffer's"),
    heddle::pass::image_in("base_color", "gbuffer's"),
    heddle::pass::image_in("material", "gbuffer's"),
    kCamera,
    kLights,
    image(VK_FORMAT_R32G32B32A32_SFLOAT, "radiance of the lights by way of the material, without shadows, cd/m^2; a 1"),
};
constexpr char kRole[] = "surface_material";

constexpr heddle_technique kMaterialImage = Asked<kPorts, kRole>::technique(
    "function_image/surface_material", "Radiance of the lights by way of each pixel's material");

}  // namespace

HEDDLE_PLUGIN(kMaterialImage)
