// SPDX-License-Identifier: Apache-2.0
// Texels <-> float32: every small value there and back, rounding against a search, packed orders, ends of ranges.
#include "vulkan/device.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

namespace heddle::vulkan {
namespace {

using testing::ElementsAre;

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

template <typename Word>
std::vector<Word> words(const std::vector<std::byte>& bytes) {
  std::vector<Word> result(bytes.size() / sizeof(Word));
  std::memcpy(result.data(), bytes.data(), bytes.size());
  return result;
}

template <typename Word>
std::vector<Word> store(std::vector<float> values, VkFormat format) {
  return words<Word>(from_float(values, format));
}

template <typename Word>
std::vector<float> load(std::vector<Word> texels, VkFormat format) {
  return to_float(std::as_bytes(std::span(texels)), format);
}

/// All words of 16 bits that a predicate keeps.
template <typename Keep>
std::vector<std::uint16_t> all_words(Keep keep) {
  std::vector<std::uint16_t> result;
  for (std::uint32_t word = 0; word < 0x10000; ++word) {
    if (keep(word)) result.push_back(static_cast<std::uint16_t>(word));
  }
  return result;
}

TEST(Format, EveryHalfComesBackWithItsBits) {
  const auto halves = all_words([](std::uint32_t) { return true; });  // Inf and all NaN payloads too
  EXPECT_EQ(store<std::uint16_t>(load(halves, VK_FORMAT_R16_SFLOAT), VK_FORMAT_R16_SFLOAT), halves);
}

TEST(Format, EveryWordOfSixteenBitsComesBack) {
  const auto all = all_words([](std::uint32_t) { return true; });
  for (const VkFormat format :
       {VK_FORMAT_R16_UNORM, VK_FORMAT_R16_UINT, VK_FORMAT_D16_UNORM, VK_FORMAT_R8G8_UNORM, VK_FORMAT_R8G8_UINT}) {
    EXPECT_EQ(store<std::uint16_t>(load(all, format), format), all) << format_info(format).name;
  }
  // The lowest number of signed formats means -1 like the one above it, which is what is written.
  const auto no_lowest = all_words([](std::uint32_t word) { return word != 0x8000; });
  EXPECT_EQ(store<std::uint16_t>(load(no_lowest, VK_FORMAT_R16_SNORM), VK_FORMAT_R16_SNORM), no_lowest);
  const auto no_low_byte = all_words([](std::uint32_t word) { return (word & 0xff) != 0x80 && word >> 8 != 0x80; });
  EXPECT_EQ(store<std::uint16_t>(load(no_low_byte, VK_FORMAT_R8G8_SNORM), VK_FORMAT_R8G8_SNORM), no_low_byte);
}

TEST(Format, EveryUnsignedFloatComesBack) {
  std::vector<std::uint32_t> texels;
  for (std::uint32_t word = 0; word < 0x800; ++word) {
    texels.push_back(word | (0x7ff - word) << 11 | (word & 0x3ff) << 22);
  }
  EXPECT_EQ(store<std::uint32_t>(load(texels, VK_FORMAT_B10G11R11_UFLOAT_PACK32), VK_FORMAT_B10G11R11_UFLOAT_PACK32),
            texels);
}

TEST(Format, HalvesRoundToNearestWithTiesToEven) {
  std::mt19937 random(7);
  const auto check_nearest = [](float value) {
    const std::uint16_t raw = store<std::uint16_t>({std::fabs(value)}, VK_FORMAT_R16_SFLOAT)[0];
    ASSERT_LT(raw, 0x7c00);
    const auto distance = [&](int word) {
      const float half = load<std::uint16_t>({static_cast<std::uint16_t>(word)}, VK_FORMAT_R16_SFLOAT)[0];
      return std::fabs(static_cast<double>(half) - std::fabs(static_cast<double>(value)));
    };
    for (const int other : {raw - 1, raw + 1}) {
      if (other < 0 || other >= 0x7c00) continue;
      EXPECT_TRUE(distance(raw) < distance(other) || (distance(raw) == distance(other) && raw % 2 == 0))
          << value << " became " << raw << " although " << other << " is nearer";
    }
  };
  for (int i = 0; i < 20000; ++i) {
    const float value = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
    if (std::isfinite(value) && std::fabs(value) < 65504) check_nearest(value);
    // Random bits are mostly far out of range; these cover every exponent of a half, subnormal ones too.
    check_nearest(std::ldexp(1 + static_cast<float>(random() % 8192) / 8192, static_cast<int>(random() % 42) - 26));
  }
}

TEST(Format, HalvesKeepInfinityAndNaNAndClampTheRest) {
  const float tiny = std::ldexp(1.0f, -25);  // half of the smallest half
  EXPECT_THAT(
      store<std::uint16_t>({kInf, -kInf, 65519.0f, 65520.0f, 1e6f, -1e6f, -0.0f, tiny, std::nextafter(tiny, 1.0f)},
                           VK_FORMAT_R16_SFLOAT),
      ElementsAre(0x7c00, 0xfc00, 0x7bff, 0x7bff, 0x7bff, 0xfbff, 0x8000, 0, 1));
  const auto nan = store<std::uint16_t>({kNaN, -kNaN}, VK_FORMAT_R16_SFLOAT);
  EXPECT_THAT(nan, ElementsAre(0x7e00, 0xfe00));
  // A payload in the low bits alone must not turn a NaN into an infinity.
  EXPECT_THAT(store<std::uint16_t>({std::bit_cast<float>(0x7f800001u)}, VK_FORMAT_R16_SFLOAT), ElementsAre(0x7e00));
}

TEST(Format, FullFloatsAreCopiedBitByBit) {
  const std::vector<std::uint32_t> bits = {0x7f800000u, 0xff800000u, 0x7fc12345u, 0x00000001u, 0x80000000u};
  EXPECT_EQ(store<std::uint32_t>(load(bits, VK_FORMAT_R32_SFLOAT), VK_FORMAT_R32_SFLOAT), bits);
  EXPECT_EQ(store<std::uint32_t>(load(bits, VK_FORMAT_D32_SFLOAT), VK_FORMAT_D32_SFLOAT), bits);
}

TEST(Format, UnsignedFloatsHaveNoSign) {
  const float smallest_10 = std::ldexp(1.0f, -19);
  EXPECT_THAT(store<std::uint32_t>({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, smallest_10}, VK_FORMAT_B10G11R11_UFLOAT_PACK32),
              ElementsAre(0x3c0u, 0x3c0u << 11, 0x1e0u << 22, 1u << 22));
  EXPECT_THAT(
      store<std::uint32_t>({-kInf, -1, -0.0f, kInf, kInf, kInf, 1e9f, 1e9f, 1e9f}, VK_FORMAT_B10G11R11_UFLOAT_PACK32),
      ElementsAre(0u, 0x7c0u | 0x7c0u << 11 | 0x3e0u << 22, 0x7bfu | 0x7bfu << 11 | 0x3dfu << 22));
  const auto back = load<std::uint32_t>({0x7bfu | 0x7bfu << 11 | 0x3dfu << 22}, VK_FORMAT_B10G11R11_UFLOAT_PACK32);
  EXPECT_THAT(back, ElementsAre(65024.0f, 65024.0f, 64512.0f));  // the largest that Vulkan names
  for (const float value :
       to_float(from_float(std::vector<float>{kNaN, -kNaN, kNaN}, VK_FORMAT_B10G11R11_UFLOAT_PACK32),
                VK_FORMAT_B10G11R11_UFLOAT_PACK32)) {
    EXPECT_TRUE(std::isnan(value));
  }
}

TEST(Format, PackedUnormHasRedInTheLowestBits) {
  EXPECT_THAT(
      store<std::uint32_t>({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, VK_FORMAT_A2B10G10R10_UNORM_PACK32),
      ElementsAre(0x3ffu, 0x3ffu << 10, 0x3ffu << 20, 3u << 30));
  EXPECT_THAT(load<std::uint32_t>({0xffffffffu}, VK_FORMAT_A2B10G10R10_UNORM_PACK32), ElementsAre(1, 1, 1, 1));
}

TEST(Format, UnormClampsAndRounds) {
  EXPECT_THAT(store<std::uint8_t>({0, 1, -1, 2, kInf, -kInf, kNaN, 0.5f}, VK_FORMAT_R8_UNORM),
              ElementsAre(0, 255, 0, 255, 255, 0, 0, 128));
  EXPECT_THAT(load<std::uint8_t>({0, 51, 255}, VK_FORMAT_R8_UNORM), ElementsAre(0.0f, 0.2f, 1.0f));
}

TEST(Format, SnormEndsMeetAtMinusOne) {
  EXPECT_THAT(load<std::int8_t>({-128, -127, 0, 127}, VK_FORMAT_R8_SNORM), ElementsAre(-1, -1, 0, 1));
  EXPECT_THAT(load<std::int16_t>({-32768, -32767, 32767}, VK_FORMAT_R16_SNORM), ElementsAre(-1, -1, 1));
  EXPECT_THAT(store<std::int8_t>({-1, -2, 1, kNaN, -0.004f, 0.004f}, VK_FORMAT_R8_SNORM),
              ElementsAre(-127, -127, 127, 0, -1, 1));
}

TEST(Format, SrgbStaysAsStored) {
  const std::vector<std::uint8_t> texel = {0, 51, 128, 255};
  EXPECT_THAT(load(texel, VK_FORMAT_R8G8B8A8_SRGB), ElementsAre(0.0f, 0.2f, 128.0f / 255.0f, 1.0f));
  EXPECT_EQ(store<std::uint8_t>({0.0f, 0.2f, 128.0f / 255.0f, 1.0f}, VK_FORMAT_R8G8B8A8_SRGB), texel);
}

TEST(Format, IntegersClampToTheirRange) {
  EXPECT_THAT(store<std::uint8_t>({-1, 2.5f, 3.5f, 300, kNaN}, VK_FORMAT_R8_UINT), ElementsAre(0, 2, 4, 255, 0));
  EXPECT_THAT(store<std::uint32_t>({-5, 5e9f, kInf, 16777216.0f}, VK_FORMAT_R32_UINT),
              ElementsAre(0u, 0xffffffffu, 0xffffffffu, 16777216u));
  EXPECT_THAT(store<std::int32_t>({-3e9f, 3e9f, -7, kNaN}, VK_FORMAT_R32_SINT),
              ElementsAre(std::numeric_limits<std::int32_t>::min(), std::numeric_limits<std::int32_t>::max(), -7, 0));
  EXPECT_THAT(load<std::int32_t>({-7, 1 << 24}, VK_FORMAT_R32_SINT), ElementsAre(-7, 16777216));
}

TEST(Format, TellsBytesChannelsAndQualifier) {
  const FormatInfo half = format_info(VK_FORMAT_R16G16B16A16_SFLOAT);
  EXPECT_EQ(half.texel_bytes, 8u);
  EXPECT_EQ(half.channels, 4u);
  EXPECT_STREQ(half.glsl, "rgba16f");
  EXPECT_STREQ(half.name, "r16g16b16a16_sfloat");
  EXPECT_FALSE(half.is_depth);
  const FormatInfo depth = format_info(VK_FORMAT_D32_SFLOAT);
  EXPECT_TRUE(depth.is_depth);
  EXPECT_STREQ(depth.glsl, "");
  const FormatInfo packed = format_info(VK_FORMAT_B10G11R11_UFLOAT_PACK32);
  EXPECT_EQ(packed.texel_bytes, 4u);
  EXPECT_EQ(packed.channels, 3u);
  EXPECT_STREQ(format_info(VK_FORMAT_R8G8B8A8_SRGB).glsl, "");  // no driver stores sRGB
  const FormatInfo blocks = format_info(VK_FORMAT_BC7_SRGB_BLOCK);
  EXPECT_EQ(blocks.texel_bytes, 0u);
  EXPECT_EQ(blocks.block_bytes, 16u);
  EXPECT_EQ(blocks.channels, 4u);
  EXPECT_STREQ(format_info(VK_FORMAT_BC1_RGB_SRGB_BLOCK).name, "bc1_rgb_srgb_block");
  EXPECT_EQ(format_info(VK_FORMAT_ASTC_4x4_UNORM_BLOCK).channels, 0u);
}

TEST(Format, BytesOfAnImageAreWholeBlocks) {
  EXPECT_EQ(image_bytes(VK_FORMAT_R8G8B8A8_SRGB, 5, 3), 60u);
  EXPECT_EQ(image_bytes(VK_FORMAT_BC7_SRGB_BLOCK, 8, 8), 64u);
  EXPECT_EQ(image_bytes(VK_FORMAT_BC1_RGB_SRGB_BLOCK, 5, 1), 16u);
}

template <typename Call>
std::string error_of(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return to_text(error.diagnostics());
  }
  return "no error";
}

TEST(Format, UnknownFormatsAndPartsOfTexelsAreErrors) {
  const std::vector<std::byte> five(5);
  EXPECT_EQ(error_of([&] { (void)to_float(five, VK_FORMAT_ASTC_4x4_UNORM_BLOCK); }),
            "error: the host does not know the format VkFormat 157");
  EXPECT_EQ(error_of([&] { (void)to_float(five, VK_FORMAT_BC7_UNORM_BLOCK); }),
            "error: texels of bc7_unorm_block have no bytes of their own: it is compressed");
  EXPECT_EQ(error_of([&] { (void)to_float(five, VK_FORMAT_R16G16_SFLOAT); }),
            "error: bytes end within a texel of r16g16_sfloat\n"
            "  found:    5 bytes\n"
            "  expected: a multiple of 4");
  EXPECT_EQ(error_of([] { (void)from_float(std::vector<float>(3), VK_FORMAT_R16G16_SFLOAT); }),
            "error: values end within a texel of r16g16_sfloat\n"
            "  found:    3 values\n"
            "  expected: a multiple of 2");
}

}  // namespace
}  // namespace heddle::vulkan
