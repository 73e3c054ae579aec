// SPDX-License-Identifier: Apache-2.0
// Executor::check: the same frames in other orders and over other memory must give the same bytes. What differs depends
// on something that no declared access tells the graph of.

#include "graph/execute_state.hpp"
#include "vulkan/hazard_recorder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

namespace heddle::graph {

namespace {

// All ones is a NaN in every float format but 1 in unorm; the other is 1e30, -13904 and 10824 as halves, and neither 0
// nor 1 as unorm. One alone would hide where its value happens to be right.
constexpr std::array<std::uint32_t, 2> kPoisons{0xFFFFFFFFU, 0x7149F2CAU};

/// Everything that was recorded is done before everything that follows.
void barrier_between_all(const heddle_vulkan& vk, VkCommandBuffer commands) {
  VkMemoryBarrier2 memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2};
  memory.srcStageMask = memory.dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
  memory.srcAccessMask = memory.dstAccessMask = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
  VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
  dependency.memoryBarrierCount = 1;
  dependency.pMemoryBarriers = &memory;
  vk.CmdPipelineBarrier2(commands, &dependency);
}

/// An image or a part of it, as it was after a frame.
struct Picture {
  ResourceIndex resource = kNoIndex;
  PassIndex pass = kNoIndex;
  std::uint32_t layer = 0, mip = 0, width = 1;
  std::vector<std::byte> bytes;
};

struct Frame {
  std::map<std::string, Lasting, std::less<>> lasting;  // of a job
  std::vector<Picture> kept;                            // what the graph was asked for
  std::vector<Picture> scanned;                         // every output, right after its pass; in the order of that run
  bool has_overflowed = false;  // a list had no room: which elements it holds is a matter of chance
};

std::vector<Frame> run_frames(Executor& executor, Executor::State& state, const scene::Scene& scene,
                              const FrameOptions& options, std::uint32_t frames) {
  std::vector<Frame> result;
  for (std::uint32_t f = 0; f < frames; ++f) {
    // Nothing changes: loops go on, or are complete, in each second frame, and begin anew in the others.
    FrameOptions frame_options = options;
    frame_options.anew = options.anew || f % 2 == 0;
    // Of a frame that nobody compares nothing is left.
    frame_options.cut = options.cut || (f > 0 && result.back().has_overflowed);
    if (state.original.is_job)
      (void)executor.run_job(scene, options);
    else
      executor.render(scene, frame_options);
    Frame& frame = result.emplace_back();
    if (state.original.is_job) frame.lasting = executor.job_result().parts;
    frame.has_overflowed =
        std::ranges::any_of(state.stats.lists, [](const ListStats& list) { return list.overflow > 0; });
    for (const Executor::State::Scan& scan : state.scans)
      frame.scanned.push_back({scan.resource,
                               scan.pass,
                               scan.layer,
                               scan.mip,
                               scan.width,
                               {scan.texels.data(), scan.texels.data() + scan.texels.size()}});
    for (const ResourceIndex wanted : state.wanted) {
      const ResourceState& kept = state.resources[state.resources[wanted].root];
      if (!kept.image) continue;
      for (std::uint32_t layer = 0; layer < kept.image.shape().layers; ++layer)
        for (std::uint32_t mip = 0; mip < kept.image.shape().mips; ++mip)
          frame.kept.push_back({wanted, state.graph.resources[wanted].producer, layer, mip,
                                std::max(kept.image.shape().width >> mip, 1U),
                                state.device->read_back(kept.image, layer, mip, kept.layout)});
    }
  }
  return result;
}

const Picture* find_same(const std::vector<Picture>& pictures, const Picture& wanted) {
  const auto found = std::find_if(pictures.begin(), pictures.end(), [&](const Picture& picture) {
    return picture.resource == wanted.resource && picture.layer == wanted.layer && picture.mip == wanted.mip;
  });
  return found == pictures.end() ? nullptr : &*found;
}

/// Of all waves of a job: they have no stages in common.
OrderSet all_orders(const std::vector<OrderSet>& waves) {
  OrderSet all;
  for (const OrderSet& wave : waves) {
    if (wave.orders.size() > all.orders.size()) all.orders = wave.orders;
    all.unordered_pairs += wave.unordered_pairs;
    all.seen_both_ways += wave.seen_both_ways;
  }
  return all;
}

std::string why_different(std::size_t order, std::optional<std::uint32_t> poison, bool is_of_lists) {
  return is_of_lists  ? "depends on the order of a list's elements, which have none"
         : order != 0 ? "depends on the order of stages that nothing puts in order"
         : poison     ? fmt::format("depends on memory that nobody wrote, filled with 0x{:08X}", *poison)
                      : "differs between two runs of the same frames, the second without culling";
}

/// The first artifact or report that differs, or nothing.
const Lasting* find_other(const Frame& expected, const Frame& found, std::string& name) {
  for (const auto& [key, lasting] : expected.lasting) {
    const auto other = found.lasting.find(key);
    if (other != found.lasting.end() && *other->second.bytes == *lasting.bytes) continue;
    name = key;
    return &lasting;
  }
  return nullptr;
}

std::string order_text(const ResolvedGraph& graph, const Order& order) {
  std::string text;
  for (const ScheduledStage& stage : order.stages) {
    const Pass& pass = graph.passes[stage.pass];
    text += fmt::format("{}{}.{}", text.empty() ? "" : ", ", pass.name, pass.entry.technique->stages[stage.stage].name);
  }
  return text;
}

}  // namespace

