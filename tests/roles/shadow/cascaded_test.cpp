// SPDX-License-Identifier: Apache-2.0
// How far cascaded is from geometry as its knobs rise, what blending does at the seams of cascades, and how many maps a
// walk draws. Prints the tables of the README.
#include "cascades.hpp"
#include "edge.hpp"
#include "parsed.hpp"

#include <nlohmann/json.hpp>

namespace {

using namespace shadow_edge;

struct CascadedSettings {
  Filter filter;
  cascaded::Settings map;
};

std::string parameters_of(const cascaded::Settings& map) {
  return fmt::format("params.resolution = {}\nparams.cascades = {}\nparams.slack = {}\nparams.distance = {}\n",
                     map.resolution, map.cascades, map.slack, map.distance);
}

Edge cascaded_edge(const CascadedSettings& settings) {
  cascaded::Settings map = settings.map;
  map.filter_radius = settings.filter.radius;
  map.caster_distance = Edge::kCasterDistance;
  const HeddleView camera = [] {
    HeddleView view = camera_of_edge();
    view.rel_from_view[0] = view.rel_from_view[5] = view.rel_from_view[10] = view.rel_from_view[15] = 1.0F;
    return view;
  }();
  HeddleLight sun{};
  sun.direction[1] = -1.0F;
  const double texel = depth_maps::texel_size(cascaded::make_views(sun, camera, dvec3(0.0), map).front());
  // README equation (3).
  const double radius = depth_maps::bounding_sphere(camera, cascaded::reaches(map).front()).radius;
  const double side = map.resolution;
  const double guard = depth_maps::guard_texels(map.filter_radius);
  EXPECT_NEAR(texel, 2.0 * radius * side / (side - 2.0 * guard) * side / (side - map.slack) / side, 1e-12);
  return {settings.filter, "cascaded", parameters_of(map) + "params.blend = 0.0\n", texel, radius};
}

TEST(CascadedMeasured, EdgeIsDisplacedByTheNormalOffsetAtEveryIncidence) {
  for (const double degrees : {30.0, 45.0, 60.0}) {
    for (const double radius : {0.0, 1.5, 4.0}) {
      CascadedSettings settings;
      settings.filter = {degrees * kPi / 180.0, radius > 0.0 ? 16U : 1U, radius};
      const Edge edge = cascaded_edge(settings);
      EXPECT_NEAR(edge.displacement(), edge.expected_displacement(), edge.staircase())
          << degrees << " degrees, radius " << radius;
    }
  }
}

TEST(CascadedMeasured, ErrorIsOfFirstOrderInTheTexelAsResolutionRises) {
  double last = 0;
  for (const std::uint32_t resolution : {512U, 1024U, 2048U, 4096U}) {
    CascadedSettings settings;
    settings.map.resolution = resolution;
    const Edge edge = cascaded_edge(settings);
    print_row("resolution", resolution, edge);
    EXPECT_NEAR(edge.displacement(), edge.expected_displacement(), edge.staircase()) << resolution;
    // Half the texel, half the error; borders and slack, 34 texels in all, make it a little more than half.
    if (last > 0) {
      EXPECT_NEAR(last / edge.wrong_width(), 2.0, 0.2) << resolution;
    }
    last = edge.wrong_width();
  }
}

TEST(CascadedMeasured, MoreCascadesMakeTheNearErrorSmaller) {
  double last = 1e9;
  for (const std::uint32_t cascades : {1U, 2U, 3U, 4U, 6U, 8U}) {
    CascadedSettings settings;
    settings.map.cascades = cascades;
    settings.map.distance = 40.0;  // the patch of one cascade's 48 texels stays in view
    const Edge edge = cascaded_edge(settings);
    print_row("cascades", cascades, edge);
    EXPECT_NEAR(edge.displacement(), edge.expected_displacement(), edge.staircase()) << cascades;
    EXPECT_LT(edge.wrong_width(), last) << cascades;
    last = edge.wrong_width();
  }
}

/// The shadow's edge along a strip of floor that goes away from the camera through the first seam, by rows: metres by
/// which the shadow is too long.
std::vector<double> edge_along_a_strip(double blend, double& seam) {
  constexpr double kHeight = 1.0;
  const dvec3 to_light = glm::normalize(dvec3(1.0, 1.0, 0.0));
  const double place = -kHeight * to_light.x / to_light.y;
  const dvec3 camera(place, 2.0, 0.0);
  cascaded::Settings map;
  map.resolution = 512;
  map.distance = 60.0;
  Scene scene;
  scene.add_floor({0, 0, 0}, 100.0);
  scene.add_floor({-100, kHeight, 0}, 100.0);  // its edge is at x = 0, above
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, -to_light));
  scene.look(camera, camera + dvec3(0, 0, -1));

  // Where the first cascade's guard begins.
  HeddleView view = camera_of_edge();
  view.rel_from_view[0] = view.rel_from_view[5] = view.rel_from_view[10] = view.rel_from_view[15] = 1.0F;
  HeddleLight sun{};
  for (int i = 0; i < 3; ++i) sun.direction[i] = static_cast<float>(-to_light[i]);
  const depth_maps::MapView first = cascaded::make_views(sun, view, camera, map).front();
  seam = 0;
  for (double z = 0; z < 60.0; z += 0.01) {
    const dvec3 texel = depth_maps::texel_of(first, {place, 0, -z});
    const double edge =
        std::max(std::abs(texel.x / map.resolution - 0.5), std::abs(texel.y / map.resolution - 0.5)) * 2;
    if (edge <= 1.0 - 2.0 * first.guard_texels / map.resolution) seam = z;
  }
  Patch patch{{place - 0.75, 0, -seam + 2.0}, {1.5, 0, 0}, {0, 0, -4.0}, {0, 1, 0}};
  patch.camera = camera;
  patch.grid = 256;
  const Image image =
      ask(scene, patch, shadow_patch::cascaded(parameters_of(map) + fmt::format("params.blend = {}\n", blend)));
  std::vector<double> rows;
  for (std::uint32_t y = 0; y < patch.grid; ++y) {
    double dark = 0;
    for (std::uint32_t x = 0; x < patch.grid; ++x) dark += 1.0 - static_cast<double>(image.at(x, y));
    rows.push_back((dark / patch.grid - 0.5) * 1.5);
  }
  return rows;
}

