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
#include <type_traits>
#include <vector>

#include "image/module.h"

struct heddle_image_source {
  std::unique_ptr<OIIO::ImageInput> input;
  std::vector<OIIO::ImageSpec> levels;
};

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

// A row of blocks of a file that claims more is broken or hostile.
constexpr std::uint64_t kMostBlockRow = 1ULL << 29;
// Rows of files without blocks are read so many bytes at a time: files that are packed in bands of rows are then not
// unpacked again for each row.
constexpr std::uint64_t kRowBytes = 8ULL << 20;

heddle_status open(const char* path, heddle_image_source** out, char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    const OIIO::ImageSpec config = as_stored();
    auto input = OIIO::ImageInput::open(path, &config);
    if (!input) {
      return fail(error, error_size, OIIO::geterror());
    }
    auto source = std::make_unique<heddle_image_source>();
    source->input = std::move(input);
    source->levels.push_back(source->input->spec());
    while (source->levels.size() < 32 && source->input->seek_subimage(0, static_cast<int>(source->levels.size()))) {
      source->levels.push_back(source->input->spec());
    }
    (void)source->input->geterror();  // of the level after the last
    for (const OIIO::ImageSpec& spec : source->levels) {
      if (spec.width < 1 || spec.height < 1 || spec.nchannels < 1) {
        return fail(error, error_size, "it has no pixels");
      }
      const std::uint64_t row =
          static_cast<std::uint64_t>(spec.width + std::max(spec.tile_width, 0)) * 4 * sizeof(float);
      if (spec.depth > 1 || spec.nchannels > 64 ||
          row * static_cast<std::uint64_t>(std::max(spec.tile_height, 1)) > kMostBlockRow) {
        return fail(error, error_size,
                    "it is deeper than one pixel, has more than 64 channels, or a row of its blocks needs more than " +
                        std::to_string(kMostBlockRow >> 20) + " MiB");
      }
    }
    *out = source.release();
    return HEDDLE_OK;
  });
}

heddle_status level(heddle_image_source* source, uint32_t level, heddle_image_source_level* out, char* error,
                    size_t error_size) {
  return guard(error, error_size, [&] {
    if (level >= source->levels.size()) {
      return fail(error, error_size,
                  "level " + std::to_string(level) + " of " + std::to_string(source->levels.size()) + " is asked for");
    }
    const OIIO::ImageSpec& spec = source->levels[level];
    const bool is_tiled = spec.tile_width > 0;
    *out = {static_cast<std::uint32_t>(spec.width),
            static_cast<std::uint32_t>(spec.height),
            static_cast<std::uint32_t>(spec.nchannels),
            static_cast<std::uint32_t>(is_tiled ? spec.tile_width : spec.width),
            static_cast<std::uint32_t>(is_tiled ? spec.tile_height : 1),
            static_cast<std::uint32_t>(8 * spec.format.basesize()),
            spec.format.is_floating_point() ? 1U : 0U,
            static_cast<std::uint32_t>(source->levels.size())};
    return HEDDLE_OK;
  });
}

/// Grey spreads to colour, absent alpha is one, further channels are left out.
template <typename Sample>
void expand(const Sample* from, size_t channels, size_t count, Sample opaque, Sample* to) {
  for (size_t i = 0; i < count; ++i, from += channels, to += 4) {
    to[0] = from[0];
    to[1] = channels < 3 ? from[0] : from[1];
    to[2] = channels < 3 ? from[0] : from[2];
    to[3] = channels == 2 ? from[1] : channels == 4 ? from[3] : opaque;
  }
}

