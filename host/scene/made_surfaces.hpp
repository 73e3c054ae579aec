// SPDX-License-Identifier: Apache-2.0
// Batches of a technique -> instances, commands and groups as the scene's own triangles have them.
#pragma once

#include "scene/upload.hpp"

namespace heddle::scene {

struct MadeBatch {
  heddle_batch record{};              // without `instances`
  std::vector<std::uint32_t> placed;  // the scene's instances, ascending
  [[nodiscard]] bool is_placed_by_scene() const { return !placed.empty(); }
  [[nodiscard]] bool operator==(const MadeBatch& other) const;
};

/// What a technique's surfaces port holds.
struct MadeSurfaces {
  std::vector<MadeBatch> batches;
  std::uint64_t given_revision = 0;  // by the technique; 0: nothing is known to last
  std::uint64_t revision = 0;        // the same number: the same batches of the same contents

  void set(std::vector<MadeBatch> all, std::uint64_t technique_revision);
  [[nodiscard]] bool has_own_places() const;  // of batches that the technique places
};

/// The part of made surfaces that the scene places, in one frame.
class PlacedBatches {
 public:
  void update(const Scene& scene, const SceneBuffers& buffers, const MadeSurfaces& made, const glm::dvec3& origin);
  [[nodiscard]] DrawList draws() const { return {draws_.groups, draws_.commands, draws_.order, &boxes_}; }
  [[nodiscard]] std::span<const HeddleInstance> instances() const { return instances_; }
  /// Object space, of a slot's batch.
  [[nodiscard]] const std::array<glm::vec3, 2>& bounds(std::uint32_t slot) const { return bounds_.at(slot); }
  /// Batches that the technique places: commands count in its own buffer.
  [[nodiscard]] std::span<const DrawGroup> own_groups() const { return own_groups_; }

 private:
  GroupedDraws draws_;  // geometries: batches
  std::vector<DrawGroup> own_groups_;
  std::vector<HeddleInstance> instances_;
  std::vector<std::array<glm::vec3, 2>> bounds_;
  InstanceBoxes boxes_;
};

/// Marks the scene's instances that these batches place.
void mark_placed(const MadeSurfaces& made, std::vector<std::uint8_t>& is_placed);
/// The same by the slots of a draw order.
std::vector<std::uint8_t> by_slot(std::span<const std::uint32_t> order, std::span<const std::uint8_t> by_instance);

}  // namespace heddle::scene
