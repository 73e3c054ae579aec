// SPDX-License-Identifier: Apache-2.0
// shadow_map's views and its normal offset: properties of the geometry, without a device.
#include "views.hpp"
#include "cameras.hpp"
#include "normal_offset.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace {

using glm::dmat4;
using glm::dvec2;
using glm::dvec3;
using glm::dvec4;
using shadow_cameras::camera_along;
using shadow_cameras::random_direction;
using shadow_map::Layout;
using shadow_map::Settings;

/// A map that fills its layer, and what shaders know of it.
struct MapView {
  depth_maps::MapView map;
  depth_maps::LookupView lookup;
};

std::vector<MapView> make_views(const HeddleLight& light, const HeddleView& camera, const dvec3& origin,
                                const Settings& settings) {
  std::vector<MapView> views;
  for (const depth_maps::MapView& map : shadow_map::make_views(
           light, origin + depth_maps::to_double(light.position_rel), camera, origin, settings, settings.resolution))
    views.push_back({map, depth_maps::make_lookup(map, origin, {0, 0, 0, settings.resolution}, settings.resolution)});
  return views;
}

HeddleLight light_of(std::uint32_t type, const dvec3& direction, const dvec3& position = dvec3(0.0)) {
  HeddleLight light{};
  light.type = type;
  light.flags = HEDDLE_LIGHT_CASTS_SHADOW;
  const dvec3 d = glm::normalize(direction);
  for (int i = 0; i < 3; ++i) {
    light.direction[i] = static_cast<float>(d[i]);
    light.position_rel[i] = static_cast<float>(position[i]);
    light.intensity[i] = 1.0F;
  }
  light.tangent[0] = 1.0F;
  light.cos_inner = 0.9F;
  light.cos_outer = 0.8F;
  return light;
}

/// ndc of a point, as the shader computes it.
dvec3 project(const MapView& view, const dvec3& position_rel) {
  dmat4 matrix;
  for (int c = 0; c < 4; ++c) {
    for (int r = 0; r < 4; ++r) matrix[c][r] = view.lookup.clip_from_rel[4 * c + r];
  }
  const dvec4 clip = matrix * dvec4(position_rel, 1.0);
  return dvec3(clip) / clip.w;
}

double largest(const dvec3& ndc) {
  return std::max(std::abs(ndc.x), std::abs(ndc.y));
}

TEST(ShadowMapViews, BoundingSphereHoldsTheWholeView) {
  for (const double half_height : {0.1, 0.577, 1.5}) {
    for (const double aspect : {0.5, 1.0, 1.78, 3.0}) {
      const HeddleView camera = camera_along({0, 0, -1}, half_height, aspect);
      const auto sphere = depth_maps::bounding_sphere(camera, 10.0);
      for (const double distance : {0.0, 5.0, 10.0}) {
        const dvec3 corner(half_height * aspect * distance, half_height * distance, distance);
        EXPECT_LE(glm::length(corner - dvec3(0, 0, sphere.centre_distance)), sphere.radius * (1 + 1e-6));
      }
    }
  }
}

TEST(ShadowMapViews, EachCascadeHoldsItsPartOfTheViewInsideTheGuard) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  Settings settings;
  for (int trial = 0; trial < 50; ++trial) {
    const dvec3 forward = random_direction(random);
    const HeddleView camera = camera_along(forward, 0.5, 1.6);
    const auto views = make_views(light_of(HEDDLE_LIGHT_DIRECTIONAL, random_direction(random)), camera,
                                  1e5 * random_direction(random), settings);
    ASSERT_EQ(views.size(), 3U);
    for (std::size_t i = 0; i < views.size(); ++i) {
      const double reach = settings.distance / std::pow(shadow_map::kCascadeRatio, static_cast<double>(2 - i));
      for (int point = 0; point < 50; ++point) {
        const double d = reach * unit(random);
        dvec3 p(0.0);
        const double weights[3] = {0.8 * d * (2 * unit(random) - 1), 0.5 * d * (2 * unit(random) - 1), -d};
        for (int c = 0; c < 3; ++c) {
          for (int r = 0; r < 3; ++r) p[r] += weights[c] * camera.rel_from_view[4 * c + r];
        }
        const dvec3 ndc = project(views[i], p);
        EXPECT_LE(largest(ndc), 1.0 - views[i].lookup.guard + 1e-5);
        EXPECT_GE(ndc.z, 0.0);
        EXPECT_LE(ndc.z, 1.0);
      }
    }
  }
}

