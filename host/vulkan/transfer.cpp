// SPDX-License-Identifier: Apache-2.0
// Bytes of the host -> buffers and images of the device, and back, through staging memory and with the barriers.
#include "vulkan/device_state.hpp"

#include <algorithm>
#include <cstring>

namespace heddle::vulkan {
namespace {

constexpr VkAccessFlags2 kAnyAccess = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;

struct Scope {
  VkPipelineStageFlags2 stage;
  VkAccessFlags2 access;
};
// Everything around a transfer: nobody tells what used the resource before or will use it after.
constexpr Scope kAnything{VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, kAnyAccess};
constexpr Scope kCopyRead{VK_PIPELINE_STAGE_2_COPY_BIT, VK_ACCESS_2_TRANSFER_READ_BIT};
constexpr Scope kCopyWrite{VK_PIPELINE_STAGE_2_COPY_BIT, VK_ACCESS_2_TRANSFER_WRITE_BIT};
constexpr Scope kHostRead{VK_PIPELINE_STAGE_2_HOST_BIT, VK_ACCESS_2_HOST_READ_BIT};

void memory_barrier(const heddle_vulkan& vk, VkCommandBuffer commands, Scope from, Scope to) {
  const VkMemoryBarrier2 barrier{.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
                                 .pNext = nullptr,
                                 .srcStageMask = from.stage,
                                 .srcAccessMask = from.access,
                                 .dstStageMask = to.stage,
                                 .dstAccessMask = to.access};
  VkDependencyInfo info{};
  info.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO;
  info.memoryBarrierCount = 1;
  info.pMemoryBarriers = &barrier;
  vk.CmdPipelineBarrier2(commands, &info);
}

/// One layer of one mip of an image, and the layout changes around a copy of it.
struct Texels {
  const Image& image;
  VkImageAspectFlags aspect;
  std::uint32_t layer, mip, width, height;
  std::uint64_t bytes;

  Texels(const Image& of, std::uint32_t of_layer, std::uint32_t of_mip) : image(of), layer(of_layer), mip(of_mip) {
    const ImageShape& shape = of.shape();
    if (layer >= shape.layers || mip >= shape.mips) {
      throw Error(HEDDLE_BUG, Diagnostic{.message = "an image has no such layer or mip",
                                         .found = "layer " + std::to_string(layer) + ", mip " + std::to_string(mip),
                                         .expected = "less than " + std::to_string(shape.layers) + " and " +
                                                     std::to_string(shape.mips)});
    }
    const FormatInfo format = format_info(shape.format);
    aspect = static_cast<VkImageAspectFlags>(format.is_depth ? VK_IMAGE_ASPECT_DEPTH_BIT : VK_IMAGE_ASPECT_COLOR_BIT);
    width = std::max(shape.width >> mip, 1u);
    height = std::max(shape.height >> mip, 1u);
    bytes = image_bytes(shape.format, width, height);
  }

  [[nodiscard]] VkBufferImageCopy copy() const {
    return {.bufferOffset = 0,
            .bufferRowLength = 0,
            .bufferImageHeight = 0,
            .imageSubresource = {aspect, mip, layer, 1},
            .imageOffset = {0, 0, 0},
            .imageExtent = {width, height, 1}};
  }

