// SPDX-License-Identifier: Apache-2.0
// The scene on the CPU: what is rendered, in float64 where places are concerned. Knows no device (upload does).
#pragma once

#include "diagnostics.hpp"
#include "scene/components.hpp"
#include "scene/rig.hpp"

#include <heddle/heddle.h>

#include <glm/glm.hpp>
#include <glm/gtc/quaternion.hpp>

#include <array>
#include <filesystem>
#include <functional>
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
  std::uint32_t filter = 0;                 // HEDDLE_FILTER_*
  std::vector<std::uint8_t> rgba;           // top row first
};

/// KHR_texture_transform: uv' = matrix * uv + offset.
struct TextureTransform {
  std::array<float, 4> matrix{1, 0, 0, 1};  // columns
  std::array<float, 2> offset{0, 0};
  bool operator==(const TextureTransform&) const = default;
};
/// Of one texture of a material (HEDDLE_TEXTURE_*); a matrix that is all zero stands for the base colour's transform.
TextureTransform texture_transform(const HeddleMaterial& record, std::uint32_t texture);
void set_texture_transform(HeddleMaterial& record, std::uint32_t texture, const TextureTransform& transform);

/// What is behind shows through: alpha is coverage, or light passes.
bool is_blended(const HeddleMaterial& material);
/// HEDDLE_SURFACE_* of what a material covers. Blended surfaces cast no shadow: a map cannot tell how much light
/// passes.
std::uint32_t surface_flags(const HeddleMaterial& material);

struct Material {
  std::string name;
  std::array<std::uint32_t, HEDDLE_TEXTURE_COUNT> textures{};  // index, HEDDLE_NONE
  HeddleMaterial record{};                                     // texture_layer* and texture_group are filled by upload
};

struct Mesh {
  std::string name;
  std::uint32_t material = 0;
  std::vector<HeddleVertex> vertices;
  std::vector<std::uint32_t> indices;
  std::array<glm::vec3, 2> bounds{};  // object space

  // A mesh that bends has a number for each of its shapes; `previous_vertices` are the last frame's where the two
  // numbers differ, and mean nothing where they are equal. 0: never bends.
  std::uint64_t shape = 0, previous_shape = 0;
  std::vector<HeddleVertex> previous_vertices;

  // What subdivision needs to know beyond triangles. Faces as they were given, each a number of corners, drawn as a fan
  // of triangles around its first one; empty: every triangle is a face. Creases are pairs of vertices, an isolated one
  // a pair of the same.
  std::vector<std::uint32_t> face_sizes;
  std::vector<std::uint32_t> creases;  // two numbers of vertices each
  std::vector<float> sharpness;        // of each crease
};

struct Instance {
  std::string name;
  std::uint32_t mesh = 0;
  glm::dmat4 scene_from_object{1.0};
  glm::dmat4 previous_scene_from_object{1.0};
};

/// What a rectangle light shines with, and its mip chain; never changes once made, so lights share it.
struct LightTexture {
  std::uint32_t width = 0, height = 0;
  std::uint32_t level_count = 0;
  std::vector<glm::vec4> texels;  // of all levels, the finest first
  std::uint64_t revision = 0;     // differs from every other's
};

struct Light {
  std::string name;
  glm::dvec3 position{0.0};
  HeddleLight record{};
  std::shared_ptr<const LightTexture> texture;  // null: none; of rectangles alone it is seen
};

struct Camera {
  std::string name;
  heddle_camera record{};
};

struct Environment {
  HeddleEnvironment record{};
  std::vector<float> texels;  // rgba
};

/// What cameras that say nothing have in a scene without surfaces, and at most. Metres; the far plane is orthographic.
inline constexpr double kDefaultNear = 0.01, kDefaultFar = 1000.0;
/// The near plane in smaller scenes, in diagonals of the scene.
inline constexpr double kNearOfDiagonal = 1e-3;

class Scene {
 public:
  std::vector<Texture> textures;
  std::vector<Material> materials;
  std::vector<Mesh> meshes;
  std::vector<Instance> instances;
  std::vector<Light> lights;
  std::vector<Camera> cameras;
  std::uint32_t camera = HEDDLE_NONE;  // in use
  Components components;
  std::vector<Rig> rigs;  // of loaded files with animations
  double time = 0;        // seconds, that the rigs are posed at
  std::optional<Environment> environment;

  /// Counted up when meshes, materials, textures or the list of instances change / when instances only move. Every
  /// scene of a process starts far from all others, so caches need no other key.
  std::uint64_t content_revision = new_revision();
  std::uint64_t motion_revision = new_revision();

