// SPDX-License-Identifier: Apache-2.0
// Parts of a bake, the elements of one instance that look to one side: what may occlude them, whether anything can, and
// what an earlier bake has answered. In float64; for execute of techniques of role bake_visibility.
#pragma once

#include "bake_elements.hpp"

#include <heddle/pieces.h>

#include <cstring>

namespace baked_visibility {

enum class PartState : std::uint8_t {
  kAsked,    // is still looked at
  kKnown,    // an earlier bake has answered
  kOpen,     // nothing rises above any of its tangent planes
  kSettled,  // more directions changed nothing any more
};

struct PartRules {
  /// Metres below a tangent plane that a surface may lie and still occlude what looks along it.
  double margin = 0;
  bool finds_open = true;
  /// All that answers depend on beside elements and surfaces.
  std::vector<double> asked;
};

namespace detail {

/// The tangent planes of a part: normals, and of the elements that have one the lowest.
struct Planes {
  std::vector<glm::dvec3> normals;
  std::vector<double> heights;
};
inline Planes planes_of(std::span<const Element> elements) {
  Planes planes;
  std::map<std::array<float, 3>, std::size_t> known;
  for (const Element& element : elements) {
    const glm::dvec3 normal(element.facing);
    if (normal == glm::dvec3(0.0)) continue;
    const double height = glm::dot(normal, glm::dvec3(element.position));
    const auto [found, is_new] =
        known.try_emplace({element.facing.x, element.facing.y, element.facing.z}, planes.normals.size());
    if (is_new) {
      planes.normals.push_back(normal);
      planes.heights.push_back(height);
    }
    planes.heights[found->second] = std::min(planes.heights[found->second], height);
  }
  return planes;
}

/// Whether a box relative to the set's origin rises above a plane that is lowered by `margin`. What is no number does.
inline bool rises(const Planes& planes, const glm::dvec3& low, const glm::dvec3& high, double margin) {
  if (low.x > high.x) return false;  // nothing
  for (std::size_t i = 0; i < planes.normals.size(); ++i) {
    const glm::dvec3& n = planes.normals[i];
    double top = 0;
    for (int axis = 0; axis < 3; ++axis)
      if (n[axis] != 0) top += n[axis] * (n[axis] > 0 ? high[axis] : low[axis]);
    if (!(top <= planes.heights[i] - margin)) return true;
  }
  return false;
}

/// Planes times vertices that are tried for one part.
inline constexpr std::uint64_t kMostTries = 1U << 26;

}  // namespace detail

class Parts {
 public:
  /// Sorts all parts; answers of those that are not asked go into `sums`, which is parallel to the elements.
  heddle_status begin(const heddle::pass::Frame& frame, const ElementSet& set, const PartRules& rules,
                      std::vector<Sums>& sums) {
    keys_.assign(set.parts.size(), {});
    states.assign(set.parts.size(), PartState::kAsked);
    sums.assign(set.elements.size(), {});
    const heddle::pass::PassHost host = frame.host();
    service_ = host.service<heddle_pieces_service>(HEDDLE_PIECES_SERVICE);
    if (service_ == nullptr) return host.fail(HEDDLE_UNSUPPORTED, "this host has no service " HEDDLE_PIECES_SERVICE);
    const heddle_surface_item* items = nullptr;
    std::uint32_t count = 0;
    if (const heddle_status status = service_->items(host.raw(), frame.raw(), "surfaces", &items, &count);
        status != HEDDLE_OK)
      return status;
    const std::span<const heddle_surface_item> surfaces(items, count);
    for (const heddle_surface_item& item : surfaces)
      if (std::ranges::find(set.others, item.instance) != set.others.end())
        return host.fail(
            HEDDLE_BAD_INPUT,
            "instance " + std::to_string(item.instance) +
                " is among the surfaces beside the one that it shows the same as, and would hide it; put a pass "
                "of role mesh_detail above, with params.show = \"fine\" for params.detail = \"fine_vertices\" "
                "and \"fine_points\", else \"coarse\"");
    const heddle::pass::Meshes meshes(host);
    for (std::size_t p = 0; p < set.parts.size(); ++p) {
      const Part& part = set.parts[p];
      const std::span<const Element> elements = std::span(set.elements).subspan(part.first, part.count);
      const detail::Planes planes = detail::planes_of(elements);
      std::vector<std::byte>& key = keys_[p];
      add(key, std::span(rules.asked));
      add(key, std::span(&set.origin, 1));
      add(key, std::span(&set.radius, 1));
      for (const Element& element : elements) {
        add(key, std::span(&element.position, 1));
        add(key, std::span(&element.normal, 1));
        add(key, std::span(&element.facing, 1));
      }
      // A normal that leans off its surface has directions in front of it that the surface hides.
      bool is_alone = rules.finds_open && part.instance != kNoMesh &&
                      std::ranges::all_of(elements, [](const Element& e) { return e.normal == e.facing; });
      for (const heddle_surface_item& item : surfaces) {
        if ((item.flags & (HEDDLE_SURFACE_OPAQUE | HEDDLE_SURFACE_MASKED)) == 0) continue;
        const glm::dvec3 low = glm::make_vec3(item.low) - set.origin, high = glm::make_vec3(item.high) - set.origin;
        if (!detail::rises(planes, low, high, rules.margin)) continue;
        add(key, std::span(item.content));
        is_alone = is_alone && item.instance == part.instance;
      }
      const std::span<Sums> answers = std::span(sums).subspan(part.first, part.count);
      if (is_alone && is_below(meshes, set, part.instance, planes)) {
        states[p] = PartState::kOpen;
        for (std::size_t e = 0; e < elements.size(); ++e) answers[e] = open_sums(elements[e]);
        continue;
      }
      const void* data = nullptr;
      std::uint64_t bytes = 0;
      if (const heddle_status status = service_->find(host.raw(), frame.raw(), key.data(), key.size(), &data, &bytes);
          status != HEDDLE_OK)
        return status;
      if (data == nullptr || bytes != answers.size_bytes()) continue;
      std::memcpy(answers.data(), data, bytes);
      states[p] = PartState::kKnown;
    }
    first_states_ = states;
    return HEDDLE_OK;
  }

