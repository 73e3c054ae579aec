/* SPDX-License-Identifier: Apache-2.0 */
/* The Vulkan functions of one device, as plugins may call them. The host fills the table with its own wrappers, so that
 * it counts commands, memory and pipelines, and tests can stand in for the driver. Plugins never link libvulkan. */
#ifndef HEDDLE_VULKAN_TABLE_H
#define HEDDLE_VULKAN_TABLE_H

#ifndef VK_NO_PROTOTYPES
#define VK_NO_PROTOTYPES
#endif
#include <stdint.h>
#include <vulkan/vulkan_core.h>

/* Appended at the end only. */
#define HEDDLE_VULKAN_FUNCTIONS(X) \
  X(DeviceWaitIdle) X(GetDeviceQueue) X(QueueSubmit2) X(QueueWaitIdle) \
  X(AllocateMemory) X(FreeMemory) X(MapMemory) X(UnmapMemory) X(FlushMappedMemoryRanges) X(InvalidateMappedMemoryRanges) \
  X(CreateBuffer) X(DestroyBuffer) X(BindBufferMemory) X(GetBufferMemoryRequirements) X(GetBufferDeviceAddress) \
  X(CreateImage) X(DestroyImage) X(BindImageMemory) X(GetImageMemoryRequirements) X(GetImageSubresourceLayout) \
  X(GetDeviceImageMemoryRequirements) X(GetDeviceBufferMemoryRequirements) \
  X(CreateImageView) X(DestroyImageView) X(CreateBufferView) X(DestroyBufferView) X(CreateSampler) X(DestroySampler) \
  X(CreateShaderModule) X(DestroyShaderModule) X(CreatePipelineLayout) X(DestroyPipelineLayout) \
  X(CreateComputePipelines) X(CreateGraphicsPipelines) X(DestroyPipeline) X(CreatePipelineCache) X(DestroyPipelineCache) \
  X(CreateDescriptorSetLayout) X(DestroyDescriptorSetLayout) X(CreateDescriptorPool) X(DestroyDescriptorPool) \
  X(ResetDescriptorPool) X(AllocateDescriptorSets) X(FreeDescriptorSets) X(UpdateDescriptorSets) \
  X(CreateCommandPool) X(DestroyCommandPool) X(ResetCommandPool) X(AllocateCommandBuffers) X(FreeCommandBuffers) \
  X(BeginCommandBuffer) X(EndCommandBuffer) X(ResetCommandBuffer) \
  X(CreateFence) X(DestroyFence) X(ResetFences) X(GetFenceStatus) X(WaitForFences) \
  X(CreateSemaphore) X(DestroySemaphore) X(WaitSemaphores) X(SignalSemaphore) X(GetSemaphoreCounterValue) \
  X(CreateQueryPool) X(DestroyQueryPool) X(GetQueryPoolResults) X(ResetQueryPool) \
  X(CmdBindPipeline) X(CmdBindDescriptorSets) X(CmdPushConstants) X(CmdBindVertexBuffers) X(CmdBindIndexBuffer) \
  X(CmdSetViewport) X(CmdSetScissor) X(CmdSetCullMode) X(CmdSetFrontFace) X(CmdSetDepthBias) X(CmdSetDepthCompareOp) \
  X(CmdDispatch) X(CmdDispatchIndirect) X(CmdDraw) X(CmdDrawIndexed) X(CmdDrawIndirect) X(CmdDrawIndexedIndirect) \
  X(CmdDrawIndexedIndirectCount) X(CmdDrawIndirectCount) \
  X(CmdBeginRendering) X(CmdEndRendering) X(CmdPipelineBarrier2) \
  X(CmdCopyBuffer) X(CmdCopyImage) X(CmdCopyBufferToImage) X(CmdCopyImageToBuffer) X(CmdBlitImage) \
  X(CmdFillBuffer) X(CmdUpdateBuffer) X(CmdClearColorImage) X(CmdClearDepthStencilImage) \
  X(CmdWriteTimestamp2) X(CmdResetQueryPool) X(CmdBeginQuery) X(CmdEndQuery) X(CmdCopyQueryPoolResults) \
  X(CmdSetBlendConstants)

typedef struct heddle_vulkan {
  uint32_t struct_size;
  uint32_t reserved;
  VkDevice device;
  VkPhysicalDevice physical_device;
#define HEDDLE_VULKAN_MEMBER(name) PFN_vk##name name;
  HEDDLE_VULKAN_FUNCTIONS(HEDDLE_VULKAN_MEMBER)
#undef HEDDLE_VULKAN_MEMBER
} heddle_vulkan;

#endif