TEST(CascadedMeasured, BlendingTurnsTheStepAtASeamIntoASlope) {
  // Over windows of 16 rows, 25 cm, the staircase of texels evens out.
  const auto smooth = [](const std::vector<double>& rows) {
    std::vector<double> means;
    for (std::size_t i = 0; i + 16 <= rows.size(); i += 16) {
      double sum = 0;
      for (std::size_t k = 0; k < 16; ++k) sum += rows[i + k];
      means.push_back(sum / 16.0);
    }
    return means;
  };
  const auto largest_step = [](const std::vector<double>& means) {
    double largest = 0;
    for (std::size_t i = 1; i < means.size(); ++i) largest = std::max(largest, std::abs(means[i] - means[i - 1]));
    return largest;
  };
  double seam = 0;
  const std::vector<double> sharp = smooth(edge_along_a_strip(0.0, seam));
  const double step = largest_step(sharp);
  std::printf("  the first seam is at %.2f m\n", seam);
  for (const double blend : {0.0, 0.1, 0.2, 0.4}) {
    const std::vector<double> means = smooth(edge_along_a_strip(blend, seam));
    std::printf("  blend %.1f: largest step of the edge within 25 cm %.1f mm\n", blend, 1e3 * largest_step(means));
    // Beyond the seam nothing blends; there is the second cascade alone.
    EXPECT_NEAR(means.back(), sharp.back(), 1e-6) << blend;
    if (blend >= 0.2) {
      EXPECT_LT(largest_step(means), 0.6 * step) << blend;
    }
  }
  EXPECT_GT(step, 0.02) << "there is a seam to be seen";
}

TEST(CascadedMeasured, AWalkDrawsFewerMapsTheMoreSlackTheyHave) {
  std::uint64_t last = ~0ULL;
  for (const int slack : {1, 4, 16, 64}) {
    Scene scene;
    scene.add_floor({0, 0, 0}, 100.0);
    scene.add_box({-1, 0, -6}, {1, 2, -5});
    scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0.4, -1, 0.3}));
    cascaded::Settings map;
    map.slack = slack;
    HeddleView view = camera_of_edge();
    const double texel = depth_maps::texel_size(
        cascaded::make_views(light(HEDDLE_LIGHT_DIRECTIONAL, {0.4, -1, 0.3}), view, dvec3(0.0), map).front());
    Patch patch{{-1, -2, -5}, {2, 0, 0}, {0, 0, 2}, {0, 1, 0}};
    patch.grid = 16;
    Graph graph("extent = [16, 16]\noutput = \"probe.values\"\n" + shadow_patch::cascaded(parameters_of(map)) +
                "[[pass]]\nname = \"probe\"\nrole = \"probe\"\ntechnique = \"shadow\"\n" + patch.text());
    std::uint64_t drawn = 0, kept = 0;
    for (int step = 0; step < 100; ++step) {
      // 1.4 m/s at 60 frames a second, and a slow turn.
      const dvec3 eye(0.0233 * step, 1.7, 0);
      scene.look(eye, eye + dvec3(std::sin(0.01 * step), 0, -std::cos(0.01 * step)));
      graph.render(scene);
      const char* text = nullptr;
      check(heddle_stats(graph.handle, &text));
      const nlohmann::json said = parsed::json(text);
      for (const auto& count : said["counts"])
        (count["name"] == "maps_drawn" ? drawn : kept) += count["count"].get<std::uint64_t>();
    }
    std::printf("  slack %2d: first texel %.2f mm, %llu of %llu maps drawn\n", slack, 1e3 * texel,
                static_cast<unsigned long long>(drawn), static_cast<unsigned long long>(drawn + kept));
    EXPECT_EQ(drawn + kept, 400U);
    // The slow turn alone moves the first map by 5 texels a frame.
    EXPECT_LE(drawn, slack < 16 ? 400U : slack < 64 ? 200U : 60U) << slack;
    EXPECT_LE(drawn, last) << slack;
    last = drawn;
  }
}

}  // namespace