  /// For other bakes: what was asked in this one.
  heddle_status keep(const heddle::pass::Frame& frame, const ElementSet& set, std::span<const Sums> sums) const {
    for (std::size_t p = 0; p < set.parts.size(); ++p) {
      if (states[p] == PartState::kKnown || states[p] == PartState::kOpen) continue;
      const auto answers = sums.subspan(set.parts[p].first, set.parts[p].count);
      if (const heddle_status status = service_->keep(frame.host().raw(), frame.raw(), keys_[p].data(), keys_[p].size(),
                                                      answers.data(), answers.size_bytes());
          status != HEDDLE_OK)
        return status;
    }
    return HEDDLE_OK;
  }

  /// Elements that are asked, as few ranges as there are: the first, and the one behind the last.
  [[nodiscard]] std::vector<std::array<std::uint32_t, 2>> ranges(const ElementSet& set) const {
    std::vector<std::array<std::uint32_t, 2>> found;
    for (std::size_t p = 0; p < states.size(); ++p) {
      if (states[p] != PartState::kAsked) continue;
      const std::uint32_t first = set.parts[p].first, end = first + set.parts[p].count;
      if (!found.empty() && found.back()[1] == first)
        found.back()[1] = end;
      else
        found.push_back({first, end});
    }
    return found;
  }
  [[nodiscard]] std::vector<std::uint32_t> asked(const ElementSet& set) const {
    std::vector<std::uint32_t> found;
    for (const auto& [first, end] : ranges(set))
      for (std::uint32_t e = first; e < end; ++e) found.push_back(e);
    return found;
  }
  [[nodiscard]] double count(PartState state) const { return static_cast<double>(std::ranges::count(states, state)); }
  /// False where another run's parts began otherwise: what it had done is of other elements.
  [[nodiscard]] bool began_as(std::span<const PartState> others) const {
    return others.size() == first_states_.size() &&
           std::ranges::equal(others, first_states_, [](PartState a, PartState b) {
             const auto is_asked = [](PartState s) { return s == PartState::kAsked || s == PartState::kSettled; };
             return a == b || (is_asked(a) && is_asked(b));
           });
  }

  std::vector<PartState> states;  // parallel to the set's parts

 private:
  template <typename Items>
  static void add(std::vector<std::byte>& key, const Items& items) {
    const auto bytes = std::as_bytes(std::span(items));
    key.insert(key.end(), bytes.begin(), bytes.end());
  }
  static Sums open_sums(const Element& element) {
    if (element.normal == glm::vec3(0.0F)) return {};
    const glm::dvec3 n(element.normal);
    return {1, 1, {n.x, n.y, n.z}};
  }
  /// Whether an instance has no vertex above any of the planes: it is convex, as its elements see it.
  static bool is_below(const heddle::pass::Meshes& meshes, const ElementSet& set, std::uint32_t index,
                       const detail::Planes& planes) {
    const heddle_scene_instance instance = meshes.instance(index);
    const heddle_scene_mesh mesh = meshes.mesh(instance.mesh);
    if (std::uint64_t{mesh.vertex_count} * planes.normals.size() > detail::kMostTries) return false;
    const double slack = 0x1p-20 * 2 * set.radius;  // of positions in float32
    const glm::dmat4 place = glm::make_mat4(instance.scene_from_object);
    for (std::uint32_t v = 0; v < mesh.vertex_count; ++v) {
      const glm::dvec3 at = glm::dvec3(place * glm::dvec4(detail::position_of(mesh.vertices[v]), 1.0)) - set.origin;
      for (std::size_t i = 0; i < planes.normals.size(); ++i)
        if (!(glm::dot(planes.normals[i], at) <= planes.heights[i] + slack)) return false;
    }
    return true;
  }

  const heddle_pieces_service* service_ = nullptr;
  std::vector<std::vector<std::byte>> keys_;  // parallel to the set's parts
  std::vector<PartState> first_states_;
};

}  // namespace baked_visibility
