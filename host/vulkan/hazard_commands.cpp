// SPDX-License-Identifier: Apache-2.0
// What each command touches: its own arguments, and through pipelines, descriptor sets and attachments.
#include "vulkan/hazard_recorder.hpp"

#include <algorithm>

namespace heddle::vulkan::hazard {
namespace {

Range bytes(VkDeviceSize offset, VkDeviceSize size) {
  Range range;
  range.offset = offset;
  range.size = size;
  return range;
}

Range subresources(const VkImageSubresourceRange& range) {
  return {0, kWhole, range.baseMipLevel, range.levelCount, range.baseArrayLayer, range.layerCount};
}

Range subresources(const VkImageSubresourceLayers& layers) {
  return {0, kWhole, layers.mipLevel, 1, layers.baseArrayLayer, layers.layerCount};
}

bool is_dynamic(VkDescriptorType type) {
  return type == VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC || type == VK_DESCRIPTOR_TYPE_STORAGE_BUFFER_DYNAMIC;
}

VkAccessFlags2 access_of(VkDescriptorType type, const shader::BoundVariable& variable) {
  switch (type) {
    case VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER:
    case VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE:
    case VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER:
      return VK_ACCESS_2_SHADER_SAMPLED_READ_BIT;
    case VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER:
    case VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC:
      return VK_ACCESS_2_UNIFORM_READ_BIT;
    case VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT:
      return VK_ACCESS_2_INPUT_ATTACHMENT_READ_BIT;
    default:
      return (variable.reads ? VK_ACCESS_2_SHADER_STORAGE_READ_BIT : 0) |
             (variable.writes ? VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT : 0);
  }
}

std::size_t index_of(VkPipelineBindPoint point) {
  return point == VK_PIPELINE_BIND_POINT_COMPUTE ? 1 : 0;
}

}  // namespace

Event& Recorder::event(VkCommandBuffer commands, const char* command, Event::Kind kind) {
  Event made;
  made.kind = kind;
  made.label = label_;
  made.command = command;
  return commands_[commands].events.emplace_back(std::move(made));
}

void Recorder::touch(Event& event, VkBuffer buffer, const Range& range, VkPipelineStageFlags2 stages,
                     VkAccessFlags2 access) {
  const auto found = buffers_.find(buffer);
  if (found == buffers_.end()) return;
  Touch made;
  made.object = found->second;
  made.range = range;
  made.stages = stages;
  made.access = access;
  event.touches.push_back(made);
}

void Recorder::touch(Event& event, VkImage image, const Range& range, VkPipelineStageFlags2 stages,
                     VkAccessFlags2 access, VkImageLayout layout) {
  const auto found = images_.find(image);
  if (found == images_.end()) return;
  Touch made;
  made.object = found->second;
  made.range = range;
  made.stages = stages;
  made.access = access;
  made.layout = layout;
  event.touches.push_back(made);
}

// ---- state ----

void Recorder::BeginCommandBuffer(VkCommandBuffer commands, const VkCommandBufferBeginInfo*) {
  const std::scoped_lock lock(mutex_);
  commands_[commands] = {};
}

void Recorder::CmdBindPipeline(VkCommandBuffer commands, VkPipelineBindPoint point, VkPipeline pipeline) {
  const std::scoped_lock lock(mutex_);
  commands_[commands].pipelines.at(index_of(point)) = pipeline;
}

void Recorder::CmdBindDescriptorSets(VkCommandBuffer commands, VkPipelineBindPoint point, VkPipelineLayout,
                                     std::uint32_t first, std::uint32_t count, const VkDescriptorSet* sets,
                                     std::uint32_t offset_count, const std::uint32_t* offsets) {
  const std::scoped_lock lock(mutex_);
  auto& bound = commands_[commands].sets.at(index_of(point));
  std::uint32_t next = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    BoundSet made{sets[i], {}};
    if (const auto set = sets_.find(sets[i]); set != sets_.end()) {
      for (const auto& [number, binding] : set->second.layout.bindings) {
        if (!is_dynamic(binding.descriptorType)) continue;
        for (std::uint32_t d = 0; d < binding.descriptorCount && next < offset_count; ++d)
          made.offsets.push_back(offsets[next++]);
      }
    }
    bound[first + i] = std::move(made);
  }
}

