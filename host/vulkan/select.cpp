// SPDX-License-Identifier: Apache-2.0
// The host's needs as tables of features; devices measured against them, and the user's choice among devices.
#include "vulkan/select.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstdlib>

namespace heddle::vulkan {
namespace {

template <typename Structure>
struct Feature {
  VkBool32 Structure::*member;
  const char* name;
};

#define HEDDLE_CORE(name)                  \
  Feature<VkPhysicalDeviceFeatures> {      \
    &VkPhysicalDeviceFeatures::name, #name \
  }
#define HEDDLE_11(name)                            \
  Feature<VkPhysicalDeviceVulkan11Features> {      \
    &VkPhysicalDeviceVulkan11Features::name, #name \
  }
#define HEDDLE_12(name)                            \
  Feature<VkPhysicalDeviceVulkan12Features> {      \
    &VkPhysicalDeviceVulkan12Features::name, #name \
  }
#define HEDDLE_13(name)                            \
  Feature<VkPhysicalDeviceVulkan13Features> {      \
    &VkPhysicalDeviceVulkan13Features::name, #name \
  }

// Without these no graph runs; every desktop driver of Vulkan 1.3 has them.
constexpr std::array kNeededCore = {
    HEDDLE_CORE(independentBlend),
    HEDDLE_CORE(multiDrawIndirect),
    HEDDLE_CORE(drawIndirectFirstInstance),
    HEDDLE_CORE(imageCubeArray),
    HEDDLE_CORE(shaderStorageImageWriteWithoutFormat),
    HEDDLE_CORE(shaderStorageImageExtendedFormats),
};
constexpr std::array kNeeded12 = {HEDDLE_12(timelineSemaphore),           HEDDLE_12(hostQueryReset),
                                  HEDDLE_12(separateDepthStencilLayouts), HEDDLE_12(uniformBufferStandardLayout),
                                  HEDDLE_12(vulkanMemoryModel),           HEDDLE_12(vulkanMemoryModelDeviceScope)};
constexpr std::array kNeeded13 = {HEDDLE_13(synchronization2), HEDDLE_13(dynamicRendering), HEDDLE_13(maintenance4),
                                  HEDDLE_13(shaderDemoteToHelperInvocation), HEDDLE_13(shaderTerminateInvocation)};

// Asked for where present.
constexpr std::array kWelcomeCore = {
    HEDDLE_CORE(samplerAnisotropy),
    HEDDLE_CORE(textureCompressionBC),
    HEDDLE_CORE(dualSrcBlend),
    HEDDLE_CORE(fragmentStoresAndAtomics),
    HEDDLE_CORE(vertexPipelineStoresAndAtomics),
    HEDDLE_CORE(shaderInt64),
    HEDDLE_CORE(shaderFloat64),
    HEDDLE_CORE(shaderInt16),
    HEDDLE_CORE(shaderImageGatherExtended),
    HEDDLE_CORE(shaderUniformBufferArrayDynamicIndexing),
    HEDDLE_CORE(shaderSampledImageArrayDynamicIndexing),
    HEDDLE_CORE(shaderStorageBufferArrayDynamicIndexing),
    HEDDLE_CORE(shaderStorageImageArrayDynamicIndexing),
    HEDDLE_CORE(shaderClipDistance),
    HEDDLE_CORE(shaderCullDistance),
    HEDDLE_CORE(fullDrawIndexUint32),
    HEDDLE_CORE(tessellationShader),
    HEDDLE_CORE(geometryShader),
    HEDDLE_CORE(depthClamp),
    HEDDLE_CORE(fillModeNonSolid),
    HEDDLE_CORE(occlusionQueryPrecise),
    HEDDLE_CORE(pipelineStatisticsQuery),
};
constexpr std::array kWelcome11 = {HEDDLE_11(shaderDrawParameters), HEDDLE_11(storageBuffer16BitAccess),
                                   HEDDLE_11(multiview)};
constexpr std::array kWelcome12 = {HEDDLE_12(drawIndirectCount),
                                   HEDDLE_12(bufferDeviceAddress),
                                   HEDDLE_12(scalarBlockLayout),
                                   HEDDLE_12(shaderFloat16),
                                   HEDDLE_12(shaderInt8),
                                   HEDDLE_12(storageBuffer8BitAccess),
                                   HEDDLE_12(shaderBufferInt64Atomics),
                                   HEDDLE_12(samplerMirrorClampToEdge)};
constexpr std::array kWelcome13 = {HEDDLE_13(subgroupSizeControl), HEDDLE_13(computeFullSubgroups),
                                   HEDDLE_13(shaderZeroInitializeWorkgroupMemory), HEDDLE_13(shaderIntegerDotProduct)};

template <typename Structure, std::size_t N>
void name_missing(const Structure& offered, const std::array<Feature<Structure>, N>& needed,
                  std::vector<std::string>& missing) {
  for (const auto& feature : needed) {
    if (offered.*feature.member == VK_FALSE) missing.emplace_back(feature.name);
  }
}

template <typename Structure, std::size_t N>
void take(const Structure& offered, const std::array<Feature<Structure>, N>& features, Structure& wanted) {
  for (const auto& feature : features) wanted.*feature.member = offered.*feature.member;
}

std::optional<std::uint32_t> find_queue_family(const Instance& instance, VkPhysicalDevice device) {
  std::uint32_t count = 0;
  instance.GetPhysicalDeviceQueueFamilyProperties(device, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  instance.GetPhysicalDeviceQueueFamilyProperties(device, &count, families.data());
  constexpr VkQueueFlags kBoth = VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT;
  for (std::uint32_t i = 0; i < count; ++i) {
    if ((families[i].queueFlags & kBoth) == kBoth) return i;
  }
  return std::nullopt;
}

const char* type_name(VkPhysicalDeviceType type) {
  switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_CPU:
      return "cpu";
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:
      return "discrete";
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU:
      return "integrated";
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU:
      return "virtual";
    default:
      return "other";
  }
}

std::string version_text(std::uint32_t version) {
  return std::to_string(VK_API_VERSION_MAJOR(version)) + "." + std::to_string(VK_API_VERSION_MINOR(version)) + "." +
         std::to_string(VK_API_VERSION_PATCH(version));
}

Candidate describe(const Instance& instance, VkPhysicalDevice handle, std::uint32_t index) {
  VkPhysicalDeviceDriverProperties driver{};
  driver.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES;
  VkPhysicalDeviceProperties2 properties{};
  properties.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2;
  properties.pNext = &driver;
  instance.GetPhysicalDeviceProperties2(handle, &properties);

  Candidate result;
  result.handle = handle;
  DeviceInfo& info = result.info;
  info.index = index;
  info.name = properties.properties.deviceName;
  info.driver = driver.driverName;
  info.driver_version = driver.driverInfo;
  info.type = type_name(properties.properties.deviceType);
  info.api_version = properties.properties.apiVersion;
  info.is_lavapipe = driver.driverID == VK_DRIVER_ID_MESA_LLVMPIPE;

  if (info.api_version < VK_API_VERSION_1_3) {
    info.missing = "Vulkan 1.3 (it offers " + version_text(info.api_version) + ")";
    return result;
  }
  Features offered;
  instance.GetPhysicalDeviceFeatures2(handle, &offered.core);
  std::vector<std::string> missing;
  name_missing(offered.core.features, kNeededCore, missing);
  name_missing(offered.v12, kNeeded12, missing);
  name_missing(offered.v13, kNeeded13, missing);
  if (const auto family = find_queue_family(instance, handle)) {
    result.queue_family = *family;
  } else {
    missing.emplace_back("a queue with graphics and compute");
  }
  info.missing = join_names(missing);
  info.is_usable = missing.empty();
  return result;
}

std::string lower(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return result;
}

bool is_named(const Candidate& candidate, const std::string& part) {
  return lower(candidate.info.name).find(part) != std::string::npos ||
         lower(candidate.info.driver).find(part) != std::string::npos ||
         (candidate.info.is_lavapipe && std::string_view("lavapipe").find(part) != std::string_view::npos);
}

std::string listing(const std::vector<Candidate>& candidates) {
  std::vector<std::string> lines;
  for (const Candidate& candidate : candidates) {
    lines.push_back(std::to_string(candidate.info.index) + " " + candidate.info.name);
  }
  return join_names(lines);
}

const Candidate& usable(const Candidate& candidate) {
  if (candidate.info.is_usable) return candidate;
  throw Error(HEDDLE_UNSUPPORTED, Diagnostic{.message = "the device \"" + candidate.info.name + "\" cannot run Heddle",
                                             .found = "it lacks " + candidate.info.missing,
                                             .help = "update its driver, or choose another device: "
                                                     "HEDDLE_DEVICE=lavapipe is software and always works"});
}

}  // namespace

Features::Features() {
  core.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
  v11.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_FEATURES;
  v12.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
  v13.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES;
  core.pNext = &v11;
  v11.pNext = &v12;
  v12.pNext = &v13;
}

std::vector<Candidate> find_candidates(const Instance& instance) {
  std::vector<Candidate> result;
  for (const VkPhysicalDevice handle : instance.physical_devices()) {
    result.push_back(describe(instance, handle, static_cast<std::uint32_t>(result.size())));
  }
  return result;
}

const Candidate& choose(const std::vector<Candidate>& candidates, std::string_view wanted) {
  std::string source = "the device that was asked for";
  std::string name(wanted);
  if (name.empty()) {
    if (const char* const variable = std::getenv("HEDDLE_DEVICE")) {
      name = variable;
      source = "HEDDLE_DEVICE";
    }
  }
  if (name.empty()) {
    const auto is_usable = [](const Candidate& candidate) { return candidate.info.is_usable; };
    const auto is_lavapipe = [](const Candidate& candidate) {
      return candidate.info.is_usable && candidate.info.is_lavapipe;
    };
    auto found = std::find_if(candidates.begin(), candidates.end(), is_lavapipe);
    if (found == candidates.end()) found = std::find_if(candidates.begin(), candidates.end(), is_usable);
    return usable(found != candidates.end() ? *found : candidates.front());
  }

  std::uint32_t index = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), index);
  const bool is_number = error == std::errc() && end == name.data() + name.size();
  if (is_number && index < candidates.size()) return usable(candidates[index]);
  const std::string part = lower(name);
  const Candidate* first = nullptr;  // a match that cannot run tells more than "not found"
  for (const Candidate& candidate : candidates) {
    // "4090" is part of a name, but "9" an index that does not exist.
    if ((is_number && name.size() < 3) || !is_named(candidate, part)) continue;
    if (candidate.info.is_usable) return candidate;
    if (first == nullptr) first = &candidate;
  }
  if (first != nullptr) return usable(*first);
  throw Error(HEDDLE_BAD_INPUT, Diagnostic{.message = source + " does not exist",
                                           .found = "\"" + name + "\"",
                                           .expected = "an index or part of a name of: " + listing(candidates),
                                           .help = "leave it out to take lavapipe, or else the first usable device"});
}

void ask_for(const Features& offered, bool validation, Features& wanted) {
  take(offered.core.features, kNeededCore, wanted.core.features);
  take(offered.v12, kNeeded12, wanted.v12);
  take(offered.v13, kNeeded13, wanted.v13);
  take(offered.core.features, kWelcomeCore, wanted.core.features);
  take(offered.v11, kWelcome11, wanted.v11);
  take(offered.v12, kWelcome12, wanted.v12);
  take(offered.v13, kWelcome13, wanted.v13);
  // Checked accesses cost time on GPUs, so only those who look for errors get them.
  if (validation) wanted.core.features.robustBufferAccess = offered.core.features.robustBufferAccess;
}

std::vector<DeviceInfo> list_devices() {
  const Instance instance(nullptr);
  std::vector<DeviceInfo> result;
  for (const Candidate& candidate : find_candidates(instance)) result.push_back(candidate.info);
  return result;
}

}  // namespace heddle::vulkan
