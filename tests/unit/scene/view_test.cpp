// SPDX-License-Identifier: Apache-2.0
// The view record against what api/heddle/records.h says of it.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <numbers>

#include "scene/scene.hpp"

namespace heddle::scene {
namespace {

constexpr double kPi = std::numbers::pi;

glm::dmat4 matrix(const float (&values)[16]) {
  glm::dmat4 made;
  for (int i = 0; i < 16; ++i) {
    made[i / 4][i % 4] = values[i];
  }
  return made;
}

heddle_camera camera_at(const glm::dvec3& position, const glm::dquat& rotation = glm::dquat(1, 0, 0, 0)) {
  heddle_camera camera{};
  camera.struct_size = sizeof camera;
  camera.vertical_angle = kPi / 2;  // tangent of half of it is 1
  camera.near_distance = 0.125;
  for (int i = 0; i < 3; ++i) {
    camera.position[i] = position[i];
  }
  camera.rotation[0] = rotation.x;
  camera.rotation[1] = rotation.y;
  camera.rotation[2] = rotation.z;
  camera.rotation[3] = rotation.w;
  return camera;
}

glm::dquat some_rotation() {
  return glm::angleAxis(0.7, glm::dvec3(0, 1, 0)) * glm::angleAxis(-0.4, glm::dvec3(1, 0, 0));
}

void expect_near(const glm::dvec4& a, const glm::dvec4& b, double tolerance) {
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(a[i], b[i], tolerance) << "component " << i;
  }
}

/// The product is the identity but for the rounding of both factors to float32: each of the four terms of an element
/// may be off by 2^-24 of itself for either factor.
void expect_inverse(const glm::dmat4& a, const glm::dmat4& b) {
  const glm::dmat4 product = a * b;
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) {
      double terms = 0;
      for (int k = 0; k < 4; ++k) {
        terms += std::abs(a[k][row] * b[column][k]);
      }
      EXPECT_NEAR(product[column][row], row == column ? 1.0 : 0.0, terms * std::ldexp(1.0, -23));
    }
  }
}

TEST(View, PerspectivePointsLandWhereTheRecordSays) {
  const HeddleView view = make_view(camera_at({0, 0, 0}), 200, 100, {0, 0, 0});
  EXPECT_EQ(view.half_size[1], 1.0F);  // exact: the tangent of pi/4 rounds to 1 in float32
  EXPECT_EQ(view.half_size[0], 2.0F);
  EXPECT_EQ(view.near_distance, 0.125F);
  EXPECT_EQ(view.is_orthographic, 0U);
  EXPECT_EQ(view.extent[0], 200U);
  EXPECT_EQ(view.jitter[0], 0.0F);
  // x = half the width to the right at 4 m, y a quarter of the height up: up is negative in Vulkan's clip space.
  const glm::dvec4 clip = matrix(view.clip_from_rel) * glm::dvec4(4, 1, -4, 1);
  expect_near(clip, {2, -1, 0.125, 4}, 1e-6);  // float32 of a tangent
  EXPECT_NEAR(clip.y / clip.w, -0.25, 1e-6);
  EXPECT_NEAR(clip.z / clip.w, 0.125 / 4, 1e-7);
}

TEST(View, DepthIsReversedAndInfinite) {
  const HeddleView view = make_view(camera_at({0, 0, 0}), 1, 1, {0, 0, 0});
  const auto depth = [&](double distance) {
    const glm::dvec4 clip = matrix(view.clip_from_rel) * glm::dvec4(0, 0, -distance, 1);
    return clip.z / clip.w;
  };
  EXPECT_EQ(depth(0.125), 1.0);
  EXPECT_EQ(depth(0.25), 0.5);
  EXPECT_EQ(depth(1e12), 0.125 / 1e12);
  EXPECT_EQ((matrix(view.clip_from_rel) * glm::dvec4(0, 0, -1, 0)).z, 0.0) << "what is infinitely far has depth 0";
}

