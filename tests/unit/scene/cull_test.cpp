// SPDX-License-Identifier: Apache-2.0
// Culling never takes away what a pixel could show: instances that were left out are clipped triangle by triangle, in
// float64 and as the vertex shader places them in float32, and nothing may remain.
#include "scene/cull.hpp"

#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace heddle::scene {
namespace {

/// What is left of a polygon in homogeneous coordinates within the clip volume (Sutherland and Hodgman 1974).
std::vector<glm::dvec4> clip(std::vector<glm::dvec4> polygon) {
  for (int plane = 0; plane < 6; ++plane) {
    const auto inside = [&](const glm::dvec4& p) {
      switch (plane) {
        case 0:
          return p.w + p.x;
        case 1:
          return p.w - p.x;
        case 2:
          return p.w + p.y;
        case 3:
          return p.w - p.y;
        case 4:
          return p.z;
        default:
          return p.w - p.z;
      }
    };
    std::vector<glm::dvec4> kept;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const glm::dvec4 a = polygon[i], b = polygon[(i + 1) % polygon.size()];
      const double da = inside(a), db = inside(b);
      if (da >= 0) kept.push_back(a);
      if ((da >= 0) != (db >= 0)) kept.push_back(a + (b - a) * (da / (da - db)));
    }
    polygon = std::move(kept);
  }
  return polygon;
}

/// A matrix times a vector as shaders do it: float32, column by column.
std::array<float, 4> multiply(const float (&m)[16], const std::array<float, 4>& v) {
  std::array<float, 4> out{};
  for (std::size_t row = 0; row < 4; ++row) {
    float sum = m[row] * v[0];
    for (std::size_t column = 1; column < 4; ++column) sum += m[4 * column + row] * v[column];
    out[row] = sum;
  }
  return out;
}

glm::dvec4 multiply_exactly(const float (&m)[16], const glm::dvec4& v) {
  glm::dvec4 out(0.0);
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) out[row] += static_cast<double>(m[4 * column + row]) * v[column];
  return out;
}

void store(const glm::dmat4& matrix, float (&out)[16]) {
  for (int i = 0; i < 16; ++i) out[i] = static_cast<float>(matrix[i / 4][i % 4]);
}

struct Shape {
  std::vector<glm::vec3> positions;  // three a triangle
  std::array<glm::vec3, 2> bounds{};
  HeddleInstance instance{};

  void bound() {
    bounds = {positions[0], positions[0]};
    for (const glm::vec3& p : positions) bounds = {glm::min(bounds[0], p), glm::max(bounds[1], p)};
  }
  [[nodiscard]] bool is_seen(const HeddleView& view, bool as_shader) const {
    for (std::size_t i = 0; i + 2 < positions.size(); i += 3) {
      std::vector<glm::dvec4> triangle;
      for (std::size_t k = 0; k < 3; ++k) {
        const glm::vec3& p = positions[i + k];
        if (as_shader) {
          std::array<float, 4> rel = multiply(instance.rel_from_object, {p.x, p.y, p.z, 1.0F});
          rel[3] = 1.0F;
          const std::array<float, 4> c = multiply(view.clip_from_rel, rel);
          triangle.emplace_back(c[0], c[1], c[2], c[3]);
        } else {
          const glm::dvec4 rel = multiply_exactly(instance.rel_from_object, glm::dvec4(glm::dvec3(p), 1.0));
          triangle.push_back(multiply_exactly(view.clip_from_rel, rel));
        }
      }
      if (!clip(std::move(triangle)).empty()) return true;
    }
    return false;
  }
};

class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_()) / 4294967296.0);
  }
  double log_uniform(double low, double high) { return std::exp(uniform(std::log(low), std::log(high))); }
  glm::dvec3 vector(double size) { return {uniform(-size, size), uniform(-size, size), uniform(-size, size)}; }
  glm::dquat rotation() {
    const glm::dquat q(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    return glm::length(q) > 0.01 ? glm::normalize(q) : glm::dquat(1, 0, 0, 0);
  }

 private:
  std::mt19937 engine_;
};

