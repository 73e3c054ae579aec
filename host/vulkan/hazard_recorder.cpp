// SPDX-License-Identifier: Apache-2.0
// Objects and the queue; the commands are in hazard_commands.cpp.
#include "vulkan/hazard_recorder.hpp"

#include "vulkan/device.hpp"

#include <algorithm>
#include <utility>

namespace heddle::vulkan::hazard {
namespace {

template <typename Handle>
std::uint64_t number_of(Handle handle) {
  return reinterpret_cast<std::uint64_t>(handle);
}

Range range_of(const VkImageSubresourceRange& range) {
  return {0, kWhole, range.baseMipLevel, range.levelCount, range.baseArrayLayer, range.layerCount};
}

}  // namespace

// ---- who, when, what it is called ----

void Recorder::label(Label label) {
  const std::scoped_lock lock(mutex_);
  const auto known = std::find_if(stream_.labels.begin(), stream_.labels.end(),
                                  [&](const Label& other) { return other.text == label.text; });
  label_ = static_cast<std::uint32_t>(known - stream_.labels.begin());
  if (known == stream_.labels.end()) stream_.labels.push_back(std::move(label));
}

void Recorder::begin_frame(std::uint64_t frame) {
  const std::scoped_lock lock(mutex_);
  Event event;
  event.kind = Event::Kind::kFrame;
  event.number = frame;
  stream_.events.push_back(std::move(event));
}

void Recorder::name(VkImage image, std::string name) {
  const std::scoped_lock lock(mutex_);
  if (const auto found = images_.find(image); found != images_.end())
    stream_.objects[found->second].name = std::move(name);
}

void Recorder::name(VkBuffer buffer, std::string name) {
  const std::scoped_lock lock(mutex_);
  if (const auto found = buffers_.find(buffer); found != buffers_.end())
    stream_.objects[found->second].name = std::move(name);
}

void Recorder::discard(VkBuffer buffer) {
  note(buffer, Event::Kind::kDiscard);
}

void Recorder::accept(VkBuffer buffer) {
  note(buffer, Event::Kind::kAccept);
}

void Recorder::note(VkBuffer buffer, Event::Kind kind) {
  const std::scoped_lock lock(mutex_);
  const auto found = buffers_.find(buffer);
  if (found == buffers_.end()) return;
  Event event;
  event.kind = kind;
  event.touches.push_back({found->second});
  stream_.events.push_back(std::move(event));
}

void Recorder::host_access(VkBuffer buffer, bool writes, std::uint64_t offset, std::uint64_t size) {
  const std::scoped_lock lock(mutex_);
  const auto found = buffers_.find(buffer);
  if (found == buffers_.end() || is_paused_) return;
  Event event;
  event.kind = writes ? Event::Kind::kHostWrite : Event::Kind::kHostRead;
  event.label = label_;
  event.command = writes ? "host write" : "host read";
  Touch touch;
  touch.object = found->second;
  touch.range.offset = offset;
  touch.range.size = size;
  event.touches.push_back(touch);
  stream_.events.push_back(std::move(event));
}

// ---- objects ----

ObjectIndex Recorder::add(Object object) {
  stream_.objects.push_back(std::move(object));
  return static_cast<ObjectIndex>(stream_.objects.size() - 1);
}

void Recorder::bind(ObjectIndex object, std::uint64_t memory, std::uint64_t offset) {
  stream_.objects[object].memory = memory;
  stream_.objects[object].offset = offset;
}

void Recorder::destroy(ObjectIndex object, const char* command) {
  Event event;
  event.kind = Event::Kind::kDestroy;
  event.command = command;
  event.touches.push_back({object});
  stream_.events.push_back(std::move(event));
}

void Recorder::CreateImage(const VkImageCreateInfo* info, const VkAllocationCallbacks*, VkImage* image) {
  const std::scoped_lock lock(mutex_);
  Object object;
  object.is_image = true;
  object.layers = info->arrayLayers;
  object.mips = info->mipLevels;
  object.texel_bytes = format_info(info->format).texel_bytes;
  images_[*image] = add(std::move(object));
}

void Recorder::DestroyImage(VkImage image, const VkAllocationCallbacks*) {
  const std::scoped_lock lock(mutex_);
  const auto found = images_.find(image);
  if (found == images_.end()) return;
  destroy(found->second, "vkDestroyImage");
  images_.erase(found);
}

void Recorder::BindImageMemory(VkImage image, VkDeviceMemory memory, VkDeviceSize offset) {
  VkMemoryRequirements needs{};
  needs_(device_, image, &needs);
  const std::scoped_lock lock(mutex_);
  const auto found = images_.find(image);
  if (found == images_.end()) return;
  bind(found->second, number_of(memory), offset);
  stream_.objects[found->second].size = needs.size;
}

void Recorder::CreateBuffer(const VkBufferCreateInfo* info, const VkAllocationCallbacks*, VkBuffer* buffer) {
  const std::scoped_lock lock(mutex_);
  Object object;
  object.size = info->size;
  buffers_[*buffer] = add(std::move(object));
}

void Recorder::DestroyBuffer(VkBuffer buffer, const VkAllocationCallbacks*) {
  const std::scoped_lock lock(mutex_);
  const auto found = buffers_.find(buffer);
  if (found == buffers_.end()) return;
  destroy(found->second, "vkDestroyBuffer");
  buffers_.erase(found);
}

void Recorder::BindBufferMemory(VkBuffer buffer, VkDeviceMemory memory, VkDeviceSize offset) {
  const std::scoped_lock lock(mutex_);
  if (const auto found = buffers_.find(buffer); found != buffers_.end()) bind(found->second, number_of(memory), offset);
}

void Recorder::CreateImageView(const VkImageViewCreateInfo* info, const VkAllocationCallbacks*, VkImageView* view) {
  const std::scoped_lock lock(mutex_);
  if (const auto found = images_.find(info->image); found != images_.end())
    views_[*view] = {found->second, range_of(info->subresourceRange)};
}

void Recorder::DestroyImageView(VkImageView view, const VkAllocationCallbacks*) {
  const std::scoped_lock lock(mutex_);
  views_.erase(view);
}

void Recorder::CreateBufferView(const VkBufferViewCreateInfo* info, const VkAllocationCallbacks*, VkBufferView* view) {
  const std::scoped_lock lock(mutex_);
  if (const auto found = buffers_.find(info->buffer); found != buffers_.end())
    buffer_views_[*view] = {found->second, {info->offset, info->range}};
}

void Recorder::DestroyBufferView(VkBufferView view, const VkAllocationCallbacks*) {
  const std::scoped_lock lock(mutex_);
  buffer_views_.erase(view);
}

void Recorder::CreateShaderModule(const VkShaderModuleCreateInfo* info, const VkAllocationCallbacks*,
                                  VkShaderModule* module) {
  const std::scoped_lock lock(mutex_);
  modules_[*module] = shader::find_accesses({info->pCode, info->codeSize / sizeof(std::uint32_t)});
}

void Recorder::DestroyShaderModule(VkShaderModule module, const VkAllocationCallbacks*) {
  const std::scoped_lock lock(mutex_);
  modules_.erase(module);
}

void Recorder::CreateDescriptorSetLayout(const VkDescriptorSetLayoutCreateInfo* info, const VkAllocationCallbacks*,
                                         VkDescriptorSetLayout* layout) {
  const std::scoped_lock lock(mutex_);
  SetLayout made;
  for (std::uint32_t i = 0; i < info->bindingCount; ++i) made.bindings[info->pBindings[i].binding] = info->pBindings[i];
  set_layouts_[*layout] = std::move(made);
}

void Recorder::AllocateDescriptorSets(const VkDescriptorSetAllocateInfo* info, VkDescriptorSet* sets) {
  const std::scoped_lock lock(mutex_);
  for (std::uint32_t i = 0; i < info->descriptorSetCount; ++i) {
    Set made;
    if (const auto layout = set_layouts_.find(info->pSetLayouts[i]); layout != set_layouts_.end()) {
      made.layout = layout->second;
      for (const auto& [number, binding] : made.layout.bindings)
        made.bindings[number].resize(binding.descriptorCount, {binding.descriptorType, {}, {}, {}});
    }
    sets_[sets[i]] = std::move(made);
  }
}

/// One write may run over the end of a binding into the next.
Recorder::Descriptor& Recorder::slot(VkDescriptorSet set, std::uint32_t& binding, std::uint32_t& element) {
  Set& of = sets_[set];
  auto found = of.bindings.find(binding);
  while (found != of.bindings.end() && element >= found->second.size()) {
    element -= static_cast<std::uint32_t>(found->second.size());
    ++found;
    if (found != of.bindings.end()) binding = found->first;
  }
  if (found != of.bindings.end()) return found->second[element];
  std::vector<Descriptor>& unknown = of.bindings[binding];  // a set that was not seen being made
  unknown.resize(std::max<std::size_t>(unknown.size(), element + 1));
  return unknown[element];
}

void Recorder::UpdateDescriptorSets(std::uint32_t write_count, const VkWriteDescriptorSet* writes,
                                    std::uint32_t copy_count, const VkCopyDescriptorSet* copies) {
  const std::scoped_lock lock(mutex_);
  for (const VkWriteDescriptorSet& write : std::span(writes, write_count)) {
    std::uint32_t binding = write.dstBinding;
    std::uint32_t element = write.dstArrayElement;
    for (std::uint32_t i = 0; i < write.descriptorCount; ++i, ++element) {
      Descriptor& descriptor = slot(write.dstSet, binding, element);
      descriptor = {write.descriptorType, {}, {}, {}};
      switch (write.descriptorType) {
        case VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER:
        case VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE:
        case VK_DESCRIPTOR_TYPE_STORAGE_IMAGE:
        case VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT:
          if (const auto view = views_.find(write.pImageInfo[i].imageView); view != views_.end()) {
            descriptor.object = view->second.object;
            descriptor.range = view->second.range;
            descriptor.layout = write.pImageInfo[i].imageLayout;
          }
          break;
        case VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER:
        case VK_DESCRIPTOR_TYPE_STORAGE_TEXEL_BUFFER:
          if (const auto view = buffer_views_.find(write.pTexelBufferView[i]); view != buffer_views_.end()) {
            descriptor.object = view->second.object;
            descriptor.range = view->second.range;
          }
          break;
        case VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER:
        case VK_DESCRIPTOR_TYPE_STORAGE_BUFFER:
        case VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC:
        case VK_DESCRIPTOR_TYPE_STORAGE_BUFFER_DYNAMIC:
          if (const auto buffer = buffers_.find(write.pBufferInfo[i].buffer); buffer != buffers_.end()) {
            descriptor.object = buffer->second;
            descriptor.range.offset = write.pBufferInfo[i].offset;
            descriptor.range.size = write.pBufferInfo[i].range;
          }
          break;
        default:
          break;
      }
    }
  }
  for (const VkCopyDescriptorSet& copy : std::span(copies, copy_count)) {
    std::uint32_t from = copy.srcBinding;
    std::uint32_t from_element = copy.srcArrayElement;
    std::uint32_t to = copy.dstBinding;
    std::uint32_t to_element = copy.dstArrayElement;
    for (std::uint32_t i = 0; i < copy.descriptorCount; ++i, ++from_element, ++to_element) {
      const Descriptor copied = slot(copy.srcSet, from, from_element);
      slot(copy.dstSet, to, to_element) = copied;
    }
  }
}

std::vector<shader::BoundVariable> Recorder::variables_of(const VkPipelineShaderStageCreateInfo& stage) const {
  const auto module = modules_.find(stage.module);
  if (module == modules_.end()) return {};
  std::vector<shader::BoundVariable> used;
  for (const shader::BoundVariable& variable : module->second)
    if (variable.reads || variable.writes) used.push_back(variable);
  return used;
}

void Recorder::CreateComputePipelines(VkPipelineCache, std::uint32_t count, const VkComputePipelineCreateInfo* infos,
                                      const VkAllocationCallbacks*, VkPipeline* pipelines) {
  const std::scoped_lock lock(mutex_);
  for (std::uint32_t i = 0; i < count; ++i)
    pipelines_[pipelines[i]] = {{{VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT, variables_of(infos[i].stage)}}, {}};
}

void Recorder::CreateGraphicsPipelines(VkPipelineCache, std::uint32_t count, const VkGraphicsPipelineCreateInfo* infos,
                                       const VkAllocationCallbacks*, VkPipeline* pipelines) {
  const std::scoped_lock lock(mutex_);
  const auto stage_of = [](VkShaderStageFlagBits stage) -> VkPipelineStageFlags2 {
    switch (stage) {
      case VK_SHADER_STAGE_TESSELLATION_CONTROL_BIT:
        return VK_PIPELINE_STAGE_2_TESSELLATION_CONTROL_SHADER_BIT;
      case VK_SHADER_STAGE_TESSELLATION_EVALUATION_BIT:
        return VK_PIPELINE_STAGE_2_TESSELLATION_EVALUATION_SHADER_BIT;
      case VK_SHADER_STAGE_GEOMETRY_BIT:
        return VK_PIPELINE_STAGE_2_GEOMETRY_SHADER_BIT;
      case VK_SHADER_STAGE_FRAGMENT_BIT:
        return VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT;
      default:
        return VK_PIPELINE_STAGE_2_VERTEX_SHADER_BIT;
    }
  };
  for (std::uint32_t i = 0; i < count; ++i) {
    Pipeline made;
    for (const VkPipelineShaderStageCreateInfo& stage : std::span(infos[i].pStages, infos[i].stageCount))
      made.stages.push_back({stage_of(stage.stage), variables_of(stage)});
    if (const VkPipelineVertexInputStateCreateInfo* input = infos[i].pVertexInputState; input != nullptr)
      for (std::uint32_t b = 0; b < input->vertexBindingDescriptionCount; ++b)
        made.vertex_bindings.push_back(input->pVertexBindingDescriptions[b].binding);
    pipelines_[pipelines[i]] = std::move(made);
  }
}

void Recorder::DestroyPipeline(VkPipeline pipeline, const VkAllocationCallbacks*) {
  const std::scoped_lock lock(mutex_);
  pipelines_.erase(pipeline);
}

// ---- the queue ----

void Recorder::QueueSubmit2(std::uint32_t count, const VkSubmitInfo2* submits, VkFence fence) {
  const std::scoped_lock lock(mutex_);
  for (const VkSubmitInfo2& submit : std::span(submits, count)) {
    for (const VkCommandBufferSubmitInfo& info : std::span(submit.pCommandBufferInfos, submit.commandBufferInfoCount)) {
      std::vector<Event>& recorded = commands_[info.commandBuffer].events;
      stream_.events.insert(stream_.events.end(), recorded.begin(), recorded.end());
    }
  }
  Event event;
  event.kind = Event::Kind::kSubmit;
  event.command = "vkQueueSubmit2";
  event.number = ++submissions_;
  stream_.events.push_back(std::move(event));
  if (fence != VK_NULL_HANDLE) fences_[fence] = submissions_;
}

void Recorder::wait(std::uint64_t submission) {
  Event event;
  event.kind = Event::Kind::kWait;
  event.number = submission;
  stream_.events.push_back(std::move(event));
}

void Recorder::WaitForFences(std::uint32_t count, const VkFence* fences, VkBool32 all, std::uint64_t) {
  const std::scoped_lock lock(mutex_);
  if (all == VK_FALSE && count > 1) return;  // which one it was is not told
  for (const VkFence fence : std::span(fences, count))
    if (const auto found = fences_.find(fence); found != fences_.end()) wait(found->second);
}

void Recorder::GetFenceStatus(VkFence fence) {
  WaitForFences(1, &fence, VK_TRUE, 0);
}

void Recorder::QueueWaitIdle() {
  const std::scoped_lock lock(mutex_);
  wait(submissions_);
}

void Recorder::DeviceWaitIdle() {
  QueueWaitIdle();
}

}  // namespace heddle::vulkan::hazard
