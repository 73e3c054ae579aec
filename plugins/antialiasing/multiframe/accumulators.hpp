// SPDX-License-Identifier: Apache-2.0
// What holds the mean, and which of it a device can blend into.
#pragma once

#include <vulkan/vulkan_core.h>

#include <array>
#include <cstdint>
#include <string>

namespace multiframe {

/// The parameter `accumulator`. Blended, the weight has the precision of the mean: devices that can blend into one then
/// can into both.
struct Accumulator {
  const char* name;
  VkFormat mean, blended_weight;
};
inline constexpr std::array<Accumulator, 5> kAccumulators{{
    {"rgba8", VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_R8_UNORM},
    {"rgba16f", VK_FORMAT_R16G16B16A16_SFLOAT, VK_FORMAT_R16_SFLOAT},
    {"rgba16", VK_FORMAT_R16G16B16A16_UNORM, VK_FORMAT_R16_UNORM},
    {"rgba32f", VK_FORMAT_R32G32B32A32_SFLOAT, VK_FORMAT_R32_SFLOAT},
    {"float32_pair", VK_FORMAT_R32G32B32A32_SFLOAT, VK_FORMAT_UNDEFINED},
}};
inline constexpr std::uint32_t kFloat32Pair = 4;

/// Why this accumulator cannot be blended into; "" if it can. features(VkFormat): VkFormatFeatureFlags of the device.
template <typename Features>
std::string why_not_blended(std::uint32_t accumulator, const Features& features) {
  const auto can = [&](const Accumulator& one) {
    if (one.blended_weight == VK_FORMAT_UNDEFINED) return false;
    return (features(one.mean) & features(one.blended_weight) & VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BLEND_BIT) != 0;
  };
  const Accumulator& asked = kAccumulators.at(accumulator);
  if (can(asked)) return {};
  std::string others;
  for (const Accumulator& one : kAccumulators)
    if (can(one)) others += std::string(others.empty() ? "" : ", ") + one.name;
  const std::string what = accumulator == kFloat32Pair ? "two floats are not one that blending could change"
                                                       : "this device does not blend into that format";
  return "accumulation = blend with accumulator = " + std::string(asked.name) + ": " + what +
         "; expected accumulator = " + others + ", or accumulation = compute";
}

}  // namespace multiframe
