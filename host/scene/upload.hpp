// SPDX-License-Identifier: Apache-2.0
// The scene on the device: vertices, indices, instances, materials, textures grouped into 2D arrays by (format, size,
// mips), and the surfaces' draw lists merged by texture group and by what pipelines must differ in.
#pragma once

#include "scene/cull.hpp"
#include "scene/look.hpp"
#include "scene/scene.hpp"
#include "vulkan/device.hpp"

#include <heddle/plugin.h>

namespace heddle::scene {

/// Draws that share pipeline state and textures: one vkCmdDrawIndexedIndirect.
struct DrawGroup {
  std::uint32_t flags = 0;                               // HEDDLE_SURFACE_* of all its batches
  std::uint32_t texture_group = 0;                       // set 2
  bool is_flipped = false;                               // front faces are clockwise
  std::uint32_t first_command = 0, command_count = 0;    // in the indirect buffer (VkDrawIndexedIndirectCommand)
  std::uint32_t first_instance = 0, instance_count = 0;  // in instances()
};

/// Places of one mesh in the vertex and index buffers. What bends is there twice: now, and in the last frame.
struct MeshRange {
  std::uint32_t first_index = 0, index_count = 0;
  std::array<std::int32_t, 2> vertex_offsets{};  // equal for what never bends
  std::array<std::uint64_t, 2> shapes{};         // that lie there
  std::size_t now = 0, before = 0;               // which of the two

  [[nodiscard]] std::int32_t vertex_offset() const { return vertex_offsets[now]; }
  /// What a shader adds to a vertex's index to find the same vertex in the last frame.
  [[nodiscard]] std::uint32_t steps_to_previous() const {
    return static_cast<std::uint32_t>(vertex_offsets[before]) - static_cast<std::uint32_t>(vertex_offsets[now]);
  }
};

/// Buffers and textures of one scene on one device. update() before each frame.
class SceneBuffers {
 public:
  SceneBuffers(vulkan::Device& device, VkDescriptorSetLayout materials_layout);
  ~SceneBuffers();
  SceneBuffers(const SceneBuffers&) = delete;
  SceneBuffers& operator=(const SceneBuffers&) = delete;

  /// Uploads what changed since the last call; instances relative to `origin`, previous places too. A mesh that bends
  /// has room for two shapes, which take turns.
  void update(const Scene& scene, const glm::dvec3& origin);

  [[nodiscard]] const vulkan::Buffer& vertices() const;   // HeddleVertex
  [[nodiscard]] const vulkan::Buffer& indices() const;    // uint32
  [[nodiscard]] const vulkan::Buffer& instances() const;  // HeddleInstance, in draw order
  [[nodiscard]] const vulkan::Buffer& materials() const;  // HeddleMaterial
  [[nodiscard]] const vulkan::Buffer& commands()
      const;  // VkDrawIndexedIndirectCommand; firstInstance = first in instances()
  [[nodiscard]] std::span<const DrawGroup> groups() const;
  /// What instances()[place] would be, relative to another point of the scene. Former places are relative to it as
  /// well.
  [[nodiscard]] HeddleInstance placed(const Scene& scene, std::uint32_t place, const glm::dvec3& origin) const;
  /// Of each of instances(): differs where its place or shape does. Meshes and materials are the content revision's.
  [[nodiscard]] std::span<const Look> looks() const;
  /// The commands of a group, of all its instances.
  [[nodiscard]] std::span<const VkDrawIndexedIndirectCommand> commands_of(const DrawGroup& group) const;
  /// The scene's instances in draw order: which one each of instances() is.
  [[nodiscard]] std::span<const std::uint32_t> order() const;
  /// Of the scene's mesh of that number.
  [[nodiscard]] const MeshRange& mesh(std::uint32_t index) const;
  /// The group's commands without the instances that cannot be seen. What bends is judged by its shape of now.
  [[nodiscard]] VisibleDraws visible(const DrawGroup& group, const Frustum& frustum) const;
  /// Descriptor set 2 of a texture group: bindings 0..4 = sampler2DArray of base colour, metallic-roughness, normal,
  /// occlusion, emissive.
  [[nodiscard]] VkDescriptorSet material_set(std::uint32_t texture_group) const;
  /// Lights relative to `origin`, in the scene's order.
  static std::vector<HeddleLight> lights(const Scene& scene, const glm::dvec3& origin);

 private:
  struct State;
  std::unique_ptr<State> state_;
};
/// Layout of set 2, fragment stage.
VkDescriptorSetLayout make_materials_layout(vulkan::Device& device);

/// All triangles in host memory, for CPU stages. Rebuilt when a revision of the scene changes.
class Snapshot {
 public:
  const heddle_snapshot& update(const Scene& scene);
  /// For snapshots of this class alone, by the pointer that update() gave. Barycentric (u, v) weigh the second and
  /// third corner; textures are filtered bilinearly at their finest level.
  [[nodiscard]] heddle_alpha_test alpha_test() const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace heddle::scene
