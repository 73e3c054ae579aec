// SPDX-License-Identifier: Apache-2.0
// Drawings with a place of their own: what they show does not depend on the camera, what they would show is a number,
// and only their own part of an image changes.
#include "parsed.hpp"
#include "roles/rendering.hpp"

#include <gmock/gmock.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace {

using namespace rendering;

std::string graph_text(const std::string& parameters = {}) {
  return "extent = [16, 16]\noutput = \"placed.color\"\n[[pass]]\nname = \"placed\"\nrole = \"views\"\n"
         "technique = \"placed\"\n" +
         parameters;
}

/// A plate of 1 m, half a metre high, round (x, z).
void add_plate(Scene& scene, double x, double z) {
  scene.add_floor({x, 0.5, z}, 0.5);
}

std::uint64_t counted(Graph& graph, const std::string& name) {
  const char* text = nullptr;
  check(heddle_stats(graph.handle, &text));
  const nlohmann::json said = parsed::json(text);
  for (const auto& count : said["counts"])
    if (count["pass"] == "placed" && count["name"] == name) return count["count"].get<std::uint64_t>();
  ADD_FAILURE() << "no counter " << name << " in " << text;
  return 0;
}

TEST(PlacedDrawing, ShowsPositionsRelativeToItsOwnOriginWhereverTheCameraIs) {
  // 2^21 m away a float32 has a quarter of a metre: relative to the camera the plate would be a smear.
  const dvec3 place(2097152.0 + 0.125, 0, -2097152.0 - 0.375);
  Scene scene;
  add_plate(scene, place.x, place.z);
  Graph graph(graph_text("params.origin = " + text_of(place) + "\n"));
  Image first;
  for (const dvec3& camera : {place + dvec3(0, 5, 0), dvec3(0.1, 0.2, 0.3), dvec3(-1e7, 12.3, 1e6)}) {
    scene.look(camera, camera + dvec3(0, -0.1, -1));
    const Image image = graph.image(scene);
    if (first.pixels.empty()) first = image;
    EXPECT_EQ(image.pixels, first.pixels) << text_of(camera);
    for (std::uint32_t y = 0; y < 16; ++y) {
      for (std::uint32_t x = 0; x < 16; ++x) {
        const double rel_x = (x + 0.5) / 8.0 - 1.0;
        const double rel_z = (y + 0.5) / 8.0 - 1.0;
        const bool is_plate = std::max(std::abs(rel_x), std::abs(rel_z)) < 0.5;
        EXPECT_EQ(image.at(x, y, 0), is_plate ? static_cast<float>(rel_x) : -1.0F) << x << ", " << y;
        EXPECT_EQ(image.at(x, y, 1), is_plate ? 0.5F : -1.0F);
        EXPECT_EQ(image.at(x, y, 2), is_plate ? static_cast<float>(rel_z) : -1.0F);
      }
    }
  }
}

TEST(PlacedDrawing, ChangesItsOwnPartAlone) {
  Scene scene;
  add_plate(scene, 0, 0);
  add_plate(scene, 10, 0);
  scene.look({0, 3, 3}, {0, 0, 0});
  Graph graph(graph_text());
  const auto shows = [&](std::uint32_t tile) { return graph.read().at(16 * tile + 8, 8, 3) == 1.0F; };
  const auto is_neutral = [&](std::uint32_t tile) { return graph.read().at(16 * tile + 8, 8, 3) == -1.0F; };
  graph.render(scene);
  EXPECT_TRUE(shows(0));
  EXPECT_TRUE(is_neutral(1)) << "what nobody has drawn";
  graph.set("placed.params.tile=1");
  graph.render(scene);
  EXPECT_TRUE(shows(0)) << "was not cleared";
  EXPECT_TRUE(shows(1));
  graph.set("placed.params.origin=[5, 0, 0]");  // nothing is there
  graph.render(scene);
  EXPECT_TRUE(shows(0));
  EXPECT_TRUE(is_neutral(1)) << "was cleared";
  graph.set("placed.params.tile=0");
  graph.set("placed.params.clears=false");
  graph.render(scene);
  EXPECT_TRUE(shows(0)) << "is drawn over";
}

