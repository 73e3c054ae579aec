// SPDX-License-Identifier: Apache-2.0
// From a directional light and the main view to its cascades, in float64. Pure functions.
#pragma once

#include "depth_maps.hpp"

#include <cstdint>
#include <vector>

namespace cascaded {

/// x first map, y number of maps, z blend, w filter radius in texels (bits of floats): one uvec4 of `light_cascades`.
struct LightCascades {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
  float blend = 0;
  float filter_radius = 0;
};
static_assert(sizeof(LightCascades) == 16, "one uvec4, as cascaded.glsl reads it");

struct Settings {
  std::uint32_t resolution = 1024;  // texels of a map's side
  std::uint32_t cascades = 4;
  double distance = 100.0;         // metres of the main view that are shadowed
  double nearest = 2.0;            // metres: where the logarithmic split scheme begins
  double split = 0.8;              // 0 even splits, 1 logarithmic ones
  double caster_distance = 200.0;  // metres towards the light in which casters are drawn
  double filter_radius = 1.5;      // texels
  double slack = 16.0;             // texels that the camera may go before a map follows it
};

/// README equation (1): how far each cascade reaches along the view, metres, rising; the last is `distance`.
std::vector<double> reaches(const Settings& settings);

/// `origin`: the frame's, in the scene.
std::vector<depth_maps::MapView> make_views(const HeddleLight& light, const HeddleView& camera,
                                            const glm::dvec3& origin, const Settings& settings);

}  // namespace cascaded