TEST(ShadowMapViews, CascadesStandStillInTheSceneWhenTheCameraMoves) {
  Settings settings;
  const HeddleView camera = camera_along({0.3, -0.2, -1}, 0.5, 1.6);
  const HeddleLight sun = light_of(HEDDLE_LIGHT_DIRECTIONAL, {0.4, -1, 0.3});
  const dvec3 scene_point(1e5 + 3.0, 2.0, -4.0);
  for (std::size_t cascade = 0; cascade < 3; ++cascade) {
    dvec2 first(0.0);
    for (int step = 0; step < 20; ++step) {
      const dvec3 origin(1e5 + 0.137 * step, 0.31 * step, 0.071 * step);
      const auto views = make_views(sun, camera, origin, settings);
      const dvec3 ndc = project(views[cascade], scene_point - origin);
      const dvec2 texels = (dvec2(ndc) * 0.5 + 0.5) * static_cast<double>(settings.resolution);
      if (step == 0) first = texels;
      const dvec2 moved = texels - first;
      // Whole texels, up to float32 matrices: 1e-7 of 1024 texels, and the translation's rounding.
      EXPECT_NEAR(moved.x, std::round(moved.x), 0.01) << cascade << ' ' << step;
      EXPECT_NEAR(moved.y, std::round(moved.y), 0.01) << cascade << ' ' << step;
    }
  }
}

TEST(ShadowMapViews, CubeFacesCoverEveryDirectionInsideTheGuard) {
  std::mt19937 random(2);
  Settings settings;
  const dvec3 position(1.0, 2.0, -3.0);
  const auto views = make_views(light_of(HEDDLE_LIGHT_POINT, {0, -1, 0}, position), camera_along({0, 0, -1}, 0.5, 1.0),
                                dvec3(0.0), settings);
  ASSERT_EQ(views.size(), 6U);
  for (int trial = 0; trial < 2000; ++trial) {
    const dvec3 d = random_direction(random);
    int axis = 0;
    for (int i = 1; i < 3; ++i) {
      if (std::abs(d[i]) > std::abs(d[axis])) axis = i;
    }
    const auto face = static_cast<std::size_t>(2 * axis + (d[axis] < 0.0 ? 1 : 0));  // +X -X +Y -Y +Z -Z
    const MapView& view = views[face];
    EXPECT_GT(glm::dot(d, dvec3(view.lookup.axis[0], view.lookup.axis[1], view.lookup.axis[2])), 0.5);
    const dvec3 ndc = project(view, position + 5.0 * d);
    EXPECT_LE(largest(ndc), 1.0 - view.lookup.guard + 1e-5);
    EXPECT_GT(ndc.z, 0.0);
    EXPECT_LT(ndc.z, 1.0);
  }
}

TEST(ShadowMapViews, SpotHoldsItsConeAndWideSpotsBecomeCubes) {
  Settings settings;
  const HeddleView camera = camera_along({0, 0, -1}, 0.5, 1.0);
  HeddleLight spot = light_of(HEDDLE_LIGHT_SPOT, {0.2, -1, 0.1}, {0, 4, 0});
  const auto views = make_views(spot, camera, dvec3(0.0), settings);
  ASSERT_EQ(views.size(), 1U);
  const dvec3 axis = glm::normalize(dvec3(0.2, -1, 0.1));
  const dvec3 side = glm::normalize(glm::cross(axis, dvec3(1, 0, 0)));
  const dvec3 other = glm::cross(axis, side);
  for (int i = 0; i < 64; ++i) {
    const double angle = 0.1 * i;
    const dvec3 edge = 0.8 * axis + 0.6 * (std::cos(angle) * side + std::sin(angle) * other);  // cos_outer is 0.8
    EXPECT_LE(largest(project(views[0], dvec3(0, 4, 0) + 3.0 * edge)), 1.0 - views[0].lookup.guard + 1e-5);
  }
  spot.cos_outer = 0.3F;
  EXPECT_EQ(shadow_map::views_needed(spot, settings).layout, Layout::kCube);
}

TEST(ShadowMapViews, BoxLightCoversExactlyItsBox) {
  Settings settings;
  HeddleLight box = light_of(HEDDLE_LIGHT_BOX, {0, -1, 0}, {2, 5, 1});
  box.half_extent[0] = 3;
  box.half_extent[1] = 1;
  box.half_extent[2] = 4;
  const auto views = make_views(box, camera_along({0, 0, -1}, 0.5, 1.0), dvec3(0.0), settings);
  ASSERT_EQ(views.size(), 1U);
  const double guard = views[0].lookup.guard;
  // Tangent is X, direction x tangent is +Z.
  EXPECT_NEAR(std::abs(project(views[0], dvec3(5, 5, 1)).x), 1.0 - guard, 1e-5);
  EXPECT_NEAR(std::abs(project(views[0], dvec3(2, 5, 2)).y), 1.0 - guard, 1e-5);
  EXPECT_NEAR(project(views[0], dvec3(2, 9, 1)).z, 1.0, 1e-5);
  EXPECT_NEAR(project(views[0], dvec3(2, 1, 1)).z, 0.0, 1e-5);
}

