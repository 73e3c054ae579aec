// SPDX-License-Identifier: Apache-2.0
// function_image/shadow: how much of the light that arrives the shadows of the frame let through.
#include "function_image.hpp"

namespace {

using namespace function_image;

constexpr heddle_port kPorts[] = {
    kDepth,
    kNormalGeometric,
    kCamera,
    kLights,
    image(VK_FORMAT_R32_SFLOAT, "visibility, the mean over lights by what they send; 1 lit, 0 in shadow"),
};
constexpr char kRole[] = "shadow";

constexpr heddle_technique kShadowImage =
    Asked<kPorts, kRole>::technique("function_image/shadow", "Visibility of the lights that reach a pixel");

}  // namespace

HEDDLE_PLUGIN(kShadowImage)
