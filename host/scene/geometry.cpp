// SPDX-License-Identifier: Apache-2.0
// Attributes -> a complete mesh: flat normals, tangents, packing, bounds.
#include "scene/geometry.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <unordered_map>

namespace heddle::scene {
namespace {

/// Every corner becomes a vertex of its own.
void unindex(Attributes& attributes) {
  const auto expand = [&](auto& values) {
    if (values.empty()) {
      return;
    }
    std::remove_reference_t<decltype(values)> expanded;
    expanded.reserve(attributes.indices.size());
    for (const std::uint32_t index : attributes.indices) {
      expanded.push_back(values[index]);
    }
    values = std::move(expanded);
  };
  expand(attributes.positions);
  expand(attributes.normals);
  expand(attributes.tangents);
  expand(attributes.uvs[0]);
  expand(attributes.uvs[1]);
  expand(attributes.colors);
  expand(attributes.sources);
  for (std::size_t i = 0; i < attributes.indices.size(); ++i) {
    attributes.indices[i] = static_cast<std::uint32_t>(i);
  }
}

glm::vec3 unit_or(const glm::dvec3& vector, const glm::vec3& otherwise) {
  const double length = glm::length(vector);
  return length > 0 ? glm::vec3(vector / length) : otherwise;
}

void make_flat_normals(Attributes& attributes) {
  attributes.tangents.clear();  // they belong to normals that are not there
  unindex(attributes);
  attributes.normals.resize(attributes.positions.size());
  for (std::size_t i = 0; i + 2 < attributes.positions.size(); i += 3) {
    const glm::dvec3 a = attributes.positions[i], b = attributes.positions[i + 1], c = attributes.positions[i + 2];
    const glm::vec3 normal = unit_or(glm::cross(b - a, c - a), glm::vec3(0, 1, 0));
    std::fill_n(attributes.normals.begin() + static_cast<std::ptrdiff_t>(i), 3, normal);
  }
}

/// Position, normal and texture coordinates by their bits, and the turn of the triangle in texture space.
struct CornerKey {
  std::array<std::uint32_t, 9> words{};
  bool operator==(const CornerKey&) const = default;
};
struct CornerHash {
  std::size_t operator()(const CornerKey& key) const {
    std::uint64_t hash = 0xcbf29ce484222325ULL;  // FNV-1a over words, with a final mix against weak low bits
    for (const std::uint32_t word : key.words) {
      hash = (hash ^ word) * 0x100000001b3ULL;
    }
    return static_cast<std::size_t>(hash ^ (hash >> 29));
  }
};

struct TriangleFrame {
  glm::dvec3 direction{0.0};  // where u grows, per unit of u
  bool is_mirrored = false;   // texture space is turned against the surface
  bool is_valid = false;      // false: no area in texture space
};

TriangleFrame frame_of(const std::array<glm::dvec3, 3>& p, const std::array<glm::dvec2, 3>& t) {
  const glm::dvec3 e1 = p[1] - p[0], e2 = p[2] - p[0];
  const glm::dvec2 d1 = t[1] - t[0], d2 = t[2] - t[0];
  const double area = d1.x * d2.y - d2.x * d1.y;
  TriangleFrame frame;
  frame.is_valid = area != 0 && std::isfinite(area);
  if (frame.is_valid) {
    // Images begin at the top, so v grows downwards, while a normal map's green points up in the image: where the image
    // is not mirrored, u and -v turn like the triangle's corners, and the area in (u, v) is negative.
    frame.is_mirrored = area > 0;
    frame.direction = (e1 * d2.y - e2 * d1.y) / area;
  }
  return frame;
}

double angle_at(const glm::dvec3& at, const glm::dvec3& to, const glm::dvec3& other) {
  const glm::dvec3 a = to - at, b = other - at;
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

void make_tangents(Attributes& attributes, std::uint32_t uv_set, const std::array<float, 4>& uv_matrix) {
  const glm::dmat2 image_from_uv(uv_matrix[0], uv_matrix[1], uv_matrix[2], uv_matrix[3]);
  const std::vector<glm::vec2>& uv = attributes.uvs.at(uv_set);
  const std::size_t triangles = attributes.indices.size() / 3;
  struct Group {
    glm::dvec3 sum{0.0};
  };
  std::unordered_map<CornerKey, std::uint32_t, CornerHash> group_of;
  group_of.reserve(attributes.positions.size());
  std::vector<Group> groups;
  std::vector<std::uint32_t> corner_group(attributes.indices.size());
  std::vector<std::uint8_t> is_mirrored(triangles, 0);

  for (std::size_t triangle = 0; triangle < triangles; ++triangle) {
    std::array<glm::dvec3, 3> p;
    std::array<glm::dvec2, 3> t;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t index = attributes.indices[triangle * 3 + k];
      p[k] = attributes.positions[index];
      t[k] = image_from_uv * glm::dvec2(uv[index]);
    }
    const TriangleFrame frame = frame_of(p, t);
    is_mirrored[triangle] = frame.is_mirrored ? 1 : 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t corner = triangle * 3 + k;
      const std::uint32_t index = attributes.indices[corner];
      const glm::vec3 &position = attributes.positions[index], &normal = attributes.normals[index];
      CornerKey key;
      const std::array<float, 8> values = {position.x, position.y, position.z,  normal.x,
                                           normal.y,   normal.z,   uv[index].x, uv[index].y};
      for (std::size_t i = 0; i < values.size(); ++i) {
        key.words[i] = std::bit_cast<std::uint32_t>(values[i] + 0.0F);  // -0 and 0 are one place
      }
      key.words[8] = is_mirrored[triangle];
      const auto [entry, is_new] = group_of.try_emplace(key, static_cast<std::uint32_t>(groups.size()));
      if (is_new) {
        groups.emplace_back();
      }
      corner_group[corner] = entry->second;
      if (frame.is_valid) {
        const glm::dvec3 n = normal;
        const glm::dvec3 across = frame.direction - n * glm::dot(n, frame.direction);
        const double length = glm::length(across);
        if (length > 0) {
          groups[entry->second].sum += across / length * angle_at(p[k], p[(k + 1) % 3], p[(k + 2) % 3]);
        }
      }
    }
  }

