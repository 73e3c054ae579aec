// SPDX-License-Identifier: Apache-2.0
// Weights of refinement and limits, float64: closed forms, what refinement itself tends to, and invariants. Needs no
// host and no device.
#include "cages.hpp"

#include <gtest/gtest.h>

namespace {

using namespace heddle::catmull_clark;
using cages::Mesh;
using cages::Point;

double largest_distance(const Refined& refined, const std::vector<Point>& points) {
  double largest = 0;
  for (std::size_t v = 0; v < refined.limits.count(); ++v)
    largest = std::max(
        largest, cages::distance(cages::weigh(refined.positions, v, points), cages::weigh(refined.limits, v, points)));
  return largest;
}

Point normal_of(const Refined& refined, std::size_t row, const std::vector<Point>& points) {
  return cages::cross(cages::weigh(refined.t1, row, points), cages::weigh(refined.t2, row, points));
}

TEST(Weights, OfTheCubeHaveItsExactLimits) {
  const Mesh cube = cages::cube();
  const Refined refined = refine_to_limit(cube.cage, 1);
  ASSERT_EQ(refined.limits.count(), 26U);  // 8 corners, 12 edges, 6 faces
  for (std::size_t v = 0; v < 26; ++v) {
    const Point at = cages::weigh(refined.limits, v, cube.points);
    int zeros = 0;
    for (const double x : at) zeros += std::abs(x) < 1e-12 ? 1 : 0;
    const double expected = zeros == 0 ? 0.5 : zeros == 1 ? 395.0 / 648 : 68.0 / 81;
    for (const double x : at) EXPECT_NEAR(std::abs(x), std::abs(x) < 1e-12 ? 0 : expected, 1e-14) << v;
  }
}

TEST(Weights, NearTheLimitFourTimesWithEveryLevel) {
  // Distances of the farthest vertex from its limit, published for these cages.
  const std::array<double, 3> box_anchors{0.0426, 0.0102, 0.0025};
  const std::array<double, 3> cube_anchors{0.1986, 0.0476, 0.0118};
  const Mesh box = cages::box(4), cube = cages::cube(), torus = cages::torus(8, 6);
  for (int level = 1; level <= 3; ++level) {
    const auto i = static_cast<std::size_t>(level - 1);
    EXPECT_NEAR(largest_distance(refine_to_limit(box.cage, level), box.points), box_anchors[i], 5.1e-5);
    EXPECT_NEAR(largest_distance(refine_to_limit(cube.cage, level), cube.points), cube_anchors[i], 5.1e-5);
  }
  for (const Mesh* mesh : {&box, &torus})
    for (int level = 1; level <= 3; ++level) {
      const double ratio = largest_distance(refine_to_limit(mesh->cage, level), mesh->points) /
                           largest_distance(refine_to_limit(mesh->cage, level + 1), mesh->points);
      EXPECT_NEAR(ratio, 4, 0.4) << level;
    }
}

TEST(Weights, OfARegularSurfaceAreTheBicubicBSpline) {
  constexpr int kAround = 8, kAcross = 6;
  const Mesh torus = cages::torus(kAround, kAcross);
  const Refined refined = refine_to_limit(torus.cage, 2);
  // A uniform cubic B-spline and its slope at t in a span, over four points.
  const auto basis = [](double t) -> std::array<double, 4> {
    const double s = 1 - t;
    return {s * s * s / 6, (3 * t * t * t - 6 * t * t + 4) / 6, (3 * s * s * s - 6 * s * s + 4) / 6, t * t * t / 6};
  };
  const auto slope = [](double t) -> std::array<double, 4> {
    const double s = 1 - t;
    return {-s * s / 2, (3 * t * t - 4 * t) / 2, -(3 * s * s - 4 * s) / 2, t * t / 2};
  };
  const auto sum = [&](int i, int j, const std::array<double, 4>& u, const std::array<double, 4>& v) {
    Point at{};
    for (int a = 0; a < 4; ++a)
      for (int b = 0; b < 4; ++b) {
        const Point& p = torus.points[static_cast<std::size_t>((i + a + kAround - 1) % kAround * kAcross +
                                                               (j + b + kAcross - 1) % kAcross)];
        for (std::size_t k = 0; k < 3; ++k)
          at[k] += u[static_cast<std::size_t>(a)] * v[static_cast<std::size_t>(b)] * p[k];
      }
    return at;
  };
  // Each quad of level 2 begins at a quarter of its face.
  std::size_t seen = 0;
  for (std::size_t q = 0; q < refined.cage_face.size(); ++q) {
    const int face = static_cast<int>(refined.cage_face[q]);
    const int i = face / kAcross, j = face % kAcross;
    for (std::size_t c = 0; c < 4; ++c) {
      const Index row = refined.quads[4 * q + c];
      const Point at = cages::weigh(refined.limits, refined.vertices[row], torus.points);
      double nearest = 1e9, turn = 1e9;
      for (int a = 0; a <= 4; ++a)
        for (int b = 0; b <= 4; ++b) {
          const double u = a / 4.0, v = b / 4.0;
          const double d = cages::distance(at, sum(i, j, basis(u), basis(v)));
          if (d >= nearest) continue;
          nearest = d;
          turn =
              cages::distance(cages::unit(normal_of(refined, row, torus.points)),
                              cages::unit(cages::cross(sum(i, j, slope(u), basis(v)), sum(i, j, basis(u), slope(v)))));
        }
      EXPECT_LT(nearest, 1e-13);
      EXPECT_LT(turn, 1e-12);
      ++seen;
    }
  }
  EXPECT_EQ(seen, std::size_t{kAround} * kAcross * 16 * 4);
}

/// Where point 0 is after some levels, and the normal that the quads around it have on average.
std::pair<Point, Point> refined_far(const Mesh& mesh, int levels) {
  // Only what is near point 0 matters, so the cage is cut down to its ring after each level.
  Mesh now = mesh;
  for (int level = 0; level < levels; ++level) {
    const Level zero = level_zero(now.cage);
    const Level next = refine(zero, now.cage.point_count);
    Mesh cut;
    std::map<Index, Index> known;
    const auto keep = [&](Index point) {
      const auto [found, is_new] = known.try_emplace(point, static_cast<Index>(cut.points.size()));
      if (is_new) cut.points.push_back(cages::weigh(next.points, point, now.points));
      return found->second;
    };
    keep(0);
    std::map<Index, double> near;  // within three faces of point 0
    const Fan around = next.topology.fan(0);
    std::vector<Index> faces(around.faces.begin(), around.faces.end());
    for (int grow = 0; grow < 2; ++grow) {
      std::vector<Index> more = faces;
      for (const Index face : faces)
        for (Index i = 0; i < 4; ++i)
          for (const Index other : next.topology.fan(next.topology.corner(face, i)).faces)
            if (std::find(more.begin(), more.end(), other) == more.end()) more.push_back(other);
      faces = std::move(more);
    }
    for (const Index face : faces) {
      cut.cage.face_sizes.push_back(4);
      for (Index i = 0; i < 4; ++i) cut.cage.corners.push_back(keep(next.topology.corner(face, i)));
    }
    for (const Edge& edge : next.topology.edges) {
      if (edge.is_border() || edge.sharpness == 0 || !known.contains(edge.points[0]) || !known.contains(edge.points[1]))
        continue;
      cut.cage.sharp_edges.push_back({{known[edge.points[0]], known[edge.points[1]]}, edge.sharpness});
    }
    if (next.point_sharpness[0] > 0) cut.cage.sharp_points.emplace_back(0U, next.point_sharpness[0]);
    cut.cage.pins_corners = false;
    cut.finish();
    now = std::move(cut);
  }
  Point normal{};
  const Level last = level_zero(now.cage);
  const Fan fan = last.topology.fan(0);
  for (std::size_t i = 0; i < fan.faces.size(); ++i) {
    Point a = now.points[fan.spokes[i]], b = now.points[fan.spokes[(i + 1) % fan.spokes.size()]];
    for (std::size_t k = 0; k < 3; ++k) {
      a[k] -= now.points[0][k];
      b[k] -= now.points[0][k];
    }
    const Point area = cages::cross(a, b);
    for (std::size_t k = 0; k < 3; ++k) normal[k] += area[k];
  }
  return {now.points[0], cages::unit(normal)};
}

/// A limit is the same whichever level it is taken from: exact, where refinement itself only comes near.
void expect_same_from_every_level(const Mesh& mesh, const std::string& what) {
  Point place{}, normal{};
  for (int level = 1; level <= 4; ++level) {
    const Refined refined = refine_to_limit(mesh.cage, level);
    const auto row = static_cast<std::size_t>(std::find(refined.vertices.begin(), refined.vertices.end(), 0U) -
                                              refined.vertices.begin());
    const Point place_now = cages::weigh(refined.limits, 0, mesh.points);
    const Point normal_now = cages::unit(normal_of(refined, row, mesh.points));
    if (level > 1) {
      EXPECT_LT(cages::distance(place_now, place), 1e-13) << what << ", level " << level;
      EXPECT_LT(cages::distance(normal_now, normal), 1e-11) << what << ", level " << level;
    }
    place = place_now;
    normal = normal_now;
  }
}

TEST(Weights, AreWhatRefinementTendsToAtEveryValence) {
  for (const int n : {3, 4, 5, 6, 8, 12, 64, 128}) {
    const Mesh mesh = cages::fan(n);
    if (n <= 12) expect_same_from_every_level(mesh, "valence " + std::to_string(n));
    const Refined refined = refine_to_limit(mesh.cage, 1);
    // What is left of curvature shrinks by about 0.6 a level at high valences, by 4 at 4.
    const auto [place, normal] = refined_far(mesh, n > 12 ? 8 : 16);
    const Point limit = cages::weigh(refined.limits, 0, mesh.points);
    EXPECT_LT(cages::distance(limit, place), n > 12 ? 1e-3 : 4e-6) << n;
    EXPECT_LT(cages::distance(cages::unit(normal_of(refined, 0, mesh.points)), normal), n > 12 ? 2e-2 : 3e-4) << n;
  }
}

TEST(Weights, AreWhatRefinementTendsToOnBordersAndCurves) {
  for (const int k : {2, 3}) {
    const Mesh mesh = cages::fan(k, false);
    expect_same_from_every_level(mesh, "border of faces " + std::to_string(k));
    const Refined refined = refine_to_limit(mesh.cage, 1);
    const auto [place, normal] = refined_far(mesh, 16);
    EXPECT_LT(cages::distance(cages::weigh(refined.limits, 0, mesh.points), place), 1e-8) << k;
    EXPECT_LT(cages::distance(cages::unit(normal_of(refined, 0, mesh.points)), normal), 5e-3) << k;
  }
  for (const int n : {3, 4, 5, 6, 9}) {  // a sharp edge that ends, semi-sharp ones, a curve
    for (const double sharpness : {kInfinite, 0.4, 1.0, 2.7}) {
      const std::string what = "valence " + std::to_string(n) + ", sharpness " + std::to_string(sharpness);
      Mesh mesh = cages::fan(n);
      mesh.cage.sharp_edges.push_back({{0, 1}, sharpness});
      if (sharpness < kInfinite) mesh.cage.sharp_edges.push_back({{0, 3}, 0.5 * sharpness});
      expect_same_from_every_level(mesh, what);
      const Refined refined = refine_to_limit(mesh.cage, 1);
      const auto [place, normal] = refined_far(mesh, 18);
      EXPECT_LT(cages::distance(cages::weigh(refined.limits, 0, mesh.points), place), 1e-5) << what;
      EXPECT_LT(cages::distance(cages::unit(normal_of(refined, 0, mesh.points)), normal), 5e-2) << what;
    }
    Mesh mesh = cages::fan(n);
    mesh.cage.sharp_edges.push_back({{0, 1}, kInfinite});
    mesh.cage.sharp_edges.push_back({{0, 5}, kInfinite});
    expect_same_from_every_level(mesh, "curve at valence " + std::to_string(n));
  }
}

TEST(Weights, AddUpToOneAndAreNeverNegative) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 20; ++trial) {
    Mesh mesh = trial % 2 == 0 ? cages::cube() : cages::fan(3 + trial % 7, trial % 3 != 0);
    const Level zero = level_zero(mesh.cage);
    for (const Edge& edge : zero.topology.edges)
      if (random() % 3 == 0) mesh.cage.sharp_edges.push_back({edge.points, static_cast<double>(random() % 120) / 10});
    if (trial % 4 == 0) mesh.cage.sharp_points.emplace_back(0U, 1.5);
    const Refined refined = refine_to_limit(mesh.cage, 2);
    for (const Weights* weights : {&refined.positions, &refined.limits})
      for (std::size_t row = 0; row < weights->count(); ++row) {
        double sum = 0;
        for (const double value : weights->values_of(row)) {
          sum += value;
          EXPECT_GE(value, -1e-15);
        }
        EXPECT_NEAR(sum, 1, 1e-13);
      }
    for (std::size_t row = 0; row < refined.vertices.size(); ++row)
      for (const Weights* weights :
           {&refined.t1, &refined.t2}) {  // differences: a tangent does not move with the surface
        double sum = 0, largest = 0;
        for (const double value : weights->values_of(row)) {
          sum += value;
          largest = std::max(largest, std::abs(value));
        }
        EXPECT_GT(largest, 0);
        EXPECT_LT(std::abs(sum), 1e-11 * std::max(largest, 1e-3)) << row;
      }
  }
}

