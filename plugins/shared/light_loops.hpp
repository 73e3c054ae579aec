// SPDX-License-Identifier: Apache-2.0
// For techniques whose shaders walk over the lights of role light_assignment: whether the device lets them.
#pragma once

#include <heddle/device.h>
#include <heddle/functions.h>
#include <heddle/pass.hpp>

#include <string>

namespace heddle::pass {

/// Iterations that a light takes of a driver's limit where it does not reach the point: the walk's own one, and the end
/// of each loop within it, which counts as one. Of shade_surface.glsl two of those; of a shadow technique, at most two
/// of the shipped ones. Measured with lavapipe (lighting's README).
inline constexpr std::uint64_t kLoopsToMeet = 1, kLoopsToShade = 3, kLoopsOfAShadow = 2;

/// HEDDLE_UNSUPPORTED, after an error with the numbers, where nobody assigns lights and an invocation that goes through
/// all of them takes more iterations than the device lets loops run: the lights behind would be dark, and nothing would
/// say so.
inline heddle_status check_light_loops(const Frame& frame, std::uint64_t loops_of_a_light) {
  const PassHost host = frame.host();
  const auto* device = host.service<heddle_device_service>(HEDDLE_DEVICE_SERVICE);
  const auto* functions = host.service<heddle_functions_service>(HEDDLE_FUNCTIONS_SERVICE);
  if (device == nullptr || functions == nullptr) return HEDDLE_OK;
  const std::uint64_t limit = device->loop_limit(host.raw());
  const std::uint64_t lights = frame.value<HeddleLight>("lights").size();
  const std::uint64_t loops = loops_of_a_light + kLoopsOfAShadow * functions->provider_count(host.raw(), "shadow");
  if (limit == 0 || lights * loops <= limit || functions->provider_count(host.raw(), "light_assignment") > 0)
    return HEDDLE_OK;
  return host.fail(HEDDLE_UNSUPPORTED,
                   "there are " + std::to_string(lights) + " lights, each pixel goes through all of them in " +
                       std::to_string(loops) + " loop iterations each, and this driver ends a shader's loops after " +
                       std::to_string(limit) + ": lights behind the first " + std::to_string(limit / loops) +
                       " would be left out; add a pass of role light_assignment above, of technique tiled");
}

}  // namespace heddle::pass
