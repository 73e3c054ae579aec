// SPDX-License-Identifier: Apache-2.0
// The hard cases of role mesh_detail.
#include "roles/rendering.hpp"

#include <heddle/components.h>

#include <nlohmann/json.hpp>

namespace {

using namespace rendering;
using Json = nlohmann::json;

std::string frame(const std::string& show) {
  return "extent = [48, 32]\noutput = \"gbuffer.depth\"\n[[pass]]\nrole = \"mesh_detail\"\ntechnique = \"chosen\"\n"
         "params.show = \"" +
         show + "\"\n[[pass]]\nrole = \"gbuffer\"\ntechnique = \"raster\"\n";
}
void set_fine(Scene& scene, std::uint32_t fine, std::uint32_t coarse) {
  check(heddle_scene_set_component(scene.handle, HEDDLE_OWNER_INSTANCE, fine, "mesh_detail.fine",
                                   ("{\"of\": " + std::to_string(coarse) + "}").c_str()));
}

constexpr std::uint32_t kCoarse = 1, kFine = 2;
/// A floor, a coarse ball that is a box, and the fine ball in two halves.
void build(Scene& scene, std::uint32_t parts) {
  scene.add_floor(dvec3(0, -1, 0), 3);
  if ((parts & kCoarse) != 0) scene.add_box(dvec3(-0.8), dvec3(0.8));
  if ((parts & kFine) != 0) scene.add_sphere(dvec3(-0.2, 0, 0), 0.8, 12);
  if ((parts & kFine) != 0) scene.add_sphere(dvec3(0.2, 0, 0), 0.8, 12);
  if (parts == (kCoarse | kFine)) set_fine(scene, 2, 1);
  if (parts == (kCoarse | kFine)) set_fine(scene, 3, 1);
  scene.look(dvec3(0, 1.5, 4), dvec3(0));
}
std::vector<float> depth(Scene& scene, const std::string& show) {
  Graph graph(frame(show));
  return graph.image(scene).pixels;
}

TEST(MeshDetail, H1OfAPairOneIsThere) {
  Scene both, coarse, fine;
  build(both, kCoarse | kFine);
  build(coarse, kCoarse);
  build(fine, kFine);
  const std::vector<float> seen_coarse = depth(both, "coarse"), seen_fine = depth(both, "fine");
  EXPECT_EQ(seen_coarse, depth(coarse, "coarse"));
  EXPECT_EQ(seen_fine, depth(fine, "fine"));
  EXPECT_NE(seen_coarse, seen_fine);
  // Changed between frames, and back.
  Graph graph(frame("coarse"));
  EXPECT_EQ(graph.image(both).pixels, seen_coarse);
  graph.set("mesh_detail.params.show=fine");
  EXPECT_EQ(graph.image(both).pixels, seen_fine);
  graph.set("mesh_detail.params.show=coarse");
  EXPECT_EQ(graph.image(both).pixels, seen_coarse);
}

TEST(MeshDetail, H2ComponentsThatNameNoCoarseInstanceAreErrors) {
  for (const auto& [of, message] :
       {std::pair(9U, "instance 2: mesh_detail.fine.of is 9; expected: the id of an instance, less than 4"),
        std::pair(2U, "instance 2: mesh_detail.fine.of is 2; expected: the id of another instance"),
        std::pair(3U,
                  "instance 2: mesh_detail.fine.of is 3; expected: the id of a coarse instance, which this one is not "
                  "itself")}) {
    Scene scene;
    build(scene, kCoarse | kFine);
    set_fine(scene, 2, of);
    const Graph graph(frame("coarse"));
    EXPECT_EQ(heddle_render(graph.handle, scene.handle, nullptr), HEDDLE_BAD_INPUT);
    EXPECT_NE(std::string(heddle_error(Host::get().handle)).find(message), std::string::npos)
        << heddle_error(Host::get().handle);
  }
}

TEST(MeshDetail, H3ASceneWithoutPairsHasNoPass) {
  const auto stats = [](std::uint32_t parts) {
    Scene scene;
    build(scene, parts);
    Graph graph(frame("coarse"));
    (void)graph.image(scene);
    const char* text = nullptr;
    check(heddle_stats(graph.handle, &text));
    return Json::parse(text);
  };
  const auto is_open = [](const Json& told) {
    return std::ranges::any_of(told["libraries"], [](const Json& library) {
      return library.get<std::string>().find("mesh_detail") != std::string::npos;
    });
  };
  EXPECT_FALSE(is_open(stats(kCoarse)));
  EXPECT_TRUE(is_open(stats(kCoarse | kFine)));
}

TEST(MeshDetail, CostsNothingOnceItHasRun) {
  Scene both, coarse;
  build(both, kCoarse | kFine);
  build(coarse, kCoarse);
  std::array<Json, 2> counters;
  for (std::size_t i = 0; i < 2; ++i) {
    Scene& scene = i == 0 ? both : coarse;
    Graph graph(frame("coarse"));
    (void)graph.image(scene);
    (void)graph.image(scene);
    const char* text = nullptr;
    check(heddle_stats(graph.handle, &text));
    counters[i] = Json::parse(text)["counters"];
  }
  for (const char* counter : {"dispatches", "draws"}) EXPECT_EQ(counters[0][counter], counters[1][counter]) << counter;
  // What the draws name of the instances that are left.
  EXPECT_LE(counters[0]["uploaded_bytes"].get<double>(), counters[1]["uploaded_bytes"].get<double>() + 64);
}

}  // namespace
