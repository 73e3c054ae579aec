// SPDX-License-Identifier: Apache-2.0
// A snapshot's triangles -> hits of Embree's, with their places in float64.
#pragma once

#include "embree_triangles.hpp"

#include <heddle/plugin.h>

#include <glm/glm.hpp>

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace heddle::path_tracer {

struct Ray {
  glm::dvec3 origin{0.0}, direction{0.0};  // unit
  double length = std::numeric_limits<double>::infinity();
};

struct Hit {
  std::uint32_t triangle = 0;
  double u = 0.0, v = 0.0;  // weights of the second and third corner
  double distance = 0.0;
};

/// Where a ray can start on a triangle's surface.
struct Foot {
  glm::dvec3 position{0.0};  // on the float64 plane of the triangle
  glm::dvec3 facet{0.0};     // unit, towards the front
  double area = 0.0;
  double lift = 0.0;  // metres off the plane at which float32 rays do not meet the triangle any more
  [[nodiscard]] glm::dvec3 above(double side) const { return position + facet * (side * lift); }
};

/// One question to Embree, as it was asked.
struct Query {
  enum Kind : std::uint32_t { kNearestSolid, kNearestBlended, kBlocked };
  std::array<float, 3> origin, direction;
  float length;
  Kind kind;
};

/// What one thread asked, in order.
struct Queries {
  std::vector<Query> list;
  std::uint64_t hits = 0;
};

/// Embree scenes of what is solid (masks with their holes) and of what is blended. Tracing: [any-thread].
class Geometry {
 public:
  Geometry();
  ~Geometry();
  Geometry(const Geometry&) = delete;
  Geometry& operator=(const Geometry&) = delete;

  /// Copies what it needs, unless it is of this revision already. False: error() says why.
  [[nodiscard]] bool update(const heddle_snapshot& snapshot);
  [[nodiscard]] const char* error() const { return error_.text; }
  /// For the masked triangles, while `snapshot` lives.
  void set_alpha_test(const heddle_snapshot* snapshot, heddle_alpha_test test) {
    snapshot_ = snapshot;
    test_ = test;
  }

  // `record`: takes what Embree was asked; nullptr: nobody wants to know.
  /// The first hit, blended surfaces too; false: none.
  [[nodiscard]] bool find_nearest(const Ray& ray, Hit& out, Queries* record) const;
  /// The first blended surface on the way; false: none.
  [[nodiscard]] bool find_blended(const Ray& ray, Hit& out, Queries* record) const;
  /// True if something solid is on the way.
  [[nodiscard]] bool is_blocked(const Ray& ray, Queries* record) const;
  /// Asks Embree all of it again, and nothing else; how many hits there are.
  [[nodiscard]] std::uint64_t replay(std::span<const Query> queries) const;
  [[nodiscard]] bool has_blended() const { return blended_.scene != nullptr; }

  [[nodiscard]] Foot foot(std::uint32_t triangle, double u, double v) const;
  [[nodiscard]] const glm::uvec3& corners(std::uint32_t triangle) const { return indices_[triangle]; }
  [[nodiscard]] std::uint32_t triangle_count() const { return static_cast<std::uint32_t>(indices_.size()); }

 private:
  struct Part {
    RTCScene scene = nullptr;
    std::vector<std::vector<std::uint32_t>> triangles;  // by geometry: Embree's primitives
  };
  void release(Part& part);
  void build(Part& part, RTCBuffer vertices, std::vector<std::vector<std::uint32_t>> triangles, std::size_t masked);
  static void filter(const RTCFilterFunctionNArguments* arguments);
  bool find(const Part& part, const Ray& ray, Hit& out, Query::Kind kind, Queries* record) const;

  RTCDevice device_ = nullptr;
  Part solid_, blended_;
  std::vector<glm::vec3> positions_;
  std::vector<glm::uvec3> indices_;
  /// Of a triangle, without regard to a place on it.
  struct Plane {
    glm::dvec3 facet;
    double area, lift;
  };
  std::vector<Plane> planes_;
  std::uint64_t revision_ = 0;
  bool is_built_ = false;
  const heddle_snapshot* snapshot_ = nullptr;
  heddle_alpha_test test_ = nullptr;
  embree::ErrorText error_;
};

}  // namespace heddle::path_tracer
