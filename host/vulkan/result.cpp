// SPDX-License-Identifier: Apache-2.0
// VkResult -> Error with the name of the call and of the result.
#include "vulkan/device.hpp"

namespace heddle::vulkan {
namespace {

std::string result_name(VkResult result) {
  switch (result) {
#define HEDDLE_RESULT(name) \
  case name:                \
    return #name;
    HEDDLE_RESULT(VK_SUCCESS)
    HEDDLE_RESULT(VK_NOT_READY)
    HEDDLE_RESULT(VK_TIMEOUT)
    HEDDLE_RESULT(VK_EVENT_SET)
    HEDDLE_RESULT(VK_EVENT_RESET)
    HEDDLE_RESULT(VK_INCOMPLETE)
    HEDDLE_RESULT(VK_ERROR_OUT_OF_HOST_MEMORY)
    HEDDLE_RESULT(VK_ERROR_OUT_OF_DEVICE_MEMORY)
    HEDDLE_RESULT(VK_ERROR_INITIALIZATION_FAILED)
    HEDDLE_RESULT(VK_ERROR_DEVICE_LOST)
    HEDDLE_RESULT(VK_ERROR_MEMORY_MAP_FAILED)
    HEDDLE_RESULT(VK_ERROR_LAYER_NOT_PRESENT)
    HEDDLE_RESULT(VK_ERROR_EXTENSION_NOT_PRESENT)
    HEDDLE_RESULT(VK_ERROR_FEATURE_NOT_PRESENT)
    HEDDLE_RESULT(VK_ERROR_INCOMPATIBLE_DRIVER)
    HEDDLE_RESULT(VK_ERROR_TOO_MANY_OBJECTS)
    HEDDLE_RESULT(VK_ERROR_FORMAT_NOT_SUPPORTED)
    HEDDLE_RESULT(VK_ERROR_FRAGMENTED_POOL)
    HEDDLE_RESULT(VK_ERROR_UNKNOWN)
    HEDDLE_RESULT(VK_ERROR_OUT_OF_POOL_MEMORY)
    HEDDLE_RESULT(VK_ERROR_INVALID_EXTERNAL_HANDLE)
    HEDDLE_RESULT(VK_ERROR_FRAGMENTATION)
    HEDDLE_RESULT(VK_ERROR_INVALID_OPAQUE_CAPTURE_ADDRESS)
    HEDDLE_RESULT(VK_PIPELINE_COMPILE_REQUIRED)
#undef HEDDLE_RESULT
    default:
      return "VkResult " + std::to_string(static_cast<int>(result));
  }
}

std::string_view result_help(VkResult result) {
  switch (result) {
    case VK_ERROR_DEVICE_LOST:
      return "the driver gave the device up, mostly after an endless loop or an access out of bounds in a shader; "
             "make a new device, and look with validation";
    case VK_ERROR_OUT_OF_DEVICE_MEMORY:
    case VK_ERROR_OUT_OF_HOST_MEMORY:
      return "use a smaller extent or fewer textures, or close other programs";
    default:
      return "";
  }
}

}  // namespace

void check(VkResult result, std::string_view call) {
  if (result == VK_SUCCESS) return;
  throw Error(HEDDLE_FAILED, std::string(call) + " failed with " + result_name(result), result_help(result));
}

}  // namespace heddle::vulkan
