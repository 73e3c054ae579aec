// SPDX-License-Identifier: Apache-2.0
// From a light and the main view to the depth maps' views, in float64.
#include "views.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace shadow_map {
namespace {

constexpr double kBilinearReach = std::numbers::sqrt2;

/// Axes of a view, world space, unit and orthogonal; it looks along -back.
struct Axes {
  glm::dvec3 right, up, back;
};

glm::dvec3 to_double(const float v[3]) {
  return {v[0], v[1], v[2]};
}

Axes axes_looking_along(const glm::dvec3& forward) {
  const glm::dvec3 back = -glm::normalize(forward);
  // Any axis that is not nearly parallel; depends on the direction alone, so that maps stand still under the camera.
  const glm::dvec3 hint = std::abs(back.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(0, 0, 1);
  const glm::dvec3 right = glm::normalize(glm::cross(hint, back));
  return {right, glm::cross(back, right), back};
}

void store(const glm::dmat4& matrix, float out[16]) {
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) out[4 * column + row] = static_cast<float>(matrix[column][row]);
  }
}

MapView make_view(const Axes& axes, const glm::dvec3& eye, const glm::dmat4& clip_from_view,
                  const glm::dvec2& half_size, double near_distance, bool is_orthographic, const Settings& settings) {
  glm::dmat4 rel_from_view(1.0);
  rel_from_view[0] = glm::dvec4(axes.right, 0.0);
  rel_from_view[1] = glm::dvec4(axes.up, 0.0);
  rel_from_view[2] = glm::dvec4(axes.back, 0.0);
  rel_from_view[3] = glm::dvec4(eye, 1.0);
  const glm::dmat4 view_from_rel = glm::inverse(rel_from_view);
  const glm::dmat4 clip_from_rel = clip_from_view * view_from_rel;

  MapView out;
  store(clip_from_rel, out.draw.clip_from_rel);
  store(glm::inverse(clip_from_rel), out.draw.rel_from_clip);
  store(view_from_rel, out.draw.view_from_rel);
  store(rel_from_view, out.draw.rel_from_view);
  store(clip_from_rel, out.draw.previous_clip_from_rel);
  out.draw.half_size[0] = static_cast<float>(half_size.x);
  out.draw.half_size[1] = static_cast<float>(half_size.y);
  out.draw.near_distance = static_cast<float>(near_distance);
  out.draw.is_orthographic = is_orthographic ? 1U : 0U;
  out.draw.extent[0] = out.draw.extent[1] = settings.resolution;

  std::copy_n(out.draw.clip_from_rel, 16, out.lookup.clip_from_rel);
  for (int i = 0; i < 3; ++i) {
    out.lookup.axis[i] = static_cast<float>(-axes.back[i]);
    out.lookup.eye_rel[i] = static_cast<float>(eye[i]);
  }
  // Views need not be square (a box light): the larger side of a texel bounds what a lookup may miss.
  out.lookup.texel_size = static_cast<float>(2.0 * std::max(half_size.x, half_size.y) / settings.resolution);
  out.lookup.guard = static_cast<float>(2.0 * guard_texels(settings.filter_radius) / settings.resolution);
  return out;
}

/// The eye is on the near plane, so that depth is 1 there and 0 at `length` metres.
MapView orthographic_view(const Axes& axes, const glm::dvec3& eye, const glm::dvec2& half_size, double length,
                          const Settings& settings) {
  glm::dmat4 clip_from_view(0.0);
  clip_from_view[0][0] = 1.0 / half_size.x;
  clip_from_view[1][1] = -1.0 / half_size.y;
  clip_from_view[2][2] = 1.0 / length;
  clip_from_view[3][2] = 1.0;
  clip_from_view[3][3] = 1.0;
  return make_view(axes, eye, clip_from_view, half_size, 0.0, true, settings);
}

MapView perspective_view(const Axes& axes, const glm::dvec3& eye, double half_tangent, double near_distance,
                         const Settings& settings) {
  glm::dmat4 clip_from_view(0.0);
  clip_from_view[0][0] = 1.0 / half_tangent;
  clip_from_view[1][1] = -1.0 / half_tangent;
  clip_from_view[2][3] = -1.0;
  clip_from_view[3][2] = near_distance;
  return make_view(axes, eye, clip_from_view, glm::dvec2(half_tangent), near_distance, false, settings);
}

/// How much wider a view is drawn than what lookups enter.
double guard_scale(const Settings& settings) {
  const double resolution = settings.resolution;
  return resolution / std::max(resolution - 2.0 * guard_texels(settings.filter_radius), 1.0);
}

MapView cascade_view(const Axes& axes, const HeddleView& camera, const glm::dvec3& origin, double reach,
                     const Settings& settings) {
  const AxisSphere sphere = bounding_sphere(camera, reach);
  const glm::dvec3 eye = {camera.rel_from_view[12], camera.rel_from_view[13], camera.rel_from_view[14]};
  const glm::dvec3 forward =
      -glm::normalize(glm::dvec3(camera.rel_from_view[8], camera.rel_from_view[9], camera.rel_from_view[10]));
  glm::dvec3 centre = eye + forward * sphere.centre_distance;

  // The grid of texels is fixed in the scene: move the centre to a multiple of a texel, else shadow edges crawl when
  // the camera moves. One more texel on each side makes up for it.
  const double half =
      sphere.radius * guard_scale(settings) * (settings.resolution / std::max(settings.resolution - 2.0, 1.0));
  const double texel = 2.0 * half / settings.resolution;
  for (const glm::dvec3& axis : {axes.right, axes.up}) {
    const double place = glm::dot(axis, origin) + glm::dot(axis, centre);
    centre += axis * (std::floor(place / texel) * texel - place);
  }
  const glm::dvec3 near_eye = centre + axes.back * (sphere.radius + settings.caster_distance);
  return orthographic_view(axes, near_eye, glm::dvec2(half), 2.0 * sphere.radius + settings.caster_distance, settings);
}

}  // namespace

