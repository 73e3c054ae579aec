// SPDX-License-Identifier: Apache-2.0
// Shapes -> Vulkan buffers and images with memory and views, on their own or placed in a heap.
#include "vulkan/device_state.hpp"

#include <algorithm>
#include <bit>
#include <utility>

namespace heddle::vulkan {
namespace {

constexpr VkBufferUsageFlags kCopies = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;

VkBufferCreateInfo buffer_info(std::uint64_t size, VkBufferUsageFlags usage) {
  return {.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO,
          .pNext = nullptr,
          .flags = 0,
          .size = size,
          .usage = usage | kCopies,
          .sharingMode = VK_SHARING_MODE_EXCLUSIVE,
          .queueFamilyIndexCount = 0,
          .pQueueFamilyIndices = nullptr};
}

VkImageCreateInfo image_info(const ImageShape& shape, bool is_placed) {
  VkImageCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
  if (shape.is_cube) info.flags |= VK_IMAGE_CREATE_CUBE_COMPATIBLE_BIT;
  if (is_placed) info.flags |= VK_IMAGE_CREATE_ALIAS_BIT;
  info.imageType = VK_IMAGE_TYPE_2D;
  info.format = shape.format;
  info.extent = {shape.width, shape.height, 1};
  info.mipLevels = shape.mips;
  info.arrayLayers = shape.layers;
  info.samples = VK_SAMPLE_COUNT_1_BIT;
  info.tiling = VK_IMAGE_TILING_OPTIMAL;
  info.usage = shape.usage;
  info.sharingMode = VK_SHARING_MODE_EXCLUSIVE;
  info.initialLayout = VK_IMAGE_LAYOUT_UNDEFINED;
  return info;
}

bool is_srgb(VkFormat format) {
  return format == VK_FORMAT_R8G8B8A8_SRGB;
}

/// What usage 0 stands for.
VkImageUsageFlags all_usage(VkFormat format, VkFormatFeatureFlags features) {
  struct Pair {
    VkFormatFeatureFlagBits feature;
    VkImageUsageFlagBits usage;
  };
  constexpr std::array<Pair, 6> kPairs{
      {{VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT, VK_IMAGE_USAGE_SAMPLED_BIT},
       {VK_FORMAT_FEATURE_STORAGE_IMAGE_BIT, VK_IMAGE_USAGE_STORAGE_BIT},
       {VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BIT, VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT},
       {VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT, VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT},
       {VK_FORMAT_FEATURE_TRANSFER_SRC_BIT, VK_IMAGE_USAGE_TRANSFER_SRC_BIT},
       {VK_FORMAT_FEATURE_TRANSFER_DST_BIT, VK_IMAGE_USAGE_TRANSFER_DST_BIT}}};
  VkImageUsageFlags usage = 0;
  for (const Pair& pair : kPairs) {
    if ((features & pair.feature) != 0) usage |= pair.usage;
  }
  // Some drivers offer stores to sRGB, but convert on none or on some of them.
  if (is_srgb(format)) usage &= ~static_cast<VkImageUsageFlags>(VK_IMAGE_USAGE_STORAGE_BIT);
  return usage;
}

std::string shape_text(const ImageShape& shape) {
  return format_text(shape.format) + " " + std::to_string(shape.width) + "x" + std::to_string(shape.height) + ", " +
         std::to_string(shape.layers) + (shape.is_cube ? " cube" : "") + " layers, " + std::to_string(shape.mips) +
         " mips";
}

/// So that linear and optimal neighbours in one heap never share a page of bufferImageGranularity.
VkMemoryRequirements keep_granularity(VkMemoryRequirements needs, std::uint64_t granularity) {
  needs.alignment = std::max(needs.alignment, granularity);  // both are powers of two
  needs.size = round_up(needs.size, granularity);
  return needs;
}

void require_fit(const Heap& heap, std::uint64_t offset, const VkMemoryRequirements& needs, const char* what) {
  if (offset % needs.alignment == 0 && offset <= heap.size() && needs.size <= heap.size() - offset) return;
  throw Error(HEDDLE_BUG,
              Diagnostic{.message = std::string(what) + " does not fit its place in the heap",
                         .found = "offset " + std::to_string(offset) + " in " + std::to_string(heap.size()) + " bytes",
                         .expected = std::to_string(needs.size) + " bytes at a multiple of " +
                                     std::to_string(needs.alignment)});
}

/// Checks a shape against the device and fills in usage.
ImageShape resolve_shape(const Instance& instance, VkPhysicalDevice device, ImageShape shape) {
  const auto fail = [&](const std::string& expected) {
    throw Error(HEDDLE_UNSUPPORTED, Diagnostic{.message = "the device cannot make an image of this shape",
                                               .found = shape_text(shape),
                                               .expected = expected});
  };
  if (format_info(shape.format).channels == 0) fail("a format of the host's list");
  if (shape.width == 0 || shape.height == 0 || shape.layers == 0 || shape.mips == 0) fail("no size of 0");
  if (shape.is_cube && (shape.layers % 6 != 0 || shape.width != shape.height)) {
    fail("square faces, six layers a cube");
  }
  const std::uint32_t most_mips = static_cast<std::uint32_t>(std::bit_width(std::max(shape.width, shape.height)));
  if (shape.mips > most_mips) fail("at most " + std::to_string(most_mips) + " mips");
  if (shape.usage == 0) {
    VkFormatProperties properties{};
    instance.GetPhysicalDeviceFormatProperties(device, shape.format, &properties);
    shape.usage = all_usage(shape.format, properties.optimalTilingFeatures);
    if (shape.usage == 0) fail("a format that the device supports");
  }
  const VkImageCreateInfo info = image_info(shape, false);
  VkImageFormatProperties limits{};
  const VkResult result = instance.GetPhysicalDeviceImageFormatProperties(device, info.format, info.imageType,
                                                                          info.tiling, info.usage, info.flags, &limits);
  if (result == VK_ERROR_FORMAT_NOT_SUPPORTED) fail("a format that the device supports for this usage");
  check(result, "vkGetPhysicalDeviceImageFormatProperties");
  if (shape.width > limits.maxExtent.width || shape.height > limits.maxExtent.height ||
      shape.layers > limits.maxArrayLayers || shape.mips > limits.maxMipLevels) {
    fail("at most " + std::to_string(limits.maxExtent.width) + "x" + std::to_string(limits.maxExtent.height) + ", " +
         std::to_string(limits.maxArrayLayers) + " layers, " + std::to_string(limits.maxMipLevels) + " mips");
  }
  return shape;
}

struct ImageNeeds {
  VkMemoryRequirements memory{};
  bool is_alone = false;
};

ImageNeeds needs_of(const heddle_vulkan& vk, const VkImageCreateInfo& info) {
  VkMemoryDedicatedRequirements alone{};
  alone.sType = VK_STRUCTURE_TYPE_MEMORY_DEDICATED_REQUIREMENTS;
  VkMemoryRequirements2 needs{};
  needs.sType = VK_STRUCTURE_TYPE_MEMORY_REQUIREMENTS_2;
  needs.pNext = &alone;
  const VkDeviceImageMemoryRequirements query{.sType = VK_STRUCTURE_TYPE_DEVICE_IMAGE_MEMORY_REQUIREMENTS,
                                              .pNext = nullptr,
                                              .pCreateInfo = &info,
                                              .planeAspect = VK_IMAGE_ASPECT_NONE};
  vk.GetDeviceImageMemoryRequirements(vk.device, &query, &needs);
  return {.memory = needs.memoryRequirements, .is_alone = alone.prefersDedicatedAllocation == VK_TRUE};
}

VkMemoryRequirements needs_of(const heddle_vulkan& vk, const VkBufferCreateInfo& info) {
  VkMemoryRequirements2 needs{};
  needs.sType = VK_STRUCTURE_TYPE_MEMORY_REQUIREMENTS_2;
  const VkDeviceBufferMemoryRequirements query{
      .sType = VK_STRUCTURE_TYPE_DEVICE_BUFFER_MEMORY_REQUIREMENTS, .pNext = nullptr, .pCreateInfo = &info};
  vk.GetDeviceBufferMemoryRequirements(vk.device, &query, &needs);
  return needs.memoryRequirements;
}

/// Where host-visible buffers live best on devices with separate heaps.
MemoryWish host_wish(VkBufferUsageFlags usage) {
  constexpr VkMemoryPropertyFlags kMapped = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
  // The host reads what the device copies there: uncached reads run at some MB/s.
  if (usage == VK_BUFFER_USAGE_TRANSFER_DST_BIT) {
    return {.needed = kMapped,
            .liked = VK_MEMORY_PROPERTY_HOST_CACHED_BIT,
            .disliked = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT};
  }
  // Staging is read once over the bus; the small window into device memory is for what shaders read.
  if (usage == VK_BUFFER_USAGE_TRANSFER_SRC_BIT) {
    return {.needed = kMapped, .liked = 0, .disliked = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT};
  }
  return {.needed = kMapped, .liked = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, .disliked = 0};
}

constexpr MemoryWish kDeviceWish{
    .needed = 0, .liked = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, .disliked = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT};

}  // namespace

// ---- owners ----

Buffer::Buffer(Buffer&& other) noexcept {
  *this = std::move(other);
}
Buffer& Buffer::operator=(Buffer&& other) noexcept {
  if (this == &other) return *this;
  if (device_ != nullptr) device_->destroy(*this);
  device_ = std::exchange(other.device_, nullptr);
  buffer_ = std::exchange(other.buffer_, VK_NULL_HANDLE);
  piece_ = std::exchange(other.piece_, {});
  size_ = std::exchange(other.size_, 0);
  data_ = std::exchange(other.data_, nullptr);
  return *this;
}
Buffer::~Buffer() {
  if (device_ != nullptr) device_->destroy(*this);
}

Image::Image(Image&& other) noexcept {
  *this = std::move(other);
}
Image& Image::operator=(Image&& other) noexcept {
  if (this == &other) return *this;
  if (device_ != nullptr) device_->destroy(*this);
  device_ = std::exchange(other.device_, nullptr);
  image_ = std::exchange(other.image_, VK_NULL_HANDLE);
  piece_ = std::exchange(other.piece_, {});
  view_ = std::exchange(other.view_, VK_NULL_HANDLE);
  shape_ = std::exchange(other.shape_, {});
  extra_views_ = std::exchange(other.extra_views_, {});
  return *this;
}
Image::~Image() {
  if (device_ != nullptr) device_->destroy(*this);
}

Heap::Heap(Heap&& other) noexcept {
  *this = std::move(other);
}
Heap& Heap::operator=(Heap&& other) noexcept {
  if (this == &other) return *this;
  if (device_ != nullptr) device_->destroy(*this);
  device_ = std::exchange(other.device_, nullptr);
  memory_ = std::exchange(other.memory_, VK_NULL_HANDLE);
  size_ = std::exchange(other.size_, 0);
  return *this;
}
Heap::~Heap() {
  if (device_ != nullptr) device_->destroy(*this);
}

void Device::destroy(Buffer& buffer) noexcept {
  const heddle_vulkan& vk = table();
  vk.DestroyBuffer(vk.device, buffer.buffer_, nullptr);
  state_->memory->free(buffer.piece_);
  buffer.device_ = nullptr;
}

void Device::destroy(Image& image) noexcept {
  const heddle_vulkan& vk = table();
  for (const VkImageView view : image.extra_views_) vk.DestroyImageView(vk.device, view, nullptr);
  vk.DestroyImageView(vk.device, image.view_, nullptr);
  vk.DestroyImage(vk.device, image.image_, nullptr);
  state_->memory->free(image.piece_);
  image.device_ = nullptr;
}

void Device::destroy(Heap& heap) noexcept {
  const heddle_vulkan& vk = table();
  vk.FreeMemory(vk.device, heap.memory_, nullptr);
  heap.device_ = nullptr;
}

// ---- buffers ----

Buffer Device::bare_buffer(std::uint64_t size, VkBufferUsageFlags usage) {
  const heddle_vulkan& vk = table();
  if (size == 0) throw Error(HEDDLE_BUG, "a buffer of 0 bytes was asked for");
  const VkBufferCreateInfo info = buffer_info(size, usage);
  Buffer buffer;
  check(vk.CreateBuffer(vk.device, &info, nullptr, &buffer.buffer_), "vkCreateBuffer");
  buffer.device_ = this;
  buffer.size_ = size;
  return buffer;
}

Buffer Device::make_buffer(std::uint64_t size, VkBufferUsageFlags usage, bool host_visible) {
  const heddle_vulkan& vk = table();
  Buffer buffer = bare_buffer(size, usage);
  MemoryRequest request;
  request.needs = needs_of(vk, buffer_info(size, usage));
  request.wish = host_visible ? host_wish(usage) : kDeviceWish;
  buffer.piece_ = state_->memory->allocate(request);
  buffer.data_ = buffer.piece_.data;
  check(vk.BindBufferMemory(vk.device, buffer.buffer_, buffer.piece_.memory, buffer.piece_.offset),
        "vkBindBufferMemory");
  return buffer;
}

VkMemoryRequirements Device::buffer_requirements(std::uint64_t size, VkBufferUsageFlags usage) {
  return keep_granularity(needs_of(table(), buffer_info(size, usage)), limits().bufferImageGranularity);
}

Buffer Device::place_buffer(std::uint64_t size, VkBufferUsageFlags usage, const Heap& heap, std::uint64_t offset) {
  const heddle_vulkan& vk = table();
  Buffer buffer = bare_buffer(size, usage);
  require_fit(heap, offset, needs_of(vk, buffer_info(size, usage)), "a buffer");
  check(vk.BindBufferMemory(vk.device, buffer.buffer_, heap.memory_, offset), "vkBindBufferMemory");
  return buffer;
}

// ---- images ----

Image Device::bare_image(const ImageShape& shape, bool is_placed) {
  const heddle_vulkan& vk = table();
  Image image;
  image.shape_ = resolve_shape(state_->instance, state_->physical_device, shape);
  const VkImageCreateInfo info = image_info(image.shape_, is_placed);
  check(vk.CreateImage(vk.device, &info, nullptr, &image.image_), "vkCreateImage");
  image.device_ = this;
  return image;
}

VkImageView Device::make_view(const Image& image, VkImageViewType type, std::uint32_t layer, std::uint32_t layers,
                              std::uint32_t mip, std::uint32_t mips) const {
  const heddle_vulkan& vk = table();
  const bool is_depth = format_info(image.shape_.format).is_depth;
  VkImageViewCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
  info.image = image.image_;
  info.viewType = type;
  info.format = image.shape_.format;
  info.subresourceRange = {
      static_cast<VkImageAspectFlags>(is_depth ? VK_IMAGE_ASPECT_DEPTH_BIT : VK_IMAGE_ASPECT_COLOR_BIT), mip, mips,
      layer, layers};
  VkImageView view = VK_NULL_HANDLE;
  check(vk.CreateImageView(vk.device, &info, nullptr, &view), "vkCreateImageView");
  return view;
}

void Device::make_main_view(Image& image) {
  constexpr VkImageUsageFlags kViewed = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_STORAGE_BIT |
                                        VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT |
                                        VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT;
  const ImageShape& shape = image.shape_;
  if ((shape.usage & kViewed) == 0) return;  // images that are only copied may have no view
  VkImageViewType type = shape.layers > 1 ? VK_IMAGE_VIEW_TYPE_2D_ARRAY : VK_IMAGE_VIEW_TYPE_2D;
  if (shape.is_cube) type = shape.layers > 6 ? VK_IMAGE_VIEW_TYPE_CUBE_ARRAY : VK_IMAGE_VIEW_TYPE_CUBE;
  image.view_ = make_view(image, type, 0, shape.layers, 0, shape.mips);
}

Image Device::make_image(const ImageShape& shape) {
  const heddle_vulkan& vk = table();
  Image image = bare_image(shape, false);
  const ImageNeeds needs = needs_of(vk, image_info(image.shape_, false));
  MemoryRequest request;
  request.needs = needs.memory;
  request.wish = kDeviceWish;
  request.is_image = true;
  request.is_alone = needs.is_alone;
  request.image = image.image_;
  image.piece_ = state_->memory->allocate(request);
  check(vk.BindImageMemory(vk.device, image.image_, image.piece_.memory, image.piece_.offset), "vkBindImageMemory");
  make_main_view(image);
  return image;
}

VkMemoryRequirements Device::image_requirements(const ImageShape& shape) {
  const ImageShape resolved = resolve_shape(state_->instance, state_->physical_device, shape);
  return keep_granularity(needs_of(table(), image_info(resolved, true)).memory, limits().bufferImageGranularity);
}

Image Device::place_image(const ImageShape& shape, const Heap& heap, std::uint64_t offset) {
  const heddle_vulkan& vk = table();
  Image image = bare_image(shape, true);
  require_fit(heap, offset, needs_of(vk, image_info(image.shape_, true)).memory, "an image");
  check(vk.BindImageMemory(vk.device, image.image_, heap.memory_, offset), "vkBindImageMemory");
  make_main_view(image);
  return image;
}

VkImageView Image::layer_view(std::uint32_t layer, std::uint32_t mip) const {
  if (layer >= shape_.layers || mip >= shape_.mips) {
    throw Error(HEDDLE_BUG, Diagnostic{.message = "an image has no such layer or mip",
                                       .found = "layer " + std::to_string(layer) + ", mip " + std::to_string(mip),
                                       .expected = "less than " + std::to_string(shape_.layers) + " and " +
                                                   std::to_string(shape_.mips)});
  }
  extra_views_.resize((std::size_t{shape_.layers} + 1) * shape_.mips);
  VkImageView& view = extra_views_[std::size_t{layer} * shape_.mips + mip];
  if (view == VK_NULL_HANDLE) view = device_->make_view(*this, VK_IMAGE_VIEW_TYPE_2D, layer, 1, mip, 1);
  return view;
}

VkImageView Image::mip_view(std::uint32_t mip) const {
  if (mip >= shape_.mips) {
    throw Error(HEDDLE_BUG, Diagnostic{.message = "an image has no such mip",
                                       .found = "mip " + std::to_string(mip),
                                       .expected = "less than " + std::to_string(shape_.mips)});
  }
  extra_views_.resize((std::size_t{shape_.layers} + 1) * shape_.mips);
  VkImageView& view = extra_views_[std::size_t{shape_.layers} * shape_.mips + mip];
  const VkImageViewType type = shape_.layers > 1 ? VK_IMAGE_VIEW_TYPE_2D_ARRAY : VK_IMAGE_VIEW_TYPE_2D;
  if (view == VK_NULL_HANDLE) view = device_->make_view(*this, type, 0, shape_.layers, mip, 1);
  return view;
}

// ---- heaps ----

Heap Device::make_heap(std::uint64_t size, std::uint32_t memory_type_bits) {
  if (size == 0) throw Error(HEDDLE_BUG, "a heap of 0 bytes was asked for");
  MemoryRequest request;
  request.needs = {.size = size, .alignment = 1, .memoryTypeBits = memory_type_bits};
  request.wish = kDeviceWish;
  request.is_alone = true;
  Heap heap;
  heap.memory_ = state_->memory->allocate(request).memory;
  heap.device_ = this;
  heap.size_ = size;
  return heap;
}

}  // namespace heddle::vulkan