  // The first way round that a vertex meets stays at its index; the other gets a copy of the vertex.
  constexpr std::uint8_t kUnset = 2;
  attributes.tangents.assign(attributes.positions.size(), glm::vec4(0.0F));
  std::vector<std::uint8_t> turn(attributes.positions.size(), kUnset);
  std::unordered_map<std::uint32_t, std::uint32_t> copies;
  for (std::size_t corner = 0; corner < attributes.indices.size(); ++corner) {
    const std::uint8_t mirrored = is_mirrored[corner / 3];
    std::uint32_t index = attributes.indices[corner];
    if (turn[index] != kUnset && turn[index] != mirrored) {
      const auto [entry, is_new] = copies.try_emplace(index, static_cast<std::uint32_t>(attributes.positions.size()));
      if (is_new) {
        const auto repeat = [&](auto& values) {
          if (!values.empty()) {
            const auto value = values[index];
            values.push_back(value);
          }
        };
        repeat(attributes.positions);
        repeat(attributes.normals);
        repeat(attributes.tangents);
        repeat(attributes.uvs[0]);
        repeat(attributes.uvs[1]);
        repeat(attributes.colors);
        repeat(attributes.sources);
        turn.push_back(kUnset);
      }
      index = entry->second;
      attributes.indices[corner] = index;
    }
    if (turn[index] == kUnset) {
      turn[index] = mirrored;
      const glm::vec3& normal = attributes.normals[index];
      const glm::vec3 tangent = unit_or(groups[corner_group[corner]].sum, any_tangent(normal));
      attributes.tangents[index] = glm::vec4(tangent, mirrored != 0 ? -1.0F : 1.0F);
    }
  }
}

}  // namespace

