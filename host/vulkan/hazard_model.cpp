// SPDX-License-Identifier: Apache-2.0
// The rules of hazard_model.hpp, one function each.
#include "vulkan/hazard_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

namespace heddle::vulkan::hazard {
namespace {

using Stages = VkPipelineStageFlags2;
using Accesses = VkAccessFlags2;

constexpr Stages kVertexInput = VK_PIPELINE_STAGE_2_INDEX_INPUT_BIT | VK_PIPELINE_STAGE_2_VERTEX_ATTRIBUTE_INPUT_BIT;
constexpr Stages kPreRasterization =
    VK_PIPELINE_STAGE_2_VERTEX_SHADER_BIT | VK_PIPELINE_STAGE_2_TESSELLATION_CONTROL_SHADER_BIT |
    VK_PIPELINE_STAGE_2_TESSELLATION_EVALUATION_SHADER_BIT | VK_PIPELINE_STAGE_2_GEOMETRY_SHADER_BIT;
constexpr Stages kTransfer = VK_PIPELINE_STAGE_2_COPY_BIT | VK_PIPELINE_STAGE_2_RESOLVE_BIT |
                             VK_PIPELINE_STAGE_2_BLIT_BIT | VK_PIPELINE_STAGE_2_CLEAR_BIT;

// The stages of a draw in the order of the pipeline.
constexpr std::array<Stages, 11> kGraphicsOrder{
    VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT,
    VK_PIPELINE_STAGE_2_INDEX_INPUT_BIT,
    VK_PIPELINE_STAGE_2_VERTEX_ATTRIBUTE_INPUT_BIT,
    VK_PIPELINE_STAGE_2_VERTEX_SHADER_BIT,
    VK_PIPELINE_STAGE_2_TESSELLATION_CONTROL_SHADER_BIT,
    VK_PIPELINE_STAGE_2_TESSELLATION_EVALUATION_SHADER_BIT,
    VK_PIPELINE_STAGE_2_GEOMETRY_SHADER_BIT,
    VK_PIPELINE_STAGE_2_EARLY_FRAGMENT_TESTS_BIT,
    VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT,
    VK_PIPELINE_STAGE_2_LATE_FRAGMENT_TESTS_BIT,
    VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT,
};

constexpr Stages all_graphics() {
  Stages stages = 0;
  for (const Stages stage : kGraphicsOrder) stages |= stage;
  return stages;
}
constexpr Stages kAllCommands = all_graphics() | VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT | kTransfer;

constexpr Accesses kWrites = VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT | VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT |
                             VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT | VK_ACCESS_2_TRANSFER_WRITE_BIT |
                             VK_ACCESS_2_HOST_WRITE_BIT | VK_ACCESS_2_SHADER_WRITE_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
constexpr Accesses kReads =
    VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT | VK_ACCESS_2_INDEX_READ_BIT | VK_ACCESS_2_VERTEX_ATTRIBUTE_READ_BIT |
    VK_ACCESS_2_UNIFORM_READ_BIT | VK_ACCESS_2_INPUT_ATTACHMENT_READ_BIT | VK_ACCESS_2_SHADER_SAMPLED_READ_BIT |
    VK_ACCESS_2_SHADER_STORAGE_READ_BIT | VK_ACCESS_2_COLOR_ATTACHMENT_READ_BIT |
    VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT | VK_ACCESS_2_TRANSFER_READ_BIT | VK_ACCESS_2_HOST_READ_BIT;

/// Every stage that a mask names, groups opened. `is_target`: TOP_OF_PIPE and BOTTOM_OF_PIPE mean the opposite as
/// source.
Stages open_groups(Stages mask, bool is_target) {
  Stages stages = mask;
  const auto open = [&](Stages group, Stages members) {
    if ((mask & group) != 0) stages = (stages & ~group) | members;
  };
  open(VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, kAllCommands);
  open(VK_PIPELINE_STAGE_2_ALL_GRAPHICS_BIT, all_graphics());
  open(VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT, kTransfer);
  open(VK_PIPELINE_STAGE_2_VERTEX_INPUT_BIT, kVertexInput);
  open(VK_PIPELINE_STAGE_2_PRE_RASTERIZATION_SHADERS_BIT, kPreRasterization);
  open(VK_PIPELINE_STAGE_2_TOP_OF_PIPE_BIT, is_target ? kAllCommands : 0);
  open(VK_PIPELINE_STAGE_2_BOTTOM_OF_PIPE_BIT, is_target ? 0 : kAllCommands);
  return stages;
}

/// With the stages of a draw that come before the named ones: they are done when those are.
Stages with_earlier(Stages stages) {
  bool is_later_named = false;
  for (auto stage = kGraphicsOrder.rbegin(); stage != kGraphicsOrder.rend(); ++stage) {
    is_later_named = is_later_named || (stages & *stage) != 0;
    if (is_later_named) stages |= *stage;
  }
  if ((stages & VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT) != 0) stages |= VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT;
  return stages;
}

/// With the stages of a draw or dispatch that come after the named ones: they wait as well.
Stages with_later(Stages stages) {
  if ((stages & VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT) != 0) stages |= VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT;
  bool is_earlier_named = false;
  for (const Stages stage : kGraphicsOrder) {
    is_earlier_named = is_earlier_named || (stages & stage) != 0;
    if (is_earlier_named) stages |= stage;
  }
  return stages;
}

Accesses open_accesses(Accesses mask) {
  Accesses access = mask;
  const auto open = [&](Accesses group, Accesses members) {
    if ((mask & group) != 0) access |= members;
  };
  open(VK_ACCESS_2_MEMORY_READ_BIT, kReads);
  open(VK_ACCESS_2_MEMORY_WRITE_BIT, kWrites);
  open(VK_ACCESS_2_SHADER_READ_BIT, VK_ACCESS_2_SHADER_SAMPLED_READ_BIT | VK_ACCESS_2_SHADER_STORAGE_READ_BIT);
  open(VK_ACCESS_2_SHADER_WRITE_BIT, VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT);
  return access;
}

/// Layouts in which an image may be touched so.
bool is_legal(VkImageLayout layout, Accesses access) {
  if (layout == VK_IMAGE_LAYOUT_GENERAL) return true;
  const auto is_one_of = [&](std::initializer_list<VkImageLayout> list) {
    return std::find(list.begin(), list.end(), layout) != list.end();
  };
  const bool is_storage = (access & (VK_ACCESS_2_SHADER_STORAGE_READ_BIT | VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT)) != 0;
  if (is_storage) return false;
  if ((access & VK_ACCESS_2_SHADER_SAMPLED_READ_BIT) != 0)
    return is_one_of({VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL, VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL,
                      VK_IMAGE_LAYOUT_DEPTH_READ_ONLY_OPTIMAL, VK_IMAGE_LAYOUT_READ_ONLY_OPTIMAL});
  if ((access & (VK_ACCESS_2_COLOR_ATTACHMENT_READ_BIT | VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT)) != 0)
    return is_one_of({VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL, VK_IMAGE_LAYOUT_ATTACHMENT_OPTIMAL});
  if ((access & VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT) != 0)
    return is_one_of({VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL, VK_IMAGE_LAYOUT_DEPTH_ATTACHMENT_OPTIMAL,
                      VK_IMAGE_LAYOUT_ATTACHMENT_OPTIMAL});
  if ((access & VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT) != 0)
    return is_one_of({VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL, VK_IMAGE_LAYOUT_DEPTH_READ_ONLY_OPTIMAL,
                      VK_IMAGE_LAYOUT_READ_ONLY_OPTIMAL, VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL,
                      VK_IMAGE_LAYOUT_DEPTH_ATTACHMENT_OPTIMAL, VK_IMAGE_LAYOUT_ATTACHMENT_OPTIMAL});
  if ((access & VK_ACCESS_2_TRANSFER_WRITE_BIT) != 0) return layout == VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
  if ((access & VK_ACCESS_2_TRANSFER_READ_BIT) != 0) return layout == VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
  return true;
}

bool contains(const Range& outer, const Range& inner, bool is_image) {
  if (is_image)
    return outer.mip <= inner.mip && inner.mip + inner.mips <= outer.mip + outer.mips && outer.layer <= inner.layer &&
           inner.layer + inner.layers <= outer.layer + outer.layers;
  return outer.offset <= inner.offset && inner.offset + inner.size <= outer.offset + outer.size;
}

/// Calls `body` with the index of each subresource.
template <typename Body>
void for_subresources(const Object& object, const Range& range, Body body) {
  for (std::uint32_t layer = range.layer; layer < range.layer + range.layers; ++layer)
    for (std::uint32_t mip = range.mip; mip < range.mip + range.mips; ++mip)
      body(std::size_t{layer} * object.mips + mip);
}

std::string scope_text(Stages stages, Accesses access) {
  return fmt::format("{} ({})", stages_text(stages), access_text(access));
}

}  // namespace

bool is_write(VkAccessFlags2 access) {
  return (access & kWrites) != 0;
}

Model::State& Model::state(ObjectIndex object) {
  for (std::size_t i = states_.size(); i <= object; ++i) {
    const Object& made = stream_->objects[i];
    State fresh;
    if (made.is_image) fresh.subresources.resize(std::size_t{made.layers} * made.mips);
    states_.push_back(std::move(fresh));
    if (made.memory != 0) in_memory_[made.memory].push_back(static_cast<ObjectIndex>(i));
  }
  return states_[object];
}

Range Model::clamp(ObjectIndex object, Range range) const {
  const Object& of = stream_->objects[object];
  if (of.is_image) {
    range.layer = std::min(range.layer, of.layers);
    range.mip = std::min(range.mip, of.mips);
    range.layers = std::min(range.layers, of.layers - range.layer);
    range.mips = std::min(range.mips, of.mips - range.mip);
    return range;
  }
  range.offset = std::min(range.offset, of.size);
  range.size = std::min(range.size, of.size - range.offset);
  return range;
}

bool Model::overlaps(ObjectIndex a, const Range& range_a, ObjectIndex b, const Range& range_b) const {
  const Object& of_a = stream_->objects[a];
  const Object& of_b = stream_->objects[b];
  const auto meet = [](std::uint64_t begin, std::uint64_t size, std::uint64_t other, std::uint64_t other_size) {
    return begin < other + other_size && other < begin + size;
  };
  if (a == b && of_a.is_image)
    return meet(range_a.mip, range_a.mips, range_b.mip, range_b.mips) &&
           meet(range_a.layer, range_a.layers, range_b.layer, range_b.layers);
  if (a != b && (of_a.memory == 0 || of_a.memory != of_b.memory)) return false;
  // Where the texels of an image lie is the driver's secret: it counts as a whole.
  const auto begin = [](const Object& object, const Range& range) {
    return object.offset + (object.is_image ? 0 : range.offset);
  };
  const auto size = [](const Object& object, const Range& range) { return object.is_image ? object.size : range.size; };
  return meet(begin(of_a, range_a), size(of_a, range_a), begin(of_b, range_b), size(of_b, range_b));
}

std::vector<ObjectIndex> Model::sharers(ObjectIndex object) const {
  const Object& of = stream_->objects[object];
  std::vector<ObjectIndex> found{object};
  const auto neighbours = in_memory_.find(of.memory);
  if (of.memory == 0 || neighbours == in_memory_.end()) return found;
  for (const ObjectIndex other : neighbours->second) {
    const Object& it = stream_->objects[other];
    if (other != object && of.offset < it.offset + it.size && it.offset < of.offset + of.size) found.push_back(other);
  }
  return found;
}

std::string Model::name(ObjectIndex object) const {
  const Object& of = stream_->objects[object];
  return of.name.empty() ? fmt::format("{} {}", of.is_image ? "image" : "buffer", object) : of.name;
}

std::string Model::describe(const Past& past) const {
  const Label& label = stream_->labels[past.label];
  std::string text = past.is_transition ? "the layout transition" : std::string(past.command);
  if (!label.text.empty()) text += " of " + label.text;
  if (past.frame == frame_) return text;
  return text + (past.frame + 1 == frame_ ? " in the frame before" : " in an earlier frame");
}

void Model::complain(const Event& event, std::string what, std::string found, std::string expected, std::string help) {
  const Label& label = stream_->labels[event.label];
  Diagnostic diagnostic;
  diagnostic.where = label.where;
  diagnostic.message =
      fmt::format("{}{}{}: {}", label.text, label.text.empty() ? "" : ", ", event.command, std::move(what));
  diagnostic.found = std::move(found);
  diagnostic.expected = std::move(expected);
  diagnostic.help = std::move(help);
  // Frames repeat what is wrong: the first one tells it.
  if (!told_.insert(diagnostic.message + diagnostic.expected).second) return;
  diagnostic.message = fmt::format("frame {}, {}", frame_, diagnostic.message);
  findings_.push_back(std::move(diagnostic));
}

std::vector<Diagnostic> Model::take_findings() {
  told_.clear();
  return std::exchange(findings_, {});
}

void Model::play(const Stream& stream, std::size_t first) {
  stream_ = &stream;
  if (!stream.objects.empty()) (void)state(static_cast<ObjectIndex>(stream.objects.size() - 1));
  for (std::size_t i = first; i < stream.events.size(); ++i) {
    const Event& event = stream.events[i];
    switch (event.kind) {
      case Event::Kind::kCommand:
        for (const Touch& one : event.touches) touch(event, one);
        for (const Touch& one : event.touches) record(event, one);
        break;
      case Event::Kind::kBarrier:
        apply(event);
        break;
      case Event::Kind::kHostRead:
      case Event::Kind::kHostWrite:
        for (const Touch& one : event.touches) host(event, one);
        break;
      case Event::Kind::kDiscard:
        for (const Touch& one : event.touches) discard(one.object);
        break;
      case Event::Kind::kAccept:
        for (const Touch& one : event.touches) accept(one.object);
        break;
      case Event::Kind::kDestroy:
        for (const Touch& one : event.touches) destroy(event, one.object);
        break;
      case Event::Kind::kSubmit:
        submission_ = event.number + 1;
        break;
      case Event::Kind::kWait:
        done_ = std::max(done_, event.number);
        break;
      case Event::Kind::kFrame:
        frame_ = event.number;
        break;
    }
  }
}

// ---- barriers ----

void Model::apply(const Event& event) {
  // All dependencies of one command hold at once: each sees what was before the command, and they do not chain with
  // each other. So first everything is looked at, then everything is changed.
  struct Change {
    Past* past;
    Stages after;
    bool becomes_available;
    std::optional<Visible> visible;
  };
  std::vector<Change> changes;
  for (const Dependency& dependency : event.dependencies) {
    const Stages source = open_groups(dependency.source_stages, false);
    const Stages source_done = with_earlier(source);
    const Stages target = open_groups(dependency.target_stages, true);
    const Accesses source_access = open_accesses(dependency.source_access);
    const bool is_global = dependency.object == kEverything;
    const Range range = is_global ? Range{} : clamp(dependency.object, dependency.range);
    for (ObjectIndex object = 0; object < states_.size(); ++object) {
      for (Past& past : states_[object].past) {
        const bool is_ordered = ((past.stage | past.after) & source_done) != 0;
        const bool is_covered = is_global || overlaps(dependency.object, range, object, past.range);
        const bool is_available =
            past.is_available || ((past.stage & source) != 0 && (past.access & kWrites & ~source_access) == 0);
        if (is_covered && is_transition(dependency))
          check_transition(event, dependency, object, past, is_ordered, is_available);
        if (!is_ordered) continue;
        Change change{&past, with_later(target), false, {}};
        if (past.is_write && is_covered && is_available) {
          change.becomes_available = true;
          change.visible = Visible{target, open_accesses(dependency.target_access)};
        }
        changes.push_back(change);
      }
    }
  }
  for (const Change& change : changes) {
    change.past->after |= change.after;
    change.past->is_available = change.past->is_available || change.becomes_available;
    if (!change.visible) continue;
    // Barriers repeat from frame to frame; what is never written again must not grow with them.
    std::vector<Visible>& visible = change.past->visible;
    const auto same = std::find_if(visible.begin(), visible.end(),
                                   [&](const Visible& v) { return v.stages == change.visible->stages; });
    if (same == visible.end())
      visible.push_back(*change.visible);
    else
      same->access |= change.visible->access;
  }
  for (const Dependency& dependency : event.dependencies)
    if (is_transition(dependency)) finish_transition(event, dependency);
}

bool Model::is_transition(const Dependency& dependency) const {
  return dependency.object != kEverything && stream_->objects[dependency.object].is_image &&
         (dependency.old_layout == VK_IMAGE_LAYOUT_UNDEFINED || dependency.old_layout != dependency.new_layout);
}

void Model::check_transition(const Event& event, const Dependency& dependency, ObjectIndex object, const Past& past,
                             bool is_ordered, bool is_available) {
  const std::string missing = fmt::format("a barrier from {}", scope_text(past.stage, past.access & kWrites));
  if (!is_ordered) {
    complain(event,
             fmt::format("'{}' changes its layout while {} may still use '{}'", name(dependency.object), describe(past),
                         name(object)),
             fmt::format("a barrier from {}", stages_text(dependency.source_stages)), missing);
  } else if (past.is_write && !is_available) {
    complain(event,
             fmt::format("'{}' changes its layout before what {} wrote to '{}' is available", name(dependency.object),
                         describe(past), name(object)),
             fmt::format("a barrier from {}", scope_text(dependency.source_stages, dependency.source_access)), missing);
  }
}

void Model::finish_transition(const Event& event, const Dependency& dependency) {
  const ObjectIndex object = dependency.object;
  const Range range = clamp(object, dependency.range);
  const bool discards = dependency.old_layout == VK_IMAGE_LAYOUT_UNDEFINED;
  State& own = state(object);
  std::set<VkImageLayout> wrong;
  for_subresources(stream_->objects[object], range, [&](std::size_t i) {
    Subresource& subresource = own.subresources[i];
    if (!discards && subresource.layout != dependency.old_layout) wrong.insert(subresource.layout);
    subresource.layout = dependency.new_layout;
    subresource.is_defined = subresource.is_defined && !discards;
  });
  for (const VkImageLayout layout : wrong)
    complain(event,
             fmt::format("the barrier's old layout {} of '{}' is not what the image is in",
                         layout_text(dependency.old_layout), name(object)),
             fmt::format("{}{}", layout_text(layout),
                         own.taken_by.empty() ? "" : fmt::format(": '{}' took its bytes", own.taken_by)),
             fmt::format("a barrier from {}", layout_text(layout)));
  const Stages target = open_groups(dependency.target_stages, true);
  std::erase_if(own.past, [&](const Past& past) { return contains(range, past.range, true); });
  Past transition;
  transition.range = range;
  transition.is_write = transition.is_transition = transition.is_available = true;
  transition.after = with_later(target);
  transition.visible.push_back({target, open_accesses(dependency.target_access)});
  transition.submission = submission_;
  transition.frame = frame_;
  transition.label = event.label;
  transition.command = event.command;
  own.past.push_back(std::move(transition));
  if (discards) own.taken_by.clear();
  take_bytes(object, range);
}

// ---- commands ----

void Model::check_layout(const Event& event, const Touch& touch) {
  const Object& object = stream_->objects[touch.object];
  State& own = state(touch.object);
  const bool reads = (touch.access & ~kWrites) != 0 && !touch.discards;
  if (!object.is_image) {
    if (reads && own.is_lost)
      complain(
          event, fmt::format("'{}' is read, and its contents are undefined", name(touch.object)),
          own.taken_by.empty() ? "nobody wrote it in this frame" : fmt::format("'{}' took its bytes", own.taken_by),
          "a write before it in the same frame, or a kept buffer");
    return;
  }
  if (!is_legal(touch.layout, touch.access))
    complain(event, fmt::format("'{}' is used in a layout that does not allow it", name(touch.object)),
             fmt::format("{} for {}", layout_text(touch.layout), access_text(touch.access)), "");
  std::set<VkImageLayout> wrong;
  bool is_defined = false;  // in part: views show more than shaders read
  for_subresources(object, clamp(touch.object, touch.range), [&](std::size_t i) {
    if (own.subresources[i].layout != touch.layout) wrong.insert(own.subresources[i].layout);
    is_defined = is_defined || own.subresources[i].is_defined;
  });
  for (const VkImageLayout layout : wrong)
    complain(event, fmt::format("'{}' is not in the layout that the command names", name(touch.object)),
             fmt::format("{}{}", layout_text(layout),
                         own.taken_by.empty() ? "" : fmt::format(": '{}' took its bytes", own.taken_by)),
             fmt::format("a barrier from {} to {} for {}", layout_text(layout), layout_text(touch.layout),
                         scope_text(touch.stages, touch.access)));
  if (reads && !is_defined && wrong.empty())
    complain(event, fmt::format("'{}' is read, and its contents are undefined", name(touch.object)),
             own.taken_by.empty() ? "nothing has been written since it was UNDEFINED"
                                  : fmt::format("'{}' took its bytes", own.taken_by),
             "a write before it");
}

void Model::check_past(const Event& event, const Touch& touch, ObjectIndex object, const Past& past) {
  const bool writes = is_write(touch.access);
  if (!past.is_write && !writes) return;
  if (past.is_atomic && touch.is_atomic && object == touch.object) return;
  const std::string other = object == touch.object ? "" : fmt::format(" to '{}' on the same bytes", name(object));
  const std::string_view now = writes ? "written" : "read";
  for (Stages rest = touch.stages; rest != 0; rest &= rest - 1) {
    const Stages stage = rest & (~rest + 1);
    const std::string target = scope_text(stage, touch.access);
    const std::string missing = past.is_transition ? fmt::format("that transition's barrier to lead to {}", target)
                                                   : fmt::format("a barrier from {} to {}",
                                                                 scope_text(past.stage, past.access & kWrites), target);
    if ((past.after & stage) == 0) {
      complain(event,
               fmt::format("'{}' is {} while {}{} may still {}", name(touch.object), now, describe(past), other,
                           past.is_write ? "write" : "read"),
               past.after == 0 ? "no barrier in between"
                               : fmt::format("barriers order it before {} alone", stages_text(past.after)),
               missing);
      return;
    }
    if (!past.is_write) continue;
    if (!past.is_available) {
      complain(
          event,
          fmt::format("'{}' is {} before what {}{} wrote is available", name(touch.object), now, describe(past), other),
          "barriers in between that do not name the writing access", missing);
      return;
    }
    Accesses visible = 0;
    for (const Visible& v : past.visible)
      if ((v.stages & stage) != 0) visible |= v.access;
    if ((touch.access & ~visible) != 0) {
      complain(event,
               fmt::format("'{}' is {}, and what {}{} wrote is not visible to it", name(touch.object), now,
                           describe(past), other),
               fmt::format("in {} it is visible to {}", stages_text(stage), access_text(visible & (kReads | kWrites))),
               missing);
      return;
    }
  }
}

void Model::touch(const Event& event, const Touch& touch) {
  check_layout(event, touch);
  const Range range = clamp(touch.object, touch.range);
  for (const ObjectIndex other : sharers(touch.object))
    for (const Past& past : state(other).past)
      if (overlaps(touch.object, range, other, past.range)) check_past(event, touch, other, past);
}

void Model::record(const Event& event, const Touch& touch) {
  State& own = state(touch.object);
  const Object& object = stream_->objects[touch.object];
  const Range range = clamp(touch.object, touch.range);
  const bool writes = is_write(touch.access);
  if (writes) {
    // Whatever came before is ordered before this write, or was complained about: the write stands for all of it. Not
    // so for what the same command does: every part of it is as new.
    std::erase_if(own.past, [&](const Past& past) {
      const bool is_of_this_command = !past.is_transition && past.after == 0 && past.command == event.command &&
                                      past.label == event.label && past.frame == frame_;
      return !is_of_this_command && contains(range, past.range, object.is_image);
    });
    if (object.is_image) {
      for_subresources(object, range, [&](std::size_t i) { own.subresources[i].is_defined = true; });
    }
    own.is_lost = false;
    own.taken_by.clear();
    take_bytes(touch.object, range);
  }
  for (Stages rest = touch.stages; rest != 0; rest &= rest - 1) {
    Past past;
    past.range = range;
    past.stage = rest & (~rest + 1);
    past.access = touch.access;
    past.is_write = writes;
    past.is_atomic = touch.is_atomic;
    past.submission = submission_;
    past.frame = frame_;
    past.label = event.label;
    past.command = event.command;
    const bool is_known = std::any_of(own.past.begin(), own.past.end(), [&](const Past& known) {
      return known.after == 0 && known.stage == past.stage && known.access == past.access &&
             known.is_atomic == past.is_atomic && known.submission == past.submission &&
             contains(known.range, range, object.is_image);
    });
    if (is_known) continue;
    // Whoever waits for the newer of two reads waits for the older one too.
    std::erase_if(own.past, [&](const Past& older) {
      return !writes && !older.is_write && older.stage == past.stage && contains(range, older.range, object.is_image);
    });
    own.past.push_back(std::move(past));
  }
}

/// Other resources on these bytes hold nothing any more.
void Model::take_bytes(ObjectIndex writer, const Range& range) {
  for (const ObjectIndex other : sharers(writer)) {
    if (other == writer || !overlaps(writer, range, other, clamp(other, {}))) continue;
    State& victim = state(other);
    for (Subresource& subresource : victim.subresources) subresource = {};
    victim.is_lost = true;
    victim.taken_by = name(writer);
  }
}

// ---- the host ----

void Model::host(const Event& event, const Touch& touch) {
  const bool writes = event.kind == Event::Kind::kHostWrite;
  const Range range = clamp(touch.object, touch.range);
  State& own = state(touch.object);
  for (const ObjectIndex other : sharers(touch.object)) {
    for (const Past& past : state(other).past) {
      if (!overlaps(touch.object, range, other, past.range) || (!past.is_write && !writes)) continue;
      if (past.submission > done_) {
        complain(event,
                 fmt::format("the host {} '{}' while {} may still use it", writes ? "writes" : "reads",
                             name(touch.object), describe(past)),
                 "a submission that nobody has waited for", "a wait for its fence");
        continue;
      }
      if (writes) continue;
      const bool is_visible = std::any_of(past.visible.begin(), past.visible.end(), [](const Visible& v) {
        return (v.stages & VK_PIPELINE_STAGE_2_HOST_BIT) != 0 && (v.access & VK_ACCESS_2_HOST_READ_BIT) != 0;
      });
      if (!is_visible)
        complain(event,
                 fmt::format("the host reads '{}', and what {} wrote is not visible to it", name(touch.object),
                             describe(past)),
                 "a wait for the fence alone makes it available, not visible to the host",
                 fmt::format("a barrier from {} to HOST (HOST_READ)", scope_text(past.stage, past.access & kWrites)));
    }
  }
  if (!writes) return;
  // A submission makes what the host wrote visible to all of its commands.
  std::erase_if(own.past, [&](const Past& past) { return contains(range, past.range, false); });
  own.is_lost = false;
  own.taken_by.clear();
}

void Model::accept(ObjectIndex object) {
  State& own = state(object);
  for (Subresource& subresource : own.subresources) subresource.is_defined = true;
  own.is_lost = false;
  own.taken_by.clear();
}

void Model::discard(ObjectIndex object) {
  State& own = state(object);
  for (Subresource& subresource : own.subresources) subresource.is_defined = false;
  own.is_lost = true;
  own.taken_by.clear();
}

void Model::destroy(const Event& event, ObjectIndex object) {
  State& own = state(object);
  for (const Past& past : own.past)
    if (past.submission > done_)
      complain(event, fmt::format("'{}' is destroyed while {} may still use it", name(object), describe(past)),
               "a submission that nobody has waited for", "a wait for its fence");
  own = {};
  const auto neighbours = in_memory_.find(stream_->objects[object].memory);
  if (neighbours != in_memory_.end()) std::erase(neighbours->second, object);
}

}  // namespace heddle::vulkan::hazard
