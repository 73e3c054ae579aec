// SPDX-License-Identifier: Apache-2.0
// Why a pass runs or not, why it stands where it stands, where its settings come from: whole texts.
#include "graph/why.hpp"

#include <gmock/gmock.h>

#include "graph/plugin_folder.hpp"

namespace heddle::graph {
namespace {

using ::testing::HasSubstr;

Json why_of(const WrittenGraph& written, std::string_view pass, std::span<const std::string> features = {}) {
  const Registry& registry = testing::shared_registry();
  const ResolvedGraph resolved = resolve(written, registry);
  ResolvedGraph graph = resolved;
  prune(graph, std::array{graph.output}, features);
  return why(written, resolved, graph, order(graph), registry.roles(), pass);
}

WrittenGraph small_graph(std::initializer_list<const char*> settings = {}) {
  WrittenGraph written = parse(testing::kSmallGraph, "small.toml");
  for (const char* setting : settings) apply_setting(written, setting);
  return written;
}

TEST(Why, SaysWhyAPassRunsWhereItStandsAndWhereItsSettingsComeFrom) {
  WrittenGraph written = small_graph({"params.near=0.25", "ao.params.radius=$near", "ao.params.falloff=linear"});
  EXPECT_EQ(to_text(why_of(written, "ao")), R"()");
}

TEST(Why, SaysThatNobodyReadsAPassAndWhatReadersTakeInstead) {
  EXPECT_EQ(to_text(why_of(small_graph({"lighting.inputs.visibility=none"}), "ao")).substr(0, 400), R"()");
}

TEST(Why, SaysThatTheTechniqueIsNoneAndWhatIsSeenInItsPlace) {
  EXPECT_EQ(to_text(why_of(small_graph({"ao.technique=none"}), "ao")), R"()");
  EXPECT_EQ(to_text(why_of(small_graph({"ao.enabled=false"}), "ao")), R"()");
}

TEST(Why, SaysWhichLineOfWhichFileRemovesAPass) {
  WrittenGraph written = overlay(parse(testing::kSmallGraph, "small.toml"),
                                 parse("extends = \"small.toml\"\nremove = [\"ao\"]\n", "over.toml"));
  EXPECT_EQ(to_text(why_of(written, "ao")), R"()");
}

TEST(Why, NamesTheProviderOfAFunction) {
  const Json answer = why_of(parse(R"(output = "display.color"
[[pass]]
role = "sky"
technique = "uniform"
[[pass]]
role = "gbuffer"
technique = "raster"
[[pass]]
role = "lighting"
technique = "deferred"
[[pass]]
role = "display"
technique = "linear"
)",
                                   "sky.toml"),
                             "sky");
  EXPECT_TRUE(answer["runs"].get<bool>());
  EXPECT_EQ(answer["rule"], "read");
  EXPECT_EQ(answer["reason"], "answers 'sky' for 'lighting'");
  EXPECT_EQ(answer["callers"][0]["pass"], "lighting");
}

TEST(Why, SaysWhatAnUnknownPassCouldBe) {
  EXPECT_EQ(testing::message_of([] { why_of(small_graph(), "oa"); }),
            "small.toml: error: the graph has no pass 'oa'\n"
            "  expected: one of gbuffer, ao, lighting, display\n"
            "  help:     did you mean 'ao'?");
}

}  // namespace
}  // namespace heddle::graph
