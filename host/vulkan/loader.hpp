// SPDX-License-Identifier: Apache-2.0
// libvulkan.so.1, opened at run time, and instances made through it: the functions that exist before a device does.
#pragma once

#include "diagnostics.hpp"

#include <heddle/vulkan_table.h>

#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

namespace heddle::vulkan {

/// The loader's functions that need no instance.
struct Loader {
  PFN_vkGetInstanceProcAddr GetInstanceProcAddr = nullptr;
  PFN_vkCreateInstance CreateInstance = nullptr;
  PFN_vkEnumerateInstanceVersion EnumerateInstanceVersion = nullptr;
  PFN_vkEnumerateInstanceLayerProperties EnumerateInstanceLayerProperties = nullptr;
  PFN_vkEnumerateInstanceExtensionProperties EnumerateInstanceExtensionProperties = nullptr;
};

/// Opens a library and finds the functions; throws Error(HEDDLE_FAILED) that says what to install. It stays open until
/// the process ends, because drivers keep threads.
Loader open_loader(const char* library);
/// libvulkan.so.1, opened by the first call.
const Loader& loader();

/// Collects what the validation layer says; one for each device.
class ValidationSink {
 public:
  explicit ValidationSink(std::function<void(Severity, std::string_view)> log) : log_(std::move(log)) {}
  void report(VkDebugUtilsMessageSeverityFlagBitsEXT severity, const VkDebugUtilsMessengerCallbackDataEXT& data);
  std::vector<std::string> take_errors();

 private:
  std::mutex mutex_;
  std::vector<std::string> errors_;
  std::function<void(Severity, std::string_view)> log_;
};

// The formatter never comes to rest on this list.
// clang-format off
#define HEDDLE_INSTANCE_FUNCTIONS(X)                                                                                  \
  X(DestroyInstance)                                                                                                  \
  X(EnumeratePhysicalDevices)                                                                                         \
  X(GetPhysicalDeviceProperties2)                                                                                     \
  X(GetPhysicalDeviceFeatures2)                                                                                       \
  X(GetPhysicalDeviceMemoryProperties) X(GetPhysicalDeviceQueueFamilyProperties) X(GetPhysicalDeviceFormatProperties) \
      X(GetPhysicalDeviceImageFormatProperties) X(CreateDevice) X(GetDeviceProcAddr)
// clang-format on

/// A Vulkan 1.3 instance and its functions.
class Instance {
 public:
  /// With a sink: the validation layer with synchronization validation reports to it, until the instance is destroyed.
  explicit Instance(ValidationSink* sink);
  ~Instance();
  Instance(const Instance&) = delete;
  Instance& operator=(const Instance&) = delete;

  [[nodiscard]] std::vector<VkPhysicalDevice> physical_devices() const;

#define HEDDLE_INSTANCE_MEMBER(name) PFN_vk##name name = nullptr;
  HEDDLE_INSTANCE_FUNCTIONS(HEDDLE_INSTANCE_MEMBER)
#undef HEDDLE_INSTANCE_MEMBER

 private:
  VkInstance instance_ = VK_NULL_HANDLE;
  VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
  PFN_vkDestroyDebugUtilsMessengerEXT destroy_messenger_ = nullptr;
};

}  // namespace heddle::vulkan
