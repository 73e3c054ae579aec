// SPDX-License-Identifier: Apache-2.0
// The checker's model. Every past access of a memory object knows which pipeline stages are ordered after it, whether
// its writes are available, and to which (stages, accesses) they are visible. A layout transition is a write.
#include "graph/hazard_checker.hpp"

#include <algorithm>
#include <map>
#include <set>

namespace heddle::graph::test_support {
namespace {

using Stages = VkPipelineStageFlags2;
using Accesses = VkAccessFlags2;

constexpr Stages kVertex = VK_PIPELINE_STAGE_2_VERTEX_SHADER_BIT;
constexpr Stages kFragment = VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT;
constexpr Stages kCompute = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT;
constexpr Stages kTransfer = VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT;
constexpr Stages kDepthTests =
    VK_PIPELINE_STAGE_2_EARLY_FRAGMENT_TESTS_BIT | VK_PIPELINE_STAGE_2_LATE_FRAGMENT_TESTS_BIT;

/// What one scheduled stage does to one memory object.
struct Touch {
  Stages stages = 0;
  Accesses reads = 0, writes = 0;
  bool needs_contents = false;
  std::set<VkImageLayout> layouts;
};

struct Past {
  std::string what;
  Stages stages = 0;  // 0: a layout transition, which only chains
  Accesses writes = 0;
  bool is_write = false, is_transition = false, is_available = false;
  Stages after = 0;  // whatever runs in these stages from now on comes later
  std::vector<std::pair<Stages, Accesses>> visible;
};

struct Memory {
  VkImageLayout layout = VK_IMAGE_LAYOUT_UNDEFINED;
  bool is_defined = false;
  std::vector<Past> past;
};

class Player {
 public:
  Player(const ResolvedGraph& graph, const Order& order, std::span<const MemoryNeed> needs, const Placement& placement,
         const BarrierPlan& plan, std::span<const ResourceIndex> wanted)
      : graph_(graph),
        order_(order),
        needs_(needs),
        placement_(placement),
        plan_(plan),
        wanted_(wanted),
        memory_(graph.resources.size()) {}

  std::vector<std::string> play(std::uint32_t frames, std::uint32_t iterations) {
    for (ResourceIndex r = 0; r < memory_.size(); ++r)
      if (is_kept(r)) memory_[r] = {plan_.first_layout[r], true, {}};
    find_turns();
    for (frame_ = 0; frame_ < frames; ++frame_) {
      if (frame_ > 0)
        for (const auto& [newest, history] : turns_) std::swap(memory_[newest], memory_[history]);
      where_ = "start";
      for (ResourceIndex r = 0; r < memory_.size(); ++r)
        if (is_kept(r) && is_used_.contains(r) && memory_[r].layout != plan_.first_layout[r])
          complain(r, "starts the frame in another layout than the plan says");
      for (ResourceIndex r = 0; r < memory_.size(); ++r)
        if (!is_kept(r)) memory_[r].is_defined = false;
      for (std::uint32_t s = 0; s < order_.stages.size(); ++s) {
        const auto loop = std::ranges::find(order_.loops, s, &ScheduledLoop::begin);
        if (loop == order_.loops.end()) {
          run(s, plan_.before[s]);
          continue;
        }
        for (std::uint32_t i = 0; i < iterations; ++i) {
          if (i > 0) begin_iteration(*loop);
          for (s = loop->begin; s < loop->end; ++s)
            if (i == 0 || !order_.stages[s].runs_once) run(s, i == 0 ? plan_.before[s] : plan_.again[s]);
        }
        s = loop->end - 1;
      }
      where_ = "end";
      for (const Barrier& barrier : plan_.at_end) apply(barrier);
      std::set<ResourceIndex> read_back;
      for (const ResourceIndex w : wanted_) {
        const ResourceIndex r = root(w);
        if (!has_bytes(r) || !is_used_.contains(r) || !read_back.insert(r).second) continue;
        Touch touch;
        touch.stages = kTransfer;
        touch.reads = VK_ACCESS_2_TRANSFER_READ_BIT;
        touch.needs_contents = true;
        touch.layouts = {VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL};
        access(r, touch);
      }
    }
    return hazards_;
  }