TEST(View, OrthographicDepthRunsFromOneToZero) {
  heddle_camera camera = camera_at({0, 0, 0});
  camera.is_orthographic = 1;
  camera.vertical_angle = 3;
  camera.aspect = 2;
  camera.near_distance = 1;
  camera.far_distance = 5;
  const HeddleView view = make_view(camera, 100, 100, {0, 0, 0});
  EXPECT_EQ(view.half_size[0], 6.0F);
  EXPECT_EQ(view.is_orthographic, 1U);
  const glm::dmat4 clip_from_rel = matrix(view.clip_from_rel);
  expect_near(clip_from_rel * glm::dvec4(6, 3, -1, 1), {1, -1, 1, 1}, 1e-6);
  expect_near(clip_from_rel * glm::dvec4(-6, -3, -5, 1), {-1, 1, 0, 1}, 1e-6);
  expect_near(clip_from_rel * glm::dvec4(0, 0, -3, 1), {0, 0, 0.5, 1}, 1e-6);
}

TEST(View, InverseUndoesTheProjection) {
  for (const std::uint32_t is_orthographic : {0U, 1U}) {
    heddle_camera camera = camera_at({3, -2, 5}, some_rotation());
    camera.is_orthographic = is_orthographic;
    const HeddleView view = make_view(camera, 1280, 720, {2, -2, 4});
    expect_inverse(matrix(view.rel_from_clip), matrix(view.clip_from_rel));
    expect_inverse(matrix(view.rel_from_view), matrix(view.view_from_rel));
  }
}

TEST(View, ClipFormulaOfTheRecordGivesTheViewPosition) {
  const HeddleView view = make_view(camera_at({3, -2, 5}, some_rotation()), 1280, 720, {1, 1, 1});
  const glm::dvec4 rel(-1.5, 0.25, -2, 1);
  const glm::dvec4 clip = matrix(view.clip_from_rel) * rel;
  const glm::dvec4 in_view = matrix(view.view_from_rel) * rel;
  const double d = clip.w;
  EXPECT_NEAR(d, -in_view.z, 1e-5);
  EXPECT_NEAR(clip.x / clip.w * view.half_size[0] * d, in_view.x, 1e-5);
  EXPECT_NEAR(-clip.y / clip.w * view.half_size[1] * d, in_view.y, 1e-5);
}

TEST(View, LargeWorldsGiveTheSameRecord) {
  const glm::dvec3 far(100000.0, -100000.0, 50000.0);
  heddle_camera here = camera_at({0.5, 1.25, -2}, some_rotation());
  heddle_camera there = camera_at(glm::dvec3(0.5, 1.25, -2) + far, some_rotation());
  const HeddleView a = make_view(here, 640, 360, {0.5, 1.25, -2}, &here);
  const HeddleView b = make_view(there, 640, 360, glm::dvec3(0.5, 1.25, -2) + far, &there);
  EXPECT_EQ(std::memcmp(&a, &b, sizeof a), 0);
}

TEST(View, PreviousViewTakesThisFramesPositions) {
  const glm::dvec3 far(100000.0, 0, 0);
  const heddle_camera before = camera_at(far + glm::dvec3(-0.25, 0.5, 0.125), some_rotation());
  const heddle_camera now = camera_at(far);
  const HeddleView view = make_view(now, 640, 360, far, &before);
  // The same camera, rendered as its own frame: a static point 100 km out lands on the same pixel.
  const HeddleView was = make_view(before, 640, 360, far + glm::dvec3(-0.25, 0.5, 0.125));
  const glm::dvec4 by_previous = matrix(view.previous_clip_from_rel) * glm::dvec4(0.5, 0.75, -6, 1);
  const glm::dvec4 by_itself = matrix(was.clip_from_rel) * glm::dvec4(0.75, 0.25, -6.125, 1);
  expect_near(by_previous, by_itself, 1e-5);
  EXPECT_GT(by_previous.w, 0);
}

TEST(View, WithoutAPastThePreviousViewIsThisOne) {
  const HeddleView view = make_view(camera_at({3, -2, 5}, some_rotation()), 64, 64, {1, 0, 0});
  EXPECT_EQ(std::memcmp(view.previous_clip_from_rel, view.clip_from_rel, sizeof view.clip_from_rel), 0);
}

TEST(View, AspectOfTheCameraGoesBeforeTheFrames) {
  heddle_camera camera = camera_at({0, 0, 0});
  camera.aspect = 3;
  EXPECT_NEAR(make_view(camera, 100, 100, {0, 0, 0}).half_size[0], 3, 1e-6);
}

TEST(View, NearDistanceHasADefault) {
  heddle_camera camera = camera_at({0, 0, 0});
  camera.near_distance = 0;
  EXPECT_EQ(make_view(camera, 1, 1, {0, 0, 0}).near_distance, 0.01F);
}

}  // namespace
}  // namespace heddle::scene