heddle_camera random_camera(Random& random, const glm::dvec3& position) {
  heddle_camera camera{};
  camera.struct_size = sizeof camera;
  const glm::dquat q = random.rotation();
  for (int i = 0; i < 3; ++i) camera.position[i] = position[i];
  camera.rotation[0] = q.x;
  camera.rotation[1] = q.y;
  camera.rotation[2] = q.z;
  camera.rotation[3] = q.w;
  camera.is_orthographic = random.uniform(0, 1) < 0.3 ? 1 : 0;
  camera.vertical_angle = camera.is_orthographic != 0 ? random.log_uniform(0.1, 100) : random.uniform(0.05, 2.8);
  camera.near_distance = random.log_uniform(1e-3, 1);
  camera.far_distance = random.log_uniform(10, 1e4);
  return camera;
}

Shape random_shape(Random& random, const glm::dvec3& place, double size) {
  Shape shape;
  for (int i = 0; i < 12; ++i) shape.positions.emplace_back(random.vector(1.0) + glm::dvec3(0, 0.5, 0));
  shape.bound();
  glm::dmat4 rel_from_object = glm::translate(glm::dmat4(1.0), place) * glm::mat4_cast(random.rotation());
  rel_from_object = glm::scale(rel_from_object, size * glm::dvec3(random.uniform(-1, 1), 1.0, random.uniform(0.01, 3)));
  rel_from_object[0] += 0.3 * rel_from_object[1];  // sheared
  store(rel_from_object, shape.instance.rel_from_object);
  return shape;
}

struct Tally {
  std::size_t culled = 0, seen = 0;
  /// Nothing of what is left out is in view, in float64 and as a shader places it.
  bool is_right(const Shape& shape, const HeddleView& view, bool is_culled) {
    const bool is_seen = shape.is_seen(view, false);
    culled += is_culled ? 1 : 0;
    seen += is_seen ? 1 : 0;
    return !is_culled || (!is_seen && !shape.is_seen(view, true));
  }
  /// The test would hold for a frustum that leaves out nothing, or for shapes that are never seen.
  void expect_both() const {
    EXPECT_GT(culled, 10000U);
    EXPECT_GT(seen, 1000U);
  }
};

TEST(Cull, NeverLeavesOutWhatCanBeSeen) {
  Random random(1);
  Tally tally;
  for (int round = 0; round < 200; ++round) {
    // The camera of shadow views and of reflections stands anywhere relative to the frame's origin.
    const glm::dvec3 origin = random.vector(1e7);
    const glm::dvec3 eye = round % 2 == 0 ? glm::dvec3(0.0) : random.vector(1e3);
    const HeddleView view = make_view(random_camera(random, origin + eye), 64, 36, origin);
    const Frustum frustum(view);
    for (int i = 0; i < 100; ++i) {
      const double distance = random.log_uniform(1e-2, 1e4);
      const Shape shape = random_shape(random, eye + random.vector(distance), distance * random.log_uniform(1e-4, 1.0));
      ASSERT_TRUE(tally.is_right(shape, view, frustum.excludes(bounding_box(shape.bounds, shape.instance))))
          << "round " << round << ", shape " << i;
    }
  }
  tally.expect_both();
}

TEST(Cull, NeverLeavesOutWhatAViewWithAnOriginOfItsOwnSees) {
  Random random(3);
  Tally tally;
  for (int round = 0; round < 300; ++round) {
    // Boxes are known relative to the frame's origin, which is as far as `from`; triangles are drawn relative to the
    // view's.
    const glm::dvec3 from = random.vector(random.log_uniform(1.0, 1e6));
    const HeddleView view = make_view(random_camera(random, glm::dvec3(0.0)), 64, 36, glm::dvec3(0.0));
    const Frustum frustum(view, from);
    for (int i = 0; i < 100; ++i) {
      const double distance = random.log_uniform(1e-2, 1e4);
      const glm::dvec3 place = random.vector(distance);
      const Shape shape = random_shape(random, place, distance * random.log_uniform(1e-4, 1.0));
      HeddleInstance boxed = shape.instance;
      for (int k = 0; k < 3; ++k) boxed.rel_from_object[12 + k] = static_cast<float>(place[k] - from[k]);
      ASSERT_TRUE(tally.is_right(shape, view, frustum.excludes(bounding_box(shape.bounds, boxed))))
          << "round " << round;
    }
  }
  tally.expect_both();
}

