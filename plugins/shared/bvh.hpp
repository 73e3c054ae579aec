// SPDX-License-Identifier: Apache-2.0
// Boxes of triangles -> a tree without pointers or stack: nodes depth first, each with the number of the one that comes
// next for a ray that misses it. Shaders walk it with bvh.glsl. Built by Embree (link embree3).
#pragma once

#include <embree3/rtcore.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <span>
#include <utility>
#include <vector>

namespace bvh {

/// Two uvec4. Leaves: first triangle times 8 plus how many, 1 to 7; other nodes: 0.
struct Node {
  std::array<float, 3> low;
  std::uint32_t escape;
  std::array<float, 3> high;
  std::uint32_t leaf;
};
static_assert(sizeof(Node) == 32, "two uvec4, as shaders read them");

inline constexpr std::uint32_t kMostInLeaf = 4;
/// So that 8 times a triangle's number fits.
inline constexpr std::size_t kMostTriangles = std::size_t{1} << 28U;

struct Box {
  std::array<float, 3> low, high;
};

/// `order`: which box each place of the leaves holds.
struct Tree {
  std::vector<Node> nodes;
  std::vector<std::uint32_t> order;
};

namespace detail {

struct Branch;
/// What a branch holds: another one, or a stretch of `Leaves`.
struct Child {
  const Branch* branch;  // NULL: a leaf
  std::uint32_t count;
  std::array<std::uint32_t, kMostInLeaf> triangles;
};
struct Branch {
  std::array<const Child*, 2> children;
  std::array<Box, 2> boxes;
};

inline Box box_of(const RTCBounds& bounds) {
  return {{bounds.lower_x, bounds.lower_y, bounds.lower_z}, {bounds.upper_x, bounds.upper_y, bounds.upper_z}};
}

/// Half the surface.
inline float area_of(const Box& box) {
  const float x = box.high[0] - box.low[0], y = box.high[1] - box.low[1], z = box.high[2] - box.low[2];
  return x * y + y * z + z * x;
}

/// Larger children first: of a ray that ends at the first thing it meets, most meet that there.
inline void flatten(const Child& child, const Box& box, Tree& tree) {
  const std::size_t place = tree.nodes.size();
  tree.nodes.push_back({box.low, 0, box.high, 0});
  if (child.branch == nullptr) {
    tree.nodes[place].leaf = static_cast<std::uint32_t>(tree.order.size()) * 8U + child.count;
    tree.order.insert(tree.order.end(), child.triangles.begin(), child.triangles.begin() + child.count);
  } else {
    const Branch& branch = *child.branch;
    const std::size_t first = area_of(branch.boxes[1]) > area_of(branch.boxes[0]) ? 1 : 0;
    flatten(*branch.children[first], branch.boxes[first], tree);
    flatten(*branch.children[1 - first], branch.boxes[1 - first], tree);
  }
  tree.nodes[place].escape = static_cast<std::uint32_t>(tree.nodes.size());
}

}  // namespace detail

/// One Embree device. Not for two threads at once.
class Builder {
 public:
  Builder() : device_(rtcNewDevice(nullptr)) {
    if (device_ != nullptr) rtcSetDeviceErrorFunction(device_, &Builder::on_error, this);
  }
  ~Builder() {
    if (device_ != nullptr) rtcReleaseDevice(device_);
  }
  Builder(const Builder&) = delete;
  Builder& operator=(const Builder&) = delete;

  /// At most kMostTriangles boxes, all finite. False: error() says why, and the tree is empty. Which tree it is may
  /// depend on the machine; what a ray meets does not, because boxes only spare it tests.
  [[nodiscard]] bool build(std::span<const Box> boxes, Tree& tree) {
    tree = {};
    error_[0] = '\0';
    if (device_ == nullptr) on_error(this, rtcGetDeviceError(nullptr), "no device");
    if (device_ == nullptr || boxes.empty()) return device_ != nullptr;
    std::vector<RTCBuildPrimitive> primitives(boxes.size());
    Box whole = boxes.front();
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      const auto& [low, high] = boxes[i];
      primitives[i] = {low[0], low[1], low[2], 0, high[0], high[1], high[2], static_cast<unsigned>(i)};
      for (std::size_t k = 0; k < 3; ++k) {
        whole.low[k] = low[k] < whole.low[k] ? low[k] : whole.low[k];
        whole.high[k] = high[k] > whole.high[k] ? high[k] : whole.high[k];
      }
    }
    RTCBVH made = rtcNewBVH(device_);
    RTCBuildArguments arguments = rtcDefaultBuildArguments();
    arguments.maxLeafSize = kMostInLeaf;
    arguments.maxDepth = 64;  // deeper than 2^28 triangles need in halves; flatten() recurses as deep
    arguments.bvh = made;
    arguments.primitives = primitives.data();
    arguments.primitiveCount = arguments.primitiveArrayCapacity = primitives.size();
    arguments.createNode = &Builder::create_branch;
    arguments.setNodeChildren = &Builder::set_children;
    arguments.setNodeBounds = &Builder::set_boxes;
    arguments.createLeaf = &Builder::create_leaf;
    const auto* root = made != nullptr ? static_cast<const detail::Child*>(rtcBuildBVH(&arguments)) : nullptr;
    if (root != nullptr && error_[0] == '\0') {
      tree.order.reserve(boxes.size());
      detail::flatten(*root, whole, tree);
    }
    if (made != nullptr) rtcReleaseBVH(made);
    if (tree.order.size() == boxes.size()) return true;
    if (error_[0] == '\0') std::snprintf(error_, sizeof error_, "Embree built no tree");
    tree = {};
    return false;
  }
  [[nodiscard]] const char* error() const { return error_; }

 private:
  static void on_error(void* self, RTCError code, const char* text) {
    auto* builder = static_cast<Builder*>(self);
    std::snprintf(builder->error_, sizeof builder->error_, "Embree error %d: %s", static_cast<int>(code),
                  text != nullptr ? text : "");
  }
  static void* create_branch(RTCThreadLocalAllocator allocator, unsigned, void*) {
    auto* branch = static_cast<detail::Branch*>(rtcThreadLocalAlloc(allocator, sizeof(detail::Branch), 16));
    auto* child = static_cast<detail::Child*>(rtcThreadLocalAlloc(allocator, sizeof(detail::Child), 16));
    *child = {branch, 0, {}};
    return child;
  }
  static void set_children(void* node, void** children, unsigned count, void*) {
    auto* branch = const_cast<detail::Branch*>(static_cast<detail::Child*>(node)->branch);
    for (unsigned i = 0; i < count; ++i) branch->children[i] = static_cast<const detail::Child*>(children[i]);
  }
  static void set_boxes(void* node, const RTCBounds** bounds, unsigned count, void*) {
    auto* branch = const_cast<detail::Branch*>(static_cast<detail::Child*>(node)->branch);
    for (unsigned i = 0; i < count; ++i) branch->boxes[i] = detail::box_of(*bounds[i]);
  }
  static void* create_leaf(RTCThreadLocalAllocator allocator, const RTCBuildPrimitive* primitives, std::size_t count,
                           void*) {
    auto* child = static_cast<detail::Child*>(rtcThreadLocalAlloc(allocator, sizeof(detail::Child), 16));
    *child = {nullptr, static_cast<std::uint32_t>(count), {}};
    for (std::size_t i = 0; i < count && i < kMostInLeaf; ++i) child->triangles[i] = primitives[i].primID;
    return child;
  }

  RTCDevice device_ = nullptr;
  char error_[160] = "";
};

}  // namespace bvh
