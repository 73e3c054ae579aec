// SPDX-License-Identifier: Apache-2.0
// Order + uses -> the barriers of a frame that repeats: for every resource the uses fall into groups (one writer, or
// readers that share a layout), and between consecutive groups stands exactly one barrier, round the frame's end too.
#include <algorithm>
#include <numeric>

#include "graph/stages.hpp"
#include "graph/uses.hpp"

namespace heddle::graph {
namespace {

constexpr VkPipelineStageFlags2 kShaderStages = VK_PIPELINE_STAGE_2_VERTEX_SHADER_BIT |
                                                VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT |
                                                VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT;
// Batches are pulled by the vertex shader of the host, and drawn as indices and commands say.
constexpr VkPipelineStageFlags2 kDrawStages =
    VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT | VK_PIPELINE_STAGE_2_INDEX_INPUT_BIT | VK_PIPELINE_STAGE_2_VERTEX_SHADER_BIT;
constexpr VkPipelineStageFlags2 kDepthStages =
    VK_PIPELINE_STAGE_2_EARLY_FRAGMENT_TESTS_BIT | VK_PIPELINE_STAGE_2_LATE_FRAGMENT_TESTS_BIT;
constexpr VkAccessFlags2 kWrites = VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT | VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT |
                                   VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT | VK_ACCESS_2_TRANSFER_WRITE_BIT;

/// Uses that need no barrier between them: one writing use, or consecutive reading ones in one layout.
struct Group {
  std::uint32_t stage = 0;  // of the first use: the barrier stands before it; Order::stages.size(): the frame's end
  AccessInfo info;
};

/// Shader stages that a scheduled stage really has, if its descriptor tells: the kinds of all its shaders.
VkPipelineStageFlags2 shader_stages(const ResolvedGraph& graph, const ScheduledStage& scheduled) {
  const Technique& technique = *graph.passes[scheduled.pass].entry.technique;
  const Stage& stage = technique.stages[scheduled.stage];
  VkPipelineStageFlags2 stages = 0;
  for (const Shader& shader : technique.shaders) {
    if (shader.stage != stage.name) continue;
    // Vertex shaders are the surfaces' own: no port is bound to them.
    stages |= shader.kind == ShaderKind::kCompute ? VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT
                                                  : VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT;
  }
  // Attachments without a raster shader: the technique records draws of its own.
  const bool draws = std::ranges::any_of(stage.accesses, [](const Access& access) {
    return access.access == HEDDLE_ACCESS_COLOR || access.access == HEDDLE_ACCESS_DEPTH ||
           access.access == HEDDLE_ACCESS_DEPTH_READ || access.access == HEDDLE_ACCESS_DRAW;
  });
  if (stages == 0 || (draws && stages == VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT)) return kShaderStages;
  return stages;
}

/// How many beginnings and ends of loops a stage has behind it: uses of different numbers are no group, because what is
/// between them happens another number of times.
std::uint32_t loop_borders(const Order& order, std::uint32_t stage) {
  std::uint32_t borders = 0;
  for (const ScheduledLoop& loop : order.loops)
    borders += (stage >= loop.begin ? 1U : 0U) + (stage >= loop.end ? 1U : 0U);
  return borders;
}

bool continues(const AccessInfo& group, const AccessInfo& next) {
  return !group.writes && !next.writes && group.layout == next.layout;
}

void widen(AccessInfo& info, const AccessInfo& more) {
  info.stages |= more.stages;
  info.access |= more.access;
}

/// For each first version: the groups of a frame, in order.
std::vector<std::vector<Group>> find_groups(const ResolvedGraph& graph, const Order& order) {
  std::vector<std::vector<Group>> groups(graph.resources.size());
  const ListPlan lists = plan_lists(graph, order);
  for (std::uint32_t s = 0; s < order.stages.size(); ++s) {
    const ScheduledStage& scheduled = order.stages[s];
    const VkPipelineStageFlags2 shaders = shader_stages(graph, scheduled);
    // Two versions of one image in one stage are one memory, and so one use.
    std::vector<ScheduledStage::Use> uses;
    for (ScheduledStage::Use use : scheduled.uses) {
      if (!has_memory(graph.resources[use.resource].type)) continue;
      use.resource = first_version(graph, use.resource);
      merge_use(uses, use);
    }
    for (const ScheduledStage::Use& use : uses) {
      const Resource& resource = graph.resources[use.resource];
      AccessInfo info = use_info(use, resource.type, resource.format);
      if ((info.stages & kShaderStages) == kShaderStages) info.stages = (info.stages & ~kShaderStages) | shaders;
      if ((use.mask & (1U << HEDDLE_ACCESS_DRAW)) != 0) info.stages |= kDrawStages;
      // The host's own transfers, beside what the stage does: they stand in one group with it.
      const auto is_in = [&](const std::vector<ResourceIndex>& of) {
        return std::ranges::find(of, use.resource) != of.end();
      };
      if (is_in(lists.emptied[s])) widen(info, access_info(HEDDLE_ACCESS_TRANSFER_WRITE, resource.type, 0));
      if (is_in(lists.counted[s])) widen(info, access_info(HEDDLE_ACCESS_TRANSFER_READ, resource.type, 0));
      info.writes = info.writes || is_in(lists.emptied[s]);
      std::vector<Group>& list = groups[use.resource];
      if (!list.empty() && continues(list.back().info, info) &&
          loop_borders(order, list.back().stage) == loop_borders(order, s)) {
        widen(list.back().info, info);
      } else {
        list.push_back({s, info});
      }
    }
  }
  return groups;
}

Barrier make_barrier(ResourceIndex resource, const AccessInfo& from, const AccessInfo& to) {
  // Only writes need to be made available; reads are waited for by their stages alone.
  return {resource, from.stages, to.stages, from.access & kWrites, to.access, from.layout, to.layout};
}

/// True if readers follow readers that see all of what they need already.
bool is_covered(const AccessInfo& before, const AccessInfo& after) {
  return continues(before, after) && (after.stages & ~before.stages) == 0 && (after.access & ~before.access) == 0;
}

/// Barriers of the iterations after the first: each group follows the one before it, the first one the last.
void plan_again(const Order& order, const Placement& placement, const std::vector<std::vector<Group>>& groups,
                const std::vector<bool>& is_kept, BarrierPlan& plan) {
  plan.again.resize(order.stages.size());
  for (const ScheduledLoop& loop : order.loops) {
    const auto is_inside = [&](const Group& group) { return group.stage >= loop.begin && group.stage < loop.end; };
    for (ResourceIndex r = 0; r < groups.size(); ++r) {
      std::vector<const Group*> repeated;
      for (const Group& group : groups[r])
        if (is_inside(group) && !order.stages[group.stage].runs_once) repeated.push_back(&group);
      for (std::size_t g = 0; g < repeated.size(); ++g) {
        const Group& group = *repeated[g];
        AccessInfo before = repeated[g > 0 ? g - 1 : repeated.size() - 1]->info;
        bool is_due = !is_covered(before, group.info);
        if (g == 0 && &group == &groups[r].front() && !is_kept[r]) {
          // Whoever has these bytes in the rest of an iteration destroys what the last one left.
          for (const Placement::Handover& handover : placement.handovers) {
            if (handover.to != r) continue;
            for (const ResourceIndex other : handover.from) {
              const auto last = std::find_if(groups[other].rbegin(), groups[other].rend(), is_inside);
              if (last == groups[other].rend()) continue;
              widen(before, last->info);
              before.layout = VK_IMAGE_LAYOUT_UNDEFINED;
              is_due = true;
            }
          }
        }
        if (is_due) plan.again[group.stage].push_back(make_barrier(r, before, group.info));
      }
    }
  }
}

}  // namespace

AccessInfo access_info(std::uint32_t access, PortType type, std::uint32_t /*format*/) {
  if (!has_memory(type)) {
    // Uploaded by the host before the frame begins: nothing on the GPU writes them. What techniques make of surfaces is
    // in their buffers.
    const bool writes = access == HEDDLE_ACCESS_HOST_WRITE || access == HEDDLE_ACCESS_BATCHES;
    return {kShaderStages, VK_ACCESS_2_SHADER_STORAGE_READ_BIT | VK_ACCESS_2_UNIFORM_READ_BIT,
            VK_IMAGE_LAYOUT_UNDEFINED, !writes, writes};
  }
  AccessInfo info;
  switch (access) {
    case HEDDLE_ACCESS_SAMPLED:
    case HEDDLE_ACCESS_SAMPLED_LINEAR:
    case HEDDLE_ACCESS_SAMPLED_COMPARE:
      info = {kShaderStages, VK_ACCESS_2_SHADER_SAMPLED_READ_BIT, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL, true,
              false};
      break;
    case HEDDLE_ACCESS_STORAGE_READ:
      info = {kShaderStages, VK_ACCESS_2_SHADER_STORAGE_READ_BIT, VK_IMAGE_LAYOUT_GENERAL, true, false};
      break;
    case HEDDLE_ACCESS_STORAGE_WRITE:
      info = {kShaderStages, VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT, VK_IMAGE_LAYOUT_GENERAL, false, true};
      break;
    case HEDDLE_ACCESS_STORAGE_READ_WRITE:
    case HEDDLE_ACCESS_APPEND:  // an atomic operation reads too
      info = {kShaderStages, VK_ACCESS_2_SHADER_STORAGE_READ_BIT | VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT,
              VK_IMAGE_LAYOUT_GENERAL, true, true};
      break;
    case HEDDLE_ACCESS_COLOR:
      info = {VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT,
              VK_ACCESS_2_COLOR_ATTACHMENT_READ_BIT | VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT,
              VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL, true, true};
      break;
    case HEDDLE_ACCESS_DEPTH:
      info = {kDepthStages,
              VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT | VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT,
              VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL, true, true};
      break;
    case HEDDLE_ACCESS_DEPTH_READ:
      info = {kDepthStages, VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT,
              VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL, true, false};
      break;
    case HEDDLE_ACCESS_DRAW:
      info = {kDrawStages,
              VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT | VK_ACCESS_2_INDEX_READ_BIT | VK_ACCESS_2_SHADER_STORAGE_READ_BIT,
              VK_IMAGE_LAYOUT_UNDEFINED, true, false};
      break;
    case HEDDLE_ACCESS_HOST_READ:  // execute copies to and from staging memory
    case HEDDLE_ACCESS_TRANSFER_READ:
      info = {VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT, VK_ACCESS_2_TRANSFER_READ_BIT, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
              true, false};
      break;
    case HEDDLE_ACCESS_HOST_WRITE:
    case HEDDLE_ACCESS_TRANSFER_WRITE:
      info = {VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT, VK_ACCESS_2_TRANSFER_WRITE_BIT,
              VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, false, true};
      break;
    default:
      throw Error(HEDDLE_BUG, "access " + std::to_string(access) + " has no meaning for an image or buffer");
  }
  if (type == PortType::kBuffer) info.layout = VK_IMAGE_LAYOUT_UNDEFINED;
  return info;
}

AccessInfo use_info(const ScheduledStage::Use& use, PortType type, std::uint32_t format) {
  AccessInfo info = access_info(use.access, type, format);
  const std::uint32_t mask = use.mask;
  if (mask == 0) return info;
  info.stages = 0;
  info.access = 0;
  info.reads = info.writes = false;
  for (std::uint32_t access = 0; access < 32; ++access) {
    if ((mask & (1U << access)) == 0) continue;
    const AccessInfo one = access_info(access, type, format);
    widen(info, one);
    info.reads = info.reads || one.reads;
    info.writes = info.writes || one.writes;
  }
  return info;
}

ListPlan plan_lists(const ResolvedGraph& graph, const Order& order) {
  ListPlan plan;
  plan.emptied.resize(order.stages.size());
  plan.counted.resize(order.stages.size());
  plan.goes_on.resize(graph.resources.size());
  for (ResourceIndex r = 0; r < graph.resources.size(); ++r) {
    const Resource& list = graph.resources[r];
    if (!list.is_list() || list.previous_version != kNoIndex || list.history_of != kNoIndex) continue;
    plan.goes_on[r] = is_kept(graph, r) && (list.flags & HEDDLE_PORT_REWRITTEN) == 0;
    std::uint32_t first = kNoIndex;
    std::uint32_t last_writer = kNoIndex;
    for (std::uint32_t s = 0; s < order.stages.size(); ++s) {
      for (const ScheduledStage::Use& use : order.stages[s].uses) {
        if (first_version(graph, use.resource) != r) continue;
        if (first == kNoIndex) first = s;
        if (use.writes) last_writer = s;
      }
    }
    if (first == kNoIndex) continue;
    plan.emptied[first].push_back(r);
    plan.counted[last_writer == kNoIndex ? first : last_writer].push_back(r);
  }
  return plan;
}

BarrierPlan plan_barriers(const ResolvedGraph& graph, const Order& order, const Placement& placement,
                          std::span<const ResourceIndex> wanted) {
  BarrierPlan plan;
  plan.before.resize(order.stages.size());
  plan.first_layout.assign(graph.resources.size(), VK_IMAGE_LAYOUT_UNDEFINED);

  std::vector<bool> is_kept(graph.resources.size(), false);
  for (ResourceIndex r = 0; r < graph.resources.size(); ++r)
    if (graph.resources[r].is_kept) is_kept[first_version(graph, r)] = true;

  std::vector<std::vector<Group>> groups = find_groups(graph, order);

  // What is read after the frame: one more reading use, at the end.
  const auto end = static_cast<std::uint32_t>(order.stages.size());
  for (const ResourceIndex w : wanted) {
    const ResourceIndex resource = first_version(graph, w);
    if (!has_memory(graph.resources[resource].type) || groups[resource].empty()) continue;
    if (placement.offset[resource] != Placement::kOwnMemory)
      throw Error(HEDDLE_BUG, "'" + graph.resources[w].name + "' is read after the frame, but its memory is shared");
    const AccessInfo info = access_info(HEDDLE_ACCESS_TRANSFER_READ, graph.resources[resource].type, 0);
    Group& last = groups[resource].back();
    if (last.stage == end) continue;  // two versions of it are wanted
    if (continues(last.info, info)) {
      widen(last.info, info);
    } else {
      groups[resource].push_back({end, info});
    }
  }

  // Readers on both sides of a loop's border need no barrier between them where the later ones see all they need
  // already; whoever comes after both must then wait for both.
  for (std::vector<Group>& list : groups)
    for (std::size_t g = 1; g < list.size(); ++g)
      if (is_covered(list[g - 1].info, list[g].info)) widen(list[g].info, list[g - 1].info);

  // Kept resources go round: the last group of a frame stands before the first one of the next; where a history is
  // read, two memories take turns, and each meets what was done to the other. Readers that meet there in one layout are
  // one group.
  std::vector<ResourceIndex> last_frame(graph.resources.size());  // what the memory was in the frame before
  std::iota(last_frame.begin(), last_frame.end(), ResourceIndex{0});
  for (const HistoryPair& pair : history_pairs(graph, order)) {
    last_frame[pair.newest] = pair.history;
    last_frame[pair.history] = pair.newest;
  }
  std::vector<bool> joins_round(graph.resources.size(), false);
  for (int turn = 0; turn < 2; ++turn) {  // the second hands on what the first found of the other memory
    for (ResourceIndex r = 0; r < groups.size(); ++r) {
      if (!is_kept[r] || groups[r].empty()) continue;
      Group& first = groups[r].front();
      Group& last = groups[last_frame[r]].back();
      plan.first_layout[r] = last.info.layout;
      if (continues(last.info, first.info)) {
        joins_round[r] = true;
        widen(last.info, first.info);
        first.info = {last.info.stages, last.info.access, first.info.layout, first.info.reads, first.info.writes};
      }
    }
  }

  const auto add = [&](const Group& group, const Barrier& barrier) {
    (group.stage == end ? plan.at_end : plan.before[group.stage]).push_back(barrier);
  };
  for (ResourceIndex r = 0; r < groups.size(); ++r) {
    for (std::size_t g = 0; g < groups[r].size(); ++g) {
      const Group& group = groups[r][g];
      if (g > 0) {
        const AccessInfo& before = groups[r][g - 1].info;
        if (!is_covered(before, group.info)) add(group, make_barrier(r, before, group.info));
        continue;
      }
      if (joins_round[r]) continue;
      AccessInfo before = groups[last_frame[r]].back().info;
      if (!is_kept[r]) {
        // Contents are not needed. Whoever had these bytes before, in this frame or the last, must be done, and its
        // writes must not land later; each one's earlier groups wait for its last one already.
        before.layout = VK_IMAGE_LAYOUT_UNDEFINED;
        for (const Placement::Handover& handover : placement.handovers) {
          if (handover.to != r) continue;
          for (const ResourceIndex other : handover.from)
            if (!groups[other].empty()) widen(before, groups[other].back().info);
        }
      }
      add(group, make_barrier(r, before, group.info));
    }
  }
  plan_again(order, placement, groups, is_kept, plan);
  return plan;
}

}  // namespace heddle::graph
