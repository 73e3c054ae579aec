// SPDX-License-Identifier: Apache-2.0
// Opens the Vulkan loader by name and makes instances, with the validation layer on request.
#include "vulkan/loader.hpp"

#include "vulkan/device.hpp"

#include <dlfcn.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <optional>
#include <utility>

namespace heddle::vulkan {
namespace {

constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";
constexpr const char* kInstallHelp =
    "install a Vulkan loader and a driver; on Debian: apt install libvulkan1 mesa-vulkan-drivers";

/// Sets a variable of the environment while a driver or layer reads it, unless the user has set it. Guarded by
/// environment_mutex(), so that two instances made at once do not undo each other's settings.
class ScopedVariable {
 public:
  ScopedVariable(const char* name, const char* value) {
    if (std::getenv(name) != nullptr) return;
    setenv(name, value, 1);
    name_ = name;
  }
  ~ScopedVariable() {
    if (name_ != nullptr) unsetenv(name_);
  }
  ScopedVariable(const ScopedVariable&) = delete;
  ScopedVariable& operator=(const ScopedVariable&) = delete;

 private:
  const char* name_ = nullptr;
};

std::mutex& environment_mutex() {
  static std::mutex mutex;
  return mutex;
}

VKAPI_ATTR VkBool32 VKAPI_CALL on_message(VkDebugUtilsMessageSeverityFlagBitsEXT severity,
                                          VkDebugUtilsMessageTypeFlagsEXT /*types*/,
                                          const VkDebugUtilsMessengerCallbackDataEXT* data, void* sink) {
  static_cast<ValidationSink*>(sink)->report(severity, *data);
  return VK_FALSE;
}

void require_validation_layer() {
  const std::vector<std::string> layers = list_layers();
  if (std::find(layers.begin(), layers.end(), kValidationLayer) != layers.end()) return;
  throw Error(HEDDLE_FAILED, Diagnostic{.message = "the validation layer is not installed",
                                        .found = layers.empty() ? "no layers" : "layers " + join_names(layers),
                                        .expected = kValidationLayer,
                                        .help = "on Debian: apt install vulkan-validationlayers"});
}

/// Makes one instance that lives as long as the process. A loader without instances closes the drivers, and some do not
/// bear to be opened again and again: NVIDIA's takes memory for thread-local data each time and after some forty times
/// cannot be opened any more. It also makes later instances cheaper. Guarded by environment_mutex().
void keep_drivers_open(const VkApplicationInfo& application) {
  static VkInstance kept = VK_NULL_HANDLE;
  if (kept != VK_NULL_HANDLE) return;
  VkInstanceCreateInfo create{};
  create.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO;
  create.pApplicationInfo = &application;
  if (loader().CreateInstance(&create, nullptr, &kept) != VK_SUCCESS) kept = VK_NULL_HANDLE;
}

template <typename Function>
void find(const Loader& from, VkInstance instance, const char* name, Function& function) {
  function = reinterpret_cast<Function>(from.GetInstanceProcAddr(instance, name));
  if (function == nullptr) {
    throw Error(HEDDLE_FAILED, "the Vulkan loader has no function " + std::string(name), kInstallHelp);
  }
}

}  // namespace

Loader open_loader(const char* library) {
  void* const handle = dlopen(library, RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) {
    const char* const reason = dlerror();
    throw Error(HEDDLE_FAILED, Diagnostic{.message = "the Vulkan loader cannot be opened",
                                          .found = reason != nullptr ? reason : "",
                                          .expected = library,
                                          .help = kInstallHelp});
  }
  Loader result;
  result.GetInstanceProcAddr = reinterpret_cast<PFN_vkGetInstanceProcAddr>(dlsym(handle, "vkGetInstanceProcAddr"));
  if (result.GetInstanceProcAddr == nullptr) {
    throw Error(HEDDLE_FAILED, Diagnostic{.message = "the Vulkan loader cannot be used",
                                          .found = std::string(library) + " without vkGetInstanceProcAddr",
                                          .help = kInstallHelp});
  }
  find(result, nullptr, "vkCreateInstance", result.CreateInstance);
  find(result, nullptr, "vkEnumerateInstanceLayerProperties", result.EnumerateInstanceLayerProperties);
  find(result, nullptr, "vkEnumerateInstanceExtensionProperties", result.EnumerateInstanceExtensionProperties);
  find(result, nullptr, "vkEnumerateInstanceVersion", result.EnumerateInstanceVersion);
  return result;
}

const Loader& loader() {
  static const Loader opened = open_loader("libvulkan.so.1");
  return opened;
}

std::vector<std::string> list_layers() {
  std::uint32_t count = 0;
  check(loader().EnumerateInstanceLayerProperties(&count, nullptr), "vkEnumerateInstanceLayerProperties");
  std::vector<VkLayerProperties> layers(count);
  check(loader().EnumerateInstanceLayerProperties(&count, layers.data()), "vkEnumerateInstanceLayerProperties");
  std::vector<std::string> names;
  for (const VkLayerProperties& layer : layers) names.emplace_back(layer.layerName);
  return names;
}

void ValidationSink::report(VkDebugUtilsMessageSeverityFlagBitsEXT severity,
                            const VkDebugUtilsMessengerCallbackDataEXT& data) {
  const std::string text = data.pMessage != nullptr ? data.pMessage : "";
  const bool is_error = severity >= VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
  const std::scoped_lock lock(mutex_);
  if (is_error) errors_.push_back(text);
  if (log_) log_(is_error ? Severity::kError : Severity::kWarning, text);
}

std::vector<std::string> ValidationSink::take_errors() {
  const std::scoped_lock lock(mutex_);
  return std::exchange(errors_, {});
}

Instance::Instance(ValidationSink* sink) {
  const Loader& from = loader();
  std::uint32_t version = 0;
  check(from.EnumerateInstanceVersion(&version), "vkEnumerateInstanceVersion");
  if (version < VK_API_VERSION_1_3) {
    throw Error(HEDDLE_FAILED, Diagnostic{.message = "the Vulkan loader is too old",
                                          .found = "Vulkan " + std::to_string(VK_API_VERSION_MAJOR(version)) + "." +
                                                   std::to_string(VK_API_VERSION_MINOR(version)),
                                          .expected = "Vulkan 1.3 or newer",
                                          .help = kInstallHelp});
  }
  if (sink != nullptr) require_validation_layer();

  const VkApplicationInfo application{.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO,
                                      .pNext = nullptr,
                                      .pApplicationName = "heddle",
                                      .applicationVersion = 0,
                                      .pEngineName = "heddle",
                                      .engineVersion = 0,
                                      .apiVersion = VK_API_VERSION_1_3};
  constexpr std::array kChecks = {VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT};
  const VkDebugUtilsMessengerCreateInfoEXT messenger{
      .sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT,
      .pNext = nullptr,
      .flags = 0,
      .messageSeverity =
          VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT,
      .messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_TYPE_PERFORMANCE_BIT_EXT,
      .pfnUserCallback = on_message,
      .pUserData = sink};
  const VkValidationFeaturesEXT checks{.sType = VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT,
                                       .pNext = &messenger,
                                       .enabledValidationFeatureCount = std::uint32_t{kChecks.size()},
                                       .pEnabledValidationFeatures = kChecks.data(),
                                       .disabledValidationFeatureCount = 0,
                                       .pDisabledValidationFeatures = nullptr};
  constexpr std::array kExtensions = {VK_EXT_DEBUG_UTILS_EXTENSION_NAME};
  const std::uint32_t with_validation = sink != nullptr ? 1 : 0;
  const VkInstanceCreateInfo create{.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
                                    .pNext = sink != nullptr ? &checks : nullptr,
                                    .flags = 0,
                                    .pApplicationInfo = &application,
                                    .enabledLayerCount = with_validation,
                                    .ppEnabledLayerNames = &kValidationLayer,
                                    .enabledExtensionCount = with_validation,
                                    .ppEnabledExtensionNames = kExtensions.data()};
  {
    const std::scoped_lock lock(environment_mutex());
    // Mesa's device selection layer asks a window system for its order of devices, and complains when there is none.
    // Heddle chooses by itself; whoever steers that layer gets it.
    std::optional<ScopedVariable> no_selection;
    if (std::getenv("MESA_VK_DEVICE_SELECT") == nullptr) no_selection.emplace("NODEVICE_SELECT", "1");
    // The layer finds hazards between submits only when this variable says so; no structure of 1.3.239 does.
    std::optional<ScopedVariable> submit_hazards;
    if (sink != nullptr) {
      submit_hazards.emplace("VK_LAYER_ENABLES", "VALIDATION_CHECK_ENABLE_SYNCHRONIZATION_VALIDATION_QUEUE_SUBMIT");
    }
    const VkResult result = from.CreateInstance(&create, nullptr, &instance_);
    if (result == VK_ERROR_INCOMPATIBLE_DRIVER) {
      throw Error(HEDDLE_FAILED, "no Vulkan driver is installed", kInstallHelp);
    }
    check(result, "vkCreateInstance");
    keep_drivers_open(application);
  }

  try {
#define HEDDLE_FIND(name) find(from, instance_, "vk" #name, name);
    HEDDLE_INSTANCE_FUNCTIONS(HEDDLE_FIND)
#undef HEDDLE_FIND
    if (sink != nullptr) {
      PFN_vkCreateDebugUtilsMessengerEXT create_messenger = nullptr;
      find(from, instance_, "vkCreateDebugUtilsMessengerEXT", create_messenger);
      find(from, instance_, "vkDestroyDebugUtilsMessengerEXT", destroy_messenger_);
      check(create_messenger(instance_, &messenger, nullptr, &messenger_), "vkCreateDebugUtilsMessengerEXT");
    }
  } catch (...) {
    if (DestroyInstance != nullptr) DestroyInstance(instance_, nullptr);
    throw;
  }
}

Instance::~Instance() {
  if (messenger_ != VK_NULL_HANDLE) destroy_messenger_(instance_, messenger_, nullptr);
  DestroyInstance(instance_, nullptr);
}

std::vector<VkPhysicalDevice> Instance::physical_devices() const {
  std::uint32_t count = 0;
  const VkResult result = EnumeratePhysicalDevices(instance_, &count, nullptr);
  if (result != VK_ERROR_INITIALIZATION_FAILED) check(result, "vkEnumeratePhysicalDevices");
  std::vector<VkPhysicalDevice> devices(result == VK_SUCCESS ? count : 0);
  if (!devices.empty()) {
    check(EnumeratePhysicalDevices(instance_, &count, devices.data()), "vkEnumeratePhysicalDevices");
  }
  if (devices.empty()) throw Error(HEDDLE_FAILED, "no Vulkan driver offers a device", kInstallHelp);
  return devices;
}

}  // namespace heddle::vulkan
