// SPDX-License-Identifier: Apache-2.0
// Needs of buffers and images -> pieces of device memory, small ones out of shared blocks.
#pragma once

#include "vulkan/device.hpp"

#include <list>
#include <mutex>

namespace heddle::vulkan {

/// The next multiple of `alignment`.
constexpr std::uint64_t round_up(std::uint64_t value, std::uint64_t alignment) {
  return (value + alignment - 1) / alignment * alignment;
}

/// What is asked of a memory type: `needed` must be there; more of `liked` and less of `disliked` is better.
struct MemoryWish {
  VkMemoryPropertyFlags needed = 0, liked = 0, disliked = 0;
};

struct MemoryRequest {
  VkMemoryRequirements needs{};
  MemoryWish wish;
  bool is_image = false;  // optimally tiled: never in a block with buffers, so that bufferImageGranularity is kept
  bool is_alone = false;  // the driver wants memory of its own for the object
  VkBuffer buffer = VK_NULL_HANDLE;  // the object, if alone
  VkImage image = VK_NULL_HANDLE;
};

/// Memory of one device. Drivers allow as few as 4096 allocations, so small objects share blocks. Thread-safe.
class MemoryPools {
 public:
  MemoryPools(const heddle_vulkan& table, const VkPhysicalDeviceMemoryProperties& properties, bool has_addresses);
  ~MemoryPools();
  MemoryPools(const MemoryPools&) = delete;
  MemoryPools& operator=(const MemoryPools&) = delete;

  /// Throws Error(HEDDLE_FAILED) when no fitting type has room. Pieces of host-visible wishes are mapped.
  MemoryPiece allocate(const MemoryRequest& request);
  void free(const MemoryPiece& piece) noexcept;

 private:
  struct Block;
  [[nodiscard]] std::vector<std::uint32_t> types_for(std::uint32_t allowed, const MemoryWish& wish) const;
  MemoryPiece allocate_alone(const MemoryRequest& request, std::uint32_t type);
  MemoryPiece allocate_shared(const MemoryRequest& request, std::uint32_t type);
  VkResult allocate_memory(const MemoryRequest* alone, std::uint64_t size, std::uint32_t type, bool is_mapped,
                           MemoryPiece& piece);

  const heddle_vulkan& table_;
  VkPhysicalDeviceMemoryProperties properties_;
  bool has_addresses_;
  std::mutex mutex_;
  std::list<Block> blocks_;
};

}  // namespace heddle::vulkan
