// SPDX-License-Identifier: Apache-2.0
// Depth maps of lights: their views in float64, relative to points of their own, so that neither a map nor its grid of
// texels moves with the camera; and what a lookup needs to know of them. Pure functions. See depth_map.glsl.
#pragma once

#include "atlas_room.hpp"

#include <heddle/records.h>

#include <glm/glm.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

namespace depth_maps {

/// What shaders know of a map: seven vec4; unpack_depth_map in depth_map.glsl reads them.
struct LookupView {
  float clip_from_rel[16];
  float axis[3];     // the way the map looks, unit
  float texel_size;  // metres; perspective: metres at distance 1 along the axis
  float eye_rel[3];
  float guard;    // width of the border, in ndc, that only filters may read
  float tile[4];  // the map's place in the atlas: its centre and half a side in uv, its layer
};
static_assert(sizeof(LookupView) == 112, "seven vec4, as depth_maps.glsl reads them");

/// Axes of a view in the scene, unit and orthogonal; it looks along -back.
struct Axes {
  glm::dvec3 right, up, back;
};

/// A map to draw and to look up.
struct MapView {
  HeddleView draw{};       // relative to `origin`
  glm::dvec3 origin{0.0};  // scene point
  Axes axes{};
  glm::dmat4 clip_from_view{1.0};
  glm::dvec2 half_size{1.0};  // metres; perspective: tangents
  double guard_texels = 0;
  std::uint32_t side = 0;  // texels
};

inline glm::dvec3 to_double(const float v[3]) {
  return {v[0], v[1], v[2]};
}

/// Any axes that look along `forward`: they depend on it alone, so that maps stand still under the camera.
inline Axes axes_along(const glm::dvec3& forward) {
  const glm::dvec3 back = -glm::normalize(forward);
  const glm::dvec3 hint = std::abs(back.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(0, 0, 1);
  const glm::dvec3 right = glm::normalize(glm::cross(hint, back));
  return {right, glm::cross(back, right), back};
}

/// A bilinear lookup reads texel centres up to one texel away in x and in y.
inline constexpr double kBilinearReach = std::numbers::sqrt2;

/// Texels at each border that lookups do not enter: the filter's reach, and once more the normal offset, which moves a
/// lookup by at most as much.
inline double guard_texels(double filter_radius) {
  return std::ceil(2.0 * (filter_radius + kBilinearReach) + 1.0);
}
/// How much wider a map is drawn than what lookups enter.
inline double guard_scale(double filter_radius, std::uint32_t side) {
  return side / std::max(side - 2.0 * guard_texels(filter_radius), 1.0);
}

namespace detail {

inline void store(const glm::dmat4& matrix, float out[16]) {
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 4; ++row) out[4 * column + row] = static_cast<float>(matrix[column][row]);
}

/// Rigid: a view's axes at `eye`.
inline glm::dmat4 placed(const Axes& axes, const glm::dvec3& eye) {
  return {glm::dvec4(axes.right, 0.0), glm::dvec4(axes.up, 0.0), glm::dvec4(axes.back, 0.0), glm::dvec4(eye, 1.0)};
}
inline glm::dmat4 placed_inverse(const Axes& axes, const glm::dvec3& eye) {
  const glm::dmat3 rotation = glm::transpose(glm::dmat3(axes.right, axes.up, axes.back));
  glm::dmat4 inverse(rotation);
  inverse[3] = glm::dvec4(-(rotation * eye), 1.0);
  return inverse;
}

inline MapView make_view(const Axes& axes, const glm::dvec3& eye, const glm::dmat4& clip_from_view,
                         const glm::dvec2& half_size, double near_distance, bool is_orthographic, double filter_radius,
                         std::uint32_t side) {
  MapView out;
  out.origin = eye;
  out.axes = axes;
  out.clip_from_view = clip_from_view;
  out.half_size = half_size;
  out.guard_texels = guard_texels(filter_radius);
  out.side = side;
  const glm::dmat4 rel_from_view = placed(axes, glm::dvec3(0.0));
  const glm::dmat4 view_from_rel = placed_inverse(axes, glm::dvec3(0.0));
  const glm::dmat4 clip_from_rel = clip_from_view * view_from_rel;
  store(clip_from_rel, out.draw.clip_from_rel);
  store(glm::inverse(clip_from_rel), out.draw.rel_from_clip);
  store(view_from_rel, out.draw.view_from_rel);
  store(rel_from_view, out.draw.rel_from_view);
  store(clip_from_rel, out.draw.previous_clip_from_rel);
  out.draw.half_size[0] = static_cast<float>(half_size.x);
  out.draw.half_size[1] = static_cast<float>(half_size.y);
  out.draw.near_distance = static_cast<float>(near_distance);
  out.draw.is_orthographic = is_orthographic ? 1U : 0U;
  out.draw.extent[0] = out.draw.extent[1] = side;
  return out;
}

}  // namespace detail

/// `eye`: in the scene, on the near plane, so that depth is 1 there and 0 at `length` metres.
inline MapView orthographic_view(const Axes& axes, const glm::dvec3& eye, const glm::dvec2& half_size, double length,
                                 double filter_radius, std::uint32_t side) {
  glm::dmat4 clip_from_view(0.0);
  clip_from_view[0][0] = 1.0 / half_size.x;
  clip_from_view[1][1] = -1.0 / half_size.y;
  clip_from_view[2][2] = 1.0 / length;
  clip_from_view[3][2] = 1.0;
  clip_from_view[3][3] = 1.0;
  return detail::make_view(axes, eye, clip_from_view, half_size, 0.0, true, filter_radius, side);
}

inline MapView perspective_view(const Axes& axes, const glm::dvec3& eye, double half_tangent, double near_distance,
                                double filter_radius, std::uint32_t side) {
  glm::dmat4 clip_from_view(0.0);
  clip_from_view[0][0] = 1.0 / half_tangent;
  clip_from_view[1][1] = -1.0 / half_tangent;
  clip_from_view[2][3] = -1.0;
  clip_from_view[3][2] = near_distance;
  return detail::make_view(axes, eye, clip_from_view, glm::dvec2(half_tangent), near_distance, false, filter_radius,
                           side);
}

/// Metres a texel spans; perspective: at distance 1. Views need not be square: the larger side bounds what is missed.
inline double texel_size(const MapView& view) {
  return 2.0 * std::max(view.half_size.x, view.half_size.y) / view.side;
}

/// A scene point in the map's texels, from its first one's outer corner, and its depth 0..1.
inline glm::dvec3 texel_of(const MapView& view, const glm::dvec3& point) {
  const glm::dvec4 clip =
      view.clip_from_view * detail::placed_inverse(view.axes, glm::dvec3(0.0)) * glm::dvec4(point - view.origin, 1.0);
  const glm::dvec3 ndc = glm::dvec3(clip) / clip.w;
  return {(0.5 * ndc.x + 0.5) * view.side, (0.5 * ndc.y + 0.5) * view.side, ndc.z};
}

/// For positions relative to the frame's origin. `layer_side`: texels of the whole layer that the tile is part of.
inline LookupView make_lookup(const MapView& view, const glm::dvec3& frame_origin, const Tile& tile,
                              std::uint32_t layer_side) {
  LookupView out{};
  const glm::dvec3 eye = view.origin - frame_origin;
  detail::store(view.clip_from_view * detail::placed_inverse(view.axes, eye), out.clip_from_rel);
  for (int i = 0; i < 3; ++i) {
    out.axis[i] = static_cast<float>(-view.axes.back[i]);
    out.eye_rel[i] = static_cast<float>(eye[i]);
  }
  out.texel_size = static_cast<float>(texel_size(view));
  out.guard = static_cast<float>(2.0 * view.guard_texels / view.side);
  // Texels and sides are small integers: exact, so that a map that fills its layer is looked up as if there were no
  // tiles.
  out.tile[0] = static_cast<float>((tile.x + 0.5 * tile.side) / layer_side);
  out.tile[1] = static_cast<float>((tile.y + 0.5 * tile.side) / layer_side);
  out.tile[2] = static_cast<float>(0.5 * tile.side / layer_side);
  out.tile[3] = static_cast<float>(tile.layer);
  return out;
}

/// Bounding sphere of the part of a view up to `distance` metres: its centre in front of the eye, and its radius.
struct AxisSphere {
  double centre_distance = 0;
  double radius = 0;
};
inline AxisSphere bounding_sphere(const HeddleView& camera, double distance) {
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

/// How far the camera may go, in texels, before a parallel light's map follows it.
struct Cascade {
  double reach = 0;            // metres of the main view
  double caster_distance = 0;  // metres towards the light, outside of the view, in which casters are drawn
  double filter_radius = 0;    // texels
  double slack = 1;            // texels
  std::uint32_t side = 0;
};

/// The map of a parallel light that holds the main view as far as `cascade.reach`, on a grid that is fixed in the
/// scene: turning the camera changes nothing but the map's place, and moving it moves the map by whole steps of `slack`
/// texels.
inline MapView cascade_view(const Axes& axes, const HeddleView& camera, const glm::dvec3& frame_origin,
                            const Cascade& cascade) {
  const AxisSphere sphere = bounding_sphere(camera, cascade.reach);
  const glm::dvec3 eye = {camera.rel_from_view[12], camera.rel_from_view[13], camera.rel_from_view[14]};
  const glm::dvec3 forward =
      -glm::normalize(glm::dvec3(camera.rel_from_view[8], camera.rel_from_view[9], camera.rel_from_view[10]));
  const glm::dvec3 centre = frame_origin + eye + forward * sphere.centre_distance;

  // The map's centre is the nearest node of a lattice of `slack` texels: up to half of them away, which its border
  // makes up for. Along the light the steps are as long as a quarter of the radius, for the depths to stand still as
  // well.
  const double slack = std::max(cascade.slack, 1.0);
  const double half = sphere.radius * guard_scale(cascade.filter_radius, cascade.side) *
                      (cascade.side / std::max(cascade.side - slack, 1.0));
  const double step = 2.0 * half / cascade.side * slack;
  const double depth_step = 0.25 * sphere.radius;
  const auto on_grid = [&](const glm::dvec3& axis, double spacing) {
    return axis * (std::round(glm::dot(axis, centre) / spacing) * spacing);
  };
  const double towards_light = sphere.radius + 0.5 * depth_step + cascade.caster_distance;
  const glm::dvec3 near_eye =
      on_grid(axes.right, step) + on_grid(axes.up, step) + on_grid(axes.back, depth_step) + axes.back * towards_light;
  return orthographic_view(axes, near_eye, glm::dvec2(half), towards_light + sphere.radius + 0.5 * depth_step,
                           cascade.filter_radius, cascade.side);
}

/// Metres of the main view that parallel lights shadow, and metres towards the light in which casters are drawn.
struct Reach {
  double distance = 0, caster_distance = 0;
};
/// How far maps of parallel lights reach where nobody says. The whole of a scene; but where it is larger than `most`
/// and than ten of its typical instances (a floor to the horizon, around things that are to have shadows), only so far.
/// At least the scene's diagonal, so that it does not follow a camera inside of it; and in steps of 10^(1/6), a scale
/// on which a thousand times as large is as fine: a camera outside, and what moves, leave the maps where they are.
/// `caster_distance`: what is asked for; no more of it is used than the scene has.
inline Reach reach_of_scene(const double (&bounds)[6], double typical_size, const glm::dvec3& eye, double most,
                            double caster_distance) {
  const glm::dvec3 low(bounds[0], bounds[1], bounds[2]);
  const glm::dvec3 high(bounds[3], bounds[4], bounds[5]);
  const double diagonal = glm::distance(low, high);
  if (!(diagonal > 0.0)) return {most, caster_distance};
  const auto rounded_up = [](double metres) { return std::pow(10.0, std::ceil(6.0 * std::log10(metres)) / 6.0); };
  constexpr double kFadeFree = 0.9;  // over the last tenth shadows fade
  const double whole = std::max(glm::length(glm::max(glm::abs(low - eye), glm::abs(high - eye))), diagonal) / kFadeFree;
  const double wanted = std::min(whole, std::max(most, 10.0 * typical_size));
  const double distance = wanted == most ? most : rounded_up(wanted);
  // Twice: whichever way the light comes from, out of the sphere around that part of the view. And no more, as what
  // float32 leaves of a lookup's place grows with its distance from where the light's rays begin.
  return {distance, std::min(std::max(caster_distance, 2.0 * distance), 2.0 * rounded_up(whole))};
}

/// Filter taps, in filter radii, evenly spread over a disk, with their mean at its centre; one tap is the centre. Vogel
/// 1979, "A better way to construct the sunflower head": equal areas, no two taps in line.
inline std::vector<std::array<float, 4>> make_kernel(std::uint32_t taps) {
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
    const glm::dvec2 tap = points[i] / longest;
    kernel[i] = {static_cast<float>(tap.x), static_cast<float>(tap.y), 0.0F, 0.0F};
  }
  return kernel;
}

}  // namespace depth_maps
