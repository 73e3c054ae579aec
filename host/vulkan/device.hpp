// SPDX-License-Identifier: Apache-2.0
// One Vulkan device with its queue, memory, counters and the wrapped function table that plugins see. libvulkan is
// opened at run time, by the first device; several devices live side by side without sharing state.
#pragma once

#include "diagnostics.hpp"

#include <heddle/vulkan_table.h>

#include <atomic>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace heddle::vulkan {

namespace hazard {
class Recorder;
}
class PipelineStore;

/// What the host counts; differences between two readings prove what a frame did.
struct Counters {
  std::uint64_t commands = 0;  // every vkCmd*
  std::uint64_t draws = 0, dispatches = 0, barriers = 0, renderings = 0;
  std::uint64_t barrier_parts = 0;  // memory, buffer and image barriers of all barriers
  std::uint64_t submits = 0;
  std::uint64_t pipelines = 0;    // created since the device
  std::uint64_t pipeline_ns = 0;  // spent by the driver on creating them
  std::uint64_t live_pipelines = 0, live_images = 0, live_buffers = 0;
  std::uint64_t device_memory_bytes = 0;  // allocated now
  std::uint64_t uploaded_bytes = 0, read_back_bytes = 0;
};

struct DeviceInfo {
  std::uint32_t index = 0;
  std::string name, driver, driver_version;
  std::string type;  // "cpu", "discrete", "integrated", "virtual", "other"
  std::uint32_t api_version = 0;
  bool is_lavapipe = false;
  bool is_usable = false;  // has all that the host needs
  std::string missing;     // why not
};

/// Opens the loader and lists devices; throws Error(HEDDLE_FAILED) with help when there is no Vulkan.
std::vector<DeviceInfo> list_devices();
/// Layers the loader knows.
std::vector<std::string> list_layers();

class Device;

/// A piece of device memory. Small objects share blocks; `block` is null where memory was allocated for one object
/// alone.
struct MemoryPiece {
  VkDeviceMemory memory = VK_NULL_HANDLE;
  std::uint64_t offset = 0;
  std::byte* data = nullptr;  // mapped: host-visible pieces
  void* block = nullptr;
};

class Buffer {
 public:
  Buffer() = default;
  Buffer(Buffer&& other) noexcept;
  Buffer& operator=(Buffer&& other) noexcept;
  ~Buffer();
  [[nodiscard]] VkBuffer handle() const { return buffer_; }
  [[nodiscard]] std::uint64_t size() const { return size_; }
  /// Mapped memory of host-visible buffers (coherent), else nullptr.
  [[nodiscard]] std::byte* data() const { return data_; }
  explicit operator bool() const { return buffer_ != VK_NULL_HANDLE; }

 private:
  friend class Device;
  Device* device_ = nullptr;
  VkBuffer buffer_ = VK_NULL_HANDLE;
  MemoryPiece piece_;  // no memory: placed in a Heap
  std::uint64_t size_ = 0;
  std::byte* data_ = nullptr;
};

struct ImageShape {
  VkFormat format = VK_FORMAT_UNDEFINED;
  std::uint32_t width = 1, height = 1, layers = 1, mips = 1;
  VkImageUsageFlags usage = 0;  // 0: everything the format allows of sampled, storage, attachment, transfer
  bool is_cube = false;
};

class Image {
 public:
  Image() = default;
  Image(Image&& other) noexcept;
  Image& operator=(Image&& other) noexcept;
  ~Image();
  [[nodiscard]] VkImage handle() const { return image_; }
  /// The view that shaders sample: 2D, 2D array if layers > 1, cube or cube array if is_cube; all mips. Depth formats:
  /// depth aspect.
  [[nodiscard]] VkImageView view() const { return view_; }
  /// One layer of one mip, 2D: attachments and storage. Made on first use, by one thread at a time.
  [[nodiscard]] VkImageView layer_view(std::uint32_t layer, std::uint32_t mip = 0) const;
  /// One mip, all layers (2D, or 2D array also of cubes): storage. Made on first use, by one thread at a time.
  [[nodiscard]] VkImageView mip_view(std::uint32_t mip) const;
  [[nodiscard]] const ImageShape& shape() const { return shape_; }
  explicit operator bool() const { return image_ != VK_NULL_HANDLE; }