void Executor::State::place_poison(ResourceIndex resource, std::uint64_t bytes) {
  ResourceState& state = resources[resource];
  const bool is_own = placement.offset[resource] == Placement::kOwnMemory;
  state.poison = device->place_buffer(bytes, VK_BUFFER_USAGE_TRANSFER_DST_BIT, is_own ? state.own_heap : heap,
                                      is_own ? 0 : placement.offset[resource]);
}

/// As before the first frame.
void Executor::State::forget_frames() {
  stats.frame = 0;
  frame_index = 0;
  previous_camera.reset();
  inputs.clear();
  sorted_counts.clear();
  overflowing.clear();
}

void Executor::State::poison_around(std::uint32_t stage, bool is_before) {
  if (!variant.poison) return;
  const vulkan::hazard::Recorder::Pause pause(device->recorder());
  const auto uses = [&](const ScheduledStage& scheduled, ResourceIndex resource) {
    return std::any_of(scheduled.uses.begin(), scheduled.uses.end(),
                       [&](const auto& use) { return resources[use.resource].root == resource; });
  };
  // What all iterations of the stage's loop find again: made before it, or only in the first of them.
  const auto lasts = [&](ResourceIndex resource) {
    const auto loop = std::ranges::find_if(
        order.loops, [&](const ScheduledLoop& one) { return stage >= one.begin && stage < one.end; });
    if (loop == order.loops.end()) return false;
    for (std::uint32_t s = 0; s < loop->end; ++s)
      if ((s < loop->begin || order.stages[s].runs_once) && uses(order.stages[s], resource)) return true;
    return false;
  };
  // A pass of a job may do its stages again: what they have used ends with the last of them.
  const auto is_of_pass = [&](const ScheduledStage& other) { return other.pass == order.stages[stage].pass; };
  const bool ends_together = graph.is_job && !is_before;
  if (ends_together && std::any_of(order.stages.begin() + stage + 1, order.stages.end(), is_of_pass)) return;
  const heddle_vulkan& vk = device->table();
  for (ResourceIndex i = 0; i < resources.size(); ++i) {
    const bool is_used = ends_together ? std::any_of(order.stages.begin(), order.stages.end(),
                                                     [&](const auto& one) { return is_of_pass(one) && uses(one, i); })
                                       : uses(order.stages[stage], i);
    if (!resources[i].poison || !is_used) continue;
    const auto begin = order.stages.begin() + (is_before ? 0 : stage + 1);
    const auto end = is_before ? order.stages.begin() + stage : order.stages.end();
    const bool is_used_there =
        std::any_of(begin, end, [&](const ScheduledStage& scheduled) { return uses(scheduled, i); });
    const bool is_read_later = !is_before && std::any_of(wanted.begin(), wanted.end(),
                                                         [&](ResourceIndex w) { return resources[w].root == i; });
    if (is_used_there || is_read_later) continue;
    if (lasts(i) && !(is_before ? is_first_iteration : is_last_iteration)) continue;
    barrier_between_all(vk, commands);
    vk.CmdFillBuffer(commands, resources[i].poison.handle(), 0, VK_WHOLE_SIZE, *variant.poison);
    barrier_between_all(vk, commands);
  }
}

