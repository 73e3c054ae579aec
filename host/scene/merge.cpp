// SPDX-License-Identifier: Apache-2.0
// Two scenes -> one: indices of the second shift.
#include <algorithm>
#include <iterator>
#include <utility>

#include "scene/scene.hpp"

namespace heddle::scene {
namespace {

template <typename Element>
void append(std::vector<Element>& to, std::vector<Element>& from) {
  to.insert(to.end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
}

}  // namespace

void merge(Scene& scene, Scene loaded) {
  scene.files.insert(scene.files.end(), loaded.files.begin(), loaded.files.end());
  const auto textures = static_cast<std::uint32_t>(scene.textures.size());
  const auto materials = static_cast<std::uint32_t>(scene.materials.size());
  const auto meshes = static_cast<std::uint32_t>(scene.meshes.size());
  const auto lights = static_cast<std::uint32_t>(scene.lights.size());
  const auto instances = static_cast<std::uint32_t>(scene.instances.size());
  const auto cameras = static_cast<std::uint32_t>(scene.cameras.size());
  for (Material& material : loaded.materials) {
    for (std::uint32_t& texture : material.textures) {
      texture += texture == HEDDLE_NONE ? 0 : textures;
    }
    material.record.id += materials;
  }
  for (Mesh& mesh : loaded.meshes) {
    mesh.material += materials;
  }
  for (Instance& instance : loaded.instances) {
    instance.mesh += meshes;
  }
  for (Light& light : loaded.lights) {
    light.record.id += lights;
  }
  for (Rig& rig : loaded.rigs) {
    for (Deformation& deformation : rig.deformations) {
      deformation.mesh += meshes;
      deformation.instance += instances;
    }
    for (const auto& [list, first] :
         {std::pair(&rig.instances, instances), std::pair(&rig.lights, lights), std::pair(&rig.cameras, cameras)}) {
      for (Rig::Attached& attached : *list) {
        attached.thing += first;
      }
    }
  }
  scene.rigs.reserve(scene.rigs.size() + loaded.rigs.size());
  scene.textures.reserve(scene.textures.size() + loaded.textures.size());
  scene.materials.reserve(scene.materials.size() + loaded.materials.size());
  scene.meshes.reserve(scene.meshes.size() + loaded.meshes.size());
  scene.instances.reserve(scene.instances.size() + loaded.instances.size());
  scene.lights.reserve(scene.lights.size() + loaded.lights.size());
  scene.cameras.reserve(scene.cameras.size() + loaded.cameras.size());
  scene.warnings.reserve(scene.warnings.size() + loaded.warnings.size());
  scene.ignored_extensions.reserve(scene.ignored_extensions.size() + loaded.ignored_extensions.size());
  scene.components.merge(loaded.components, {0, instances, materials, lights});
  if (scene.cameras.empty() && !loaded.cameras.empty()) {
    scene.camera = loaded.camera < loaded.cameras.size() ? loaded.camera : 0;
  }
  append(scene.rigs, loaded.rigs);
  append(scene.textures, loaded.textures);
  append(scene.materials, loaded.materials);
  append(scene.meshes, loaded.meshes);
  append(scene.instances, loaded.instances);
  append(scene.lights, loaded.lights);
  append(scene.cameras, loaded.cameras);
  append(scene.warnings, loaded.warnings);
  for (std::string& extension : loaded.ignored_extensions) {
    if (std::find(scene.ignored_extensions.begin(), scene.ignored_extensions.end(), extension) ==
        scene.ignored_extensions.end()) {
      scene.ignored_extensions.push_back(std::move(extension));
    }
  }
  scene.content_revision = Scene::new_revision();
  scene.motion_revision = Scene::new_revision();
}

}  // namespace heddle::scene
