// SPDX-License-Identifier: Apache-2.0
// Bent vertices -> a mesh's next shape.
#pragma once

#include "scene/scene.hpp"

namespace heddle::scene {

/// Gives the mesh a new shape; the one before stays its previous shape unless it has one of an earlier frame already.
/// True if joints turned triangles over, so that the indices changed too.
bool set_shape(const DeformedVertices& bent, Deformation& deformation, Mesh& mesh);

}  // namespace heddle::scene
