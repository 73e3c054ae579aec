// SPDX-License-Identifier: Apache-2.0
// Components in a glTF file -> the scene's: objects by component name in `extras.heddle`, or in the extension
// HEDDLE_components, of nodes, meshes, lights, materials and the scene.
#pragma once

#include "scene/gltf_document.hpp"

#include <map>

namespace heddle::scene::gltf {

class ComponentImport {
 public:
  ComponentImport(const Document& document, Scene& scene) : document_(document), scene_(scene) {}

  /// Of a node, its mesh and its light; a node's own say more than what it shares with others. What it made are the
  /// instances and lights from these ids on.
  void import_node(std::size_t node, std::uint32_t first_instance, std::uint32_t first_light);
  /// `ids`: the scene's index of each glTF material that something shows.
  void import_materials(const std::map<int, std::uint32_t>& ids);
  void import_scene();
  /// All mistakes of the file at once.
  void throw_if_any();

 private:
  struct Target {
    Owner owner = Owner::kScene;
    std::uint32_t first = 0, end = 0;
  };
  void import(const std::string& extras, const std::string& extensions, const std::string& pointer,
              std::span<const Target> targets);
  void import_all(const Json& components, const std::string& pointer, std::span<const Target> targets);

  const Document& document_;
  Scene& scene_;
  std::vector<Diagnostic> problems_;
};

}  // namespace heddle::scene::gltf
