// SPDX-License-Identifier: Apache-2.0
// The scene on the device: vertices, indices, instances, materials, textures grouped into 2D arrays by (format, size,
// mips), and the surfaces' draw lists merged by texture group and by what pipelines must differ in.
#pragma once

#include "scene/cull.hpp"
#include "scene/look.hpp"
#include "scene/scene.hpp"
#include "vulkan/device.hpp"

#include <heddle/materials.h>
#include <heddle/plugin.h>

#include <functional>

namespace heddle::scene {

/// Draws that share pipeline state and textures: one vkCmdDrawIndexedIndirect.
struct DrawGroup {
  std::uint32_t flags = 0;                               // HEDDLE_SURFACE_* of all its batches
  std::uint32_t texture_group = 0;                       // set 2
  bool is_flipped = false;                               // front faces are clockwise
  std::uint32_t first_command = 0, command_count = 0;    // in the indirect buffer (VkDrawIndexedIndirectCommand)
  std::uint32_t first_instance = 0, instance_count = 0;  // in instances()
};

/// Instances of the scene in the order of their draws, whoever made what is drawn there. Borrowed from its owner until
/// that changes.
struct DrawList {
  std::span<const DrawGroup> groups;
  std::span<const VkDrawIndexedIndirectCommand> commands;  // firstInstance counts in `order`
  std::span<const std::uint32_t> order;                    // the scene's instance of each slot
  const InstanceBoxes* boxes = nullptr;                    // parallel to order
  /// The group's commands without the instances that cannot be seen (none is left out without a frustum), or that are
  /// gone, by slot.
  [[nodiscard]] VisibleDraws visible(const DrawGroup& group, const Frustum* frustum,
                                     std::span<const std::uint8_t> is_gone = {}) const {
    return cull(commands.subspan(group.first_command, group.command_count), *boxes, frustum, is_gone);
  }
};

/// What an instance's draw depends on.
struct DrawKey {
  std::uint32_t flags = 0, flip = 0, texture_group = 0;
  std::uint32_t geometry = 0;  // a mesh, or whatever else is drawn there
  std::uint32_t instance = 0;  // of the scene
};
struct GroupedDraws {
  std::vector<DrawGroup> groups;
  std::vector<VkDrawIndexedIndirectCommand> commands;
  std::vector<std::uint32_t> geometries;  // of each command
  std::vector<std::uint32_t> order;       // the scene's instance of each slot
};
/// Sorted by what draws must differ in: equal geometries side by side become one command, equal state one group.
/// `geometry` gives the indices of one.
GroupedDraws group_draws(std::vector<DrawKey> keys,
                         const std::function<VkDrawIndexedIndirectCommand(std::uint32_t)>& geometry);

/// The record of an instance, of a mesh of `material`, relative to `origin`; previous_vertex as in HeddleInstance.
HeddleInstance place(const Scene& scene, std::uint32_t instance, const glm::dvec3& origin, std::uint32_t material,
                     std::uint32_t previous_vertex);

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

  /// Brings bytes into a buffer of the device.
  using Upload = std::function<void(const vulkan::Buffer&, std::uint64_t offset, std::span<const std::byte>)>;
  /// Uploads what changed since the last call; instances relative to `origin`, previous places too. A mesh that bends
  /// has room for two shapes, which take turns. Unless update_remakes, all of it is brought by `upload` (none: at once)
  /// into buffers that stay.
  void update(const Scene& scene, const glm::dvec3& origin, const Upload& upload = {});
  /// The next update makes buffers, textures or draws anew: nothing that was submitted may still use them.
  [[nodiscard]] bool update_remakes(const Scene& scene) const;
  /// The next update starts over: what the last one handed to `upload` did not reach the device.
  void forget();

  [[nodiscard]] const vulkan::Buffer& vertices() const;   // HeddleVertex
  [[nodiscard]] const vulkan::Buffer& indices() const;    // uint32
  [[nodiscard]] const vulkan::Buffer& instances() const;  // HeddleInstance, in draw order
  [[nodiscard]] const vulkan::Buffer& materials() const;  // HeddleMaterial
  [[nodiscard]] const vulkan::Buffer& commands()
      const;  // VkDrawIndexedIndirectCommand; firstInstance = first in instances()
  [[nodiscard]] std::span<const DrawGroup> groups() const;
  /// The scene's instances in draw order: which one each of instances() is.
  [[nodiscard]] std::span<const std::uint32_t> order() const;
  /// Of each of the scene's instances: differs where its place or its mesh's shape does. What meshes and materials are
  /// made of is the content revision's.
  [[nodiscard]] std::span<const Look> looks() const;
  /// Of the scene's mesh of that number.
  [[nodiscard]] const MeshRange& mesh(std::uint32_t index) const;
  /// What bends is judged by its shape of now.
  [[nodiscard]] DrawList draws() const;
  /// Where a material's textures are bound, HeddleMaterial::texture_group.
  [[nodiscard]] std::uint32_t texture_group(std::uint32_t material) const;
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
/// The device's: nobody destroys it.
VkDescriptorSetLayout make_materials_layout(vulkan::Device& device);

struct MadeSurfaces;
/// What techniques made, in host memory: for each, the newest first, its batches and what lies in their buffers.
struct MadeContents {
  const MadeSurfaces* surfaces = nullptr;
  std::span<const HeddleVertex> vertices;
  std::span<const std::uint32_t> indices;
  std::span<const HeddleInstance> instances;
  std::span<const VkDrawIndexedIndirectCommand> commands;
};

/// All triangles in host memory, for CPU stages. Rebuilt when a revision of the scene, or of what was made, changes.
class Snapshot {
 public:
  const heddle_snapshot& update(const Scene& scene);
  /// Of made surfaces; `holds_scene`: beneath them are the scene's own. `origin`: the frame's.
  const heddle_snapshot& update(const Scene& scene, bool holds_scene, std::span<const MadeContents> made,
                                const glm::dvec3& origin);
  /// As the last update left it.
  [[nodiscard]] const heddle_snapshot& record() const;
  /// False if update has to see their contents.
  [[nodiscard]] bool is_of(const Scene& scene, bool holds_scene, std::span<const MadeSurfaces* const> made,
                           const glm::dvec3& origin) const;
  /// For snapshots of this class alone, by the pointer that update() gave. Barycentric (u, v) weigh the second and
  /// third corner; textures are filtered bilinearly at their finest level.
  [[nodiscard]] heddle_alpha_test alpha_test() const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

/// Of a snapshot that class Snapshot made, by the reference that update() gave; valid as long as that is.
heddle_snapshot_attributes snapshot_attributes(const heddle_snapshot& snapshot);

}  // namespace heddle::scene
