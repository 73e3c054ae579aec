// SPDX-License-Identifier: Apache-2.0
// Placement of transient memory: nothing that lives together overlaps, and chains really share.
#include <gmock/gmock.h>

#include <random>

#include "graph/synthetic_graph.hpp"

namespace heddle::graph {
namespace {

using test_support::SyntheticGraph;
using test_support::touch;

/// A chain of passes, each reading the one before: at any stage two images live.
struct Chain : SyntheticGraph {
  std::vector<ResourceIndex> images;
  explicit Chain(int length) {
    for (int i = 0; i < length; ++i) {
      const PassIndex p = pass("p" + std::to_string(i));
      std::vector<Access> accesses{touch("out", HEDDLE_ACCESS_STORAGE_WRITE)};
      if (i > 0) {
        input(p, "in", images.back());
        accesses.push_back(touch("in", HEDDLE_ACCESS_SAMPLED));
      }
      images.push_back(image(p, "out"));
      gpu(p, "main", accesses);
    }
  }
  [[nodiscard]] std::vector<MemoryNeed> needs(std::uint64_t size, std::uint64_t alignment = 64) const {
    return std::vector<MemoryNeed>(graph.resources.size(), MemoryNeed{size, alignment});
  }
};

TEST(Alias, SharesMemoryOfImagesThatNeverLiveTogether) {
  const Chain chain(6);
  const Placement placement = alias(chain.graph, order(chain.graph), chain.needs(1000), {});
  EXPECT_EQ(placement.unaliased_size, 6 * 1024U);
  EXPECT_EQ(placement.heap_size, 1024U + 1000U);
  EXPECT_NE(placement.offset[0], placement.offset[1]);
  EXPECT_EQ(placement.offset[0], placement.offset[2]);
}

TEST(Alias, NamesWhoseMemoryIsTakenOver) {
  const Chain chain(3);
  const Placement placement = alias(chain.graph, order(chain.graph), chain.needs(1000), {});
  ASSERT_EQ(placement.handovers.size(), 2U);
  EXPECT_EQ(placement.handovers[0].to, chain.images[0]);  // from the frame before
  EXPECT_EQ(placement.handovers[0].stage, 0U);
  EXPECT_THAT(placement.handovers[0].from, ::testing::ElementsAre(chain.images[2]));
  EXPECT_EQ(placement.handovers[1].to, chain.images[2]);
  EXPECT_EQ(placement.handovers[1].stage, 2U);
  EXPECT_THAT(placement.handovers[1].from, ::testing::ElementsAre(chain.images[0]));
}

TEST(Alias, LeavesPinnedAndKeptResourcesAlone) {
  Chain chain(4);
  chain.graph.resources[chain.images[1]].is_kept = true;
  const Placement placement = alias(chain.graph, order(chain.graph), chain.needs(1000), std::array{chain.images[3]});
  EXPECT_EQ(placement.offset[chain.images[1]], Placement::kOwnMemory);
  EXPECT_EQ(placement.offset[chain.images[3]], Placement::kOwnMemory);
  EXPECT_NE(placement.offset[chain.images[0]], Placement::kOwnMemory);
  EXPECT_EQ(placement.unaliased_size, 2048U);
}

TEST(Alias, LivesAsLongAsTheLastVersion) {
  SyntheticGraph made;
  const PassIndex first = made.pass("first"), other = made.pass("other"), changer = made.pass("changer"),
                  last = made.pass("last");
  const ResourceIndex a = made.image(first, "a");
  made.gpu(first, "main", {touch("a", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.input(other, "a", a);
  const ResourceIndex b = made.image(other, "b");
  made.gpu(other, "main", {touch("a", HEDDLE_ACCESS_SAMPLED), touch("b", HEDDLE_ACCESS_STORAGE_WRITE)});
  const ResourceIndex changed = made.change(changer, "a", a);
  made.input(changer, "b", b);
  made.gpu(changer, "main", {touch("b", HEDDLE_ACCESS_SAMPLED), touch("a", HEDDLE_ACCESS_STORAGE_READ_WRITE)});
  made.input(last, "a", changed);
  const ResourceIndex c = made.image(last, "c");
  made.gpu(last, "main", {touch("a", HEDDLE_ACCESS_SAMPLED), touch("c", HEDDLE_ACCESS_STORAGE_WRITE)});
  std::vector<MemoryNeed> needs(made.graph.resources.size(), MemoryNeed{512, 256});
  needs[changed] = {};
  const Placement placement = alias(made.graph, order(made.graph), needs, {});
  EXPECT_EQ(placement.offset[changed], placement.offset[a]);
  EXPECT_NE(placement.offset[c], placement.offset[a]);
  EXPECT_EQ(placement.offset[c], placement.offset[b]);
  EXPECT_EQ(placement.heap_size, 1024U);
}

TEST(Alias, HonoursAlignmentAndNeverOverlapsWhatLivesTogether) {
  std::mt19937 random(11);
  for (int round = 0; round < 60; ++round) {
    SyntheticGraph made;
    std::vector<ResourceIndex> images;
    for (int i = 0; i < 14; ++i) {
      const PassIndex p = made.pass("p" + std::to_string(i));
      std::vector<Access> accesses{touch("out", HEDDLE_ACCESS_STORAGE_WRITE)};
      for (std::size_t j = 0; j < images.size(); ++j) {
        if (random() % 4 != 0) continue;
        const std::string port = "in" + std::to_string(j);
        made.input(p, port, images[j]);
        accesses.push_back(touch(port, HEDDLE_ACCESS_SAMPLED));
      }
      images.push_back(made.image(p, "out"));
      made.gpu(p, "main", accesses);
    }
    std::vector<MemoryNeed> needs;
    for (std::size_t r = 0; r < made.graph.resources.size(); ++r)
      needs.push_back({1 + random() % 5000, std::uint64_t{1} << (random() % 12)});
    const Order sequence = order(made.graph);
    const Placement placement = alias(made.graph, sequence, needs, {});
    EXPECT_LE(placement.heap_size, placement.unaliased_size);
    // Lifetimes anew, from the uses alone.
    std::vector<std::pair<std::size_t, std::size_t>> lives(needs.size(), {sequence.stages.size(), 0});
    std::uint64_t busiest = 0;
    for (std::size_t s = 0; s < sequence.stages.size(); ++s)
      for (const auto& use : sequence.stages[s].uses)
        lives[use.resource] = {std::min(lives[use.resource].first, s), std::max(lives[use.resource].second, s)};
    for (std::size_t s = 0; s < sequence.stages.size(); ++s) {
      std::uint64_t alive = 0;
      for (std::size_t r = 0; r < needs.size(); ++r)
        if (lives[r].first <= s && s <= lives[r].second) alive += needs[r].size;
      busiest = std::max(busiest, alive);
    }
    EXPECT_GE(placement.heap_size, busiest);
    for (std::size_t a = 0; a < needs.size(); ++a) {
      ASSERT_NE(placement.offset[a], Placement::kOwnMemory);
      EXPECT_EQ(placement.offset[a] % std::max<std::uint64_t>(needs[a].alignment, 256), 0U);
      EXPECT_LE(placement.offset[a] + needs[a].size, placement.heap_size);
      for (std::size_t b = a + 1; b < needs.size(); ++b) {
        const bool live_together = lives[a].first <= lives[b].second && lives[b].first <= lives[a].second;
        const bool share = placement.offset[a] < placement.offset[b] + needs[b].size &&
                           placement.offset[b] < placement.offset[a] + needs[a].size;
        EXPECT_FALSE(live_together && share) << a << " and " << b;
      }
    }
  }
}

TEST(Alias, GivesNothingToValuesAndToWhatNoStageTouches) {
  SyntheticGraph made;
  const PassIndex p = made.pass("p");
  made.value(p, "v");
  made.image(p, "untouched");
  made.cpu(p, "main", {touch("v", HEDDLE_ACCESS_VALUE)});
  const std::vector<MemoryNeed> needs{{0, 1}, {4096, 256}};
  const Placement placement = alias(made.graph, order(made.graph), needs, {});
  EXPECT_THAT(placement.offset, ::testing::Each(Placement::kOwnMemory));
  EXPECT_EQ(placement.heap_size, 0U);
  EXPECT_EQ(placement.own_size, 4096U) << "its pass makes it all the same, beside the heap";
}

}  // namespace
}  // namespace heddle::graph
