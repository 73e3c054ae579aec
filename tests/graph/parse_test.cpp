// SPDX-License-Identifier: Apache-2.0
// Text -> WrittenGraph: places, order of the file, and what is refused. Whole messages: errors_test.cpp.
#include <gmock/gmock.h>

#include "graph/plugin_folder.hpp"

namespace heddle::graph {
namespace {

using test_support::message_of;
using test_support::text;
using ::testing::HasSubstr;

TEST(Parse, GivesEveryValueAndKeyItsPlace) {
  const WrittenGraph graph = parse(
      "extent = [640, 360]\noutput = \"display.color\"\n[[pass]]\nname = \"ao\"\nrole = \"ambient_occlusion\"\n"
      "technique = \"gtao\"\nparams.radius = 0.5\n  inputs.depth = \"gbuffer.depth\"\n",
      "a.toml");
  EXPECT_EQ(graph.extent->where.line, 1U);
  EXPECT_EQ(graph.extent->where.column, 10U);
  ASSERT_EQ(graph.passes.size(), 1U);
  const WrittenPass& pass = graph.passes[0];
  EXPECT_EQ(pass.where.file, "a.toml");
  EXPECT_EQ(pass.where.line, 3U);
  EXPECT_EQ(text(pass.name), "ao");
  EXPECT_EQ(pass.technique.where.line, 6U);
  EXPECT_EQ(pass.technique.where.column, 13U);
  ASSERT_EQ(pass.params.size(), 1U);
  EXPECT_EQ(pass.params[0].first.where.line, 7U);
  EXPECT_EQ(pass.params[0].first.where.column, 8U);
  EXPECT_EQ(std::get<double>(pass.params[0].second.value), 0.5);
  ASSERT_EQ(pass.inputs.size(), 1U);
  EXPECT_EQ(pass.inputs[0].second.where.line, 8U);
  EXPECT_EQ(pass.inputs[0].second.where.column, 18U);
}

TEST(Parse, KeepsTheOrderOfTheFileForKeysThatSortOtherwise) {
  const WrittenGraph graph = parse("params.z = 1\nparams.a = 2\nparams.m = 3\n", "a.toml");
  ASSERT_EQ(graph.params.size(), 3U);
  EXPECT_EQ(graph.params[0].first.name, "z");
  EXPECT_EQ(graph.params[1].first.name, "a");
  EXPECT_EQ(graph.params[2].first.name, "m");
}

TEST(Parse, TellsIntegersFromFloats) {
  const WrittenGraph graph = parse("params.i = 1\nparams.f = 1.0\n", "a.toml");
  EXPECT_TRUE(std::holds_alternative<std::int64_t>(graph.params[0].second.value));
  EXPECT_TRUE(std::holds_alternative<double>(graph.params[1].second.value));
}

TEST(Parse, NamesAPassAfterItsRole) {
  const WrittenGraph graph = parse("[[pass]]\nrole = \"sky\"\ntechnique = \"uniform\"\n", "a.toml");
  EXPECT_EQ(text(graph.passes[0].name), "sky");
}

TEST(Parse, TakesTablesAndDottedKeysAlike) {
  const WrittenGraph dotted =
      parse("[[pass]]\nrole = \"sky\"\ntechnique = \"uniform\"\nparams.radiance = [1, 2, 3]\n", "a.toml");
  const WrittenGraph table =
      parse("[[pass]]\nrole = \"sky\"\ntechnique = \"uniform\"\n[pass.params]\nradiance = [1, 2, 3]\n", "a.toml");
  const WrittenGraph brace =
      parse("[[pass]]\nrole = \"sky\"\ntechnique = \"uniform\"\nparams = { radiance = [1, 2, 3] }\n", "a.toml");
  for (const WrittenGraph* graph : {&dotted, &table, &brace}) {
    ASSERT_EQ(graph->passes[0].params.size(), 1U);
    EXPECT_EQ(graph->passes[0].params[0].first.name, "radiance");
    EXPECT_EQ(std::get<std::vector<Written>>(graph->passes[0].params[0].second.value).size(), 3U);
  }
}

TEST(Parse, RefusesValuesThatAreNoNumbers) {
  EXPECT_THAT(message_of([] { parse("params.a = nan\n", "a.toml"); }), HasSubstr("a.toml:1:12: error: nan and inf"));
  EXPECT_THAT(message_of([] { parse("params.a = [1, -inf]\n", "a.toml"); }),
              HasSubstr("a.toml:1:16: error: nan and inf"));
  EXPECT_THAT(message_of([] { parse("params.a = 1979-05-27\n", "a.toml"); }),
              HasSubstr("a date or time cannot stand here"));
}

TEST(Parse, SurvivesAnyPrefixOfAGraph) {
  for (std::size_t length = 0; length < test_support::kSmallGraph.size(); ++length) {
    try {
      parse(test_support::kSmallGraph.substr(0, length), "a.toml");
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), HEDDLE_BAD_INPUT) << length;
      EXPECT_FALSE(error.diagnostics().empty());
    }
  }
}

TEST(Parse, RefusesBytesThatAreNoText) {
  EXPECT_THROW(parse(std::string_view("a = \"\xff\"\n"), "a.toml"), Error);
  EXPECT_THROW(parse(std::string_view("\0\0\0", 3), "a.toml"), Error);
  EXPECT_THROW(parse(std::string(2000, '['), "a.toml"), Error);
}

}  // namespace
}  // namespace heddle::graph
