// SPDX-License-Identifier: Apache-2.0
// Calls of the device's table -> a hazard::Stream. Knows what stands behind handles: which bytes an image lies on, what
// a descriptor set holds, what the shaders of a pipeline do to each binding.
//
// Functions are named like the Vulkan functions that they follow, with the same arguments but the first (the device),
// and are called after a success; those that destroy, before. table.cpp finds them by name: a function that is not here
// is not followed. Command buffers are recorded by one thread at a time. [record-thread], but for the objects:
// [any-thread]
#pragma once

#include "vulkan/hazard_stream.hpp"
#include "vulkan/shader_access.hpp"

#include <array>
#include <map>
#include <mutex>
#include <optional>
#include <span>

namespace heddle::vulkan::hazard {

class Recorder {
 public:
  /// How large an image is only the driver knows.
  Recorder(VkDevice device, PFN_vkGetImageMemoryRequirements needs) : device_(device), needs_(needs) {}

  /// Every command from now on is of this pass and stage.
  void label(Label label);
  /// A frame begins.
  void begin_frame(std::uint64_t frame);
  /// What people call an image or a buffer.
  void name(VkImage image, std::string name);
  void name(VkBuffer buffer, std::string name);
  /// Contents of the last frame are nobody's business.
  void discard(VkBuffer buffer);
  /// What a buffer holds is meant, whatever it is: its maker has said that it has nothing to write.
  void accept(VkBuffer buffer);
  /// The host reads or writes mapped memory.
  void host_access(VkBuffer buffer, bool writes, std::uint64_t offset, std::uint64_t size);
  /// While one lives, commands are not part of what is proven: they synchronize with everything and leave layouts as
  /// they were. nullptr: nothing records.
  class Pause {
   public:
    explicit Pause(Recorder* recorder) : recorder_(recorder) {
      if (recorder_ != nullptr) recorder_->is_paused_ = true;
    }
    ~Pause() {
      if (recorder_ != nullptr) recorder_->is_paused_ = false;
    }
    Pause(const Pause&) = delete;
    Pause& operator=(const Pause&) = delete;

   private:
    Recorder* recorder_;
  };

  [[nodiscard]] const Stream& stream() const { return stream_; }
  /// Forgets events that were played; objects and labels stay.
  void forget_events() { stream_.events.clear(); }

  // ---- objects ----
  void CreateImage(const VkImageCreateInfo* info, const VkAllocationCallbacks*, VkImage* image);
  void DestroyImage(VkImage image, const VkAllocationCallbacks*);
  void BindImageMemory(VkImage image, VkDeviceMemory memory, VkDeviceSize offset);
  void CreateBuffer(const VkBufferCreateInfo* info, const VkAllocationCallbacks*, VkBuffer* buffer);
  void DestroyBuffer(VkBuffer buffer, const VkAllocationCallbacks*);
  void BindBufferMemory(VkBuffer buffer, VkDeviceMemory memory, VkDeviceSize offset);
  void CreateImageView(const VkImageViewCreateInfo* info, const VkAllocationCallbacks*, VkImageView* view);
  void DestroyImageView(VkImageView view, const VkAllocationCallbacks*);
  void CreateBufferView(const VkBufferViewCreateInfo* info, const VkAllocationCallbacks*, VkBufferView* view);
  void DestroyBufferView(VkBufferView view, const VkAllocationCallbacks*);
  void CreateShaderModule(const VkShaderModuleCreateInfo* info, const VkAllocationCallbacks*, VkShaderModule* module);
  void DestroyShaderModule(VkShaderModule module, const VkAllocationCallbacks*);
  void CreateDescriptorSetLayout(const VkDescriptorSetLayoutCreateInfo* info, const VkAllocationCallbacks*,
                                 VkDescriptorSetLayout* layout);
  void AllocateDescriptorSets(const VkDescriptorSetAllocateInfo* info, VkDescriptorSet* sets);
  void UpdateDescriptorSets(std::uint32_t write_count, const VkWriteDescriptorSet* writes, std::uint32_t copy_count,
                            const VkCopyDescriptorSet* copies);
  void CreateComputePipelines(VkPipelineCache, std::uint32_t count, const VkComputePipelineCreateInfo* infos,
                              const VkAllocationCallbacks*, VkPipeline* pipelines);
  void CreateGraphicsPipelines(VkPipelineCache, std::uint32_t count, const VkGraphicsPipelineCreateInfo* infos,
                               const VkAllocationCallbacks*, VkPipeline* pipelines);
  void DestroyPipeline(VkPipeline pipeline, const VkAllocationCallbacks*);