template <typename Sample>
heddle_status read_rows(heddle_image_source& source, std::uint32_t number, const uint32_t* rectangle, std::byte* out,
                        size_t row_bytes, char* error, size_t error_size) {
  const OIIO::ImageSpec& spec = source.levels[number];
  const auto width = static_cast<std::int64_t>(spec.width), height = static_cast<std::int64_t>(spec.height);
  const std::int64_t x = rectangle[0], y = rectangle[1], end_x = x + rectangle[2], end_y = y + rectangle[3];
  const int channels = std::min(spec.nchannels, 4), mip = static_cast<int>(number);
  const OIIO::TypeDesc type = std::is_same_v<Sample, float> ? OIIO::TypeDesc::FLOAT : OIIO::TypeDesc::UINT8;
  const bool is_tiled = spec.tile_width > 0;
  // Columns and rows that are decoded: whole blocks.
  const std::int64_t block_x = is_tiled ? spec.tile_width : width;
  const std::int64_t first_x = x / block_x * block_x,
                     last_x = std::min(width, (end_x + block_x - 1) / block_x * block_x);
  const auto columns = static_cast<size_t>(last_x - first_x);
  const size_t row_size = columns * static_cast<size_t>(channels) * sizeof(Sample);
  const std::int64_t block_y =
      is_tiled ? spec.tile_height : std::clamp<std::int64_t>(static_cast<std::int64_t>(kRowBytes / row_size), 1, 256);
  // OpenImageIO turns bytes into floats by a multiplication; 0..1 as stored means the quotient, rounded once.
  const bool is_quotient =
      std::is_same_v<Sample, float> && spec.format == OIIO::TypeDesc::UINT8 && spec.channelformats.empty();
  std::vector<Sample> decoded(columns * static_cast<size_t>(channels) * static_cast<size_t>(std::min(block_y, height)));
  std::vector<std::uint8_t> bytes(is_quotient ? decoded.size() : 0);
  void* target = is_quotient ? static_cast<void*>(bytes.data()) : decoded.data();
  const OIIO::TypeDesc asked = is_quotient ? OIIO::TypeDesc::UINT8 : type;
  for (std::int64_t at = is_tiled ? y / block_y * block_y : y; at < end_y; at += block_y) {
    const std::int64_t end = std::min(at + block_y, is_tiled ? height : end_y);
    const int top = static_cast<int>(at) + spec.y, bottom = static_cast<int>(end) + spec.y;
    const bool is_read = is_tiled ? source.input->read_tiles(0, mip, static_cast<int>(first_x) + spec.x,
                                                             static_cast<int>(last_x) + spec.x, top, bottom, 0, 1, 0,
                                                             channels, asked, target)
                                  : source.input->read_scanlines(0, mip, top, bottom, 0, 0, channels, asked, target);
    if (!is_read) {
      return fail(error, error_size, source.input->geterror());
    }
    std::transform(bytes.begin(), bytes.end(), decoded.begin(),
                   [](std::uint8_t value) { return static_cast<Sample>(static_cast<float>(value) / 255.0F); });
    const auto opaque = static_cast<Sample>(std::is_same_v<Sample, float> ? 1 : 255);
    for (std::int64_t row = std::max(at, y); row < std::min(end, end_y); ++row) {
      const Sample* from =
          decoded.data() +
          (static_cast<size_t>(row - at) * columns + static_cast<size_t>(x - first_x)) * static_cast<size_t>(channels);
      auto* to = reinterpret_cast<Sample*>(out + static_cast<size_t>(row - y) * row_bytes);
      expand(from, static_cast<size_t>(channels), rectangle[2], opaque, to);
    }
  }
  return HEDDLE_OK;
}

heddle_status read_part(heddle_image_source* source, uint32_t level, const uint32_t x_y_width_height[4],
                        uint32_t is_float, void* out, size_t row_bytes, char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    auto* bytes = static_cast<std::byte*>(out);
    return is_float != 0
               ? read_rows<float>(*source, level, x_y_width_height, bytes, row_bytes, error, error_size)
               : read_rows<std::uint8_t>(*source, level, x_y_width_height, bytes, row_bytes, error, error_size);
  });
}

void close(heddle_image_source* source) {
  delete source;
}

constexpr heddle_image_module kModule = {sizeof(heddle_image_module),
                                         HEDDLE_IMAGE_MODULE_REVISION,
                                         read,
                                         decode8,
                                         write,
                                         release,
                                         open,
                                         level,
                                         read_part,
                                         close};

}  // namespace

const heddle_image_module* heddle_image_module_entry(void) {
  return &kModule;
}
