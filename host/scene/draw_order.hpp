// SPDX-License-Identifier: Apache-2.0
// Surfaces and a view -> draws from the farthest instance to the nearest, for blending.
#pragma once

#include "scene/made_surfaces.hpp"

namespace heddle::scene {

/// What is sorted: the scene's own instances, or those of made batches.
struct DrawSource {
  DrawList list;
  const PlacedBatches* made = nullptr;   // null: the scene's meshes
  std::vector<const DrawGroup*> groups;  // of the list, that are drawn
  std::vector<std::uint8_t> is_gone;     // by slot; empty: none is
};

/// One vkCmdDrawIndexed.
struct OrderedDraw {
  std::size_t source = 0;
  const DrawGroup* group = nullptr;
  std::uint32_t first_index = 0, index_count = 0;
  std::int32_t vertex_offset = 0;
  std::uint32_t first_instance = 0, instance_count = 0;  // slots of the source
};

struct OrderedDraws {
  std::vector<OrderedDraw> draws;
  std::vector<std::uint32_t>
      indices;  // what first_index of the scene's meshes counts in; empty: SceneBuffers::indices()
  std::uint32_t drawn = 0, culled = 0;  // instances
};

/// The instances of all sources by the depth of their bounds' centre along the view's axis, in float64, farthest first;
/// of equal ones the scene's first one first. With `sorts_triangles` the triangles of each instance of the scene's
/// meshes as well, by the depth of their centroids. `origin` is the frame's. Instances that `frustum` excludes are left
/// out before anything is sorted; null: none is.
OrderedDraws order_back_to_front(const Scene& scene, std::span<const DrawSource> sources, const HeddleView& view,
                                 const glm::dvec3& origin, bool sorts_triangles, const Frustum* frustum = nullptr);

}  // namespace heddle::scene
