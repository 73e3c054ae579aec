// SPDX-License-Identifier: Apache-2.0
// The sequence of stages: dependencies, ties, changes in place, functions, early cpu stages, splits, cycles.
#include <gmock/gmock.h>

#include <random>

#include "graph/plugin_folder.hpp"
#include "graph/synthetic_graph.hpp"

namespace heddle::graph {
namespace {

using test_support::message_of;
using test_support::SyntheticGraph;
using test_support::touch;

TEST(Order, FollowsPortsAndNotTheFile) {
  SyntheticGraph made;
  const PassIndex reader = made.pass("reader"), writer = made.pass("writer");
  const ResourceIndex a = made.image(writer, "a");
  made.input(reader, "a", a);
  made.gpu(reader, "main", {touch("a", HEDDLE_ACCESS_SAMPLED)});
  made.gpu(writer, "main", {touch("a", HEDDLE_ACCESS_STORAGE_WRITE)});
  EXPECT_EQ(made.text(order(made.graph)), "writer.main reader.main");
}

TEST(Order, BreaksTiesByTheFileAndKeepsDeclaredStages) {
  SyntheticGraph made;
  for (const char* name : {"b", "a"}) {
    const PassIndex pass = made.pass(name);
    made.image(pass, "x");
    made.gpu(pass, "second_name", {touch("x", HEDDLE_ACCESS_STORAGE_WRITE)});
    made.gpu(pass, "first_name", {touch("x", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
  }
  EXPECT_EQ(made.text(order(made.graph)), "b.second_name b.first_name a.second_name a.first_name");
}

TEST(Order, LeavesOutStagesThatAChoiceRulesOut) {
  const auto text = [](std::size_t chosen) {
    SyntheticGraph made;
    made.image(made.pass("before"), "y");
    made.gpu(0, "main", {touch("y", HEDDLE_ACCESS_STORAGE_WRITE)});
    const PassIndex pass = made.pass("a");
    made.image(pass, "x");
    for (const char* name : {"first", "left", "right", "last"})
      made.gpu(pass, name, {touch("x", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
    made.choose(pass, {"both", "left", "right"}, chosen);
    made.only_if(pass, 0, "both");
    made.only_if(pass, 1, "left");
    made.only_if(pass, 2, "right");
    const Order ordered = order(made.graph);
    for (const StageDependency& one : stage_dependencies(made.graph)) EXPECT_EQ(one.from_pass, one.to_pass);
    return made.text(ordered);
  };
  EXPECT_EQ(text(0), "before.main a.first a.last");
  EXPECT_EQ(text(1), "before.main a.left a.last");
  EXPECT_EQ(text(2), "before.main a.right a.last");
}

TEST(Order, LeavesPrunedPassesOut) {
  SyntheticGraph made;
  const PassIndex pass = made.pass("a");
  made.image(pass, "x");
  made.gpu(pass, "main", {touch("x", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.graph.passes[pass].is_pruned = true;
  EXPECT_TRUE(order(made.graph).stages.empty());
}

TEST(Order, PutsReadersOfTheOldVersionBeforeTheChange) {
  SyntheticGraph made;
  const PassIndex first = made.pass("first"), changer = made.pass("changer"), old_reader = made.pass("old_reader"),
                  new_reader = made.pass("new_reader");
  const ResourceIndex a = made.image(first, "a");
  made.gpu(first, "main", {touch("a", HEDDLE_ACCESS_STORAGE_WRITE)});
  const ResourceIndex changed = made.change(changer, "a", a);
  made.gpu(changer, "main", {touch("a", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
  made.input(old_reader, "a", a);
  made.gpu(old_reader, "main", {touch("a", HEDDLE_ACCESS_SAMPLED)});
  made.input(new_reader, "a", changed);
  made.gpu(new_reader, "main", {touch("a", HEDDLE_ACCESS_SAMPLED)});
  EXPECT_EQ(made.text(order(made.graph)), "first.main old_reader.main changer.main new_reader.main");
}

TEST(Order, RunsProvidersAndWhatTheyReadBeforeCallers) {
  SyntheticGraph made;
  const PassIndex caller = made.pass("caller"), outer = made.pass("outer"), inner = made.pass("inner"),
                  depth = made.pass("depth");
  const ResourceIndex d = made.image(depth, "d");
  made.gpu(depth, "main", {touch("d", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.input(inner, "d", d);
  made.provide(inner, "noise", {touch("d", HEDDLE_ACCESS_SAMPLED)});
  made.image(outer, "map");
  made.gpu(outer, "main", {touch("map", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.provide(outer, "shadow", {touch("map", HEDDLE_ACCESS_SAMPLED)}, {"noise"});
  made.bind(outer, "noise", {inner});
  made.image(caller, "out");
  made.gpu(caller, "quiet", {touch("out", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.gpu(caller, "calls", {touch("out", HEDDLE_ACCESS_STORAGE_READ_WRITE)}, ShaderKind::kFullscreen, {"shadow"});
  made.bind(caller, "shadow", {outer});
  const Order result = order(made.graph);
  EXPECT_EQ(made.text(result), "caller.quiet outer.main depth.main caller.calls");
  // The uses of the functions are the caller's, in the stage whose shader calls, and only there.
  std::vector<std::string> uses;
  for (const auto& use : result.stages[3].uses) uses.push_back(made.graph.resources[use.resource].name);
  EXPECT_THAT(uses, ::testing::UnorderedElementsAre("caller.out", "outer.map", "depth.d"));
  EXPECT_EQ(result.stages[0].uses.size(), 1U);
  EXPECT_THAT(reached_providers(made.graph, caller, std::array{std::string("shadow")}),
              ::testing::ElementsAre(outer, inner));
}

TEST(Order, LetsAStageWithLatencyRunBeforeWhatItReadsIsMade) {
  SyntheticGraph made;
  const PassIndex manager = made.pass("manager"), draw = made.pass("draw"), paint = made.pass("paint");
  const ResourceIndex pages = made.value(manager, "pages");
  made.input(draw, "pages", pages);
  const ResourceIndex feedback = made.buffer(draw, "feedback");
  made.gpu(draw, "main", {touch("pages", HEDDLE_ACCESS_VALUE), touch("feedback", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.input(manager, "feedback", feedback);
  made.cpu(manager, "update", {touch("feedback", HEDDLE_ACCESS_HOST_READ), touch("pages", HEDDLE_ACCESS_VALUE)});
  made.change(paint, "feedback", feedback);
  made.gpu(paint, "main", {touch("feedback", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
  EXPECT_THROW(order(made.graph), Error);  // without latency each waits for the other
  made.delay(manager, 0, 2);
  const Order result = order(made.graph);
  EXPECT_EQ(made.text(result), "manager.update draw.main manager.update paint.main");
  EXPECT_FALSE(result.stages[0].is_read_back);
  EXPECT_TRUE(result.stages[2].is_read_back);  // before it is changed in place
  for (const ScheduledStage& stage : result.stages) EXPECT_FALSE(stage.splits_submission);
  ASSERT_EQ(result.stages[0].uses.size(), 1U);
  EXPECT_EQ(result.stages[0].uses[0].resource, pages);
  ASSERT_EQ(result.stages[2].uses.size(), 1U);
  EXPECT_EQ(result.stages[2].uses[0].resource, feedback);
}

TEST(Order, SeesNoCycleInWhatIsReadOfTheLastFrame) {
  SyntheticGraph made;
  const PassIndex light = made.pass("light"), probes = made.pass("probes");
  const ResourceIndex radiance = made.image(light, "radiance");
  const ResourceIndex field = made.image(probes, "field", HEDDLE_PORT_KEPT);
  made.input(light, "field", made.history(field));
  made.gpu(light, "main", {touch("field", HEDDLE_ACCESS_SAMPLED), touch("radiance", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.input(probes, "radiance", radiance);
  made.gpu(probes, "main", {touch("radiance", HEDDLE_ACCESS_SAMPLED), touch("field", HEDDLE_ACCESS_STORAGE_WRITE)});
  EXPECT_EQ(made.text(order(made.graph)), "light.main probes.main");
}

TEST(Order, MergesSeveralAccessesOfOneResource) {
  SyntheticGraph made;
  const PassIndex source = made.pass("source"), contact = made.pass("contact"), caller = made.pass("caller");
  const ResourceIndex d = made.image(source, "d");
  made.gpu(source, "main", {touch("d", HEDDLE_ACCESS_DEPTH, HEDDLE_LOAD_CLEAR)}, ShaderKind::kSurfaces);
  made.input(contact, "d", d);
  made.provide(contact, "shadow", {touch("d", HEDDLE_ACCESS_SAMPLED)});
  made.input(caller, "d", d);
  made.gpu(caller, "main", {touch("d", HEDDLE_ACCESS_DEPTH_READ)}, ShaderKind::kSurfaces, {"shadow"});
  made.bind(caller, "shadow", {contact});
  const Order result = order(made.graph);
  ASSERT_EQ(result.stages[1].uses.size(), 1U);
  const auto& use = result.stages[1].uses[0];
  EXPECT_EQ(use.mask, (1U << HEDDLE_ACCESS_DEPTH_READ) | (1U << HEDDLE_ACCESS_SAMPLED));
  const AccessInfo info = use_info(use, PortType::kImage, VK_FORMAT_D32_SFLOAT);
  EXPECT_EQ(info.layout, VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL);
  EXPECT_EQ(info.access, VK_ACCESS_2_SHADER_SAMPLED_READ_BIT | VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT);
  EXPECT_TRUE(use.reads);
  EXPECT_FALSE(use.writes);
}

TEST(Order, SchedulesCpuStagesOfValuesEarlyWithoutSplitting) {
  SyntheticGraph made;
  const PassIndex draw = made.pass("draw"), sun = made.pass("sun"), light = made.pass("light");
  made.image(draw, "a");
  made.gpu(draw, "main", {touch("a", HEDDLE_ACCESS_STORAGE_WRITE)});
  const ResourceIndex lights = made.value(sun, "lights");
  made.cpu(sun, "main", {touch("lights", HEDDLE_ACCESS_VALUE)});
  made.input(light, "lights", lights);
  made.image(light, "b");
  made.gpu(light, "main", {touch("lights", HEDDLE_ACCESS_VALUE), touch("b", HEDDLE_ACCESS_STORAGE_WRITE)});
  const Order result = order(made.graph);
  EXPECT_EQ(made.text(result), "sun.main draw.main light.main");
  for (const ScheduledStage& stage : result.stages) EXPECT_FALSE(stage.splits_submission);
  EXPECT_TRUE(result.stages[0].uses[0].writes);
  EXPECT_FALSE(result.stages[2].uses[0].writes);
}

TEST(Order, SplitsWhereTheHostReadsWhatTheGpuMade) {
  SyntheticGraph made;
  const PassIndex draw = made.pass("draw"), trace = made.pass("trace"), use = made.pass("use");
  const ResourceIndex depth = made.image(draw, "depth");
  made.gpu(draw, "main", {touch("depth", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.input(trace, "depth", depth);
  const ResourceIndex visibility = made.image(trace, "visibility");
  made.cpu(trace, "main", {touch("depth", HEDDLE_ACCESS_HOST_READ), touch("visibility", HEDDLE_ACCESS_HOST_WRITE)});
  made.input(use, "visibility", visibility);
  made.gpu(use, "main", {touch("visibility", HEDDLE_ACCESS_SAMPLED)});
  const Order result = order(made.graph);
  EXPECT_EQ(made.text(result), "draw.main trace.main use.main");
  EXPECT_FALSE(result.stages[0].splits_submission);
  EXPECT_TRUE(result.stages[1].splits_submission);
  EXPECT_FALSE(result.stages[2].splits_submission);
}

TEST(Order, NamesACycleAndWhoReadsWhat) {
  SyntheticGraph made;
  const PassIndex a = made.pass("a"), b = made.pass("b");
  const ResourceIndex x = made.image(a, "x"), y = made.image(b, "y");
  made.input(a, "y", y);
  made.input(b, "x", x);
  made.gpu(a, "main", {touch("y", HEDDLE_ACCESS_SAMPLED), touch("x", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.gpu(b, "main", {touch("x", HEDDLE_ACCESS_SAMPLED), touch("y", HEDDLE_ACCESS_STORAGE_WRITE)});
  EXPECT_EQ(message_of([&] { order(made.graph); }),
            "synthetic.toml:1:1: error: these passes wait for each other: a -> b -> a\n"
            "  found:    'a' reads 'b.y'; 'b' reads 'a.x'\n"
            "  help:     bind one of these inputs to another pass, or to \"none\"");
}

TEST(Order, NamesAPassThatCallsAFunctionOverItsOwnOutput) {
  SyntheticGraph made;
  const PassIndex light = made.pass("light"), contact = made.pass("contact");
  const ResourceIndex x = made.image(light, "x");
  made.input(contact, "x", x);
  made.provide(contact, "shadow", {touch("x", HEDDLE_ACCESS_SAMPLED)});
  made.gpu(light, "main", {touch("x", HEDDLE_ACCESS_STORAGE_WRITE)}, ShaderKind::kCompute, {"shadow"});
  made.bind(light, "shadow", {contact});
  EXPECT_THAT(message_of([&] { order(made.graph); }), ::testing::HasSubstr("light -> light"));
}

TEST(Order, NamesFunctionsThatCallEachOther) {
  SyntheticGraph made;
  const PassIndex a = made.pass("a"), b = made.pass("b");
  made.provide(a, "shadow", {}, {"noise"});
  made.provide(b, "noise", {}, {"shadow"});
  made.bind(a, "noise", {b});
  made.bind(b, "shadow", {a});
  EXPECT_THAT(message_of([&] { order(made.graph); }),
              ::testing::HasSubstr("these passes wait for each other: a -> b -> a"));
}

TEST(Order, IsTheSameForAnyDagEveryTimeAndRespectsIt) {
  std::mt19937 random(7);
  for (int round = 0; round < 50; ++round) {
    SyntheticGraph made;
    std::vector<ResourceIndex> images;
    for (int i = 0; i < 12; ++i) {
      const PassIndex pass = made.pass("p" + std::to_string(i));
      images.push_back(made.image(pass, "x"));
    }
    // Edges only from a random permutation's earlier to its later passes.
    std::vector<PassIndex> permutation(12);
    for (PassIndex i = 0; i < 12; ++i) permutation[i] = i;
    std::shuffle(permutation.begin(), permutation.end(), random);
    for (std::size_t i = 0; i < 12; ++i) {
      std::vector<Access> accesses{touch("x", HEDDLE_ACCESS_STORAGE_WRITE)};
      for (std::size_t j = 0; j < i; ++j) {
        if (random() % 4 != 0) continue;
        const std::string port = "in" + std::to_string(j);
        made.input(permutation[i], port, images[permutation[j]]);
        accesses.push_back(touch(port, HEDDLE_ACCESS_SAMPLED));
      }
      made.gpu(permutation[i], "main", accesses);
    }
    const Order result = order(made.graph);
    EXPECT_EQ(made.text(result), made.text(order(made.graph)));
    std::vector<std::size_t> place(12);
    ASSERT_EQ(result.stages.size(), 12U);
    for (std::size_t s = 0; s < 12; ++s) place[result.stages[s].pass] = s;
    for (const ScheduledStage& stage : result.stages)
      for (const auto& use : stage.uses)
        EXPECT_LE(place[made.graph.resources[use.resource].producer], place[stage.pass]);
  }
}

TEST(Orders, OfAChainThereIsOne) {
  SyntheticGraph made;
  const PassIndex writer = made.pass("writer"), reader = made.pass("reader");
  made.input(reader, "a", made.image(writer, "a"));
  made.gpu(writer, "main", {touch("a", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.gpu(reader, "main", {touch("a", HEDDLE_ACCESS_SAMPLED)});
  const OrderSet set = find_orders(made.graph, 16);
  EXPECT_EQ(set.orders.size(), 1U);
  EXPECT_EQ(set.unordered_pairs, 0U);
}

TEST(Orders, StopAtTheLimitAndSayWhatWasNotSeen) {
  SyntheticGraph made;
  for (const char* name : {"a", "b"}) {
    const PassIndex pass = made.pass(name);
    made.image(pass, "x");
    made.gpu(pass, "main", {touch("x", HEDDLE_ACCESS_STORAGE_WRITE)});
  }
  const OrderSet one = find_orders(made.graph, 1);
  EXPECT_EQ(one.unordered_pairs, 1U);
  EXPECT_EQ(one.seen_both_ways, 0U);
  const OrderSet two = find_orders(made.graph, 2);
  EXPECT_EQ(two.seen_both_ways, 1U);
  EXPECT_EQ(made.text(two.orders[0]), made.text(order(made.graph))) << "order's own comes first";
  EXPECT_EQ(made.text(two.orders[1]), "b.main a.main");
}

TEST(Orders, ShowEveryPairBothWaysAndKeepEveryDependency) {
  std::mt19937 random(5);
  for (int round = 0; round < 40; ++round) {
    constexpr std::size_t kPasses = 12;
    SyntheticGraph made;
    std::vector<ResourceIndex> images;
    std::vector<std::vector<bool>> waits(kPasses, std::vector<bool>(kPasses, false));
    for (std::size_t i = 0; i < kPasses; ++i) {
      const PassIndex p = made.pass("p" + std::to_string(i));
      std::vector<Access> accesses{touch("out", HEDDLE_ACCESS_STORAGE_WRITE)};
      for (std::size_t j = 0; j < i; ++j) {
        if (random() % 6 != 0) continue;
        made.input(p, "in" + std::to_string(j), images[j]);
        accesses.push_back(touch("in" + std::to_string(j), HEDDLE_ACCESS_SAMPLED));
        waits[i][j] = true;
        for (std::size_t k = 0; k < j; ++k) waits[i][k] = waits[i][k] || waits[j][k];
      }
      images.push_back(made.image(p, "out"));
      made.gpu(p, "main", accesses);
    }
    const OrderSet set = find_orders(made.graph, 200);
    std::vector<std::vector<bool>> seen(kPasses, std::vector<bool>(kPasses, false));
    for (const Order& one : set.orders) {
      ASSERT_EQ(one.stages.size(), kPasses);
      for (std::size_t i = 0; i < kPasses; ++i) {
        for (std::size_t j = i + 1; j < kPasses; ++j) {
          const PassIndex earlier = one.stages[i].pass, later = one.stages[j].pass;
          EXPECT_FALSE(waits[earlier][later]);
          seen[earlier][later] = true;
        }
      }
    }
    std::size_t unordered = 0;
    for (std::size_t a = 0; a < kPasses; ++a) {
      for (std::size_t b = a + 1; b < kPasses; ++b) {
        if (waits[a][b] || waits[b][a]) continue;
        ++unordered;
        EXPECT_TRUE(seen[a][b] && seen[b][a]) << a << " and " << b;
      }
    }
    EXPECT_EQ(set.unordered_pairs, unordered);
    EXPECT_EQ(set.seen_both_ways, unordered);
  }
}

}  // namespace
}  // namespace heddle::graph
