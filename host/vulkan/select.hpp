// SPDX-License-Identifier: Apache-2.0
// Physical devices -> which can run the host, which features to ask of it, and which one the user means.
#pragma once

#include "vulkan/device.hpp"
#include "vulkan/loader.hpp"

#include <optional>

namespace heddle::vulkan {

/// Features of core Vulkan 1.3 in one chain; pinned, because the structures point at each other.
struct Features {
  Features();
  Features(const Features&) = delete;
  Features& operator=(const Features&) = delete;

  VkPhysicalDeviceFeatures2 core{};
  VkPhysicalDeviceVulkan11Features v11{};
  VkPhysicalDeviceVulkan12Features v12{};
  VkPhysicalDeviceVulkan13Features v13{};
};

struct Candidate {
  VkPhysicalDevice handle = VK_NULL_HANDLE;
  DeviceInfo info;
  std::uint32_t queue_family = 0;  // with graphics and compute, if usable
};

std::vector<Candidate> find_candidates(const Instance& instance);

/// The one that `wanted` (DeviceOptions::device, not yet resolved) means; throws Error if there is none.
const Candidate& choose(const std::vector<Candidate>& candidates, std::string_view wanted);

/// Fills `wanted` with what the host needs and what it welcomes of `offered`.
void ask_for(const Features& offered, bool validation, Features& wanted);

}  // namespace heddle::vulkan
