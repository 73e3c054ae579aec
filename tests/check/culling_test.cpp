// SPDX-License-Identifier: Apache-2.0
// Culling in whole frames: it touches no pixel, each view has its own, and the statistics say what it did.
#include "parsed.hpp"
#include "roles/rendering.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

namespace {

using rendering::dvec3;
using rendering::Graph;
using rendering::Scene;

class Culling : public testing::Test {
 protected:
  static void SetUpTestSuite() { rendering::Host::flags = HEDDLE_HOST_CHECK; }

  static std::array<int, 2> drawn_and_culled(Graph& graph) {
    const char* text = nullptr;
    rendering::check(heddle_stats(graph.handle, &text));
    const nlohmann::json instances = parsed::json(text)["instances"];
    return {instances["drawn"].get<int>(), instances["culled"].get<int>()};
  }
  static constexpr const char* kGbuffer =
      "extent = [32, 16]\noutput = \"gbuffer.depth\"\n[[pass]]\nrole = \"gbuffer\"\ntechnique = \"raster\"\n";
  static constexpr const char* kDeferred = "extends = \"deferred.toml\"\nextent = [32, 16]\n";
};

TEST_F(Culling, StatisticsSayHowManyInstancesWereDrawnAndCulled) {
  Scene scene;
  for (int i = -2; i <= 2; ++i) scene.add_box(dvec3(10 * i - 0.5, -0.5, -5.5), dvec3(10 * i + 0.5, 0.5, -4.5));
  scene.add_box(dvec3(-0.5, -0.5, 4.5), dvec3(0.5, 0.5, 5.5));  // behind
  scene.look(dvec3(0.0), dvec3(0, 0, -1));
  Graph graph(kGbuffer);
  graph.render(scene);
  EXPECT_EQ(drawn_and_culled(graph), (std::array{1, 5}));
  scene.look(dvec3(0.0), dvec3(0, 0, 1));
  graph.render(scene);
  EXPECT_EQ(drawn_and_culled(graph), (std::array{1, 5})) << "the one behind";
  scene.look(dvec3(0.0), dvec3(0, 1, 0));
  graph.render(scene);
  EXPECT_EQ(drawn_and_culled(graph), (std::array{0, 6}));
  scene.look(dvec3(0, 0, 100), dvec3(0, 0, -1));
  graph.render(scene);
  EXPECT_EQ(drawn_and_culled(graph), (std::array{6, 0}));
}

TEST_F(Culling, FramesWithAndWithoutItHaveTheSameBytes) {
  Scene scene(dvec3(1e5, -2e4, 3e5));
  scene.add_floor(dvec3(0, -1, 0), 50);
  for (int x = -6; x <= 6; ++x) {
    for (int z = -6; z <= 6; ++z) {
      // Many of them cross the edges of the view, and of the shadow's views.
      const dvec3 low(3.1 * x, -1 + 0.3 * ((x + z) % 3), 3.3 * z);
      scene.add_box(low, low + dvec3(1.7, 1 + 0.1 * (x + 6), 0.9));
    }
  }
  scene.add_light(rendering::light(HEDDLE_LIGHT_DIRECTIONAL, dvec3(1, -1, 0.5), 1e4));
  scene.add_light(rendering::light(HEDDLE_LIGHT_POINT, dvec3(0, -1, 0), 1e3), dvec3(1, 4, 2));
  scene.look(dvec3(0.3, 1, 0.2), dvec3(4, 0.5, -3));
  Graph graph(kDeferred, {"shadow.params.resolution=128"});
  const char* report = nullptr;
  // The check's second run draws everything.
  ASSERT_EQ(heddle_graph_check(graph.handle, scene.handle, nullptr, 1, &report), HEDDLE_OK)
      << heddle_error(rendering::Host::get().handle);
  graph.render(scene);
  EXPECT_GT(drawn_and_culled(graph)[0], 100);
  EXPECT_GT(drawn_and_culled(graph)[1], 100);
}

TEST_F(Culling, CasterOutOfTheCamerasViewStillCastsItsShadow) {
  const auto lit = [](bool has_caster) {
    Scene scene;
    scene.add_floor(dvec3(0, 0, 0), 4);
    // Beside and above what the camera sees; the light comes from there.
    if (has_caster) scene.add_box(dvec3(-9, 8, -2), dvec3(-7, 9, 2));
    scene.add_light(rendering::light(HEDDLE_LIGHT_DIRECTIONAL, dvec3(1, -1, 0), 1e5));
    scene.look(dvec3(0, 3, 0), dvec3(0.0), 0.6);
    Graph camera(kGbuffer);
    camera.render(scene);
    EXPECT_EQ(drawn_and_culled(camera), (std::array{1, has_caster ? 1 : 0})) << "the caster is out of view";
    Graph graph(kDeferred, {"output=lighting.radiance", "sky.technique=uniform", "sky.params.radiance=[0, 0, 0]"});
    return graph.image(scene).at(16, 8);
  };
  EXPECT_GT(lit(false), 1.0F);
  EXPECT_EQ(lit(true), 0.0F);
}

}  // namespace