  void barrier(const heddle_vulkan& vk, VkCommandBuffer commands, Scope from, VkImageLayout old_layout, Scope to,
               VkImageLayout new_layout) const {
    const VkImageMemoryBarrier2 change{.sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2,
                                       .pNext = nullptr,
                                       .srcStageMask = from.stage,
                                       .srcAccessMask = from.access,
                                       .dstStageMask = to.stage,
                                       .dstAccessMask = to.access,
                                       .oldLayout = old_layout,
                                       .newLayout = new_layout,
                                       .srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                       .dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                       .image = image.handle(),
                                       .subresourceRange = {aspect, mip, 1, layer, 1}};
    VkDependencyInfo info{};
    info.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO;
    info.imageMemoryBarrierCount = 1;
    info.pImageMemoryBarriers = &change;
    vk.CmdPipelineBarrier2(commands, &info);
  }
};

void require_range(const Buffer& buffer, std::uint64_t offset, std::uint64_t size) {
  if (offset <= buffer.size() && size <= buffer.size() - offset) return;
  throw Error(HEDDLE_BUG, Diagnostic{.message = "a transfer leaves its buffer",
                                     .found = std::to_string(size) + " bytes at " + std::to_string(offset),
                                     .expected = "within " + std::to_string(buffer.size()) + " bytes"});
}

void require_usage(const Image& image, VkImageUsageFlagBits usage, const char* name) {
  if ((image.shape().usage & usage) != 0) return;
  throw Error(HEDDLE_BUG, "an image is copied that was made without " + std::string(name));
}

}  // namespace

void Device::upload(const Buffer& target, std::uint64_t offset, std::span<const std::byte> bytes) {
  require_range(target, offset, bytes.size());
  if (bytes.empty()) return;
  if (target.data() != nullptr) {
    std::memcpy(target.data() + offset, bytes.data(), bytes.size());
    note_host_write(target, offset, bytes.size());
    count_upload(bytes.size());
    return;
  }
  const Buffer staging = make_buffer(bytes.size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT, true);
  std::memcpy(staging.data(), bytes.data(), bytes.size());
  note_host_write(staging);
  run([&](VkCommandBuffer commands) {
    const heddle_vulkan& vk = table();
    memory_barrier(vk, commands, kAnything, kCopyWrite);
    const VkBufferCopy copy{.srcOffset = 0, .dstOffset = offset, .size = bytes.size()};
    vk.CmdCopyBuffer(commands, staging.handle(), target.handle(), 1, &copy);
    memory_barrier(vk, commands, kCopyWrite, kAnything);
  });
  count_upload(bytes.size());
}

void Device::upload(const Image& target, std::uint32_t layer, std::uint32_t mip, std::span<const std::byte> bytes) {
  const Texels texels(target, layer, mip);
  require_usage(target, VK_IMAGE_USAGE_TRANSFER_DST_BIT, "VK_IMAGE_USAGE_TRANSFER_DST_BIT");
  if (bytes.size() != texels.bytes) {
    throw Error(HEDDLE_BUG, Diagnostic{.message = "an upload has the wrong size",
                                       .found = std::to_string(bytes.size()) + " bytes",
                                       .expected = std::to_string(texels.bytes) + " bytes, " +
                                                   std::to_string(texels.width) + "x" + std::to_string(texels.height) +
                                                   " texels of " + format_text(target.shape().format)});
  }
  const Buffer staging = make_buffer(bytes.size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT, true);
  std::memcpy(staging.data(), bytes.data(), bytes.size());
  note_host_write(staging);
  run([&](VkCommandBuffer commands) {
    const heddle_vulkan& vk = table();
    texels.barrier(vk, commands, kAnything, VK_IMAGE_LAYOUT_UNDEFINED, kCopyWrite,
                   VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
    const VkBufferImageCopy copy = texels.copy();
    vk.CmdCopyBufferToImage(commands, staging.handle(), target.handle(), VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1,
                            &copy);
    texels.barrier(vk, commands, kCopyWrite, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, kAnything,
                   VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL);
  });
  count_upload(bytes.size());
}

std::vector<std::byte> Device::read_back(const Image& source, std::uint32_t layer, std::uint32_t mip,
                                         VkImageLayout layout) {
  std::vector<std::byte> bytes;
  read_back(source, layer, mip, layout,
            [&](std::span<const std::byte> read) { bytes.assign(read.begin(), read.end()); });
  return bytes;
}

void Device::read_back(const Image& source, std::uint32_t layer, std::uint32_t mip, VkImageLayout layout,
                       const std::function<void(std::span<const std::byte>)>& use) {
  const Texels texels(source, layer, mip);
  require_usage(source, VK_IMAGE_USAGE_TRANSFER_SRC_BIT, "VK_IMAGE_USAGE_TRANSFER_SRC_BIT");
  if (layout == VK_IMAGE_LAYOUT_UNDEFINED) {
    throw Error(HEDDLE_BUG, "an image is read back whose content is undefined",
                "name the layout in which the last writer left it");
  }
  const bool is_readable = layout == VK_IMAGE_LAYOUT_GENERAL || layout == VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
  const VkImageLayout copied = is_readable ? layout : VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
  const Buffer staging = make_buffer(texels.bytes, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
  run([&](VkCommandBuffer commands) {
    const heddle_vulkan& vk = table();
    texels.barrier(vk, commands, kAnything, layout, kCopyRead, copied);
    const VkBufferImageCopy copy = texels.copy();
    vk.CmdCopyImageToBuffer(commands, source.handle(), copied, staging.handle(), 1, &copy);
    texels.barrier(vk, commands, kCopyRead, copied, kAnything, layout);
    memory_barrier(vk, commands, kCopyWrite, kHostRead);
  });
  count_read_back(texels.bytes);
  note_host_read(staging);
  use({staging.data(), texels.bytes});
}

std::vector<std::byte> Device::read_back(const Buffer& source, std::uint64_t offset, std::uint64_t size) {
  require_range(source, offset, size);
  if (size == 0) return {};
  const Buffer staging = make_buffer(size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
  run([&](VkCommandBuffer commands) {
    const heddle_vulkan& vk = table();
    memory_barrier(vk, commands, kAnything, kCopyRead);
    const VkBufferCopy copy{.srcOffset = offset, .dstOffset = 0, .size = size};
    vk.CmdCopyBuffer(commands, source.handle(), staging.handle(), 1, &copy);
    memory_barrier(vk, commands, kCopyWrite, kHostRead);
  });
  count_read_back(size);
  note_host_read(staging);
  return {staging.data(), staging.data() + size};
}

}  // namespace heddle::vulkan
