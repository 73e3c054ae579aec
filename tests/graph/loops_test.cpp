// SPDX-License-Identifier: Apache-2.0
// Which passes a loop repeats, in which order, with which memory and barriers; and what is refused in a loop.
#include <gmock/gmock.h>

#include <algorithm>
#include <random>

#include "graph/hazard_checker.hpp"
#include "graph/plugin_folder.hpp"
#include "graph/synthetic_graph.hpp"

namespace heddle::graph {
namespace {

using test_support::find_hazards;
using test_support::find_needless_barriers;
using test_support::message_of;
using test_support::SyntheticGraph;
using test_support::touch;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

/// camera -> draw.a -> light.b -> loop (gathers b, makes it anew) -> show.c; table.t is read by light, not repeated.
struct Sampled : SyntheticGraph {
  PassIndex camera = pass("camera"), table = pass("table"), draw = pass("draw"), light = pass("light"),
            loop_pass = pass("aa"), show = pass("show");
  ResourceIndex view, t, a, b, sample_view, sum, mean, c;
  Sampled() {
    view = value(camera, "view");
    cpu(camera, "main", {touch("view", HEDDLE_ACCESS_VALUE)});
    t = image(table, "t");
    gpu(table, "main", {touch("t", HEDDLE_ACCESS_STORAGE_WRITE)});
    input(draw, "view", view);
    a = image(draw, "a");
    gpu(draw, "main", {touch("view", HEDDLE_ACCESS_VALUE), touch("a", HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_CLEAR)},
        ShaderKind::kSurfaces);
    input(light, "a", a);
    input(light, "t", t);
    b = image(light, "b");
    gpu(light, "main",
        {touch("a", HEDDLE_ACCESS_SAMPLED), touch("t", HEDDLE_ACCESS_SAMPLED),
         touch("b", HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_DONT_CARE)},
        ShaderKind::kFullscreen);
    make_loop();
    input(show, "b", mean);
    c = image(show, "c");
    gpu(show, "main", {touch("b", HEDDLE_ACCESS_SAMPLED), touch("c", HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_DONT_CARE)},
        ShaderKind::kFullscreen);
    output(c);
  }
  void make_loop() {
    input(loop_pass, "view", view);
    sample_view = value(loop_pass, "sample_view");
    mean = change(loop_pass, "b", b);
    sum = image(loop_pass, "sum", HEDDLE_PORT_KEPT);
    cpu(loop_pass, "move", {touch("view", HEDDLE_ACCESS_VALUE), touch("sample_view", HEDDLE_ACCESS_VALUE)});
    gpu(loop_pass, "add", {touch("b", HEDDLE_ACCESS_SAMPLED), touch("sum", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
    gpu(loop_pass, "resolve",
        {touch("sum", HEDDLE_ACCESS_SAMPLED), touch("b", HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_DONT_CARE)},
        ShaderKind::kFullscreen);
    part(loop_pass, 0, HEDDLE_LOOP_BEFORE);
    part(loop_pass, 1, HEDDLE_LOOP_AFTER);
    loop(loop_pass, "view", "sample_view", "b");
  }
  Order weave() {
    prune(graph, std::array{graph.output}, {});
    weave_loops(graph);
    return order(graph);
  }
};

struct PlannedLoops {
  std::vector<MemoryNeed> needs;
  Placement placement;
  BarrierPlan plan;
};

PlannedLoops plan_frame(const ResolvedGraph& graph, const Order& sequence, std::span<const ResourceIndex> wanted) {
  PlannedLoops planned;
  for (const Resource& resource : graph.resources) {
    const bool has_memory = (resource.type == PortType::kImage || resource.type == PortType::kBuffer) &&
                            resource.previous_version == kNoIndex;
    planned.needs.push_back({has_memory ? std::uint64_t{1000} : 0, 64});
  }
  planned.placement = alias(graph, sequence, planned.needs, wanted);
  planned.plan = plan_barriers(graph, sequence, planned.placement, wanted);
  return planned;
}

PlannedLoops expect_proven(const ResolvedGraph& graph, const Order& sequence, std::span<const ResourceIndex> wanted) {
  PlannedLoops planned = plan_frame(graph, sequence, wanted);
  for (const std::uint32_t iterations : {1U, 2U, 3U, 4U})
    EXPECT_THAT(find_hazards(graph, sequence, planned.needs, planned.placement, planned.plan, wanted, 3, iterations),
                IsEmpty())
        << iterations << " iterations";
  EXPECT_THAT(find_needless_barriers(graph, sequence, planned.needs, planned.placement, planned.plan, wanted),
              IsEmpty());
  return planned;
}

TEST(Loops, RepeatWhatLiesBetweenTheOverriddenValueAndTheGatheredInput) {
  Sampled made;
  const Order sequence = made.weave();
  EXPECT_EQ(made.text(sequence), "camera.main table.main aa.move draw.main light.main aa.add aa.resolve show.main");
  ASSERT_EQ(sequence.loops.size(), 1U);
  EXPECT_EQ(sequence.loops[0].begin, 2U);
  EXPECT_EQ(sequence.loops[0].end, 6U);
  EXPECT_THAT(made.graph.loops[0].body, ElementsAre(made.draw, made.light));
  EXPECT_EQ(made.graph.passes[made.draw].ports.at("view"), made.sample_view);
  EXPECT_EQ(made.graph.passes[made.loop_pass].ports.at("view"), made.view);
}

TEST(Loops, LeavePassesBelowTheirOwnValue) {
  Sampled made;
  made.input(made.show, "view", made.view);
  made.weave();
  EXPECT_EQ(made.graph.passes[made.show].ports.at("view"), made.view);
}

TEST(Loops, ThatNobodyAsksForOverrideNothing) {
  Sampled made;
  made.output(made.b);
  const Order sequence = made.weave();
  EXPECT_TRUE(made.graph.passes[made.loop_pass].is_pruned);
  EXPECT_TRUE(sequence.loops.empty());
  EXPECT_EQ(made.graph.passes[made.draw].ports.at("view"), made.view);
  EXPECT_EQ(made.text(sequence), "camera.main table.main draw.main light.main");
}

TEST(Loops, RepeatChangersOfTheOverriddenValueToo) {
  // A pass that bends the view: its copy is made of the sample's.
  SyntheticGraph made;
  const PassIndex camera = made.pass("camera"), bend = made.pass("bend"), draw = made.pass("draw"),
                  aa = made.pass("aa");
  const ResourceIndex view = made.value(camera, "view");
  made.cpu(camera, "main", {touch("view", HEDDLE_ACCESS_VALUE)});
  const ResourceIndex bent = made.change(bend, "view", view);
  made.cpu(bend, "main", {touch("view", HEDDLE_ACCESS_VALUE)});
  made.input(draw, "view", bent);
  const ResourceIndex a = made.image(draw, "a");
  made.gpu(draw, "main", {touch("view", HEDDLE_ACCESS_VALUE), touch("a", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.input(aa, "view", view);
  const ResourceIndex sample = made.value(aa, "sample");
  made.input(aa, "a", a);
  const ResourceIndex sum = made.image(aa, "sum", HEDDLE_PORT_KEPT);
  made.cpu(aa, "move", {touch("view", HEDDLE_ACCESS_VALUE), touch("sample", HEDDLE_ACCESS_VALUE)});
  made.gpu(aa, "add", {touch("a", HEDDLE_ACCESS_SAMPLED), touch("sum", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
  made.part(aa, 0, HEDDLE_LOOP_BEFORE);
  made.part(aa, 1, HEDDLE_LOOP_AFTER);
  made.loop(aa, "view", "sample", "a");
  made.output(sum);
  prune(made.graph, std::array{sum}, {});
  weave_loops(made.graph);
  EXPECT_EQ(made.graph.resources[bent].previous_version, sample);
  EXPECT_EQ(made.graph.passes[bend].inout_sources.at("view"), sample);
  EXPECT_EQ(made.text(order(made.graph)), "camera.main aa.move bend.main draw.main aa.add");
}

TEST(Loops, KeepWhatIsMadeBeforeAliveToTheEnd) {
  Sampled made;
  const Order sequence = made.weave();
  const PlannedLoops planned = expect_proven(made.graph, sequence, std::array{made.c});
  // The table is read by light alone, but in every iteration: what is drawn before may not take its bytes.
  EXPECT_NE(planned.placement.offset[made.t], planned.placement.offset[made.a]);
  EXPECT_NE(planned.placement.offset[made.t], planned.placement.offset[made.b]);
  EXPECT_EQ(planned.plan.again.size(), sequence.stages.size());
  EXPECT_FALSE(planned.plan.again[3].empty()) << "what is drawn again waits for who read it";
  for (const std::size_t outside : {0U, 1U, 6U, 7U}) EXPECT_THAT(planned.plan.again[outside], IsEmpty());
}

TEST(Loops, LetHistoriesStandStill) {
  Sampled made;
  const ResourceIndex kept = made.image(made.light, "kept", HEDDLE_PORT_KEPT);
  made.input(made.light, "past", made.history(kept));
  made.gpu(made.light, "blend", {touch("past", HEDDLE_ACCESS_SAMPLED), touch("kept", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.gpu(made.light, "use", {touch("kept", HEDDLE_ACCESS_SAMPLED), touch("b", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
  const Order sequence = made.weave();
  expect_proven(made.graph, sequence, std::array{made.c});
}

TEST(Loops, RunStagesWithLatencyOnce) {
  Sampled made;
  // A manager of pages: its stage sees the sample's view, so it is in the body, but advances by frames.
  const PassIndex manager = made.pass("manager");
  const ResourceIndex pages = made.image(manager, "pages");
  made.input(manager, "view", made.view);
  made.input(manager, "feedback", made.a);
  made.cpu(manager, "update",
           {touch("view", HEDDLE_ACCESS_VALUE), touch("feedback", HEDDLE_ACCESS_HOST_READ),
            touch("pages", HEDDLE_ACCESS_HOST_WRITE)},
           2);
  made.input(made.light, "pages", pages);
  made.gpu(made.light, "page", {touch("pages", HEDDLE_ACCESS_SAMPLED), touch("b", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
  const Order sequence = made.weave();
  EXPECT_EQ(made.text(sequence),
            "camera.main table.main aa.move draw.main light.main manager.update light.page aa.add "
            "aa.resolve show.main manager.update");
  EXPECT_TRUE(sequence.stages[5].runs_once);
  EXPECT_TRUE(sequence.stages[10].is_read_back);
  EXPECT_FALSE(sequence.stages[10].runs_once);
  expect_proven(made.graph, sequence, std::array{made.c});
}

TEST(Loops, WithinALoopAreRefused) {
  Sampled made;
  const PassIndex outer = made.pass("outer");
  made.input(outer, "view", made.view);
  made.value(outer, "sample_view");
  made.input(outer, "c", made.c);
  const ResourceIndex sum = made.image(outer, "sum", HEDDLE_PORT_KEPT);
  made.cpu(outer, "move", {touch("view", HEDDLE_ACCESS_VALUE), touch("sample_view", HEDDLE_ACCESS_VALUE)});
  made.gpu(outer, "add", {touch("c", HEDDLE_ACCESS_SAMPLED), touch("sum", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
  made.part(outer, 0, HEDDLE_LOOP_BEFORE);
  made.part(outer, 1, HEDDLE_LOOP_AFTER);
  made.loop(outer, "view", "sample_view", "c");
  made.output(sum);
  EXPECT_EQ(message_of([&] { made.weave(); }),
            "synthetic.toml:7:1: error: pass 'outer' would repeat pass 'aa', which is a loop itself\n"
            "  expected: loops that stand apart from each other\n"
            "  help:     give one of them technique = \"none\", or bind inputs.c of 'outer' above 'aa'");
}

TEST(Loops, OverOnePassAreRefused) {
  Sampled made;
  const PassIndex other = made.pass("other");
  made.input(other, "view", made.view);
  made.value(other, "sample_view");
  made.input(other, "a", made.a);
  const ResourceIndex sum = made.image(other, "sum", HEDDLE_PORT_KEPT);
  made.cpu(other, "move", {touch("view", HEDDLE_ACCESS_VALUE), touch("sample_view", HEDDLE_ACCESS_VALUE)});
  made.gpu(other, "add", {touch("a", HEDDLE_ACCESS_SAMPLED), touch("sum", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
  made.part(other, 0, HEDDLE_LOOP_BEFORE);
  made.part(other, 1, HEDDLE_LOOP_AFTER);
  made.loop(other, "view", "sample_view", "a");
  prune(made.graph, std::array{made.c, sum}, {});
  EXPECT_EQ(message_of([&] {
              weave_loops(made.graph);
              order(made.graph);
            }),
            "synthetic.toml:7:1: error: passes 'aa' and 'other' would both repeat pass 'draw'\n"
            "  expected: a pass in the body of one loop\n"
            "  help:     give one of the two technique = \"none\", or each a 'draw' of its own");
}

TEST(Loops, RefuseToChangeInPlaceWhatIsMadeBefore) {
  Sampled made;
  const ResourceIndex painted = made.change(made.draw, "t", made.t);
  made.gpu(made.draw, "paint", {touch("t", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
  made.graph.passes[made.light].ports["t"] = painted;
  EXPECT_EQ(message_of([&] { made.weave(); }),
            "synthetic.toml:3:1: error: pass 'draw' changes 'draw.t', which is made before the loop, and the loop of "
            "pass 'aa' would do so in each iteration\n"
            "  expected: what an iteration changes is made in it\n"
            "  help:     put pass 'draw' behind 'aa', or give 'aa' technique = \"none\"");
}

TEST(Loops, RefuseStateThatAdvancesInPlace) {
  Sampled made;
  made.image(made.light, "state", HEDDLE_PORT_KEPT);
  made.gpu(made.light, "advance", {touch("state", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
  // Without a reader in the loop it would advance once a frame, behind it.
  made.gpu(made.light, "use", {touch("state", HEDDLE_ACCESS_SAMPLED), touch("b", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
  EXPECT_EQ(message_of([&] { made.weave(); }),
            "synthetic.toml:4:1: error: pass 'light' keeps its state in 'light.state' in place, and the loop of pass "
            "'aa' would do so in each iteration\n"
            "  expected: what lasts is read by @previous, which stands still in a loop\n"
            "  help:     put pass 'light' behind 'aa', or give 'aa' technique = \"none\"");
}

TEST(Loops, LetIterationsMakeAKeptListAnew) {
  for (const bool is_rewritten : {true, false}) {
    Sampled made;
    const ResourceIndex list = made.buffer(
        made.draw, "list", HEDDLE_PORT_LIST | HEDDLE_PORT_KEPT | (is_rewritten ? HEDDLE_PORT_REWRITTEN : 0U));
    made.gpu(made.draw, "find", {touch("list", HEDDLE_ACCESS_APPEND)});
    made.input(made.light, "list", list);
    made.gpu(made.light, "use",
             {touch("list", HEDDLE_ACCESS_STORAGE_READ), touch("b", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
    if (is_rewritten) {
      expect_proven(made.graph, made.weave(), std::array{made.c});
    } else {
      EXPECT_THAT(message_of([&] { made.weave(); }),
                  ::testing::HasSubstr("pass 'draw' keeps its state in 'draw.list' in place"));
    }
  }
}

TEST(Loops, NoteThatTheyRepeatNothing) {
  Sampled made;
  made.graph.passes[made.draw].ports.erase("view");
  const Order sequence = made.weave();
  EXPECT_THAT(made.graph.notes,
              ElementsAre("pass 'aa': repeats no pass: nothing that it gathers depends on 'camera.view'"));
  EXPECT_EQ(sequence.loops[0].end - sequence.loops[0].begin, 2U);  // its own two stages
  expect_proven(made.graph, sequence, std::array{made.c});
}

TEST(Loops, AreCoveredInGraphsMadeByChance) {
  constexpr std::array kReads{HEDDLE_ACCESS_SAMPLED, HEDDLE_ACCESS_STORAGE_READ, HEDDLE_ACCESS_TRANSFER_READ};
  constexpr std::array kWrites{HEDDLE_ACCESS_STORAGE_WRITE, HEDDLE_ACCESS_COLOR, HEDDLE_ACCESS_TRANSFER_WRITE};
  constexpr std::array kKinds{ShaderKind::kCompute, ShaderKind::kFullscreen, ShaderKind::kSurfaces};
  std::mt19937 random(11);
  std::size_t repeated = 0;
  std::size_t again = 0;
  for (int round = 0; round < 40; ++round) {
    SyntheticGraph made;
    const PassIndex camera = made.pass("camera");
    const ResourceIndex view = made.value(camera, "view");
    made.cpu(camera, "main", {touch("view", HEDDLE_ACCESS_VALUE)});
    std::vector<ResourceIndex> images;
    const auto add_pass = [&](int number, bool may_see) {
      const PassIndex p = made.pass("p" + std::to_string(number));
      std::vector<Access> accesses;
      for (std::size_t j = 0; j < images.size(); ++j) {
        if (random() % 3 != 0) continue;
        made.input(p, "in" + std::to_string(j), images[j]);
        accesses.push_back(touch("in" + std::to_string(j), kReads[random() % kReads.size()]));
      }
      if (may_see && random() % 3 == 0) {
        made.input(p, "view", view);
        accesses.push_back(touch("view", HEDDLE_ACCESS_VALUE));
      }
      images.push_back(made.image(p, "out", random() % 5 == 0 ? HEDDLE_PORT_KEPT : 0));
      accesses.push_back(touch("out", kWrites[random() % kWrites.size()], HEDDLE_LOAD_CLEAR));
      made.gpu(p, "main", accesses, kKinds[random() % kKinds.size()]);
    };
    for (int i = 0; i < 7; ++i) add_pass(i, true);
    const PassIndex aa = made.pass("aa");
    const ResourceIndex gathered = images.back();
    made.input(aa, "view", view);
    made.value(aa, "sample");
    const bool in_place = random() % 2 == 0;
    const ResourceIndex result = in_place ? made.change(aa, "b", gathered) : made.image(aa, "result");
    if (!in_place) made.input(aa, "b", gathered);
    made.image(aa, "sum", HEDDLE_PORT_KEPT);
    made.cpu(aa, "move", {touch("view", HEDDLE_ACCESS_VALUE), touch("sample", HEDDLE_ACCESS_VALUE)});
    made.gpu(aa, "add", {touch("b", kReads[random() % 2]), touch("sum", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
    made.gpu(aa, "resolve",
             {touch("sum", HEDDLE_ACCESS_SAMPLED),
              touch(in_place ? "b" : "result", HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_DONT_CARE)},
             ShaderKind::kFullscreen);
    made.part(aa, 0, HEDDLE_LOOP_BEFORE);
    made.part(aa, 1, HEDDLE_LOOP_AFTER);
    made.loop(aa, "view", "sample", "b");
    images.back() = result;
    for (int i = 7; i < 10; ++i) add_pass(i, false);
    made.output(images.back());
    const std::vector wanted{images.back(), result};
    if (std::ranges::any_of(made.graph.resources, [&](const Resource& r) { return r.previous_version == result; }))
      continue;
    prune(made.graph, wanted, {});
    weave_loops(made.graph);
    const Order sequence = order(made.graph);
    const PlannedLoops planned = expect_proven(made.graph, sequence, wanted);
    repeated += made.graph.loops[0].body.size();
    for (const auto& list : planned.plan.again) again += list.size();
    if (HasFailure()) FAIL() << "round " << round;
  }
  EXPECT_GT(repeated, 40U);  // the rounds were not empty
  EXPECT_GT(again, 100U);
}

}  // namespace
}  // namespace heddle::graph