  // ---- the queue ----
  void QueueSubmit2(std::uint32_t count, const VkSubmitInfo2* submits, VkFence fence);
  void WaitForFences(std::uint32_t count, const VkFence* fences, VkBool32 all, std::uint64_t timeout);
  void GetFenceStatus(VkFence fence);
  void QueueWaitIdle();
  void DeviceWaitIdle();

  // ---- commands ----
  void BeginCommandBuffer(VkCommandBuffer commands, const VkCommandBufferBeginInfo*);
  void CmdBindPipeline(VkCommandBuffer commands, VkPipelineBindPoint point, VkPipeline pipeline);
  void CmdBindDescriptorSets(VkCommandBuffer commands, VkPipelineBindPoint point, VkPipelineLayout, std::uint32_t first,
                             std::uint32_t count, const VkDescriptorSet* sets, std::uint32_t offset_count,
                             const std::uint32_t* offsets);
  void CmdBindVertexBuffers(VkCommandBuffer commands, std::uint32_t first, std::uint32_t count, const VkBuffer* buffers,
                            const VkDeviceSize* offsets);
  void CmdBindIndexBuffer(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset, VkIndexType);
  void CmdDispatch(VkCommandBuffer commands, std::uint32_t x, std::uint32_t y, std::uint32_t z);
  void CmdDispatchIndirect(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset);
  void CmdDraw(VkCommandBuffer commands, std::uint32_t vertices, std::uint32_t instances, std::uint32_t, std::uint32_t);
  void CmdDrawIndexed(VkCommandBuffer commands, std::uint32_t indices, std::uint32_t instances, std::uint32_t,
                      std::int32_t, std::uint32_t);
  void CmdDrawIndirect(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset, std::uint32_t count,
                       std::uint32_t stride);
  void CmdDrawIndexedIndirect(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset, std::uint32_t count,
                              std::uint32_t stride);
  void CmdDrawIndirectCount(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset, VkBuffer count_buffer,
                            VkDeviceSize count_offset, std::uint32_t most, std::uint32_t stride);
  void CmdDrawIndexedIndirectCount(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset,
                                   VkBuffer count_buffer, VkDeviceSize count_offset, std::uint32_t most,
                                   std::uint32_t stride);
  void CmdBeginRendering(VkCommandBuffer commands, const VkRenderingInfo* info);
  void CmdPipelineBarrier2(VkCommandBuffer commands, const VkDependencyInfo* info);
  void CmdCopyBuffer(VkCommandBuffer commands, VkBuffer source, VkBuffer target, std::uint32_t count,
                     const VkBufferCopy* regions);
  void CmdCopyImage(VkCommandBuffer commands, VkImage source, VkImageLayout source_layout, VkImage target,
                    VkImageLayout target_layout, std::uint32_t count, const VkImageCopy* regions);
  void CmdCopyBufferToImage(VkCommandBuffer commands, VkBuffer source, VkImage target, VkImageLayout layout,
                            std::uint32_t count, const VkBufferImageCopy* regions);
  void CmdCopyImageToBuffer(VkCommandBuffer commands, VkImage source, VkImageLayout layout, VkBuffer target,
                            std::uint32_t count, const VkBufferImageCopy* regions);
  void CmdBlitImage(VkCommandBuffer commands, VkImage source, VkImageLayout source_layout, VkImage target,
                    VkImageLayout target_layout, std::uint32_t count, const VkImageBlit* regions, VkFilter);
  void CmdFillBuffer(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset, VkDeviceSize size, std::uint32_t);
  void CmdUpdateBuffer(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset, VkDeviceSize size, const void*);
  void CmdClearColorImage(VkCommandBuffer commands, VkImage image, VkImageLayout layout, const VkClearColorValue*,
                          std::uint32_t count, const VkImageSubresourceRange* ranges);
  void CmdClearDepthStencilImage(VkCommandBuffer commands, VkImage image, VkImageLayout layout,
                                 const VkClearDepthStencilValue*, std::uint32_t count,
                                 const VkImageSubresourceRange* ranges);
  void CmdCopyQueryPoolResults(VkCommandBuffer commands, VkQueryPool, std::uint32_t first, std::uint32_t count,
                               VkBuffer target, VkDeviceSize offset, VkDeviceSize stride, VkQueryResultFlags);

