// SPDX-License-Identifier: Apache-2.0
// Blocks of device memory with lists of free ranges; the smallest range that fits is taken, neighbours are joined.
#include "vulkan/memory.hpp"

#include <algorithm>
#include <bit>
#include <map>
#include <optional>

namespace heddle::vulkan {
namespace {

constexpr std::uint64_t kBlockBytes = 64ull << 20;

}  // namespace

struct MemoryPools::Block {
  MemoryPiece whole;
  std::uint64_t size = 0;
  std::uint32_t type = 0;
  bool is_image = false, is_mapped = false;
  std::map<std::uint64_t, std::uint64_t> free;  // offset -> size
  std::map<std::uint64_t, std::uint64_t> used;

  std::optional<std::uint64_t> take(std::uint64_t bytes, std::uint64_t alignment) {
    auto best = free.end();
    for (auto range = free.begin(); range != free.end(); ++range) {
      const std::uint64_t start = round_up(range->first, alignment);
      if (start + bytes > range->first + range->second) continue;
      if (best == free.end() || range->second < best->second) best = range;
    }
    if (best == free.end()) return std::nullopt;
    const auto [offset, length] = *best;
    const std::uint64_t start = round_up(offset, alignment);
    free.erase(best);
    if (start > offset) free[offset] = start - offset;
    if (offset + length > start + bytes) free[start + bytes] = offset + length - (start + bytes);
    used[start] = bytes;
    return start;
  }

