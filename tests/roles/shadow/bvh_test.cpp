// SPDX-License-Identifier: Apache-2.0
// bvh.glsl and owen_sobol.glsl, compiled here as C++ (glm; literals are float by a compiler option, as in GLSL), over
// trees of bvh.hpp, against every triangle in float64 and against Embree's own rays. Needs no device.
#include "bvh.hpp"
#include "shared/owen_sobol.hpp"

#include <glm/glm.hpp>
#include <glm/gtc/integer.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace glsl {
using namespace glm;
using uint = unsigned int;
#define precise
#include "shared/bvh.glsl"
#include "shared/owen_sobol.glsl"
#undef precise
}  // namespace glsl

namespace {

using glm::dvec3;
using glm::vec3;

// With literals float by option, these are double.
constexpr double operator""_d(long double value) {
  return static_cast<double>(value);
}
constexpr double operator""_d(unsigned long long value) {
  return static_cast<double>(value);
}

using Corners = std::array<vec3, 3>;

struct Mesh {
  std::vector<Corners> triangles;
  bvh::Tree tree;

  void build() {
    std::vector<bvh::Box> boxes;
    for (const Corners& c : triangles) {
      const vec3 low = glm::min(c[0], glm::min(c[1], c[2])), high = glm::max(c[0], glm::max(c[1], c[2]));
      boxes.push_back({{low.x, low.y, low.z}, {high.x, high.y, high.z}});
    }
    bvh::Builder builder;
    ASSERT_TRUE(builder.build(boxes, tree)) << builder.error();
  }
};

vec3 vec_of(const std::array<float, 3>& v) {
  return {v[0], v[1], v[2]};
}

/// As ray_traced.glsl walks; `steps`: nodes and triangles.
bool is_blocked(const Mesh& mesh, const vec3& origin, const vec3& direction, float reach, float uncertain,
                std::size_t& steps) {
  const glsl::BvhRay ray = glsl::bvh_ray(origin, direction, reach);
  for (std::size_t node = 0; node < mesh.tree.nodes.size(); ++steps) {
    const bvh::Node& at = mesh.tree.nodes[node];
    if (!glsl::bvh_meets_box(ray, vec_of(at.low), vec_of(at.high))) {
      node = at.escape;
      continue;
    }
    for (std::uint32_t i = at.leaf >> 3U; i < (at.leaf >> 3U) + (at.leaf & 7U); ++i, ++steps) {
      const Corners& c = mesh.triangles[mesh.tree.order[i]];
      if (glsl::bvh_meet_triangle(ray, c[0], c[1], c[2], uncertain).is_hit) return true;
    }
    ++node;
  }
  return false;
}

enum class Truth { kFree, kBlocked, kNeither };

/// Every triangle, in float64: neither where a ray passes an edge, or meets a triangle near its origin or end, by less
/// than `margin` metres.
Truth truth_of(const Mesh& mesh, const dvec3& origin, const dvec3& direction, double reach, double margin) {
  bool is_near = false;
  for (const Corners& c : mesh.triangles) {
    const dvec3 a(c[0]), b(c[1]), d(c[2]), n = glm::cross(b - a, d - a);
    const double slope = glm::dot(n, direction);
    const double t = slope != 0_d ? glm::dot(n, a - origin) / slope : -1_d;
    // How far inside of each edge's plane along the ray, metres.
    double inside = 1e30_d;
    for (int k = 0; k < 3; ++k) {
      const dvec3 p = dvec3(c[std::size_t(k)]) - origin, q = dvec3(c[std::size_t((k + 1) % 3)]) - origin;
      const dvec3 edge = glm::cross(q - p, direction);
      const double length = glm::length(edge);
      if (length == 0_d) return Truth::kNeither;
      inside = std::min(inside, glm::dot(edge, p) / length * (slope < 0_d ? -1_d : 1_d));
    }
    // A grazing plane's distance is uncertain by the margin over the cosine.
    const double along = margin * glm::length(n) / std::max(std::abs(slope), 1e-30_d);
    if (inside > margin && t > along && t < reach - along) return Truth::kBlocked;
    is_near |= inside > -margin && t > -along && t < reach + along;
  }
  return is_near ? Truth::kNeither : Truth::kFree;
}

vec3 random_in_cube(std::mt19937& random, float half) {
  std::uniform_real_distribution<float> even(-half, half);
  const float x = even(random), y = even(random);
  return {x, y, even(random)};
}
vec3 random_direction(std::mt19937& random) {
  for (;;) {
    const vec3 v = random_in_cube(random, 1.0f);
    if (glm::dot(v, v) > 0.01f && glm::dot(v, v) < 1.0f) return glm::normalize(v);
  }
}

Mesh soup(std::uint32_t count, float size, const vec3& centre, std::uint32_t seed) {
  std::mt19937 random(seed);
  Mesh mesh;
  for (std::uint32_t i = 0; i < count; ++i) {
    const vec3 at = centre + random_in_cube(random, 10.0f);
    mesh.triangles.push_back({at, at + random_in_cube(random, size), at + random_in_cube(random, size)});
  }
  mesh.build();
  return mesh;
}

Mesh sphere(float radius, const vec3& centre, int rings) {
  const auto point = [&](int i, int j) {
    const float theta = float(3.14159265358979324) * float(i) / float(rings);
    const float phi = float(3.14159265358979324) * float(j % (2 * rings)) / float(rings);
    // The poles are one point each.
    const float across = i == 0 || i == rings ? 0.0f : std::sin(theta);
    return centre + radius * vec3(across * std::cos(phi), i == rings ? -1.0f : std::cos(theta), across * std::sin(phi));
  };
  Mesh mesh;
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < 2 * rings; ++j) {
      if (i > 0) mesh.triangles.push_back({point(i, j), point(i, j + 1), point(i + 1, j)});
      if (i + 1 < rings) mesh.triangles.push_back({point(i, j + 1), point(i + 1, j + 1), point(i + 1, j)});
    }
  }
  mesh.build();
  return mesh;
}