void Recorder::CmdBindVertexBuffers(VkCommandBuffer commands, std::uint32_t first, std::uint32_t count,
                                    const VkBuffer* buffers, const VkDeviceSize* offsets) {
  const std::scoped_lock lock(mutex_);
  for (std::uint32_t i = 0; i < count; ++i) commands_[commands].vertex_buffers[first + i] = {buffers[i], offsets[i]};
}

void Recorder::CmdBindIndexBuffer(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset, VkIndexType) {
  const std::scoped_lock lock(mutex_);
  commands_[commands].index_buffer = {buffer, offset};
}

// ---- dispatches and draws ----

void Recorder::touch_variable(Event& event, const shader::BoundVariable& variable, const Set& set,
                              const std::vector<std::uint32_t>& offsets, VkPipelineStageFlags2 stage) {
  const auto binding = set.bindings.find(variable.binding);
  if (binding == set.bindings.end()) return;
  // Dynamic offsets are counted over the set's dynamic bindings in their order.
  std::size_t dynamic = 0;
  for (const auto& [number, layout] : set.layout.bindings)
    if (number < variable.binding && is_dynamic(layout.descriptorType)) dynamic += layout.descriptorCount;
  for (const Descriptor& descriptor : binding->second) {
    Range range = descriptor.range;
    if (is_dynamic(descriptor.type)) {
      if (dynamic < offsets.size()) range.offset += offsets[dynamic];
      ++dynamic;
    }
    if (!descriptor.object) continue;
    Touch touch;
    touch.object = *descriptor.object;
    touch.range = range;
    touch.stages = stage;
    touch.access = access_of(descriptor.type, variable);
    touch.layout = descriptor.layout;
    touch.is_atomic = variable.is_atomic;
    event.touches.push_back(touch);
  }
}

void Recorder::touch_bound(Event& event, Commands& state, VkPipelineBindPoint point) {
  const auto pipeline = pipelines_.find(state.pipelines.at(index_of(point)));
  if (pipeline == pipelines_.end()) return;
  const auto& bound = state.sets.at(index_of(point));
  for (const PipelineStage& stage : pipeline->second.stages) {
    for (const shader::BoundVariable& variable : stage.variables) {
      const auto set = bound.find(variable.set);
      if (set == bound.end()) continue;
      const auto contents = sets_.find(set->second.set);
      if (contents == sets_.end()) continue;
      touch_variable(event, variable, contents->second, set->second.offsets, stage.stage);
    }
  }
}

void Recorder::touch_vertices(Event& event, Commands& state, bool is_indexed) {
  touch_bound(event, state, VK_PIPELINE_BIND_POINT_GRAPHICS);
  if (is_indexed)
    touch(event, state.index_buffer.buffer, bytes(state.index_buffer.offset, kWhole),
          VK_PIPELINE_STAGE_2_INDEX_INPUT_BIT, VK_ACCESS_2_INDEX_READ_BIT);
  const auto pipeline = pipelines_.find(state.pipelines[0]);
  if (pipeline == pipelines_.end()) return;
  for (const std::uint32_t binding : pipeline->second.vertex_bindings)
    if (const auto bound = state.vertex_buffers.find(binding); bound != state.vertex_buffers.end())
      touch(event, bound->second.buffer, bytes(bound->second.offset, kWhole),
            VK_PIPELINE_STAGE_2_VERTEX_ATTRIBUTE_INPUT_BIT, VK_ACCESS_2_VERTEX_ATTRIBUTE_READ_BIT);
}

void Recorder::CmdDispatch(VkCommandBuffer commands, std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_ || x == 0 || y == 0 || z == 0) return;
  touch_bound(event(commands, "vkCmdDispatch"), commands_[commands], VK_PIPELINE_BIND_POINT_COMPUTE);
}

void Recorder::CmdDispatchIndirect(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_) return;
  Event& made = event(commands, "vkCmdDispatchIndirect");
  touch(made, buffer, bytes(offset, sizeof(VkDispatchIndirectCommand)), VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT,
        VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT);
  touch_bound(made, commands_[commands], VK_PIPELINE_BIND_POINT_COMPUTE);
}

void Recorder::CmdDraw(VkCommandBuffer commands, std::uint32_t vertices, std::uint32_t instances, std::uint32_t,
                       std::uint32_t) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_ || vertices == 0 || instances == 0) return;
  touch_vertices(event(commands, "vkCmdDraw"), commands_[commands], false);
}

