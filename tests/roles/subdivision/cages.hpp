// SPDX-License-Identifier: Apache-2.0
// Cages for tests, with their points in float64.
#pragma once

#include "shared/catmull_clark.hpp"

#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace cages {

using heddle::catmull_clark::Cage;
using heddle::catmull_clark::Index;
using heddle::catmull_clark::Weights;
using Point = std::array<double, 3>;

struct Mesh {
  Cage cage;
  std::vector<Point> points;
  void add_face(std::initializer_list<Index> corners) {
    cage.face_sizes.push_back(static_cast<Index>(corners.size()));
    cage.corners.insert(cage.corners.end(), corners.begin(), corners.end());
  }
  void finish() { cage.point_count = static_cast<Index>(points.size()); }
};

/// [-1, 1]^3.
inline Mesh cube() {
  Mesh mesh;
  for (int i = 0; i < 8; ++i) mesh.points.push_back({i & 1 ? 1.0 : -1.0, i & 2 ? 1.0 : -1.0, i & 4 ? 1.0 : -1.0});
  mesh.add_face({0, 2, 3, 1});
  mesh.add_face({4, 5, 7, 6});
  mesh.add_face({0, 1, 5, 4});
  mesh.add_face({2, 6, 7, 3});
  mesh.add_face({0, 4, 6, 2});
  mesh.add_face({1, 3, 7, 5});
  mesh.finish();
  return mesh;
}

/// A box of k x k quads a side, [-1, 1]^3.
inline Mesh box(int k) {
  Mesh mesh;
  std::map<std::array<int, 3>, Index> known;
  const auto point = [&](std::array<int, 3> at) {
    const auto [found, is_new] = known.try_emplace(at, static_cast<Index>(mesh.points.size()));
    if (is_new) mesh.points.push_back({2.0 * at[0] / k - 1, 2.0 * at[1] / k - 1, 2.0 * at[2] / k - 1});
    return found->second;
  };
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const int side : {0, k})
      for (int i = 0; i < k; ++i)
        for (int j = 0; j < k; ++j) {
          const auto at = [&](int u, int v) {
            std::array<int, 3> where{};
            where[axis] = side;
            where[(axis + 1) % 3] = u;
            where[(axis + 2) % 3] = v;
            return point(where);
          };
          if (side == k)
            mesh.add_face({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
          else
            mesh.add_face({at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)});
        }
  mesh.finish();
  return mesh;
}

/// Closed both ways: every point regular.
inline Mesh torus(int around, int across) {
  Mesh mesh;
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < across; ++j) {
      const double u = 2 * std::numbers::pi * i / around, v = 2 * std::numbers::pi * j / across;
      mesh.points.push_back(
          {(2 + 0.7 * std::cos(v)) * std::cos(u), 0.7 * std::sin(v), -(2 + 0.7 * std::cos(v)) * std::sin(u)});
    }
  const auto at = [&](int i, int j) { return static_cast<Index>((i % around) * across + j % across); };
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < across; ++j) mesh.add_face({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
  mesh.finish();
  return mesh;
}

/// n quads around a point, and a ring more of them: point 0 has valence n, and what is around it is smooth.
inline Mesh fan(int n, bool is_closed = true) {
  Mesh mesh;
  const int spokes = is_closed ? n : n + 1;
  const double turn = is_closed ? 2 * std::numbers::pi / n : std::numbers::pi / n;
  const auto height = [](double x, double y) { return 0.3 * x * x - 0.2 * x * y + 0.15 * y * y + 0.1 * x; };
  mesh.points.push_back({0, 0, height(0, 0)});
  // Ring r: points on spokes at radius r, and corners between them.
  for (int r = 1; r <= 3; ++r)
    for (int i = 0; i < spokes; ++i)
      for (int k = 0; k < 2 * r; ++k) {
        // Along the outline of the square of each face: from spoke i outwards to the corner, and in to the next spoke.
        const double along = k <= r ? k : r, back = k <= r ? r : 2 * r - k;
        const double a = turn * i, b = turn * (i + 1);
        const double x = std::cos(a) * back + std::cos(b) * along, y = std::sin(a) * back + std::sin(b) * along;
        mesh.points.push_back({x, y, height(x, y)});
      }
  const auto at = [&](int face, int u, int v) -> Index {  // u along spoke `face`, v along the next
    if (u == 0 && v == 0) return 0;
    if (u == 0) {
      face = is_closed ? (face + 1) % n : face + 1;
      u = v;
      v = 0;
    }
    const int r = std::max(u, v), k = v <= u && u == r ? v : 2 * r - u;
    int first = 1;
    for (int q = 1; q < r; ++q) first += spokes * 2 * q;
    return static_cast<Index>(first + face * 2 * r + k);
  };
  for (int f = 0; f < n; ++f)
    for (int u = 0; u < 3; ++u)
      for (int v = 0; v < 3; ++v) mesh.add_face({at(f, u, v), at(f, u + 1, v), at(f, u + 1, v + 1), at(f, u, v + 1)});
  // Points beside the last spoke of an open fan belong to no face.
  mesh.finish();
  return mesh;
}

inline Point weigh(const Weights& weights, std::size_t row, const std::vector<Point>& points) {
  Point sum{};
  const auto of = weights.points_of(row);
  const auto values = weights.values_of(row);
  for (std::size_t i = 0; i < of.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) sum[k] += values[i] * points[of[i]][k];
  return sum;
}
inline Point cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double dot(const Point& a, const Point& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline Point unit(const Point& a) {
  const double length = std::sqrt(dot(a, a));
  return {a[0] / length, a[1] / length, a[2] / length};
}
inline double distance(const Point& a, const Point& b) {
  const Point d{a[0] - b[0], a[1] - b[1], a[2] - b[2]};
  return std::sqrt(dot(d, d));
}
/// sin of the angle between two directions.
inline double turned(const Point& a, const Point& b) {
  const Point c = cross(unit(a), unit(b));
  return std::sqrt(dot(c, c));
}

}  // namespace cages