 private:
  void run(std::uint32_t s, const std::vector<Barrier>& barriers) {
    where_ = graph_.passes[order_.stages[s].pass].name + " stage " + std::to_string(s);
    for (const Barrier& barrier : barriers) apply(barrier);
    for (const auto& [resource, touch] : touches(order_.stages[s])) {
      Touch head;
      head.stages = kTransfer;
      head.layouts = touch.layouts;
      if (is_emptied(resource, s)) {
        head.writes = VK_ACCESS_2_TRANSFER_WRITE_BIT;
        access(resource, head);
        apply({resource, kTransfer, touch.stages, head.writes, touch.reads | touch.writes});
      }
      access(resource, touch);
      if (!is_counted(resource, s)) continue;
      head.writes = 0;
      head.reads = VK_ACCESS_2_TRANSFER_READ_BIT;
      apply({resource, touch.stages, kTransfer, touch.writes, head.reads});
      access(resource, head);
    }
  }
  /// The host's own transfers, beside what the stage does, with barriers of their own in between.
  [[nodiscard]] bool is_emptied(ResourceIndex r, std::uint32_t stage) {
    const Resource& list = graph_.resources[r];
    if (!list.is_list() || list.history_of != kNoIndex) return false;
    for (std::uint32_t s = 0; s < stage; ++s)
      if (touches(order_.stages[s]).contains(r)) return false;
    return true;
  }
  [[nodiscard]] bool is_counted(ResourceIndex r, std::uint32_t stage) {
    if (!graph_.resources[r].is_list() || graph_.resources[r].history_of != kNoIndex) return false;
    const auto writes = [&](std::uint32_t s) {
      const auto found = touches(order_.stages[s]);
      const auto touch = found.find(r);
      return touch != found.end() && touch->second.writes != 0;
    };
    if (!writes(stage)) return false;
    for (std::uint32_t s = stage + 1; s < order_.stages.size(); ++s)
      if (writes(s)) return false;
    return true;
  }
  /// What was made in an iteration is not there in the next, unless it is kept or made only once.
  void begin_iteration(const ScheduledLoop& loop) {
    std::set<ResourceIndex> made;
    std::set<ResourceIndex> stays;
    for (std::uint32_t s = loop.begin; s < loop.end; ++s)
      for (const auto& [resource, touch] : touches(order_.stages[s]))
        if (touch.writes != 0) (order_.stages[s].runs_once ? stays : made).insert(resource);
    for (const ResourceIndex r : made)
      if (!is_kept(r) && !stays.contains(r)) memory_[r].is_defined = false;
  }
  [[nodiscard]] bool has_bytes(ResourceIndex r) const {
    return graph_.resources[r].type == PortType::kImage || graph_.resources[r].type == PortType::kBuffer;
  }
  [[nodiscard]] ResourceIndex root(ResourceIndex r) const {
    while (has_bytes(r) && graph_.resources[r].previous_version != kNoIndex) r = graph_.resources[r].previous_version;
    return r;
  }
  [[nodiscard]] bool is_kept(ResourceIndex r) const {
    if (root(r) != r || !has_bytes(r)) return false;
    for (ResourceIndex v = 0; v < graph_.resources.size(); ++v)
      if (graph_.resources[v].is_kept && root(v) == r) return true;
    return false;
  }
  /// Pairs of memories that change places between frames: the newest, and last frame's that somebody reads.
  void find_turns() {
    for (const ScheduledStage& scheduled : order_.stages) static_cast<void>(touches(scheduled));
    for (ResourceIndex r = 0; r < graph_.resources.size(); ++r) {
      const ResourceIndex newest = graph_.resources[r].history_of;
      if (newest != kNoIndex && has_bytes(r) && is_used_.contains(r)) turns_.emplace_back(root(newest), r);
    }
  }
  [[nodiscard]] bool shares_bytes(ResourceIndex a, ResourceIndex b) const {
    if (a == b) return true;
    const auto begin_a = placement_.offset[a];
    const auto begin_b = placement_.offset[b];
    if (begin_a == Placement::kOwnMemory || begin_b == Placement::kOwnMemory) return false;
    return begin_a < begin_b + needs_[b].size && begin_b < begin_a + needs_[a].size;
  }
  void complain(ResourceIndex r, const std::string& what) {
    hazards_.push_back("frame " + std::to_string(frame_) + ", " + where_ + ": '" + graph_.resources[r].name + "' " +
                       what);
  }

  // ---- what a stage really does, from descriptors ----

