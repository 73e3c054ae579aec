// SPDX-License-Identifier: Apache-2.0
// Opens the image module at the first use, and turns its answers into images and errors.
#include "image/image.hpp"

#include <dlfcn.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <mutex>
#include <system_error>

#include "image/module.h"

namespace heddle::image {
namespace {

constexpr const char* kModuleName = "libheddle_image.so";
constexpr const char* kHelp =
    "install the Debian package libopenimageio2.4 and keep libheddle_image.so beside libheddle.so, or name the module "
    "in "
    "HEDDLE_IMAGE_MODULE";

/// Folder of the library or program that holds this code.
std::filesystem::path own_folder() {
  Dl_info info{};
  std::error_code ignored;
  if (dladdr(reinterpret_cast<const void*>(&own_folder), &info) != 0 && info.dli_fname != nullptr &&
      std::strchr(info.dli_fname, '/') != nullptr) {
    return std::filesystem::weakly_canonical(info.dli_fname, ignored).parent_path();
  }
  // A program found through PATH is known to the loader by its bare name.
  return std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path();
}

std::filesystem::path find_module() {
  if (const char* named = std::getenv("HEDDLE_IMAGE_MODULE"); named != nullptr && *named != '\0') {
    return named;
  }
  const std::filesystem::path folder = own_folder();
  for (const char* relative : {"", "../lib", "../lib/x86_64-linux-gnu"}) {
    std::error_code ignored;
    if (const auto file = folder / relative / kModuleName; std::filesystem::exists(file, ignored)) {
      return file;
    }
  }
  return folder / kModuleName;
}

/// Opened once for the process and never closed: OpenImageIO keeps threads. A failure is tried again next time.
const heddle_image_module& module() {
  static std::mutex mutex;
  static const heddle_image_module* opened = nullptr;
  const std::lock_guard lock(mutex);
  if (opened != nullptr) {
    return *opened;
  }
  const std::filesystem::path file = find_module();
  void* library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  if (library == nullptr) {
    throw Error(HEDDLE_FAILED, fmt::format("cannot open the image module '{}': {}", file.string(), dlerror()), kHelp);
  }
  const auto entry = reinterpret_cast<heddle_image_module_entry_function>(dlsym(library, "heddle_image_module_entry"));
  const heddle_image_module* found = entry == nullptr ? nullptr : entry();
  if (found == nullptr || found->struct_size < sizeof(heddle_image_module) ||
      found->revision != HEDDLE_IMAGE_MODULE_REVISION) {
    throw Error(HEDDLE_FAILED, fmt::format("'{}' is not the image module of this version of Heddle", file.string()),
                kHelp);
  }
  opened = found;
  return *opened;
}

using Reason = std::array<char, 1024>;

[[noreturn]] void fail(heddle_status status, std::string_view file, std::string message, std::string found) {
  while (!found.empty() && (found.back() == '\n' || found.back() == '.')) {
    found.pop_back();
  }
  throw Error(status,
              Diagnostic{Severity::kError, {std::string(file), 0, 0}, std::move(message), std::move(found), "", ""});
}

/// Known before OpenImageIO is: its message for a missing file speaks of plugins.
void require_file(const std::filesystem::path& file) {
  std::error_code error_code;
  if (!std::filesystem::is_regular_file(file, error_code)) {
    throw Error(HEDDLE_BAD_INPUT,
                Diagnostic{Severity::kError, {file.string(), 0, 0}, "there is no such image", "", "", ""});
  }
}

/// Kind of file by its first bytes, "" if it is none that a texture may be.
const char* extension_of(std::span<const std::byte> bytes) {
  struct Magic {
    std::string_view start;
    const char* extension;
  };
  using namespace std::string_view_literals;
  static constexpr std::array<Magic, 8> kMagics = {{{"\x89PNG\r\n\x1a\n"sv, "png"},
                                                    {"\xff\xd8\xff"sv, "jpg"},
                                                    {"BM"sv, "bmp"},
                                                    {"GIF8"sv, "gif"},
                                                    {"DDS "sv, "dds"},
                                                    {"II*\0"sv, "tif"},
                                                    {"MM\0*"sv, "tif"},
                                                    {"v/1\x01"sv, "exr"}}};
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  for (const Magic& magic : kMagics) {
    if (text.starts_with(magic.start)) {
      return magic.extension;
    }
  }
  if (text.size() > 12 && text.starts_with("RIFF") && text.substr(8, 4) == "WEBP") {
    return "webp";
  }
  return "";
}

}  // namespace

Image read(const std::filesystem::path& file) {
  require_file(file);
  const heddle_image_module& images = module();
  heddle_image_pixels pixels{};
  Reason reason{};
  if (const heddle_status status = images.read(file.c_str(), &pixels, reason.data(), reason.size());
      status != HEDDLE_OK) {
    fail(status, file.string(), "the image cannot be read", reason.data());
  }
  const std::unique_ptr<heddle_image_pixels, void (*)(heddle_image_pixels*)> owner(&pixels, images.release);
  Image image{pixels.width, pixels.height, pixels.channels, {}};
  const auto* values = static_cast<const float*>(pixels.data);
  image.pixels.assign(values, values + std::size_t{pixels.width} * pixels.height * pixels.channels);
  return image;
}

struct OpenImage::State {
  std::filesystem::path file;
  const heddle_image_module* module = nullptr;
  heddle_image_source* source = nullptr;
  std::mutex mutex;  // the module reads one part at a time

