// SPDX-License-Identifier: Apache-2.0
// From a light and the main view to the depth maps' views, in float64.
#include "views.hpp"

#include <algorithm>
#include <cmath>

namespace shadow_map {

using depth_maps::Axes;
using depth_maps::MapView;
using depth_maps::to_double;

namespace {

/// Tangent of the half angle that one map of the light sees, without its border.
double half_tangent(const HeddleLight& light, Layout layout) {
  return layout == Layout::kSpot ? std::tan(std::acos(std::min(static_cast<double>(light.cos_outer), 0.9999))) : 1.0;
}

}  // namespace

LightViews views_needed(const HeddleLight& light, const Settings& settings) {
  const bool shines = light.intensity[0] > 0 || light.intensity[1] > 0 || light.intensity[2] > 0;
  if ((light.flags & HEDDLE_LIGHT_CASTS_SHADOW) == 0 || !shines) return {};
  const auto radius = static_cast<float>(settings.filter_radius);
  switch (light.type) {
    case HEDDLE_LIGHT_DIRECTIONAL:
      return {0, settings.cascades, settings.cascades > 0 ? Layout::kCascades : Layout::kNone, radius};
    case HEDDLE_LIGHT_SPOT:
    case HEDDLE_LIGHT_CONE:
      if (light.cos_outer > std::cos(kWidestSpot)) return {0, 1, Layout::kSpot, radius};
      return {0, 6, Layout::kCube, radius};
    case HEDDLE_LIGHT_POINT:
    case HEDDLE_LIGHT_SPHERE:
    case HEDDLE_LIGHT_CAPSULE:
    case HEDDLE_LIGHT_WEDGE:
    case HEDDLE_LIGHT_RECTANGLE:
      return {0, 6, Layout::kCube, radius};
    case HEDDLE_LIGHT_BOX:
      return {0, 1, Layout::kBox, radius};
    default:
      return {};
  }
}

std::uint32_t levels_of(const Settings& settings) {
  const auto least = std::max<std::uint32_t>(
      settings.smallest, static_cast<std::uint32_t>(4.0 * depth_maps::guard_texels(settings.filter_radius)));
  std::uint32_t levels = 1;
  while (levels < kMostLevels && settings.resolution >> levels >= least) ++levels;
  return levels;
}

std::uint32_t level_needed(const HeddleLight& light, const HeddleView& camera, const Settings& settings) {
  const Layout layout = views_needed(light, settings).layout;
  if ((layout != Layout::kSpot && layout != Layout::kCube) || light.range <= 0.0F) return 0;
  const glm::dvec3 eye(camera.rel_from_view[12], camera.rel_from_view[13], camera.rel_from_view[14]);
  const double range = static_cast<double>(light.range) + 0.5 * static_cast<double>(light.segment_length);
  const double nearest = glm::length(to_double(light.position_rel) - eye) - range;
  if (nearest <= 0.0) return 0;
  const double pixel = 2.0 * static_cast<double>(camera.half_size[1]) / std::max(camera.extent[1], 1U) *
                       (camera.is_orthographic != 0 ? 1.0 : nearest);
  const double inside = 2.0 * half_tangent(light, layout) * range * settings.fineness / pixel;
  const double border = 2.0 * depth_maps::guard_texels(settings.filter_radius);
  std::uint32_t level = 0;
  while (level + 1 < levels_of(settings) && (settings.resolution >> (level + 1)) - border >= inside) ++level;
  return level;
}

std::vector<MapView> make_views(const HeddleLight& light, const glm::dvec3& position, const HeddleView& camera,
                                const glm::dvec3& origin, const Settings& settings, std::uint32_t side) {
  const LightViews needed = views_needed(light, settings);
  const double guard_scale = depth_maps::guard_scale(settings.filter_radius, side);
  std::vector<MapView> views;
  switch (needed.layout) {
    case Layout::kNone:
      break;
    case Layout::kCascades: {
      const Axes axes = depth_maps::axes_along(to_double(light.direction));
      for (std::uint32_t i = 0; i < needed.count; ++i) {
        const double reach = settings.distance / std::pow(kCascadeRatio, needed.count - 1 - i);
        views.push_back(depth_maps::cascade_view(axes, camera, origin,
                                                 {reach, settings.caster_distance, settings.filter_radius, 1.0, side}));
      }
      break;
    }
    case Layout::kSpot:
      views.push_back(depth_maps::perspective_view(depth_maps::axes_along(to_double(light.direction)), position,
                                                   half_tangent(light, needed.layout) * guard_scale,
                                                   settings.near_distance, settings.filter_radius, side));
      break;
    case Layout::kCube: {
      // An emitter's own body, drawn in the scene, must not shadow its light.
      const double body = light.type == HEDDLE_LIGHT_SPHERE || light.type == HEDDLE_LIGHT_CAPSULE ? light.radius : 0.0;
      for (int face = 0; face < 6; ++face) {
        glm::dvec3 forward(0.0);
        forward[face / 2] = face % 2 == 0 ? 1.0 : -1.0;
        // 1.01: a cube inscribed around a sphere would still cut it by rounding.
        views.push_back(depth_maps::perspective_view(depth_maps::axes_along(forward), position, guard_scale,
                                                     std::max(settings.near_distance, 1.01 * body),
                                                     settings.filter_radius, side));
      }
      break;
    }
    case Layout::kBox: {
      const glm::dvec3 back = -glm::normalize(to_double(light.direction));
      const glm::dvec3 right = glm::normalize(to_double(light.tangent));
      const Axes axes = {right, glm::cross(back, right), back};
      const glm::dvec3 half = to_double(light.half_extent);
      views.push_back(depth_maps::orthographic_view(axes, position + back * half.z, glm::dvec2(half) * guard_scale,
                                                    2.0 * half.z, settings.filter_radius, side));
      break;
    }
  }
  return views;
}

}  // namespace shadow_map
