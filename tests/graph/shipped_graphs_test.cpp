// SPDX-License-Identifier: Apache-2.0
// Every file of scripts/graphs resolves, orders, and has its barriers proven, with hand-made descriptors.
#include <gmock/gmock.h>

#include <algorithm>

#include "graph/hazard_checker.hpp"
#include "graph/plugin_folder.hpp"

namespace heddle::graph {
namespace {

using test_support::find_hazards;
using test_support::find_needless_barriers;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::filesystem::path graphs() {
  return std::filesystem::path(HEDDLE_SOURCE_DIR) / "scripts" / "graphs";
}

std::vector<std::string> files() {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(graphs()))
    if (entry.path().extension() == ".toml") names.push_back(entry.path().stem().string());
  std::ranges::sort(names);
  return names;
}

std::string sequence_of(const ResolvedGraph& graph, const Order& sequence) {
  std::string text;
  for (const ScheduledStage& stage : sequence.stages)
    text += (text.empty() ? "" : " ") + graph.passes[stage.pass].name + "." +
            graph.passes[stage.pass].entry.technique->stages[stage.stage].name;
  return text;
}

/// Compiles a graph as a frame would, with two more ports asked for, and proves its barriers.
void prove(const std::string& file, const Registry& registry, std::span<const std::string> features) {
  ResolvedGraph graph = resolve(read_graph(graphs() / (file + ".toml")), registry);
  std::vector<ResourceIndex> wanted;
  if (graph.output != kNoIndex) wanted.push_back(graph.output);
  for (const char* name : {"ao.visibility", "shadow.atlas", "bake.occlusion"})
    if (std::ranges::any_of(graph.resources, [&](const Resource& r) { return r.name == name; }))
      wanted.push_back(find_resource(graph, name));
  prune(graph, wanted, features);
  weave_loops(graph);
  const Order sequence = order(graph);
  std::vector<MemoryNeed> needs;
  for (const Resource& resource : graph.resources) {
    const bool has_memory = resource.previous_version == kNoIndex;
    const std::uint64_t texels = std::uint64_t{4} * resource.width * resource.height * resource.layers;
    const std::uint64_t bytes = resource.type == PortType::kImage    ? texels
                                : resource.type == PortType::kBuffer ? resource.byte_size
                                                                     : 0;
    needs.push_back({has_memory ? bytes : 0, 256});
  }
  const Placement placement = alias(graph, sequence, needs, wanted);
  const BarrierPlan plan = plan_barriers(graph, sequence, placement, wanted);
  for (const std::uint32_t iterations : {1U, 2U, 3U})
    EXPECT_THAT(find_hazards(graph, sequence, needs, placement, plan, wanted, 3, iterations), IsEmpty());
  // A list is copied for its count where the last shader has appended; its copy for a stage with latency follows, and
  // the barrier before it finds nothing left to do.
  std::vector<std::string> needless = find_needless_barriers(graph, sequence, needs, placement, plan, wanted);
  std::erase_if(needless, [&](const std::string& barrier) {
    for (std::size_t s = 0; s < sequence.stages.size(); ++s)
      for (const ScheduledStage::Use& use : sequence.stages[s].uses)
        if (sequence.stages[s].is_read_back && graph.resources[use.resource].is_list() &&
            barrier == "before stage " + std::to_string(s) + ": '" + graph.resources[use.resource].name + "'")
          return true;
    return false;
  });
  EXPECT_THAT(needless, IsEmpty());
  EXPECT_LE(placement.heap_size, placement.unaliased_size);
}

class ShippedGraphs : public ::testing::TestWithParam<std::string> {};

TEST_P(ShippedGraphs, ResolveWithEveryBarrierProven) {
  const std::vector<std::string> features{"blended",          "environment",         "lights",
                                          "mesh_detail.fine", "subdivision.surface", "texture_source.virtual"};
  prove(GetParam(), test_support::shared_registry(), {});
  prove(GetParam(), test_support::shared_registry(), features);
}

TEST_P(ShippedGraphs, ResolveWithThePluginsOfThisBuild) {
  const std::filesystem::path plugins = std::filesystem::path(HEDDLE_BUILD_DIR) / "lib" / "heddle" / "plugins";
  if (!std::filesystem::exists(plugins)) GTEST_SKIP() << "no plugins are built in " << plugins;
  const Registry registry({plugins});
  for (const char* id : {"sky/procedural",
                         "sky/uniform",
                         "sky/environment_map",
                         "mesh_detail/chosen",
                         "subdivision/catmull_clark",
                         "gbuffer/raster",
                         "ambient_occlusion/gtao",
                         "ambient_occlusion/ray_traced",
                         "ambient_occlusion/baked",
                         "bake_visibility/depth_maps",
                         "shadow/shadow_map",
                         "shadow/ray_marched_screen",
                         "surface_material/ggx",
                         "light_assignment/tiled",
                         "light_count/heat_map",
                         "texture_source/virtual",
                         "texture_store/tiled",
                         "lighting/deferred",
                         "ray_tracing/path_tracer",
                         "transparency/sorted",
                         "display/linear"})
    if (registry.find(id).technique == nullptr) GTEST_SKIP() << id << " is not built";
  const std::vector<std::string> features{"blended",          "environment",         "lights",
                                          "mesh_detail.fine", "subdivision.surface", "texture_source.virtual"};
  prove(GetParam(), registry, {});
  prove(GetParam(), registry, features);
}

INSTANTIATE_TEST_SUITE_P(Files, ShippedGraphs, ::testing::ValuesIn(files()),
                         [](const auto& test) { return test.param; });

TEST(DeferredGraph, RunsInTheOrderThatThePortsDemand) {
  ResolvedGraph graph = resolve(read_graph(graphs() / "deferred.toml"), test_support::shared_registry());
  prune(graph, std::array{graph.output}, {});
  EXPECT_EQ(
      sequence_of(graph, order(graph)),
      "sky.sun shadow.views sky.sky_map sky.filter gbuffer.draw ao.horizon ao.denoise shadow.draw material.tables "
      "lighting.light display.encode");
}

TEST(VirtualTextureGraph, CopiesWhatFunctionsAppendAfterAllThatCallThem) {
  const std::array<std::string, 2> features{"blended", "texture_source.virtual"};
  ResolvedGraph graph = resolve(read_graph(graphs() / "virtual_texture.toml"), test_support::shared_registry());
  prune(graph, std::array{graph.output}, features);
  // In every order that is right, not by chance.
  for (const Order& sequence : find_orders(graph, 32).orders) {
    const std::vector<ScheduledStage>& stages = sequence.stages;
    const auto copy = std::ranges::find_if(stages, &ScheduledStage::is_read_back);
    ASSERT_NE(copy, stages.end());
    for (const char* caller : {"gbuffer", "transparency"}) {
      const auto found = std::ranges::find_if(stages, [&](const ScheduledStage& stage) {
        return graph.passes[stage.pass].name == caller && !stage.is_read_back;
      });
      ASSERT_NE(found, stages.end()) << caller;
      EXPECT_LT(found - copy, 0) << caller;
    }
  }
}

TEST(DeferredGraph, DrawsAndTracesWhatSubdivisionMakes) {
  const std::array<std::string, 1> features{"subdivision.surface"};
  ResolvedGraph graph = resolve(read_graph(graphs() / "reference_ao.toml"), test_support::shared_registry());
  prune(graph, std::array{graph.output}, features);
  const Order sequence = order(graph);
  const std::string text = sequence_of(graph, sequence);
  EXPECT_LT(text.find("subdivision.refine"), text.find("gbuffer.draw"));
  EXPECT_LT(text.find("subdivision.refine"), text.find("shadow.draw"));
  for (const char* reader : {"gbuffer", "shadow", "ao"}) {
    const auto pass = std::ranges::find(graph.passes, reader, &Pass::name);
    EXPECT_EQ(graph.resources[pass->ports.at("surfaces")].name, "subdivision.surfaces") << reader;
  }
  for (const ScheduledStage& stage : sequence.stages) {
    const std::string& name = graph.passes[stage.pass].name;
    if (name != "gbuffer" && name != "ao") continue;
    const auto use =
        std::ranges::find(stage.uses, find_resource(graph, "subdivision.vertices"), &ScheduledStage::Use::resource);
    ASSERT_NE(use, stage.uses.end()) << name;
    EXPECT_EQ(use->access, name == "ao" ? HEDDLE_ACCESS_HOST_READ : HEDDLE_ACCESS_DRAW);
    EXPECT_TRUE(use->reads && !use->writes);
  }
}

TEST(DeferredGraph, RunsTheSameInWhateverOrderThePassesWithNamedPortsStand) {
  // With every binding written out, the file's order decides ties only: dependencies come from the ports.
  WrittenGraph written = read_graph(graphs() / "deferred.toml");
  const ResolvedGraph graph = resolve(written, test_support::shared_registry());
  for (WrittenPass& pass : written.passes) {
    const std::string& name = std::get<std::string>(pass.name.value);
    const auto resolved = std::ranges::find(graph.passes, name, &Pass::name);
    for (const Port& port : resolved->entry.technique->ports) {
      if (port.direction == Direction::kOut) continue;
      const auto& bound = port.direction == Direction::kIn ? resolved->ports : resolved->inout_sources;
      const auto found = bound.find(port.name);
      pass.inputs.emplace_back(WrittenKey{port.name, {}, {}},
                               Written{found == bound.end() ? "none" : graph.resources[found->second].name, {}});
    }
    for (const FunctionBinding& binding : resolved->functions) {
      std::vector<Written> providers;
      for (const PassIndex p : binding.providers) providers.push_back({graph.passes[p].name, {}});
      pass.functions.emplace_back(WrittenKey{binding.role, {}, {}}, Written{providers, {}});
    }
  }
  std::ranges::reverse(written.passes);
  const ResolvedGraph turned = resolve(written, test_support::shared_registry());
  for (const Pass& pass : graph.passes) {
    const auto other = std::ranges::find(turned.passes, pass.name, &Pass::name);
    ASSERT_NE(other, turned.passes.end());
    for (const auto& [port, resource] : pass.ports)
      EXPECT_EQ(turned.resources[other->ports.at(port)].name, graph.resources[resource].name);
  }
  const Order sequence = order(turned);
  std::vector<std::size_t> last(turned.passes.size(), 0), first(turned.passes.size(), 0);
  for (std::size_t s = sequence.stages.size(); s-- > 0;) first[sequence.stages[s].pass] = s;
  for (std::size_t s = 0; s < sequence.stages.size(); ++s) last[sequence.stages[s].pass] = s;
  const auto index = [&](std::string_view name) {
    return static_cast<std::size_t>(std::ranges::find(turned.passes, name, &Pass::name) - turned.passes.begin());
  };
  EXPECT_LT(last[index("gbuffer")], first[index("ao")]);
  EXPECT_LT(last[index("ao")], first[index("lighting")]);
  EXPECT_LT(last[index("shadow")], first[index("lighting")]);
  EXPECT_LT(last[index("material")], first[index("lighting")]);
  EXPECT_LT(last[index("lighting")], first[index("display")]);
}

TEST(SupersampledGraph, RepeatsWhatDependsOnTheCameraAndNothingElse) {
  ResolvedGraph graph = resolve(read_graph(graphs() / "supersampled.toml"), test_support::shared_registry());
  prune(graph, std::array{graph.output}, {});
  weave_loops(graph);
  const Order sequence = order(graph);
  EXPECT_EQ(sequence_of(graph, sequence),
            "sky.sun sky.sky_map sky.filter material.tables "
            "aa.move shadow.views gbuffer.draw ao.horizon ao.denoise shadow.draw lighting.light aa.accumulate "
            "aa.resolve display.encode");
  ASSERT_EQ(sequence.loops.size(), 1U);
  EXPECT_EQ(sequence.loops[0].begin, 4U);
  EXPECT_EQ(sequence.loops[0].end, 12U);
}

TEST(SupersampledGraph, IsThePlainGraphWithoutTheWord) {
  WrittenGraph written = read_graph(graphs() / "supersampled.toml");
  apply_setting(written, "aa.technique=none");
  ResolvedGraph graph = resolve(written, test_support::shared_registry());
  ResolvedGraph plain = resolve(read_graph(graphs() / "deferred.toml"), test_support::shared_registry());
  for (ResolvedGraph* one : {&graph, &plain}) {
    prune(*one, std::array{one->output}, {});
    weave_loops(*one);
  }
  EXPECT_TRUE(graph.loops.empty());
  EXPECT_EQ(sequence_of(graph, order(graph)), sequence_of(plain, order(plain)));
}

TEST(ReferenceAo, SwapsOneWord) {
  const ResolvedGraph deferred = resolve(read_graph(graphs() / "deferred.toml"), test_support::shared_registry());
  const ResolvedGraph reference = resolve(read_graph(graphs() / "reference_ao.toml"), test_support::shared_registry());
  ASSERT_EQ(deferred.passes.size(), reference.passes.size());
  for (std::size_t p = 0; p < deferred.passes.size(); ++p) {
    const bool is_ao = deferred.passes[p].name == "ao";
    EXPECT_EQ(deferred.passes[p].entry.technique == reference.passes[p].entry.technique, !is_ao);
  }
}

}  // namespace
}  // namespace heddle::graph
