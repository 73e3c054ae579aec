// SPDX-License-Identifier: Apache-2.0
// What techniques with depth maps share: places in an atlas, maps that stand still under the camera, and the bounds of
// cascades. Properties of the geometry, without a device.
#include "depth_maps.hpp"
#include "cameras.hpp"
#include "cascades.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace {

using depth_maps::AtlasPlaces;
using depth_maps::AtlasRoom;
using depth_maps::AtlasWish;
using depth_maps::MapView;
using depth_maps::Square;
using depth_maps::Tile;
using glm::dvec2;
using glm::dvec3;
using shadow_cameras::camera_along;
using shadow_cameras::random_direction;

// ---- the atlas ------------------------------------------------------------------------------------------------------

bool overlap(const Tile& a, const Tile& b) {
  return a.layer == b.layer && a.x < b.x + b.side && b.x < a.x + a.side && a.y < b.y + b.side && b.y < a.y + a.side;
}

TEST(AtlasRoom, FillsToTheLastTexelWhereSidesArePowersOfTwo) {
  AtlasRoom room(2, 4);
  std::uint64_t texels = 0;
  // A quarter of a layer, sixteen sixteenths of one, three quarters more, and what is left in 64ths.
  const auto take = [&](std::uint32_t level, std::uint32_t count) {
    const auto squares = room.take(level, count);
    for (const Square& square : squares) {
      const Tile tile = depth_maps::tile_of(square, 256);
      texels += std::uint64_t{tile.side} * tile.side;
    }
    return squares.size();
  };
  EXPECT_EQ(take(1, 1), 1U);
  EXPECT_EQ(take(2, 16), 16U);
  EXPECT_EQ(take(1, 3), 3U) << "sixteenths went round the one quarter that was begun, not into whole ones";
  EXPECT_EQ(texels, 2U * 256 * 256);
  EXPECT_EQ(take(3, 1), 0U);
}

TEST(AtlasRoom, GivesAllOrNothing) {
  AtlasRoom room(1, 3);
  EXPECT_EQ(room.take(1, 5).size(), 0U);
  EXPECT_EQ(room.take(1, 4).size(), 4U);
}

TEST(AtlasPlaces, NeverOverlapAndStayWhileTheirOwnersAsk) {
  std::mt19937 random(5);
  const auto below = [&](std::uint32_t end) {
    return std::uniform_int_distribution<std::uint32_t>(0, end - 1)(random);
  };
  AtlasPlaces places;
  std::vector<AtlasWish> wishes;
  std::vector<std::vector<Square>> before;
  std::vector<AtlasWish> asked;
  int stayed = 0;
  for (int step = 0; step < 300; ++step) {
    // Somebody comes, goes, or wants another size.
    const std::uint32_t dice = below(3);
    if (wishes.size() < 4 || dice == 0) {
      wishes.push_back({static_cast<std::uint64_t>(1000 + step), below(5), 4, below(2) == 0 ? 1U : 6U});
    } else if (dice == 1) {
      wishes.erase(wishes.begin() + below(static_cast<std::uint32_t>(wishes.size())));
    } else {
      wishes[below(static_cast<std::uint32_t>(wishes.size()))].level = below(5);
    }
    const auto granted = places.grant(wishes, 4, 5);
    ASSERT_EQ(granted.size(), wishes.size());
    std::vector<Tile> tiles;
    double asked_layers = 0;
    for (std::size_t i = 0; i < wishes.size(); ++i) {
      asked_layers += wishes[i].count * std::pow(0.25, wishes[i].level);
      ASSERT_TRUE(granted[i].empty() || granted[i].size() == wishes[i].count);
      for (const Square& square : granted[i]) {
        EXPECT_GE(square.level, wishes[i].level);
        tiles.push_back(depth_maps::tile_of(square, 1000));  // no power of two
        EXPECT_LE(tiles.back().x + tiles.back().side, 1000U);
        EXPECT_LE(tiles.back().y + tiles.back().side, 1000U);
      }
    }
    for (std::size_t a = 0; a < tiles.size(); ++a)
      for (std::size_t b = a + 1; b < tiles.size(); ++b) ASSERT_FALSE(overlap(tiles[a], tiles[b])) << step;
    // With half of it free nobody who was satisfied has to move.
    if (asked_layers <= 1.0) {
      for (std::size_t i = 0; i < wishes.size(); ++i) {
        const auto known = std::ranges::find(asked, wishes[i]);
        if (known == asked.end()) continue;
        const auto& had = before[static_cast<std::size_t>(known - asked.begin())];
        if (had.empty() || had.front().level != wishes[i].level) continue;
        EXPECT_EQ(granted[i], had) << step;
        ++stayed;
      }
    }
    before = granted;
    asked = wishes;
    if (asked_layers > 6.0) wishes.clear();
  }
  EXPECT_GT(stayed, 50);
}

