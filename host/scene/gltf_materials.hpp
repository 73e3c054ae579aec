// SPDX-License-Identifier: Apache-2.0
// glTF materials and their textures -> the scene's, on demand: only what a drawn primitive names is decoded.
#pragma once

#include "scene/gltf_document.hpp"

#include <map>
#include <tuple>

namespace heddle::scene::gltf {

class MaterialImport {
 public:
  /// `scene` receives materials and textures; ids are indices in it.
  MaterialImport(Document& document, Scene& scene) : document_(document), scene_(scene) {}

  /// Scene's index of a glTF material; -1 is glTF's default material.
  std::uint32_t import(int material);
  /// Of each imported glTF material, the scene's index.
  [[nodiscard]] const std::map<int, std::uint32_t>& ids() const { return materials_; }
  /// Decodes what the imported materials use; each image once, stored once for each use (colour or data, wrap modes).
  void decode_textures();

 private:
  struct Use {
    std::size_t image = 0;
    std::uint32_t texture = 0;
  };
  std::uint32_t import_texture(int texture, bool is_srgb);

  Document& document_;
  Scene& scene_;
  std::map<int, std::uint32_t> materials_;
  std::map<std::tuple<std::size_t, bool, std::uint32_t, std::uint32_t, std::uint32_t>, std::uint32_t> textures_;
  std::vector<Use> uses_;
};

/// A number of an extension's object; `otherwise` where it is absent.
double extension_number(const tinygltf::ExtensionMap& extensions, const char* extension, const char* key,
                        double otherwise);

}  // namespace heddle::scene::gltf