TEST(Cull, KeepsWhatOnlyTouchesTheEdgeOfTheView) {
  Random random(2);
  std::size_t touching = 0;
  for (int round = 0; round < 20000; ++round) {
    const glm::dvec3 origin = random.vector(1e5);
    const HeddleView view = make_view(random_camera(random, origin), 64, 36, origin);
    const Frustum frustum(view);
    // A point on a face of the clip volume, within rounding, and a triangle from there to the outside.
    const int face = static_cast<int>(random.uniform(0, 4));
    glm::dvec4 clip_point(random.uniform(-0.9, 0.9), random.uniform(-0.9, 0.9), random.uniform(0.01, 0.99), 1.0);
    clip_point[face / 2] = (face % 2 == 0 ? 1.0 : -1.0) * (1.0 + random.uniform(-1e-7, 1e-7));
    const glm::dvec4 rel4 = multiply_exactly(view.rel_from_clip, clip_point);
    const glm::dvec3 rel = glm::dvec3(rel4) / rel4.w;
    clip_point[face / 2] *= 1.5;
    const glm::dvec4 out4 = multiply_exactly(view.rel_from_clip, clip_point);
    const glm::dvec3 outside = glm::dvec3(out4) / out4.w - rel;
    Shape shape;
    shape.positions = {glm::vec3(0.0F), glm::vec3(outside), glm::vec3(1.1 * outside)};
    shape.bound();
    store(glm::translate(glm::dmat4(1.0), rel), shape.instance.rel_from_object);
    if (!shape.is_seen(view, true) && !shape.is_seen(view, false)) continue;
    ++touching;
    ASSERT_FALSE(frustum.excludes(bounding_box(shape.bounds, shape.instance))) << "round " << round;
  }
  EXPECT_GT(touching, 5000U);
}

TEST(Cull, LeavesOutEveryBoxThatLiesBeyondAFace) {
  // What is in view is [-1, 1] x [-1, 1] x [-10, -1] metres.
  heddle_camera camera{};
  camera.struct_size = sizeof camera;
  camera.rotation[3] = 1;
  camera.is_orthographic = 1;
  camera.vertical_angle = 1;
  camera.near_distance = 1;
  camera.far_distance = 10;
  const Frustum frustum(make_view(camera, 16, 16, glm::dvec3(0.0)));
  const glm::dvec3 half(0.25);
  const double gap = 1e-4;
  EXPECT_FALSE(frustum.excludes({{0, 0, -5}, half}));
  EXPECT_TRUE(frustum.contains({{0, 0, -5}, half}));
  for (const double side : {-1.0, 1.0}) {
    for (int axis = 0; axis < 2; ++axis) {
      glm::dvec3 centre(0, 0, -5);
      centre[axis] = side * (1.25 - gap);
      EXPECT_FALSE(frustum.excludes({centre, half}));
      EXPECT_FALSE(frustum.contains({centre, half}));
      centre[axis] = side * (1.25 + gap);
      EXPECT_TRUE(frustum.excludes({centre, half}));
    }
  }
  EXPECT_FALSE(frustum.excludes({{0, 0, -0.75 - gap}, half}));
  EXPECT_TRUE(frustum.excludes({{0, 0, -0.75 + gap}, half}));
  EXPECT_FALSE(frustum.excludes({{0, 0, -10.25 + gap}, half}));
  EXPECT_TRUE(frustum.excludes({{0, 0, -10.25 - gap}, half}));
}

TEST(Cull, InfiniteProjectionLeavesOutNothingForItsDistance) {
  heddle_camera camera{};
  camera.struct_size = sizeof camera;
  camera.rotation[3] = 1;
  camera.vertical_angle = 1;
  const Frustum frustum(make_view(camera, 16, 16, glm::dvec3(0.0)));
  EXPECT_FALSE(frustum.excludes({{0, 0, -1e30}, glm::dvec3(1.0)}));
  EXPECT_TRUE(frustum.excludes({{0, 0, 1e30}, glm::dvec3(1.0)}));
}

