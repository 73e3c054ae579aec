// SPDX-License-Identifier: Apache-2.0
// Triangles of shapes whose occlusion has a closed form.
#pragma once

#include <glm/glm.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

namespace shapes {

struct Mesh {
  std::vector<glm::vec3> positions;
  std::vector<glm::uvec3> indices;

  void add(const Mesh& other) {
    const auto base = static_cast<std::uint32_t>(positions.size());
    positions.insert(positions.end(), other.positions.begin(), other.positions.end());
    for (const glm::uvec3& triangle : other.indices) {
      indices.push_back(triangle + glm::uvec3(base));
    }
  }
};

/// Parallelogram of corners centre +- u +- v; counter-clockwise seen from cross(u, v).
inline Mesh quad(const glm::dvec3& center, const glm::dvec3& u, const glm::dvec3& v) {
  Mesh mesh;
  mesh.positions = {glm::vec3(center - u - v), glm::vec3(center + u - v), glm::vec3(center + u + v),
                    glm::vec3(center - u + v)};
  mesh.indices = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

/// Icosahedron divided `level` times, 20 * 4^level triangles; radius scaled so that its volume is the sphere's.
/// At level 6 edges are 0.0173 radii, so vertices and face centres differ from the sphere by less than
/// edge^2 / 6 = 5e-5 radii, and the silhouette by less than half of that on average.
inline Mesh sphere(const glm::dvec3& center, double radius, int level) {
  const double t = (1.0 + std::sqrt(5.0)) / 2.0;
  std::vector<glm::dvec3> points = {{-1, t, 0},  {1, t, 0},  {-1, -t, 0}, {1, -t, 0}, {0, -1, t},  {0, 1, t},
                                    {0, -1, -t}, {0, 1, -t}, {t, 0, -1},  {t, 0, 1},  {-t, 0, -1}, {-t, 0, 1}};
  for (glm::dvec3& point : points) {
    point = glm::normalize(point);
  }
  std::vector<glm::uvec3> faces = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                                   {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                                   {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  for (int i = 0; i < level; ++i) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      const auto [place, is_new] = middles.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(points.size()));
      if (is_new) {
        points.push_back(glm::normalize(points[a] + points[b]));
      }
      return place->second;
    };
    std::vector<glm::uvec3> finer;
    for (const glm::uvec3& f : faces) {
      const std::uint32_t a = middle(f.x, f.y);
      const std::uint32_t b = middle(f.y, f.z);
      const std::uint32_t c = middle(f.z, f.x);
      finer.insert(finer.end(), {{f.x, a, c}, {f.y, b, a}, {f.z, c, b}, {a, b, c}});
    }
    faces = std::move(finer);
  }
  double volume = 0.0;
  for (const glm::uvec3& f : faces) {
    volume += glm::dot(points[f.x], glm::cross(points[f.y], points[f.z])) / 6.0;
  }
  const double scale = radius * std::cbrt(4.0 / 3.0 * 3.14159265358979323846 / volume);
  Mesh mesh;
  for (const glm::dvec3& point : points) {
    mesh.positions.emplace_back(center + scale * point);
  }
  mesh.indices = std::move(faces);
  return mesh;
}

}  // namespace shapes
