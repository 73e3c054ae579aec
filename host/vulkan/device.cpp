// SPDX-License-Identifier: Apache-2.0
// Makes a device of the user's choice with its queue, counted table, memory and samplers; runs commands and waits.
#include "vulkan/device.hpp"

#include "vulkan/device_state.hpp"

namespace heddle::vulkan {
namespace {

struct SamplerKind {
  VkFilter filter;
  VkSamplerAddressMode address;
  bool is_compare;
};
constexpr std::array<SamplerKind, 5> kSamplers{{
    // In the order of Device::Sampler.
    {VK_FILTER_NEAREST, VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE, false},
    {VK_FILTER_LINEAR, VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE, false},
    {VK_FILTER_LINEAR, VK_SAMPLER_ADDRESS_MODE_REPEAT, false},
    {VK_FILTER_LINEAR, VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT, false},
    {VK_FILTER_LINEAR, VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE, true},
}};

VkSampler make_sampler(const heddle_vulkan& vk, const SamplerKind& kind) {
  VkSamplerCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO;
  info.magFilter = info.minFilter = kind.filter;
  info.mipmapMode = kind.filter == VK_FILTER_LINEAR ? VK_SAMPLER_MIPMAP_MODE_LINEAR : VK_SAMPLER_MIPMAP_MODE_NEAREST;
  info.addressModeU = info.addressModeV = info.addressModeW = kind.address;
  info.compareEnable = kind.is_compare ? VK_TRUE : VK_FALSE;
  info.compareOp = VK_COMPARE_OP_GREATER_OR_EQUAL;
  info.maxLod = VK_LOD_CLAMP_NONE;
  VkSampler sampler = VK_NULL_HANDLE;
  check(vk.CreateSampler(vk.device, &info, nullptr, &sampler), "vkCreateSampler");
  return sampler;
}

}  // namespace

Device::State::State(const DeviceOptions& options) : sink(options.log), instance(options.validation ? &sink : nullptr) {
  const std::vector<Candidate> candidates = find_candidates(instance);
  const Candidate& chosen = choose(candidates, options.device);
  physical_device = chosen.handle;
  info = chosen.info;
  queue_family = chosen.queue_family;
  VkPhysicalDeviceProperties2 properties{};
  properties.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2;
  instance.GetPhysicalDeviceProperties2(physical_device, &properties);
  limits = properties.properties.limits;
  instance.GetPhysicalDeviceMemoryProperties(physical_device, &memory_properties);

  Features offered;
  instance.GetPhysicalDeviceFeatures2(physical_device, &offered.core);
  ask_for(offered, options.validation, features);
  const float priority = 1;
  const VkDeviceQueueCreateInfo queue_info{.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
                                           .pNext = nullptr,
                                           .flags = 0,
                                           .queueFamilyIndex = queue_family,
                                           .queueCount = 1,
                                           .pQueuePriorities = &priority};
  VkDeviceCreateInfo device_info{};
  device_info.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO;
  device_info.pNext = &features.core;
  device_info.queueCreateInfoCount = 1;
  device_info.pQueueCreateInfos = &queue_info;
  VkDevice device = VK_NULL_HANDLE;
  check(instance.CreateDevice(physical_device, &device_info, nullptr, &device), "vkCreateDevice");
  handle.destroy = reinterpret_cast<PFN_vkDestroyDevice>(instance.GetDeviceProcAddr(device, "vkDestroyDevice"));
  handle.device = device;

  table.emplace(device, physical_device, instance.GetDeviceProcAddr);
  if (options.check) {
    const auto needs = reinterpret_cast<PFN_vkGetImageMemoryRequirements>(
        instance.GetDeviceProcAddr(device, "vkGetImageMemoryRequirements"));
    proof = std::make_unique<Proof>(device, needs);
    table->set_recorder(&proof->recorder);
    if (options.validation) table->use_classic_passes(instance.GetDeviceProcAddr);
  }
  if (features.v12.bufferDeviceAddress == VK_FALSE) table->remove(&heddle_vulkan::GetBufferDeviceAddress);
  if (features.v12.drawIndirectCount == VK_FALSE) {
    table->remove(&heddle_vulkan::CmdDrawIndirectCount);
    table->remove(&heddle_vulkan::CmdDrawIndexedIndirectCount);
  }
  memory.emplace(table->table(), memory_properties, features.v12.bufferDeviceAddress == VK_TRUE);
  pipelines.emplace(table->table());

  try {
    make_objects();
  } catch (...) {
    destroy_objects();
    throw;
  }
}

Device::State::~State() {
  table->table().DeviceWaitIdle(handle.device);
  destroy_objects();
}

std::vector<Diagnostic> Device::State::Proof::take_findings() {
  constexpr std::size_t kEventsKept = 65536;  // for whoever looks at the stream: many frames; some 20 MB
  model.play(recorder.stream(), played);
  played = recorder.stream().events.size();
  if (played > kEventsKept) {
    recorder.forget_events();
    played = 0;
  }
  return model.take_findings();
}

void Device::State::make_objects() {
  const heddle_vulkan& vk = table->table();
  const VkDevice device = vk.device;
  vk.GetDeviceQueue(device, queue_family, 0, &queue);
  const VkCommandPoolCreateInfo pool_info{.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
                                          .pNext = nullptr,
                                          .flags = VK_COMMAND_POOL_CREATE_TRANSIENT_BIT,
                                          .queueFamilyIndex = queue_family};
  check(vk.CreateCommandPool(device, &pool_info, nullptr, &pool), "vkCreateCommandPool");
  const VkCommandBufferAllocateInfo commands_info{.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
                                                  .pNext = nullptr,
                                                  .commandPool = pool,
                                                  .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY,
                                                  .commandBufferCount = 1};
  check(vk.AllocateCommandBuffers(device, &commands_info, &commands), "vkAllocateCommandBuffers");
  const VkFenceCreateInfo fence_info{.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO, .pNext = nullptr, .flags = 0};
  check(vk.CreateFence(device, &fence_info, nullptr, &fence), "vkCreateFence");
  for (std::size_t i = 0; i < samplers.size(); ++i) samplers[i] = make_sampler(vk, kSamplers[i]);
}

void Device::State::destroy_objects() noexcept {
  const heddle_vulkan& vk = table->table();
  for (const VkSampler sampler : samplers) vk.DestroySampler(vk.device, sampler, nullptr);
  vk.DestroyFence(vk.device, fence, nullptr);
  vk.DestroyCommandPool(vk.device, pool, nullptr);
}

Device::Device(const DeviceOptions& options) : state_(std::make_unique<State>(options)) {}
Device::~Device() = default;

const DeviceInfo& Device::info() const {
  return state_->info;
}
const VkPhysicalDeviceLimits& Device::limits() const {
  return state_->limits;
}
const VkPhysicalDeviceFeatures& Device::features() const {
  return state_->features.core.features;
}
const heddle_vulkan& Device::table() const {
  return state_->table->table();
}
VkQueue Device::queue() const {
  return state_->queue;
}
std::uint32_t Device::queue_family() const {
  return state_->queue_family;
}
Counters Device::counters() const {
  return state_->table->counters();
}
PipelineStore& Device::pipelines() const {
  return *state_->pipelines;
}
std::vector<std::string> Device::take_validation_errors() {
  return state_->sink.take_errors();
}
hazard::Recorder* Device::recorder() const {
  return state_->proof ? &state_->proof->recorder : nullptr;
}
void Device::note_host_read(const Buffer& buffer, std::uint64_t offset, std::uint64_t size) {
  if (state_->proof) state_->proof->recorder.host_access(buffer.handle(), false, offset, size);
}
void Device::note_host_write(const Buffer& buffer, std::uint64_t offset, std::uint64_t size) {
  if (state_->proof) state_->proof->recorder.host_access(buffer.handle(), true, offset, size);
}
std::vector<Diagnostic> Device::take_hazards() {
  if (!state_->proof) return {};
  return state_->proof->take_findings();
}
void Device::count_upload(std::uint64_t bytes) {
  state_->table->count_upload(bytes);
}
void Device::count_read_back(std::uint64_t bytes) {
  state_->table->count_read_back(bytes);
}
VkSampler Device::sampler(Sampler which) const {
  return state_->samplers.at(static_cast<std::size_t>(which));
}

VkFormatFeatureFlags Device::format_features(VkFormat format) const {
  VkFormatProperties properties{};
  state_->instance.GetPhysicalDeviceFormatProperties(state_->physical_device, format, &properties);
  return properties.optimalTilingFeatures;
}

bool Device::has_format(VkFormat format, VkFormatFeatureFlags features) const {
  return (format_features(format) & features) == features;
}

void Device::run(const std::function<void(VkCommandBuffer)>& record) {
  const std::scoped_lock lock(state_->run_mutex);
  const heddle_vulkan& vk = table();
  check(vk.ResetCommandPool(vk.device, state_->pool, 0), "vkResetCommandPool");
  const VkCommandBufferBeginInfo begin{.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO,
                                       .pNext = nullptr,
                                       .flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT,
                                       .pInheritanceInfo = nullptr};
  check(vk.BeginCommandBuffer(state_->commands, &begin), "vkBeginCommandBuffer");
  record(state_->commands);
  check(vk.EndCommandBuffer(state_->commands), "vkEndCommandBuffer");

  const VkCommandBufferSubmitInfo commands{.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_SUBMIT_INFO,
                                           .pNext = nullptr,
                                           .commandBuffer = state_->commands,
                                           .deviceMask = 0};
  VkSubmitInfo2 submit{};
  submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO_2;
  submit.commandBufferInfoCount = 1;
  submit.pCommandBufferInfos = &commands;
  check(vk.QueueSubmit2(state_->queue, 1, &submit, state_->fence), "vkQueueSubmit2");
  check(vk.WaitForFences(vk.device, 1, &state_->fence, VK_TRUE, UINT64_MAX), "vkWaitForFences");
  check(vk.ResetFences(vk.device, 1, &state_->fence), "vkResetFences");
}

}  // namespace heddle::vulkan
