// SPDX-License-Identifier: Apache-2.0
// Which depth maps are drawn: those that would look different by now and no others, told by counters; and that a
// picture made with kept ones is, byte for byte, the picture made with all of them drawn.
#include "parsed.hpp"
#include "patch.hpp"
#include "roles/readme.hpp"

#include <gmock/gmock.h>

#include <heddle/plugin.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <random>

namespace {

using namespace rendering;
using shadow_patch::Patch;

/// Three spots in a row, 10 m apart, each over a box of its own, above one floor.
class Row {
 public:
  static constexpr double kApart = 10.0;

  explicit Row(std::uint32_t light_type = HEDDLE_LIGHT_SPOT) : light_type_(light_type) {
    scene.add_floor({0, 0, 0}, 100.0);
    for (int i = 0; i < 3; ++i) {
      scene.add_box({kApart * i - 0.5, 1, -0.5}, {kApart * i + 0.5, 1.5, 0.5});
      scene.add_light(record(), {kApart * i, 6, 0});
    }
    look({kApart, 4, 12});
  }
  [[nodiscard]] HeddleLight record() const {
    HeddleLight made = light(light_type_);
    made.cos_outer = 0.85F;
    made.range = 12.0F;
    return made;
  }
  void look(const dvec3& from) {
    camera = from;
    scene.look(from, from + dvec3(0, -0.3, -1));
  }
  void move_box(int box, const dvec3& to) {
    dmat4 matrix = glm::scale(glm::translate(dmat4(1.0), to), dvec3(1.0, 0.5, 1.0));
    check(heddle_scene_set_instance(scene.handle, static_cast<std::uint32_t>(box) + 1, &matrix[0][0]));
  }
  void move_light(int index, const dvec3& to) {
    heddle_light made{};
    made.struct_size = sizeof made;
    made.record = record();
    for (int i = 0; i < 3; ++i) made.position[i] = to[i];
    check(heddle_scene_set_light(scene.handle, static_cast<std::uint32_t>(index), &made));
  }
  Scene scene;
  dvec3 camera{0.0};

 private:
  std::uint32_t light_type_;
};

std::string shadow_pass(const std::string& technique, const std::string& parameters) {
  return "[[pass]]\nname = \"shadow\"\nrole = \"shadow\"\ntechnique = \"" + technique + "\"\n" + parameters;
}
constexpr const char* kSmall = "params.resolution = 128\nparams.filter_taps = 4\n";

/// Asks a strip of floor under all three lights for one of them.
std::string graph_of(const std::string& shadow) {
  Patch patch{{-5, 0, -2}, {30, 0, 0}, {0, 0, 4}, {0, 1, 0}};
  patch.camera = {Row::kApart, 4, 12};  // it follows the camera from there
  patch.grid = 64;
  return "extent = [64, 64]\noutput = \"probe.values\"\n" + shadow +
         "[[pass]]\nname = \"probe\"\nrole = \"probe\"\ntechnique = \"shadow\"\n" + patch.text();
}

struct Maps {
  std::uint64_t drawn = 0, kept = 0;
  bool operator==(const Maps&) const = default;
};
void PrintTo(const Maps& maps, std::ostream* out) {
  *out << maps.drawn << " drawn, " << maps.kept << " kept";
}

nlohmann::json stats(Graph& graph) {
  const char* text = nullptr;
  check(heddle_stats(graph.handle, &text));
  return parsed::json(text);
}

Maps render(Graph& graph, Scene& scene, bool is_cut = false) {
  heddle_render_options options{};
  options.struct_size = sizeof options;
  options.cut = is_cut ? 1 : 0;
  check(heddle_render(graph.handle, scene.handle, &options));
  Maps maps;
  const nlohmann::json said = stats(graph);
  for (const auto& count : said["counts"]) {
    EXPECT_EQ(count["pass"], "shadow");
    (count["name"] == "maps_drawn" ? maps.drawn : maps.kept) = count["count"].get<std::uint64_t>();
  }
  return maps;
}

TEST(KeptMaps, AreNotDrawnAgainInAFrameLikeTheLast) {
  for (const auto& [technique, maps] : {std::pair("shadow_map", 3U + 3U), std::pair("cascaded", 4U)}) {
    Row row;
    row.scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0.3, -1, 0.2}));
    Graph graph(graph_of(shadow_pass(technique, kSmall)));
    EXPECT_EQ(render(graph, row.scene), (Maps{maps, 0})) << technique;
    const Image first = graph.read();
    EXPECT_GE(stats(graph)["counters"]["draws"], maps);
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(render(graph, row.scene), (Maps{0, maps})) << technique;
      EXPECT_EQ(stats(graph)["counters"]["draws"], 0);
      EXPECT_EQ(stats(graph)["instances"]["drawn"], 0);
      EXPECT_EQ(graph.read().pixels, first.pixels);
    }
    EXPECT_EQ(render(graph, row.scene, true), (Maps{maps, 0})) << "nothing outlasts a cut";
    EXPECT_EQ(graph.read().pixels, first.pixels);
  }
}

