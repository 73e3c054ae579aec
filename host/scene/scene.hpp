// SPDX-License-Identifier: Apache-2.0
// The scene on the CPU: what is rendered, in float64 where places are concerned. Knows no device (upload does).
#pragma once

#include "diagnostics.hpp"

#include <heddle/heddle.h>

#include <glm/glm.hpp>
#include <glm/gtc/quaternion.hpp>

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace heddle::scene {

struct Texture {
  std::string name;
  std::uint32_t width = 0, height = 0;
  bool is_srgb = false;  // decided by the materials that use it; a texture used as both is stored twice
  std::array<std::uint32_t, 2> wrap{0, 0};  // 0 repeat, 1 mirror, 2 clamp
  std::vector<std::uint8_t> rgba;           // top row first
};

struct Material {
  std::string name;
  std::array<std::uint32_t, HEDDLE_TEXTURE_COUNT> textures{};  // index, HEDDLE_NONE
  HeddleMaterial record{};                                     // texture_layer* and texture_group are filled by upload
};

/// What is behind shows through: alpha is coverage, or light passes.
bool is_blended(const HeddleMaterial& material);

struct Mesh {
  std::string name;
  std::uint32_t material = 0;
  std::vector<HeddleVertex> vertices;
  std::vector<std::uint32_t> indices;
  std::array<glm::vec3, 2> bounds{};  // object space
};

struct Instance {
  std::string name;
  std::uint32_t mesh = 0;
  glm::dmat4 scene_from_object{1.0};
  glm::dmat4 previous_scene_from_object{1.0};
};

struct Light {
  std::string name;
  glm::dvec3 position{0.0};
  HeddleLight record{};
};

struct Camera {
  std::string name;
  heddle_camera record{};
};

struct Environment {
  HeddleEnvironment record{};
  std::vector<float> texels;  // rgba
};

class Scene {
 public:
  std::vector<Texture> textures;
  std::vector<Material> materials;
  std::vector<Mesh> meshes;
  std::vector<Instance> instances;
  std::vector<Light> lights;
  std::vector<Camera> cameras;
  std::uint32_t camera = HEDDLE_NONE;  // in use
  std::optional<Environment> environment;

  /// Counted up when meshes, materials, textures or the list of instances change / when instances only move. Every
  /// scene of a process starts far from all others, so caches need no other key.
  std::uint64_t content_revision = new_revision();
  std::uint64_t motion_revision = new_revision();

  /// What loaded files asked for and did not get: skipped primitives, extensions that nobody here knows.
  std::vector<std::string> warnings;
  std::vector<std::string> ignored_extensions;

  /// After a frame: what moved has arrived, so the next frame's previous places are this one's. True if anything had
  /// moved (then motion_revision is new).
  bool settle();
  static std::uint64_t new_revision();

  /// Scene-space bounds of all instances; {0,0} if empty.
  [[nodiscard]] std::array<glm::dvec3, 2> bounds() const;
  /// The camera in use for a frame of this shape; without one: a view of the whole scene, slightly from above and the
  /// side, far enough to hold the bounding sphere.
  [[nodiscard]] heddle_camera active_camera(std::uint32_t width, std::uint32_t height) const;
  /// Facts that techniques can ask for: "surfaces", "lights", "masked", "blended", "emissive", "double_sided",
  /// "textures", "environment". Only what an instance shows counts.
  [[nodiscard]] std::vector<std::string> features() const;
  [[nodiscard]] std::string describe_json() const;
};

/// Adds a glTF 2.0 file to the scene, all or nothing. Throws Error with the file and what in it is wrong. A scene
/// without cameras then uses the file's first one. Skins and morph targets are applied as the file poses them.
void load_gltf(Scene& scene, const std::filesystem::path& file);

/// View record of a camera, unjittered, composed in float64. `origin`: the frame's origin. `previous`: last frame's
/// camera, with its own position.
HeddleView make_view(const heddle_camera& camera, std::uint32_t width, std::uint32_t height, const glm::dvec3& origin,
                     const heddle_camera* previous = nullptr);

}  // namespace heddle::scene
