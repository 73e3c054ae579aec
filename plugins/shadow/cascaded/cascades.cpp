// SPDX-License-Identifier: Apache-2.0
// From a directional light and the main view to its cascades, in float64.
#include "cascades.hpp"

#include <algorithm>
#include <cmath>

namespace cascaded {

std::vector<double> reaches(const Settings& settings) {
  const double far = settings.distance;
  const double near = std::min(settings.nearest, far);
  std::vector<double> all;
  for (std::uint32_t i = 1; i <= settings.cascades; ++i) {
    const double part = static_cast<double>(i) / settings.cascades;
    const double logarithmic = near * std::pow(far / near, part);
    const double even = near + (far - near) * part;
    all.push_back(i == settings.cascades ? far : settings.split * logarithmic + (1.0 - settings.split) * even);
  }
  return all;
}

std::vector<depth_maps::MapView> make_views(const HeddleLight& light, const HeddleView& camera,
                                            const glm::dvec3& origin, const Settings& settings) {
  const depth_maps::Axes axes = depth_maps::axes_along(depth_maps::to_double(light.direction));
  std::vector<depth_maps::MapView> views;
  for (const double reach : reaches(settings)) {
    views.push_back(depth_maps::cascade_view(
        axes, camera, origin,
        {reach, settings.caster_distance, settings.filter_radius, settings.slack, settings.resolution}));
  }
  return views;
}

}  // namespace cascaded
