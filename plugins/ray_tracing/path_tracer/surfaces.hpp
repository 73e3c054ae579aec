// SPDX-License-Identifier: Apache-2.0
// A hit -> what is at that point: the twin of plugins/shared/surface_sample.glsl in float64, textures at their finest
// level. README "Surfaces".
#pragma once

#include "geometry.hpp"

#include <heddle/materials.h>
#include <heddle/services.h>

#include <array>
#include <optional>

namespace heddle::path_tracer {

struct Surface {
  Foot foot;
  glm::dvec3 facet{0.0};             // unit, towards the viewer
  glm::dvec3 normal{0.0};            // unit, what is shaded: with normal map, bent until it does not turn away
  glm::dvec3 normal_geometric{0.0};  // interpolated, on the viewer's side
  heddle_surface_point point{};
  double coverage = 1.0;      // of blended materials, else 1
  double transmission = 0.0;  // share of what is not metal that light passes through
  glm::dvec3 emissive{0.0};   // cd/m^2 towards the viewer; of unlit materials all that they show
  bool is_front = true;
  bool is_double_sided = false;
  bool is_blended = false;
  bool is_unlit = false;
};

/// Materials and textures of the scene, with the attributes of a snapshot's vertices: borrowed from the host for one
/// call of execute. Reading: [any-thread].
class Surfaces {
 public:
  /// False if the scene names what it does not have; the host has told it then.
  [[nodiscard]] bool update(const heddle_pass_host* host, const heddle_materials_service& service,
                            const heddle_snapshot& snapshot);

  /// `to_viewer`: unit.
  [[nodiscard]] Surface at(const Geometry& geometry, const Hit& hit, const glm::dvec3& to_viewer) const;
  /// What a triangle's front sends out, without regard to what it covers; 0 for unlit materials, which light nothing.
  [[nodiscard]] glm::dvec3 emissive(std::uint32_t triangle, double u, double v) const;
  [[nodiscard]] bool can_shine(std::uint32_t triangle) const;
  [[nodiscard]] bool is_double_sided(std::uint32_t triangle) const;
  /// Something that is the same only while all materials and textures are.
  [[nodiscard]] std::uint64_t hash() const;

 private:
  struct Corners {
    std::array<std::uint32_t, 3> vertices;
    std::array<double, 3> weights;
  };
  [[nodiscard]] Corners corners(std::uint32_t triangle, double u, double v) const;
  [[nodiscard]] glm::dvec4 vertex_color(const Corners& corners) const;
  template <glm::length_t kSize>
  [[nodiscard]] glm::vec<kSize, double> interpolate(const float* values, const Corners& corners) const;
  /// nullopt: the material has no such texture.
  [[nodiscard]] std::optional<glm::dvec4> sample(const heddle_scene_material& material, std::uint32_t slot,
                                                 const Corners& corners) const;

  const heddle_snapshot* snapshot_ = nullptr;
  heddle_snapshot_attributes attributes_{};
  std::vector<heddle_scene_material> materials_;
  std::vector<heddle_scene_texture> textures_;
};

}  // namespace heddle::path_tracer
