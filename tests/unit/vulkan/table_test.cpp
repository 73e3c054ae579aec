// SPDX-License-Identifier: Apache-2.0
// Every kind of call counts once, on its own device; devices in one process do not meet.
#include "vulkan/table.hpp"

#include "unit/vulkan/on_device.hpp"

#include <array>
#include <thread>

namespace heddle::vulkan {
namespace {

// A compute shader that does nothing: void main() {} with local size 1, SPIR-V 1.0.
constexpr std::array<std::uint32_t, 35> kEmptyShader = {
    0x07230203, 0x00010000, 0,  5,          0,     // magic, version, generator, bound, schema
    0x00020011, 1,                                 // OpCapability Shader
    0x0003000e, 0,          1,                     // OpMemoryModel Logical GLSL450
    0x0005000f, 5,          3,  0x6e69616d, 0,     // OpEntryPoint GLCompute %3 "main"
    0x00060010, 3,          17, 1,          1, 1,  // OpExecutionMode %3 LocalSize 1 1 1
    0x00020013, 1,                                 // %1 = OpTypeVoid
    0x00030021, 2,          1,                     // %2 = OpTypeFunction %1
    0x00050036, 1,          3,  0,          2,     // %3 = OpFunction %1 None %2
    0x000200f8, 4,                                 // %4 = OpLabel
    0x000100fd, 0x00010038,                        // OpReturn, OpFunctionEnd
};

class Counting : public OnDevice {
 protected:
  Counters since(const Counters& before) const {
    Counters now = device_->counters();
    now.commands -= before.commands;
    now.draws -= before.draws;
    now.dispatches -= before.dispatches;
    now.barriers -= before.barriers;
    now.renderings -= before.renderings;
    now.submits -= before.submits;
    now.pipelines -= before.pipelines;
    return now;
  }
  static VkPipelineLayout make_layout(const heddle_vulkan& vk) {
    VkPipelineLayoutCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
    VkPipelineLayout layout = VK_NULL_HANDLE;
    check(vk.CreatePipelineLayout(vk.device, &info, nullptr, &layout), "vkCreatePipelineLayout");
    return layout;
  }
  static std::array<VkPipeline, 2> make_pipelines(const heddle_vulkan& vk, VkPipelineLayout layout) {
    VkShaderModuleCreateInfo module_info{};
    module_info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
    module_info.codeSize = sizeof(kEmptyShader);
    module_info.pCode = kEmptyShader.data();
    VkShaderModule module = VK_NULL_HANDLE;
    check(vk.CreateShaderModule(vk.device, &module_info, nullptr, &module), "vkCreateShaderModule");
    VkComputePipelineCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
    info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    info.stage.module = module;
    info.stage.pName = "main";
    info.layout = layout;
    const std::array infos = {info, info};
    std::array<VkPipeline, 2> pipelines{};
    check(vk.CreateComputePipelines(vk.device, VK_NULL_HANDLE, 2, infos.data(), nullptr, pipelines.data()),
          "vkCreateComputePipelines");
    vk.DestroyShaderModule(vk.device, module, nullptr);
    return pipelines;
  }
};

TEST_F(Counting, RunWithoutDispatchCountsNoDispatch) {
  const Buffer buffer = device_->make_buffer(64, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, false);
  const Counters before = device_->counters();
  device_->run([&](VkCommandBuffer commands) {
    device_->table().CmdFillBuffer(commands, buffer.handle(), 0, VK_WHOLE_SIZE, 7);
  });
  const Counters did = since(before);
  EXPECT_EQ(did.commands, 1u);
  EXPECT_EQ(did.submits, 1u);
  EXPECT_EQ(did.dispatches, 0u);
  EXPECT_EQ(did.draws, 0u);
  EXPECT_EQ(did.barriers, 0u);
  EXPECT_EQ(did.renderings, 0u);
}

TEST_F(Counting, EmptyRunIsASubmitWithoutCommands) {
  const Counters before = device_->counters();
  device_->run([](VkCommandBuffer) {});
  EXPECT_EQ(since(before).commands, 0u);
  EXPECT_EQ(since(before).submits, 1u);
}

TEST_F(Counting, DispatchesBarriersAndPipelines) {
  const heddle_vulkan& vk = device_->table();
  const Counters before = device_->counters();
  const VkPipelineLayout layout = make_layout(vk);
  const auto pipelines = make_pipelines(vk, layout);
  EXPECT_EQ(since(before).pipelines, 2u);
  EXPECT_EQ(device_->counters().live_pipelines, 2u);
  device_->run([&](VkCommandBuffer commands) {
    vk.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipelines[0]);
    vk.CmdDispatch(commands, 1, 1, 1);
    VkDependencyInfo nothing{};
    nothing.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO;
    vk.CmdPipelineBarrier2(commands, &nothing);
    vk.CmdDispatch(commands, 2, 1, 1);
  });
  const Counters did = since(before);
  EXPECT_EQ(did.commands, 4u);
  EXPECT_EQ(did.dispatches, 2u);
  EXPECT_EQ(did.barriers, 1u);
  vk.DestroyPipeline(vk.device, pipelines[0], nullptr);
  vk.DestroyPipeline(vk.device, pipelines[1], nullptr);
  vk.DestroyPipeline(vk.device, VK_NULL_HANDLE, nullptr);  // legal, and no pipeline less
  vk.DestroyPipelineLayout(vk.device, layout, nullptr);
  EXPECT_EQ(device_->counters().live_pipelines, 0u);
  EXPECT_EQ(since(before).pipelines, 2u);
}

TEST_F(Counting, RenderingsCountWithoutDraws) {
  const heddle_vulkan& vk = device_->table();
  const Image target = device_->make_image({.format = VK_FORMAT_R8G8B8A8_UNORM, .width = 16, .height = 16});
  const Counters before = device_->counters();
  device_->run([&](VkCommandBuffer commands) {
    VkImageMemoryBarrier2 change{};
    change.sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2;
    change.dstStageMask = VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT;
    change.dstAccessMask = VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT;
    change.newLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
    change.image = target.handle();
    change.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    VkDependencyInfo barrier{};
    barrier.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO;
    barrier.imageMemoryBarrierCount = 1;
    barrier.pImageMemoryBarriers = &change;
    vk.CmdPipelineBarrier2(commands, &barrier);
    VkRenderingAttachmentInfo color{};
    color.sType = VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO;
    color.imageView = target.layer_view(0);
    color.imageLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
    color.loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
    color.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
    color.clearValue.color = {{0.2f, 0.4f, 0.6f, 1.0f}};
    VkRenderingInfo info{};
    info.sType = VK_STRUCTURE_TYPE_RENDERING_INFO;
    info.renderArea = {{0, 0}, {16, 16}};
    info.layerCount = 1;
    info.colorAttachmentCount = 1;
    info.pColorAttachments = &color;
    vk.CmdBeginRendering(commands, &info);
    vk.CmdEndRendering(commands);
  });
  const Counters did = since(before);
  EXPECT_EQ(did.renderings, 1u);
  EXPECT_EQ(did.barriers, 1u);
  EXPECT_EQ(did.commands, 3u);
  EXPECT_EQ(did.draws, 0u);
  const auto texels = device_->read_back(target, 0, 0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL);
  ASSERT_EQ(texels.size(), 16u * 16 * 4);
  EXPECT_EQ(texels[0], std::byte{51});
  EXPECT_EQ(texels[1021], std::byte{102});
}

TEST_F(Counting, MemoryComesAndGoes) {
  const heddle_vulkan& vk = device_->table();
  const std::uint64_t before = device_->counters().device_memory_bytes;
  VkMemoryAllocateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
  info.allocationSize = 12345;
  VkDeviceMemory memory = VK_NULL_HANDLE;
  check(vk.AllocateMemory(vk.device, &info, nullptr, &memory), "vkAllocateMemory");
  EXPECT_EQ(device_->counters().device_memory_bytes, before + 12345);
  vk.FreeMemory(vk.device, memory, nullptr);
  vk.FreeMemory(vk.device, VK_NULL_HANDLE, nullptr);
  EXPECT_EQ(device_->counters().device_memory_bytes, before);
}

TEST_F(Counting, DevicesInOneProcessCountApart) {
  std::unique_ptr<Device> other = make_device();
  const Counters first_before = device_->counters();
  const Counters other_before = other->counters();
  const Image image = device_->make_image({.format = VK_FORMAT_R8_UNORM, .width = 4, .height = 4});
  {
    const Buffer buffer = other->make_buffer(64, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, false);
    for (int i = 0; i < 3; ++i) {
      other->run([&](VkCommandBuffer commands) {
        other->table().CmdFillBuffer(commands, buffer.handle(), 0, VK_WHOLE_SIZE, 7);
      });
    }
    EXPECT_EQ(other->counters().live_buffers, other_before.live_buffers + 1);
  }
  EXPECT_EQ(other->counters().submits, other_before.submits + 3);
  EXPECT_EQ(other->counters().commands, other_before.commands + 3);
  EXPECT_EQ(other->counters().live_images, 0u);
  EXPECT_EQ(device_->counters().submits, first_before.submits);
  EXPECT_EQ(device_->counters().commands, first_before.commands);
  EXPECT_EQ(device_->counters().live_images, 1u);
  // A table works on any device, since it finds the device by the handle: plugins may keep a pointer to either.
  EXPECT_EQ(device_->table().DeviceWaitIdle(other->table().device), VK_SUCCESS);

  other.reset();
  device_->run([](VkCommandBuffer) {});
  EXPECT_EQ(device_->counters().submits, first_before.submits + 1);
}

TEST_F(Counting, DevicesThatComeAndGoLeaveNoTrace) {
  for (int i = 0; i < 5; ++i) {
    const std::unique_ptr<Device> other = make_device();
    EXPECT_EQ(other->counters().submits, 0u);
    other->run([](VkCommandBuffer) {});
    EXPECT_EQ(other->counters().submits, 1u);
  }
  EXPECT_EQ(device_->counters().submits, 0u);
}

TEST_F(Counting, SeveralRecordingThreadsLoseNothing) {
  constexpr std::uint32_t kThreads = 4, kEach = 5000;
  const heddle_vulkan& vk = device_->table();
  const Buffer buffer = device_->make_buffer(64, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, false);
  const std::uint64_t before = device_->counters().commands;
  std::vector<std::thread> threads;
  for (std::uint32_t t = 0; t < kThreads; ++t) {
    threads.emplace_back([&] {
      VkCommandPoolCreateInfo pool_info{};
      pool_info.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO;
      pool_info.queueFamilyIndex = device_->queue_family();
      VkCommandPool pool = VK_NULL_HANDLE;
      check(vk.CreateCommandPool(vk.device, &pool_info, nullptr, &pool), "vkCreateCommandPool");
      VkCommandBufferAllocateInfo allocate{};
      allocate.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
      allocate.commandPool = pool;
      allocate.commandBufferCount = 1;
      VkCommandBuffer commands = VK_NULL_HANDLE;
      check(vk.AllocateCommandBuffers(vk.device, &allocate, &commands), "vkAllocateCommandBuffers");
      VkCommandBufferBeginInfo begin{};
      begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
      check(vk.BeginCommandBuffer(commands, &begin), "vkBeginCommandBuffer");
      const VkViewport viewport{0, 0, 8, 8, 0, 1};
      for (std::uint32_t i = 0; i < kEach; ++i) vk.CmdSetViewport(commands, 0, 1, &viewport);
      check(vk.EndCommandBuffer(commands), "vkEndCommandBuffer");
      vk.DestroyCommandPool(vk.device, pool, nullptr);
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(device_->counters().commands, before + std::uint64_t{kThreads} * kEach);
}

TEST_F(Counting, TableIsWholeButForFunctionsOfMissingFeatures) {
  const heddle_vulkan& vk = device_->table();
  EXPECT_EQ(vk.struct_size, sizeof(heddle_vulkan));
  std::vector<std::string> missing;
#define HEDDLE_LOOK(name) \
  if (vk.name == nullptr) missing.emplace_back(#name);
  HEDDLE_VULKAN_FUNCTIONS(HEDDLE_LOOK)
#undef HEDDLE_LOOK
  if (device_->info().is_lavapipe) {
    EXPECT_EQ(join_names(missing), "");
  }
}

}  // namespace
}  // namespace heddle::vulkan
