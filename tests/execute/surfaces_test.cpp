// SPDX-License-Identifier: Apache-2.0
// Surfaces that techniques make, against the same triangles as the scene has them: drawn by gbuffer, shadow, forward
// and transparency, traced, culled, replaced, placed by the GPU.
#include "parsed.hpp"
#include "roles/rendering.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

namespace {

using namespace rendering;

// Every frame below is proven: barriers, and numbers that passes make.
const bool kIsChecked = [] {
  Host::flags = HEDDLE_HOST_CHECK;
  return true;
}();

std::string deferred(const std::string& make, const std::string& more = {}) {
  return "extends = \"studio\"\nextent = [64, 40]\n" + more + make;
}

/// Passes above the gbuffer: `surfaces` of all below is what they make.
std::string above(const std::string& technique, const std::string& more = {}) {
  return "[[pass]]\nname = \"make\"\nrole = \"made\"\nbefore = \"gbuffer\"\ntechnique = \"" + technique + "\"\n" + more;
}

void furnish(Scene& scene) {
  scene.add_floor(dvec3(0, 0, 0), 6);
  scene.add_box(dvec3(-2, 0, -1), dvec3(-1, 1, 0));
  scene.add_sphere(dvec3(0.5, 0.7, -0.5), 0.7, 12);
  HeddleMaterial glass = Scene::grey();
  glass.alpha_mode = HEDDLE_ALPHA_BLEND;
  glass.base_color[3] = 0.4F;
  scene.use_material(glass);
  scene.add_box(dvec3(1, 0, 0), dvec3(1.8, 1, 0.5));
  scene.add_box(dvec3(-1.5, 0.2, 0.6), dvec3(-0.5, 0.8, 0.9));
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, dvec3(0.4, -1, -0.3), 3));
  scene.look(dvec3(1, 2, 4), dvec3(0, 0.5, 0));
}

nlohmann::json stats(Graph& graph) {
  const char* text = nullptr;
  check(heddle_stats(graph.handle, &text));
  return parsed::json(text);
}

void expect_same(const Image& a, const Image& b, const std::string& what) {
  ASSERT_EQ(a.pixels.size(), b.pixels.size());
  std::size_t different = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i)
    different += std::memcmp(&a.pixels[i], &b.pixels[i], 4) != 0 ? 1 : 0;
  EXPECT_EQ(different, 0U) << what;
}

TEST(MadeSurfaces, LookInEveryByteLikeTheMeshesInWhosePlaceTheyAre) {
  Scene scene;
  furnish(scene);
  for (const char* lighting : {"deferred", "forward"}) {
    const std::string traced = std::string("[[pass]]\nname = \"lighting\"\ntechnique = \"") + lighting +
                               "\"\n[[pass]]\nname = \"ao\"\ntechnique = \"ray_traced\"\nparams.samples = 16\n";
    Graph plain(deferred({}, traced)), copied(deferred(above("copies"), traced)),
        half(deferred(above("copies", "params.every = 2\n"), traced));
    for (Graph* graph : {&plain, &copied, &half}) {
      graph->keep("gbuffer.depth");
      graph->keep("gbuffer.normal");
      graph->keep("ao.visibility");
      for (int k = 0; k < 2; ++k) graph->render(scene);
    }
    const Image reference = plain.read();
    std::size_t covered = 0;
    for (const float depth : plain.read("gbuffer.depth").pixels) covered += std::isfinite(depth) ? 1 : 0;
    EXPECT_GT(covered, 1000U);
    for (Graph* graph : {&copied, &half}) {
      expect_same(graph->read(), reference, lighting);
      for (const char* port : {"gbuffer.depth", "gbuffer.normal", "ao.visibility"})
        expect_same(graph->read(port), plain.read(port), port);
    }
  }
}

TEST(MadeSurfaces, TakeTheMeshesOfTheirInstancesAway) {
  Scene scene;
  furnish(scene);
  Graph graph(deferred(above("copies", "params.removes = true\n")));
  graph.keep("gbuffer.depth");
  graph.render(scene);
  for (const float depth : graph.read("gbuffer.depth").pixels) ASSERT_TRUE(std::isinf(depth));
}

TEST(MadeSurfaces, AreCulledAsInstancesAre) {
  Scene scene;
  furnish(scene);
  scene.use_material(Scene::grey());
  scene.add_box(dvec3(0, 0, 50), dvec3(1, 1, 51));  // behind the camera
  Graph plain(deferred({})), copied(deferred(above("copies")));
  plain.render(scene);
  copied.render(scene);
  EXPECT_GT(stats(plain)["instances"]["culled"], 0);
  EXPECT_EQ(stats(copied)["instances"], stats(plain)["instances"]);
}

TEST(MadeSurfaces, AreMadeAnewForAnotherScene) {
  Scene first, second;
  furnish(first);
  furnish(second);
  second.add_box(dvec3(-3, 0, -3), dvec3(-2, 2, -2));
  Graph plain(deferred({})), copied(deferred(above("copies")));
  for (Scene* scene : {&first, &second, &first}) expect_same(copied.image(*scene), plain.image(*scene), "scene");
  second.add_sphere(dvec3(2, 1, -2), 0.5, 8);  // and for one that grows
  expect_same(copied.image(second), plain.image(second), "grown scene");
}

