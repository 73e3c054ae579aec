// SPDX-License-Identifier: Apache-2.0
// Memory pools against a driver that the test plays: a GPU with separate heaps, little room, and a count of
// allocations.
#include "vulkan/memory.hpp"

#include <gtest/gtest.h>

#include <map>
#include <random>

namespace heddle::vulkan {
namespace {

constexpr std::uint64_t kMiB = 1ull << 20;
constexpr std::uint64_t kGiB = 1ull << 30;

// Types in the order of a discrete GPU's driver.
constexpr std::uint32_t kDevice = 0, kHost = 1, kHostCached = 2, kWindow = 3, kUncached = 4;

struct Allocated {
  std::uint64_t size = 0;
  std::uint32_t type = 0;
  bool is_owned = false;
  std::unique_ptr<std::byte[]> mapped;
};

/// The driver. Functions of the table have no user pointer, hence the one instance; one test at a time uses it.
struct Driver {
  std::map<std::uint64_t, Allocated> live;
  std::uint64_t next = 1, total = 0;
  std::map<std::uint32_t, std::uint64_t> room;  // by type; no entry: plenty
};
Driver* driver = nullptr;

std::uint64_t number(VkDeviceMemory memory) {
  return reinterpret_cast<std::uint64_t>(memory);
}

VkResult VKAPI_CALL allocate(VkDevice, const VkMemoryAllocateInfo* info, const VkAllocationCallbacks*,
                             VkDeviceMemory* memory) {
  const auto room = driver->room.find(info->memoryTypeIndex);
  if (room != driver->room.end()) {
    if (room->second < info->allocationSize) return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    room->second -= info->allocationSize;
  }
  const auto* next = static_cast<const VkBaseInStructure*>(info->pNext);
  const bool is_owned = next != nullptr && next->sType == VK_STRUCTURE_TYPE_MEMORY_DEDICATED_ALLOCATE_INFO;
  driver->live[driver->next] = {info->allocationSize, info->memoryTypeIndex, is_owned, nullptr};
  *memory = reinterpret_cast<VkDeviceMemory>(driver->next++);
  ++driver->total;
  return VK_SUCCESS;
}
void VKAPI_CALL free_memory(VkDevice, VkDeviceMemory memory, const VkAllocationCallbacks*) {
  EXPECT_EQ(driver->live.erase(number(memory)), 1u) << "freed twice or never allocated";
}
VkResult VKAPI_CALL map(VkDevice, VkDeviceMemory memory, VkDeviceSize, VkDeviceSize, VkMemoryMapFlags, void** data) {
  Allocated& allocated = driver->live.at(number(memory));
  allocated.mapped = std::make_unique_for_overwrite<std::byte[]>(allocated.size);
  *data = allocated.mapped.get();
  return VK_SUCCESS;
}

class Memory : public testing::Test {
 protected:
  Memory() {
    driver = &driver_;
    table_.AllocateMemory = allocate;
    table_.FreeMemory = free_memory;
    table_.MapMemory = map;
    properties_.memoryHeapCount = 3;
    properties_.memoryHeaps[0] = {24 * kGiB, VK_MEMORY_HEAP_DEVICE_LOCAL_BIT};
    properties_.memoryHeaps[1] = {32 * kGiB, 0};
    properties_.memoryHeaps[2] = {256 * kMiB, VK_MEMORY_HEAP_DEVICE_LOCAL_BIT};
    constexpr VkMemoryPropertyFlags kLocal = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
    constexpr VkMemoryPropertyFlags kMapped =
        VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    properties_.memoryTypeCount = 5;
    properties_.memoryTypes[kDevice] = {kLocal, 0};
    properties_.memoryTypes[kHost] = {kMapped, 1};
    properties_.memoryTypes[kHostCached] = {kMapped | VK_MEMORY_PROPERTY_HOST_CACHED_BIT, 1};
    properties_.memoryTypes[kWindow] = {kMapped | kLocal, 2};
    properties_.memoryTypes[kUncached] = {kLocal | VK_MEMORY_PROPERTY_DEVICE_UNCACHED_BIT_AMD, 0};
  }
  ~Memory() override {
    EXPECT_TRUE(driver_.live.empty()) << "leaked";
    driver = nullptr;
  }
  [[nodiscard]] std::uint32_t type_of(const MemoryPiece& piece) const {
    return driver_.live.at(number(piece.memory)).type;
  }
  static MemoryRequest request(std::uint64_t size, bool is_image = false, std::uint64_t alignment = 256) {
    MemoryRequest result;
    result.needs = {.size = size, .alignment = alignment, .memoryTypeBits = 0x1f};
    result.wish = {
        .needed = 0, .liked = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, .disliked = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT};
    result.is_image = is_image;
    return result;
  }
  static MemoryRequest mapped(VkMemoryPropertyFlags liked, VkMemoryPropertyFlags disliked) {
    MemoryRequest result = request(kMiB);
    result.wish = {.needed = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT,
                   .liked = liked,
                   .disliked = disliked};
    return result;
  }

