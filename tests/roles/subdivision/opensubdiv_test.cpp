// SPDX-License-Identifier: Apache-2.0
// The same cages through OpenSubdiv, which others wrote: places after uniform refinement, limits and normals.
#include "cages.hpp"

#include <opensubdiv/far/primvarRefiner.h>
#include <opensubdiv/far/topologyDescriptor.h>
#include <opensubdiv/far/topologyRefinerFactory.h>

#include <gtest/gtest.h>

#include <memory>

namespace {

using namespace heddle::catmull_clark;
using cages::Mesh;
using cages::Point;
namespace Far = OpenSubdiv::Far;
namespace Sdc = OpenSubdiv::Sdc;

/// What the library interpolates.
struct Value {
  Point at{};
  void Clear() { at = {}; }
  void AddWithWeight(const Value& from, double weight) {
    for (std::size_t k = 0; k < 3; ++k) at[k] += weight * from.at[k];
  }
};

struct Theirs {
  std::vector<Value> places, limits, t1, t2;
};

Theirs refine_theirs(const Mesh& mesh, int levels) {
  std::vector<int> sizes, corners, creases, sharp_points;
  std::vector<float> crease_weights, point_weights;
  for (const Index size : mesh.cage.face_sizes) sizes.push_back(static_cast<int>(size));
  for (const Index corner : mesh.cage.corners) corners.push_back(static_cast<int>(corner));
  for (const auto& [points, sharpness] : mesh.cage.sharp_edges) {
    for (const Index point : points) creases.push_back(static_cast<int>(point));
    crease_weights.push_back(static_cast<float>(sharpness));
  }
  for (const auto& [point, sharpness] : mesh.cage.sharp_points) {
    sharp_points.push_back(static_cast<int>(point));
    point_weights.push_back(static_cast<float>(sharpness));
  }
  Far::TopologyDescriptor descriptor;
  descriptor.numVertices = static_cast<int>(mesh.points.size());
  descriptor.numFaces = static_cast<int>(sizes.size());
  descriptor.numVertsPerFace = sizes.data();
  descriptor.vertIndicesPerFace = corners.data();
  descriptor.numCreases = static_cast<int>(crease_weights.size());
  descriptor.creaseVertexIndexPairs = creases.data();
  descriptor.creaseWeights = crease_weights.data();
  descriptor.numCorners = static_cast<int>(point_weights.size());
  descriptor.cornerVertexIndices = sharp_points.data();
  descriptor.cornerWeights = point_weights.data();
  Sdc::Options options;
  options.SetVtxBoundaryInterpolation(mesh.cage.pins_corners ? Sdc::Options::VTX_BOUNDARY_EDGE_AND_CORNER
                                                             : Sdc::Options::VTX_BOUNDARY_EDGE_ONLY);
  using Factory = Far::TopologyRefinerFactory<Far::TopologyDescriptor>;
  const std::unique_ptr<Far::TopologyRefiner> refiner(
      Factory::Create(descriptor, Factory::Options(Sdc::SCHEME_CATMARK, options)));
  Far::TopologyRefiner::UniformOptions uniform(levels);
  uniform.fullTopologyInLastLevel = true;
  refiner->RefineUniform(uniform);
  const Far::PrimvarRefinerReal<double> primvars(*refiner);
  std::vector<Value> values(mesh.points.size());
  for (std::size_t i = 0; i < values.size(); ++i) values[i].at = mesh.points[i];
  for (int level = 1; level <= levels; ++level) {
    std::vector<Value> next(static_cast<std::size_t>(refiner->GetLevel(level).GetNumVertices()));
    primvars.Interpolate(level, values, next);
    values = std::move(next);
  }
  Theirs theirs{values, std::vector<Value>(values.size()), std::vector<Value>(values.size()),
                std::vector<Value>(values.size())};
  primvars.Limit(values, theirs.limits, theirs.t1, theirs.t2);
  return theirs;
}

struct Agreement {
  double place = 0, limit = 0, normal = 0;
  std::size_t limits = 0, normals = 0;
};

/// Their vertices come in another order: each of ours is compared with the nearest of theirs.
Agreement compare(const Mesh& mesh, int levels) {
  Level level = level_zero(mesh.cage);
  for (int i = 0; i < levels; ++i) level = refine(level, mesh.cage.point_count);
  const Refined ours = take_limits(level, mesh.cage.point_count);
  const Theirs theirs = refine_theirs(mesh, levels);
  EXPECT_EQ(ours.positions.count(), theirs.places.size());
  Agreement agreement;
  std::vector<std::size_t> rows_of(ours.positions.count(), 0), row_of(ours.positions.count(), 0);
  for (std::size_t row = 0; row < ours.vertices.size(); ++row) {
    ++rows_of[ours.vertices[row]];
    row_of[ours.vertices[row]] = row;
  }
  for (Index v = 0; v < ours.positions.count(); ++v) {
    const Point place = cages::weigh(ours.positions, v, mesh.points);
    std::size_t nearest = 0;
    for (std::size_t i = 1; i < theirs.places.size(); ++i)
      if (cages::distance(place, theirs.places[i].at) < cages::distance(place, theirs.places[nearest].at)) nearest = i;
    agreement.place = std::max(agreement.place, cages::distance(place, theirs.places[nearest].at));
    const Fan fan = level.topology.fan(v);
    std::size_t sharp = 0;
    for (const Index edge : fan.edges) sharp += level.topology.edges[edge].sharpness > 0 ? 1 : 0;
    // Where a sharp edge ends they take the limit of a smooth point, which it is not.
    if (fan.faces.empty() || sharp == 1) continue;
    agreement.limit = std::max(agreement.limit,
                               cages::distance(cages::weigh(ours.limits, v, mesh.points), theirs.limits[nearest].at));
    ++agreement.limits;
    // Of a curve or corner they give one side's tangents, of what has no tangent plane any; and on borders between
    // three faces normals that are others from every level, which the next test shows.
    const bool has_plane = fan.is_closed ? sharp == 0 : fan.faces.size() == 2 && sharp == 2;
    const bool is_pinned = level.point_sharpness[v] > 0;
    if (rows_of[v] != 1 || !has_plane || is_pinned || (!fan.is_closed && fan.faces.size() == 1)) continue;
    const Point normal =
        cages::cross(cages::weigh(ours.t1, row_of[v], mesh.points), cages::weigh(ours.t2, row_of[v], mesh.points));
    const Point other = cages::cross(theirs.t1[nearest].at, theirs.t2[nearest].at);
    agreement.normal = std::max(agreement.normal, cages::distance(cages::unit(normal), cages::unit(other)));
    ++agreement.normals;
  }
  return agreement;
}

void expect_agreement(const Mesh& mesh, int levels, const std::string& what, double tolerance = 1e-13) {
  const Agreement agreement = compare(mesh, levels);
  EXPECT_LT(agreement.place, tolerance) << what;
  EXPECT_LT(agreement.limit, tolerance) << what;
  EXPECT_LT(agreement.normal, 10 * tolerance) << what;
  EXPECT_GT(agreement.limits, 8U) << what;
  EXPECT_GT(agreement.normals, 8U) << what;
}

TEST(OpenSubdiv, AgreesOnSmoothCages) {
  expect_agreement(cages::cube(), 3, "cube");
  expect_agreement(cages::box(3), 2, "box");
  expect_agreement(cages::torus(6, 5), 2, "torus");
  for (const int n : {3, 5, 8, 12}) expect_agreement(cages::fan(n), 2, "valence " + std::to_string(n));
}

TEST(OpenSubdiv, AgreesOnBorders) {
  for (const bool pins : {true, false})
    for (const int k : {2, 3, 4}) {
      Mesh mesh = cages::fan(k, false);
      mesh.cage.pins_corners = pins;
      expect_agreement(mesh, 2, "border of faces " + std::to_string(k));
    }
}

TEST(OpenSubdiv, HasOtherNormalsOnBordersOfThreeFacesFromEveryLevel) {
  const Mesh mesh = cages::fan(3, false);
  std::vector<Point> theirs;
  for (int level = 1; level <= 3; ++level) {
    const Theirs refined = refine_theirs(mesh, level);
    const Point limit = cages::weigh(refine_to_limit(mesh.cage, 1).limits, 0, mesh.points);
    for (std::size_t i = 0; i < refined.limits.size(); ++i)
      if (cages::distance(refined.limits[i].at, limit) < 1e-12)
        theirs.push_back(cages::unit(cages::cross(refined.t1[i].at, refined.t2[i].at)));
  }
  ASSERT_EQ(theirs.size(), 3U);
  EXPECT_GT(cages::distance(theirs[0], theirs[1]), 1e-4);
  EXPECT_GT(cages::distance(theirs[1], theirs[2]), 1e-4);
}

TEST(OpenSubdiv, AgreesOnTrianglesAndPolygons) {
  Mesh prism;
  const Index n = 7;
  for (Index i = 0; i < n; ++i)
    for (const double y : {-1.0, 1.0})
      prism.points.push_back({std::cos(6.28318530718 * i / n), y, -std::sin(6.28318530718 * i / n)});
  for (Index i = 0; i < n; ++i) {
    const Index j = (i + 1) % n;
    prism.add_face({2 * i, 2 * j, 2 * j + 1, 2 * i + 1});
  }
  prism.cage.face_sizes.push_back(n);
  for (Index i = 0; i < n; ++i) prism.cage.corners.push_back(2 * i + 1);
  for (Index i = 1; i + 1 < n; ++i) prism.add_face({0, 2 * (i + 1), 2 * i});
  prism.finish();
  expect_agreement(prism, 2, "prism with a lid of triangles");
}

TEST(OpenSubdiv, AgreesOnSharpness) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 12; ++trial) {
    Mesh mesh = trial % 2 == 0 ? cages::box(2) : cages::fan(5);
    // Whole numbers of levels and fractions, all over by level 3 or never.
    constexpr std::array kSharpness{0.25, 0.5, 1.0, 1.75, 2.0, kInfinite};
    for (const Edge& edge : level_zero(mesh.cage).topology.edges)
      if (random() % 4 == 0)
        mesh.cage.sharp_edges.push_back({edge.points, kSharpness.at(random() % kSharpness.size())});
    if (trial % 3 == 0) mesh.cage.sharp_points.emplace_back(0U, kSharpness.at(random() % kSharpness.size()));
    expect_agreement(mesh, 3, "trial " + std::to_string(trial), 1e-8);  // they average sharpness in float32
  }
}

}  // namespace