  static Stages shader_stages(const Technique& technique, const Stage& stage) {
    Stages stages = 0;
    for (const Shader& shader : technique.shaders)
      if (shader.stage == stage.name)
        stages |=
            shader.kind == ShaderKind::kCompute ? kCompute : kFragment;  // ports are seen by fragment shaders only
    // Attachments that no raster shader of its own draws into: the technique records draws with pipelines of which the
    // descriptor tells nothing, and whose shaders may read any port.
    const bool has_attachments = std::ranges::any_of(stage.accesses, [](const Access& access) {
      return access.access >= HEDDLE_ACCESS_COLOR && access.access <= HEDDLE_ACCESS_DEPTH_READ;
    });
    if (has_attachments && stages == kCompute) stages = 0;
    return stages != 0 ? stages : kVertex | kFragment | kCompute;
  }

  void add(std::map<ResourceIndex, Touch>& list, const Pass& pass, const Access& access, Stages shaders) const {
    const auto bound = pass.ports.find(access.port);
    if (bound == pass.ports.end() || !has_bytes(bound->second)) return;
    Touch& touch = list[root(bound->second)];
    const auto say = [&](Stages stages, Accesses reads, Accesses writes, VkImageLayout layout, bool needs_contents) {
      touch.stages |= stages;
      touch.reads |= reads;
      touch.writes |= writes;
      touch.layouts.insert(layout);
      touch.needs_contents = touch.needs_contents || needs_contents;
    };
    const bool keeps = access.load == HEDDLE_LOAD_KEEP ||
                       (access.load == HEDDLE_LOAD_CLEAR_NEW && pass.inout_sources.count(access.port) != 0);
    switch (access.access) {
      case HEDDLE_ACCESS_SAMPLED:
      case HEDDLE_ACCESS_SAMPLED_LINEAR:
      case HEDDLE_ACCESS_SAMPLED_COMPARE:
        return say(shaders, VK_ACCESS_2_SHADER_SAMPLED_READ_BIT, 0, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL, true);
      case HEDDLE_ACCESS_STORAGE_READ:
        return say(shaders, VK_ACCESS_2_SHADER_STORAGE_READ_BIT, 0, VK_IMAGE_LAYOUT_GENERAL, true);
      case HEDDLE_ACCESS_STORAGE_WRITE:
        return say(shaders, 0, VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT, VK_IMAGE_LAYOUT_GENERAL, false);
      case HEDDLE_ACCESS_STORAGE_READ_WRITE:
      case HEDDLE_ACCESS_APPEND:
        return say(shaders, VK_ACCESS_2_SHADER_STORAGE_READ_BIT, VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT,
                   VK_IMAGE_LAYOUT_GENERAL, true);
      case HEDDLE_ACCESS_COLOR:
        return say(VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT, VK_ACCESS_2_COLOR_ATTACHMENT_READ_BIT,
                   VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL, keeps);
      case HEDDLE_ACCESS_DEPTH:
        return say(kDepthTests, VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT,
                   VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT, VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL,
                   keeps);
      case HEDDLE_ACCESS_DEPTH_READ:
        return say(kDepthTests, VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT, 0,
                   VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL, true);
      case HEDDLE_ACCESS_HOST_READ:
      case HEDDLE_ACCESS_TRANSFER_READ:
        return say(kTransfer, VK_ACCESS_2_TRANSFER_READ_BIT, 0, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, true);
      case HEDDLE_ACCESS_HOST_WRITE:
      case HEDDLE_ACCESS_TRANSFER_WRITE:
        return say(kTransfer, 0, VK_ACCESS_2_TRANSFER_WRITE_BIT, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, false);
      default:
        return;
    }
  }

  /// Surfaces that passes made are read out of the buffers that their ports name.
  void add_made(std::map<ResourceIndex, Touch>& list, ResourceIndex surfaces, std::uint32_t access) const {
    if (access != HEDDLE_ACCESS_DRAW && access != HEDDLE_ACCESS_HOST_READ) return;
    for (; surfaces != kNoIndex && graph_.resources[surfaces].type == PortType::kSurfaces;
         surfaces = graph_.resources[surfaces].previous_version) {
      if (graph_.resources[surfaces].producer == kNoIndex) continue;
      const Pass& maker = graph_.passes[graph_.resources[surfaces].producer];
      for (const Port& port : maker.entry.technique->ports) {
        if (port.name != graph_.resources[surfaces].port) continue;
        for (const std::string* name : {&port.vertices, &port.indices, &port.instances, &port.commands}) {
          if (name->empty()) continue;
          Touch& touch = list[root(maker.ports.at(*name))];
          touch.needs_contents = true;
          touch.layouts.insert(VK_IMAGE_LAYOUT_UNDEFINED);
          if (access == HEDDLE_ACCESS_HOST_READ) {
            touch.stages |= kTransfer;
            touch.reads |= VK_ACCESS_2_TRANSFER_READ_BIT;
            continue;
          }
          touch.stages |= VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT | VK_PIPELINE_STAGE_2_INDEX_INPUT_BIT | kVertex;
          touch.reads |=
              VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT | VK_ACCESS_2_INDEX_READ_BIT | VK_ACCESS_2_SHADER_STORAGE_READ_BIT;
        }
      }
    }
  }

