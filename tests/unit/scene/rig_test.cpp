// SPDX-License-Identifier: Apache-2.0
// Keys to values, and poses of nodes, against closed forms.
#include "scene/rig.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "diagnostics.hpp"

namespace heddle::scene {
namespace {

using Path = Channel::Path;
using Interpolation = Channel::Interpolation;

std::vector<double> at(const Channel& channel, double time) {
  std::vector<double> out(channel.width);
  sample(channel, time, out);
  return out;
}

Channel one_number(Interpolation interpolation, std::vector<double> times, std::vector<double> values) {
  return {0, Path::kWeights, interpolation, 1, std::move(times), std::move(values)};
}

TEST(Sample, HoldsTheFirstAndLastKeys) {
  for (const Interpolation interpolation : {Interpolation::kLinear, Interpolation::kStep}) {
    const Channel channel = one_number(interpolation, {1, 2}, {5, 7});
    EXPECT_THAT(at(channel, -10), testing::ElementsAre(5));
    EXPECT_THAT(at(channel, 1), testing::ElementsAre(5));
    EXPECT_THAT(at(channel, 2), testing::ElementsAre(7));
    EXPECT_THAT(at(channel, 100), testing::ElementsAre(7));
  }
  const Channel cubic = one_number(Interpolation::kCubicSpline, {1, 2}, {9, 5, 9, 9, 7, 9});
  EXPECT_THAT(at(cubic, 0), testing::ElementsAre(5));
  EXPECT_THAT(at(cubic, 3), testing::ElementsAre(7));
}

TEST(Sample, LinearIsALineAndStepHolds) {
  EXPECT_THAT(at(one_number(Interpolation::kLinear, {1, 3, 4}, {10, 20, 0}), 1.5), testing::ElementsAre(12.5));
  EXPECT_THAT(at(one_number(Interpolation::kLinear, {1, 3, 4}, {10, 20, 0}), 3.25), testing::ElementsAre(15));
  EXPECT_THAT(at(one_number(Interpolation::kStep, {1, 3, 4}, {10, 20, 0}), 2.999), testing::ElementsAre(10));
  EXPECT_THAT(at(one_number(Interpolation::kStep, {1, 3, 4}, {10, 20, 0}), 3), testing::ElementsAre(20));
}

TEST(Sample, CubicSplineReproducesACubic) {
  // Hermite interpolation of a cubic's own values and slopes is the cubic: tangents are per second, not per key.
  const auto value = [](double t) { return 1 - 2 * t + 3 * t * t - 0.5 * t * t * t; };
  const auto slope = [](double t) { return -2 + 6 * t - 1.5 * t * t; };
  const Channel channel =
      one_number(Interpolation::kCubicSpline, {0.5, 2, 5},
                 {slope(0.5), value(0.5), slope(0.5), slope(2), value(2), slope(2), slope(5), value(5), slope(5)});
  for (const double t : {0.5, 0.75, 1.9, 2.0, 3.3, 4.99}) {
    EXPECT_NEAR(at(channel, t)[0], value(t), 1e-13 * 40) << t;  // values to 40, a dozen roundings
  }
}

TEST(Sample, RotationsTurnEvenlyTheShorterWay) {
  const double half = std::sqrt(0.5);
  // From none to a quarter turn about y, written with the other sign; lengths do not matter.
  const Channel channel{0, Path::kRotation, Interpolation::kLinear, 4, {0, 1}, {0, 0, 0, 2, 0, -half, 0, -half}};
  for (const double share : {0.1, 0.5, 0.9}) {
    const std::vector<double> turned = at(channel, share);
    const double angle = share * std::numbers::pi / 4;  // half of the turn
    EXPECT_NEAR(turned[1], std::sin(angle), 1e-15);
    EXPECT_NEAR(turned[3], std::cos(angle), 1e-15);
  }
}

TEST(Sample, RotationsOfTinyAnglesKeepTheirDigits) {
  // cos(1e-9) is 1 in float64: an arc cosine would find no turn at all.
  const Channel channel{0, Path::kRotation, Interpolation::kLinear, 4, {0, 1}, {0, 0, 0, 1, 1e-9, 0, 0, 1}};
  EXPECT_NEAR(at(channel, 0.25)[0] / 0.25e-9, 1, 1e-14);
  const Channel same{0, Path::kRotation, Interpolation::kLinear, 4, {0, 1}, {0, 0, 0, 1, 0, 0, 0, 1}};
  EXPECT_THAT(at(same, 0.5), testing::ElementsAre(0, 0, 0, 1));
}

TEST(Sample, CubicRotationsComeOutWithLengthOne) {
  const Channel channel{0, Path::kRotation, Interpolation::kCubicSpline,
                        4, {0, 1},          {0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 3, 0, 0, 3, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}};
  const std::vector<double> q = at(channel, 0.4);
  EXPECT_NEAR(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1, 1e-15);
}

TEST(Sample, KeysAtOneTimeAreAJump) {
  const Channel channel = one_number(Interpolation::kLinear, {0, 1, 1, 2}, {0, 1, 5, 6});
  EXPECT_NEAR(at(channel, std::nextafter(1.0, 0.0))[0], 1, 1e-15);
  EXPECT_THAT(at(channel, 1), testing::ElementsAre(5));
}

Rig arm() {
  Rig rig;
  rig.nodes.resize(2);
  rig.nodes[1].parent = 0;
  rig.nodes[1].translation = {1, 0, 0};
  rig.order = {0, 1};
  rig.animations.resize(1);
  rig.animations[0].channels.push_back({0, Path::kTranslation, Interpolation::kLinear, 3, {0, 2}, {0, 0, 0, 8, 0, 0}});
  rig.animations[0].duration = 2;
  return rig;
}

TEST(Pose, ChildrenFollowAndRestIsWithoutAnimation) {
  Rig rig = arm();
  EXPECT_EQ(rig.pose(0.5).scene_from_node[1][3].x, 3);
  rig.animation = HEDDLE_NONE;
  EXPECT_EQ(rig.pose(0.5).scene_from_node[1][3].x, 1);
  EXPECT_THAT(rig.moving_nodes(), testing::ElementsAre(1, 1));
}

TEST(Pose, LoopsBeginAgainAfterTheEndAndNotAtIt) {
  Rig rig = arm();
  const auto x = [&](double time) { return rig.pose(time).scene_from_node[0][3].x; };
  EXPECT_EQ(x(7), 8);
  rig.loops = true;
  EXPECT_EQ(x(2), 8);
  EXPECT_EQ(x(2.5), 2);
  EXPECT_EQ(x(7), 4);
  EXPECT_EQ(x(-0.5), 6);
}

TEST(Pose, PlacesBeyondFloat64AreErrors) {
  Rig rig = arm();
  rig.file = "a.glb";
  rig.nodes[0].name = "root";
  rig.nodes[0].scale = rig.nodes[1].scale = glm::dvec3(1e200);
  try {
    (void)rig.pose(0);
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "a.glb: error: node 1 '': its place in the scene is not finite");
  }
}

}  // namespace
}  // namespace heddle::scene
