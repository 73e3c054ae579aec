// SPDX-License-Identifier: Apache-2.0
// View-frustum culling of instances: Assarsson and Moller 2000, "Optimized View Frustum Culling Algorithms for Bounding
// Boxes", the test of a box against the planes of the clip volume (Gribb and Hartmann 2001, "Fast Extraction of Viewing
// Frustum Planes from the World-View-Projection Matrix").
#include "scene/cull.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace heddle::scene {
namespace {

// A dot product of four terms in float32 is wrong by at most 4 u times the sum of its terms' absolute values (Higham
// 2002, "Accuracy and Stability of Numerical Algorithms", 3.1: gamma_4). Doubled, to stand far from second-order terms.
constexpr double kUnitRoundoff = 0.5 * static_cast<double>(std::numeric_limits<float>::epsilon());
constexpr double kDotError = 8.0 * kUnitRoundoff;
// Vertex shaders may flush numbers below it to zero, in each of a few terms.
constexpr double kSmallestNormal = 16.0 * static_cast<double>(std::numeric_limits<float>::min());

Box hull(const Box& a, const Box& b) {
  const glm::dvec3 low = glm::min(a.centre - a.half, b.centre - b.half);
  const glm::dvec3 high = glm::max(a.centre + a.half, b.centre + b.half);
  return {0.5 * (low + high), 0.5 * (high - low)};
}

}  // namespace

Box bounding_box(const std::array<glm::vec3, 2>& bounds, const HeddleInstance& instance) {
  const glm::dvec3 low(bounds[0]), high(bounds[1]);
  const glm::dvec3 centre = 0.5 * (low + high), half = 0.5 * (high - low);
  const glm::dvec3 farthest = glm::max(glm::abs(low), glm::abs(high));
  Box box;
  for (int row = 0; row < 3; ++row) {
    double sum = static_cast<double>(instance.rel_from_object[12 + row]);
    double reach = 0, magnitude = std::abs(sum);
    for (int column = 0; column < 3; ++column) {
      const double element = static_cast<double>(instance.rel_from_object[4 * column + row]);
      sum += element * centre[column];
      reach += std::abs(element) * half[column];
      magnitude += std::abs(element) * farthest[column];
    }
    box.centre[row] = sum;
    box.half[row] = reach + kDotError * magnitude + kSmallestNormal;
  }
  return box;
}

Frustum::Frustum(const HeddleView& view, const glm::dvec3& from) : shift_{from, kDotError * glm::abs(from)} {
  // Inside: -w <= x <= w, -w <= y <= w, 0 <= z <= w. Each is a sum of two rows of the matrix that the shader multiplies
  // with; the plane z >= 0 of an infinite projection excludes nothing by itself.
  const auto element = [&](int row, int column) { return static_cast<double>(view.clip_from_rel[4 * column + row]); };
  constexpr int kW = 3;
  struct Sum {
    double w;
    int row;
    double factor;
  };
  constexpr std::array<Sum, 6> kSums{{{1, 0, 1}, {1, 0, -1}, {1, 1, 1}, {1, 1, -1}, {0, 2, 1}, {1, 2, -1}}};
  for (std::size_t i = 0; i < planes_.size(); ++i) {
    const Sum& sum = kSums[i];
    Plane& plane = planes_[i];
    for (int column = 0; column < 4; ++column) {
      const double a = sum.w * element(kW, column), b = sum.factor * element(sum.row, column);
      const double slack = kDotError * (std::abs(a) + std::abs(b));
      if (column < 3) {
        plane.normal[column] = a + b;
        plane.slack[column] = slack;
      } else {
        plane.offset = a + b;
        plane.offset_slack = slack + kSmallestNormal;
      }
    }
  }
}

bool Frustum::excludes(const Box& given) const {
  const Box box{given.centre + shift_.centre, given.half + shift_.half};
  const glm::dvec3 farthest = glm::abs(box.centre) + box.half;
  for (const Plane& plane : planes_) {
    const double greatest = glm::dot(plane.normal, box.centre) + plane.offset +
                            glm::dot(glm::abs(plane.normal), box.half) + glm::dot(plane.slack, farthest) +
                            plane.offset_slack;
    if (greatest < 0) return true;
  }
  return false;
}

bool Frustum::contains(const Box& given) const {
  const Box box{given.centre + shift_.centre, given.half + shift_.half};
  return std::all_of(planes_.begin(), planes_.end(), [&](const Plane& plane) {
    return glm::dot(plane.normal, box.centre) + plane.offset - glm::dot(glm::abs(plane.normal), box.half) >= 0;
  });
}

void InstanceBoxes::assign(std::vector<Box> boxes) {
  boxes_ = std::move(boxes);
  runs_.clear();
  for (std::size_t i = 0; i < boxes_.size(); ++i) {
    if (i % kRun == 0) {
      runs_.push_back(boxes_[i]);
    } else {
      runs_.back() = hull(runs_.back(), boxes_[i]);
    }
  }
  // Hulls are rounded in float64, far below what the boxes allow for; but a NaN must not hide behind its neighbours.
  for (std::size_t i = 0; i < boxes_.size(); ++i) {
    const glm::dvec3 sum = boxes_[i].centre + boxes_[i].half;
    if (std::isnan(sum.x + sum.y + sum.z)) runs_[i / kRun] = boxes_[i];
  }
}

void InstanceBoxes::find_visible(const Frustum& frustum, std::size_t first, std::size_t count,
                                 std::uint8_t* out) const {
  const std::size_t last = first + count;
  for (std::size_t i = first; i < last;) {
    const std::size_t end = std::min(last, (i / kRun + 1) * kRun);
    const Box& run = runs_[i / kRun];
    const bool is_outside = frustum.excludes(run);
    if (is_outside || frustum.contains(run)) {
      std::fill(out + (i - first), out + (end - first), static_cast<std::uint8_t>(is_outside ? 0 : 1));
      i = end;
      continue;
    }
    for (; i < end; ++i) out[i - first] = frustum.excludes(boxes_[i]) ? 0 : 1;
  }
}

namespace {
constexpr std::uint8_t kGone = 2;  // neither in view nor out of it
}  // namespace

VisibleDraws cull(std::span<const VkDrawIndexedIndirectCommand> commands, const InstanceBoxes& boxes,
                  const Frustum* frustum, std::span<const std::uint8_t> is_gone) {
  VisibleDraws left;
  if (commands.empty()) return left;
  const std::uint32_t first = commands.front().firstInstance;
  const std::uint32_t count = commands.back().firstInstance + commands.back().instanceCount - first;
  std::vector<std::uint8_t> visible(count, 1);
  if (frustum != nullptr) boxes.find_visible(*frustum, first, count, visible.data());
  for (std::uint32_t i = 0; i < count && !is_gone.empty(); ++i) {
    if (is_gone[first + i] != 0) visible[i] = kGone;
  }
  for (const VkDrawIndexedIndirectCommand& command : commands) {
    const std::uint32_t end = command.firstInstance + command.instanceCount;
    for (std::uint32_t i = command.firstInstance; i < end;) {
      if (visible[i - first] != 1) {
        if (visible[i - first] == 0) ++left.culled;
        ++i;
        continue;
      }
      VkDrawIndexedIndirectCommand stretch = command;
      stretch.firstInstance = i;
      while (i < end && visible[i - first] == 1) ++i;
      stretch.instanceCount = i - stretch.firstInstance;
      left.drawn += stretch.instanceCount;
      left.commands.push_back(stretch);
    }
  }
  return left;
}

}  // namespace heddle::scene