TEST(PlacedDrawing, LooksTheSameUntilSomethingInItsViewChanges) {
  Scene scene;
  add_plate(scene, 0, 0);
  add_plate(scene, 10, 0);
  scene.look({0, 3, 3}, {0, 0, 0});
  Graph graph(graph_text());
  const auto has_changed = [&] {
    graph.render(scene);
    return counted(graph, "changes") == 1;
  };
  const auto move = [&](std::uint32_t plate, const dvec3& to) {
    const dmat4 matrix = glm::translate(dmat4(1.0), to);
    check(heddle_scene_set_instance(scene.handle, plate, &matrix[0][0]));
  };
  EXPECT_TRUE(has_changed());
  EXPECT_FALSE(has_changed());
  scene.look({1, 4, 3}, {0, 0, 0});
  EXPECT_FALSE(has_changed()) << "the camera is not in it";
  move(1, {12, 0, 0});
  EXPECT_FALSE(has_changed()) << "out of view before and after";
  move(0, {1e-9, 0.5, 0});
  EXPECT_TRUE(has_changed()) << "less than float32 shows is a change as well";
  EXPECT_FALSE(has_changed());
  move(1, {0.5, 0.2, 0});
  EXPECT_TRUE(has_changed()) << "into view";
  graph.set("placed.params.tile=1");
  EXPECT_TRUE(has_changed());
  graph.set("placed.params.origin=[0, 0, 0.25]");
  EXPECT_TRUE(has_changed());
  EXPECT_FALSE(has_changed());
}

TEST(PlacedDrawing, SeesWhatTechniquesMakeAndPlace) {
  const auto text = [](const std::string& technique, const std::string& more) {
    return graph_text().insert(
        graph_text().find("[[pass]]"),
        "[[pass]]\nname = \"make\"\nrole = \"made\"\ntechnique = \"" + technique + "\"\n" + more);
  };
  Scene scene;
  add_plate(scene, 0, 0);
  // What the scene places: the same in every byte, wherever the camera is.
  Graph plain(graph_text()), copied(text("copies", ""));
  for (const dvec3& camera : {dvec3(0, 5, 0), dvec3(1e6, 3, -1e6)}) {
    scene.look(camera, camera + dvec3(0, -0.1, -1));
    EXPECT_EQ(copied.image(scene).pixels, plain.image(scene).pixels) << text_of(camera);
  }
  EXPECT_EQ(counted(plain, "changes"), 0U);
  EXPECT_EQ(counted(copied, "changes"), 1U) << "the technique says nothing of what lasts";
  // What the GPU places, relative to the camera: at its place in the scene, up to float32 at the camera.
  Graph listed(text("listed", "params.count = 1\nparams.place = [5, 0.25, 7]\n"));
  listed.set("placed.params.origin=[5, 0, 7]");
  listed.set("placed.params.front=true");
  for (const dvec3& camera : {dvec3(5, 5, 7), dvec3(5, 2, 100), dvec3(-1000, 3, 20)}) {
    scene.look(camera, camera + dvec3(0, -0.1, -1));
    const Image image = listed.image(scene);
    EXPECT_EQ(image.at(8, 6, 3), 1.0F) << text_of(camera);
    EXPECT_EQ(image.at(0, 0, 3), -1.0F) << text_of(camera);
    EXPECT_EQ(counted(listed, "changes"), 1U);
  }
}

TEST(PlacedDrawing, KnowsTheLightsOfTheSceneAlone) {
  Scene scene;
  add_plate(scene, 0, 0);
  scene.add_light(light(HEDDLE_LIGHT_POINT), {1, 2, 3});
  scene.look({0, 3, 3}, {0, 0, 0});
  Graph graph(graph_text());
  graph.render(scene);
  EXPECT_EQ(counted(graph, "lights"), 1U) << "of two that were asked for, added up over a frame";
}

TEST(PlacedDrawing, ThatIsWrongIsAMistakeOfTheTechnique) {
  Scene scene;
  add_plate(scene, 0, 0);
  scene.look({0, 3, 3}, {0, 0, 0});
  const auto message = [&](int mistake) {
    Graph graph(graph_text(fmt::format("params.mistake = {}\n", mistake)));
    EXPECT_NE(heddle_render(graph.handle, scene.handle, nullptr), HEDDLE_OK);
    return std::string(heddle_error(Host::get().handle));
  };
  const std::string about = "test.toml:3:1: error: pass 'placed' (views/placed): ";
  const std::string help = "\n  help:     this is a mistake of the technique, not of the graph";
  EXPECT_EQ(message(1), about + "places a drawing without a view" + help);
  EXPECT_EQ(message(2), about + "places a drawing of 'surfaces' in an order other than HEDDLE_ORDER_STATE" + help);
  EXPECT_EQ(message(3), about + "draws 'color', which its stage does not declare as DRAW" + help);
}

}  // namespace