/// Embree's own robust rays over the same triangles.
class Embree {
 public:
  explicit Embree(const Mesh& mesh) : device_(rtcNewDevice(nullptr)), scene_(rtcNewScene(device_)) {
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    const std::size_t count = mesh.triangles.size();
    auto* vertices = static_cast<vec3*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(vec3), 3 * count));
    auto* indices = static_cast<std::uint32_t*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, count));
    for (std::size_t i = 0; i < 3 * count; ++i) {
      vertices[i] = mesh.triangles[i / 3][i % 3];
      indices[i] = static_cast<std::uint32_t>(i);
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene_);
  }
  ~Embree() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  Embree(const Embree&) = delete;
  Embree& operator=(const Embree&) = delete;
  [[nodiscard]] bool is_blocked(const vec3& origin, const vec3& direction, float reach) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRay ray{};
    ray.org_x = origin.x;
    ray.org_y = origin.y;
    ray.org_z = origin.z;
    ray.dir_x = direction.x;
    ray.dir_y = direction.y;
    ray.dir_z = direction.z;
    ray.tfar = reach;
    ray.mask = ~0U;
    rtcOccluded1(scene_, &context, &ray);
    return ray.tfar < 0.0f;
  }

 private:
  RTCDevice device_;
  RTCScene scene_;
};

TEST(Bvh, HoldsEveryTriangleOnceWithinItsBoxes) {
  for (const std::uint32_t count : {1U, 2U, 5U, 1000U}) {
    const Mesh mesh = soup(count, 1.0f, vec3(0.0f), count);
    ASSERT_EQ(mesh.tree.order.size(), count);
    std::vector<std::uint32_t> sorted = mesh.tree.order;
    std::sort(sorted.begin(), sorted.end());
    for (std::uint32_t i = 0; i < count; ++i) EXPECT_EQ(sorted[i], i);
    std::uint32_t next = 0;
    for (std::size_t i = 0; i < mesh.tree.nodes.size(); ++i) {
      const bvh::Node& node = mesh.tree.nodes[i];
      EXPECT_GT(node.escape, i);
      EXPECT_LE(node.escape, mesh.tree.nodes.size());
      if (node.leaf == 0) continue;
      EXPECT_EQ(node.escape, i + 1);
      EXPECT_EQ(node.leaf >> 3U, next);
      next += node.leaf & 7U;
      EXPECT_LE(node.leaf & 7U, bvh::kMostInLeaf);
      for (std::uint32_t k = node.leaf >> 3U; k < next; ++k) {
        for (const vec3& corner : mesh.triangles[mesh.tree.order[k]]) {
          EXPECT_TRUE(glm::all(glm::lessThanEqual(vec_of(node.low), corner)) &&
                      glm::all(glm::lessThanEqual(corner, vec_of(node.high))));
        }
      }
    }
    EXPECT_EQ(next, count);
  }
  const Mesh none = soup(0, 1.0f, vec3(0.0f), 1);
  EXPECT_TRUE(none.tree.nodes.empty());
}

