// SPDX-License-Identifier: Apache-2.0
// Memory that a frame's commands use until its fence: one of it where every frame is waited for, several in live mode,
// where frames run while the next ones are recorded.

#include "graph/execute_state.hpp"

#include <algorithm>

namespace heddle::graph {

namespace {

constexpr VkAccessFlags2 kAnything = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;

}  // namespace

FrameMemory Executor::State::make_frame_memory() const {
  const heddle_vulkan& vk = device->table();
  FrameMemory memory;
  VkCommandPoolCreateInfo pool{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO};
  pool.queueFamilyIndex = device->queue_family();
  pool.flags = VK_COMMAND_POOL_CREATE_TRANSIENT_BIT;
  vulkan::check(vk.CreateCommandPool(vk.device, &pool, nullptr, &memory.command_pool), "vkCreateCommandPool");
  const VkFenceCreateInfo fence_info{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
  vulkan::check(vk.CreateFence(vk.device, &fence_info, nullptr, &memory.fence), "vkCreateFence");
  return memory;
}

void Executor::State::destroy_frame_memory(FrameMemory& memory) const {
  const heddle_vulkan& vk = device->table();
  for (VkDescriptorPool pool : memory.descriptor_pools) vk.DestroyDescriptorPool(vk.device, pool, nullptr);
  vk.DestroyCommandPool(vk.device, memory.command_pool, nullptr);
  vk.DestroyFence(vk.device, memory.fence, nullptr);
  memory = {};
}

bool Executor::State::is_done(const FrameMemory& memory) const {
  const heddle_vulkan& vk = device->table();
  const VkResult status = vk.GetFenceStatus(vk.device, memory.fence);
  if (status != VK_NOT_READY) vulkan::check(status, "vkGetFenceStatus");
  return status == VK_SUCCESS;
}

/// A frame of this graph; those that are not in flight are done.
bool Executor::State::is_done(std::uint64_t frame_of_copy) const {
  for (const FrameMemory& memory : in_flight)
    if (memory.submitted_frame == frame_of_copy) return is_done(memory);
  return true;
}

/// The device is done with it.
void Executor::State::end_frame(FrameMemory& memory) {
  const heddle_vulkan& vk = device->table();
  (void)vk.ResetFences(vk.device, 1, &memory.fence);  // fails only for want of memory, and this runs in destructors
  memory.frame_buffers.clear();
}

/// Ends frames that are done; waits for the oldest where more than `most_left` would be left.
void Executor::State::end_finished_frames(std::size_t most_left) {
  while (!in_flight.empty()) {
    if (!is_done(in_flight.front())) {
      if (in_flight.size() <= most_left) return;
      wait_for(in_flight.front().fence);
    }
    FrameMemory memory = std::move(in_flight.front());
    in_flight.pop_front();
    end_frame(memory);
    const std::vector<ResourceIndex> counted = memory.count_slots;
    spare.push_back(std::move(memory));
    if (!counted.empty()) tell_counts(spare.back());
  }
}

void Executor::State::wait_for_frames() {
  end_finished_frames(0);
}

/// Memory for the frame that begins. With one frame at a time it is always the same.
void Executor::State::take_frame_memory() {
  if (!services.is_live) return;
  // A list that is filled on from frame to frame begins with what the host knows of the last one.
  const bool has_such_lists = std::ranges::any_of(lists.goes_on, [](bool goes_on) { return goes_on; });
  end_finished_frames(has_such_lists ? 0 : kFramesInFlight - 1);
  if (command_pool != VK_NULL_HANDLE) return;  // the last frame submitted nothing
  if (spare.empty()) {
    static_cast<FrameMemory&>(*this) = make_frame_memory();
  } else {
    static_cast<FrameMemory&>(*this) = std::move(spare.back());
    spare.pop_back();
  }
}

/// What frames that may still run read and write comes before what this frame does.
void Executor::State::order_after_frames_in_flight() {
  if (in_flight.empty()) return;
  barrier_between(device->table(), commands, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, kAnything,
                  VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, kAnything);
}

/// A copy at this point of the frame's commands. What this frame recorded before and frames in flight see the old
/// bytes.
void Executor::State::upload_in_frame(const vulkan::Buffer& target, std::uint64_t offset,
                                      std::span<const std::byte> bytes) {
  if (bytes.empty()) return;
  const heddle_vulkan& vk = device->table();
  vulkan::Buffer staging = device->make_buffer(bytes.size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT, true);
  std::copy(bytes.begin(), bytes.end(), staging.data());
  device->note_host_write(staging);
  barrier_between(vk, commands, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, kAnything, VK_PIPELINE_STAGE_2_COPY_BIT,
                  VK_ACCESS_2_TRANSFER_WRITE_BIT);
  const VkBufferCopy region{0, offset, bytes.size()};
  vk.CmdCopyBuffer(commands, staging.handle(), target.handle(), 1, &region);
  barrier_between(vk, commands, VK_PIPELINE_STAGE_2_COPY_BIT, VK_ACCESS_2_TRANSFER_WRITE_BIT,
                  VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, kAnything);
  device->count_upload(bytes.size());
  frame_buffers.push_back(std::move(staging));
}

}  // namespace heddle::graph
