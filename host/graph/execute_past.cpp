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

}  // namespace

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

void barrier_between(const heddle_vulkan& vk, VkCommandBuffer commands, VkPipelineStageFlags2 from,
                     VkAccessFlags2 written, VkPipelineStageFlags2 to, VkAccessFlags2 access) {
  VkMemoryBarrier2 memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2};
  memory.srcStageMask = from;
  memory.srcAccessMask = written;
  memory.dstStageMask = to;
  memory.dstAccessMask = access;
  VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
  dependency.memoryBarrierCount = 1;
  dependency.pMemoryBarriers = &memory;
  vk.CmdPipelineBarrier2(commands, &dependency);
}

void show_copies_to_host(const heddle_vulkan& vk, VkCommandBuffer commands) {
  barrier_between(vk, commands, VK_PIPELINE_STAGE_2_COPY_BIT, VK_ACCESS_2_TRANSFER_WRITE_BIT,
                  VK_PIPELINE_STAGE_2_HOST_BIT, VK_ACCESS_2_HOST_READ_BIT);
}

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
    set_value(index, {});
    resources[index].value.block_bytes = std::max<std::uint64_t>(history.byte_size, 16);
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
  if (info.cut != 0) {
    for (ReadBackRing& ring : rings)
      for (ReadBackRing::Copy& copy : ring.copies) copy.frame = HEDDLE_NO_FRAME;
  }
  for (ResourceIndex i = 0; i < graph.resources.size(); ++i) {
    const Resource& history = graph.resources[i];
    if (history.history_of == kNoIndex) continue;
    ResourceState& old = resources[i];
    if (history.type == PortType::kValue) {
      if (is_continuing) continue;
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
    if (is_continuing) {
      // No time has passed: nobody changes places, but the plan expects the layouts of two who did.
      for (const ResourceIndex r : {newest, i}) {
        record_barriers(std::array{full_barrier(r, resources[r].layout, barriers.first_layout[r])});
      }
      continue;
    }
    std::swap(resources[newest].image, old.image);
    std::swap(resources[newest].buffer, old.buffer);
    std::swap(resources[newest].layout, old.layout);
    if ((graph.resources[newest].flags & HEDDLE_PORT_REWRITTEN) == 0) carry_over(newest, i);
    if (info.cut != 0) clear_history(i);
  }
}

std::uint64_t Executor::State::host_bytes(ResourceIndex index) const {
  const ResourceState& state = resources[resources[index].root];
  const Resource& resource = graph.resources[resources[index].root];
  return state.image ? bytes_of(all_mips(resource), resource) : state.buffer.size();
}

/// An image or a buffer as it is at this point of the commands.
void Executor::State::copy_to_host(ResourceIndex index, const vulkan::Buffer& buffer) {
  const heddle_vulkan& vk = device->table();
  const ResourceState& state = root(index);
  const Resource& resource = graph.resources[state.root];
  if (state.image) {
    const std::vector<VkBufferImageCopy> regions = all_mips(resource);
    vk.CmdCopyImageToBuffer(commands, state.image.handle(), state.layout, buffer.handle(),
                            static_cast<std::uint32_t>(regions.size()), regions.data());
  } else {
    const VkBufferCopy region{0, 0, host_bytes(index)};
    vk.CmdCopyBuffer(commands, state.buffer.handle(), buffer.handle(), 1, &region);
  }
  device->count_read_back(host_bytes(index));
}

/// The copies that a stage with latency will read. The frame's end waits for them, nothing within the frame does; in
/// live mode nothing does.
void Executor::State::run_read_back(const ScheduledStage& scheduled) {
  const Pass& pass = graph.passes[scheduled.pass];
  const Stage& stage = pass.entry.technique->stages[scheduled.stage];
  for (const Access& access : stage.accesses) {
    const auto bound = pass.ports.find(access.port);
    if (bound == pass.ports.end() || !stage.is_late(access, graph.resources[bound->second].type)) continue;
    auto ring = std::ranges::find_if(rings, [&](const ReadBackRing& candidate) {
      return candidate.pass == scheduled.pass && candidate.stage == scheduled.stage && candidate.port == access.port;
    });
    if (ring == rings.end()) {
      rings.push_back({scheduled.pass, scheduled.stage, access.port, {}});
      ring = std::prev(rings.end());
      // Live: the newest copy that is surely there is of the frame before those in flight.
      const std::size_t reach = std::max<std::size_t>(stage.latency, services.is_live ? kFramesInFlight : 0);
      ring->copies.resize(reach + 1);
    }
    ReadBackRing::Copy& copy = ring->copies[info.index % ring->copies.size()];
    if (!copy.buffer)
      copy.buffer = device->make_buffer(host_bytes(bound->second), VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
    copy_to_host(bound->second, copy.buffer);
    copy.frame = info.index;
  }
  show_copies_to_host(device->table(), commands);
}

/// What the stage maps in this frame: the copy of `latency` frames ago, in live mode the newest before that if that one
/// is not there yet; or zeros.
heddle_frame::Mapping Executor::State::late_mapping(const ScheduledStage& scheduled, const std::string& port) {
  const Pass& pass = graph.passes[scheduled.pass];
  const std::uint64_t latency = pass.entry.technique->stages[scheduled.stage].latency;
  heddle_frame::Mapping mapping;
  mapping.port = port;
  ++stats.waits.late_reads;
  for (const ReadBackRing& ring : rings) {
    if (ring.pass != scheduled.pass || ring.stage != scheduled.stage || ring.port != port) continue;
    const ReadBackRing::Copy* newest = nullptr;
    bool is_stale = false;
    for (const ReadBackRing::Copy& copy : ring.copies) {
      if (copy.frame == HEDDLE_NO_FRAME || copy.frame + latency > info.index) continue;
      const bool is_due = copy.frame + latency == info.index;
      if (!is_done(copy.frame)) {
        is_stale = is_stale || is_due;
        continue;
      }
      if (!is_due && !services.is_live) continue;
      if (newest == nullptr || copy.frame > newest->frame) newest = &copy;
    }
    // A copy that was not due, where none is: of a frame in which the stage's inputs were not made.
    if (newest != nullptr && newest->frame + latency != info.index && !is_stale) newest = nullptr;
    stats.waits.stale_reads += is_stale ? 1 : 0;
    if (newest == nullptr) break;
    device->note_host_read(newest->buffer);
    mapping.frame = newest->frame;
    mapping.late = newest->buffer.data();
    return mapping;
  }
  mapping.zeros.resize(host_bytes(pass.ports.find(port)->second));
  mapping.late = mapping.zeros.data();
  return mapping;
}

/// A stage that answered HEDDLE_KEEP wrote nothing into the memory that took its turn.
void Executor::State::keep_outputs(const ScheduledStage& stage) {
  if (is_fresh || is_continuing) return;
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
