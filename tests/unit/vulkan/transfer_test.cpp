// SPDX-License-Identifier: Apache-2.0
// Bytes there and back for every format, layer and mip; the host's decoding against the device's own.
#include "unit/vulkan/on_device.hpp"

#include <cmath>
#include <map>

namespace heddle::vulkan {
namespace {

constexpr VkImageLayout kReadLayout = VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL;

/// All formats that the host knows; none of Vulkan's core formats lies beyond ASTC.
std::vector<VkFormat> all_formats() {
  std::vector<VkFormat> formats;
  for (int number = 1; number <= VK_FORMAT_ASTC_12x12_SRGB_BLOCK; ++number) {
    if (format_info(static_cast<VkFormat>(number)).texel_bytes != 0) formats.push_back(static_cast<VkFormat>(number));
  }
  return formats;
}

class Transfer : public OnDevice {
 protected:
  /// Bits that every device keeps: numbers in range for depth, no NaN whose payload a driver may touch.
  static std::vector<std::byte> texels(VkFormat format, std::size_t count, std::uint32_t seed) {
    const FormatInfo info = format_info(format);
    const auto noise = pattern(count * info.channels, seed);
    std::vector<float> values;
    for (const std::byte byte : noise) values.push_back(static_cast<float>(std::to_integer<int>(byte)) / 255.0f);
    if (std::string_view(info.name).ends_with("int")) {
      for (float& value : values) value = std::round(value * 255);
    }
    return from_float(values, format);
  }
};

TEST_F(Transfer, EveryFormatComesBackFromEveryLayerAndMip) {
  EXPECT_GE(all_formats().size(), 34u);
  for (const VkFormat format : all_formats()) {
    const char* const name = format_info(format).name;
    if (!device_->has_format(format, VK_FORMAT_FEATURE_TRANSFER_SRC_BIT | VK_FORMAT_FEATURE_TRANSFER_DST_BIT)) {
      EXPECT_FALSE(device_->info().is_lavapipe) << name;
      continue;
    }
    const Image image = device_->make_image({.format = format, .width = 13, .height = 7, .layers = 3, .mips = 3});
    const auto size = [](std::uint32_t mip) { return std::size_t{13u >> mip} * (7u >> mip); };
    for (std::uint32_t at = 0; at < 9; ++at) {
      device_->upload(image, at / 3, at % 3, texels(format, size(at % 3), at + 1));
    }
    for (std::uint32_t at = 0; at < 9; ++at) {
      ASSERT_EQ(device_->read_back(image, at / 3, at % 3, kReadLayout), texels(format, size(at % 3), at + 1))
          << name << ", layer " << at / 3 << ", mip " << at % 3;
    }
  }
}

TEST_F(Transfer, BytesAreCounted) {
  const Image image = device_->make_image({.format = VK_FORMAT_R8G8_UNORM, .width = 5, .height = 3});
  device_->upload(image, 0, 0, pattern(30, 1));
  (void)device_->read_back(image, 0, 0, kReadLayout);
  (void)device_->read_back(image, 0, 0, kReadLayout);  // still in its layout
  EXPECT_EQ(device_->counters().uploaded_bytes, 30u);
  EXPECT_EQ(device_->counters().read_back_bytes, 60u);
}

TEST_F(Transfer, BuffersTakeOddSizesAtOddOffsets) {
  for (const bool host_visible : {false, true}) {
    const Buffer buffer = device_->make_buffer(1001, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, host_visible);
    const auto all = pattern(1001, 2);
    const auto part = pattern(13, 3);
    device_->upload(buffer, 0, all);
    device_->upload(buffer, 7, part);
    device_->upload(buffer, 1001, {});
    auto expected = all;
    std::copy(part.begin(), part.end(), expected.begin() + 7);
    EXPECT_EQ(device_->read_back(buffer, 0, 1001), expected);
    EXPECT_EQ(device_->read_back(buffer, 7, 13), part);
    EXPECT_TRUE(device_->read_back(buffer, 3, 0).empty());
  }
}

// A blit to rgba32f decodes on the device. Vulkan defines unorm and snorm as exact quotients; drivers multiply by a
// reciprocal instead, which costs one rounding: two steps of float32 around 1. Floats are exact.
TEST_F(Transfer, HostDecodesAsTheDeviceDoes) {
  constexpr std::uint32_t kWidth = 64, kHeight = 16;
  for (const VkFormat format : all_formats()) {
    const FormatInfo info = format_info(format);
    const std::string_view name = info.name;
    const bool is_number = !name.ends_with("int") && !name.ends_with("srgb") && !info.is_depth;
    if (!is_number || !device_->has_format(format, VK_FORMAT_FEATURE_BLIT_SRC_BIT)) continue;
    if (!device_->has_format(VK_FORMAT_R32G32B32A32_SFLOAT, VK_FORMAT_FEATURE_BLIT_DST_BIT)) continue;
    const Image source = device_->make_image({.format = format, .width = kWidth, .height = kHeight});
    const Image target =
        device_->make_image({.format = VK_FORMAT_R32G32B32A32_SFLOAT, .width = kWidth, .height = kHeight});
    const auto bytes = pattern(std::size_t{kWidth} * kHeight * info.texel_bytes, 4);
    device_->upload(source, 0, 0, bytes);
    device_->upload(target, 0, 0, std::vector<std::byte>(std::size_t{kWidth} * kHeight * 16));
    device_->run([&](VkCommandBuffer commands) {
      const auto change = [&](const Image& image, VkImageLayout from, VkImageLayout to) {
        VkImageMemoryBarrier2 barrier{};
        barrier.sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2;
        barrier.srcStageMask = barrier.dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
        barrier.srcAccessMask = barrier.dstAccessMask = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
        barrier.oldLayout = from;
        barrier.newLayout = to;
        barrier.image = image.handle();
        barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
        VkDependencyInfo dependency{};
        dependency.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO;
        dependency.imageMemoryBarrierCount = 1;
        dependency.pImageMemoryBarriers = &barrier;
        device_->table().CmdPipelineBarrier2(commands, &dependency);
      };
      change(source, kReadLayout, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
      change(target, kReadLayout, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
      const VkOffset3D corner{kWidth, kHeight, 1};
      const VkImageBlit blit{.srcSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1},
                             .srcOffsets = {{0, 0, 0}, corner},
                             .dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1},
                             .dstOffsets = {{0, 0, 0}, corner}};
      device_->table().CmdBlitImage(commands, source.handle(), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, target.handle(),
                                    VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &blit, VK_FILTER_NEAREST);
      change(target, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, kReadLayout);
    });
    const auto on_device = to_float(device_->read_back(target, 0, 0, kReadLayout), VK_FORMAT_R32G32B32A32_SFLOAT);
    const auto on_host = to_float(bytes, format);
    const float tolerance = name.ends_with("norm") || name.ends_with("norm_pack32") ? 1.2e-7f : 0.0f;
    for (std::size_t i = 0; i < on_host.size(); ++i) {
      const float theirs = on_device[i / info.channels * 4 + i % info.channels];
      if (std::isnan(on_host[i])) {
        ASSERT_TRUE(std::isnan(theirs)) << name << " at " << i;
      } else if (std::isinf(on_host[i])) {
        ASSERT_EQ(on_host[i], theirs) << name << " at " << i;
      } else if (std::fpclassify(on_host[i]) == FP_SUBNORMAL) {
        ASSERT_NEAR(on_host[i], theirs, 1.2e-38f) << name;  // blits may flush what is below float32's normal range
      } else {
        ASSERT_NEAR(on_host[i], theirs, tolerance) << name << " at " << i;
      }
    }
  }
}

TEST_F(Transfer, WrongSizesAndLayoutsAreErrors) {
  const Image image = device_->make_image({.format = VK_FORMAT_R8G8_UNORM, .width = 5, .height = 3, .mips = 2});
  EXPECT_EQ(error_of([&] { device_->upload(image, 0, 1, pattern(3, 1)); }),
            "error: an upload has the wrong size\n"
            "  found:    3 bytes\n"
            "  expected: 4 bytes, 2x1 texels of r8g8_unorm");
  EXPECT_EQ(error_of([&] { device_->upload(image, 1, 0, pattern(30, 1)); }),
            "error: an image has no such layer or mip\n"
            "  found:    layer 1, mip 0\n"
            "  expected: less than 1 and 2");
  EXPECT_EQ(error_of([&] { (void)device_->read_back(image, 0, 0, VK_IMAGE_LAYOUT_UNDEFINED); }),
            "error: an image is read back whose content is undefined\n"
            "  help:     name the layout in which the last writer left it");
  const Image sampled = device_->make_image(
      {.format = VK_FORMAT_R8G8_UNORM, .width = 5, .height = 3, .usage = VK_IMAGE_USAGE_SAMPLED_BIT});
  EXPECT_EQ(error_of([&] { (void)device_->read_back(sampled, 0, 0, kReadLayout); }),
            "error: an image is copied that was made without VK_IMAGE_USAGE_TRANSFER_SRC_BIT");
  EXPECT_EQ(error_of([&] { device_->upload(sampled, 0, 0, pattern(30, 1)); }),
            "error: an image is copied that was made without VK_IMAGE_USAGE_TRANSFER_DST_BIT");
  const Buffer buffer = device_->make_buffer(64, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, false);
  EXPECT_EQ(error_of([&] { device_->upload(buffer, 60, pattern(5, 1)); }),
            "error: a transfer leaves its buffer\n"
            "  found:    5 bytes at 60\n"
            "  expected: within 64 bytes");
  EXPECT_EQ(error_of([&] { (void)device_->read_back(buffer, 65, 0); }),
            "error: a transfer leaves its buffer\n"
            "  found:    0 bytes at 65\n"
            "  expected: within 64 bytes");
}

}  // namespace
}  // namespace heddle::vulkan
