// SPDX-License-Identifier: Apache-2.0
#include "scene/made_surfaces.hpp"

#include <algorithm>
#include <cstring>

namespace heddle::scene {

bool MadeBatch::operator==(const MadeBatch& other) const {
  return std::memcmp(&record, &other.record, sizeof record) == 0 && placed == other.placed;
}

void MadeSurfaces::set(std::vector<MadeBatch> all, std::uint64_t technique_revision) {
  const bool is_same = technique_revision != 0 && technique_revision == given_revision && all == batches;
  batches = std::move(all);
  given_revision = technique_revision;
  if (!is_same) revision = Scene::new_revision();
}

bool MadeSurfaces::has_own_places() const {
  return std::any_of(batches.begin(), batches.end(), [](const MadeBatch& batch) {
    return !batch.is_placed_by_scene() && batch.record.command_count > 0;
  });
}

void PlacedBatches::update(const Scene& scene, const SceneBuffers& buffers, const MadeSurfaces& made,
                           const glm::dvec3& origin) {
  *this = {};
  std::vector<DrawKey> keys;
  for (std::uint32_t b = 0; b < made.batches.size(); ++b) {
    const MadeBatch& batch = made.batches[b];
    // Another scene than the one that the batches were made for: the technique is about to be told.
    if (batch.record.material >= scene.materials.size()) continue;
    const std::uint32_t flags = surface_flags(scene.materials[batch.record.material].record);
    const std::uint32_t texture_group = buffers.texture_group(batch.record.material);
    if (!batch.is_placed_by_scene()) {
      if (batch.record.command_count > 0) {
        own_groups_.push_back({flags, texture_group, batch.record.is_flipped != 0, batch.record.first_command,
                               batch.record.command_count, 0, 0});
      }
      continue;
    }
    if (batch.record.index_count == 0) continue;
    for (const std::uint32_t instance : batch.placed) {
      if (instance >= scene.instances.size()) continue;
      const bool flips = glm::determinant(glm::dmat3(scene.instances[instance].scene_from_object)) < 0;
      keys.push_back({flags, flips ? 1U : 0U, texture_group, b, instance});
    }
  }
  draws_ = group_draws(std::move(keys), [&](std::uint32_t b) {
    const heddle_batch& batch = made.batches[b].record;
    return VkDrawIndexedIndirectCommand{batch.index_count, 0, batch.first_index, batch.vertex_offset, 0};
  });
  std::vector<Box> boxes;
  for (std::size_t c = 0; c < draws_.commands.size(); ++c) {
    const heddle_batch& batch = made.batches[draws_.geometries[c]].record;
    const std::array<glm::vec3, 2> bounds{glm::vec3(batch.bounds[0], batch.bounds[1], batch.bounds[2]),
                                          glm::vec3(batch.bounds[3], batch.bounds[4], batch.bounds[5])};
    for (std::uint32_t i = 0; i < draws_.commands[c].instanceCount; ++i) {
      const std::uint32_t instance = draws_.order[draws_.commands[c].firstInstance + i];
      bounds_.push_back(bounds);
      instances_.push_back(place(scene, instance, origin, batch.material, batch.previous_vertex));
      boxes.push_back(bounding_box(bounds, instances_.back()));
    }
  }
  boxes_.assign(std::move(boxes));
}

void mark_placed(const MadeSurfaces& made, std::vector<std::uint8_t>& is_placed) {
  for (const MadeBatch& batch : made.batches)
    for (const std::uint32_t instance : batch.placed)
      if (instance < is_placed.size()) is_placed[instance] = 1;
}

std::vector<std::uint8_t> by_slot(std::span<const std::uint32_t> order, std::span<const std::uint8_t> by_instance) {
  std::vector<std::uint8_t> slots;
  if (std::none_of(by_instance.begin(), by_instance.end(), [](std::uint8_t marked) { return marked != 0; }))
    return slots;
  slots.reserve(order.size());
  for (const std::uint32_t instance : order) slots.push_back(by_instance[instance]);
  return slots;
}

}  // namespace heddle::scene
