// SPDX-License-Identifier: Apache-2.0
// Why a pass runs or not, why it stands where it stands, where its settings come from: whole texts.
#include "graph/why.hpp"

#include <gmock/gmock.h>

#include "graph/plugin_folder.hpp"

namespace heddle::graph {
namespace {

using ::testing::StartsWith;

Json why_of(const WrittenGraph& written, std::string_view pass,
            const Registry& registry = test_support::shared_registry()) {
  const ResolvedGraph resolved = resolve(written, registry);
  ResolvedGraph graph = resolved;
  prune(graph, std::array{graph.output}, {});
  return why(written, resolved, graph, order(graph), registry.roles(), pass);
}

WrittenGraph small_graph(std::initializer_list<const char*> settings = {}) {
  WrittenGraph written = parse(test_support::kSmallGraph, "small.toml");
  for (const char* setting : settings) apply_setting(written, setting);
  return written;
}

TEST(Why, SaysWhyAPassRunsWhereItStandsAndWhereItsSettingsComeFrom) {
  WrittenGraph written = small_graph({"params.near=0.25", "ao.params.radius=$near", "ao.params.falloff=linear"});
  EXPECT_EQ(to_text(why_of(written, "ao")),
            R"(pass 'ao' (ambient_occlusion/gtao) runs: makes 'ao.visibility' for 'lighting'
  written at small.toml:5:1

why it runs, down to what is asked for
  'ao' makes 'ao.visibility' for 'lighting'
  'lighting' makes 'lighting.radiance' for 'display'
  'display' makes the output 'display.color'

who uses it
  ao.noisy       no other pass reads it
  ao.visibility  'lighting' reads it as 'visibility'

where it stands
    2 of 5  ao.horizon
        after    1 gbuffer.draw: 'ao' reads 'gbuffer.depth'; 'ao' reads 'gbuffer.normal_geometric'
        before   3 ao.denoise: stages of a pass run in their order
    3 of 5  ao.denoise
        after    1 gbuffer.draw: 'ao' reads 'gbuffer.depth'
        after    2 ao.horizon: stages of a pass run in their order
        before   4 lighting.light: 'lighting' reads 'ao.visibility'

settings, and where each comes from
  technique                "gtao"                      small.toml:8:13
  params.radius            0.25                        params.near at --set, by "$near" at --set
  params.falloff           "linear"                    --set
  params.directions        2                           default of ambient_occlusion/gtao
  params.denoise           true                        default of ambient_occlusion/gtao
  inputs.depth             "gbuffer.depth"             not bound: the last producer above
  inputs.normal_geometric  "gbuffer.normal_geometric"  not bound: the last producer above
  inputs.camera            "scene.camera"              not bound: the scene's
)");
}

TEST(Why, SaysThatNobodyReadsAPassAndWhatReadersTakeInstead) {
  EXPECT_THAT(to_text(why_of(small_graph({"lighting.inputs.visibility=none"}), "ao")),
              StartsWith(R"(pass 'ao' (ambient_occlusion/gtao) does not run: nobody asks for 'ao.noisy', 'ao.visibility'
  written at small.toml:5:1
  the graph's output is 'display.color', written at small.toml:1:10

who uses it
  ao.noisy       no other pass reads it
  ao.visibility  not read: 'lighting' takes nothing as 'visibility' (--set)

settings, and where each comes from
)"));
}

TEST(Why, SaysThatTheTechniqueIsNoneAndWhatIsSeenInItsPlace) {
  EXPECT_EQ(to_text(why_of(small_graph({"ao.technique=none"}), "ao")),
            R"(pass 'ao' (ambient_occlusion/none) does not run: its technique is "none", at --set
  written at small.toml:5:1

what passes see in its place
  'lighting': 'visibility' is the neutral value (1, 1, 1, 1)
)");
  EXPECT_EQ(to_text(why_of(small_graph({"ao.enabled=false"}), "ao")),
            R"(pass 'ao' (ambient_occlusion/gtao) does not run: it says enabled = false, at --set
  written at small.toml:5:1

what passes see in its place
  'lighting': 'visibility' is the neutral value (1, 1, 1, 1)
)");
}

TEST(Why, SaysWhichLineOfWhichFileRemovesAPass) {
  WrittenGraph written = overlay(parse(test_support::kSmallGraph, "small.toml"),
                                 parse("extends = \"small.toml\"\nremove = [\"ao\"]\n", "over.toml"));
  EXPECT_EQ(to_text(why_of(written, "ao")),
            R"(pass 'ao' (ambient_occlusion/gtao) does not run: an overlay removes it, at over.toml:2:11
  written at small.toml:5:1

what passes see in its place
  'lighting': 'visibility' is the neutral value (1, 1, 1, 1)
)");
}

TEST(Why, SaysWhatTheSceneLacks) {
  test_support::PluginFolder folder;
  Technique technique = *test_support::shared_registry().find("ambient_occlusion/gtao").technique;
  technique.id = "ambient_occlusion/foggy";
  technique.features = {"fog"};
  folder.add(technique);
  const Registry registry = folder.registry();
  const Json answer = why_of(small_graph({"ao.technique=foggy"}), "ao", registry);
  EXPECT_EQ(answer["rule"], "feature_missing");
  EXPECT_THAT(to_text(answer), StartsWith("pass 'ao' (ambient_occlusion/foggy) does not run: the scene has no 'fog'\n"
                                          "  written at small.toml:5:1\n"));
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
  EXPECT_EQ(test_support::message_of([] { why_of(small_graph(), "oa"); }),
            "small.toml: error: the graph has no pass 'oa'\n"
            "  expected: one of gbuffer, ao, lighting, display\n"
            "  help:     did you mean 'ao'?");
}

}  // namespace
}  // namespace heddle::graph