TEST(KeptMaps, AreDrawnAgainWhereACasterInTheirViewMoved) {
  Row row;
  Graph graph(graph_of(shadow_pass("shadow_map", kSmall)));
  EXPECT_EQ(render(graph, row.scene), (Maps{3, 0}));
  row.move_box(1, {Row::kApart + 0.3, 1.25, 0});
  EXPECT_EQ(render(graph, row.scene), (Maps{1, 2}));
  EXPECT_EQ(render(graph, row.scene), (Maps{0, 3})) << "it rests";
  row.move_box(1, {0.9, 1.25, 0.2});
  EXPECT_EQ(render(graph, row.scene), (Maps{2, 1})) << "it leaves one view and comes into another";
  row.move_box(1, {0, 1.25, 50});
  EXPECT_EQ(render(graph, row.scene), (Maps{1, 2})) << "it leaves";
  row.move_box(1, {0, 1.25, 60});
  EXPECT_EQ(render(graph, row.scene), (Maps{0, 3})) << "nobody sees it";
}

TEST(KeptMaps, AreDrawnAgainWhereTheirLightMoved) {
  for (const auto& [type, faces] : {std::pair(HEDDLE_LIGHT_SPOT, 1U), std::pair(HEDDLE_LIGHT_POINT, 6U)}) {
    Row row(type);
    Graph graph(graph_of(shadow_pass("shadow_map", std::string(kSmall) + "params.views = 18\n")));
    EXPECT_EQ(render(graph, row.scene), (Maps{3 * faces, 0}));
    row.move_light(2, {2 * Row::kApart, 6.5, 0});
    EXPECT_EQ(render(graph, row.scene), (Maps{faces, 2 * faces}));
    EXPECT_EQ(render(graph, row.scene), (Maps{0, 3 * faces}));
  }
}

TEST(KeptMaps, OfLightsWithAPlaceStayUnderTheCamera) {
  Row row(HEDDLE_LIGHT_POINT);
  Graph graph(graph_of(shadow_pass("shadow_map", std::string(kSmall) + "params.views = 18\n")));
  EXPECT_EQ(render(graph, row.scene), (Maps{18, 0}));
  for (int step = 1; step < 5; ++step) {
    // Near enough that no map may be smaller.
    row.look({Row::kApart + 0.1234567 * step, 4.0 + 0.01 * step, 12 - 0.3 * step});
    EXPECT_EQ(render(graph, row.scene), (Maps{0, 18})) << step;
  }
}

TEST(KeptMaps, MakeThePictureThatAllOfThemDrawnWouldMake) {
  for (const char* technique : {"shadow_map", "cascaded"}) {
    Row row;
    row.scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0.3, -1, 0.2}));
    std::mt19937 random(7);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    const std::string more = std::string(kSmall) + "params.distance = 40.0\n";
    Graph keeping(graph_of(shadow_pass(technique, more)));
    Graph drawing(graph_of(shadow_pass(technique, more + "params.keep = false\n")));
    Maps sum;
    std::ptrdiff_t dark = 0, lit = 0;
    for (int step = 0; step < 24; ++step) {
      if (step % 4 == 1) row.move_box(static_cast<int>(random() % 3), {10.0 + 12.0 * unit(random), 1.5, unit(random)});
      if (step % 6 == 2)
        row.move_light(static_cast<int>(random() % 3), {10.0 + 12.0 * unit(random), 6.0, unit(random)});
      // At one height, so that the points stay on the floor.
      if (step % 3 == 0) row.look({10.0 + 4.0 * unit(random), 4.0, 12.0 + 3.0 * unit(random)});
      const Maps kept = render(keeping, row.scene);
      const Maps drawn = render(drawing, row.scene);
      EXPECT_EQ(drawn.kept, 0U);
      EXPECT_EQ(kept.drawn + kept.kept, drawn.drawn);
      sum.drawn += kept.drawn;
      sum.kept += kept.kept;
      for (const std::uint32_t index : {0U, 1U, 2U, 3U}) {
        const std::string ask = fmt::format("probe.params.light={}", index);
        keeping.set(ask);
        drawing.set(ask);
        render(keeping, row.scene);
        render(drawing, row.scene);
        const Image picture = keeping.read();
        ASSERT_EQ(picture.pixels, drawing.read().pixels) << technique << ", light " << index << ", step " << step;
        dark += std::ranges::count(picture.pixels, 0.0F);
        lit += std::ranges::count(picture.pixels, 1.0F);
      }
    }
    EXPECT_GT(sum.kept, sum.drawn / 2) << technique;
    EXPECT_GT(sum.drawn, 10U) << technique;
    EXPECT_GT(dark, 1000) << technique;
    EXPECT_GT(lit, 1000) << technique;
  }
}