TEST(ShadowMapViews, OnlyShiningLightsThatCastGetViews) {
  const Settings settings;
  HeddleLight light = light_of(HEDDLE_LIGHT_POINT, {0, -1, 0});
  EXPECT_EQ(shadow_map::views_needed(light, settings).count, 6U);
  light.flags = 0;
  EXPECT_EQ(shadow_map::views_needed(light, settings).count, 0U);
  light = light_of(HEDDLE_LIGHT_ENVIRONMENT, {0, -1, 0});
  EXPECT_EQ(shadow_map::views_needed(light, settings).count, 0U);
  light = light_of(HEDDLE_LIGHT_DIRECTIONAL, {0, -1, 0});
  light.intensity[0] = light.intensity[1] = light.intensity[2] = 0.0F;
  EXPECT_EQ(shadow_map::views_needed(light, settings).count, 0U);
}

TEST(ShadowMapKernel, TapsAreCentredAndReachTheRim) {
  for (const std::uint32_t taps : {1U, 2U, 4U, 9U, 16U, 25U, 64U}) {
    const auto kernel = depth_maps::make_kernel(taps);
    ASSERT_EQ(kernel.size(), taps);
    dvec2 mean(0.0);
    double longest = 0;
    for (const auto& tap : kernel) {
      mean += dvec2(tap[0], tap[1]) / static_cast<double>(taps);
      longest = std::max(longest, glm::length(dvec2(tap[0], tap[1])));
    }
    EXPECT_NEAR(glm::length(mean), 0.0, 1e-6);
    EXPECT_LE(longest, 1.0 + 1e-6);
    if (taps == 1) {
      EXPECT_EQ(longest, 0.0);
    }
  }
}

TEST(ShadowMapSizes, TexelsAreAsFineAsThePixelsThatSeeThemAndNoFinerThanThat) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  int coarser = 0;
  for (int trial = 0; trial < 400; ++trial) {
    Settings settings;
    settings.fineness = std::pow(2.0, 4.0 * unit(random) - 2.0);
    settings.smallest = 32;
    HeddleView camera = camera_along(random_direction(random), 0.5, 1.6);
    camera.extent[0] = 1280;
    camera.extent[1] = 720;
    HeddleLight light = light_of(trial % 2 == 0 ? HEDDLE_LIGHT_SPOT : HEDDLE_LIGHT_POINT, {0, -1, 0},
                                 (1.0 + 300.0 * unit(random)) * random_direction(random));
    light.range = static_cast<float>(1.0 + 20.0 * unit(random));
    const std::uint32_t level = shadow_map::level_needed(light, camera, settings);
    ASSERT_LT(level, shadow_map::levels_of(settings));
    const double nearest = glm::length(depth_maps::to_double(light.position_rel)) - static_cast<double>(light.range);
    if (nearest <= 0) {
      EXPECT_EQ(level, 0U) << "the eye may be beside what is lit";
      continue;
    }
    const double pixel = nearest * 2.0 * 0.5 / 720.0;
    const double tangent = trial % 2 == 0 ? 0.75 : 1.0;  // cos_outer is 0.8
    const double border = 2.0 * depth_maps::guard_texels(settings.filter_radius);
    const auto texel = [&](std::uint32_t at) {
      return 2.0 * tangent * static_cast<double>(light.range) / ((settings.resolution >> at) - border);
    };
    if (level > 0) {
      EXPECT_LE(texel(level), pixel / settings.fineness * (1 + 1e-6));
      ++coarser;
    }
    if (level + 1 < shadow_map::levels_of(settings)) {
      EXPECT_GT(texel(level + 1), pixel / settings.fineness * (1 - 1e-6));
    }
  }
  EXPECT_GT(coarser, 100);
  const HeddleView camera = camera_along({0, 0, -1}, 0.5, 1.0);
  EXPECT_EQ(shadow_map::level_needed(light_of(HEDDLE_LIGHT_POINT, {0, -1, 0}, {0, 0, 1000}), camera, {}), 0U)
      << "without a range it may light what is near";
}

