// SPDX-License-Identifier: Apache-2.0
// Text parameters, and shader text that a technique makes while it runs: what it answers, and what people are told.
#include "roles/rendering.hpp"

#include <filesystem>
#include <fstream>

namespace {

using namespace rendering;

std::string graph_text(const std::string& params) {
  return "extent = [8, 8]\noutput = \"text.values\"\n[[pass]]\nname = \"text\"\nrole = \"probe\"\ntechnique = "
         "\"text\"\n" +
         params;
}

float answer(Graph& graph) {
  Scene scene;
  scene.look({0, 0, 0}, {0, 0, -1});
  return graph.image(scene).at(5, 0);
}

/// What rendering it says; the graph's folder is the build's.
std::string error_of(const std::string& params) {
  heddle_host* host = Host::get().handle;
  heddle_graph* graph = nullptr;
  if (heddle_graph_parse(host, graph_text(params).c_str(), "test.toml", HEDDLE_BUILD_DIR, nullptr, 0, &graph) !=
      HEDDLE_OK) {
    return heddle_error(host);
  }
  Scene scene;
  scene.look({0, 0, 0}, {0, 0, -1});
  std::string text;
  if (heddle_render(graph, scene.handle, nullptr) != HEDDLE_OK) text = heddle_error(host);
  heddle_graph_destroy(graph);
  return text;
}

TEST(GeneratedText, AnswersInPlaceOfTheFileThatStandsInForIt) {
  Graph graph(graph_text(""));
  EXPECT_EQ(answer(graph), -1.0F) << "the file";
  graph.set("text.params.expression=\"2.0 * x + 1.0\"");
  EXPECT_EQ(answer(graph), 11.0F);
  graph.set("text.params.expression=\"3.0 * x\"");
  EXPECT_EQ(answer(graph), 15.0F) << "a change is compiled anew";
  graph.set("text.params.expression=\"\"");
  EXPECT_EQ(answer(graph), -1.0F) << "the file again";
}

TEST(GeneratedText, ListsOfNamesReachThePlugin) {
  Graph graph(graph_text("params.expression = \"x\"\nparams.terms = [\"0.25\", \"x * x\"]\n"));
  EXPECT_EQ(answer(graph), 30.25F);
}

TEST(GeneratedText, PathsStartFromTheFolderOfTheGraph) {
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "heddle-generated-text";
  std::filesystem::create_directories(folder / "graphs");
  std::ofstream(folder / "expression.txt") << "x + 0.5";
  std::ofstream(folder / "graphs" / "text.toml") << graph_text("params.file = \"../expression.txt\"\n");
  heddle_graph* graph = nullptr;
  check(heddle_graph_load(Host::get().handle, (folder / "graphs" / "text.toml").c_str(), nullptr, 0, &graph));
  Scene scene;
  scene.look({0, 0, 0}, {0, 0, -1});
  check(heddle_render(graph, scene.handle, nullptr));
  heddle_image image{};
  image.struct_size = sizeof image;
  check(heddle_read(graph, nullptr, 0, 0, &image));
  EXPECT_EQ(image.pixels[0], 0.5F);
  heddle_graph_destroy(graph);
  std::filesystem::remove_all(folder);
  EXPECT_EQ(error_of("params.file = \"no/such.txt\"\n"),
            "test.toml:3:1: error: pass 'text' (probe/text): cannot read " HEDDLE_BUILD_DIR "/no/such.txt");
}

TEST(GeneratedText, AMistakeInItShowsTheLine) {
  EXPECT_EQ(
      error_of("params.expression = \"x + y\"\n"),
      "generated/expression.glsl:1: error: shader 'ask' of pass 'text': 'y': undeclared identifier\n"
      "  found:    float expression(float x) { return x + y; }\n"
      "  help:     the technique made this text while it ran: it is a mistake of the technique, not of the graph");
}

TEST(GeneratedText, ATextWithoutFileAndATextThatComesTooLateAreMistakesOfTheTechnique) {
  const std::string help = "\n  help:     this is a mistake of the technique, not of the graph";
  EXPECT_EQ(error_of("params.without_file = true\n"),
            "test.toml:3:1: error: pass 'text' (probe/text): sets the text 'generated/nothing.glsl' and has no "
            "file " HEDDLE_BUILD_DIR "/tests/plugins/probe/probe/generated/nothing.glsl to stand in for it" +
                help);
  EXPECT_EQ(error_of("params.late = true\n"),
            "test.toml:3:1: error: pass 'text' (probe/text): calls set_text outside of declare and prepare" + help);
}

}  // namespace
