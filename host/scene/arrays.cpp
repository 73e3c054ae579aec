// SPDX-License-Identifier: Apache-2.0
// Arrays of an application -> meshes: every number is checked before it is used.

#include "scene/arrays.hpp"

#include "scene/geometry.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numeric>

namespace heddle::scene {

namespace {

/// `count` vectors of Vector's length from a flat array; empty for NULL.
template <class Vector>
std::vector<Vector> vectors(const float* values, std::uint32_t count, const std::string& mesh, const char* array) {
  std::vector<Vector> made;
  if (values == nullptr) return made;
  made.resize(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    for (glm::length_t c = 0; c < Vector::length(); ++c) {
      const float value = values[static_cast<std::size_t>(i) * Vector::length() + static_cast<std::size_t>(c)];
      if (!std::isfinite(value)) {
        throw Error(HEDDLE_BAD_INPUT,
                    fmt::format("mesh '{}': {}[{}][{}] is {}: expected a finite number", mesh, array, i, c, value));
      }
      made[i][c] = value;
    }
  }
  return made;
}

}  // namespace

Mesh make_mesh(const heddle_mesh& given, std::string name, std::uint32_t material_index, const Material& material) {
  const std::uint32_t count = given.vertex_count;
  if (given.positions == nullptr || count == 0) {
    throw Error(HEDDLE_BAD_INPUT, fmt::format("mesh '{}' has no positions", name));
  }
  Attributes attributes;
  attributes.positions = vectors<glm::vec3>(given.positions, count, name, "positions");
  attributes.normals = vectors<glm::vec3>(given.normals, count, name, "normals");
  attributes.tangents = vectors<glm::vec4>(given.tangents, count, name, "tangents");
  attributes.uvs[0] = vectors<glm::vec2>(given.uv0, count, name, "uv0");
  attributes.uvs[1] = vectors<glm::vec2>(given.uv1, count, name, "uv1");
  attributes.colors = vectors<glm::vec4>(given.colors, count, name, "colors");
  if (given.indices != nullptr) {
    attributes.indices.assign(given.indices, given.indices + given.index_count);
  } else {
    attributes.indices.resize(count);
    std::iota(attributes.indices.begin(), attributes.indices.end(), 0U);
  }
  if (attributes.indices.empty() || attributes.indices.size() % 3 != 0) {
    throw Error(HEDDLE_BAD_INPUT, fmt::format("mesh '{}' has {} indices: expected triangles, a multiple of 3", name,
                                              attributes.indices.size()));
  }
  for (std::size_t i = 0; i < attributes.indices.size(); ++i) {
    if (attributes.indices[i] >= count) {
      throw Error(HEDDLE_BAD_INPUT, fmt::format("mesh '{}': indices[{}] is {}: expected less than {} vertices", name, i,
                                                attributes.indices[i], count));
    }
  }
  const bool has_normal_map = material.textures[HEDDLE_TEXTURE_NORMAL] != HEDDLE_NONE;
  const std::uint32_t uv_set = (material.record.texture_uv_sets >> HEDDLE_TEXTURE_NORMAL) & 1U;
  return build_mesh(std::move(name), material_index, std::move(attributes), has_normal_map ? uv_set : HEDDLE_NONE,
                    texture_transform(material.record, HEDDLE_TEXTURE_NORMAL).matrix);
}

}  // namespace heddle::scene
