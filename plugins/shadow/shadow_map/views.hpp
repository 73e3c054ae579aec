// SPDX-License-Identifier: Apache-2.0
// From a light and the main view to the depth maps' views, in float64: cascades of a directional light, the face of a
// spot or box, the six faces of a light that shines all round. Pure functions.
#pragma once

#include <heddle/records.h>

#include <glm/glm.hpp>

#include <array>
#include <cstdint>
#include <vector>

namespace shadow_map {

/// How the views of a light are arranged; the same numbers as kLayout* in shadow_map.glsl.
enum class Layout : std::uint32_t { kNone = 0, kCascades = 1, kSpot = 2, kCube = 3, kBox = 4 };

/// What the shader knows of a view: six vec4 of the port `shadow_views`.
struct ShadowView {
  float clip_from_rel[16];
  float axis[3];
  float texel_size;
  float eye_rel[3];
  float guard;
};
static_assert(sizeof(ShadowView) == 96, "six vec4, as shadow_map.glsl reads them");

/// x first view, y number of views, z Layout, w filter radius in texels (the bits of a float): one uvec4 of the port
/// `light_views`.
struct LightViews {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
  Layout layout = Layout::kNone;
  float filter_radius = 0;
};
static_assert(sizeof(LightViews) == 16, "one uvec4, as shadow_map.glsl reads it");

struct Settings {
  std::uint32_t resolution = 1024;  // texels of a view's side
  std::uint32_t cascades = 3;
  double distance = 60.0;          // metres of the main view that directional lights shadow
  double caster_distance = 200.0;  // metres towards a directional light in which casters are drawn
  double near_distance = 0.02;     // metres; what is nearer to a light does not cast
  double filter_radius = 1.5;      // texels
};

/// One depth map to draw.
struct MapView {
  HeddleView draw{};    // for the host
  ShadowView lookup{};  // for the shader
};

/// Each cascade reaches this many times further than the one inside it.
inline constexpr double kCascadeRatio = 3.0;
/// Spots wider than this (half angle, radians) are drawn as cubes: the tangent of one face would grow without bound.
inline constexpr double kWidestSpot = 1.0471975511965976;

/// Texels at each border that lookups do not enter: the filter's reach, and once more the normal offset, which moves a
/// lookup by at most as much.
double guard_texels(double filter_radius);

/// How many views a light needs, and in which layout; count 0: it casts no shadow with this technique.
LightViews views_needed(const HeddleLight& light, const Settings& settings);

/// The views of a light, `views_needed(light).count` of them. `origin`: the frame's origin in the scene, metres.
std::vector<MapView> make_views(const HeddleLight& light, const HeddleView& camera, const glm::dvec3& origin,
                                const Settings& settings);

/// Filter taps, in the unit of `radius`, evenly spread over a disk of `radius`, with their mean at its centre; one tap
/// is the centre.
std::vector<std::array<float, 4>> make_kernel(std::uint32_t taps, double radius);

/// Bounding sphere of the part of a view up to `distance` metres: its centre in front of the eye, and its radius.
struct AxisSphere {
  double centre_distance = 0;
  double radius = 0;
};
AxisSphere bounding_sphere(const HeddleView& camera, double distance);

}  // namespace shadow_map
