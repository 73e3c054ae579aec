// SPDX-License-Identifier: Apache-2.0
// The hard cases of role light_count for light_count/heat_map, and its colours.
#include "roles/rendering.hpp"

namespace {

using namespace rendering;

constexpr std::uint32_t kSize = 64;

std::string graph_text(const std::string& assignment) {
  return "extent = [64, 64]\noutput = \"counted.count\"\n"
         "[[pass]]\nrole = \"gbuffer\"\ntechnique = \"raster\"\nparams.precision = \"float32\"\n"
         "[[pass]]\nname = \"lights\"\nrole = \"light_assignment\"\ntechnique = \"" +
         assignment + "\"\n[[pass]]\nname = \"counted\"\nrole = \"light_count\"\ntechnique = \"heat_map\"\n";
}

/// A floor in the lower half of the image, 1 m below the camera at 0; the sky above.
void look_over_a_floor(Scene& scene) {
  scene.add_floor({0, -1, 0}, 1e4);
  scene.look({0, 0, 0}, {0, 0, -1}, 1.0);
}

/// Where the pixel sees the floor.
dvec3 floor_at(std::uint32_t x, std::uint32_t y) {
  const double half = std::tan(0.5);
  const dvec3 ray((2.0 * (x + 0.5) / kSize - 1.0) * half, (1.0 - 2.0 * (y + 0.5) / kSize) * half, -1.0);
  return ray / -ray.y;
}

TEST(LightCount, H1WithoutLightAssignmentEveryLightIsMetAtEverySurface) {
  Scene scene;
  look_over_a_floor(scene);
  for (int i = 0; i < 7; ++i) {
    HeddleLight record = light(i % 2 == 0 ? HEDDLE_LIGHT_POINT : HEDDLE_LIGHT_DIRECTIONAL);
    record.range = 0.1F;
    scene.add_light(record, {0, 50, 0});
  }
  Graph graph(graph_text("none"));
  graph.keep("counted.color");
  const Image count = graph.image(scene);
  const Image color = graph.read("counted.color");
  for (std::uint32_t y = 0; y < kSize; ++y)
    for (std::uint32_t x = 0; x < kSize; ++x) {
      const bool is_floor = y >= kSize / 2;
      ASSERT_EQ(count.at(x, y, 0), is_floor ? 7.0F : 0.0F) << x << ", " << y;
      ASSERT_EQ(count.at(x, y, 1), is_floor ? 3.0F : 0.0F) << x << ", " << y;  // the directional ones
      // 7 is between cyan at 5 and green at 26.
      ASSERT_EQ(color.at(x, y, 0), 0.0F);
      ASSERT_EQ(color.at(x, y, 1), is_floor ? 1.0F : 0.0F);
      ASSERT_NEAR(static_cast<double>(color.at(x, y, 2)),
                  is_floor ? 2.0 - 4.0 * std::log(7.0) / std::log(656.8408) : 0.0, 0.01);
    }
}

TEST(LightCount, H2ALightCountsWithinItsRangeAndNotBeyondIt) {
  Scene scene;
  look_over_a_floor(scene);
  HeddleLight record = light(HEDDLE_LIGHT_POINT);
  record.range = 2.0F;
  const dvec3 position(0.3, -0.2, -4);
  scene.add_light(record, position);
  for (const char* assignment : {"none", "brute_force"}) {
    Graph graph(graph_text(assignment));
    const Image count = graph.image(scene);
    int reached = 0;
    for (std::uint32_t y = kSize / 2; y < kSize; ++y)
      for (std::uint32_t x = 0; x < kSize; ++x) {
        const double distance = glm::length(floor_at(x, y) - position);
        if (std::abs(distance - 2.0) < 1e-4) continue;  // the floor's depth in float32
        ASSERT_EQ(count.at(x, y, 1), distance < 2.0 ? 1.0F : 0.0F) << assignment << " " << x << ", " << y;
        ASSERT_GE(count.at(x, y, 0), count.at(x, y, 1));
        reached += distance < 2.0 ? 1 : 0;
      }
    EXPECT_GT(reached, 50);
  }
}

}  // namespace
