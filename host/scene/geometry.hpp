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
  /// If given, 0, 1, 2 ...: completing splits vertices, and this then says which given vertex each one was.
  std::vector<std::uint32_t> sources;
};

/// Fills in what is missing: unit normals always, tangents where a normal map needs them. `tangent_uv_set`: where a
/// normal map's coordinates are; HEDDLE_NONE: there is no normal map, and any direction across the normal will do as a
/// tangent.
///
/// Flat normals: every triangle gets vertices of its own (glTF 2.0, 3.7.2.1). Tangents after the idea of Mikkelsen
/// 2008, "Simulation of Wrinkled Surfaces Revisited": each corner adds its triangle's texture gradient, projected onto
/// the vertex's tangent plane and weighted by the corner's angle, to all corners with equal position, normal and
/// coordinates whose triangles are turned the same way in texture space; where both ways meet, the vertex is split.
/// `uv_matrix`: the normal map's transform of its coordinates, which turns its axes on the surface.
void complete(Attributes& attributes, std::uint32_t tangent_uv_set,
              const std::array<float, 4>& uv_matrix = {1, 0, 0, 1});
/// Packs completed attributes; tangents that are absent lie anyhow across the normal.
Mesh pack(std::string name, std::uint32_t material, Attributes attributes);
/// Both.
Mesh build_mesh(std::string name, std::uint32_t material, Attributes attributes, std::uint32_t tangent_uv_set,
                const std::array<float, 4>& uv_matrix = {1, 0, 0, 1});

/// Whatever lies across a unit vector.
glm::vec3 any_tangent(const glm::vec3& normal);

/// rgba8 with round to nearest of values clamped to 0..1, red in the lowest byte.
std::uint32_t pack_unorm8(const glm::vec4& color);

/// Takes normals of object space to scene space, up to length: inverse transpose, right for mirrored and defined for
/// flattening matrices too.
glm::dmat3 normal_matrix(const glm::dmat3& scene_from_object);

}  // namespace heddle::scene