 private:
  void note(VkBuffer buffer, Event::Kind kind);
  struct View {
    ObjectIndex object = 0;
    Range range;
  };
  struct Descriptor {
    VkDescriptorType type = VK_DESCRIPTOR_TYPE_SAMPLER;
    std::optional<ObjectIndex> object;
    Range range;
    VkImageLayout layout = VK_IMAGE_LAYOUT_UNDEFINED;
  };
  struct SetLayout {
    std::map<std::uint32_t, VkDescriptorSetLayoutBinding> bindings;  // pImmutableSamplers is not to be read
  };
  struct Set {
    SetLayout layout;
    std::map<std::uint32_t, std::vector<Descriptor>> bindings;
  };
  struct PipelineStage {
    VkPipelineStageFlags2 stage = 0;
    std::vector<shader::BoundVariable> variables;
  };
  struct Pipeline {
    std::vector<PipelineStage> stages;
    std::vector<std::uint32_t> vertex_bindings;
  };
  struct BoundSet {
    VkDescriptorSet set = VK_NULL_HANDLE;
    std::vector<std::uint32_t> offsets;  // dynamic ones
  };
  struct BoundBuffer {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceSize offset = 0;
  };
  struct Commands {
    std::vector<Event> events;
    std::array<VkPipeline, 2> pipelines{};  // by bind point: graphics, compute
    std::array<std::map<std::uint32_t, BoundSet>, 2> sets;
    std::map<std::uint32_t, BoundBuffer> vertex_buffers;
    BoundBuffer index_buffer;
  };

  ObjectIndex add(Object object);
  void bind(ObjectIndex object, std::uint64_t memory, std::uint64_t offset);
  void destroy(ObjectIndex object, const char* command);
  Descriptor& slot(VkDescriptorSet set, std::uint32_t& binding, std::uint32_t& element);
  [[nodiscard]] std::vector<shader::BoundVariable> variables_of(const VkPipelineShaderStageCreateInfo& stage) const;

  Event& event(VkCommandBuffer commands, const char* command, Event::Kind kind = Event::Kind::kCommand);
  void touch(Event& event, VkBuffer buffer, const Range& range, VkPipelineStageFlags2 stages, VkAccessFlags2 access);
  void touch(Event& event, VkImage image, const Range& range, VkPipelineStageFlags2 stages, VkAccessFlags2 access,
             VkImageLayout layout);
  void touch_bound(Event& event, Commands& state, VkPipelineBindPoint point);
  void touch_variable(Event& event, const shader::BoundVariable& variable, const Set& set,
                      const std::vector<std::uint32_t>& offsets, VkPipelineStageFlags2 stage);
  void touch_vertices(Event& event, Commands& state, bool is_indexed);
  void touch_attachment(Event& event, const VkRenderingAttachmentInfo& attachment, bool is_depth);
  void draw_indirect(VkCommandBuffer commands, const char* command, VkBuffer buffer, VkDeviceSize offset,
                     std::uint32_t count, std::uint32_t stride, bool is_indexed, VkBuffer count_buffer,
                     VkDeviceSize count_offset);
  [[nodiscard]] VkDeviceSize bytes_of(const VkBufferImageCopy& region, VkImage image) const;
  void wait(std::uint64_t submission);

  VkDevice device_;
  PFN_vkGetImageMemoryRequirements needs_;
  std::mutex mutex_;
  Stream stream_;
  bool is_paused_ = false;
  std::uint32_t label_ = 0;
  std::uint64_t submissions_ = 0;
  std::map<VkImage, ObjectIndex> images_;
  std::map<VkBuffer, ObjectIndex> buffers_;
  std::map<VkImageView, View> views_;
  std::map<VkBufferView, View> buffer_views_;
  std::map<VkShaderModule, std::vector<shader::BoundVariable>> modules_;
  std::map<VkDescriptorSetLayout, SetLayout> set_layouts_;
  std::map<VkDescriptorSet, Set> sets_;
  std::map<VkPipeline, Pipeline> pipelines_;
  std::map<VkCommandBuffer, Commands> commands_;
  std::map<VkFence, std::uint64_t> fences_;
};

}  // namespace heddle::vulkan::hazard
