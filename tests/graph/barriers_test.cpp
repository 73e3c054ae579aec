// SPDX-License-Identifier: Apache-2.0
// Barriers of a frame, proven by an independent checker over three frames, on graphs made by hand and by chance; and
// that the checker misses every barrier that is taken away.
#include <gmock/gmock.h>

#include <random>

#include "graph/hazard_checker.hpp"
#include "graph/synthetic_graph.hpp"

namespace heddle::graph {
namespace {

using test_support::find_hazards;
using test_support::find_needless_barriers;
using test_support::SyntheticGraph;
using test_support::touch;
using ::testing::IsEmpty;

struct Planned {
  Order sequence;
  std::vector<MemoryNeed> needs;
  Placement placement;
  BarrierPlan plan;
};

Planned plan_frame(const SyntheticGraph& made, std::vector<ResourceIndex> wanted, std::uint64_t size = 1000) {
  Planned planned;
  planned.sequence = order(made.graph);
  for (const Resource& resource : made.graph.resources) {
    const bool has_memory = resource.type != PortType::kValue && resource.previous_version == kNoIndex;
    planned.needs.push_back({has_memory ? size : 0, 64});
  }
  planned.placement = alias(made.graph, planned.sequence, planned.needs, wanted);
  planned.plan = plan_barriers(made.graph, planned.sequence, planned.placement, wanted);
  return planned;
}

std::size_t count(const BarrierPlan& plan) {
  std::size_t total = plan.at_end.size();
  for (const auto& list : plan.before) total += list.size();
  return total;
}

/// Every hazard is covered, and no barrier is there for nothing: the checker sees each one's absence.
Planned expect_proven(const SyntheticGraph& made, const std::vector<ResourceIndex>& wanted) {
  Planned planned = plan_frame(made, wanted);
  EXPECT_THAT(find_hazards(made.graph, planned.sequence, planned.needs, planned.placement, planned.plan, wanted),
              IsEmpty());
  EXPECT_THAT(
      find_needless_barriers(made.graph, planned.sequence, planned.needs, planned.placement, planned.plan, wanted),
      IsEmpty());
  return planned;
}

TEST(Barriers, CoverWriteThenRead) {
  SyntheticGraph made;
  const PassIndex w = made.pass("w"), r = made.pass("r");
  const ResourceIndex a = made.image(w, "a");
  made.gpu(w, "main", {touch("a", HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_CLEAR)}, ShaderKind::kFullscreen);
  made.input(r, "a", a);
  const ResourceIndex b = made.image(r, "b");
  made.gpu(r, "main", {touch("a", HEDDLE_ACCESS_SAMPLED), touch("b", HEDDLE_ACCESS_STORAGE_WRITE)});
  const Planned planned = expect_proven(made, {b});
  const auto& second = planned.plan.before[1];
  const auto barrier = std::ranges::find(second, a, &Barrier::resource);
  ASSERT_NE(barrier, second.end());
  EXPECT_EQ(barrier->source_stages, VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT);
  EXPECT_EQ(barrier->source_access, VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT);
  EXPECT_EQ(barrier->target_stages, VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT);
  EXPECT_EQ(barrier->target_access, VK_ACCESS_2_SHADER_SAMPLED_READ_BIT);
  EXPECT_EQ(barrier->old_layout, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL);
  EXPECT_EQ(barrier->new_layout, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL);
  ASSERT_EQ(planned.plan.at_end.size(), 1U);
  EXPECT_EQ(planned.plan.at_end[0].new_layout, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
}

TEST(Barriers, LetReadersShareOneAndMakeTheWriterWaitForAll) {
  SyntheticGraph made;
  const PassIndex w = made.pass("w"), fragment = made.pass("fragment"), compute = made.pass("compute"),
                  changer = made.pass("changer");
  const ResourceIndex a = made.image(w, "a");
  made.gpu(w, "main", {touch("a", HEDDLE_ACCESS_STORAGE_WRITE)});
  for (const auto& [pass, kind] :
       {std::pair(fragment, ShaderKind::kFullscreen), std::pair(compute, ShaderKind::kCompute)}) {
    made.input(pass, "a", a);
    made.gpu(pass, "main", {touch("a", HEDDLE_ACCESS_SAMPLED)}, kind);
  }
  const ResourceIndex changed = made.change(changer, "a", a);
  made.gpu(changer, "main", {touch("a", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
  const Planned planned = expect_proven(made, {changed});
  EXPECT_EQ(planned.plan.before[1].size(), 1U);
  EXPECT_EQ(planned.plan.before[1][0].target_stages,
            VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT | VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT);
  EXPECT_THAT(planned.plan.before[2], IsEmpty());
  ASSERT_EQ(planned.plan.before[3].size(), 1U);
  EXPECT_EQ(planned.plan.before[3][0].resource, a);  // the version with memory
  EXPECT_EQ(planned.plan.before[3][0].source_stages,
            VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT | VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT);
  EXPECT_EQ(planned.plan.before[3][0].source_access, 0U);
}

TEST(Barriers, ChangeTheLayoutBetweenReaders) {
  SyntheticGraph made;
  const PassIndex w = made.pass("w"), sampled = made.pass("sampled"), stored = made.pass("stored"),
                  again = made.pass("again");
  const ResourceIndex a = made.image(w, "a");
  made.gpu(w, "main", {touch("a", HEDDLE_ACCESS_STORAGE_WRITE)});
  for (const auto& [pass, access] :
       {std::pair(sampled, HEDDLE_ACCESS_SAMPLED), std::pair(stored, HEDDLE_ACCESS_STORAGE_READ),
        std::pair(again, HEDDLE_ACCESS_SAMPLED_LINEAR)}) {
    made.input(pass, "a", a);
    made.gpu(pass, "main", {touch("a", access)});
  }
  expect_proven(made, {});
  EXPECT_EQ(count(plan_frame(made, {}).plan), 4U);
}

TEST(Barriers, NeedNoneBetweenReadersOfABuffer) {
  SyntheticGraph made;
  const PassIndex w = made.pass("w"), one = made.pass("one"), two = made.pass("two");
  const ResourceIndex a = made.buffer(w, "a");
  made.gpu(w, "main", {touch("a", HEDDLE_ACCESS_STORAGE_WRITE)});
  for (const PassIndex pass : {one, two}) {
    made.input(pass, "a", a);
    made.gpu(pass, "main", {touch("a", HEDDLE_ACCESS_STORAGE_READ)});
  }
  const Planned planned = expect_proven(made, {});
  EXPECT_EQ(count(planned.plan), 2U);  // write after the last frame's reads, read after write
  EXPECT_EQ(planned.plan.before[1][0].old_layout, VK_IMAGE_LAYOUT_UNDEFINED);
}

TEST(Barriers, CoverDepthThatIsDrawnTestedAndSampled) {
  SyntheticGraph made;
  const PassIndex draw = made.pass("draw"), decal = made.pass("decal"), use = made.pass("use");
  const ResourceIndex depth = made.image(draw, "depth");
  made.graph.resources[depth].format = VK_FORMAT_D32_SFLOAT;
  made.gpu(draw, "main", {touch("depth", HEDDLE_ACCESS_DEPTH, HEDDLE_LOAD_CLEAR)}, ShaderKind::kSurfaces);
  made.input(decal, "depth", depth);
  const ResourceIndex color = made.image(decal, "color");
  made.gpu(decal, "main",
           {touch("color", HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_CLEAR), touch("depth", HEDDLE_ACCESS_DEPTH_READ)},
           ShaderKind::kSurfaces);
  made.input(use, "depth", depth);
  made.input(use, "color", color);
  made.gpu(use, "main", {touch("depth", HEDDLE_ACCESS_SAMPLED_COMPARE), touch("color", HEDDLE_ACCESS_SAMPLED)},
           ShaderKind::kFullscreen);
  const Planned planned = expect_proven(made, {});
  const Barrier& tested = *std::ranges::find(planned.plan.before[1], depth, &Barrier::resource);
  EXPECT_EQ(tested.source_stages,
            VK_PIPELINE_STAGE_2_EARLY_FRAGMENT_TESTS_BIT | VK_PIPELINE_STAGE_2_LATE_FRAGMENT_TESTS_BIT);
  EXPECT_EQ(tested.new_layout, VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL);
}

TEST(Barriers, CoverFunctionsThatOthersProvide) {
  SyntheticGraph made;
  const PassIndex depth = made.pass("depth"), contact = made.pass("contact"), light = made.pass("light");
  const ResourceIndex d = made.image(depth, "d");
  made.gpu(depth, "main", {touch("d", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.input(contact, "d", d);
  made.provide(contact, "shadow", {touch("d", HEDDLE_ACCESS_SAMPLED)});
  const ResourceIndex out = made.image(light, "out");
  made.gpu(light, "main", {touch("out", HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_CLEAR)}, ShaderKind::kFullscreen, {"shadow"});
  made.bind(light, "shadow", {contact});
  const Planned planned = expect_proven(made, {out});
  const auto barrier = std::ranges::find(planned.plan.before[1], d, &Barrier::resource);
  ASSERT_NE(barrier, planned.plan.before[1].end());
  EXPECT_EQ(barrier->target_stages, VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT);
}

TEST(Barriers, CoverCpuStagesByTransfers) {
  SyntheticGraph made;
  const PassIndex draw = made.pass("draw"), trace = made.pass("trace"), use = made.pass("use");
  const ResourceIndex depth = made.image(draw, "depth");
  made.gpu(draw, "main", {touch("depth", HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_CLEAR)}, ShaderKind::kFullscreen);
  made.input(trace, "depth", depth);
  const ResourceIndex visibility = made.image(trace, "visibility");
  made.cpu(trace, "main", {touch("depth", HEDDLE_ACCESS_HOST_READ), touch("visibility", HEDDLE_ACCESS_HOST_WRITE)});
  made.input(use, "visibility", visibility);
  made.gpu(use, "main", {touch("visibility", HEDDLE_ACCESS_SAMPLED)});
  const Planned planned = expect_proven(made, {});
  const auto& before = planned.plan.before[1];
  EXPECT_EQ(std::ranges::find(before, depth, &Barrier::resource)->new_layout, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
  EXPECT_EQ(std::ranges::find(before, visibility, &Barrier::resource)->new_layout,
            VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
}

TEST(Barriers, KeepTheLayoutOfKeptImagesFromFrameToFrame) {
  SyntheticGraph made;
  const PassIndex history = made.pass("history"), use = made.pass("use");
  const ResourceIndex a = made.image(history, "a", HEDDLE_PORT_KEPT);
  made.gpu(history, "read", {touch("a", HEDDLE_ACCESS_SAMPLED)});  // last frame's
  made.gpu(history, "write", {touch("a", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.input(use, "a", a);
  made.gpu(use, "main", {touch("a", HEDDLE_ACCESS_SAMPLED)}, ShaderKind::kFullscreen);
  const Planned planned = expect_proven(made, {});
  EXPECT_EQ(planned.plan.first_layout[a], VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL);
  // The readers at the end of a frame and at the start of the next are one group: one barrier serves both.
  EXPECT_THAT(planned.plan.before[0], IsEmpty());
  EXPECT_EQ(planned.plan.before[1][0].source_stages,
            VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT);
}

TEST(Barriers, LetTwoMemoriesTakeTurnsForAHistory) {
  SyntheticGraph made;
  const PassIndex average = made.pass("average"), use = made.pass("use");
  const ResourceIndex a = made.image(average, "a", HEDDLE_PORT_KEPT);
  const ResourceIndex past = made.history(a);
  made.input(average, "past", past);
  made.gpu(average, "main", {touch("past", HEDDLE_ACCESS_SAMPLED), touch("a", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.input(use, "a", a);
  made.gpu(use, "main", {touch("a", HEDDLE_ACCESS_SAMPLED)}, ShaderKind::kFullscreen);
  const Planned planned = expect_proven(made, {});
  // What is written now was read last frame; what is read now was read at the last frame's end, in the same layout.
  EXPECT_EQ(planned.plan.first_layout[a], VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL);
  EXPECT_EQ(planned.plan.first_layout[past], VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL);
  ASSERT_EQ(planned.plan.before[0].size(), 1U);
  EXPECT_EQ(planned.plan.before[0][0].resource, a);
  EXPECT_EQ(planned.plan.before[0][0].source_stages,
            VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT);
  EXPECT_EQ(planned.placement.offset[past], Placement::kOwnMemory);
}

TEST(Barriers, CoverHistoriesOfAttachmentsAndBuffersAcrossFrames) {
  for (const bool reads_first : {true, false}) {
    SyntheticGraph made;
    const PassIndex early = reads_first ? made.pass("early") : kNoIndex;
    const PassIndex draw = made.pass("draw"), counter = made.pass("counter");
    const PassIndex late = reads_first ? early : made.pass("late");
    const ResourceIndex color = made.image(draw, "color", HEDDLE_PORT_KEPT);
    made.gpu(draw, "main", {touch("color", HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_CLEAR)}, ShaderKind::kSurfaces);
    const ResourceIndex counts = made.buffer(counter, "counts", HEDDLE_PORT_KEPT);
    made.gpu(counter, "main", {touch("counts", HEDDLE_ACCESS_STORAGE_WRITE)});
    made.input(late, "color", made.history(color));
    made.input(late, "counts", made.history(counts));
    made.gpu(late, "main", {touch("color", HEDDLE_ACCESS_SAMPLED_LINEAR), touch("counts", HEDDLE_ACCESS_STORAGE_READ)},
             ShaderKind::kFullscreen);
    const Planned planned = expect_proven(made, {color});
    EXPECT_GE(count(planned.plan), 5U);
  }
}

TEST(Barriers, NeverDiscardKeptContents) {
  SyntheticGraph made;
  const PassIndex table = made.pass("table"), use = made.pass("use");
  const ResourceIndex a = made.image(table, "a", HEDDLE_PORT_KEPT);
  made.gpu(table, "main", {touch("a", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.input(use, "a", a);
  made.gpu(use, "main", {touch("a", HEDDLE_ACCESS_SAMPLED)});
  const Planned planned = expect_proven(made, {a});
  for (const auto& list : planned.plan.before)
    for (const Barrier& barrier : list) EXPECT_NE(barrier.old_layout, VK_IMAGE_LAYOUT_UNDEFINED);
  EXPECT_EQ(planned.plan.first_layout[a], VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
}

TEST(Barriers, WaitForWhoHadTheMemoryBefore) {
  SyntheticGraph made;
  ResourceIndex previous = kNoIndex;
  std::vector<ResourceIndex> images;
  for (int i = 0; i < 5; ++i) {
    const PassIndex p = made.pass("p" + std::to_string(i));
    const bool draws = i % 2 == 0;
    std::vector<Access> accesses{
        touch("out", draws ? HEDDLE_ACCESS_COLOR : HEDDLE_ACCESS_STORAGE_WRITE, HEDDLE_LOAD_CLEAR)};
    if (previous != kNoIndex) {
      made.input(p, "in", previous);
      accesses.push_back(touch("in", HEDDLE_ACCESS_SAMPLED));
    }
    previous = made.image(p, "out");
    images.push_back(previous);
    made.gpu(p, "main", accesses, draws ? ShaderKind::kFullscreen : ShaderKind::kCompute);
  }
  const Planned planned = expect_proven(made, {});
  EXPECT_EQ(planned.placement.offset[images[0]], planned.placement.offset[images[2]]);
  const Barrier& barrier = *std::ranges::find(planned.plan.before[2], images[2], &Barrier::resource);
  EXPECT_EQ(barrier.old_layout, VK_IMAGE_LAYOUT_UNDEFINED);
  EXPECT_NE(barrier.source_stages & VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT, 0U);  // who read images[0] last
}

TEST(Barriers, LetOneStageTouchTwoVersions) {
  SyntheticGraph made;
  const PassIndex w = made.pass("w"), changer = made.pass("changer"), reader = made.pass("reader");
  const ResourceIndex a = made.image(w, "a");
  made.gpu(w, "main", {touch("a", HEDDLE_ACCESS_STORAGE_WRITE)});
  const ResourceIndex changed = made.change(changer, "a", a);
  made.gpu(changer, "look", {touch("a", HEDDLE_ACCESS_SAMPLED)});
  made.gpu(changer, "paint", {touch("a", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
  made.input(reader, "a", changed);
  made.gpu(reader, "main", {touch("a", HEDDLE_ACCESS_SAMPLED)}, ShaderKind::kFullscreen);
  expect_proven(made, {});
}

TEST(Barriers, RefuseToShareWhatIsReadAfterTheFrame) {
  SyntheticGraph made;
  const PassIndex w = made.pass("w");
  const ResourceIndex a = made.image(w, "a");
  made.gpu(w, "main", {touch("a", HEDDLE_ACCESS_STORAGE_WRITE)});
  const Order sequence = order(made.graph);
  const Placement placement = alias(made.graph, sequence, std::array{MemoryNeed{256, 256}}, {});
  EXPECT_THROW(plan_barriers(made.graph, sequence, placement, std::array{a}), Error);
}

TEST(Barriers, CoverHowTheHostEmptiesAndCountsLists) {
  for (const std::uint32_t flags : {0U, HEDDLE_PORT_KEPT, HEDDLE_PORT_KEPT | HEDDLE_PORT_REWRITTEN}) {
    for (const bool has_readers : {true, false}) {
      SyntheticGraph made;
      const PassIndex find = made.pass("find"), more = made.pass("more"), shade = made.pass("shade");
      const PassIndex blur = made.pass("blur");
      const ResourceIndex list = made.buffer(find, "list", HEDDLE_PORT_LIST | flags);
      made.gpu(find, "main", {touch("list", HEDDLE_ACCESS_APPEND)});
      const ResourceIndex longer = made.change(more, "list", list);
      made.gpu(more, "main", {touch("list", HEDDLE_ACCESS_APPEND)}, ShaderKind::kFullscreen);
      const ResourceIndex color = made.image(shade, "color");
      std::vector<Access> shading{touch("color", HEDDLE_ACCESS_STORAGE_WRITE)};
      if (has_readers) {
        made.input(shade, "list", longer);
        shading.push_back(touch("list", HEDDLE_ACCESS_STORAGE_READ));
      }
      if (flags == (HEDDLE_PORT_KEPT | HEDDLE_PORT_REWRITTEN)) {
        made.input(shade, "last", made.history(list));
        shading.push_back(touch("last", HEDDLE_ACCESS_STORAGE_READ));
      }
      made.gpu(shade, "main", shading);
      made.input(blur, "color", color);
      made.image(blur, "blurred");  // may take the list's place
      made.gpu(blur, "main", {touch("color", HEDDLE_ACCESS_SAMPLED), touch("blurred", HEDDLE_ACCESS_STORAGE_WRITE)});
      const Planned planned = expect_proven(made, {color});
      const ListPlan lists = plan_lists(made.graph, planned.sequence);
      using List = std::vector<ResourceIndex>;
      const auto stage_of = [&](PassIndex pass) {
        return static_cast<std::size_t>(std::ranges::find(planned.sequence.stages, pass, &ScheduledStage::pass) -
                                        planned.sequence.stages.begin());
      };
      EXPECT_EQ(lists.emptied[stage_of(find)], List{list});
      EXPECT_EQ(lists.goes_on[list], flags == HEDDLE_PORT_KEPT);
      EXPECT_EQ(lists.counted[stage_of(more)], List{list});
      EXPECT_EQ(lists.counted[stage_of(find)], List{});
    }
  }
}

TEST(Barriers, CoverGraphsMadeByChance) {
  constexpr std::array kReads{HEDDLE_ACCESS_SAMPLED, HEDDLE_ACCESS_SAMPLED_LINEAR, HEDDLE_ACCESS_STORAGE_READ,
                              HEDDLE_ACCESS_TRANSFER_READ};
  constexpr std::array kWrites{HEDDLE_ACCESS_STORAGE_WRITE, HEDDLE_ACCESS_COLOR, HEDDLE_ACCESS_TRANSFER_WRITE};
  constexpr std::array kKinds{ShaderKind::kCompute, ShaderKind::kFullscreen, ShaderKind::kSurfaces};
  std::mt19937 random(3);
  std::size_t barriers = 0;
  for (int round = 0; round < 40; ++round) {
    SyntheticGraph made;
    std::vector<ResourceIndex> newest;  // latest versions
    for (int i = 0; i < 9; ++i) {
      const PassIndex p = made.pass("p" + std::to_string(i));
      const bool is_cpu = random() % 6 == 0;
      std::vector<Access> accesses;
      std::vector<ResourceIndex> made_here;
      for (std::size_t j = 0; j < newest.size(); ++j) {
        const std::string port = "in" + std::to_string(j);
        const std::uint32_t dice = random() % 8;
        if (dice < 2) {
          made.input(p, port, newest[j]);
          const bool is_buffer = made.graph.resources[newest[j]].type == PortType::kBuffer;
          accesses.push_back(touch(port, is_cpu      ? HEDDLE_ACCESS_HOST_READ
                                         : is_buffer ? HEDDLE_ACCESS_STORAGE_READ
                                                     : kReads[random() % kReads.size()]));
        } else if (dice == 2 && !is_cpu) {
          newest[j] = made.change(p, port, newest[j]);
          accesses.push_back(touch(port, HEDDLE_ACCESS_STORAGE_READ_WRITE));
        }
      }
      const std::uint32_t flags = random() % 3 == 0 ? HEDDLE_PORT_KEPT : 0;
      const bool is_buffer = random() % 4 == 0;
      made_here.push_back(is_buffer ? made.buffer(p, "out", flags) : made.image(p, "out", flags));
      // Histories of the own output, and of an older kept one.
      for (const ResourceIndex kept : {made_here.back(), newest.empty() ? made_here.back() : newest.front()}) {
        const std::string port = "past" + std::to_string(kept);
        const bool has_history =
            std::ranges::any_of(made.graph.resources, [&](const Resource& r) { return r.history_of == kept; });
        if (!made.graph.resources[kept].is_kept || has_history || random() % 2 == 0) continue;
        made.input(p, port, made.history(kept));
        accesses.push_back(touch(port, is_cpu ? HEDDLE_ACCESS_HOST_READ
                                       : made.graph.resources[kept].type == PortType::kBuffer
                                           ? HEDDLE_ACCESS_STORAGE_READ
                                           : kReads[random() % kReads.size()]));
      }
      accesses.push_back(touch("out",
                               is_cpu      ? HEDDLE_ACCESS_HOST_WRITE
                               : is_buffer ? HEDDLE_ACCESS_STORAGE_WRITE
                                           : kWrites[random() % kWrites.size()],
                               HEDDLE_LOAD_CLEAR));
      if (is_cpu) {
        made.cpu(p, "main", accesses, random() % 2);
      } else {
        made.gpu(p, "main", accesses, kKinds[random() % kKinds.size()]);
      }
      newest.insert(newest.end(), made_here.begin(), made_here.end());
    }
    const std::vector<ResourceIndex> wanted{newest.back(), newest[random() % newest.size()]};
    const Planned planned = expect_proven(made, wanted);
    barriers += count(planned.plan);
    if (HasFailure()) FAIL() << "round " << round;
  }
  EXPECT_GT(barriers, 400U);  // the rounds were not empty
}

}  // namespace
}  // namespace heddle::graph
