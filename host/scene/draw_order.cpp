// SPDX-License-Identifier: Apache-2.0
// Depths along the view's axis in float64 -> a stable order of instances and triangles.
#include "scene/draw_order.hpp"

#include <algorithm>

namespace heddle::scene {
namespace {

/// What is placed: one instance, where it is in the buffers, and how far away.
struct Placed {
  double depth = 0;
  std::uint32_t instance = 0;  // of the scene
  std::uint32_t slot = 0;      // of SceneBuffers::instances()
  const DrawGroup* group = nullptr;
};

/// Depth along the axis as a function of object space: dot(gradient, position) + offset.
struct DepthOf {
  glm::dvec3 gradient{0.0};
  double offset = 0;

  DepthOf(const HeddleView& view, const glm::dmat4& scene_from_object, const glm::dvec3& origin) {
    // The view looks along -Z: its third row, negated.
    const float* m = view.view_from_rel;
    const glm::dvec3 axis(-static_cast<double>(m[2]), -static_cast<double>(m[6]), -static_cast<double>(m[10]));
    gradient = glm::transpose(glm::dmat3(scene_from_object)) * axis;
    offset = glm::dot(axis, glm::dvec3(scene_from_object[3]) - origin) - static_cast<double>(m[14]);
  }
  [[nodiscard]] double operator()(const glm::dvec3& position) const { return glm::dot(gradient, position) + offset; }
};

glm::dvec3 position_of(const HeddleVertex& vertex) {
  return {vertex.position[0], vertex.position[1], vertex.position[2]};
}

/// Appends the mesh's triangles, farthest centroid first.
void append_triangles(const Mesh& mesh, const DepthOf& depth_of, std::vector<std::uint32_t>& indices) {
  std::vector<std::pair<double, std::uint32_t>> triangles;
  triangles.reserve(mesh.indices.size() / 3);
  for (std::uint32_t first = 0; first + 2 < mesh.indices.size(); first += 3) {
    glm::dvec3 sum(0.0);
    for (std::uint32_t k = 0; k < 3; ++k) sum += position_of(mesh.vertices[mesh.indices[first + k]]);
    triangles.emplace_back(depth_of(sum / 3.0), first);
  }
  std::stable_sort(triangles.begin(), triangles.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  for (const auto& [depth, first] : triangles)
    indices.insert(indices.end(), mesh.indices.begin() + first, mesh.indices.begin() + first + 3);
}

/// Where the group's instances lie that may be seen, and how many of them there are.
std::vector<std::uint32_t> seen_slots(const SceneBuffers& buffers, const DrawGroup& group, const Frustum* frustum,
                                      OrderedDraws& counted) {
  std::vector<std::uint32_t> slots;
  const auto add = [&](std::uint32_t first, std::uint32_t count) {
    for (std::uint32_t i = 0; i < count; ++i) slots.push_back(first + i);
  };
  if (frustum == nullptr) {
    add(group.first_instance, group.instance_count);
  } else {
    const VisibleDraws visible = buffers.visible(group, *frustum);
    for (const VkDrawIndexedIndirectCommand& command : visible.commands)
      add(command.firstInstance, command.instanceCount);
    counted.culled += visible.culled;
  }
  counted.drawn += static_cast<std::uint32_t>(slots.size());
  return slots;
}

}  // namespace

OrderedDraws order_back_to_front(const Scene& scene, const SceneBuffers& buffers,
                                 std::span<const DrawGroup* const> groups, const HeddleView& view,
                                 const glm::dvec3& origin, bool sorts_triangles, const Frustum* frustum) {
  OrderedDraws ordered;
  std::vector<Placed> placed;
  for (const DrawGroup* group : groups) {
    for (const std::uint32_t slot : seen_slots(buffers, *group, frustum, ordered)) {
      Placed one;
      one.slot = slot;
      one.instance = buffers.order()[one.slot];
      one.group = group;
      const Instance& instance = scene.instances[one.instance];
      const auto& bounds = scene.meshes[instance.mesh].bounds;
      const glm::dvec3 centre = 0.5 * (glm::dvec3(bounds[0]) + glm::dvec3(bounds[1]));
      one.depth = DepthOf(view, instance.scene_from_object, origin)(centre);
      placed.push_back(one);
    }
  }
  std::sort(placed.begin(), placed.end(), [](const Placed& a, const Placed& b) {
    return a.depth != b.depth ? a.depth > b.depth : a.instance < b.instance;
  });

  for (std::size_t i = 0; i < placed.size(); ++i) {
    const Placed& one = placed[i];
    const Instance& instance = scene.instances[one.instance];
    const MeshRange& range = buffers.mesh(instance.mesh);
    if (sorts_triangles) {
      const auto first = static_cast<std::uint32_t>(ordered.indices.size());
      append_triangles(scene.meshes[instance.mesh], DepthOf(view, instance.scene_from_object, origin), ordered.indices);
      ordered.draws.push_back({one.group, first, static_cast<std::uint32_t>(ordered.indices.size()) - first,
                               range.vertex_offset(), one.slot, 1});
      continue;
    }
    // Neighbours of one mesh that also lie side by side in the buffer are one draw.
    if (i > 0 && placed[i - 1].group == one.group && placed[i - 1].slot + 1 == one.slot &&
        scene.instances[placed[i - 1].instance].mesh == instance.mesh) {
      ++ordered.draws.back().instance_count;
      continue;
    }
    ordered.draws.push_back({one.group, range.first_index, range.index_count, range.vertex_offset(), one.slot, 1});
  }
  return ordered;
}

}  // namespace heddle::scene
