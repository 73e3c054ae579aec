// SPDX-License-Identifier: Apache-2.0
// What techniques are told of images: neutral only where that is known, and never of what anything has drawn into.
#include "parsed.hpp"
#include "roles/rendering.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace {

using namespace rendering;

std::string graph_text(const std::string& how) {
  return fmt::format(
      "extent = [16, 16]\noutput = \"asks.image\"\n[[pass]]\nname = \"asks\"\nrole = \"contents\"\n"
      "technique = \"asks\"\nparams.how = \"{}\"\n",
      how);
}

/// Which of the images `image`, `other`, `absent` are said to be neutral: "ioa", with '-' where not.
std::string neutral(Graph& graph, Scene& scene) {
  graph.render(scene);
  const char* text = nullptr;
  check(heddle_stats(graph.handle, &text));
  const nlohmann::json said = parsed::json(text);
  std::string out;
  for (const char* name : {"image", "other", "absent"})
    for (const auto& count : said["counts"])
      if (count["name"] == name) out += count["count"] == 1 ? name[0] : '-';
  return out;
}

TEST(Contents, AreKnownOfWhatWasClearedAndNotDrawnInto) {
  Scene scene;
  scene.add_floor({0, 0, 0}, 1.0);
  const auto look_at_floor = [&] { scene.look({0, 3, 3}, {0, 0, 0}); };
  const auto look_away = [&] { scene.look({0, 3, 3}, {0, 6, 6}); };
  const auto both = [&](const std::string& how) {
    Graph graph(graph_text(how));
    look_at_floor();
    std::string out = neutral(graph, scene);
    look_away();
    out += " " + neutral(graph, scene);
    look_at_floor();
    return out + " " + neutral(graph, scene);
  };
  // `other` is cleared to something else, `absent` is bound to nothing; seen, not seen, seen again.
  EXPECT_EQ(both("both_layers"), "--a i-a --a");
  EXPECT_EQ(both("one_layer"), "--a --a --a") << "the other layer holds anything";
  EXPECT_EQ(both("by_hand"), "--a --a --a") << "nobody knows what was recorded with the command buffer";
  EXPECT_EQ(both("placed"), "--a --a --a") << "of which only a part is cleared";
  EXPECT_EQ(both("nothing"), "ioa ioa ioa") << "the host has cleared both to their neutral values";
}

TEST(Contents, AskedOfWhatTheStageDoesNotDeclareIsAMistakeOfTheTechnique) {
  Scene scene;
  scene.add_floor({0, 0, 0}, 1.0);
  scene.look({0, 3, 3}, {0, 0, 0});
  Graph graph(graph_text("undeclared"));
  EXPECT_NE(heddle_render(graph.handle, scene.handle, nullptr), HEDDLE_OK);
  EXPECT_STREQ(heddle_error(Host::get().handle),
               "test.toml:3:1: error: pass 'asks' (contents/asks): asks what 'surfaces' holds, which is no image that "
               "stage 'ask' declares\n  help:     this is a mistake of the technique, not of the graph");
}

}  // namespace