double guard_texels(double filter_radius) {
  return std::ceil(2.0 * (filter_radius + kBilinearReach) + 1.0);
}

AxisSphere bounding_sphere(const HeddleView& camera, double distance) {
  const glm::dvec2 half(camera.half_size[0], camera.half_size[1]);
  if (camera.is_orthographic != 0) {
    return {0.5 * distance, std::sqrt(0.25 * distance * distance + glm::dot(half, half))};
  }
  // The apex and the four far corners, which lie at (h, 1) * distance: the sphere through all five if its centre is in
  // front of the far plane, else the one around the far corners.
  const double slope_squared = glm::dot(half, half);
  if (slope_squared >= 1.0) return {distance, distance * std::sqrt(slope_squared)};
  const double radius = 0.5 * distance * (1.0 + slope_squared);
  return {radius, radius};
}

LightViews views_needed(const HeddleLight& light, const Settings& settings) {
  const bool shines = light.intensity[0] > 0 || light.intensity[1] > 0 || light.intensity[2] > 0;
  if ((light.flags & HEDDLE_LIGHT_CASTS_SHADOW) == 0 || !shines) return {};
  const auto radius = static_cast<float>(settings.filter_radius);
  switch (light.type) {
    case HEDDLE_LIGHT_DIRECTIONAL:
      return {0, settings.cascades, Layout::kCascades, radius};
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

std::vector<MapView> make_views(const HeddleLight& light, const HeddleView& camera, const glm::dvec3& origin,
                                const Settings& settings) {
  const LightViews needed = views_needed(light, settings);
  std::vector<MapView> views;
  const glm::dvec3 position = to_double(light.position_rel);
  switch (needed.layout) {
    case Layout::kNone:
      break;
    case Layout::kCascades: {
      const Axes axes = axes_looking_along(to_double(light.direction));
      for (std::uint32_t i = 0; i < needed.count; ++i) {
        const double reach = settings.distance / std::pow(kCascadeRatio, needed.count - 1 - i);
        views.push_back(cascade_view(axes, camera, origin, reach, settings));
      }
      break;
    }
    case Layout::kSpot: {
      const double tangent = std::tan(std::acos(std::min(static_cast<double>(light.cos_outer), 0.9999)));
      views.push_back(perspective_view(axes_looking_along(to_double(light.direction)), position,
                                       tangent * guard_scale(settings), settings.near_distance, settings));
      break;
    }
    case Layout::kCube: {
      // An emitter's own body, drawn in the scene, must not shadow its light.
      const double body = light.type == HEDDLE_LIGHT_SPHERE || light.type == HEDDLE_LIGHT_CAPSULE ? light.radius : 0.0;
      for (int face = 0; face < 6; ++face) {
        glm::dvec3 forward(0.0);
        forward[face / 2] = face % 2 == 0 ? 1.0 : -1.0;
        // 1.01: a cube inscribed around a sphere would still cut it by rounding.
        views.push_back(perspective_view(axes_looking_along(forward), position, guard_scale(settings),
                                         std::max(settings.near_distance, 1.01 * body), settings));
      }
      break;
    }
    case Layout::kBox: {
      const glm::dvec3 back = -glm::normalize(to_double(light.direction));
      const glm::dvec3 right = glm::normalize(to_double(light.tangent));
      const Axes axes = {right, glm::cross(back, right), back};
      const glm::dvec3 half = to_double(light.half_extent);
      views.push_back(orthographic_view(axes, position + back * half.z, glm::dvec2(half) * guard_scale(settings),
                                        2.0 * half.z, settings));
      break;
    }
  }
  return views;
}

std::vector<std::array<float, 4>> make_kernel(std::uint32_t taps, double radius) {
  // Vogel 1979, "A better way to construct the sunflower head": equal areas, no two taps in line.
  const double golden_angle = std::numbers::pi * (3.0 - std::sqrt(5.0));
  std::vector<glm::dvec2> points(std::max(taps, 1U));
  glm::dvec2 mean(0.0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double r = std::sqrt((static_cast<double>(i) + 0.5) / static_cast<double>(points.size()));
    const double angle = golden_angle * static_cast<double>(i);
    points[i] = r * glm::dvec2(std::cos(angle), std::sin(angle));
    mean += points[i] / static_cast<double>(points.size());
  }
  // A mean off the centre would move every shadow; after it is taken away the farthest tap is put back on the rim.
  double longest = 1.0;
  for (glm::dvec2& point : points) {
    point -= mean;
    longest = std::max(longest, glm::length(point));
  }
  std::vector<std::array<float, 4>> kernel(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const glm::dvec2 tap = points[i] * (radius / longest);
    kernel[i] = {static_cast<float>(tap.x), static_cast<float>(tap.y), 0.0F, 0.0F};
  }
  return kernel;
}

}  // namespace shadow_map