  void add_functions(std::map<ResourceIndex, Touch>& list, const Pass& caller, const std::vector<std::string>& calls,
                     Stages shaders, std::uint32_t depth) const {
    if (depth > 16) return;
    for (const std::string& role : calls)
      for (const FunctionBinding& binding : caller.functions)
        if (binding.role == role)
          for (const PassIndex p : binding.providers) {
            const Pass& provider = graph_.passes[p];
            for (const Function& function : provider.entry.technique->functions) {
              if (function.role != role) continue;
              for (const Access& access : function.accesses) add(list, provider, access, shaders);
              add_functions(list, provider, function.calls, shaders, depth + 1);
            }
          }
  }

  [[nodiscard]] std::map<ResourceIndex, Touch> touches(const ScheduledStage& scheduled) {
    std::map<ResourceIndex, Touch> list;
    const Pass& pass = graph_.passes[scheduled.pass];
    const Technique& technique = *pass.entry.technique;
    const Stage& stage = technique.stages[scheduled.stage];
    const Stages shaders = shader_stages(technique, stage);
    for (const Access& access : stage.accesses) {
      const auto bound = pass.ports.find(access.port);
      if (bound == pass.ports.end()) continue;
      // A stage with latency reads the host's copies; only making them touches the memory.
      const bool is_copied = stage.latency > 0 && access.access == HEDDLE_ACCESS_HOST_READ && has_bytes(bound->second);
      if (is_copied == scheduled.is_read_back) add(list, pass, access, shaders);
      if (!scheduled.is_read_back) add_made(list, bound->second, access.access);
    }
    for (const Shader& shader : technique.shaders)
      if (shader.stage == stage.name) add_functions(list, pass, shader.calls, shaders, 0);
    for (const auto& [resource, touch] : list) is_used_.insert(resource);
    return list;
  }

  [[nodiscard]] VkImageLayout needed_layout(ResourceIndex r, const Touch& touch) const {
    if (graph_.resources[r].type == PortType::kBuffer) return VK_IMAGE_LAYOUT_UNDEFINED;
    if (touch.layouts.size() == 1) return *touch.layouts.begin();
    const std::set<VkImageLayout> depth_and_sampled{VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL,
                                                    VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL};
    return touch.layouts == depth_and_sampled ? VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL
                                              : VK_IMAGE_LAYOUT_GENERAL;
  }

  // ---- the rules ----

  void apply(const Barrier& barrier) {
    const ResourceIndex r = barrier.resource;
    Memory& memory = memory_[r];
    const bool is_image = graph_.resources[r].type == PortType::kImage;
    const bool discards = is_image && barrier.old_layout == VK_IMAGE_LAYOUT_UNDEFINED;
    const bool is_transition = is_image && (discards || barrier.old_layout != barrier.new_layout);
    if (is_image && !discards && memory.layout != barrier.old_layout) complain(r, "is not in the barrier's old layout");
    for (ResourceIndex other = 0; other < memory_.size(); ++other) {
      if (!shares_bytes(r, other)) continue;
      for (Past& past : memory_[other].past) {
        const bool is_direct = !past.is_transition && (past.stages & ~barrier.source_stages) == 0;
        const bool is_ordered = is_direct || (past.after & barrier.source_stages) != 0;
        if (is_direct && (past.writes & ~barrier.source_access) == 0) past.is_available = true;
        if (is_transition && !is_ordered) complain(r, "changes its layout while " + past.what + " may still run");
        if (is_transition && past.is_write && !past.is_available)
          complain(r, "changes its layout before the writes of " + past.what + " are available");
        if (!is_ordered) continue;
        past.after |= barrier.target_stages;
        if (past.is_write && past.is_available) past.visible.emplace_back(barrier.target_stages, barrier.target_access);
      }
    }
    if (!is_image) return;
    memory.layout = barrier.new_layout;
    if (discards) memory.is_defined = false;
    if (is_transition) {
      Past transition{"the layout transition before " + where_, 0, 0, true, true, true, barrier.target_stages, {}};
      transition.visible.emplace_back(barrier.target_stages, barrier.target_access);
      memory.past = {transition};  // all older ones are ordered before it, or were complained about
    }
  }

