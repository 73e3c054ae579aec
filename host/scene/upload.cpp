// SPDX-License-Identifier: Apache-2.0
// A scene -> buffers, texture arrays, descriptor sets and draw lists of one device.
#include "scene/upload.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <tuple>
#include <utility>

#include "scene/light_texture.hpp"
#include "scene/texture_groups.hpp"
#include "vulkan/pipeline_store.hpp"

namespace heddle::scene {
namespace {

// Buffers of empty scenes are bound too: none is smaller than a cache line.
constexpr std::size_t kMinimumBytes = 64;

constexpr VkBufferUsageFlags kCommandUsage = VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
constexpr VkBufferUsageFlags kTransfers = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;

void store(const glm::dmat4& matrix, const glm::dvec3& origin, float (&out)[16]) {
  for (int i = 0; i < 16; ++i) {
    const int column = i / 4, row = i % 4;
    // The only difference of large numbers, made in float64.
    const double value = column == 3 && row < 3 ? matrix[column][row] - origin[row] : matrix[column][row];
    out[i] = static_cast<float>(value) + 0.0F;
  }
}

bool is_mirrored(const Instance& instance) {
  return glm::determinant(glm::dmat3(instance.scene_from_object)) < 0;
}

/// Fills a buffer, made anew if it does not fit exactly: sizes change only with content and order.
template <typename Element>
void fill(vulkan::Device& device, const SceneBuffers::Upload& upload, vulkan::Buffer& buffer,
          const std::vector<Element>& elements, VkBufferUsageFlags usage) {
  const std::span<const std::byte> bytes = std::as_bytes(std::span(elements));
  const std::size_t size = std::max(bytes.size(), kMinimumBytes);
  if (!buffer || buffer.size() != size) {
    buffer = vulkan::Buffer();
    buffer = device.make_buffer(size, usage | kTransfers, false);
  }
  if (bytes.size() < kMinimumBytes) {
    std::array<std::byte, kMinimumBytes> padded{};
    std::copy(bytes.begin(), bytes.end(), padded.begin());
    upload(buffer, 0, padded);
  } else {
    upload(buffer, 0, bytes);
  }
}

}  // namespace

GroupedDraws group_draws(std::vector<DrawKey> keys,
                         const std::function<VkDrawIndexedIndirectCommand(std::uint32_t)>& geometry) {
  const auto state = [](const DrawKey& key) { return std::tie(key.flags, key.flip, key.texture_group); };
  // Opaque before masked before blended: depth is filled before anything is tested texel by texel.
  constexpr std::uint32_t kClasses = HEDDLE_SURFACE_OPAQUE | HEDDLE_SURFACE_MASKED | HEDDLE_SURFACE_BLENDED;
  std::sort(keys.begin(), keys.end(), [&](const DrawKey& a, const DrawKey& b) {
    return std::tuple(a.flags & kClasses, state(a), a.geometry, a.instance) <
           std::tuple(b.flags & kClasses, state(b), b.geometry, b.instance);
  });
  GroupedDraws draws;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const DrawKey& key = keys[i];
    const auto slot = static_cast<std::uint32_t>(i);
    const bool is_same_state = i > 0 && state(keys[i - 1]) == state(key);
    if (!is_same_state) {
      draws.groups.push_back(
          {key.flags, key.texture_group, key.flip != 0, static_cast<std::uint32_t>(draws.commands.size()), 0, slot, 0});
    }
    ++draws.groups.back().instance_count;
    if (is_same_state && keys[i - 1].geometry == key.geometry) {
      ++draws.commands.back().instanceCount;
    } else {
      draws.commands.push_back(geometry(key.geometry));
      draws.commands.back().instanceCount = 1;
      draws.commands.back().firstInstance = slot;
      draws.geometries.push_back(key.geometry);
      ++draws.groups.back().command_count;
    }
    draws.order.push_back(key.instance);
  }
  return draws;
}

