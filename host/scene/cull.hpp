// SPDX-License-Identifier: Apache-2.0
// Boxes around instances and a view -> the draw commands of the instances that may be seen. What is left out can touch
// no pixel: boxes and planes allow for every rounding of the vertex shader.
#pragma once

#include "scene/scene.hpp"

#include <heddle/vulkan_table.h>

namespace heddle::scene {

/// Axis-aligned, in position_rel.
struct Box {
  glm::dvec3 centre{0.0}, half{0.0};
};

/// Holds every vertex within `bounds` (object space) as the shader places it in float32.
Box bounding_box(const std::array<glm::vec3, 2>& bounds, const HeddleInstance& instance);

/// The clip volume of a view: any projection, infinite far planes too.
class Frustum {
 public:
  /// `from`: where boxes are relative to, seen from where the view is relative to.
  explicit Frustum(const HeddleView& view, const glm::dvec3& from = glm::dvec3(0.0));
  /// No point of the box can be drawn. Never true of a box or view that holds a NaN.
  [[nodiscard]] bool excludes(const Box& box) const;
  /// Every point of the box is in view, up to rounding.
  [[nodiscard]] bool contains(const Box& box) const;

 private:
  struct Plane {
    glm::dvec3 normal{0.0};
    double offset = 0;
    glm::dvec3 slack{0.0};  // of rounding, for each metre from the origin
    double offset_slack = 0;
  };
  std::array<Plane, 6> planes_;
  Box shift_;  // what is added to boxes; its half is what vertices may be rounded by when they are placed once more
};

/// Boxes of instances in draw order, and of runs of them, which decide for many at once where neighbours in the order
/// are neighbours in space.
class InstanceBoxes {
 public:
  void assign(std::vector<Box> boxes);
  [[nodiscard]] std::size_t size() const { return boxes_.size(); }
  /// For instances first to first + count: 1 where one may be seen, else 0.
  void find_visible(const Frustum& frustum, std::size_t first, std::size_t count, std::uint8_t* out) const;

 private:
  static constexpr std::size_t kRun = 32;
  std::vector<Box> boxes_, runs_;
};

struct VisibleDraws {
  std::vector<VkDrawIndexedIndirectCommand> commands;  // of the given ones, what is left: the same instances, in order
  std::uint32_t drawn = 0, culled = 0;                 // instances
};
/// `commands` draw instances that follow each other: firstInstance counts in `boxes`. Instances keep their numbers, so
/// a command whose instances are seen in part becomes one for each stretch of them. Instances that `is_gone` says are
/// not there count as neither drawn nor culled; empty: all are there. Without a frustum all that are there are drawn.
VisibleDraws cull(std::span<const VkDrawIndexedIndirectCommand> commands, const InstanceBoxes& boxes,
                  const Frustum* frustum, std::span<const std::uint8_t> is_gone = {});

}  // namespace heddle::scene
