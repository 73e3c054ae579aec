// SPDX-License-Identifier: Apache-2.0
// How far shadow_map is from geometry as its knobs rise: the edge of a half plane's shadow on a floor, whose
// displacement README equation (1) says. Prints the tables of the README.
#include "edge.hpp"
#include "views.hpp"

namespace {

using namespace shadow_edge;

struct Settings {
  Filter filter;
  std::uint32_t resolution = 1024;
  std::uint32_t cascades = 3;
};

Edge edge_of(const Settings& settings) {
  constexpr double kDistance = 60.0;  // metres
  const double resolution = settings.resolution;
  const double reach = kDistance / std::pow(shadow_map::kCascadeRatio, settings.cascades - 1.0);
  const double radius = depth_maps::bounding_sphere(camera_of_edge(), reach).radius;
  // As cascade_view: a border for the filter, and half a texel on each side for the grid that stands still.
  const double inside = resolution - 2.0 * depth_maps::guard_texels(settings.filter.radius);
  const double texel = 2.0 * radius / inside * (resolution / (resolution - 1.0));
  return {settings.filter, "shadow_map",
          fmt::format("params.resolution = {}\nparams.cascades = {}\nparams.distance = {}\n", settings.resolution,
                      settings.cascades, kDistance),
          texel, radius};
}

TEST(ShadowMapMeasured, EdgeIsDisplacedByTheNormalOffsetAtEveryIncidence) {
  // Under steeper light the map's axes are the scene's, and the edge is drawn along a row: off by up to half a texel.
  for (const double degrees : {30.0, 45.0, 60.0}) {
    for (const double radius : {0.0, 1.5, 4.0}) {
      Settings settings;
      settings.filter.incidence = degrees * kPi / 180.0;
      settings.filter.radius = radius;
      settings.filter.taps = radius > 0.0 ? 16 : 1;
      const Edge edge = edge_of(settings);
      EXPECT_NEAR(edge.displacement(), edge.expected_displacement(), edge.staircase())
          << degrees << " degrees, radius " << radius;
    }
  }
}

TEST(ShadowMapMeasured, ErrorIsOfFirstOrderInTheTexelAsResolutionRises) {
  double last = 0;
  for (const std::uint32_t resolution : {512U, 1024U, 2048U, 4096U}) {
    Settings settings;
    settings.resolution = resolution;
    const Edge edge = edge_of(settings);
    print_row("resolution", resolution, edge);
    EXPECT_NEAR(edge.displacement(), edge.expected_displacement(), edge.staircase()) << resolution;
    // Half the texel, half the error; the border of the maps, 9 texels each, makes it a little more than half.
    if (last > 0) {
      EXPECT_NEAR(last / edge.wrong_width(), 2.0, 0.15) << resolution;
    }
    last = edge.wrong_width();
  }
}

TEST(ShadowMapMeasured, EachCascadeMakesTheNearErrorAThird) {
  double last = 0;
  for (const std::uint32_t cascades : {1U, 2U, 3U, 4U}) {
    Settings settings;
    settings.cascades = cascades;
    const Edge edge = edge_of(settings);
    print_row("cascades", cascades, edge);
    EXPECT_NEAR(edge.displacement(), edge.expected_displacement(), edge.staircase()) << cascades;
    if (last > 0) {
      EXPECT_NEAR(last / edge.wrong_width(), 3.0, 0.15) << cascades;
    }
    last = edge.wrong_width();
  }
}

TEST(ShadowMapMeasured, TapsApproachTheDisk) {
  std::vector<double> errors;
  for (const std::uint32_t taps : {1U, 4U, 9U, 16U, 25U, 49U}) {
    Settings settings;
    settings.filter.taps = taps;
    settings.filter.radius = 4.0;
    const Edge edge = edge_of(settings);
    errors.push_back(edge.profile_error());
    std::printf("  filter_taps %2u: RMSE of the penumbra %.4f\n", taps, errors.back());
    if (errors.size() < 3) continue;
    // Taps spread evenly: faster than random ones, whose error goes with the root of their number. One tap is the
    // centre.
    EXPECT_LT(errors.back(), errors[1] / std::sqrt(taps / 4.0)) << taps;
  }
}

}  // namespace
