// SPDX-License-Identifier: Apache-2.0
// Primitives of glTF meshes -> triangle lists at rest, with the joints and morph targets that bend them.
#pragma once

#include "scene/geometry.hpp"
#include "scene/gltf_document.hpp"

#include <optional>

namespace heddle::scene::gltf {

struct Primitive {
  Attributes attributes;
  std::vector<std::uint32_t> face_sizes;  // as Mesh has them
  Influence influence;
  std::vector<MorphTarget> targets;  // only if asked for
};

/// Reads one primitive at rest; nothing if it has no triangles (points, lines, no positions), with a warning in the
/// document.
std::optional<Primitive> read_primitive(Document& document, std::size_t mesh, std::size_t primitive, bool with_targets);

}  // namespace heddle::scene::gltf
