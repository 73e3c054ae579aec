// SPDX-License-Identifier: Apache-2.0
// Files and file bytes <-> pixels, through OpenImageIO, behind the C border of module.h.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <new>
#include <string>
#include <vector>

#include "image/module.h"

namespace {

// A decoded texture of 2^28 texels is 1 GiB: files that claim more are broken or hostile.
constexpr std::uint64_t kMaximumTexels = 1ULL << 28;

heddle_status fail(char* error, size_t error_size, const std::string& reason) {
  std::snprintf(error, error_size, "%s", reason.empty() ? "OpenImageIO gives no reason" : reason.c_str());
  return HEDDLE_BAD_INPUT;
}

std::string size_error(const OIIO::ImageSpec& spec) {
  if (spec.width < 1 || spec.height < 1 || spec.nchannels < 1) {
    return "it has no pixels";
  }
  const auto texels = static_cast<std::uint64_t>(spec.width) * static_cast<std::uint64_t>(spec.height);
  if (spec.depth > 1 || texels > kMaximumTexels || spec.nchannels > 64) {
    return "it is larger than 2^28 pixels, deeper than one, or has more than 64 channels";
  }
  return {};
}

/// Values as stored: colours are not multiplied by alpha.
OIIO::ImageSpec as_stored() {
  OIIO::ImageSpec config;
  config.attribute("oiio:UnassociatedAlpha", 1);
  return config;
}

/// Every entry answers by status: nothing may throw across the border.
template <typename Body>
heddle_status guard(char* error, size_t error_size, const Body& body) {
  try {
    return body();
  } catch (const std::bad_alloc&) {
    fail(error, error_size, "not enough memory");
    return HEDDLE_FAILED;
  } catch (const std::exception& exception) {
    return fail(error, error_size, exception.what());
  }
}

heddle_status read(const char* path, heddle_image_pixels* out, char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    const OIIO::ImageSpec config = as_stored();
    const auto input = OIIO::ImageInput::open(path, &config);
    if (!input) {
      return fail(error, error_size, OIIO::geterror());
    }
    const OIIO::ImageSpec& spec = input->spec();
    if (const std::string reason = size_error(spec); !reason.empty()) {
      return fail(error, error_size, reason);
    }
    const auto width = static_cast<std::uint32_t>(spec.width), height = static_cast<std::uint32_t>(spec.height);
    const auto channels = static_cast<std::uint32_t>(spec.nchannels);
    std::unique_ptr<float, decltype(&std::free)> pixels(
        static_cast<float*>(std::malloc(sizeof(float) * width * height * channels)), &std::free);
    if (!pixels) {
      throw std::bad_alloc();
    }
    // OpenImageIO turns bytes into floats by a multiplication; 0..1 as stored means the quotient, rounded once.
    if (spec.format == OIIO::TypeDesc::UINT8 && spec.channelformats.empty()) {
      std::vector<std::uint8_t> bytes(size_t{width} * height * channels);
      if (!input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::UINT8, bytes.data())) {
        return fail(error, error_size, input->geterror());
      }
      std::transform(bytes.begin(), bytes.end(), pixels.get(),
                     [](std::uint8_t value) { return static_cast<float>(value) / 255.0F; });
    } else if (!input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::FLOAT, pixels.get())) {
      return fail(error, error_size, input->geterror());
    }
    *out = {width, height, channels, pixels.release()};
    return HEDDLE_OK;
  });
}

heddle_status decode8(const void* bytes, size_t size, const char* extension, std::uint64_t maximum_texels,
                      heddle_image_pixels* out, char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    OIIO::Filesystem::IOMemReader reader(const_cast<void*>(bytes), size);
    OIIO::ImageSpec config = as_stored();
    OIIO::Filesystem::IOProxy* proxy = &reader;
    // Readers of 2.4 take it from the configuration; the argument alone reaches only the ones that look for it.
    config.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, &proxy);
    const auto input = OIIO::ImageInput::open(std::string("memory.") + extension, &config, &reader);
    if (!input) {
      return fail(error, error_size, OIIO::geterror());
    }
    const OIIO::ImageSpec& spec = input->spec();
    if (const std::string reason = size_error(spec); !reason.empty()) {
      return fail(error, error_size, reason);
    }
    const auto width = static_cast<std::uint32_t>(spec.width), height = static_cast<std::uint32_t>(spec.height);
    const size_t texels = size_t{width} * height;
    if (texels > maximum_texels) {
      return fail(error, error_size,
                  std::to_string(width) + " x " + std::to_string(height) + " pixels, of at most " +
                      std::to_string(maximum_texels) + " that there is room for");
    }
    const auto channels = static_cast<size_t>(std::min(spec.nchannels, 4));
    std::unique_ptr<std::uint8_t, decltype(&std::free)> pixels(static_cast<std::uint8_t*>(std::malloc(texels * 4)),
                                                               &std::free);
    if (!pixels) {
      throw std::bad_alloc();
    }
    // Read with a stride of four; then grey spreads to colour and absent alpha becomes one.
    if (!input->read_image(0, 0, 0, static_cast<int>(channels), OIIO::TypeDesc::UINT8, pixels.get(), 4)) {
      return fail(error, error_size, input->geterror());
    }
    for (size_t i = 0; i < texels && channels != 4; ++i) {
      std::uint8_t* texel = pixels.get() + i * 4;
      texel[3] = channels == 2 ? texel[1] : std::uint8_t{255};
      if (channels < 3) {
        texel[1] = texel[2] = texel[0];
      }
    }
    *out = {width, height, 4, pixels.release()};
    return HEDDLE_OK;
  });
}

heddle_status write(const char* path, uint32_t width, uint32_t height, uint32_t channels, uint32_t is_float,
                    const void* data, char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    const auto output = OIIO::ImageOutput::create(path);
    if (!output) {
      return fail(error, error_size, OIIO::geterror());
    }
    const OIIO::TypeDesc type = is_float != 0 ? OIIO::TypeDesc::FLOAT : OIIO::TypeDesc::UINT8;
    OIIO::ImageSpec spec(static_cast<int>(width), static_cast<int>(height), static_cast<int>(channels), type);
    spec.attribute("oiio:UnassociatedAlpha", 1);
    spec.attribute("CompressionQuality", 95);  // jpg: below it, blocks show in dark gradients
    if (!output->open(path, spec) || !output->write_image(type, data) || !output->close()) {
      return fail(error, error_size, output->geterror());
    }
    return HEDDLE_OK;
  });
}

void release(heddle_image_pixels* pixels) {
  std::free(pixels->data);
  *pixels = {};
}

constexpr heddle_image_module kModule = {
    sizeof(heddle_image_module), HEDDLE_IMAGE_MODULE_REVISION, read, decode8, write, release};

}  // namespace

const heddle_image_module* heddle_image_module_entry(void) {
  return &kModule;
}
