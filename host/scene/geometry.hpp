// SPDX-License-Identifier: Apache-2.0
// Vertex attributes as they come in -> meshes with every field of HeddleVertex: flat normals where there are none,
// tangents where there are none.
#pragma once

#include "scene/scene.hpp"

namespace heddle::scene {

/// Attributes of one triangle list. Empty arrays are absent; the others have one element a position.
struct Attributes {
  std::vector<glm::vec3> positions, normals;
  std::vector<glm::vec4> tangents;
  std::array<std::vector<glm::vec2>, 2> uvs;
  std::vector<glm::vec4> colors;
  std::vector<std::uint32_t> indices;  // a multiple of three, all in range
};

/// Fills in what is missing and packs. `tangent_uv_set`: where a normal map's coordinates are; HEDDLE_NONE: there is no
/// normal map, and any direction across the normal will do as a tangent.
///
/// Flat normals: every triangle gets vertices of its own (glTF 2.0, 3.7.2.1). Tangents after the idea of Mikkelsen
/// 2008, "Simulation of Wrinkled Surfaces Revisited": each corner adds its triangle's texture gradient, projected onto
/// the vertex's tangent plane and weighted by the corner's angle, to all corners with equal position, normal and
/// coordinates whose triangles are turned the same way in texture space; where both ways meet, the vertex is split.
Mesh build_mesh(std::string name, std::uint32_t material, Attributes attributes, std::uint32_t tangent_uv_set);

/// Whatever lies across a unit vector.
glm::vec3 any_tangent(const glm::vec3& normal);

/// rgba8 with round to nearest of values clamped to 0..1, red in the lowest byte.
std::uint32_t pack_unorm8(const glm::vec4& color);

/// Takes normals of object space to scene space, up to length: inverse transpose, right for mirrored and defined for
/// flattening matrices too.
glm::dmat3 normal_matrix(const glm::dmat3& scene_from_object);

}  // namespace heddle::scene