TEST(Bvh, IsTheSameTreeEachTime) {
  const Mesh one = soup(5000, 0.5f, vec3(0.0f), 3), other = soup(5000, 0.5f, vec3(0.0f), 3);
  EXPECT_EQ(one.tree.order, other.tree.order);
}

TEST(Bvh, RaysAgreeWithFloat64AndWithEmbreeButForEdges) {
  struct Case {
    const char* name;
    float size;
    vec3 centre;
  };
  for (const Case& one : {Case{"small", 1.5f, vec3(0.0f)}, Case{"needles and plates", 20.0f, vec3(0.0f)},
                          Case{"a kilometre away", 1.5f, vec3(1e3f, 0.0f, -1e3f)}}) {
    SCOPED_TRACE(one.name);
    const Mesh mesh = soup(one.size > 2.0f ? 60 : 600, one.size, one.centre, 11);
    const Embree embree(mesh);
    std::mt19937 random(5);
    // Roundings of coordinates as large as these, a few of them.
    const double margin = 16_d * 0x1p-24 * (double(glm::length(one.centre)) + 30_d);
    int blocked = 0, neither = 0, wrong = 0, embree_wrong = 0, differ = 0;
    constexpr int kRays = 6000;
    std::size_t steps = 0;
    for (int i = 0; i < kRays; ++i) {
      const vec3 origin = one.centre + random_in_cube(random, 12.0f), direction = random_direction(random);
      const float reach = i % 3 == 0 ? 5.0f : 1e3f;
      const bool got = is_blocked(mesh, origin, direction, reach, 0.0f, steps);
      const bool theirs = embree.is_blocked(origin, direction, reach);
      const Truth truth = truth_of(mesh, dvec3(origin), dvec3(direction), double(reach), margin);
      differ += got != theirs;
      if (truth == Truth::kNeither) {
        ++neither;
        continue;
      }
      blocked += got;
      wrong += got != (truth == Truth::kBlocked);
      embree_wrong += theirs != (truth == Truth::kBlocked);
    }
    std::printf("  %s: of %d rays %d blocked, %d near an edge, %d unlike Embree, %.0f steps a ray\n", one.name, kRays,
                blocked, neither, differ, double(steps) / double(kRays));
    EXPECT_EQ(wrong, 0);
    EXPECT_EQ(embree_wrong, 0) << "then the margin, not the walk, is wrong";
    EXPECT_LE(differ, neither);
    EXPECT_GT(blocked, kRays / 20);
    EXPECT_LT(neither, kRays / 20);
  }
}

TEST(Bvh, NoRayLeavesAClosedMeshThroughItsEdges) {
  for (const vec3& centre : {vec3(0.0f), vec3(1000.0f, -300.0f, 77.0f)}) {
    const Mesh mesh = sphere(1.0f, centre, 24);
    std::mt19937 random(9);
    std::size_t steps = 0;
    int free = 0;
    for (const Corners& c : mesh.triangles) {
      const vec3 origin = centre + random_in_cube(random, 0.3f);
      // At corners and at points of edges, as float32 has them.
      for (const vec3& to : {c[0], 0.5f * (c[0] + c[1]), c[1] + 0.3f * (c[2] - c[1])}) {
        if (glm::length(to - origin) < 0.01f) continue;
        free += !is_blocked(mesh, origin, glm::normalize(to - origin), 10.0f, 0.0f, steps);
      }
    }
    EXPECT_EQ(free, 0);
  }
}