/// Reversed depth of the plane n.(x - p) = 0 in the view, at the centre of the texel nearest to `texel`.
struct PlaneInView {
  const MapView& view;
  const dvec3& p;
  const dvec3& n;
  double resolution;

  [[nodiscard]] double depth_at(const dvec2& texel) const {
    // The ray of the texel: through two depths of the same ndc.
    dmat4 matrix;
    for (int c = 0; c < 4; ++c) {
      for (int r = 0; r < 4; ++r) matrix[c][r] = view.lookup.clip_from_rel[4 * c + r];
    }
    const dmat4 inverse = glm::inverse(matrix);
    const dvec2 ndc = texel / resolution * 2.0 - 1.0;
    const auto at = [&](double depth) {
      const dvec4 q = inverse * dvec4(ndc, depth, 1.0);
      return dvec3(q) / q.w;
    };
    const dvec3 a = at(0.9);
    const dvec3 b = at(0.1);
    const double t = glm::dot(n, p - a) / glm::dot(n, b - a);
    return project(view, a + t * (b - a)).z;
  }
};

TEST(ShadowMapOffset, NoTexelThatTheFilterReadsShowsTheReceiversOwnPlaneInFront) {
  // Hard case H1 as geometry: planes of every orientation up to NoL = 0.05, at random places of the map's grid.
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  Settings settings;
  settings.resolution = 512;
  const HeddleView camera = camera_along({0, 0, -1}, 0.5, 1.0);
  for (const std::uint32_t type : {HEDDLE_LIGHT_DIRECTIONAL, HEDDLE_LIGHT_SPOT, HEDDLE_LIGHT_POINT}) {
    for (const double filter_radius : {0.0, 1.5, 4.0}) {
      settings.filter_radius = filter_radius;
      double tightest = 1e9;       // smallest room between the lookup and its own plane, of its depth
      double tightest_half = 1e9;  // the same with half of the offset
      for (int trial = 0; trial < 3000; ++trial) {
        const dvec3 light_position(0.3, 6.0, -5.0);
        const auto views = make_views(light_of(type, {0.1, -1, 0.2}, light_position), camera, dvec3(0.0), settings);
        const MapView& view = type == HEDDLE_LIGHT_POINT ? views[3] : views[0];  // the face that looks down
        const dvec3 axis(view.lookup.axis[0], view.lookup.axis[1], view.lookup.axis[2]);
        const bool is_parallel = type == HEDDLE_LIGHT_DIRECTIONAL;
        const dvec3 p = is_parallel
                            ? dvec3(unit(random) - 0.5, unit(random) - 0.5, -3.0 * unit(random))
                            : light_position + 4.0 * (axis + 0.4 * dvec3(unit(random) - 0.5, 0, unit(random) - 0.5));
        const dvec3 L = is_parallel ? -axis : glm::normalize(light_position - p);
        dvec3 n = random_direction(random);
        // Half of the planes graze.
        const double NoL = trial % 2 == 0 ? 0.05 : 0.05 + 0.95 * unit(random);
        n = glm::normalize(n - glm::dot(n, L) * L);
        n = NoL * L + std::sqrt(1 - NoL * NoL) * n;

        const double texel = view.lookup.texel_size * (is_parallel ? 1.0 : glm::dot(p - light_position, axis));
        const double along = glm::dot(n, axis);
        const double offset =
            normal_offset_float64::normal_offset(filter_radius, texel, std::sqrt(1 - along * along), 0);
        const PlaneInView plane{view, p, n, 512.0};
        for (const bool is_half : {false, true}) {
          const dvec3 lookup = project(view, p + n * (is_half ? 0.5 * offset : offset));
          const dvec2 place = (dvec2(lookup) * 0.5 + 0.5) * 512.0;
          double& least = is_half ? tightest_half : tightest;
          for (int corner = 0; corner < 16; ++corner) {
            const double angle = corner * 0.3926990817;
            const dvec2 tap = place + filter_radius * dvec2(std::cos(angle), std::sin(angle));
            // The four texels around the tap: their centres.
            for (const dvec2 step : {dvec2(0, 0), dvec2(1, 0), dvec2(0, 1), dvec2(1, 1)}) {
              const dvec2 centre = floor(tap - 0.5) + 0.5 + step;
              const double stored = plane.depth_at(centre);
              least = std::min(least, (lookup.z - stored) / lookup.z);
            }
          }
        }
      }
      EXPECT_GE(tightest, 0.0) << "light type " << type << ", radius " << filter_radius;
      EXPECT_LT(tightest_half, 0.0) << "half of the offset would do: light type " << type << ", radius "
                                    << filter_radius;
    }
  }
}

}  // namespace