TEST(AtlasPlaces, GivesTheImportantFirstAndTheOthersLessWhenItIsFull) {
  AtlasPlaces places;
  const std::vector<AtlasWish> wishes{{1, 0, 2, 1}, {2, 0, 2, 1}, {3, 0, 2, 6}, {4, 0, 0, 1}};
  const auto granted = places.grant(wishes, 3, 3);
  EXPECT_EQ(granted[0].front().level, 0U);
  EXPECT_EQ(granted[1].front().level, 0U);
  ASSERT_EQ(granted[2].size(), 6U);
  EXPECT_EQ(granted[2].front().level, 2U) << "six quarters do not fit, six sixteenths do";
  EXPECT_TRUE(granted[3].empty()) << "a whole layer or nothing";
}

// ---- maps that stand still ------------------------------------------------------------------------------------------

HeddleLight sun(const dvec3& direction) {
  HeddleLight light{};
  light.type = HEDDLE_LIGHT_DIRECTIONAL;
  light.flags = HEDDLE_LIGHT_CASTS_SHADOW;
  const dvec3 d = glm::normalize(direction);
  for (int i = 0; i < 3; ++i) {
    light.direction[i] = static_cast<float>(d[i]);
    light.intensity[i] = 1.0F;
  }
  return light;
}

TEST(Cascades, MoveByWholeTexelsUnderACameraThatMovesAndTurns) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  cascaded::Settings settings;
  // Near the scene's origin, and 100 km and 10,000 km away.
  for (const double away : {0.0, 1e5, 1e7}) {
    const HeddleLight light = sun(random_direction(random));
    const dvec3 place = away * random_direction(random);
    std::vector<dvec3> points;
    for (int i = 0; i < 20; ++i) points.push_back(place + 50.0 * dvec3(unit(random), unit(random), unit(random)));
    const dvec3 at = place;
    const auto first = cascaded::make_views(light, camera_along({0.3, -0.2, -1}, 0.5, 1.6), at, settings);
    std::size_t moved = 0;
    double worst = 0;
    double worst_looked_up = 0;
    for (int step = 0; step < 200; ++step) {
      const dvec3 origin = at + 3.0 * dvec3(unit(random), unit(random), unit(random));
      const auto views =
          cascaded::make_views(light, camera_along(random_direction(random), 0.5, 1.6), origin, settings);
      for (std::size_t c = 0; c < views.size(); ++c) {
        const Tile whole{0, 0, 0, settings.resolution};
        const depth_maps::LookupView lookup = depth_maps::make_lookup(views[c], origin, whole, settings.resolution);
        EXPECT_EQ(depth_maps::texel_size(views[c]), depth_maps::texel_size(first[c])) << "the grid is one and the same";
        for (const dvec3& point : points) {
          const dvec3 now = depth_maps::texel_of(views[c], point);
          const dvec2 shift = dvec2(now) - dvec2(depth_maps::texel_of(first[c], point));
          worst = std::max({worst, std::abs(shift.x - std::round(shift.x)), std::abs(shift.y - std::round(shift.y))});
          moved += std::abs(std::round(shift.x)) > 0.5 ? 1 : 0;
          // As shaders find it, in float32.
          const glm::vec3 rel(point - origin);
          glm::mat4 matrix;
          for (int k = 0; k < 16; ++k) matrix[k / 4][k % 4] = lookup.clip_from_rel[k];
          const glm::vec4 clip = matrix * glm::vec4(rel, 1.0F);
          const dvec2 looked_up = (0.5 * dvec2(clip) + 0.5) * static_cast<double>(settings.resolution);
          worst_looked_up = std::max({worst_looked_up, std::abs(looked_up.x - now.x), std::abs(looked_up.y - now.y)});
        }
      }
    }
    // float64: a place has 2^-53 of its distance, a texel of the finest cascade 8 mm; a few operations.
    EXPECT_LE(worst, 1e-9 + 8.0 * away * std::pow(2.0, -53) / depth_maps::texel_size(first[0])) << away;
    // float32: positions within 87 m of the camera, of matrices whose numbers are up to 200 m over the half side: 2^-24
    // of their sum in each of four products, in texels of the finest cascade.
    EXPECT_LE(worst_looked_up, 4.0 * std::pow(2.0, -24) * (87.0 + 260.0) / depth_maps::texel_size(first[0])) << away;
    EXPECT_GT(moved, 100U) << "the maps followed the camera";
  }
}