CheckReport Executor::check(const scene::Scene& scene, const FrameOptions& options, std::uint32_t frames) {
  State& s = *state_;
  using ListOrder = State::ListOrder;
  const auto run = [&](std::size_t order, std::optional<std::uint32_t> poison, bool culls = true,
                       ListOrder list_order = ListOrder::kAscending) {
    s.unplan();
    s.variant = {order, poison, culls, list_order};
    s.forget_frames();
    return run_frames(*this, s, scene, options, frames);
  };
  struct Restore {
    State& state;
    ~Restore() {
      state.unplan();
      state.variant = {};
      state.forget_frames();
    }
  } restore{s};

  if (s.original.is_job) frames = 1;  // it has no past
  s.open_device();
  // Only here bytes of an image are where the memory is that a buffer over it fills.
  const bool can_poison = s.device->info().is_lavapipe;
  // What the others are compared with starts from zeros where it can: left to what the memory happens to hold, two runs
  // of one graph would be told apart by chance.
  const auto zeros = can_poison ? std::optional<std::uint32_t>(0) : std::nullopt;
  s.wave_orders.clear();
  const std::vector<Frame> expected = run(0, zeros);
  const OrderSet orders = s.original.is_job ? all_orders(s.wave_orders) : find_orders(s.graph, State::kMostOrders);
  CheckReport report;
  report.frames = frames;
  report.runs = 1;
  report.orders = orders.orders.size();
  report.unordered_pairs = orders.unordered_pairs;
  report.seen_both_ways = orders.seen_both_ways;
  if (s.original.is_job)
    report.compared = s.job_wants();
  else
    for (const ResourceIndex wanted : s.wanted) report.compared.push_back(s.graph.resources[wanted].name);
  if (can_poison) report.poisons.assign(kPoisons.begin(), kPoisons.end());

  for (const auto& counted : s.lists.counted)
    for (const ResourceIndex list : counted) report.lists.push_back(s.graph.resources[list].name);
  for (const Frame& frame : expected) report.overflowed += frame.has_overflowed ? 1 : 0;
  if (report.overflowed == frames) {
    Diagnostic diagnostic;
    diagnostic.where.file = s.graph.file;
    diagnostic.message = fmt::format("in each of {} frames a list had no room: nothing could be compared", frames);
    for (const ListStats& list : s.stats.lists)
      if (list.overflow > 0)
        diagnostic.found += fmt::format("{}'{}' with room for {} elements, {} more were left out",
                                        diagnostic.found.empty() ? "" : "; ", list.name, list.capacity, list.overflow);
    diagnostic.help = "which elements are left out is a matter of chance; check more frames, if the lists grow";
    throw Error(HEDDLE_BAD_INPUT, std::move(diagnostic));
  }

  const auto compare = [&](const std::vector<Frame>& found, std::size_t order, std::optional<std::uint32_t> poison,
                           bool is_of_lists = false) {
    ++report.runs;
    for (std::uint32_t f = 0; f < frames; ++f) {
      if (expected[f].has_overflowed || found[f].has_overflowed) continue;
      std::string name;
      if (const Lasting* lasting = find_other(expected[f], found[f], name); lasting != nullptr) {
        Diagnostic diagnostic;
        diagnostic.where = s.original.passes[s.original.resources[find_resource(s.original, name)].producer].where;
        diagnostic.message = fmt::format("'{}' {}", name, why_different(order, poison, is_of_lists));
        diagnostic.found = fmt::format("other bytes than in the order of the graph");
        diagnostic.help =
            "pass '" + lasting->pass + "', or one before it, uses something that its declared accesses do not tell";
        throw Error(HEDDLE_BUG, std::move(diagnostic));
      }
      for (const Picture& picture : expected[f].kept) {
        const Picture* same = find_same(found[f].kept, picture);
        if (same == nullptr || same->bytes == picture.bytes) continue;
        const auto at = static_cast<std::size_t>(
            std::mismatch(picture.bytes.begin(), picture.bytes.end(), same->bytes.begin()).first -
            picture.bytes.begin());
        const auto format = static_cast<VkFormat>(s.graph.resources[s.resources[picture.resource].root].format);
        const vulkan::FormatInfo info = vulkan::format_info(format);
        const std::size_t texel = at / std::max(info.texel_bytes, 1U);
        const auto texel_text = [&](const Picture& of) {
          if (info.texel_bytes == 0)
            return fmt::format("{:02x} at byte {}", std::to_integer<unsigned>(of.bytes[at]), at);
          std::vector<float> values =
              vulkan::to_float(std::span(of.bytes).subspan(texel * info.texel_bytes, info.texel_bytes), format);
          for (float& value : values)
            if (std::isnan(value)) value = std::abs(value);  // a NaN's sign says nothing
          return fmt::format("{}", fmt::join(values, " "));
        };
        Diagnostic diagnostic;
        diagnostic.where.file = s.graph.file;
        diagnostic.message =
            fmt::format("'{}' {}", s.graph.resources[picture.resource].name, why_different(order, poison, is_of_lists));
        diagnostic.found = fmt::format("frame {}, pixel {}, {}: {}", f, texel % picture.width, texel / picture.width,
                                       texel_text(*same));
        diagnostic.expected = fmt::format("{}, as in the order of the graph", texel_text(picture));
        for (const Picture& scanned : expected[f].scanned) {
          const Picture* other = find_same(found[f].scanned, scanned);
          if (other == nullptr || other->bytes == scanned.bytes) continue;
          const Pass& pass = s.graph.passes[scanned.pass];
          diagnostic.where = pass.where;
          diagnostic.help = fmt::format(
              "the first output that differs is '{}': pass '{}' ({}) uses {}", s.graph.resources[scanned.resource].name,
              pass.name, pass.entry.technique->id,
              is_of_lists ? "where an element stands in a list" : "something that its declared accesses do not tell");
          break;
        }
        if (order != 0)
          diagnostic.help += fmt::format("{}the order was {}", diagnostic.help.empty() ? "" : "; ",
                                         order_text(s.graph, orders.orders[order]));
        throw Error(HEDDLE_BUG, std::move(diagnostic));
      }
    }
  };
  // The second one also draws what no view can see, which must touch no pixel.
  compare(run(0, zeros, false), 0, {});
  // What each stage has appended, the other way round.
  if (!report.lists.empty()) compare(run(0, zeros, true, ListOrder::kDescending), 0, {}, true);
  for (std::size_t order = 0; order < orders.orders.size(); ++order) {
    if (!can_poison && order != 0) compare(run(order, {}), order, {});
    for (const std::uint32_t poison : report.poisons) compare(run(order, poison), order, poison);
  }
  return report;
}

}  // namespace heddle::graph