void Recorder::CmdDrawIndexed(VkCommandBuffer commands, std::uint32_t indices, std::uint32_t instances, std::uint32_t,
                              std::int32_t, std::uint32_t) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_ || indices == 0 || instances == 0) return;
  touch_vertices(event(commands, "vkCmdDrawIndexed"), commands_[commands], true);
}

void Recorder::draw_indirect(VkCommandBuffer commands, const char* command, VkBuffer buffer, VkDeviceSize offset,
                             std::uint32_t count, std::uint32_t stride, bool is_indexed, VkBuffer count_buffer,
                             VkDeviceSize count_offset) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_ || count == 0) return;
  Event& made = event(commands, command);
  const VkDeviceSize one = is_indexed ? sizeof(VkDrawIndexedIndirectCommand) : sizeof(VkDrawIndirectCommand);
  touch(made, buffer, bytes(offset, VkDeviceSize{count - 1} * stride + one), VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT,
        VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT);
  if (count_buffer != VK_NULL_HANDLE)
    touch(made, count_buffer, bytes(count_offset, sizeof(std::uint32_t)), VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT,
          VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT);
  touch_vertices(made, commands_[commands], is_indexed);
}

void Recorder::CmdDrawIndirect(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset, std::uint32_t count,
                               std::uint32_t stride) {
  draw_indirect(commands, "vkCmdDrawIndirect", buffer, offset, count, stride, false, VK_NULL_HANDLE, 0);
}

void Recorder::CmdDrawIndexedIndirect(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset,
                                      std::uint32_t count, std::uint32_t stride) {
  draw_indirect(commands, "vkCmdDrawIndexedIndirect", buffer, offset, count, stride, true, VK_NULL_HANDLE, 0);
}

void Recorder::CmdDrawIndirectCount(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset,
                                    VkBuffer count_buffer, VkDeviceSize count_offset, std::uint32_t most,
                                    std::uint32_t stride) {
  draw_indirect(commands, "vkCmdDrawIndirectCount", buffer, offset, most, stride, false, count_buffer, count_offset);
}

void Recorder::CmdDrawIndexedIndirectCount(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset,
                                           VkBuffer count_buffer, VkDeviceSize count_offset, std::uint32_t most,
                                           std::uint32_t stride) {
  draw_indirect(commands, "vkCmdDrawIndexedIndirectCount", buffer, offset, most, stride, true, count_buffer,
                count_offset);
}

// ---- attachments ----

// The whole rendering is one touch of each attachment: inside it the device keeps the order of draws by itself.
void Recorder::touch_attachment(Event& event, const VkRenderingAttachmentInfo& attachment, bool is_depth) {
  const auto view = views_.find(attachment.imageView);
  if (view == views_.end()) return;
  Touch made;
  made.object = view->second.object;
  made.range = view->second.range;
  made.layout = attachment.imageLayout;
  made.discards = attachment.loadOp != VK_ATTACHMENT_LOAD_OP_LOAD;
  const bool is_read_only = made.layout == VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL ||
                            made.layout == VK_IMAGE_LAYOUT_DEPTH_READ_ONLY_OPTIMAL ||
                            made.layout == VK_IMAGE_LAYOUT_READ_ONLY_OPTIMAL;
  const bool writes = !is_read_only && (made.discards || attachment.storeOp != VK_ATTACHMENT_STORE_OP_NONE);
  if (is_depth) {
    made.stages = VK_PIPELINE_STAGE_2_EARLY_FRAGMENT_TESTS_BIT | VK_PIPELINE_STAGE_2_LATE_FRAGMENT_TESTS_BIT;
    made.access =
        VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT | (writes ? VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT : 0);
  } else {
    made.stages = VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT;
    made.access = (made.discards ? 0 : VK_ACCESS_2_COLOR_ATTACHMENT_READ_BIT) |
                  (writes ? VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT : 0);
  }
  event.touches.push_back(made);
  const auto resolve = views_.find(attachment.resolveImageView);
  if (attachment.resolveMode == VK_RESOLVE_MODE_NONE || resolve == views_.end()) return;
  made.object = resolve->second.object;
  made.range = resolve->second.range;
  made.layout = attachment.resolveImageLayout;
  made.stages = VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT;
  made.access = VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT;
  made.discards = true;
  event.touches.push_back(made);
}

void Recorder::CmdBeginRendering(VkCommandBuffer commands, const VkRenderingInfo* info) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_) return;
  Event& made = event(commands, "vkCmdBeginRendering");
  for (const VkRenderingAttachmentInfo& color : std::span(info->pColorAttachments, info->colorAttachmentCount))
    touch_attachment(made, color, false);
  if (info->pDepthAttachment != nullptr) touch_attachment(made, *info->pDepthAttachment, true);
}