  void access(ResourceIndex r, const Touch& touch) {
    Memory& memory = memory_[r];
    if (graph_.resources[r].type == PortType::kImage && memory.layout != needed_layout(r, touch))
      complain(r, "is in the wrong layout");
    if (touch.needs_contents && !memory.is_defined) complain(r, "is read, but its contents are undefined");
    const bool writes = touch.writes != 0;
    for (ResourceIndex other = 0; other < memory_.size(); ++other) {
      if (!shares_bytes(r, other)) continue;
      for (const Past& past : memory_[other].past) {
        if (!past.is_write && !writes && other == r) continue;  // readers do not mind each other
        if ((touch.stages & ~past.after) != 0) {
          complain(r, "may run together with " + past.what);
          continue;
        }
        if (!past.is_write) continue;
        if (!past.is_available) complain(r, "comes before the writes of " + past.what + " are available");
        if (touch.reads != 0 && other == r) {
          const bool is_visible = std::ranges::any_of(past.visible, [&](const auto& v) {
            return (touch.stages & ~v.first) == 0 && (touch.reads & ~v.second) == 0;
          });
          if (!is_visible) complain(r, "reads what is not visible of " + past.what);
        }
      }
    }
    if (writes) {
      memory.past.clear();
      memory.is_defined = true;
      for (ResourceIndex other = 0; other < memory_.size(); ++other)
        if (other != r && shares_bytes(r, other)) memory_[other].is_defined = false;
    }
    Past past;
    past.what = "frame " + std::to_string(frame_) + " " + where_;
    past.stages = touch.stages;
    past.writes = touch.writes;
    past.is_write = writes;
    memory.past.push_back(past);
  }

  const ResolvedGraph& graph_;
  const Order& order_;
  std::span<const MemoryNeed> needs_;
  const Placement& placement_;
  const BarrierPlan& plan_;
  std::span<const ResourceIndex> wanted_;
  std::vector<Memory> memory_;
  std::vector<std::string> hazards_;
  std::set<ResourceIndex> is_used_;
  std::vector<std::pair<ResourceIndex, ResourceIndex>> turns_;
  std::string where_;
  std::uint32_t frame_ = 0;
};

}  // namespace

std::vector<std::string> find_hazards(const ResolvedGraph& graph, const Order& order, std::span<const MemoryNeed> needs,
                                      const Placement& placement, const BarrierPlan& plan,
                                      std::span<const ResourceIndex> wanted, std::uint32_t frames,
                                      std::uint32_t iterations) {
  return Player(graph, order, needs, placement, plan, wanted).play(frames, iterations);
}

std::vector<std::string> find_needless_barriers(const ResolvedGraph& graph, const Order& order,
                                                std::span<const MemoryNeed> needs, const Placement& placement,
                                                const BarrierPlan& plan, std::span<const ResourceIndex> wanted) {
  const auto is_proven = [&](const BarrierPlan& tried) {
    for (const std::uint32_t iterations : {1U, 2U, 3U}) {
      if (!find_hazards(graph, order, needs, placement, tried, wanted, 3, iterations).empty()) return false;
      if (order.loops.empty()) break;
    }
    return true;
  };
  std::vector<std::string> needless;
  BarrierPlan poorer = plan;
  const auto try_without = [&](std::vector<Barrier>& list, const std::string& where) {
    for (std::size_t b = 0; b < list.size(); ++b) {
      const Barrier removed = list[b];
      list.erase(list.begin() + static_cast<std::ptrdiff_t>(b));
      if (is_proven(poorer)) needless.push_back(where + ": '" + graph.resources[removed.resource].name + "'");
      list.insert(list.begin() + static_cast<std::ptrdiff_t>(b), removed);
    }
  };
  for (std::size_t s = 0; s < plan.before.size(); ++s)
    try_without(poorer.before[s], "before stage " + std::to_string(s));
  for (std::size_t s = 0; s < plan.again.size(); ++s)
    try_without(poorer.again[s], "again before stage " + std::to_string(s));
  try_without(poorer.at_end, "at the end");
  return needless;
}

}  // namespace heddle::graph::test_support