TEST(Cascades, AreDrawnAgainOnlyWhenTheCameraHasGoneFarEnough) {
  const HeddleLight light = sun({0.4, -1, 0.3});
  const HeddleView camera = camera_along({0.3, -0.2, -1}, 0.5, 1.6);
  for (const double slack : {1.0, 16.0, 64.0}) {
    cascaded::Settings settings;
    settings.slack = slack;
    const auto first = cascaded::make_views(light, camera, dvec3(0.0), settings);
    const double texel = depth_maps::texel_size(first[0]);
    int changes = 0;
    constexpr int kSteps = 1000;
    dvec3 last = first[0].origin;
    for (int step = 1; step <= kSteps; ++step) {
      const auto views = cascaded::make_views(light, camera, dvec3(step * 0.25 * texel, 0, 0), settings);
      changes += views[0].origin != last ? 1 : 0;
      last = views[0].origin;
    }
    // 250 texels of a way that the map's axes see at most in full, each axis by itself, and the depth's steps.
    EXPECT_LE(changes, 2.0 * 250.0 / slack + 3.0) << slack;
    EXPECT_GE(changes, 0.5 * 250.0 / slack) << slack;
  }
}

TEST(Cascades, HoldTheirPartOfTheViewInsideTheGuard) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int trial = 0; trial < 50; ++trial) {
    cascaded::Settings settings;
    settings.slack = trial % 2 == 0 ? 16.0 : 200.0;
    settings.filter_radius = trial % 3 == 0 ? 8.0 : 1.5;
    const HeddleView camera = camera_along(random_direction(random), 0.5, 1.6);
    const dvec3 origin = 1e5 * random_direction(random);
    const auto views = cascaded::make_views(sun(random_direction(random)), camera, origin, settings);
    const auto reaches = cascaded::reaches(settings);
    ASSERT_EQ(views.size(), settings.cascades);
    for (std::size_t i = 0; i < views.size(); ++i) {
      for (int point = 0; point < 50; ++point) {
        const double d = reaches[i] * unit(random);
        dvec3 p = origin;
        const double weights[3] = {0.8 * d * (2 * unit(random) - 1), 0.5 * d * (2 * unit(random) - 1), -d};
        for (int c = 0; c < 3; ++c)
          for (int r = 0; r < 3; ++r) p[r] += weights[c] * static_cast<double>(camera.rel_from_view[4 * c + r]);
        const dvec3 texel = depth_maps::texel_of(views[i], p);
        const double guard = depth_maps::guard_texels(settings.filter_radius);
        for (const double t : {texel.x, texel.y}) {
          EXPECT_GE(t, guard - 1e-6);
          EXPECT_LE(t, settings.resolution - guard + 1e-6);
        }
        EXPECT_GE(texel.z, 0.0);
        EXPECT_LE(texel.z, 1.0);
      }
    }
  }
}

