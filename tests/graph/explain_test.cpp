// SPDX-License-Identifier: Apache-2.0
// What explain says: for people, for programs, for Graphviz.
#include <gmock/gmock.h>

#include "graph/plugin_folder.hpp"
#include "json.hpp"
#include "parsed.hpp"

namespace heddle::graph {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;

struct Explained {
  std::string text, json, dot;
};

Explained explain(std::initializer_list<const char*> settings) {
  WrittenGraph written = parse(test_support::kSmallGraph, "small.toml");
  for (const char* setting : settings) apply_setting(written, setting);
  ResolvedGraph graph = resolve(written, test_support::shared_registry());
  prune(graph, std::array{graph.output}, {});
  const Order sequence = order(graph);
  std::vector<MemoryNeed> needs;
  for (const Resource& resource : graph.resources)
    needs.push_back({resource.type == PortType::kImage ? std::uint64_t{4} * resource.width * resource.height : 0, 256});
  const std::array wanted{graph.output};
  const Placement placement = alias(graph, sequence, needs, wanted);
  const BarrierPlan barriers = plan_barriers(graph, sequence, placement, wanted);
  return {explain_text(graph, sequence, placement, barriers), explain_json(graph, sequence, placement, barriers),
          explain_dot(graph, sequence)};
}

TEST(Explain, SaysWhatStaysAndWhy) {
  const std::string text = explain({"extent=[64,32]"}).text;
  EXPECT_THAT(text, HasSubstr("small.toml: 64 x 32 pixels, output 'display.color'\n"));
  EXPECT_THAT(text, HasSubstr("kept  ao        ambient_occlusion/gtao  makes 'ao.visibility' for 'lighting'\n"));
  EXPECT_THAT(text, HasSubstr("lighting  calls shadow            the neutral answer\n"));
  EXPECT_THAT(text, HasSubstr("gpu gbuffer.draw\n"));
  EXPECT_THAT(
      text,
      HasSubstr("barrier 'ao.noisy' compute (storage_write) -> compute (sampled_read), general -> shader_read_only\n"));
  EXPECT_THAT(text, HasSubstr("gbuffer.depth             r32f 64 x 32        heap at "));
  EXPECT_THAT(text, HasSubstr("5 stages"));
}

TEST(Explain, SaysThePeakMemoryOrThatNobodyKnowsIt) {
  EXPECT_THAT(explain({}).text, ContainsRegex("peak memory of images and buffers: [0-9.]+ [KMi]*B, [0-9.]+ [KMi]*B "
                                              "without sharing; [0-9.]+ [KMi]*B of it is kept or read afterwards\n"));
  const auto memory = parsed::json(explain({"extent=[64,32]"}).json)["memory"];
  EXPECT_GE(memory["own_bytes"], 4 * 64 * 32) << "the output, which is read afterwards";
  EXPECT_LE(memory["heap_bytes"], memory["unaliased_bytes"]);
  ResolvedGraph graph = resolve(parse(test_support::kSmallGraph, "small.toml"), test_support::shared_registry());
  prune(graph, std::array{graph.output}, {});
  const Order sequence = order(graph);
  const Placement placement = alias(graph, sequence, std::vector<MemoryNeed>(graph.resources.size()), {});
  EXPECT_THAT(explain_text(graph, sequence, placement, plan_barriers(graph, sequence, placement, {})),
              HasSubstr("peak memory of images and buffers: not known without a device\n"));
}

TEST(Explain, SaysWhatGoesAndWhy) {
  const std::string text = explain({"lighting.inputs.visibility=none"}).text;
  EXPECT_THAT(text,
              HasSubstr("dropped  ao        ambient_occlusion/gtao  nobody asks for 'ao.noisy', 'ao.visibility'\n"));
  EXPECT_THAT(explain({"ao.technique=none"}).text,
              HasSubstr("note: pass 'ao': technique none, its outputs are neutral\n"));
}

TEST(Explain, ShowsTheStall) {
  EXPECT_THAT(explain({"ao.technique=ray_traced"}).text,
              HasSubstr("cpu ao.trace   waits for the gpu: reads what it made this frame\n"));
}

TEST(Explain, GivesTheSameFactsAsJson) {
  const auto json = parse_json(explain({"ao.params.falloff=linear"}).json);
  EXPECT_EQ(json["output"], "display.color");
  EXPECT_EQ(json["passes"].size(), 4U);
  EXPECT_EQ(json["passes"][1]["parameters"]["falloff"], "linear");
  EXPECT_EQ(json["passes"][1]["parameters"]["denoise"], true);
  EXPECT_EQ(json["passes"][1]["ports"]["depth"], "gbuffer.depth");
  EXPECT_EQ(json["stages"].size(), 5U);
  EXPECT_EQ(json["stages"][0]["pass"], "gbuffer");
  EXPECT_GT(json["memory"]["unaliased_bytes"], json["memory"]["heap_bytes"]);
  EXPECT_EQ(json["barriers_at_end"][0]["new_layout"], "transfer_src");
}

TEST(Explain, DrawsPrunedPassesGrey) {
  const std::string dot = explain({"lighting.inputs.visibility=none"}).dot;
  EXPECT_THAT(dot, HasSubstr("digraph heddle {"));
  EXPECT_THAT(dot, HasSubstr("\"gbuffer\" -> \"lighting\" [label=\"depth\"]"));
  EXPECT_THAT(dot, HasSubstr("\"ao\" [label=\"ao\\nambient_occlusion/gtao\", tooltip=\"nobody asks for 'ao.noisy', "
                             "'ao.visibility'\", fillcolor=grey90"));
  EXPECT_THAT(dot, HasSubstr("\"gbuffer\" -> \"ao\" [label=\"depth\", color=grey, fontcolor=grey]"));
}

}  // namespace
}  // namespace heddle::graph