 private:
  friend class Device;
  Device* device_ = nullptr;
  VkImage image_ = VK_NULL_HANDLE;
  MemoryPiece piece_;  // no memory: placed in a Heap
  VkImageView view_ = VK_NULL_HANDLE;
  ImageShape shape_;
  mutable std::vector<VkImageView> extra_views_;  // layer x mip, then mips; made on first use
};

/// One block of device memory into which transient images and buffers are placed (alias).
class Heap {
 public:
  Heap() = default;
  Heap(Heap&& other) noexcept;
  Heap& operator=(Heap&& other) noexcept;
  ~Heap();
  [[nodiscard]] VkDeviceMemory memory() const { return memory_; }
  [[nodiscard]] std::uint64_t size() const { return size_; }

 private:
  friend class Device;
  Device* device_ = nullptr;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  std::uint64_t size_ = 0;
};

struct DeviceOptions {
  // Part of a name in any case ("lavapipe" works), or an index; "": HEDDLE_DEVICE, else lavapipe, else the first
  // usable.
  std::string device;
  bool validation = false;  // the layer, with synchronization validation; missing layer: Error(HEDDLE_FAILED)
  // Record what the driver is given, and prove that nothing races (take_hazards). Under validation also give the layer
  // render passes in place of dynamic rendering, whose attachments it does not follow.
  bool check = false;
  std::function<void(Severity, std::string_view)> log;
};

class Device {
 public:
  explicit Device(const DeviceOptions& options);
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  [[nodiscard]] const DeviceInfo& info() const;
  [[nodiscard]] const VkPhysicalDeviceLimits& limits() const;
  /// What was asked for and is there: the host's needs are, the rest may be missing (samplerAnisotropy, shaderFloat64).
  [[nodiscard]] const VkPhysicalDeviceFeatures& features() const;
  /// The counted table: the host itself calls Vulkan through it, and plugins get the same one.
  [[nodiscard]] const heddle_vulkan& table() const;
  [[nodiscard]] VkQueue queue() const;
  [[nodiscard]] std::uint32_t queue_family() const;
  [[nodiscard]] Counters counters() const;
  /// What graphs of this device share.
  [[nodiscard]] PipelineStore& pipelines() const;
  /// Errors the validation layer reported since the last call, and forgets them. Empty without validation.
  std::vector<std::string> take_validation_errors();
  /// Follows every call in check mode; else nullptr.
  [[nodiscard]] hazard::Recorder* recorder() const;
  /// The host is about to read or to have written mapped memory of a buffer: check mode proves that the device is done.
  void note_host_read(const Buffer& buffer, std::uint64_t offset = 0, std::uint64_t size = VK_WHOLE_SIZE);
  void note_host_write(const Buffer& buffer, std::uint64_t offset = 0, std::uint64_t size = VK_WHOLE_SIZE);
  /// Hazards between commands that were submitted since the last call. Empty without check mode.
  std::vector<Diagnostic> take_hazards();
  /// Of optimally tiled images.
  [[nodiscard]] VkFormatFeatureFlags format_features(VkFormat format) const;
  /// Whether they have all of these.
  [[nodiscard]] bool has_format(VkFormat format, VkFormatFeatureFlags features) const;

  /// Every buffer can also be copied from and to.
  Buffer make_buffer(std::uint64_t size, VkBufferUsageFlags usage, bool host_visible);
  Image make_image(const ImageShape& shape);
  // Placed: the driver's needs, then the object at an offset of a heap. Sizes and alignments are whole multiples of the
  // device's bufferImageGranularity, so that any packing that keeps to them is right. Objects may overlap: they alias.
  [[nodiscard]] VkMemoryRequirements image_requirements(const ImageShape& shape);
  [[nodiscard]] VkMemoryRequirements buffer_requirements(std::uint64_t size, VkBufferUsageFlags usage);
  Heap make_heap(std::uint64_t size, std::uint32_t memory_type_bits);
  Image place_image(const ImageShape& shape, const Heap& heap, std::uint64_t offset);
  Buffer place_buffer(std::uint64_t size, VkBufferUsageFlags usage, const Heap& heap, std::uint64_t offset);

