// SPDX-License-Identifier: Apache-2.0
// shadow/ray_marched_screen: contact shadows from the main view's depth image. Nothing but a function's text.
#include <heddle/pass.hpp>

namespace {

using namespace heddle::pass;

constexpr double kStepsLadder[] = {4, 8, 16, 32, 64, 128};
constexpr heddle_parameter kParameters[] = {
    parameter("distance", "m", 1e-6, 1e4, 0.3, "length of the ray, at most"),
    knob(integer("steps", "1", 1, 128, 16, "samples along the ray", HEDDLE_PARAMETER_CONSTANT), kStepsLadder),
    parameter("thickness", "m", 1e-6, 1e4, 0.1,
              "how far behind a visible surface there still is something; shortened as the ray is"),
    parameter("stride", "px", 0.25, 1024, 4, "longest step: nearby, rays are no longer than `steps` of these"),
    toggle("dither", true, "starts each pixel's steps elsewhere, by a fixed pattern: bands become noise"),
};

constexpr heddle_port kPorts[] = {
    value_in("lights", "the lights that `light` indexes"),
    value_in("camera", "the view that made depth"),
    image_in("depth", "what the main view sees; without it everything is lit", HEDDLE_PORT_OPTIONAL),
    value_in("shadow_settings_light", nullptr),
};
constexpr heddle_access kAccesses[] = {value("lights"), value("camera"), sampled("depth"),
                                       value("shadow_settings_light")};
constexpr heddle_function kFunctions[] = {function("shadow", "contact.glsl", kAccesses)};

constexpr heddle_technique kRayMarchedScreen = [] {
  heddle_technique t = technique<Nothing>(
      "shadow/ray_marched_screen", "Contact shadows: rays marched over the main view's depth",
      "Sousa, Kasyan and Schulz 2011, Secrets of CryENGINE 3 Graphics Technology; McGuire and Mara 2014, Efficient GPU "
      "Screen-Space Ray Tracing",
      kPorts, kParameters, kFunctions);
  t.components = "shadow.settings";
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kRayMarchedScreen)
