// SPDX-License-Identifier: Apache-2.0
// The parts of a scene, each in two ways: whether it is what it was a frame ago, and what it holds in any process.
#pragma once

#include "content_hash.hpp"
#include "graph/scene_ports.hpp"
#include "scene/scene.hpp"

#include <span>
#include <vector>

namespace heddle::graph {

template <typename T>
void add_bytes(std::vector<std::byte>& bytes, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  const auto added = std::as_bytes(std::span(&value, 1));
  bytes.insert(bytes.end(), added.begin(), added.end());
}

template <typename T>
void add_bytes(ContentHash& hash, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  hash.add({reinterpret_cast<const char*>(&value), sizeof value});
}

template <typename T>
void add_array(ContentHash& hash, const std::vector<T>& values) {
  static_assert(std::is_trivially_copyable_v<T>);
  hash.add_long(std::as_bytes(std::span(values)));
}

/// The same bytes: a frame of this size sees the same of all parts and of the components. Revisions stand for what is
/// large, so they hold within one process alone.
std::vector<std::byte> scene_state(const scene::Scene& scene, std::uint32_t width, std::uint32_t height);

/// What a pass sees of a part whose frame has this origin. Throws Error(HEDDLE_BUG) for the camera: jobs have none.
void add_content(ContentHash& hash, const scene::Scene& scene, ScenePart part, const glm::dvec3& origin);

}  // namespace heddle::graph