  void give_back(std::uint64_t offset) {
    const auto piece = used.find(offset);
    auto range = free.emplace(piece->first, piece->second).first;
    used.erase(piece);
    const auto next = std::next(range);
    if (next != free.end() && range->first + range->second == next->first) {
      range->second += next->second;
      free.erase(next);
    }
    if (range == free.begin()) return;
    const auto before = std::prev(range);
    if (before->first + before->second == range->first) {
      before->second += range->second;
      free.erase(range);
    }
  }
};

MemoryPools::MemoryPools(const heddle_vulkan& table, const VkPhysicalDeviceMemoryProperties& properties,
                         bool has_addresses)
    : table_(table), properties_(properties), has_addresses_(has_addresses) {}

MemoryPools::~MemoryPools() {
  for (const Block& block : blocks_) table_.FreeMemory(table_.device, block.whole.memory, nullptr);
}

std::vector<std::uint32_t> MemoryPools::types_for(std::uint32_t allowed, const MemoryWish& wish) const {
  // Memory that is lazily allocated, protected or bypasses caches (AMD) is right for nothing that the host makes.
  constexpr VkMemoryPropertyFlags kNever = VK_MEMORY_PROPERTY_LAZILY_ALLOCATED_BIT | VK_MEMORY_PROPERTY_PROTECTED_BIT |
                                           VK_MEMORY_PROPERTY_DEVICE_COHERENT_BIT_AMD |
                                           VK_MEMORY_PROPERTY_DEVICE_UNCACHED_BIT_AMD;
  const auto flags_of = [this](std::uint32_t type) { return properties_.memoryTypes[type].propertyFlags; };
  std::vector<std::uint32_t> types;
  for (std::uint32_t type = 0; type < properties_.memoryTypeCount; ++type) {
    const bool is_fit = (allowed >> type & 1u) != 0 && (flags_of(type) & wish.needed) == wish.needed;
    if (is_fit && (flags_of(type) & kNever) == 0) types.push_back(type);
  }
  const auto score = [&](std::uint32_t type) {
    return std::popcount(flags_of(type) & wish.liked) - std::popcount(flags_of(type) & wish.disliked);
  };
  // Stable: drivers list faster types of equal flags first.
  std::stable_sort(types.begin(), types.end(), [&](auto a, auto b) { return score(a) > score(b); });
  return types;
}

VkResult MemoryPools::allocate_memory(const MemoryRequest* alone, std::uint64_t size, std::uint32_t type,
                                      bool is_mapped, MemoryPiece& piece) {
  const bool is_owned = alone != nullptr && (alone->buffer != VK_NULL_HANDLE || alone->image != VK_NULL_HANDLE);
  const VkMemoryDedicatedAllocateInfo owner{.sType = VK_STRUCTURE_TYPE_MEMORY_DEDICATED_ALLOCATE_INFO,
                                            .pNext = nullptr,
                                            .image = is_owned ? alone->image : VK_NULL_HANDLE,
                                            .buffer = is_owned ? alone->buffer : VK_NULL_HANDLE};
  const VkMemoryAllocateFlagsInfo flags{.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO,
                                        .pNext = is_owned ? &owner : nullptr,
                                        .flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT,
                                        .deviceMask = 0};
  const VkMemoryAllocateInfo info{.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO,
                                  .pNext = has_addresses_ ? static_cast<const void*>(&flags) : flags.pNext,
                                  .allocationSize = size,
                                  .memoryTypeIndex = type};
  const VkResult result = table_.AllocateMemory(table_.device, &info, nullptr, &piece.memory);
  if (result != VK_SUCCESS || !is_mapped) return result;
  void* data = nullptr;
  const VkResult mapped = table_.MapMemory(table_.device, piece.memory, 0, VK_WHOLE_SIZE, 0, &data);
  if (mapped != VK_SUCCESS) {
    table_.FreeMemory(table_.device, piece.memory, nullptr);
    piece.memory = VK_NULL_HANDLE;
  }
  piece.data = static_cast<std::byte*>(data);
  return mapped;
}

MemoryPiece MemoryPools::allocate_alone(const MemoryRequest& request, std::uint32_t type) {
  const bool is_mapped = (request.wish.needed & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT) != 0;
  MemoryPiece piece;
  const VkResult result = allocate_memory(&request, request.needs.size, type, is_mapped, piece);
  return result == VK_SUCCESS ? piece : MemoryPiece{};
}

MemoryPiece MemoryPools::allocate_shared(const MemoryRequest& request, std::uint32_t type) {
  const bool is_mapped = (request.wish.needed & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT) != 0;
  const auto piece_of = [&](Block& block) -> MemoryPiece {
    const auto offset = block.take(request.needs.size, request.needs.alignment);
    if (!offset) return {};
    return {.memory = block.whole.memory,
            .offset = *offset,
            .data = block.whole.data != nullptr ? block.whole.data + *offset : nullptr,
            .block = &block};
  };
  for (Block& block : blocks_) {
    if (block.type != type || block.is_image != request.is_image || block.is_mapped != is_mapped) continue;
    if (const MemoryPiece piece = piece_of(block); piece.block != nullptr) return piece;
  }
  Block& block = blocks_.emplace_back();
  block.size = std::min(kBlockBytes, properties_.memoryHeaps[properties_.memoryTypes[type].heapIndex].size / 8);
  block.type = type;
  block.is_image = request.is_image;
  block.is_mapped = is_mapped;
  if (allocate_memory(nullptr, block.size, type, is_mapped, block.whole) != VK_SUCCESS) {
    blocks_.pop_back();
    return {};
  }
  block.free[0] = block.size;
  return piece_of(block);
}

MemoryPiece MemoryPools::allocate(const MemoryRequest& request) {
  const std::scoped_lock lock(mutex_);
  for (const std::uint32_t type : types_for(request.needs.memoryTypeBits, request.wish)) {
    const std::uint64_t heap = properties_.memoryHeaps[properties_.memoryTypes[type].heapIndex].size;
    // Large objects would leave a block half empty.
    const bool is_large = request.needs.size > std::min(kBlockBytes, heap / 8) / 2;
    MemoryPiece piece;
    if (!request.is_alone && !is_large) piece = allocate_shared(request, type);
    if (piece.memory == VK_NULL_HANDLE) piece = allocate_alone(request, type);
    if (piece.memory != VK_NULL_HANDLE) return piece;
  }
  throw Error(HEDDLE_FAILED, "the device has no memory left for " + std::to_string(request.needs.size) + " bytes",
              "use a smaller extent or fewer textures, or close other programs");
}

void MemoryPools::free(const MemoryPiece& piece) noexcept {
  if (piece.memory == VK_NULL_HANDLE) return;
  const std::scoped_lock lock(mutex_);
  if (piece.block == nullptr) {
    table_.FreeMemory(table_.device, piece.memory, nullptr);
    return;
  }
  Block& block = *static_cast<Block*>(piece.block);
  block.give_back(piece.offset);
  if (!block.used.empty()) return;
  // One empty block of a kind stays, so that making and destroying one object again and again costs nothing.
  const auto is_spare = [&](const Block& other) {
    return &other != &block && other.used.empty() && other.type == block.type && other.is_image == block.is_image &&
           other.is_mapped == block.is_mapped;
  };
  if (std::none_of(blocks_.begin(), blocks_.end(), is_spare)) return;
  table_.FreeMemory(table_.device, block.whole.memory, nullptr);
  blocks_.remove_if([&](const Block& other) { return &other == &block; });
}

}  // namespace heddle::vulkan