TEST(Bvh, NothingShadowsTheTriangleItLiesOn) {
  // Points of triangles of any size and place, rounded to float32 and moved off by what that rounds, as the technique
  // does: rays away from them meet nothing. Without the bound of rounding they do.
  std::mt19937 random(21);
  int met = 0, met_without = 0, rays = 0;
  for (const float size : {0.01f, 1.0f, 1e4f}) {
    for (const float far : {0.0f, 1e3f, 1e5f}) {
      for (int i = 0; i < 300; ++i) {
        const vec3 at = random_in_cube(random, 1.0f) * far;
        const Corners c = {at, at + random_in_cube(random, size), at + random_in_cube(random, size)};
        const dvec3 exact = glm::cross(dvec3(c[1]) - dvec3(c[0]), dvec3(c[2]) - dvec3(c[0]));
        if (glm::length(exact) < 0.05_d * double(size) * double(size)) continue;
        const dvec3 normal = glm::normalize(exact);
        float largest = 0;
        for (const vec3& p : c) largest = std::max(largest, glsl::bvh_largest(p.x, p.y, p.z));
        std::uniform_real_distribution<float> even(0.0f, 1.0f);
        for (int k = 0; k < 20; ++k) {
          const float u = even(random), v = (1.0f - u) * even(random);
          const dvec3 on =
              dvec3(c[0]) + double(u) * (dvec3(c[1]) - dvec3(c[0])) + double(v) * (dvec3(c[2]) - dvec3(c[0]));
          const double lift = 8_d * 0x1p-24 * std::max({std::abs(on.x), std::abs(on.y), std::abs(on.z)});
          const vec3 origin(on + lift * normal);
          vec3 direction = random_direction(random);
          if (glm::dot(dvec3(direction), normal) < 0_d) direction = -direction;
          if (glm::dot(dvec3(direction), normal) < 0.02_d) continue;
          ++rays;
          const glsl::BvhRay ray = glsl::bvh_ray(origin, direction, 1e6f);
          const float uncertain = 8.0f * 0x1p-24f * largest;
          met += glsl::bvh_meet_triangle(ray, c[0], c[1], c[2], uncertain).is_hit;
          const glsl::BvhHit plain =
              glsl::bvh_meet_triangle(glsl::bvh_ray(vec3(on), direction, 1e6f), c[0], c[1], c[2], 0);
          met_without += plain.is_hit;
        }
      }
    }
  }
  std::printf("  of %d rays %d meet their own triangle, without lift and corners' rounding %d\n", rays, met,
              met_without);
  EXPECT_EQ(met, 0);
  EXPECT_GT(met_without, 0) << "the test proves nothing";
  EXPECT_GT(rays, 10000);
}

TEST(Bvh, ThinObstaclesNearTheOriginAreMetAllTheSame) {
  // A plate 1 mm off a floor of 20 km: the floor's own uncertainty must not hide it.
  const float h = 1e4f;
  Mesh mesh;
  mesh.triangles = {{vec3(-h, 0, -h), vec3(-h, 0, h), vec3(h, 0, h)},
                    {vec3(-h, 0, -h), vec3(h, 0, h), vec3(h, 0, -h)},
                    {vec3(-1, 0.001f, -1), vec3(-1, 0.001f, 1), vec3(1, 0.001f, 0)}};
  mesh.build();
  const float uncertain_floor = 8.0f * 0x1p-24f * h;
  EXPECT_GT(uncertain_floor, 0.001f);
  const glsl::BvhRay ray = glsl::bvh_ray(vec3(0, 1e-5f, 0), glm::normalize(vec3(0.1f, 1.0f, 0.0f)), 100.0f);
  int met = 0;
  for (const Corners& c : mesh.triangles) {
    float largest = 0;
    for (const vec3& p : c) largest = std::max(largest, glsl::bvh_largest(p.x, p.y, p.z));
    met += glsl::bvh_meet_triangle(ray, c[0], c[1], c[2], 8.0f * 0x1p-24f * largest).is_hit;
  }
  EXPECT_EQ(met, 1);
}

TEST(OwenSobol, IsTheSequenceOfTheReferenceBeforeScrambling) {
  // Direction numbers of the second dimension, one by one.
  std::mt19937 random(2);
  for (int n = 0; n < 2000; ++n) {
    const std::uint32_t index = n < 64 ? static_cast<std::uint32_t>(n) : static_cast<std::uint32_t>(random());
    std::uint32_t expected = 0;
    for (std::uint32_t bits = index, v = 1U << 31U; bits != 0; bits >>= 1U, v ^= v >> 1U) {
      expected ^= (bits & 1U) != 0 ? v : 0U;
    }
    EXPECT_EQ(glsl::sobol_second(index), expected) << index;
    const std::uint32_t seed = static_cast<std::uint32_t>(random());
    EXPECT_EQ(glsl::scramble_owen(index, seed), sampling::scramble_owen(index, seed));
  }
}

TEST(OwenSobol, PowersOfTwoFillEveryElementaryBoxOnce) {
  for (const glm::uvec2 seed : {glm::uvec2(1, 2), glm::uvec2(0xdeadbeefU, 77)}) {
    for (int bits = 0; bits <= 8; ++bits) {
      std::vector<int> hits(256, 0);
      for (std::uint32_t i = 0; i < 256; ++i) {
        const glm::vec2 p = glsl::owen_sobol_point(i, seed);
        const int x = static_cast<int>(p.x * float(1 << bits)), y = static_cast<int>(p.y * float(1 << (8 - bits)));
        ++hits[static_cast<std::size_t>(y * (1 << bits) + x)];
      }
      for (const int hit : hits) EXPECT_EQ(hit, 1);
    }
  }
}

}  // namespace