  std::vector<const void*> seen_by;  // graphs that have shown the scene as it is

  std::vector<std::filesystem::path> files;  // that were read, with those that they name

  /// What loaded files asked for and did not get: skipped primitives, extensions that nobody here knows.
  std::vector<std::string> warnings;
  std::vector<std::string> ignored_extensions;

  /// Poses what animations move; the places and shapes of the last frame stay the previous ones. Nothing happens at the
  /// time that the scene is posed at already. On an error the scene is as before.
  void set_time(double seconds);
  /// Which animation of its file plays, counted over all files, and whether it begins again after its end; HEDDLE_NONE:
  /// all files are at rest. Poses anew.
  void use_animation(std::uint32_t id, bool loops);
  [[nodiscard]] std::size_t animation_count() const;

  /// After a frame: what moved has arrived, so the next frame's previous places are this one's. True if anything had
  /// moved (then motion_revision is new).
  bool settle();
  /// Several graphs may show one scene in turn; each has last frame's places for its previous ones. Before a graph's
  /// frame, after it, and before anything moves: what somebody has seen then becomes previous.
  void begin_frame(const void* graph);
  void end_frame(const void* graph);
  void begin_move();
  static std::uint64_t new_revision();

  /// Scene-space bounds of all instances; {0,0} if empty.
  [[nodiscard]] std::array<glm::dvec3, 2> bounds() const;
  /// The camera in use for a frame of this shape; without one: a view of the whole scene, slightly from above and the
  /// side, far enough to hold the bounding sphere of all that the animations in use do.
  [[nodiscard]] heddle_camera active_camera(std::uint32_t width, std::uint32_t height) const;
  /// Facts that techniques can ask for: "surfaces", "lights", "masked", "blended", "emissive", "double_sided",
  /// "textures", "environment", of which only what an instance shows counts, and the names of the components that it
  /// has.
  [[nodiscard]] std::vector<std::string> features() const;
  [[nodiscard]] std::string describe_json() const;

  /// Bounds of all instances over the animations in use: what follows from the scene's size does not depend on the
  /// time.
  [[nodiscard]] const std::array<glm::dvec3, 2>& reach() const { return extent().bounds; }
  /// The median diagonal of the instances' boxes, metres; 0 if empty.
  [[nodiscard]] double typical_size() const { return extent().typical_size; }

 private:
  void pose_rigs(double seconds);
  [[nodiscard]] std::array<glm::dvec3, 2> find_reach() const;
  struct Extent {
    std::uint64_t content_revision = 0, motion_revision = 0;  // the latter without animations
    std::size_t instances = 0;
    std::vector<std::uint32_t> animations;
    std::array<glm::dvec3, 2> bounds{};
    double typical_size = 0;
  };
  [[nodiscard]] const Extent& extent() const;
  mutable std::optional<Extent> extent_;
};

/// The same number: the same content and components.
inline std::uint64_t component_revision(const Scene& scene) {
  // Both only grow, and content revisions of two scenes are far apart: no two tables have the same number.
  return scene.content_revision + scene.components.revision();
}

/// Of cameras, lights, materials, instances, in their order.
template <typename Elements>
std::vector<std::string> names_of(const Elements& elements) {
  std::vector<std::string> names;
  for (const auto& element : elements) names.push_back(element.name);
  return names;
}

/// Direction and place of a light at a node; it shines along the node's -Z.
void place_light(Light& light, const glm::dmat4& scene_from_node);

/// Moves a scene behind another. Nothing here can fail but memory. A scene without cameras then uses the first that
/// comes.
void merge(Scene& scene, Scene loaded);

/// What a file may cost, and reach. Files come from strangers unless the caller says otherwise.
struct LoadLimits {
  std::uint64_t bytes = 4ULL << 30;                             // all that loading makes, added up; 2^64-1: no limit
  bool leaves_folder = false;                                   // may name files outside of its own folder
  std::function<void(std::string_view, double)> progress = {};  // how far it has come, 0 to 1; throws to end it
};

/// Adds a glTF 2.0 file to the scene, all or nothing. Throws Error with the file and what in it is wrong. A scene
/// without cameras then uses the file's first one. Its first animation is in use, and posed at the scene's time.
void load_gltf(Scene& scene, const std::filesystem::path& file, const LoadLimits& limits = {});

/// View record of a camera, unjittered, composed in float64. `origin`: the frame's origin. `previous`: last frame's
/// camera, with its own position.
HeddleView make_view(const heddle_camera& camera, std::uint32_t width, std::uint32_t height, const glm::dvec3& origin,
                     const heddle_camera* previous = nullptr);

}  // namespace heddle::scene