TEST(Cull, KeepsWhatIsNotANumber) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  heddle_camera camera{};
  camera.struct_size = sizeof camera;
  camera.rotation[3] = 1;
  camera.vertical_angle = 1;
  const HeddleView view = make_view(camera, 16, 16, glm::dvec3(0.0));
  EXPECT_FALSE(Frustum(view).excludes({{nan, nan, nan}, glm::dvec3(1.0)}));
  HeddleView broken = view;
  std::fill(std::begin(broken.clip_from_rel), std::end(broken.clip_from_rel), static_cast<float>(nan));
  EXPECT_FALSE(Frustum(broken).excludes({{0, 0, 5}, glm::dvec3(1.0)}));

  // Also between neighbours that are out of view.
  std::vector<Box> boxes(64, Box{{0, 0, 100}, glm::dvec3(1.0)});
  InstanceBoxes instances;
  std::vector<std::uint8_t> visible(64);
  boxes[40].centre = glm::dvec3(nan);
  instances.assign(boxes);
  instances.find_visible(Frustum(view), 0, 64, visible.data());
  for (std::size_t i = 0; i < 64; ++i) EXPECT_EQ(visible[i], i == 40 ? 1 : 0) << i;
}

TEST(Cull, CommandsShowTheVisibleInstancesInOrderAndNoOthers) {
  Random random(3);
  for (int round = 0; round < 100; ++round) {
    const HeddleView view = make_view(random_camera(random, glm::dvec3(0.0)), 64, 36, glm::dvec3(0.0));
    const Frustum frustum(view);
    const auto first = static_cast<std::uint32_t>(random.uniform(0, 50));  // of another group
    std::vector<VkDrawIndexedIndirectCommand> commands;
    std::vector<Box> boxes(first);
    std::vector<std::uint32_t> expected;
    for (std::uint32_t mesh = 0; mesh < 10; ++mesh) {
      const auto count = static_cast<std::uint32_t>(random.uniform(1, 80));
      commands.push_back(
          {mesh + 1, count, 100 * mesh, static_cast<std::int32_t>(mesh), static_cast<std::uint32_t>(boxes.size())});
      for (std::uint32_t i = 0; i < count; ++i) {
        // Some lie in clusters, so that whole runs are decided at once.
        const glm::dvec3 cluster = round % 2 == 0 ? glm::dvec3(30.0 * (mesh % 3) - 30.0, 0, 0) : glm::dvec3(0.0);
        boxes.push_back({cluster + random.vector(20.0), glm::dvec3(random.uniform(0, 2))});
        if (!frustum.excludes(boxes.back())) expected.push_back(static_cast<std::uint32_t>(boxes.size() - 1));
      }
    }
    InstanceBoxes instances;
    const std::size_t total = boxes.size() - first;
    instances.assign(std::move(boxes));
    const VisibleDraws left = cull(commands, instances, &frustum);
    std::vector<std::uint32_t> drawn;
    for (const VkDrawIndexedIndirectCommand& command : left.commands) {
      const auto owner = std::find_if(commands.begin(), commands.end(), [&](const VkDrawIndexedIndirectCommand& given) {
        return given.indexCount == command.indexCount;
      });
      ASSERT_NE(owner, commands.end());
      EXPECT_EQ(command.firstIndex, owner->firstIndex);
      EXPECT_EQ(command.vertexOffset, owner->vertexOffset);
      EXPECT_GE(command.firstInstance, owner->firstInstance);
      EXPECT_LE(command.firstInstance + command.instanceCount, owner->firstInstance + owner->instanceCount);
      for (std::uint32_t i = 0; i < command.instanceCount; ++i) drawn.push_back(command.firstInstance + i);
    }
    // A run that lies in view as a whole is drawn by that alone; its boxes are each in view then.
    EXPECT_EQ(drawn, expected) << "round " << round;
    EXPECT_EQ(left.drawn, expected.size());
    EXPECT_EQ(left.drawn + left.culled, total);
  }
}

}  // namespace
}  // namespace heddle::scene
