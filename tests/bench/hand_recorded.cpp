// SPDX-License-Identifier: Apache-2.0
#include "hand_recorded.hpp"

#include <algorithm>
#include <cstring>

namespace heddle::bench {
namespace {

constexpr VkFormat kFormat = VK_FORMAT_R32_SFLOAT;
constexpr VkImageSubresourceRange kWhole{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};

VkImageMemoryBarrier2 transition(VkImage image, VkImageLayout from, VkImageLayout to) {
  VkImageMemoryBarrier2 barrier{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2};
  barrier.srcStageMask = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT;
  barrier.dstStageMask = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT;
  barrier.oldLayout = from;
  barrier.newLayout = to;
  barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  barrier.image = image;
  barrier.subresourceRange = kWhole;
  return barrier;
}

}  // namespace

HandRecorded::HandRecorded(Session& session, const Chain& chain)
    : session_(session), device_(session.device()), chain_(chain), maker_(device_) {
  const heddle_vulkan& vk = device_.table();
  make_pipeline(false);
  make_pipeline(true);
  for (std::uint32_t i = 0; i < chain_.passes; ++i) {
    vulkan::ImageShape shape;
    shape.format = kFormat;
    shape.width = chain_.width;
    shape.height = chain_.height;
    images_.push_back(device_.make_image(shape));
  }
  const Technique& technique = *session_.registry().find("chain/work").technique;
  const vulkan::ParameterLayout layout = vulkan::parameter_layout(technique);
  parameters_ = device_.make_buffer(layout.size, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT, true);
  std::memset(parameters_.data(), 0, layout.size);
  for (std::size_t i = 0; i < technique.parameters.size(); ++i) {
    const std::int32_t value = technique.parameters[i].name == "iterations" ? chain_.iterations : 0;
    std::memcpy(parameters_.data() + layout.offset[i], &value, sizeof value);
  }
  const std::array<VkDescriptorPoolSize, 3> sizes{{{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, chain_.passes},
                                                   {VK_DESCRIPTOR_TYPE_STORAGE_IMAGE, chain_.passes},
                                                   {VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, chain_.passes}}};
  VkDescriptorPoolCreateInfo descriptor_info{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO};
  descriptor_info.maxSets = chain_.passes;
  descriptor_info.poolSizeCount = sizes.size();
  descriptor_info.pPoolSizes = sizes.data();
  vulkan::check(vk.CreateDescriptorPool(vk.device, &descriptor_info, nullptr, &descriptor_pool_),
                "vkCreateDescriptorPool");
  for (std::uint32_t i = 0; i < chain_.passes; ++i) make_set(i);
  VkCommandPoolCreateInfo pool_info{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO};
  pool_info.queueFamilyIndex = device_.queue_family();
  pool_info.flags = VK_COMMAND_POOL_CREATE_TRANSIENT_BIT;
  vulkan::check(vk.CreateCommandPool(vk.device, &pool_info, nullptr, &command_pool_), "vkCreateCommandPool");
  VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
  allocate.commandPool = command_pool_;
  allocate.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
  allocate.commandBufferCount = 1;
  vulkan::check(vk.AllocateCommandBuffers(vk.device, &allocate, &commands_), "vkAllocateCommandBuffers");
  const VkFenceCreateInfo fence_info{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
  vulkan::check(vk.CreateFence(vk.device, &fence_info, nullptr, &fence_), "vkCreateFence");
}

HandRecorded::~HandRecorded() {
  const heddle_vulkan& vk = device_.table();
  (void)vk.DeviceWaitIdle(vk.device);
  vk.DestroyFence(vk.device, fence_, nullptr);
  vk.DestroyCommandPool(vk.device, command_pool_, nullptr);
  vk.DestroyDescriptorPool(vk.device, descriptor_pool_, nullptr);
}

void HandRecorded::make_pipeline(bool reads_previous) {
  const TechniqueEntry entry = session_.registry().find("chain/work");
  vulkan::ShaderRequest request;
  request.pass = "work";
  request.technique = entry.technique;
  request.shader = entry.technique->find_shader("work");
  request.folder = entry.manifest->folder;
  for (const Access& access : entry.technique->find_stage("work")->accesses) {
    vulkan::BoundPort port;
    port.port = access.port;
    port.access = access.access;
    port.is_bound = access.port == "result" || reads_previous;
    port.format = kFormat;
    request.ports.push_back(port);
  }
  const auto folders = session_.registry().shared_folders();
  request.shared_folders.assign(folders.begin(), folders.end());
  const std::size_t index = reads_previous ? 1 : 0;
  shaders_[index] = vulkan::compile(request, session_.services().cache_folder);
  pipelines_[index] = maker_.compute(shaders_[index], {});
}

void HandRecorded::make_set(std::uint32_t pass) {
  const heddle_vulkan& vk = device_.table();
  const std::size_t index = pass == 0 ? 0 : 1;
  const VkDescriptorSetLayout layout = pipelines_[index].set_layout(0);
  VkDescriptorSetAllocateInfo allocate{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO};
  allocate.descriptorPool = descriptor_pool_;
  allocate.descriptorSetCount = 1;
  allocate.pSetLayouts = &layout;
  VkDescriptorSet set = VK_NULL_HANDLE;
  vulkan::check(vk.AllocateDescriptorSets(vk.device, &allocate, &set), "vkAllocateDescriptorSets");
  for (const vulkan::Binding& binding : shaders_[index].bindings) {
    VkDescriptorImageInfo image{};
    VkDescriptorBufferInfo buffer{};
    switch (binding.kind) {
      case vulkan::Binding::Kind::kSampledImage:
        image = {device_.sampler(vulkan::Device::Sampler::kNearestClamp), images_[pass - 1].view(),
                 VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL};
        break;
      case vulkan::Binding::Kind::kStorageImage:
        image = {VK_NULL_HANDLE, images_[pass].mip_view(0), VK_IMAGE_LAYOUT_GENERAL};
        break;
      case vulkan::Binding::Kind::kParameters:
        buffer = {parameters_.handle(), 0, VK_WHOLE_SIZE};
        break;
      default:
        throw Error(HEDDLE_BUG, "chain/work binds something that the hand-recorded chain does not know");
    }
    VkWriteDescriptorSet write{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET};
    write.dstSet = set;
    write.dstBinding = binding.binding;
    write.descriptorCount = 1;
    write.descriptorType = vulkan::descriptor_type(binding);
    write.pImageInfo = &image;
    write.pBufferInfo = &buffer;
    vk.UpdateDescriptorSets(vk.device, 1, &write, 0, nullptr);
  }
  sets_.push_back(set);
}

FrameTime HandRecorded::frame() {
  const heddle_vulkan& vk = device_.table();
  const double start = now_ms(), cpu_start = thread_cpu_ms();
  vulkan::check(vk.ResetCommandPool(vk.device, command_pool_, 0), "vkResetCommandPool");
  VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  vulkan::check(vk.BeginCommandBuffer(commands_, &begin), "vkBeginCommandBuffer");
  const auto synchronize = [&](std::span<const VkImageMemoryBarrier2> barriers) {
    VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
    dependency.imageMemoryBarrierCount = static_cast<std::uint32_t>(barriers.size());
    dependency.pImageMemoryBarriers = barriers.data();
    vk.CmdPipelineBarrier2(commands_, &dependency);
  };
  for (std::uint32_t i = 0; i < chain_.passes; ++i) {
    // Its own image: contents are of no use; the last frame's reader is done before it is written again.
    std::array<VkImageMemoryBarrier2, 2> barriers{
        transition(images_[i].handle(), VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_GENERAL), {}};
    barriers[0].dstAccessMask = VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT;
    if (i > 0) {
      barriers[1] =
          transition(images_[i - 1].handle(), VK_IMAGE_LAYOUT_GENERAL, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL);
      barriers[1].srcAccessMask = VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT;
      barriers[1].dstAccessMask = VK_ACCESS_2_SHADER_SAMPLED_READ_BIT;
    }
    synchronize(std::span(barriers).first(i > 0 ? 2 : 1));
    const vulkan::Pipeline& pipeline = pipelines_[i > 0 ? 1 : 0];
    vk.CmdBindPipeline(commands_, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline.handle());
    vk.CmdBindDescriptorSets(commands_, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline.layout(), 0, 1, &sets_[i], 0, nullptr);
    if (chain_.is_empty) {
      vk.CmdDispatch(commands_, 0, 1, 1);
    } else {
      vk.CmdDispatch(commands_, (chain_.width + 7) / 8, (chain_.height + 7) / 8, 1);
    }
  }
  VkImageMemoryBarrier2 last =
      transition(images_.back().handle(), VK_IMAGE_LAYOUT_GENERAL, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
  last.srcAccessMask = VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT;
  last.dstStageMask = VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT;
  last.dstAccessMask = VK_ACCESS_2_TRANSFER_READ_BIT;
  synchronize({&last, 1});
  vulkan::check(vk.EndCommandBuffer(commands_), "vkEndCommandBuffer");
  VkCommandBufferSubmitInfo buffer{VK_STRUCTURE_TYPE_COMMAND_BUFFER_SUBMIT_INFO};
  buffer.commandBuffer = commands_;
  VkSubmitInfo2 submit{VK_STRUCTURE_TYPE_SUBMIT_INFO_2};
  submit.commandBufferInfoCount = 1;
  submit.pCommandBufferInfos = &buffer;
  FrameTime time;
  const double submitted = now_ms();
  vulkan::check(vk.QueueSubmit2(device_.queue(), 1, &submit, fence_), "vkQueueSubmit2");
  vulkan::check(vk.WaitForFences(vk.device, 1, &fence_, VK_TRUE, ~0ULL), "vkWaitForFences");
  time.submit_ms = now_ms() - submitted;
  vulkan::check(vk.ResetFences(vk.device, 1, &fence_), "vkResetFences");
  time.cpu_ms = thread_cpu_ms() - cpu_start;
  time.wall_ms = now_ms() - start;
  return time;
}

std::vector<float> HandRecorded::read() {
  return vulkan::to_float(device_.read_back(images_.back(), 0, 0, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL), kFormat);
}

}  // namespace heddle::bench
