// SPDX-License-Identifier: Apache-2.0
// Lifetimes over the order of stages + memory needs -> offsets in one heap, so that no two resources that live at the
// same time share a byte; and who takes over whose bytes.
#include <algorithm>
#include <numeric>

#include "graph/stages.hpp"
#include "graph/uses.hpp"

namespace heddle::graph {
namespace {

// Image rows and bufferImageGranularity are finer than this on every driver that was measured.
constexpr std::uint64_t kSmallestAlignment = 256;

struct Block {
  ResourceIndex resource = kNoIndex;
  std::uint32_t first = kNoIndex, last = 0;  // stages, inclusive
  std::uint64_t size = 0, alignment = 1;
  std::uint64_t offset = 0;
  [[nodiscard]] bool lives_with(const Block& other) const { return first <= other.last && other.first <= last; }
  [[nodiscard]] bool shares_bytes_with(const Block& other) const {
    return offset < other.offset + other.size && other.offset < offset + size;
  }
};

std::uint64_t round_up(std::uint64_t value, std::uint64_t multiple) {
  return (value + multiple - 1) / multiple * multiple;
}

/// Places blocks in the given order, each into the tightest hole among those that live with it. Returns the heap's
/// size.
std::uint64_t place(std::vector<Block>& blocks, std::span<const std::size_t> sequence) {
  std::uint64_t heap = 0;
  std::vector<const Block*> placed;  // sorted by offset
  for (const std::size_t index : sequence) {
    Block& block = blocks[index];
    std::uint64_t best = ~0ULL;
    std::uint64_t best_hole = ~0ULL;
    std::uint64_t end = 0;  // of what lives with the block, so far
    for (const Block* other : placed) {
      if (!block.lives_with(*other)) continue;
      const std::uint64_t start = round_up(end, block.alignment);
      if (other->offset >= start + block.size && other->offset - end < best_hole) {
        best = start;
        best_hole = other->offset - end;
      }
      end = std::max(end, other->offset + other->size);
    }
    block.offset = best != ~0ULL ? best : round_up(end, block.alignment);
    heap = std::max(heap, block.offset + block.size);
    placed.insert(std::ranges::upper_bound(placed, block.offset, {}, [](const Block* b) { return b->offset; }), &block);
  }
  return heap;
}

}  // namespace

Placement alias(const ResolvedGraph& graph, const Order& order, std::span<const MemoryNeed> needs,
                std::span<const ResourceIndex> pinned) {
  const std::size_t count = graph.resources.size();
  if (needs.size() != count) throw Error(HEDDLE_BUG, "memory needs and resources differ in number");
  Placement placement;
  placement.offset.assign(count, Placement::kOwnMemory);

  std::vector<bool> is_own(count, false);
  for (ResourceIndex r = 0; r < count; ++r)
    if (graph.resources[r].is_kept) is_own[first_version(graph, r)] = true;
  for (const ResourceIndex r : pinned) is_own[first_version(graph, r)] = true;

  std::vector<Block> lifetimes(count);
  for (std::uint32_t s = 0; s < order.stages.size(); ++s) {
    for (const ScheduledStage::Use& use : order.stages[s].uses) {
      Block& block = lifetimes[first_version(graph, use.resource)];
      block.first = std::min(block.first, s);
      block.last = std::max(block.last, s);
    }
  }

  // A pass of a job may do all of its stages again, for the next slice: what one of them has used lives as long.
  for (std::uint32_t s = 0; graph.is_job && s < order.stages.size(); ++s)
    for (std::uint32_t later = s + 1; later < order.stages.size(); ++later)
      if (order.stages[later].pass == order.stages[s].pass)
        for (const ScheduledStage::Use& use : order.stages[s].uses) {
          Block& block = lifetimes[first_version(graph, use.resource)];
          block.last = std::max(block.last, later);
        }

  // What the iterations of a loop find again lives through all of it: what is made before, and what is made only once.
  for (const ScheduledLoop& loop : order.loops) {
    for (std::uint32_t s = loop.begin; s < loop.end; ++s) {
      for (const ScheduledStage::Use& use : order.stages[s].uses) {
        Block& block = lifetimes[first_version(graph, use.resource)];
        const bool is_made_once = order.stages[s].runs_once && use.writes;
        if (is_made_once) block.first = std::min(block.first, loop.begin);
        if (is_made_once || block.first < loop.begin) block.last = std::max(block.last, loop.end - 1);
      }
    }
  }

  std::vector<Block> blocks;
  for (ResourceIndex r = 0; r < count; ++r) {
    Block block = lifetimes[r];
    const bool is_apart = is_own[r] || block.first == kNoIndex;  // nobody uses it: its pass makes it all the same
    if (is_apart && has_memory(graph.resources[r].type)) placement.own_size += needs[r].size;
    if (is_own[r] || needs[r].size == 0 || block.first == kNoIndex || !has_memory(graph.resources[r].type)) continue;
    block.resource = r;
    block.size = needs[r].size;
    // lcm, not max: an alignment need not be a power of two here.
    block.alignment = std::lcm(std::max<std::uint64_t>(needs[r].alignment, 1), kSmallestAlignment);
    placement.unaliased_size += round_up(block.size, block.alignment);
    blocks.push_back(block);
  }

  // Greedy packing depends on the sequence; the better of two is taken: large blocks first, and blocks as they come.
  std::vector<std::size_t> by_size(blocks.size());
  std::iota(by_size.begin(), by_size.end(), std::size_t{0});
  std::vector<std::size_t> by_time = by_size;
  std::ranges::stable_sort(by_size, std::ranges::greater{}, [&](std::size_t i) { return blocks[i].size; });
  std::ranges::stable_sort(by_time, {}, [&](std::size_t i) { return blocks[i].first; });
  std::vector<Block> other = blocks;
  const std::uint64_t size_by_size = place(blocks, by_size);
  const std::uint64_t size_by_time = place(other, by_time);
  if (size_by_time < size_by_size) blocks = std::move(other);
  placement.heap_size = std::min(size_by_size, size_by_time);

  // The proof, for every pair: whoever lives together shares no byte.
  for (std::size_t i = 0; i < blocks.size(); ++i)
    for (std::size_t j = i + 1; j < blocks.size(); ++j)
      if (blocks[i].lives_with(blocks[j]) && blocks[i].shares_bytes_with(blocks[j]))
        throw Error(HEDDLE_BUG, "'" + graph.resources[blocks[i].resource].name + "' and '" +
                                    graph.resources[blocks[j].resource].name + "' live at one time in the same memory");

  for (const Block& block : blocks) placement.offset[block.resource] = block.offset;
  for (ResourceIndex r = 0; r < count; ++r)  // later versions are found where the first is
    placement.offset[r] = placement.offset[first_version(graph, r)];

  for (const Block& block : blocks) {
    Placement::Handover handover{block.first, block.resource, {}};
    // First those of this frame, then those whose last use is in the frame before.
    for (const bool earlier : {true, false})
      for (const Block& from : blocks)
        if (from.resource != block.resource && block.shares_bytes_with(from) && (from.last < block.first) == earlier)
          handover.from.push_back(from.resource);
    if (!handover.from.empty()) placement.handovers.push_back(std::move(handover));
  }
  std::ranges::stable_sort(placement.handovers, {}, &Placement::Handover::stage);
  return placement;
}

}  // namespace heddle::graph
