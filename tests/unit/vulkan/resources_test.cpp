// SPDX-License-Identifier: Apache-2.0
// Buffers, images and heaps: usage, views, moves, sharing of blocks, aliasing, and errors for shapes that cannot be.
#include "unit/vulkan/on_device.hpp"

#include <cstring>
#include <random>

namespace heddle::vulkan {
namespace {

constexpr VkImageLayout kRead = VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL;

class Resources : public OnDevice {};

TEST_F(Resources, UsageZeroIsAllThatTheFormatAllows) {
  const Image half = device_->make_image({.format = VK_FORMAT_R16G16B16A16_SFLOAT, .width = 8, .height = 8});
  constexpr VkImageUsageFlags kAll = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_STORAGE_BIT |
                                     VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT |
                                     VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  EXPECT_EQ(half.shape().usage, kAll);
  const Image srgb = device_->make_image({.format = VK_FORMAT_R8G8B8A8_SRGB, .width = 8, .height = 8});
  EXPECT_EQ(srgb.shape().usage & VK_IMAGE_USAGE_STORAGE_BIT, 0u);
  EXPECT_NE(srgb.shape().usage & VK_IMAGE_USAGE_SAMPLED_BIT, 0u);
  const Image depth = device_->make_image({.format = VK_FORMAT_D32_SFLOAT, .width = 8, .height = 8});
  EXPECT_NE(depth.shape().usage & VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT, 0u);
  EXPECT_EQ(depth.shape().usage & VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT, 0u);
}

TEST_F(Resources, ViewsAreMadeOnceAndDiffer) {
  const Image cube = device_->make_image(
      {.format = VK_FORMAT_R16G16B16A16_SFLOAT, .width = 16, .height = 16, .layers = 6, .mips = 3, .is_cube = true});
  std::vector<VkImageView> views = {cube.view()};
  for (std::uint32_t mip = 0; mip < 3; ++mip) {
    views.push_back(cube.mip_view(mip));
    for (std::uint32_t layer = 0; layer < 6; ++layer) views.push_back(cube.layer_view(layer, mip));
  }
  std::sort(views.begin(), views.end());
  EXPECT_EQ(std::unique(views.begin(), views.end()), views.end());
  EXPECT_EQ(cube.layer_view(5, 2), cube.layer_view(5, 2));
  EXPECT_EQ(cube.mip_view(1), cube.mip_view(1));
  const Image cubes =
      device_->make_image({.format = VK_FORMAT_R8G8B8A8_UNORM, .width = 4, .height = 4, .layers = 12, .is_cube = true});
  EXPECT_NE(cubes.view(), VkImageView{VK_NULL_HANDLE});
}

TEST_F(Resources, ImagesThatAreOnlyCopiedHaveNoView) {
  const Image image = device_->make_image({.format = VK_FORMAT_R8_UNORM,
                                           .width = 4,
                                           .height = 4,
                                           .usage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT});
  EXPECT_EQ(image.view(), VkImageView{VK_NULL_HANDLE});
}

TEST_F(Resources, MovesLeaveNothingBehind) {
  {
    Buffer first = device_->make_buffer(64, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, true);
    std::byte* const data = first.data();
    Buffer second = std::move(first);
    EXPECT_FALSE(first);
    EXPECT_EQ(first.data(), nullptr);
    EXPECT_EQ(second.data(), data);
    EXPECT_EQ(second.size(), 64u);
    second = device_->make_buffer(32, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, false);
    EXPECT_EQ(device_->counters().live_buffers, 1u);
    Image image = device_->make_image({.format = VK_FORMAT_R8_UNORM, .width = 4, .height = 4});
    (void)image.layer_view(0);
    Image other = std::move(image);
    EXPECT_FALSE(image);
    EXPECT_EQ(device_->counters().live_images, 1u);
    Heap heap = device_->make_heap(4096, ~0u);
    const Heap moved = std::move(heap);
    EXPECT_EQ(heap.size(), 0u);
    EXPECT_EQ(moved.size(), 4096u);
  }
  EXPECT_EQ(device_->counters().live_buffers, 0u);
  EXPECT_EQ(device_->counters().live_images, 0u);
}

TEST_F(Resources, ThousandsOfSmallObjectsNeedFewAllocations) {
  std::vector<Buffer> buffers;
  for (std::uint32_t i = 0; i < 5000; ++i) {  // more than the 4096 allocations that drivers guarantee
    buffers.push_back(device_->make_buffer(1 + i % 300, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, true));
    std::memset(buffers.back().data(), static_cast<int>(i % 251), buffers.back().size());
  }
  EXPECT_LE(device_->counters().device_memory_bytes, 64u << 20);
  for (std::uint32_t i = 0; i < 5000; ++i) {
    ASSERT_EQ(buffers[i].data()[0], static_cast<std::byte>(i % 251));
    ASSERT_EQ(buffers[i].data()[buffers[i].size() - 1], static_cast<std::byte>(i % 251));
  }
}

TEST_F(Resources, NeighboursInABlockKeepTheirTexels) {
  struct Live {
    Image image;
    std::uint32_t seed;
  };
  std::vector<Live> live;
  std::mt19937 random(11);
  const auto size_of = [](const Image& image) { return std::size_t{image.shape().width} * image.shape().height * 4; };
  for (std::uint32_t step = 0; step < 120; ++step) {
    if (live.size() > 20) {
      const std::size_t which = random() % live.size();
      const Live gone = std::exchange(live[which], std::move(live.back()));
      live.pop_back();
      ASSERT_EQ(device_->read_back(gone.image, 0, 0, kRead), pattern(size_of(gone.image), gone.seed));
    }
    const auto width = static_cast<std::uint32_t>(1 + random() % 70);
    const auto height = static_cast<std::uint32_t>(1 + random() % 70);
    Image image = device_->make_image({.format = VK_FORMAT_R8G8B8A8_UNORM, .width = width, .height = height});
    device_->upload(image, 0, 0, pattern(size_of(image), step));
    live.push_back({std::move(image), step});
  }
  for (const Live& each : live) {
    ASSERT_EQ(device_->read_back(each.image, 0, 0, kRead), pattern(size_of(each.image), each.seed));
  }
}

TEST_F(Resources, PlacedImagesShareBytes) {
  const ImageShape shape{.format = VK_FORMAT_R16G16B16A16_SFLOAT, .width = 33, .height = 17};
  const VkMemoryRequirements needs = device_->image_requirements(shape);
  const Heap heap = device_->make_heap(needs.size * 2, needs.memoryTypeBits);
  const std::uint64_t second_place = (needs.size + needs.alignment - 1) / needs.alignment * needs.alignment;
  const Image first = device_->place_image(shape, heap, 0);
  const Image alias = device_->place_image(shape, heap, 0);
  const auto bytes = pattern(std::size_t{33} * 17 * 8, 5);
  device_->upload(first, 0, 0, bytes);
  // Images of one shape, made to alias, read the same texels in the same layout.
  EXPECT_EQ(device_->read_back(alias, 0, 0, kRead), bytes);
  // Another place in the heap is another image.
  const Heap wide = device_->make_heap(second_place + needs.size, needs.memoryTypeBits);
  const Image low = device_->place_image(shape, wide, 0);
  const Image high = device_->place_image(shape, wide, second_place);
  device_->upload(low, 0, 0, bytes);
  device_->upload(high, 0, 0, pattern(bytes.size(), 6));
  EXPECT_EQ(device_->read_back(low, 0, 0, kRead), bytes);
}

TEST_F(Resources, PlacedBuffersShareBytes) {
  constexpr std::uint64_t kBytes = 300001;  // many times any alignment
  const VkMemoryRequirements needs = device_->buffer_requirements(kBytes, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  EXPECT_GE(needs.size, kBytes);
  EXPECT_EQ(needs.size % device_->limits().bufferImageGranularity, 0u);
  const Heap heap = device_->make_heap(needs.size + needs.alignment, needs.memoryTypeBits);
  const Buffer low = device_->place_buffer(kBytes, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, heap, 0);
  const Buffer high = device_->place_buffer(kBytes, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, heap, needs.alignment);
  const auto bytes = pattern(kBytes, 9);
  device_->upload(low, 0, bytes);
  const auto seen = device_->read_back(high, 0, kBytes - needs.alignment);
  EXPECT_TRUE(std::equal(seen.begin(), seen.end(), bytes.begin() + static_cast<std::ptrdiff_t>(needs.alignment)));
}

TEST_F(Resources, PlacesOutsideTheHeapAreErrors) {
  const Heap heap = device_->make_heap(65536, ~0u);
  const auto text =
      error_of([&] { (void)device_->place_buffer(4096, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, heap, 65536 - 2048); });
  EXPECT_TRUE(
      text.starts_with("error: a buffer does not fit its place in the heap\n"
                       "  found:    offset 63488 in 65536 bytes\n"
                       "  expected: 4096 bytes at a multiple of "))
      << text;
  EXPECT_NE(
      error_of([&] { (void)device_->place_image({.format = VK_FORMAT_R8_UNORM, .width = 4, .height = 4}, heap, 1); }),
      "no error");
  EXPECT_EQ(device_->counters().live_buffers, 0u);
  EXPECT_EQ(device_->counters().live_images, 0u);
}

TEST_F(Resources, ShapesThatCannotBeAreErrors) {
  const auto text = [&](const ImageShape& shape) { return error_of([&] { (void)device_->make_image(shape); }); };
  const std::string head = "error: the device cannot make an image of this shape\n";
  EXPECT_EQ(text({.format = VK_FORMAT_R8_UNORM, .width = 0, .height = 4}),
            head + "  found:    r8_unorm 0x4, 1 layers, 1 mips\n  expected: no size of 0");
  EXPECT_EQ(text({.format = VK_FORMAT_R8_UNORM, .width = 8, .height = 4, .mips = 5}),
            head + "  found:    r8_unorm 8x4, 1 layers, 5 mips\n  expected: at most 4 mips");
  EXPECT_EQ(text({.format = VK_FORMAT_R8_UNORM, .width = 8, .height = 8, .layers = 5, .is_cube = true}),
            head + "  found:    r8_unorm 8x8, 5 cube layers, 1 mips\n  expected: square faces, six layers a cube");
  EXPECT_EQ(text({.format = VK_FORMAT_ASTC_4x4_UNORM_BLOCK, .width = 4, .height = 4}),
            head + "  found:    VkFormat 157 4x4, 1 layers, 1 mips\n  expected: a format of the host's list");
  EXPECT_EQ(
      text({.format = VK_FORMAT_D32_SFLOAT, .width = 4, .height = 4, .usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT}),
      head +
          "  found:    d32_sfloat 4x4, 1 layers, 1 mips\n"
          "  expected: a format that the device supports for this usage");
  const std::string huge = text({.format = VK_FORMAT_R8_UNORM, .width = 1u << 20, .height = 4});
  EXPECT_TRUE(huge.starts_with(head + "  found:    r8_unorm 1048576x4, 1 layers, 1 mips\n  expected: at most "))
      << huge;
  EXPECT_EQ(error_of([&] { (void)device_->make_buffer(0, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, false); }),
            "error: a buffer of 0 bytes was asked for");
  EXPECT_EQ(error_of([&] { (void)device_->make_heap(0, ~0u); }), "error: a heap of 0 bytes was asked for");
}

TEST_F(Resources, ViewsOutsideTheImageAreErrors) {
  const Image image =
      device_->make_image({.format = VK_FORMAT_R8_UNORM, .width = 8, .height = 8, .layers = 2, .mips = 2});
  EXPECT_EQ(error_of([&] { (void)image.layer_view(2, 1); }),
            "error: an image has no such layer or mip\n"
            "  found:    layer 2, mip 1\n"
            "  expected: less than 2 and 2");
  EXPECT_EQ(error_of([&] { (void)image.mip_view(2); }),
            "error: an image has no such mip\n"
            "  found:    mip 2\n"
            "  expected: less than 2");
}

}  // namespace
}  // namespace heddle::vulkan
