// SPDX-License-Identifier: Apache-2.0
// The formats that the host knows; texels of any of them -> float32 and back, exactly as Vulkan defines the encodings.
#include "vulkan/device_state.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

namespace heddle::vulkan {
namespace {

enum class Kind : std::uint8_t { kUnorm, kSnorm, kUint, kSint, kFloat, kUfloat };

/// Bits of each channel, the first in the lowest bits of the texel.
struct Format {
  VkFormat format;
  Kind kind;
  std::array<std::uint8_t, 4> bits;
  const char* name;
  const char* glsl;
  bool is_depth = false;
};

// clang-format off
#define HEDDLE_ONE(b)   {b, 0, 0, 0}
#define HEDDLE_TWO(b)   {b, b, 0, 0}
#define HEDDLE_FOUR(b)  {b, b, b, b}
constexpr std::array kFormats = {
    Format{VK_FORMAT_R8_UNORM, Kind::kUnorm, HEDDLE_ONE(8), "r8_unorm", "r8"},
    Format{VK_FORMAT_R8G8_UNORM, Kind::kUnorm, HEDDLE_TWO(8), "r8g8_unorm", "rg8"},
    Format{VK_FORMAT_R8G8B8A8_UNORM, Kind::kUnorm, HEDDLE_FOUR(8), "r8g8b8a8_unorm", "rgba8"},
    Format{VK_FORMAT_R8G8B8A8_SRGB, Kind::kUnorm, HEDDLE_FOUR(8), "r8g8b8a8_srgb", ""},
    Format{VK_FORMAT_R8_SNORM, Kind::kSnorm, HEDDLE_ONE(8), "r8_snorm", "r8_snorm"},
    Format{VK_FORMAT_R8G8_SNORM, Kind::kSnorm, HEDDLE_TWO(8), "r8g8_snorm", "rg8_snorm"},
    Format{VK_FORMAT_R8G8B8A8_SNORM, Kind::kSnorm, HEDDLE_FOUR(8), "r8g8b8a8_snorm", "rgba8_snorm"},
    Format{VK_FORMAT_R8_UINT, Kind::kUint, HEDDLE_ONE(8), "r8_uint", "r8ui"},
    Format{VK_FORMAT_R8G8_UINT, Kind::kUint, HEDDLE_TWO(8), "r8g8_uint", "rg8ui"},
    Format{VK_FORMAT_R8G8B8A8_UINT, Kind::kUint, HEDDLE_FOUR(8), "r8g8b8a8_uint", "rgba8ui"},
    Format{VK_FORMAT_R16_UNORM, Kind::kUnorm, HEDDLE_ONE(16), "r16_unorm", "r16"},
    Format{VK_FORMAT_R16G16_UNORM, Kind::kUnorm, HEDDLE_TWO(16), "r16g16_unorm", "rg16"},
    Format{VK_FORMAT_R16G16B16A16_UNORM, Kind::kUnorm, HEDDLE_FOUR(16), "r16g16b16a16_unorm", "rgba16"},
    Format{VK_FORMAT_R16_SNORM, Kind::kSnorm, HEDDLE_ONE(16), "r16_snorm", "r16_snorm"},
    Format{VK_FORMAT_R16G16_SNORM, Kind::kSnorm, HEDDLE_TWO(16), "r16g16_snorm", "rg16_snorm"},
    Format{VK_FORMAT_R16G16B16A16_SNORM, Kind::kSnorm, HEDDLE_FOUR(16), "r16g16b16a16_snorm", "rgba16_snorm"},
    Format{VK_FORMAT_R16_SFLOAT, Kind::kFloat, HEDDLE_ONE(16), "r16_sfloat", "r16f"},
    Format{VK_FORMAT_R16G16_SFLOAT, Kind::kFloat, HEDDLE_TWO(16), "r16g16_sfloat", "rg16f"},
    Format{VK_FORMAT_R16G16B16A16_SFLOAT, Kind::kFloat, HEDDLE_FOUR(16), "r16g16b16a16_sfloat", "rgba16f"},
    Format{VK_FORMAT_R16_UINT, Kind::kUint, HEDDLE_ONE(16), "r16_uint", "r16ui"},
    Format{VK_FORMAT_R16G16_UINT, Kind::kUint, HEDDLE_TWO(16), "r16g16_uint", "rg16ui"},
    Format{VK_FORMAT_R16G16B16A16_UINT, Kind::kUint, HEDDLE_FOUR(16), "r16g16b16a16_uint", "rgba16ui"},
    Format{VK_FORMAT_R32_SFLOAT, Kind::kFloat, HEDDLE_ONE(32), "r32_sfloat", "r32f"},
    Format{VK_FORMAT_R32G32_SFLOAT, Kind::kFloat, HEDDLE_TWO(32), "r32g32_sfloat", "rg32f"},
    Format{VK_FORMAT_R32G32B32A32_SFLOAT, Kind::kFloat, HEDDLE_FOUR(32), "r32g32b32a32_sfloat", "rgba32f"},
    Format{VK_FORMAT_R32_UINT, Kind::kUint, HEDDLE_ONE(32), "r32_uint", "r32ui"},
    Format{VK_FORMAT_R32G32_UINT, Kind::kUint, HEDDLE_TWO(32), "r32g32_uint", "rg32ui"},
    Format{VK_FORMAT_R32G32B32A32_UINT, Kind::kUint, HEDDLE_FOUR(32), "r32g32b32a32_uint", "rgba32ui"},
    Format{VK_FORMAT_R32_SINT, Kind::kSint, HEDDLE_ONE(32), "r32_sint", "r32i"},
    Format{VK_FORMAT_R32G32_SINT, Kind::kSint, HEDDLE_TWO(32), "r32g32_sint", "rg32i"},
    Format{VK_FORMAT_R32G32B32A32_SINT, Kind::kSint, HEDDLE_FOUR(32), "r32g32b32a32_sint", "rgba32i"},
    Format{VK_FORMAT_B10G11R11_UFLOAT_PACK32, Kind::kUfloat, {11, 11, 10, 0}, "b10g11r11_ufloat_pack32", "r11f_g11f_b10f"},
    Format{VK_FORMAT_A2B10G10R10_UNORM_PACK32, Kind::kUnorm, {10, 10, 10, 2}, "a2b10g10r10_unorm_pack32", "rgb10_a2"},
    Format{VK_FORMAT_D32_SFLOAT, Kind::kFloat, HEDDLE_ONE(32), "d32_sfloat", "", true},
    Format{VK_FORMAT_D16_UNORM, Kind::kUnorm, HEDDLE_ONE(16), "d16_unorm", "", true},
};
#undef HEDDLE_ONE
#undef HEDDLE_TWO
#undef HEDDLE_FOUR
// clang-format on

/// Blocks of 4 x 4 texels.
struct BlockFormat {
  VkFormat format;
  std::uint32_t bytes, channels;
  const char* name;
};
constexpr std::array kBlockFormats = {
    BlockFormat{VK_FORMAT_BC1_RGB_UNORM_BLOCK, 8, 3, "bc1_rgb_unorm_block"},
    BlockFormat{VK_FORMAT_BC1_RGB_SRGB_BLOCK, 8, 3, "bc1_rgb_srgb_block"},
    BlockFormat{VK_FORMAT_BC4_UNORM_BLOCK, 8, 1, "bc4_unorm_block"},
    BlockFormat{VK_FORMAT_BC5_UNORM_BLOCK, 16, 2, "bc5_unorm_block"},
    BlockFormat{VK_FORMAT_BC7_UNORM_BLOCK, 16, 4, "bc7_unorm_block"},
    BlockFormat{VK_FORMAT_BC7_SRGB_BLOCK, 16, 4, "bc7_srgb_block"},
};

const BlockFormat* find_block(VkFormat format) {
  const auto found = std::ranges::find(kBlockFormats, format, &BlockFormat::format);
  return found != kBlockFormats.end() ? &*found : nullptr;
}

const Format* find(VkFormat format) {
  const auto found =
      std::find_if(kFormats.begin(), kFormats.end(), [&](const Format& f) { return f.format == format; });
  return found != kFormats.end() ? &*found : nullptr;
}

std::uint32_t channels_of(const Format& format) {
  return static_cast<std::uint32_t>(4 - std::count(format.bits.begin(), format.bits.end(), 0));
}

std::uint32_t texel_bytes_of(const Format& format) {
  return static_cast<std::uint32_t>(format.bits[0] + format.bits[1] + format.bits[2] + format.bits[3]) / 8;
}

/// Floats with 5 bits of exponent (bias 15): 16 bits with sign, 11 and 10 bits without.
struct SmallFloat {
  int mantissa_bits;
  bool has_sign;
};

SmallFloat small_float(Kind kind, int bits) {
  if (kind == Kind::kFloat) return {10, true};
  return {bits - 5, false};
}

constexpr int kBias = 15;
constexpr std::uint32_t kTopExponent = 31;

float decode_small(std::uint32_t raw, SmallFloat type) {
  const std::uint32_t mantissa = raw & ((1u << type.mantissa_bits) - 1);
  const std::uint32_t exponent = raw >> type.mantissa_bits & kTopExponent;
  const bool is_negative = type.has_sign && (raw >> (type.mantissa_bits + 5) & 1u) != 0;
  if (exponent == kTopExponent) {
    // The payload of a NaN stays in the upper bits, as the processor's own conversion leaves it.
    const std::uint32_t bits = 0x7f800000u | mantissa << (23 - type.mantissa_bits) | (is_negative ? 0x80000000u : 0u);
    return std::bit_cast<float>(bits);
  }
  const std::uint32_t whole = exponent == 0 ? mantissa : mantissa | 1u << type.mantissa_bits;
  const int power = std::max(static_cast<int>(exponent), 1) - kBias - type.mantissa_bits;
  const float magnitude = std::ldexp(static_cast<float>(whole), power);
  return is_negative ? -magnitude : magnitude;
}

std::uint32_t encode_small(float value, SmallFloat type) {
  const std::uint32_t infinity = kTopExponent << type.mantissa_bits;
  const std::uint32_t sign = type.has_sign && std::signbit(value) ? 1u << (type.mantissa_bits + 5) : 0u;
  if (std::isnan(value)) {
    const std::uint32_t payload = (std::bit_cast<std::uint32_t>(value) & 0x7fffffu) >> (23 - type.mantissa_bits);
    return sign | infinity | (payload != 0 ? payload : 1u << (type.mantissa_bits - 1));
  }
  if (!type.has_sign && std::signbit(value)) return 0;
  const float magnitude = std::fabs(value);
  if (std::isinf(value)) return sign | infinity;
  // Below the smallest normal number the step stays that of the smallest exponent.
  const int exponent = magnitude == 0 ? 1 - kBias : std::max(std::ilogb(magnitude), 1 - kBias);
  const double steps = std::nearbyint(std::ldexp(static_cast<double>(magnitude), type.mantissa_bits - exponent));
  // A carry out of the mantissa moves into the exponent by itself, since the fields are adjacent.
  const double raw = steps + std::ldexp(static_cast<double>(exponent + kBias - 1), type.mantissa_bits);
  return sign | static_cast<std::uint32_t>(std::min(raw, static_cast<double>(infinity - 1)));
}

float decode(std::uint32_t raw, Kind kind, int bits) {
  const double top = std::ldexp(1.0, bits) - 1;  // largest unsigned value
  switch (kind) {
    case Kind::kUnorm:
      return static_cast<float>(raw / top);
    case Kind::kSnorm: {
      const auto whole = static_cast<std::int32_t>(raw << (32 - bits)) >> (32 - bits);
      return static_cast<float>(std::max(whole / (std::ldexp(1.0, bits - 1) - 1), -1.0));
    }
    case Kind::kUint:
      return static_cast<float>(raw);
    case Kind::kSint:
      return static_cast<float>(static_cast<std::int32_t>(raw << (32 - bits)) >> (32 - bits));
    case Kind::kFloat:
      if (bits == 32) return std::bit_cast<float>(raw);
      return decode_small(raw, small_float(kind, bits));
    case Kind::kUfloat:
      return decode_small(raw, small_float(kind, bits));
  }
  return 0;
}

std::uint32_t encode(float value, Kind kind, int bits) {
  const std::uint32_t mask = bits == 32 ? 0xffffffffu : (1u << bits) - 1;
  const double number = std::isnan(value) ? 0.0 : static_cast<double>(value);
  const auto rounded = [&](double low, double high, double scale) {
    return static_cast<std::int64_t>(std::nearbyint(std::clamp(number, low, high) * scale));
  };
  switch (kind) {
    case Kind::kUnorm:
      return static_cast<std::uint32_t>(rounded(0, 1, static_cast<double>(mask)));
    case Kind::kSnorm:
      return static_cast<std::uint32_t>(rounded(-1, 1, static_cast<double>(mask >> 1))) & mask;
    case Kind::kUint:
      return static_cast<std::uint32_t>(rounded(0, static_cast<double>(mask), 1));
    case Kind::kSint: {
      const auto high = static_cast<double>(mask >> 1);
      return static_cast<std::uint32_t>(rounded(-high - 1, high, 1)) & mask;
    }
    case Kind::kFloat:
      if (bits == 32) return std::bit_cast<std::uint32_t>(value);
      return encode_small(value, small_float(kind, bits));
    case Kind::kUfloat:
      return encode_small(value, small_float(kind, bits));
  }
  return 0;
}

const Format& require(VkFormat format) {
  if (const Format* const found = find(format)) return *found;
  if (const BlockFormat* const block = find_block(format); block != nullptr)
    throw Error(HEDDLE_UNSUPPORTED,
                std::string("texels of ") + block->name + " have no bytes of their own: it is compressed");
  throw Error(HEDDLE_UNSUPPORTED, "the host does not know the format " + format_text(format));
}

/// Texels are read and written as little-endian bit strings; a packed format never has channels across 32 bits.
bool is_packed(const Format& format) {
  return format.bits[0] % 8 != 0;
}

}  // namespace

FormatInfo format_info(VkFormat format) {
  if (const BlockFormat* const block = find_block(format); block != nullptr)
    return {.channels = block->channels, .block_bytes = block->bytes, .name = block->name};
  const Format* const found = find(format);
  if (found == nullptr) return {};
  return {.texel_bytes = texel_bytes_of(*found),
          .channels = channels_of(*found),
          .glsl = found->glsl,
          .name = found->name,
          .is_depth = found->is_depth};
}

std::uint64_t image_bytes(VkFormat format, std::uint32_t width, std::uint32_t height) {
  const FormatInfo info = format_info(format);
  if (info.block_bytes != 0) return std::uint64_t{info.block_bytes} * ((width + 3) / 4) * ((height + 3) / 4);
  return std::uint64_t{info.texel_bytes} * width * height;
}

std::string format_text(VkFormat format) {
  if (const BlockFormat* const block = find_block(format); block != nullptr) return block->name;
  const Format* const found = find(format);
  return found != nullptr ? found->name : "VkFormat " + std::to_string(static_cast<int>(format));
}

std::vector<float> to_float(std::span<const std::byte> texels, VkFormat format) {
  const Format& known = require(format);
  std::vector<float> values(texels.size() / texel_bytes_of(known) * channels_of(known));
  to_float(texels, format, values);
  return values;
}

void to_float(std::span<const std::byte> texels, VkFormat format, std::span<float> values) {
  static_assert(std::endian::native == std::endian::little);
  const Format& known = require(format);
  const std::size_t texel_bytes = texel_bytes_of(known);
  const std::uint32_t channels = channels_of(known);
  if (texels.size() % texel_bytes != 0) {
    throw Error(HEDDLE_BUG, Diagnostic{.message = "bytes end within a texel of " + format_text(format),
                                       .found = std::to_string(texels.size()) + " bytes",
                                       .expected = "a multiple of " + std::to_string(texel_bytes)});
  }
  std::size_t value = 0;
  for (std::size_t at = 0; at < texels.size(); at += texel_bytes) {
    std::uint32_t packed = 0;
    if (is_packed(known)) std::memcpy(&packed, &texels[at], texel_bytes);
    std::size_t bit = 0;
    for (std::uint32_t channel = 0; channel < channels; ++channel) {
      const int bits = known.bits[channel];
      std::uint32_t raw = 0;
      if (is_packed(known)) {
        raw = packed >> bit & ((1u << bits) - 1);
      } else {
        std::memcpy(&raw, &texels[at + bit / 8], static_cast<std::size_t>(bits) / 8);
      }
      values[value++] = decode(raw, known.kind, bits);
      bit += static_cast<std::size_t>(bits);
    }
  }
}

std::vector<std::byte> from_float(std::span<const float> values, VkFormat format) {
  const Format& known = require(format);
  const std::size_t texel_bytes = texel_bytes_of(known);
  const std::uint32_t channels = channels_of(known);
  if (values.size() % channels != 0) {
    throw Error(HEDDLE_BUG, Diagnostic{.message = "values end within a texel of " + format_text(format),
                                       .found = std::to_string(values.size()) + " values",
                                       .expected = "a multiple of " + std::to_string(channels)});
  }
  std::vector<std::byte> texels(values.size() / channels * texel_bytes);
  std::size_t value = 0;
  for (std::size_t at = 0; at < texels.size(); at += texel_bytes) {
    std::uint32_t packed = 0;
    std::size_t bit = 0;
    for (std::uint32_t channel = 0; channel < channels; ++channel) {
      const int bits = known.bits[channel];
      const std::uint32_t raw = encode(values[value++], known.kind, bits);
      if (is_packed(known)) {
        packed |= raw << bit;
      } else {
        std::memcpy(&texels[at + bit / 8], &raw, static_cast<std::size_t>(bits) / 8);
      }
      bit += static_cast<std::size_t>(bits);
    }
    if (is_packed(known)) std::memcpy(&texels[at], &packed, texel_bytes);
  }
  return texels;
}

}  // namespace heddle::vulkan