  [[noreturn]] void fail_to_read(heddle_status status, const Reason& reason) const {
    fail(status, file.string(), "the image cannot be read", reason.data());
  }
  [[nodiscard]] heddle_image_source_level level(std::uint32_t number) const {
    heddle_image_source_level level{};
    Reason reason{};
    if (const heddle_status status = module->level(source, number, &level, reason.data(), reason.size());
        status != HEDDLE_OK)
      fail_to_read(status, reason);
    return level;
  }
};

OpenImage::OpenImage(const std::filesystem::path& file) : state_(std::make_unique<State>()) {
  require_file(file);
  state_->file = file;
  state_->module = &module();
  Reason reason{};
  if (const heddle_status status = state_->module->open(file.c_str(), &state_->source, reason.data(), reason.size());
      status != HEDDLE_OK)
    state_->fail_to_read(status, reason);
}

OpenImage::~OpenImage() {
  if (state_->source != nullptr) state_->module->close(state_->source);
}

heddle_image_level OpenImage::level(std::uint32_t level) const {
  const std::lock_guard lock(state_->mutex);
  const heddle_image_source_level found = state_->level(level);
  heddle_image_level out{};
  out.struct_size = sizeof out;
  out.width = found.width;
  out.height = found.height;
  out.channels = found.channels;
  out.block_width = found.block_width;
  out.block_height = found.block_height;
  out.level_count = found.level_count;
  out.sample_bits = found.sample_bits;
  out.is_float = found.is_float;
  return out;
}

void OpenImage::read(const heddle_image_part& part, void* out, std::uint64_t row_bytes) const {
  const std::lock_guard lock(state_->mutex);
  const heddle_image_source_level level = state_->level(part.level);
  const std::uint64_t pixel = part.samples == HEDDLE_IMAGE_FLOATS ? 4 * sizeof(float) : 4;
  if (std::uint64_t{part.x} + part.width > level.width || std::uint64_t{part.y} + part.height > level.height ||
      part.samples > HEDDLE_IMAGE_FLOATS || row_bytes < pixel * part.width)
    throw Error(HEDDLE_BUG, Diagnostic{Severity::kError,
                                       {state_->file.string(), 0, 0},
                                       "a part is asked for that the image does not have, or that its rows cannot hold",
                                       fmt::format("{} x {} pixels at ({}, {}), rows of {} bytes", part.width,
                                                   part.height, part.x, part.y, row_bytes),
                                       fmt::format("a part of {} x {} pixels", level.width, level.height),
                                       ""});
  if (part.width == 0 || part.height == 0) return;
  const std::uint32_t rectangle[4] = {part.x, part.y, part.width, part.height};
  Reason reason{};
  if (const heddle_status status =
          state_->module->read_part(state_->source, part.level, rectangle, part.samples == HEDDLE_IMAGE_FLOATS ? 1 : 0,
                                    out, row_bytes, reason.data(), reason.size());
      status != HEDDLE_OK)
    state_->fail_to_read(status, reason);
}

Image8 decode8(std::span<const std::byte> file_bytes, std::string_view name, std::uint64_t maximum_texels) {
  const char* extension = extension_of(file_bytes);
  if (*extension == '\0') {
    throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                             {std::string(name), 0, 0},
                                             "the image is of no known kind",
                                             fmt::format("{} bytes that begin like none", file_bytes.size()),
                                             "PNG or JPEG",
                                             ""});
  }
  const heddle_image_module& images = module();
  heddle_image_pixels pixels{};
  Reason reason{};
  if (const heddle_status status = images.decode8(file_bytes.data(), file_bytes.size(), extension, maximum_texels,
                                                  &pixels, reason.data(), reason.size());
      status != HEDDLE_OK) {
    fail(status, name, "the image cannot be decoded", reason.data());
  }
  const std::unique_ptr<heddle_image_pixels, void (*)(heddle_image_pixels*)> owner(&pixels, images.release);
  Image8 image{pixels.width, pixels.height, {}};
  const auto* values = static_cast<const std::uint8_t*>(pixels.data);
  image.rgba.assign(values, values + std::size_t{pixels.width} * pixels.height * 4);
  return image;
}