HeddleInstance place(const Scene& scene, std::uint32_t instance, const glm::dvec3& origin, std::uint32_t material,
                     std::uint32_t previous_vertex) {
  const Instance& placed = scene.instances[instance];
  HeddleInstance record{};
  store(placed.scene_from_object, origin, record.rel_from_object);
  store(placed.previous_scene_from_object, origin, record.previous_rel_from_object);
  record.material = material;
  record.object = instance;
  record.flags = surface_flags(scene.materials.at(material).record);
  record.flip = is_mirrored(placed) ? 1 : 0;
  record.previous_vertex = previous_vertex;
  return record;
}

struct SceneBuffers::State {
  State(vulkan::Device& used, VkDescriptorSetLayout layout) : device(used), textures(used, layout) {}

  vulkan::Device& device;
  TextureGroups textures;
  vulkan::Buffer vertices, indices, instances, materials, commands;
  std::vector<MeshRange> meshes;
  std::vector<std::uint32_t> bending;   // meshes with two shapes
  GroupedDraws draws;                   // geometries: meshes
  InstanceBoxes boxes;                  // in draw order
  std::vector<std::uint8_t> flips;      // by scene's instance
  std::vector<Look> looks;              // by scene's instance
  std::vector<HeddleMaterial> records;  // as uploaded
  std::uint64_t content_revision = 0, motion_revision = 0;
  glm::dvec3 origin{0.0};
  Upload upload;  // of the update that runs

  [[nodiscard]] bool is_turned(const Scene& scene) const;
  void upload_meshes(const Scene& scene);
  void upload_shapes(const Scene& scene);
  void upload_materials(const Scene& scene);
  void sort_draws(const Scene& scene);
  void upload_instances(const Scene& scene);
  void find_looks(const Scene& scene);
};

