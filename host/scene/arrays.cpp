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

/// Corners of faces -> triangles around each face's first corner.
std::vector<std::uint32_t> fan_out(const std::vector<std::uint32_t>& corners, const std::vector<std::uint32_t>& sizes,
                                   const std::string& mesh) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    sum += sizes[i];
    if (sizes[i] >= 3) continue;
    throw Error(HEDDLE_BAD_INPUT,
                fmt::format("mesh '{}': face_sizes[{}] is {}: expected 3 corners or more", mesh, i, sizes[i]));
  }
  if (sum != corners.size()) {
    throw Error(HEDDLE_BAD_INPUT, fmt::format("mesh '{}': face_sizes add up to {}: expected {}, the number of indices",
                                              mesh, sum, corners.size()));
  }
  std::vector<std::uint32_t> triangles;
  const std::uint32_t* face = corners.data();
  for (const std::uint32_t size : sizes) {
    for (std::uint32_t i = 1; i + 1 < size; ++i) triangles.insert(triangles.end(), {face[0], face[i], face[i + 1]});
    face += size;
  }
  return triangles;
}

/// Creases of given vertices, as vertices of the mesh, which may have split them.
void take_creases(const heddle_mesh& given, const std::vector<std::uint32_t>& given_indices, Mesh& mesh) {
  if (given.crease_count == 0 || given.creases == nullptr || given.sharpness == nullptr) return;
  std::vector<std::uint32_t> made(given.vertex_count, HEDDLE_NONE);
  for (std::size_t i = 0; i < given_indices.size(); ++i) made[given_indices[i]] = mesh.indices[i];
  for (std::uint32_t i = 0; i < given.crease_count; ++i) {
    for (std::size_t k = 0; k < 2; ++k) {
      const std::uint32_t vertex = given.creases[std::size_t{i} * 2 + k];
      if (vertex < given.vertex_count && made[vertex] != HEDDLE_NONE) {
        mesh.creases.push_back(made[vertex]);
        continue;
      }
      throw Error(HEDDLE_BAD_INPUT, fmt::format("mesh '{}': creases[{}][{}] is {}: expected a vertex of a face",
                                                mesh.name, i, k, vertex));
    }
    const float sharpness = given.sharpness[i];
    if (!std::isfinite(sharpness) || sharpness < 0) {
      throw Error(HEDDLE_BAD_INPUT, fmt::format("mesh '{}': sharpness[{}] is {}: expected a number of at least 0",
                                                mesh.name, i, sharpness));
    }
    mesh.sharpness.push_back(sharpness);
  }
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
  std::vector<std::uint32_t> face_sizes;
  if (given.face_count > 0 && given.face_sizes != nullptr) {
    face_sizes.assign(given.face_sizes, given.face_sizes + given.face_count);
    attributes.indices = fan_out(attributes.indices, face_sizes, name);
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
  const std::vector<std::uint32_t> given_indices = attributes.indices;
  const bool has_normal_map = material.textures[HEDDLE_TEXTURE_NORMAL] != HEDDLE_NONE;
  const std::uint32_t uv_set = (material.record.texture_uv_sets >> HEDDLE_TEXTURE_NORMAL) & 1U;
  Mesh mesh = build_mesh(std::move(name), material_index, std::move(attributes), has_normal_map ? uv_set : HEDDLE_NONE,
                         texture_transform(material.record, HEDDLE_TEXTURE_NORMAL).matrix);
  mesh.face_sizes = std::move(face_sizes);
  take_creases(given, given_indices, mesh);
  return mesh;
}

}  // namespace heddle::scene