void write(const std::filesystem::path& file, const Image& image) {
  if (image.width == 0 || image.height == 0 || image.channels == 0 || image.channels > 4 ||
      image.pixels.size() != std::size_t{image.width} * image.height * image.channels) {
    throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                             {file.string(), 0, 0},
                                             "the image to be written has no proper shape",
                                             fmt::format("{} x {} pixels of {} channels, {} values", image.width,
                                                         image.height, image.channels, image.pixels.size()),
                                             "1 to 4 channels, and width x height x channels values",
                                             ""});
  }
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  const bool is_float =
      extension == ".exr" || extension == ".hdr" || extension == ".pfm" || extension == ".tif" || extension == ".tiff";
  std::vector<std::uint8_t> bytes;
  if (!is_float) {
    bytes.resize(image.pixels.size());
    std::transform(image.pixels.begin(), image.pixels.end(), bytes.begin(), [](float value) {
      // Written so that NaN fails the comparison and becomes 0.
      const float clamped = value > 0.0F ? std::min(value, 1.0F) : 0.0F;
      return static_cast<std::uint8_t>(std::lround(clamped * 255.0F));
    });
  }
  const heddle_image_module& images = module();
  // Beside the target, so that the rename stays in one file system; unique, so that two writers never share it.
  static std::atomic<std::uint32_t> serial{0};
  const std::filesystem::path partial =
      file.parent_path() / fmt::format(".{}.{}-{}.partial{}", file.stem().string(), getpid(), serial++, extension);
  Reason reason{};
  std::error_code error_code;
  const heddle_status status = images.write(
      partial.c_str(), image.width, image.height, image.channels, is_float ? 1 : 0,
      is_float ? static_cast<const void*>(image.pixels.data()) : bytes.data(), reason.data(), reason.size());
  if (status != HEDDLE_OK) {
    std::filesystem::remove(partial, error_code);
    // The library speaks of the temporary file.
    std::string found = reason.data();
    for (std::size_t at = 0; (at = found.find(partial.string(), at)) != std::string::npos;)
      found.replace(at, partial.string().size(), file.string());
    fail(status, file.string(), "the image cannot be written", found);
  }
  std::filesystem::rename(partial, file, error_code);
  if (error_code) {
    const std::string why = error_code.message();
    std::filesystem::remove(partial, error_code);
    throw Error(HEDDLE_FAILED,
                Diagnostic{Severity::kError, {file.string(), 0, 0}, "the image cannot be put in place", why, "", ""});
  }
}

}  // namespace heddle::image