glm::vec3 any_tangent(const glm::vec3& normal) {
  // The axis that the normal follows least.
  const glm::vec3 size = glm::abs(normal);
  glm::dvec3 axis(0, 0, 1);
  if (size.x <= size.y && size.x <= size.z) {
    axis = {1, 0, 0};
  } else if (size.y <= size.z) {
    axis = {0, 1, 0};
  }
  const glm::dvec3 n = normal;
  return unit_or(axis - n * glm::dot(n, axis), glm::vec3(1, 0, 0));
}

std::uint32_t pack_unorm8(const glm::vec4& color) {
  std::uint32_t packed = 0;
  for (int i = 0; i < 4; ++i) {
    const float clamped = color[i] > 0.0F ? std::min(color[i], 1.0F) : 0.0F;
    packed |= static_cast<std::uint32_t>(std::lround(clamped * 255.0F)) << (8 * i);
  }
  return packed;
}

glm::dmat3 normal_matrix(const glm::dmat3& m) {
  // The matrix of cofactors is the inverse transpose times the determinant, whose sign must not turn normals round.
  const glm::dmat3 cofactors(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
  return glm::determinant(m) < 0 ? -cofactors : cofactors;
}

void complete(Attributes& attributes, std::uint32_t tangent_uv_set, const std::array<float, 4>& uv_matrix) {
  if (attributes.normals.empty()) {
    make_flat_normals(attributes);
  }
  for (glm::vec3& normal : attributes.normals) {
    normal = unit_or(normal, glm::vec3(0, 1, 0));
  }
  if (attributes.tangents.empty() && tangent_uv_set < 2 && !attributes.uvs[tangent_uv_set].empty()) {
    make_tangents(attributes, tangent_uv_set, uv_matrix);
  }
}

Mesh build_mesh(std::string name, std::uint32_t material, Attributes attributes, std::uint32_t tangent_uv_set,
                const std::array<float, 4>& uv_matrix) {
  complete(attributes, tangent_uv_set, uv_matrix);
  return pack(std::move(name), material, std::move(attributes));
}

Mesh pack(std::string name, std::uint32_t material, Attributes attributes) {
  Mesh mesh;
  mesh.name = std::move(name);
  mesh.material = material;
  mesh.indices = std::move(attributes.indices);
  mesh.vertices.resize(attributes.positions.size());
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    HeddleVertex& vertex = mesh.vertices[i];
    const glm::vec3 &position = attributes.positions[i], &normal = attributes.normals[i];
    glm::vec4 tangent(0.0F, 0.0F, 0.0F, 1.0F);
    if (!attributes.tangents.empty()) {
      tangent = attributes.tangents[i];
    }
    const glm::vec3 direction = unit_or(glm::dvec3(tangent), any_tangent(normal));
    const std::array<glm::vec2, 2> uv = {attributes.uvs[0].empty() ? glm::vec2(0) : attributes.uvs[0][i],
                                         attributes.uvs[1].empty() ? glm::vec2(0) : attributes.uvs[1][i]};
    for (int k = 0; k < 3; ++k) {
      vertex.position[k] = position[k];
      vertex.normal[k] = normal[k];
      vertex.tangent[k] = direction[k];
    }
    vertex.tangent[3] = tangent.w < 0 ? -1.0F : 1.0F;
    vertex.u0 = uv[0].x;
    vertex.v0 = uv[0].y;
    vertex.u1 = uv[1].x;
    vertex.v1 = uv[1].y;
    vertex.color = attributes.colors.empty() ? 0xffffffffU : pack_unorm8(attributes.colors[i]);
    if (i == 0) {
      mesh.bounds = {position, position};
    }
    mesh.bounds = {glm::min(mesh.bounds[0], position), glm::max(mesh.bounds[1], position)};
  }
  return mesh;
}

}  // namespace heddle::scene