// ---- barriers ----

void Recorder::CmdPipelineBarrier2(VkCommandBuffer commands, const VkDependencyInfo* info) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_) return;
  Event& made = event(commands, "vkCmdPipelineBarrier2", Event::Kind::kBarrier);
  const auto scopes = [](const auto& barrier) {
    Dependency dependency;
    dependency.source_stages = barrier.srcStageMask;
    dependency.source_access = barrier.srcAccessMask;
    dependency.target_stages = barrier.dstStageMask;
    dependency.target_access = barrier.dstAccessMask;
    return dependency;
  };
  for (const VkMemoryBarrier2& barrier : std::span(info->pMemoryBarriers, info->memoryBarrierCount))
    made.dependencies.push_back(scopes(barrier));
  for (const VkBufferMemoryBarrier2& barrier : std::span(info->pBufferMemoryBarriers, info->bufferMemoryBarrierCount)) {
    const auto buffer = buffers_.find(barrier.buffer);
    if (buffer == buffers_.end()) continue;
    Dependency dependency = scopes(barrier);
    dependency.object = buffer->second;
    dependency.range = bytes(barrier.offset, barrier.size);
    made.dependencies.push_back(dependency);
  }
  for (const VkImageMemoryBarrier2& barrier : std::span(info->pImageMemoryBarriers, info->imageMemoryBarrierCount)) {
    const auto image = images_.find(barrier.image);
    if (image == images_.end()) continue;
    Dependency dependency = scopes(barrier);
    dependency.object = image->second;
    dependency.range = subresources(barrier.subresourceRange);
    dependency.old_layout = barrier.oldLayout;
    dependency.new_layout = barrier.newLayout;
    made.dependencies.push_back(dependency);
  }
}

// ---- transfers ----

VkDeviceSize Recorder::bytes_of(const VkBufferImageCopy& region, VkImage image) const {
  const auto found = images_.find(image);
  const VkDeviceSize texel = found == images_.end() ? 0 : stream_.objects[found->second].texel_bytes;
  if (texel == 0) return kWhole;
  const VkDeviceSize row = std::max(region.bufferRowLength, region.imageExtent.width);
  const VkDeviceSize rows = std::max(region.bufferImageHeight, region.imageExtent.height);
  return texel * row * rows * region.imageExtent.depth * region.imageSubresource.layerCount;
}

void Recorder::CmdCopyBuffer(VkCommandBuffer commands, VkBuffer source, VkBuffer target, std::uint32_t count,
                             const VkBufferCopy* regions) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_) return;
  Event& made = event(commands, "vkCmdCopyBuffer");
  for (const VkBufferCopy& region : std::span(regions, count)) {
    touch(made, source, bytes(region.srcOffset, region.size), VK_PIPELINE_STAGE_2_COPY_BIT,
          VK_ACCESS_2_TRANSFER_READ_BIT);
    touch(made, target, bytes(region.dstOffset, region.size), VK_PIPELINE_STAGE_2_COPY_BIT,
          VK_ACCESS_2_TRANSFER_WRITE_BIT);
  }
}

void Recorder::CmdCopyImage(VkCommandBuffer commands, VkImage source, VkImageLayout source_layout, VkImage target,
                            VkImageLayout target_layout, std::uint32_t count, const VkImageCopy* regions) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_) return;
  Event& made = event(commands, "vkCmdCopyImage");
  for (const VkImageCopy& region : std::span(regions, count)) {
    touch(made, source, subresources(region.srcSubresource), VK_PIPELINE_STAGE_2_COPY_BIT,
          VK_ACCESS_2_TRANSFER_READ_BIT, source_layout);
    touch(made, target, subresources(region.dstSubresource), VK_PIPELINE_STAGE_2_COPY_BIT,
          VK_ACCESS_2_TRANSFER_WRITE_BIT, target_layout);
  }
}

void Recorder::CmdCopyBufferToImage(VkCommandBuffer commands, VkBuffer source, VkImage target, VkImageLayout layout,
                                    std::uint32_t count, const VkBufferImageCopy* regions) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_) return;
  Event& made = event(commands, "vkCmdCopyBufferToImage");
  for (const VkBufferImageCopy& region : std::span(regions, count)) {
    touch(made, source, bytes(region.bufferOffset, bytes_of(region, target)), VK_PIPELINE_STAGE_2_COPY_BIT,
          VK_ACCESS_2_TRANSFER_READ_BIT);
    touch(made, target, subresources(region.imageSubresource), VK_PIPELINE_STAGE_2_COPY_BIT,
          VK_ACCESS_2_TRANSFER_WRITE_BIT, layout);
  }
}

