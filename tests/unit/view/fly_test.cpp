// SPDX-License-Identifier: Apache-2.0
#include "view/fly.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace {

using heddle::view::Axes;
using heddle::view::axes_of;

constexpr double kPi = std::numbers::pi;

heddle_camera camera_at(double x, double y, double z) {
  heddle_camera camera{};
  camera.struct_size = sizeof camera;
  camera.position[0] = x;
  camera.position[1] = y;
  camera.position[2] = z;
  camera.rotation[3] = 1;
  camera.vertical_angle = 0.9;
  return camera;
}

double length_of(const heddle_camera& camera) {
  double squares = 0;
  for (const double number : camera.rotation) squares += number * number;
  return std::sqrt(squares);
}

void expect_near(const std::array<double, 3>& a, const std::array<double, 3>& b, double bound) {
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(a[i], b[i], bound);
}

}  // namespace

TEST(Fly, LooksAlongMinusZAtFirst) {
  const Axes axes = axes_of(camera_at(0, 0, 0));
  expect_near(axes.forward, {0, 0, -1}, 0);
  expect_near(axes.right, {1, 0, 0}, 0);
  expect_near(axes.up, {0, 1, 0}, 0);
}

TEST(Fly, TurnsLeftAboutTheVerticalAxis) {
  heddle_camera camera = camera_at(0, 0, 0);
  heddle::view::look(camera, kPi / 2, 0);
  expect_near(axes_of(camera).forward, {-1, 0, 0}, 1e-15);
}

TEST(Fly, LooksNoFurtherThanStraightUp) {
  heddle_camera camera = camera_at(0, 0, 0);
  for (int i = 0; i < 100; ++i) heddle::view::look(camera, 0.03, 0.1);
  const Axes axes = axes_of(camera);
  EXPECT_GT(axes.forward[1], 1 - 1e-9);
  EXPECT_GT(axes.up[0] * axes.up[0] + axes.up[2] * axes.up[2], 0.99);  // not over the top
  EXPECT_GT(axes.up[1], 0);
  heddle::view::look(camera, 0, -0.5);
  EXPECT_NEAR(std::asin(axes_of(camera).forward[1]), kPi / 2 - 0.5, 2e-6);
}

TEST(Fly, StaysARotationOverManyTurns) {
  heddle_camera camera = camera_at(0, 0, 0);
  for (int i = 0; i < 100000; ++i) heddle::view::look(camera, 1e-2, i % 2 == 0 ? 7e-4 : -7e-4);
  EXPECT_NEAR(length_of(camera), 1, 4e-16);
  // 1000 radians to the left: what is left of whole turns. Each turn errs by some 1e-16.
  const double heading = std::atan2(-axes_of(camera).forward[0], -axes_of(camera).forward[2]);
  EXPECT_NEAR(std::remainder(heading - 1000.0, 2 * kPi), 0, 1e-9);
}

TEST(Fly, MovesByAMillimetreAHundredKilometresAway) {
  heddle_camera camera = camera_at(1e5, 0, -1e5);
  for (int i = 0; i < 1000; ++i) heddle::view::move(camera, 0.001, 0, 0.001);
  EXPECT_NEAR(camera.position[0], 1e5 + 1, 1e-8);
  EXPECT_NEAR(camera.position[2], -1e5 - 1, 1e-8);
}

TEST(Fly, KeepsTheRollOfACameraUntilItIsLevelled) {
  heddle_camera camera = camera_at(0, 0, 0);
  camera.rotation[2] = std::sin(0.15);  // about the line of sight
  camera.rotation[3] = std::cos(0.15);
  heddle::view::look(camera, 0.4, 0.2);
  const Axes rolled = axes_of(camera);
  // The angle between the picture's right and the horizon is the roll still.
  const double across = std::hypot(rolled.forward[0], rolled.forward[2]);
  EXPECT_NEAR(std::asin(rolled.right[1] / across), 0.3, 1e-12);
  heddle::view::level(camera);
  const Axes level = axes_of(camera);
  EXPECT_NEAR(level.right[1], 0, 1e-15);
  expect_near(level.forward, rolled.forward, 1e-15);
}

TEST(Fly, LevelsACameraThatLooksStraightDown) {
  heddle_camera camera = camera_at(0, 0, 0);
  camera.rotation[0] = -std::sqrt(0.5);
  camera.rotation[3] = std::sqrt(0.5);
  const Axes before = axes_of(camera);
  heddle::view::level(camera);
  expect_near(axes_of(camera).forward, before.forward, 1e-9);
  expect_near(axes_of(camera).up, before.up, 1e-9);
}

TEST(Fly, WritesAnOverlayWithAllDigits) {
  heddle_camera camera = camera_at(0.1, 1.0 / 3, 1e5);
  camera.near_distance = 0.05;
  EXPECT_EQ(heddle::view::overlay_text(camera, "a \"b\""),
            "[[camera]]\nname = \"a \\\"b\\\"\"\nposition = [0.1, 0.3333333333333333, 100000]\n"
            "target = [0.1, 0.3333333333333333, 99999]\nvertical_angle = 0.9\nnear = 0.05\n");
}
