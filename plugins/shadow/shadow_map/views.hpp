// SPDX-License-Identifier: Apache-2.0
// From a light and the main view to the depth maps' views, in float64: cascades of a directional light, the face of a
// spot or box, the six faces of a light that shines all round; and how fine they need be. Pure functions.
#pragma once

#include "depth_maps.hpp"

#include <heddle/records.h>

#include <glm/glm.hpp>

#include <cstdint>
#include <vector>

namespace shadow_map {

/// How the views of a light are arranged; the same numbers as kLayout* in shadow_map.glsl.
enum class Layout : std::uint32_t { kNone = 0, kCascades = 1, kSpot = 2, kCube = 3, kBox = 4 };

/// x first map, y number of maps, z Layout, w filter radius in texels (the bits of a float): one uvec4 of the port
/// `light_views`.
struct LightViews {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
  Layout layout = Layout::kNone;
  float filter_radius = 0;
};
static_assert(sizeof(LightViews) == 16, "one uvec4, as shadow_map.glsl reads it");

struct Settings {
  std::uint32_t resolution = 1024;  // texels of the largest map's side
  std::uint32_t smallest = 64;      // texels of the smallest map's side
  std::uint32_t cascades = 3;
  double distance = 60.0;          // metres of the main view that directional lights shadow
  double caster_distance = 200.0;  // metres towards a directional light in which casters are drawn
  double near_distance = 0.02;     // metres; what is nearer to a light does not cast
  double filter_radius = 1.5;      // texels
  double fineness = 1.0;           // texels that a pixel sees at least
};

/// Sizes of maps, each half of the last.
inline constexpr std::uint32_t kMostLevels = 8;
/// Each cascade reaches this many times further than the one inside it.
inline constexpr double kCascadeRatio = 3.0;
/// Spots wider than this (half angle, radians) are drawn as cubes: the tangent of one face would grow without bound.
inline constexpr double kWidestSpot = 1.0471975511965976;

/// How many views a light needs, and in which layout; count 0: it casts no shadow with this technique.
LightViews views_needed(const HeddleLight& light, const Settings& settings);

/// How often the side of a map may be halved: below the smallest one that was asked for, or that its border leaves
/// half of, no more.
std::uint32_t levels_of(const Settings& settings);

/// README equation (2): how often a light's maps may be halved until a texel of the farthest that they light is as wide
/// as `1 / fineness` of the nearest pixel that sees it. At least 0, and less than levels_of.
std::uint32_t level_needed(const HeddleLight& light, const HeddleView& camera, const Settings& settings);

/// The views of a light, `views_needed(light).count` of them, `side` texels wide. `position`: of the light, in the
/// scene; `origin`: the frame's.
std::vector<depth_maps::MapView> make_views(const HeddleLight& light, const glm::dvec3& position,
                                            const HeddleView& camera, const glm::dvec3& origin,
                                            const Settings& settings, std::uint32_t side);

}  // namespace shadow_map