TEST(Cascades, SplitEvenlyLogarithmicallyOrInBetween) {
  cascaded::Settings settings;
  settings.cascades = 4;
  settings.distance = 81.0 * 2.0;
  settings.nearest = 2.0;
  settings.split = 1.0;
  const auto logarithmic = cascaded::reaches(settings);
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_NEAR(logarithmic[i], 2.0 * std::pow(3.0, static_cast<double>(i) + 1), 1e-9);
  settings.split = 0.0;
  const auto even = cascaded::reaches(settings);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(even[i], 2.0 + 40.0 * (static_cast<double>(i) + 1), 1e-9);
  settings.split = 0.25;
  const auto mixed = cascaded::reaches(settings);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(mixed[i], 0.25 * logarithmic[i] + 0.75 * even[i], 1e-9);
  // Nearest beyond the distance: one reach for all.
  settings.nearest = 1000.0;
  for (const double reach : cascaded::reaches(settings)) EXPECT_NEAR(reach, settings.distance, 1e-9);
}

TEST(ReachOfScene, IsAsFarAsTheSceneAtAnyScale) {
  const auto reach = [](double scale, const dvec3& eye, double half, double typical) {
    const double bounds[6] = {-half * scale, 0, -half * scale, half * scale, half * scale, half * scale};
    return depth_maps::reach_of_scene(bounds, typical * scale, scale * eye, 60.0, 200.0);
  };
  const double diagonal = 3.0 * 4.0;  // of 8 x 4 x 8 m
  const depth_maps::Reach usual = reach(1.0, {0, 1, 0}, 4.0, 8.0);
  // All that can be seen is before the last tenth, over which shadows fade; rounding up costs less than half of a step.
  EXPECT_GE(0.9 * usual.distance, diagonal);
  EXPECT_LT(0.9 * usual.distance, diagonal * std::pow(10.0, 1.0 / 6.0));
  for (const double scale : {1e-3, 1e3}) {
    const depth_maps::Reach scaled = reach(scale, {0, 1, 0}, 4.0, 8.0);
    EXPECT_NEAR(scaled.distance, scale * usual.distance, 1e-9 * scale);
    EXPECT_NEAR(scaled.caster_distance, scale * usual.caster_distance, 1e-9 * scale);
  }
  // Inside of it the camera does not matter; outside it goes by steps.
  EXPECT_EQ(reach(1.0, {3, 3, -3}, 4.0, 8.0).distance, usual.distance);
  EXPECT_GE(0.9 * reach(1.0, {30, 3, 0}, 4.0, 8.0).distance, std::sqrt(34.0 * 34.0 + 3.0 * 3.0 + 4.0 * 4.0));
  EXPECT_EQ(reach(1.0, {30.01, 3, 0}, 4.0, 8.0).distance, reach(1.0, {30, 3, 0}, 4.0, 8.0).distance);
}

TEST(ReachOfScene, OfSmallThingsOnALargeFloorIsWhatTheyNeed) {
  const double bounds[6] = {-5000, 0, -5000, 5000, 3, 5000};
  const depth_maps::Reach reach = depth_maps::reach_of_scene(bounds, 2.0, {0, 2, 0}, 60.0, 200.0);
  EXPECT_EQ(reach.distance, 60.0);
  EXPECT_EQ(reach.caster_distance, 200.0);
  // Where half of what there is has 200 m, shadows of 60 m would be lost among them.
  EXPECT_GE(depth_maps::reach_of_scene(bounds, 200.0, {0, 2, 0}, 60.0, 200.0).distance, 2000.0);
  const double nothing[6] = {};
  EXPECT_EQ(depth_maps::reach_of_scene(nothing, 0.0, {0, 2, 0}, 60.0, 200.0).distance, 60.0);
}

}  // namespace
