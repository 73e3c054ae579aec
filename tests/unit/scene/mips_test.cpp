// SPDX-License-Identifier: Apache-2.0
// Mip chains: sizes, averages worked out by hand, and the transfer function against its definition.
#include "scene/mips.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace heddle::scene {
namespace {

Texture texture(std::uint32_t width, std::uint32_t height, bool is_srgb, const std::vector<std::uint8_t>& red) {
  Texture made;
  made.width = width;
  made.height = height;
  made.is_srgb = is_srgb;
  for (const std::uint8_t value : red) {
    made.rgba.insert(made.rgba.end(), {value, 0, 255, value});
  }
  return made;
}

TEST(Srgb, EveryCodeComesBack) {
  for (int code = 0; code < 256; ++code) {
    EXPECT_EQ(encode_srgb(decode_srgb(static_cast<std::uint8_t>(code))), code);
  }
}

TEST(Srgb, EncodingRoundsToTheNearestCode) {
  for (int i = 0; i <= 100000; ++i) {
    const double linear = i / 100000.0;
    const double encoded = linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
    // A value within float32's rounding of the middle between two codes may go either way.
    EXPECT_NEAR(encode_srgb(static_cast<float>(linear)), encoded * 255, 0.5 + 1e-3) << linear;
  }
  EXPECT_EQ(encode_srgb(-1), 0);
  EXPECT_EQ(encode_srgb(2), 255);
  EXPECT_EQ(encode_srgb(std::nanf("")), 0);
}

TEST(Mips, GoDownToOneTexel) {
  EXPECT_EQ(mip_count(1, 1), 1U);
  EXPECT_EQ(mip_count(2, 1), 2U);
  EXPECT_EQ(mip_count(255, 3), 8U);
  EXPECT_EQ(mip_count(256, 3), 9U);
  const std::vector<MipLevel> mips = make_mips(texture(5, 3, false, std::vector<std::uint8_t>(15, 9)));
  ASSERT_EQ(mips.size(), 3U);
  EXPECT_EQ(mips[1].width, 2U);
  EXPECT_EQ(mips[1].height, 1U);
  EXPECT_EQ(mips[2].width, 1U);
  EXPECT_EQ(mips[2].rgba.size(), 4U);
}

TEST(Mips, FirstLevelIsTheTextureItself) {
  const Texture made = texture(2, 2, true, {1, 2, 3, 4});
  EXPECT_EQ(make_mips(made)[0].rgba, made.rgba);
}

TEST(Mips, DataIsAveragedAsItIs) {
  const std::vector<MipLevel> mips = make_mips(texture(2, 2, false, {0, 10, 20, 31}));
  EXPECT_THAT(mips[1].rgba, testing::ElementsAre(15, 0, 255, 15));  // 15.25
}

TEST(Mips, ColourIsAveragedInLinearLightAndAlphaIsNot) {
  const std::vector<MipLevel> mips = make_mips(texture(2, 2, true, {0, 255, 0, 255}));
  // Half the light of white encodes as 188 (0.5 -> 0.7354), half the alpha as 128.
  EXPECT_THAT(mips[1].rgba, testing::ElementsAre(188, 0, 255, 128));
}

TEST(Mips, OddSizesLoseNoRow) {
  // 3 -> 1: a third each.
  EXPECT_EQ(make_mips(texture(3, 1, false, {0, 0, 255}))[1].rgba[0], 85);
  // 5 -> 2: each covers two and a half texels: (10 + 20 + 30 / 2) / 2.5 and (30 / 2 + 40 + 50) / 2.5.
  const std::vector<MipLevel> mips = make_mips(texture(5, 1, false, {10, 20, 30, 40, 50}));
  EXPECT_EQ(mips[1].rgba[0], 18);
  EXPECT_EQ(mips[1].rgba[4], 42);
  EXPECT_EQ(mips[2].rgba[0], 30);
}

TEST(Mips, LevelsDoNotAccumulateRounding) {
  // Texels 0 and 1 alternate: the average is 0.5 at every level, and rounding it up level by level would keep it at 1
  // only by rounding 0.5 once; from unrounded levels a quarter stays a quarter.
  std::vector<std::uint8_t> quarter(64 * 64, 0);
  for (std::size_t i = 0; i < quarter.size(); i += 4) {
    quarter[i] = 2;
  }
  for (const MipLevel& mip : make_mips(texture(64, 64, false, quarter))) {
    if (mip.width <= 16) {
      EXPECT_EQ(mip.rgba[0], 1);  // 0.5 rounds up, once
    }
  }
  for (std::size_t i = 0; i < quarter.size(); ++i) {
    quarter[i] = i % 4 == 0 ? 1 : 0;  // 0.25: two levels that each rounded 0.5 up would make 1 of it
  }
  EXPECT_EQ(make_mips(texture(64, 64, false, quarter)).back().rgba[0], 0);
}

TEST(Mips, FlatColoursStayFlat) {
  for (const bool is_srgb : {false, true}) {
    for (int code = 0; code < 256; code += 5) {
      const auto value = static_cast<std::uint8_t>(code);
      for (const MipLevel& mip : make_mips(texture(7, 6, is_srgb, std::vector<std::uint8_t>(42, value)))) {
        EXPECT_EQ(mip.rgba[0], value);
        EXPECT_EQ(mip.rgba[mip.rgba.size() - 4], value);
      }
    }
  }
}

}  // namespace
}  // namespace heddle::scene
