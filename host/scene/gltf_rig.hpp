// SPDX-License-Identifier: Apache-2.0
// Nodes, skins and animations of a glTF file -> a rig, checked whole.
#pragma once

#include "scene/gltf_document.hpp"
#include "scene/rig.hpp"

namespace heddle::scene::gltf {

/// All nodes and animations; fails where the nodes are no forest. Skins are read when a node uses them (import_skin).
Rig import_rig(Document& document);

/// Index in the rig of a skin of the file.
std::uint32_t import_skin(const Document& document, int skin, Rig& rig, std::vector<std::uint32_t>& skin_ids);

}  // namespace heddle::scene::gltf
