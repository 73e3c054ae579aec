// SPDX-License-Identifier: Apache-2.0
// What a frame finds of the frames before: histories change places with what is newest, or are neutral after a cut.

#include "graph/execute_state.hpp"

#include <algorithm>
#include <cstring>

namespace heddle::graph {

namespace {

bool is_image_or_buffer(const Resource& resource) {
  return resource.type == PortType::kImage || resource.type == PortType::kBuffer;
}

VkImageAspectFlags aspect_of(std::uint32_t format) {
  return vulkan::format_info(static_cast<VkFormat>(format)).is_depth ? VK_IMAGE_ASPECT_DEPTH_BIT
                                                                     : VK_IMAGE_ASPECT_COLOR_BIT;
}

/// Before the frame's own commands and after everything of the last frame, or the other way round: these few commands
/// are not in the plan, so they are ordered against everything.
Barrier full_barrier(ResourceIndex resource, VkImageLayout from, VkImageLayout to) {
  Barrier barrier;
  barrier.resource = resource;
  barrier.source_stages = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
  barrier.source_access = VK_ACCESS_2_MEMORY_WRITE_BIT;
  barrier.target_stages = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
  barrier.target_access = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
  barrier.old_layout = from;
  barrier.new_layout = to;
  return barrier;
}

}  // namespace

/// Copies last frame's contents to where this frame's are made. Both keep their layouts.
void Executor::State::carry_over(ResourceIndex newest, ResourceIndex history) {
  ResourceState& to = resources[newest];
  const ResourceState& from = resources[history];
  const Resource& shape = graph.resources[newest];
  const VkImageLayout to_layout = to.layout;
  const VkImageLayout from_layout = from.layout;
  const heddle_vulkan& vk = device->table();
  const std::array begin{full_barrier(newest, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL),
                         full_barrier(history, from_layout, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL)};
  record_barriers(begin);
  if (to.image) {
    std::vector<VkImageCopy> regions;
    for (std::uint32_t mip = 0; mip < to.image.shape().mips; ++mip) {
      VkImageCopy region{};
      region.srcSubresource = {aspect_of(shape.format), mip, 0, to.image.shape().layers};
      region.dstSubresource = region.srcSubresource;
      region.extent = {std::max(shape.width >> mip, 1U), std::max(shape.height >> mip, 1U), 1};
      regions.push_back(region);
    }
    vk.CmdCopyImage(commands, from.image.handle(), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, to.image.handle(),
                    VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, static_cast<std::uint32_t>(regions.size()), regions.data());
  } else {
    const VkBufferCopy region{0, 0, to.buffer.size()};
    vk.CmdCopyBuffer(commands, from.buffer.handle(), to.buffer.handle(), 1, &region);
  }
  const std::array end{full_barrier(newest, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, to_layout),
                       full_barrier(history, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, from_layout)};
  record_barriers(end);
}

/// The neutral value of the role that made it: for images; buffers hold zero bytes, values nothing.
void Executor::State::clear_history(ResourceIndex index) {
  const Resource& history = graph.resources[index];
  if (history.type == PortType::kValue) {
    const std::vector<std::byte> zeros(std::max<std::uint64_t>(history.byte_size, 16));
    set_value(index, zeros);  // what shaders see of an empty block
    Value& value = resources[index].value;
    value.bytes.clear();
    value.storage_range = 16;
    return;
  }
  ResourceState& state = resources[index];
  const VkImageLayout layout = state.layout;
  if (state.image) {
    const Resource& newest = graph.resources[history.history_of];
    const RolePort* port = graph.passes[newest.producer].role->find_port(newest.port);
    clear_image(state, history, port != nullptr ? port->neutral : std::array<double, 4>{0, 0, 0, 0});
    record_barriers(std::array{full_barrier(index, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, layout)});
  } else if (state.buffer) {
    record_barriers(std::array{full_barrier(index, layout, layout)});
    device->table().CmdFillBuffer(commands, state.buffer.handle(), 0, VK_WHOLE_SIZE, 0);
    record_barriers(std::array{full_barrier(index, layout, layout)});
  }
}

/// At a frame's start. What a technique keeps must still be where it made it, history or not: it is copied back unless
/// the technique says that it writes all of it anyway.
void Executor::State::turn_histories() {
  for (ResourceIndex i = 0; i < graph.resources.size(); ++i) {
    const Resource& history = graph.resources[i];
    if (history.history_of == kNoIndex) continue;
    ResourceState& old = resources[i];
    if (history.type == PortType::kValue) {
      if (info.cut == 0 && resources[history.history_of].value.is_set) {
        set_value(i, std::vector(resources[history.history_of].value.bytes));
      } else {
        clear_history(i);
      }
      continue;
    }
    if (!old.image && !old.buffer) continue;
    if (is_fresh) continue;  // both hold neutral contents
    const ResourceIndex newest = resources[history.history_of].root;
    std::swap(resources[newest].image, old.image);
    std::swap(resources[newest].buffer, old.buffer);
    std::swap(resources[newest].layout, old.layout);
    if ((graph.resources[newest].flags & HEDDLE_PORT_REWRITTEN) == 0) carry_over(newest, i);
    if (info.cut != 0) clear_history(i);
  }
}

/// A stage that answered HEDDLE_KEEP wrote nothing into the memory that took its turn.
void Executor::State::keep_outputs(const ScheduledStage& stage) {
  if (is_fresh) return;
  for (const ScheduledStage::Use& use : stage.uses) {
    const ResourceIndex newest = resources[use.resource].root;
    if (!use.writes || !is_image_or_buffer(graph.resources[newest])) continue;
    if ((graph.resources[newest].flags & HEDDLE_PORT_REWRITTEN) == 0) continue;  // carried over when the frame began
    for (ResourceIndex i = 0; i < graph.resources.size(); ++i) {
      const ResourceIndex of = graph.resources[i].history_of;
      const bool is_turned = resources[i].image || resources[i].buffer;
      if (of != kNoIndex && resources[of].root == newest && is_turned) carry_over(newest, i);
    }
  }
}

}  // namespace heddle::graph