/// The squares of made/listed and made/counted, as meshes.
void add_squares(Scene& scene) {
  for (int i = 0; i < 24; ++i) {
    if (i % 3 == 2) continue;
    const float h = 0.4F;
    scene.add_mesh({-h, -h, 0, h, -h, 0, h, h, 0, -h, h, 0}, {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, {0, 1, 2, 0, 2, 3},
                   glm::translate(dmat4(1.0), dvec3(-3.5 + i % 8, -1 + i / 8, -8)));
  }
}

TEST(MadeSurfaces, AreDrawnAndTracedWhereTheGpuPutsThem) {
  Scene squares, floor;
  for (Scene* scene : {&squares, &floor}) {
    scene->add_floor(dvec3(0, -1.6, -8), 8);
    scene->add_light(light(HEDDLE_LIGHT_DIRECTIONAL, dvec3(0.4, -1, -0.3), 3));
    scene->look(dvec3(0, 1, 1), dvec3(0, 0, -8));
  }
  add_squares(squares);
  const std::string traced = "[[pass]]\nname = \"ao\"\ntechnique = \"ray_traced\"\nparams.samples = 16\n";
  Graph plain(deferred({}, traced));
  plain.keep("gbuffer.depth");
  plain.keep("ao.visibility");
  plain.render(squares);
  for (const char* technique : {"listed", "counted"}) {
    Graph made(deferred(above(technique), traced));
    made.keep("gbuffer.depth");
    made.keep("ao.visibility");
    for (int k = 0; k < 2; ++k) made.render(floor);
    expect_same(made.read(), plain.read(), technique);
    expect_same(made.read("gbuffer.depth"), plain.read("gbuffer.depth"), technique);
    // The scene's centre, to which a snapshot's positions are relative, is another: rays differ by rounding.
    const Image a = made.read("ao.visibility"), b = plain.read("ao.visibility");
    std::size_t different = 0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i) different += std::abs(a.pixels[i] - b.pixels[i]) > 1e-4F ? 1 : 0;
    EXPECT_LT(different, a.pixels.size() / 100) << technique;
  }
}

TEST(MadeSurfaces, AreInSnapshotsWithWhatIsBeneathThem) {
  Scene scene;
  scene.add_floor(dvec3(0, 0, 0), 6);
  scene.look(dvec3(0, 1, 5), dvec3(0, 0, 0));
  const auto seen = [&](const std::string& make) {
    Graph graph("extent = [8, 8]\noutput = \"look.color\"\n" + make +
                "[[pass]]\nname = \"look\"\nrole = \"made\"\ntechnique = \"look\"\ninputs.triangles = \"" +
                (make.empty() ? "scene" : "made") + ".surfaces\"\n");
    return graph.image(scene).pixels;
  };
  EXPECT_THAT(seen({}), testing::ElementsAre(2, 6, 0, 0));
  EXPECT_THAT(seen("[[pass]]\nrole = \"made\"\ntechnique = \"copies\"\n"), testing::ElementsAre(2, 6, 0, 0));
  EXPECT_THAT(seen("[[pass]]\nrole = \"made\"\ntechnique = \"copies\"\nparams.removes = true\n"),
              testing::ElementsAre(0, 0, 0, 0));
  // Two triangles of each of 16 squares; the scene's beside them.
  double x = 0, y = 0;
  for (int i = 0; i < 24; ++i) {
    x += i % 3 == 2 ? 0 : 6 * (-3.5 + i % 8);
    y += i % 3 == 2 ? 0 : 6 * (-1.0 + i / 8);
  }
  for (const char* technique : {"listed", "counted"}) {
    const std::string make = std::string("[[pass]]\nrole = \"made\"\ntechnique = \"") + technique + "\"\n";
    const std::vector<float> beside = seen(make), alone = seen(make + "inputs.surfaces = \"none\"\n");
    EXPECT_THAT(beside, testing::ElementsAre(34, 70, testing::FloatNear(static_cast<float>(x), 1e-3F),
                                             testing::FloatNear(static_cast<float>(y), 1e-3F)));
    EXPECT_EQ(alone[0], 32);
  }
}

TEST(MadeSurfaces, AreCopiedOnceForAStageThatReadsThemThroughTwoPorts) {
  Scene scene;
  scene.add_floor(dvec3(0, 0, 0), 6);
  scene.look(dvec3(0, 1, 5), dvec3(0, 0, 0));
  const auto look = [&](const std::string& more) {
    Graph graph(
        "extent = [8, 8]\noutput = \"look.color\"\n[[pass]]\nrole = \"made\"\ntechnique = \"listed\"\n"
        "[[pass]]\nname = \"look\"\nrole = \"made\"\ntechnique = \"look\"\n"
        "inputs.triangles = \"made.surfaces\"\n" +
        more);
    const Image seen = graph.image(scene);
    EXPECT_EQ(seen.pixels[0], 34);
    return stats(graph)["counters"]["read_back_bytes"].get<std::uint64_t>();
  };
  const std::uint64_t once = look({});
  EXPECT_GT(once, 0U);
  EXPECT_EQ(look("inputs.others = \"made.surfaces\"\n"), once);
}

TEST(MadeSurfaces, AreRefusedWhereTheyLieOutsideOfTheirBuffers) {
  Scene scene;
  furnish(scene);
  Graph graph(deferred(above("copies", "params.astray = true\n")));
  EXPECT_EQ(heddle_render(graph.handle, scene.handle, nullptr), HEDDLE_BUG);
  EXPECT_STREQ(heddle_error(Host::get().handle),
               "error: batch 0 of 'make.surfaces' has indices 1839 to 1845 of 1842: expected triangles within them");
}

TEST(MadeSurfaces, AreCoveredByBarriersAndTheSameInEveryOrder) {
  Scene scene;
  furnish(scene);
  for (const char* technique : {"copies", "listed"}) {
    Graph graph(deferred(above(technique)), {"extent=[24,16]"});
    const char* report = nullptr;
    EXPECT_EQ(heddle_graph_check(graph.handle, scene.handle, nullptr, 3, &report), HEDDLE_OK)
        << technique << ": " << heddle_error(Host::get().handle);
  }
}

}  // namespace