TEST(Weights, KeepSharpEdgesWhereTheyAre) {
  Mesh cube = cages::cube();
  for (const Edge& edge : level_zero(cube.cage).topology.edges)
    cube.cage.sharp_edges.push_back({edge.points, kInfinite});
  const Refined refined = refine_to_limit(cube.cage, 3);
  for (std::size_t row = 0; row < refined.vertices.size(); ++row) {
    const Point at = cages::weigh(refined.limits, refined.vertices[row], cube.points);
    const Point normal = cages::unit(normal_of(refined, row, cube.points));
    // A cube all of whose edges are sharp is that cube: every place on a face, with a normal for each face it is on.
    EXPECT_NEAR(std::max({std::abs(at[0]), std::abs(at[1]), std::abs(at[2])}), 1, 1e-13);
    EXPECT_NEAR(std::max({std::abs(normal[0]), std::abs(normal[1]), std::abs(normal[2])}), 1, 1e-12);
    EXPECT_NEAR(cages::dot(at, normal), 1, 1e-12);
  }
}

TEST(Weights, RefuseWhatIsNoManifold) {
  const auto reason = [](std::vector<Index> sizes, std::vector<Index> corners, Index points) -> std::string {
    try {
      const Topology topology(points, std::move(sizes), std::move(corners));
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return {};
  };
  EXPECT_EQ(reason({3, 3, 3}, {0, 1, 2, 1, 0, 3, 0, 1, 4}, 5), "an edge of 3 faces between points 0 and 1");
  EXPECT_EQ(reason({3, 3}, {0, 1, 2, 0, 1, 3}, 4),
            "two faces turned against each other, or one twice, share the edge between points 0 and 1");
  EXPECT_EQ(reason({3, 3}, {0, 1, 2, 0, 3, 4}, 5), "faces meet at point 0 alone, in more than one fan");
  EXPECT_EQ(reason({3, 3}, {0, 1, 2, 0, 1, 2}, 3),
            "two faces turned against each other, or one twice, share the edge between points 0 and 1");
  EXPECT_EQ(reason({3}, {0, 1, 1}, 2), "face 0 has a corner twice");
  EXPECT_EQ(reason({2}, {0, 1}, 2), "face 0 has fewer than three corners");
  EXPECT_EQ(reason({4}, {0, 1, 2, 3}, 4), "");
}

TEST(Weights, OfAnythingThatIsNoManifoldEndInAReason) {
  std::mt19937 random(7);
  int refused = 0;
  for (int trial = 0; trial < 10000; ++trial) {
    Cage cage;
    const auto below = [&](unsigned most) { return static_cast<Index>(random() % most); };
    cage.point_count = 3 + below(6);
    for (Index f = 0, count = 1 + below(6); f < count; ++f) {
      cage.face_sizes.push_back(3 + below(3));
      for (Index i = 0; i < cage.face_sizes.back(); ++i) cage.corners.push_back(below(cage.point_count));
    }
    try {
      (void)refine_to_limit(cage, 1);
    } catch (const std::invalid_argument&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 5000);
  EXPECT_LT(refused, 10000);
}

}  // namespace