  /// Records with `record`, submits and waits. For uploads and tests. Throws Error on device loss.
  void run(const std::function<void(VkCommandBuffer)>& record);
  /// Fills a device buffer / image (one layer, one mip; image ends in SHADER_READ_ONLY_OPTIMAL) through staging memory.
  /// Mapped buffers are written at once: nothing that was submitted may still use them. Not from inside run().
  void upload(const Buffer& target, std::uint64_t offset, std::span<const std::byte> bytes);
  void upload(const Image& target, std::uint32_t layer, std::uint32_t mip, std::span<const std::byte> bytes);
  /// Reads back tightly packed texels; the image is in `layout` and stays in it.
  std::vector<std::byte> read_back(const Image& source, std::uint32_t layer, std::uint32_t mip, VkImageLayout layout);
  /// The same without a copy: `use` gets the bytes where the device put them, until it returns.
  void read_back(const Image& source, std::uint32_t layer, std::uint32_t mip, VkImageLayout layout,
                 const std::function<void(std::span<const std::byte>)>& use);
  std::vector<std::byte> read_back(const Buffer& source, std::uint64_t offset, std::uint64_t size);
  void count_upload(std::uint64_t bytes);
  void count_read_back(std::uint64_t bytes);

  /// Immutable samplers, made once: nearest/linear x repeat/clamp/mirror, and depth comparison (GREATER_OR_EQUAL,
  /// linear).
  enum class Sampler : std::uint8_t { kNearestClamp, kLinearClamp, kLinearRepeat, kLinearMirror, kCompareClamp };
  [[nodiscard]] VkSampler sampler(Sampler which) const;

 private:
  friend class Buffer;
  friend class Image;
  friend class Heap;
  void destroy(Buffer& buffer) noexcept;
  void destroy(Image& image) noexcept;
  void destroy(Heap& heap) noexcept;
  [[nodiscard]] VkImageView make_view(const Image& image, VkImageViewType type, std::uint32_t layer,
                                      std::uint32_t layers, std::uint32_t mip, std::uint32_t mips) const;
  Image bare_image(const ImageShape& shape, bool is_placed);
  Buffer bare_buffer(std::uint64_t size, VkBufferUsageFlags usage);
  void make_main_view(Image& image);

  struct State;
  std::unique_ptr<State> state_;
};

/// Throws Error(HEDDLE_FAILED) naming the call and the result's name unless VK_SUCCESS.
void check(VkResult result, std::string_view call);
/// Bytes of a texel, channels and kind of a color or depth format the host supports (r8 .. rgba32f, srgb, 10-11 bit),
/// or of a compressed one, which is sampled and copied and nothing else: its texels have no bytes of their own.
struct FormatInfo {
  std::uint32_t texel_bytes = 0, channels = 0;
  std::uint32_t block_bytes = 0;  // of 4 x 4 texels; 0: not compressed
  const char* glsl = "";          // "rgba16f": format qualifier for storage images; "" if none
  const char* name = "";          // "r16g16b16a16_sfloat"
  bool is_depth = false;
};
/// All zero for formats that the host does not know.
FormatInfo format_info(VkFormat format);
/// Of an image of so many texels, tightly packed.
std::uint64_t image_bytes(VkFormat format, std::uint32_t width, std::uint32_t height);
/// Texels of `format` to float32, channels kept (sRGB formats stay encoded values 0..1 as stored). Throws
/// Error(HEDDLE_UNSUPPORTED) for unknown formats, Error(HEDDLE_BUG) for parts of texels.
std::vector<float> to_float(std::span<const std::byte> texels, VkFormat format);
/// The same into memory of the caller's, which has room for exactly that many.
void to_float(std::span<const std::byte> texels, VkFormat format, std::span<float> values);
/// The reverse, for writing host data into images; values are clamped to the format's range, rounded to nearest, ties
/// to even. Floats keep Inf and NaN (unsigned ones: -Inf becomes 0); in other formats NaN becomes 0.
std::vector<std::byte> from_float(std::span<const float> values, VkFormat format);

}  // namespace heddle::vulkan
