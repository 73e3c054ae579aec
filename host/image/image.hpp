// SPDX-License-Identifier: Apache-2.0
// Images in and out through OpenImageIO, which lives in a module of its own (libheddle_image.so) that is opened at the
// first use: it costs 0.4 s and 256 libraries.
#pragma once

#include "diagnostics.hpp"

#include <heddle/images.h>

#include <filesystem>
#include <memory>
#include <span>
#include <vector>

namespace heddle::image {

struct Image {
  std::uint32_t width = 0, height = 0, channels = 0;
  std::vector<float> pixels;  // top row first
};

/// Throws Error(HEDDLE_BAD_INPUT) with the file and the library's reason.
Image read(const std::filesystem::path& file);
/// Eight-bit textures as stored, expanded to RGBA; from a file or from the bytes of one (glTF buffers).
struct Image8 {
  std::uint32_t width = 0, height = 0;
  std::vector<std::uint8_t> rgba;
};
/// More than `maximum_texels` are an error before memory is taken for them.
Image8 decode8(std::span<const std::byte> file_bytes, std::string_view name, std::uint64_t maximum_texels = 1ULL << 28);

/// A file that is read part by part, so that it may be larger than memory. Threads take turns.
class OpenImage {
 public:
  /// Throws Error(HEDDLE_BAD_INPUT) with the file and the library's reason; so does everything else here.
  explicit OpenImage(const std::filesystem::path& file);
  ~OpenImage();
  OpenImage(const OpenImage&) = delete;
  OpenImage& operator=(const OpenImage&) = delete;
  [[nodiscard]] heddle_image_level level(std::uint32_t level) const;
  /// As heddle_images_service::read.
  void read(const heddle_image_part& part, void* out, std::uint64_t row_bytes) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Under a temporary name, then renamed. .exr: float32; .png, .jpg ...: 8 bits, values clamped to 0..1 and rounded.
void write(const std::filesystem::path& file, const Image& image);

}  // namespace heddle::image