  Driver driver_;
  heddle_vulkan table_{};
  VkPhysicalDeviceMemoryProperties properties_{};
};

TEST_F(Memory, ChoosesTheTypeThatFitsTheWish) {
  MemoryPools pools(table_, properties_, false);
  const MemoryPiece image = pools.allocate(request(kMiB, true));
  EXPECT_EQ(type_of(image), kDevice);
  EXPECT_EQ(image.data, nullptr);
  const MemoryPiece staging = pools.allocate(mapped(0, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT));
  EXPECT_EQ(type_of(staging), kHost);
  EXPECT_NE(staging.data, nullptr);
  EXPECT_EQ(type_of(pools.allocate(mapped(VK_MEMORY_PROPERTY_HOST_CACHED_BIT, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT))),
            kHostCached);
  EXPECT_EQ(type_of(pools.allocate(mapped(VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, 0))), kWindow);
}

TEST_F(Memory, FallsBackToAnotherTypeWhenAHeapIsFull) {
  driver_.room[kDevice] = 10 * kMiB;  // less than a block: memory for the object alone still fits
  MemoryPools pools(table_, properties_, false);
  const MemoryPiece first = pools.allocate(request(8 * kMiB));
  EXPECT_EQ(type_of(first), kDevice);
  const MemoryPiece second = pools.allocate(request(8 * kMiB));
  EXPECT_EQ(type_of(second), kWindow);
  pools.free(first);
  pools.free(second);
}

TEST_F(Memory, SaysHowMuchDidNotFit) {
  for (std::uint32_t type = 0; type < 5; ++type) driver_.room[type] = 0;
  MemoryPools pools(table_, properties_, false);
  try {
    pools.allocate(request(123456));
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), HEDDLE_FAILED);
    EXPECT_EQ(to_text(error.diagnostics()),
              "error: the device has no memory left for 123456 bytes\n"
              "  help:     use a smaller extent or fewer textures, or close other programs");
  }
}

TEST_F(Memory, SharesBlocksAmongSmallObjectsButNotImagesWithBuffers) {
  MemoryPools pools(table_, properties_, false);
  const MemoryPiece buffer = pools.allocate(request(1000));
  const MemoryPiece other = pools.allocate(request(1000));
  const MemoryPiece image = pools.allocate(request(1000, true));
  EXPECT_EQ(buffer.memory, other.memory);
  EXPECT_NE(buffer.memory, image.memory);
  EXPECT_EQ(other.offset, 1024u);  // the next multiple of 256
}

TEST_F(Memory, GivesLargeAndOwnedObjectsMemoryOfTheirOwn) {
  MemoryPools pools(table_, properties_, false);
  const MemoryPiece large = pools.allocate(request(33 * kMiB));
  EXPECT_EQ(large.block, nullptr);
  EXPECT_EQ(driver_.live.at(number(large.memory)).size, 33 * kMiB);
  MemoryRequest owned = request(kMiB, true);
  owned.is_alone = true;
  owned.image = reinterpret_cast<VkImage>(77);
  const MemoryPiece alone = pools.allocate(owned);
  EXPECT_TRUE(driver_.live.at(number(alone.memory)).is_owned);
  pools.free(large);
  pools.free(alone);
  EXPECT_TRUE(driver_.live.empty());
}

TEST_F(Memory, KeepsOneEmptyBlockForTheNextObject) {
  MemoryPools pools(table_, properties_, false);
  for (int i = 0; i < 100; ++i) pools.free(pools.allocate(request(kMiB)));
  EXPECT_EQ(driver_.total, 1u);
  std::vector<MemoryPiece> pieces;
  for (int i = 0; i < 40; ++i) pieces.push_back(pools.allocate(request(16 * kMiB)));
  EXPECT_EQ(driver_.live.size(), 10u);
  for (const MemoryPiece& piece : pieces) pools.free(piece);
  EXPECT_EQ(driver_.live.size(), 1u);
}

TEST_F(Memory, NeverHandsOutTheSameByteTwice) {
  MemoryPools pools(table_, properties_, false);
  std::mt19937 random(3);
  struct Live {
    MemoryPiece piece;
    std::uint64_t size;
  };
  std::vector<Live> live;
  std::map<std::pair<std::uint64_t, std::uint64_t>, std::uint64_t> used;  // memory, offset -> size
  for (int step = 0; step < 20000; ++step) {
    if (!live.empty() && random() % 2 == 0) {
      const std::size_t which = random() % live.size();
      used.erase({number(live[which].piece.memory), live[which].piece.offset});
      pools.free(live[which].piece);
      live[which] = live.back();
      live.pop_back();
      continue;
    }
    const std::uint64_t size = 1 + random() % (step % 50 == 0 ? 40 * kMiB : 200000);
    const std::uint64_t alignment = 1ull << random() % 17;
    const MemoryPiece piece = pools.allocate(request(size, random() % 2 == 0, alignment));
    ASSERT_EQ(piece.offset % alignment, 0u);
    const std::uint64_t memory = number(piece.memory);
    ASSERT_LE(piece.offset + size, driver_.live.at(memory).size);
    const auto next = used.lower_bound({memory, piece.offset});
    if (next != used.end() && next->first.first == memory) {
      ASSERT_LE(piece.offset + size, next->first.second);
    }
    if (next != used.begin() && std::prev(next)->first.first == memory) {
      ASSERT_LE(std::prev(next)->first.second + std::prev(next)->second, piece.offset);
    }
    used[{memory, piece.offset}] = size;
    live.push_back({piece, size});
  }
  for (const Live& object : live) pools.free(object.piece);
  // Everything was joined again: a whole block's worth fits where small pieces were.
  const std::uint64_t before = driver_.total;
  const MemoryPiece whole = pools.allocate(request(32 * kMiB));
  const MemoryPiece rest = pools.allocate(request(32 * kMiB));
  EXPECT_EQ(whole.memory, rest.memory);
  EXPECT_EQ(driver_.total, before);
}

}  // namespace
}  // namespace heddle::vulkan
