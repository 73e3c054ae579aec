// SPDX-License-Identifier: Apache-2.0
// Many emitters -> one of them, drawn by how much it may send to a point. README (5).
#pragma once

#include <glm/glm.hpp>

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

namespace heddle::path_tracer {

/// Where emitters are, which way they shine, and how strongly: intensity in candela of the strongest direction.
struct LightBounds {
  glm::dvec3 low{0.0}, high{0.0};
  glm::dvec3 axis{0.0, 1.0, 0.0};
  double cos_spread = -1.0;  // every emitter's own axis lies in a cone of this cosine around `axis`
  double cos_reach = 0.0;    // beyond an axis, light leaves within this angle, falling off with its cosine
  double intensity = 0.0;
  double range = 0.0;  // of the farthest reaching one; infinity: unlimited
  bool is_two_sided = false;
  bool has_shape = false;  // rays can meet it
};

/// The same, as it is asked for.
class LightReach {
 public:
  LightReach() = default;
  explicit LightReach(const LightBounds& bounds);
  /// An estimate of the light that arrives at a point with this normal; 0 only where none does.
  [[nodiscard]] double importance(const glm::dvec3& point, const glm::dvec3& normal) const;

 private:
  glm::dvec3 center_{0.0}, half_{0.0}, axis_{0.0, 1.0, 0.0};
  double radius_squared_ = 0.0, least_squared_ = 0.0, range_squared_ = 0.0;
  double cos_spread_ = -1.0, sin_spread_ = 0.0, cos_reach_ = 0.0, intensity_ = 0.0;
  bool is_two_sided_ = false, is_limited_ = false;
};

/// A binary tree over emitters. Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree
/// Splitting", without splitting; costs and bounds after Pharr, Jakob and Humphreys 2023, "Physically Based Rendering",
/// section 12.6.3.
class LightTree {
 public:
  void build(std::span<const LightBounds> bounds);
  [[nodiscard]] bool is_empty() const { return nodes_.empty(); }

  /// About the light of all of them at a point; 0 only where there is none.
  [[nodiscard]] double importance(const glm::dvec3& point, const glm::dvec3& normal) const {
    return nodes_.empty() ? 0.0 : nodes_.front().reach.importance(point, normal);
  }
  struct Choice {
    std::uint32_t emitter = 0;
    double probability = 0.0;  // 0: nothing arrives at this point
    double rest = 0.0;         // of u, as even as u was
  };
  [[nodiscard]] Choice choose(const glm::dvec3& point, const glm::dvec3& normal, double u) const;
  /// With which choose() answers this emitter.
  [[nodiscard]] double probability(const glm::dvec3& point, const glm::dvec3& normal, std::uint32_t emitter) const;

  /// visit(emitter) for all with a shape whose bounds the ray meets before `length`.
  template <typename Visit>
  void meet(const glm::dvec3& origin, const glm::dvec3& direction, double length, const Visit& visit) const;

 private:
  struct Node {
    LightReach reach;
    LightBounds bounds;
    std::uint32_t child = 0;  // of two: this node's number + 1, and this
    std::uint32_t emitter = 0;
    bool is_leaf = false;
  };
  std::uint32_t build(std::span<const LightBounds> bounds, std::span<std::uint32_t> emitters, std::uint64_t trail,
                      std::uint32_t depth);

  std::vector<Node> nodes_;
  std::vector<std::uint64_t> trails_;  // by emitter: which child at each level, the lowest bit first
  std::vector<std::uint32_t> leaves_;  // by emitter
};

template <typename Visit>
void LightTree::meet(const glm::dvec3& origin, const glm::dvec3& direction, double length, const Visit& visit) const {
  if (nodes_.empty() || !nodes_.front().bounds.has_shape) return;
  const glm::dvec3 inverse = 1.0 / direction;
  std::uint32_t stack[64];
  std::uint32_t count = 0;
  stack[count++] = 0;
  while (count > 0) {
    const Node& node = nodes_[stack[--count]];
    if (!node.bounds.has_shape) continue;
    double near = 0.0, far = length;
    for (glm::length_t i = 0; i < 3; ++i) {
      const double a = (node.bounds.low[i] - origin[i]) * inverse[i],
                   b = (node.bounds.high[i] - origin[i]) * inverse[i];
      // A ray within a face's plane makes 0 * infinity, which bounds nothing.
      if (a < b || b <= a) {
        near = std::max(near, std::min(a, b));
        far = std::min(far, std::max(a, b));
      }
    }
    if (near > far * (1.0 + 1e-9)) continue;
    if (node.is_leaf) {
      visit(node.emitter);
    } else {
      const auto self = static_cast<std::uint32_t>(&node - nodes_.data());
      stack[count++] = node.child;
      stack[count++] = self + 1;
    }
  }
}

}  // namespace heddle::path_tracer
