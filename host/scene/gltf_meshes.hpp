// SPDX-License-Identifier: Apache-2.0
// Primitives of glTF meshes -> triangle lists in object space, posed by morph weights and joints.
#pragma once

#include "scene/geometry.hpp"
#include "scene/gltf_document.hpp"

#include <optional>

namespace heddle::scene::gltf {

/// Influences of one vertex: joints of the skin, with weights that sum to 1.
struct Influence {
  std::vector<std::uint32_t> joints;  // `per_vertex` a vertex
  std::vector<float> weights;
  std::size_t per_vertex = 0;  // 0: the primitive has none
};

struct Primitive {
  Attributes attributes;
  Influence influence;
};

/// Reads one primitive with these morph weights; nothing if it has no triangles (points, lines, no positions), with a
/// warning in the document.
std::optional<Primitive> read_primitive(Document& document, std::size_t mesh, std::size_t primitive,
                                        std::span<const double> morph_weights);

/// Matrices of a skin's joints, scene from bind pose, from the nodes' places.
std::vector<glm::dmat4> joint_matrices(const Document& document, int skin, std::span<const glm::dmat4> scene_from_node);

/// Moves the vertices by their joints: linear blending in float64. The result is in scene axes, relative to `origin`.
void apply_skin(const Document& document, std::span<const glm::dmat4> joints, const glm::dvec3& origin,
                Primitive& primitive);

}  // namespace heddle::scene::gltf
