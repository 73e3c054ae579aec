// SPDX-License-Identifier: Apache-2.0
// Arrays of an application (heddle_mesh) -> a checked mesh with every vertex field.
#pragma once

#include "scene/scene.hpp"

namespace heddle::scene {

/// Copies and completes. Throws Error(HEDDLE_BAD_INPUT) naming the mesh, the array and the first wrong element: an
/// index out of range, a position that is not finite, an index count that is not a multiple of three.
Mesh make_mesh(const heddle_mesh& given, std::string name, std::uint32_t material_index, const Material& material);

}  // namespace heddle::scene
