// SPDX-License-Identifier: Apache-2.0
// function_image/light_assignment: what arrives from the lights that a pixel's point is given.
#include "function_image.hpp"

namespace {

using namespace function_image;

constexpr heddle_port kPorts[] = {
    kDepth,
    kNormalGeometric,
    kCamera,
    kLights,
    image(VK_FORMAT_R32_SFLOAT, "illuminance from the lights that are met, lx, each on a plane that faces it"),
};
constexpr char kRole[] = "light_assignment";

constexpr heddle_technique kLightsImage = Asked<kPorts, kRole>::technique(
    "function_image/light_assignment", "Illuminance from the lights that are met at each pixel");

}  // namespace

HEDDLE_PLUGIN(kLightsImage)