void Recorder::CmdCopyImageToBuffer(VkCommandBuffer commands, VkImage source, VkImageLayout layout, VkBuffer target,
                                    std::uint32_t count, const VkBufferImageCopy* regions) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_) return;
  Event& made = event(commands, "vkCmdCopyImageToBuffer");
  for (const VkBufferImageCopy& region : std::span(regions, count)) {
    touch(made, source, subresources(region.imageSubresource), VK_PIPELINE_STAGE_2_COPY_BIT,
          VK_ACCESS_2_TRANSFER_READ_BIT, layout);
    touch(made, target, bytes(region.bufferOffset, bytes_of(region, source)), VK_PIPELINE_STAGE_2_COPY_BIT,
          VK_ACCESS_2_TRANSFER_WRITE_BIT);
  }
}

void Recorder::CmdBlitImage(VkCommandBuffer commands, VkImage source, VkImageLayout source_layout, VkImage target,
                            VkImageLayout target_layout, std::uint32_t count, const VkImageBlit* regions, VkFilter) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_) return;
  Event& made = event(commands, "vkCmdBlitImage");
  for (const VkImageBlit& region : std::span(regions, count)) {
    touch(made, source, subresources(region.srcSubresource), VK_PIPELINE_STAGE_2_BLIT_BIT,
          VK_ACCESS_2_TRANSFER_READ_BIT, source_layout);
    touch(made, target, subresources(region.dstSubresource), VK_PIPELINE_STAGE_2_BLIT_BIT,
          VK_ACCESS_2_TRANSFER_WRITE_BIT, target_layout);
  }
}

void Recorder::CmdFillBuffer(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset, VkDeviceSize size,
                             std::uint32_t) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_) return;
  touch(event(commands, "vkCmdFillBuffer"), buffer, bytes(offset, size), VK_PIPELINE_STAGE_2_CLEAR_BIT,
        VK_ACCESS_2_TRANSFER_WRITE_BIT);
}

void Recorder::CmdUpdateBuffer(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset, VkDeviceSize size,
                               const void*) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_) return;
  touch(event(commands, "vkCmdUpdateBuffer"), buffer, bytes(offset, size), VK_PIPELINE_STAGE_2_CLEAR_BIT,
        VK_ACCESS_2_TRANSFER_WRITE_BIT);
}

void Recorder::CmdClearColorImage(VkCommandBuffer commands, VkImage image, VkImageLayout layout,
                                  const VkClearColorValue*, std::uint32_t count,
                                  const VkImageSubresourceRange* ranges) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_) return;
  Event& made = event(commands, "vkCmdClearColorImage");
  for (const VkImageSubresourceRange& range : std::span(ranges, count))
    touch(made, image, subresources(range), VK_PIPELINE_STAGE_2_CLEAR_BIT, VK_ACCESS_2_TRANSFER_WRITE_BIT, layout);
}

void Recorder::CmdClearDepthStencilImage(VkCommandBuffer commands, VkImage image, VkImageLayout layout,
                                         const VkClearDepthStencilValue*, std::uint32_t count,
                                         const VkImageSubresourceRange* ranges) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_) return;
  Event& made = event(commands, "vkCmdClearDepthStencilImage");
  for (const VkImageSubresourceRange& range : std::span(ranges, count))
    touch(made, image, subresources(range), VK_PIPELINE_STAGE_2_CLEAR_BIT, VK_ACCESS_2_TRANSFER_WRITE_BIT, layout);
}

void Recorder::CmdCopyQueryPoolResults(VkCommandBuffer commands, VkQueryPool, std::uint32_t, std::uint32_t,
                                       VkBuffer target, VkDeviceSize offset, VkDeviceSize, VkQueryResultFlags) {
  const std::scoped_lock lock(mutex_);
  if (is_paused_) return;
  touch(event(commands, "vkCmdCopyQueryPoolResults"), target, bytes(offset, kWhole), VK_PIPELINE_STAGE_2_COPY_BIT,
        VK_ACCESS_2_TRANSFER_WRITE_BIT);
}

}  // namespace heddle::vulkan::hazard
