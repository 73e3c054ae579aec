// SPDX-License-Identifier: Apache-2.0
// No part of a scene is forgotten: each switch below names them all, or the compiler says which one is missing.
#include "graph/execute_parts.hpp"

#include "scene/light_texture.hpp"
#include "scene/upload.hpp"

namespace heddle::graph {

namespace {

/// Everything that shaders and snapshots see of what is drawn, as it is posed.
void add_surfaces(ContentHash& hash, const scene::Scene& scene) {
  for (const scene::Texture& texture : scene.textures) {
    for (const std::uint32_t number :
         {texture.width, texture.height, texture.is_srgb ? 1U : 0U, texture.wrap[0], texture.wrap[1], texture.filter})
      add_bytes(hash, number);
    add_array(hash, texture.rgba);
  }
  for (const scene::Material& material : scene.materials) {
    hash.add(material.name);
    add_bytes(hash, material.textures);
    add_bytes(hash, material.record);
  }
  for (const scene::Mesh& mesh : scene.meshes) {
    add_bytes(hash, mesh.material);
    add_array(hash, mesh.vertices);
    add_array(hash, mesh.indices);
  }
  for (const scene::Instance& instance : scene.instances) {
    add_bytes(hash, instance.mesh);
    add_bytes(hash, instance.scene_from_object);
  }
}

void add_state(std::vector<std::byte>& bytes, const scene::Scene& scene, ScenePart part, std::uint32_t width,
               std::uint32_t height) {
  switch (part) {
    case ScenePart::kCamera:
      add_bytes(bytes, scene.active_camera(width, height));
      return;
    case ScenePart::kEnvironment:
      add_bytes(bytes, scene.environment.has_value());
      if (scene.environment) add_bytes(bytes, scene.environment->record);  // with the revision of its texels
      return;
    case ScenePart::kLightTextures:
      for (const scene::Light& light : scene.lights)
        add_bytes(bytes, light.texture ? light.texture->revision : std::uint64_t{0});
      return;
    case ScenePart::kLights:
      add_bytes(bytes, scene.lights.size());
      for (const scene::Light& light : scene.lights) {
        add_bytes(bytes, light.position);
        add_bytes(bytes, light.record);
      }
      return;
    case ScenePart::kSurfaces:
      add_bytes(bytes, scene.content_revision);
      add_bytes(bytes, scene.motion_revision);
      return;
  }
}

}  // namespace

std::vector<std::byte> scene_state(const scene::Scene& scene, std::uint32_t width, std::uint32_t height) {
  std::vector<std::byte> bytes;
  add_bytes(bytes, &scene);
  for (const ScenePort& port : kScenePorts) add_state(bytes, scene, port.part, width, height);
  add_bytes(bytes, scene.components.revision());
  return bytes;
}

void add_content(ContentHash& hash, const scene::Scene& scene, ScenePart part, const glm::dvec3& origin) {
  switch (part) {
    case ScenePart::kCamera:
      // A key that does not hold what a job reads would give out the artifact of another scene.
      throw Error(HEDDLE_BUG, "no job's key can hold the scene's camera");
    case ScenePart::kEnvironment:
      if (scene.environment) {
        HeddleEnvironment record = scene.environment->record;
        record.revision = 0;  // a count of this process
        add_bytes(hash, record);
        add_array(hash, scene.environment->texels);
      }
      return;
    case ScenePart::kLightTextures:
      add_array(hash, scene::light_texture_elements(scene::light_textures(scene)));
      return;
    case ScenePart::kLights:
      add_bytes(hash, origin);
      add_array(hash, scene::SceneBuffers::lights(scene, origin));
      for (const scene::Light& light : scene.lights) hash.add(light.name);
      return;
    case ScenePart::kSurfaces: {
      add_bytes(hash, origin);
      ContentHash surfaces;
      add_surfaces(surfaces, scene);
      hash.add(surfaces.hexadecimal());
      return;
    }
  }
}

}  // namespace heddle::graph