TEST(KeptMaps, SurviveASwapOfWhoReadsThemAndWhatTheyDoNotDependOn) {
  Row row;
  Graph graph(graph_of(shadow_pass("shadow_map", kSmall)));
  EXPECT_EQ(render(graph, row.scene), (Maps{3, 0}));
  const Image first = graph.read();
  graph.set("probe.params.light=1");
  EXPECT_EQ(render(graph, row.scene), (Maps{0, 3}));
  graph.set("shadow.params.filter_taps=9");
  EXPECT_EQ(render(graph, row.scene), (Maps{0, 3}));
  graph.set("shadow.params.filter_radius=2.5");
  EXPECT_EQ(render(graph, row.scene), (Maps{3, 0})) << "borders are wider";
  graph.set("shadow.params.resolution=256");
  EXPECT_EQ(render(graph, row.scene), (Maps{3, 0})) << "the atlas is another";
  for (const char* setting : {"probe.params.light=0", "shadow.params.filter_taps=4", "shadow.params.filter_radius=1.5",
                              "shadow.params.resolution=128"})
    graph.set(setting);
  EXPECT_EQ(render(graph, row.scene), (Maps{3, 0}));
  EXPECT_EQ(graph.read().pixels, first.pixels);
}

TEST(KeptMaps, AreDrawnOnceForAllSamplesOfALoop) {
  for (const char* technique : {"shadow_map", "cascaded"}) {
    Row row;  // and the sky's sun
    Graph graph("extends = \"supersampled\"\nextent = [32, 32]\n[[pass]]\nname = \"shadow\"\ntechnique = \"" +
                    std::string(technique) + "\"\n" + kSmall,
                {"aa.params.samples=4"});
    const std::uint64_t maps = technique == std::string("cascaded") ? 4 : 6;
    EXPECT_EQ(render(graph, row.scene), (Maps{maps, 3 * maps})) << technique;
    row.look({Row::kApart, 4.5, 10});
    const Maps moved = render(graph, row.scene);
    EXPECT_LE(moved.drawn, technique == std::string("cascaded") ? 4U : 3U) << technique;
    EXPECT_EQ(moved.drawn + moved.kept, 4 * maps) << technique;
  }
}

TEST(KeptMaps, HoldManyLightsWhoseMapsAreAsFineAsPixels) {
  // 64 lamps of 12 m on a field that is seen from 200 m away and above.
  Scene scene;
  scene.add_floor({0, 0, 0}, 200.0);
  HeddleLight lamp = light(HEDDLE_LIGHT_POINT);
  lamp.range = 6.0F;
  for (int i = 0; i < 64; ++i) {
    const dvec3 at(10.0 * (i % 8), 0, 10.0 * (i / 8));
    scene.add_box(at + dvec3(-0.5, 1, -0.5), at + dvec3(0.5, 1.1, 0.5));
    scene.add_light(lamp, at + dvec3(0, 3, 0));
  }
  scene.look({35, 200, 35.1}, {35, 0, 35});
  Patch patch{{-0.2, 0, -0.2}, {0.4, 0, 0}, {0, 0, 0.4}, {0, 1, 0}};
  patch.grid = 64;
  const auto text = [&](int lamp_index) {
    Patch placed = patch;
    placed.corner += dvec3(10.0 * (lamp_index % 8), 0, 10.0 * (lamp_index / 8));
    placed.camera = {35, 200, 35.1};
    placed.light = static_cast<std::uint32_t>(lamp_index);
    return "extent = [64, 64]\noutput = \"probe.values\"\n" + shadow_pass("shadow_map", "params.resolution = 512\n") +
           "[[pass]]\nname = \"probe\"\nrole = \"probe\"\ntechnique = \"shadow\"\n" + placed.text();
  };
  for (const int index : {0, 27, 63}) {
    Host::get().log.clear();
    Graph graph(text(index));
    // 384 maps in the room of 16.
    EXPECT_EQ(render(graph, scene), (Maps{64 * 6, 0}));
    EXPECT_THAT(Host::get().log, testing::Each(testing::Not(testing::HasSubstr("no room"))));
    EXPECT_EQ(graph.read().at(32, 32), 0.0F) << "under the box of lamp " << index;
  }
}

TEST(KeptMaps, ReadmesSayWhatTheDescriptorsDo) {
  const char* text = nullptr;
  check(heddle_list(Host::get().handle, &text));
  const nlohmann::json all = parsed::json(text);
  for (const char* id : {"shadow/shadow_map", "shadow/cascaded", "shadow/ray_traced"}) {
    const std::string table = parameter_table(all, id);
    ASSERT_FALSE(table.empty()) << id;
    EXPECT_THAT(readme_of(id), testing::HasSubstr(table)) << id;
  }
}

}  // namespace