void SceneBuffers::State::upload_meshes(const Scene& scene) {
  std::vector<HeddleVertex> all_vertices;
  std::vector<std::uint32_t> all_indices;
  meshes.clear();
  bending.clear();
  for (const Mesh& mesh : scene.meshes) {
    MeshRange range;
    range.first_index = static_cast<std::uint32_t>(all_indices.size());
    range.index_count = static_cast<std::uint32_t>(mesh.indices.size());
    const std::size_t copies = mesh.shape != 0 ? 2 : 1;
    for (std::size_t copy = 0; copy < copies; ++copy) {
      range.vertex_offsets[copy] = static_cast<std::int32_t>(all_vertices.size());
      range.vertex_offsets[1] = range.vertex_offsets[copy];
      range.shapes[copy] = mesh.shape;
      all_vertices.insert(all_vertices.end(), mesh.vertices.begin(), mesh.vertices.end());
    }
    if (copies == 2) {
      bending.push_back(static_cast<std::uint32_t>(meshes.size()));
    }
    meshes.push_back(range);
    all_indices.insert(all_indices.end(), mesh.indices.begin(), mesh.indices.end());
  }
  if (all_vertices.size() > 0x7fffffffU || all_indices.size() > 0xffffffffU) {
    throw Error(HEDDLE_UNSUPPORTED, fmt::format("the scene has {} vertices and {} indices, more than a draw can reach",
                                                all_vertices.size(), all_indices.size()));
  }
  fill(device, upload, vertices, all_vertices, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  fill(device, upload, indices, all_indices, VK_BUFFER_USAGE_INDEX_BUFFER_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
}

/// Brings this frame's and the last one's shapes of what bends to the device, each once, and lets the draws use them.
void SceneBuffers::State::upload_shapes(const Scene& scene) {
  bool is_switched = false;
  for (const std::uint32_t index : bending) {
    const Mesh& mesh = scene.meshes[index];
    MeshRange& range = meshes[index];
    const auto bring = [&](const std::vector<HeddleVertex>& shape_vertices, std::uint64_t shape, std::size_t kept) {
      for (std::size_t slot = 0; slot < 2; ++slot) {
        if (range.shapes[slot] == shape) {
          return slot;
        }
      }
      const std::size_t slot = 1 - kept;
      range.shapes[slot] = 0;  // of nothing, if the upload fails
      upload(vertices, static_cast<std::uint64_t>(range.vertex_offsets[slot]) * sizeof(HeddleVertex),
             std::as_bytes(std::span(shape_vertices)));
      range.shapes[slot] = shape;
      return slot;
    };
    const std::size_t was = range.now;
    if (mesh.shape == mesh.previous_shape) {
      range.now = range.before = bring(mesh.vertices, mesh.shape, range.now);
    } else {
      range.before = bring(mesh.previous_vertices, mesh.previous_shape, range.shapes[0] == mesh.shape ? 0 : 1);
      range.now = bring(mesh.vertices, mesh.shape, range.before);
    }
    is_switched |= range.now != was;
  }
  if (!is_switched) {
    return;
  }
  for (std::size_t i = 0; i < draws.commands.size(); ++i) {
    draws.commands[i].vertexOffset = meshes[draws.geometries[i]].vertex_offset();
  }
  fill(device, upload, commands, draws.commands, kCommandUsage);
}

void SceneBuffers::State::upload_materials(const Scene& scene) {
  textures.rebuild(scene);
  records.clear();
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    HeddleMaterial record = scene.materials[i].record;
    const TextureGroups::Place& place = textures.place(i);
    for (std::size_t k = 0; k < 4; ++k) {
      record.texture_layer[k] = place.layers[k];
    }
    record.texture_layer_4 = place.layers[4];
    for (std::uint32_t k = 1; k < HEDDLE_TEXTURE_COUNT; ++k) {
      set_texture_transform(record, k, texture_transform(record, k));
    }
    record.texture_group = place.group;
    record.id = static_cast<std::uint32_t>(i);
    records.push_back(record);
  }
  fill(device, upload, materials, records, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
}

void SceneBuffers::State::sort_draws(const Scene& scene) {
  flips.assign(scene.instances.size(), 0);
  std::vector<DrawKey> keys;
  for (std::uint32_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    flips[i] = is_mirrored(instance) ? 1 : 0;
    if (meshes.at(instance.mesh).index_count == 0) continue;
    const HeddleMaterial& material = records.at(scene.meshes[instance.mesh].material);
    keys.push_back({surface_flags(material), flips[i], material.texture_group, instance.mesh, i});
  }
  draws = group_draws(std::move(keys), [&](std::uint32_t mesh) {
    return VkDrawIndexedIndirectCommand{meshes[mesh].index_count, 0, meshes[mesh].first_index,
                                        meshes[mesh].vertex_offset(), 0};
  });
  fill(device, upload, commands, draws.commands, kCommandUsage);
}

void SceneBuffers::State::upload_instances(const Scene& scene) {
  std::vector<HeddleInstance> list;
  std::vector<Box> list_boxes;
  list.reserve(draws.order.size());
  list_boxes.reserve(draws.order.size());
  for (const std::uint32_t index : draws.order) {
    const std::uint32_t mesh = scene.instances[index].mesh;
    list.push_back(place(scene, index, origin, scene.meshes[mesh].material, meshes[mesh].steps_to_previous()));
    list_boxes.push_back(bounding_box(scene.meshes[mesh].bounds, list.back()));
  }
  boxes.assign(std::move(list_boxes));
  fill(device, upload, instances, list, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
}

void SceneBuffers::State::find_looks(const Scene& scene) {
  looks.clear();
  for (const Instance& instance : scene.instances) {
    Look look;
    look.add(instance.mesh);
    look.add(scene.meshes.at(instance.mesh).shape);
    for (int column = 0; column < 4; ++column)
      for (int row = 0; row < 4; ++row) look.add(std::bit_cast<std::uint64_t>(instance.scene_from_object[column][row]));
    looks.push_back(look);
  }
}

SceneBuffers::SceneBuffers(vulkan::Device& device, VkDescriptorSetLayout materials_layout)
    : state_(std::make_unique<State>(device, materials_layout)) {}

SceneBuffers::~SceneBuffers() = default;

/// An instance was mirrored, or is no longer: draws are sorted by it.
bool SceneBuffers::State::is_turned(const Scene& scene) const {
  for (std::size_t i = 0; i < scene.instances.size(); ++i)
    if (is_mirrored(scene.instances[i]) != (flips[i] != 0)) return true;
  return false;
}

bool SceneBuffers::update_remakes(const Scene& scene) const {
  if (state_->content_revision != scene.content_revision) return true;
  return state_->motion_revision != scene.motion_revision && state_->is_turned(scene);
}

void SceneBuffers::forget() {
  state_->content_revision = 0;
}

void SceneBuffers::update(const Scene& scene, const glm::dvec3& origin, const Upload& upload) {
  State& state = *state_;
  const bool is_new = state.content_revision != scene.content_revision;
  const bool has_moved = is_new || state.motion_revision != scene.motion_revision;
  if (!has_moved && state.origin == origin) {
    return;
  }
  const bool is_remade = update_remakes(scene);
  if (is_remade || !upload) {
    state.upload = [&device = state.device](const vulkan::Buffer& target, std::uint64_t offset,
                                            std::span<const std::byte> bytes) { device.upload(target, offset, bytes); };
  } else {
    state.upload = upload;
  }
  // Until all is done the buffers belong to no revision: after an error half way, the next call starts over.
  state.content_revision = 0;
  state.origin = origin;
  if (is_new) {
    state.upload_meshes(scene);
    state.upload_materials(scene);
  }
  if (has_moved) {
    state.upload_shapes(scene);
  }
  if (is_remade) {
    state.sort_draws(scene);
  }
  state.upload_instances(scene);
  if (has_moved) {
    state.find_looks(scene);
  }
  state.content_revision = scene.content_revision;
  state.motion_revision = scene.motion_revision;
}

const vulkan::Buffer& SceneBuffers::vertices() const {
  return state_->vertices;
}
const vulkan::Buffer& SceneBuffers::indices() const {
  return state_->indices;
}
const vulkan::Buffer& SceneBuffers::instances() const {
  return state_->instances;
}
const vulkan::Buffer& SceneBuffers::materials() const {
  return state_->materials;
}
const vulkan::Buffer& SceneBuffers::commands() const {
  return state_->commands;
}
std::span<const DrawGroup> SceneBuffers::groups() const {
  return state_->draws.groups;
}
std::span<const Look> SceneBuffers::looks() const {
  return state_->looks;
}
std::span<const std::uint32_t> SceneBuffers::order() const {
  return state_->draws.order;
}
const MeshRange& SceneBuffers::mesh(std::uint32_t index) const {
  return state_->meshes.at(index);
}
DrawList SceneBuffers::draws() const {
  return {state_->draws.groups, state_->draws.commands, state_->draws.order, &state_->boxes};
}
std::uint32_t SceneBuffers::texture_group(std::uint32_t material) const {
  return state_->records.at(material).texture_group;
}
VkDescriptorSet SceneBuffers::material_set(std::uint32_t texture_group) const {
  return state_->textures.set(texture_group);
}

std::vector<HeddleLight> SceneBuffers::lights(const Scene& scene, const glm::dvec3& origin) {
  std::vector<HeddleLight> lights;
  lights.reserve(scene.lights.size());
  const std::vector<const LightTexture*> textures = light_textures(scene);
  for (const Light& light : scene.lights) {
    HeddleLight record = light.record;
    record.texture = light_texture_number(light, textures);
    const glm::dvec3 position_rel = light.position - origin;
    for (int i = 0; i < 3; ++i) {
      record.position_rel[i] = static_cast<float>(position_rel[i]);
    }
    record.id = static_cast<std::uint32_t>(lights.size());
    lights.push_back(record);
  }
  return lights;
}

VkDescriptorSetLayout make_materials_layout(vulkan::Device& device) {
  std::array<VkDescriptorSetLayoutBinding, HEDDLE_TEXTURE_COUNT> bindings{};
  for (std::uint32_t i = 0; i < bindings.size(); ++i) {
    bindings[i].binding = i;
    bindings[i].descriptorType = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
    bindings[i].descriptorCount = 1;
    bindings[i].stageFlags = VK_SHADER_STAGE_FRAGMENT_BIT;
  }
  return device.pipelines().set_layout(bindings);
}

}  // namespace heddle::scene
