// SPDX-License-Identifier: Apache-2.0
// function_image/sky: what the sky of the frame sends along each pixel's ray, surfaces or not.
#include "function_image.hpp"

namespace {

using namespace function_image;

constexpr heddle_port kPorts[] = {
    kDepth,
    kNormalGeometric,
    kCamera,
    image(VK_FORMAT_R32G32B32A32_SFLOAT, "radiance from the pixel's direction, cd/m^2; a 1"),
};
constexpr char kRole[] = "sky";

constexpr heddle_technique kSkyImage =
    Asked<kPorts, kRole>::technique("function_image/sky", "Radiance of the sky along each pixel's ray");

}  // namespace

HEDDLE_PLUGIN(kSkyImage)
