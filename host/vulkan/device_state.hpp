// SPDX-License-Identifier: Apache-2.0
// What a Device is made of, for the files that implement it: device.cpp, resources.cpp, transfer.cpp.
#pragma once

#include "vulkan/device.hpp"
#include "vulkan/hazard_model.hpp"
#include "vulkan/hazard_recorder.hpp"
#include "vulkan/loader.hpp"
#include "vulkan/memory.hpp"
#include "vulkan/pipeline_store.hpp"
#include "vulkan/select.hpp"
#include "vulkan/table.hpp"

#include <array>
#include <optional>

namespace heddle::vulkan {

struct Device::State {
  explicit State(const DeviceOptions& options);
  ~State();
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  void make_objects();
  void destroy_objects() noexcept;

  // In the order of making; destroyed backwards, so that teardown is reported too.
  ValidationSink sink;
  Instance instance;
  VkPhysicalDevice physical_device = VK_NULL_HANDLE;
  DeviceInfo info;
  VkPhysicalDeviceLimits limits{};
  VkPhysicalDeviceMemoryProperties memory_properties{};
  Features features;  // enabled ones
  std::uint32_t queue_family = 0;

  struct Handle {  // destroys the VkDevice after everything that is declared below it
    VkDevice device = VK_NULL_HANDLE;
    PFN_vkDestroyDevice destroy = nullptr;
    ~Handle() {
      if (device != VK_NULL_HANDLE) destroy(device, nullptr);
    }
  } handle;
  VkQueue queue = VK_NULL_HANDLE;
  struct Proof {
    Proof(VkDevice device, PFN_vkGetImageMemoryRequirements needs) : recorder(device, needs) {}
    std::vector<Diagnostic> take_findings();
    hazard::Recorder recorder;
    hazard::Model model;
    std::size_t played = 0;  // events
  };
  std::unique_ptr<Proof> proof;  // check mode alone; outlives the table, which tells it of calls
  std::optional<CountedTable> table;
  std::optional<MemoryPools> memory;
  std::optional<PipelineStore> pipelines;

  // run(): one command buffer, used again and again.
  std::mutex run_mutex;
  VkCommandPool pool = VK_NULL_HANDLE;
  VkCommandBuffer commands = VK_NULL_HANDLE;
  VkFence fence = VK_NULL_HANDLE;
  std::array<VkSampler, 5> samplers{};
};

/// The name of a format for messages; unknown ones get their number.
std::string format_text(VkFormat format);

}  // namespace heddle::vulkan
