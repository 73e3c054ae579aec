// SPDX-License-Identifier: Apache-2.0
// Depths along the view's axis in float64 -> a stable order of instances and triangles.
#include "scene/draw_order.hpp"

#include <algorithm>
#include <tuple>

namespace heddle::scene {
namespace {

/// What is placed: one instance, where it is in the buffers, and how far away.
struct Placed {
  double depth = 0;
  std::uint32_t instance = 0;  // of the scene
  std::uint32_t slot = 0;      // of the source
  std::size_t source = 0;
  const DrawGroup* group = nullptr;
  const VkDrawIndexedIndirectCommand* command = nullptr;  // that draws it
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

}  // namespace

OrderedDraws order_back_to_front(const Scene& scene, std::span<const DrawSource> sources, const HeddleView& view,
                                 const glm::dvec3& origin, bool sorts_triangles, const Frustum* frustum) {
  OrderedDraws ordered;
  std::vector<Placed> placed;
  for (std::size_t s = 0; s < sources.size(); ++s) {
    const DrawSource& source = sources[s];
    for (const DrawGroup* group : source.groups) {
      const VisibleDraws visible = source.list.visible(*group, frustum, source.is_gone);
      ordered.drawn += visible.drawn;
      ordered.culled += visible.culled;
      const VkDrawIndexedIndirectCommand* command = &source.list.commands[group->first_command];
      for (const VkDrawIndexedIndirectCommand& part : visible.commands) {
        // What is visible are parts of the group's commands, in their order.
        while (part.firstInstance >= command->firstInstance + command->instanceCount) ++command;
        for (std::uint32_t slot = part.firstInstance; slot < part.firstInstance + part.instanceCount; ++slot) {
          Placed one;
          one.slot = slot;
          one.instance = source.list.order[slot];
          one.source = s;
          one.group = group;
          one.command = command;
          const Instance& instance = scene.instances[one.instance];
          const auto& bounds = source.made != nullptr ? source.made->bounds(slot) : scene.meshes[instance.mesh].bounds;
          const glm::dvec3 centre = 0.5 * (glm::dvec3(bounds[0]) + glm::dvec3(bounds[1]));
          one.depth = DepthOf(view, instance.scene_from_object, origin)(centre);
          placed.push_back(one);
        }
      }
    }
  }
  std::sort(placed.begin(), placed.end(), [](const Placed& a, const Placed& b) {
    if (a.depth != b.depth) return a.depth > b.depth;
    return std::tie(a.instance, a.source, a.slot) < std::tie(b.instance, b.source, b.slot);
  });

  for (std::size_t i = 0; i < placed.size(); ++i) {
    const Placed& one = placed[i];
    const Instance& instance = scene.instances[one.instance];
    if (sorts_triangles && sources[one.source].made == nullptr) {
      const auto first = static_cast<std::uint32_t>(ordered.indices.size());
      append_triangles(scene.meshes[instance.mesh], DepthOf(view, instance.scene_from_object, origin), ordered.indices);
      ordered.draws.push_back({one.source, one.group, first, static_cast<std::uint32_t>(ordered.indices.size()) - first,
                               one.command->vertexOffset, one.slot, 1});
      continue;
    }
    // Neighbours of one mesh that also lie side by side in the buffer are one draw.
    if (i > 0 && placed[i - 1].command == one.command && placed[i - 1].slot + 1 == one.slot) {
      ++ordered.draws.back().instance_count;
      continue;
    }
    ordered.draws.push_back({one.source, one.group, one.command->firstIndex, one.command->indexCount,
                             one.command->vertexOffset, one.slot, 1});
  }
  return ordered;
}

}  // namespace heddle::scene
