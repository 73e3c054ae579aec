// SPDX-License-Identifier: Apache-2.0
// One light and one point -> from where its light comes: the twin of plugins/shared/light.glsl in float64, and samples
// of those lights that have a size. README equations (7) to (10).
#pragma once

#include <heddle/records.h>

#include <glm/glm.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>

namespace heddle::path_tracer {

/// A HeddleLight in the axes and from the origin of the triangles.
struct Light {
  HeddleLight record{};
  glm::dvec3 position{0.0}, direction{0.0}, tangent{0.0}, bitangent{0.0}, intensity{0.0};
  double range = 0.0, radius = 0.0;
  bool casts_shadow = false;
  std::uint64_t texture = 0;  // element of `light_textures` with its first texel, 0: none
  std::uint32_t texture_width = 0, texture_height = 0;

  /// `origin`: what position_rel is relative to, from the triangles' origin.
  Light(const HeddleLight& record, const glm::dvec3& origin, std::span<const glm::vec4> light_textures);
  Light() = default;

  /// A direction alone says from where its light comes; others are seen under an angle.
  [[nodiscard]] bool has_size() const;
  /// A rectangle or sphere, which rays can meet at a finite distance.
  [[nodiscard]] bool is_shape() const {
    return record.type == HEDDLE_LIGHT_SPHERE || record.type == HEDDLE_LIGHT_RECTANGLE;
  }
  [[nodiscard]] bool is_disc() const { return record.type == HEDDLE_LIGHT_DIRECTIONAL && has_size(); }
  /// 1 near the light, 0 at and beyond its range.
  [[nodiscard]] double window(double distance_squared) const;
  [[nodiscard]] bool is_in_box(const glm::dvec3& point) const;
};

struct Arrival {
  glm::dvec3 direction{0.0};  // unit, to the light
  double distance = 0.0;      // metres; infinity for directional lights
  glm::dvec3 value{0.0};      // without size: lx facing `direction`; with one: cd/m^2
  double pdf = 0.0;           // per steradian; 0: nothing arrives. 1 for lights without size
};

/// (7) Of lights without size.
Arrival arrival_without_size(const Light& light, const glm::dvec3& point);

/// (8) to (10) A point of a light that has a size, as seen from `point`.
Arrival sample_light(const Light& light, const glm::dvec3& point, const glm::dvec2& u,
                     std::span<const glm::vec4> light_textures);

/// What a ray from `point` along a unit direction meets of a shape or disc farther than `first` and up to `length`: its
/// value, its distance, and the density with which sample_light draws that direction at `point`. pdf 0: it misses.
Arrival meet_light(const Light& light, const glm::dvec3& point, const glm::dvec3& direction, double first,
                   double length, std::span<const glm::vec4> light_textures);

/// 1 - cos of an angle by its sine squared, without cancellation.
inline double one_minus_cos(double sine_squared) {
  return sine_squared / (1.0 + std::sqrt(std::max(1.0 - sine_squared, 0.0)));
}

}  // namespace heddle::path_tracer
