// SPDX-License-Identifier: Apache-2.0
// Blocks: layouts against the specification, errors against bounds, flat blocks, equal blocks for equal texels.
#include "block_compression.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "texture_tiles.hpp"

namespace {

using namespace heddle::block_compression;
namespace tiles = heddle::texture_tiles;

Texels flat(float r, float g, float b) {
  Texels texels;
  texels.fill({r, g, b});
  return texels;
}

Texels through(std::uint32_t format, const Texels& texels) {
  std::array<std::byte, 16> bytes{};
  Texels back{};
  if (format == kBc1) {
    encode_bc1(texels, bytes.data());
    decode_bc1(bytes.data(), back);
  } else {
    encode_bc7(texels, bytes.data());
    EXPECT_TRUE(decode_bc7(bytes.data(), back));
  }
  return back;
}

float largest_error(const Texels& a, const Texels& b) {
  float most = 0;
  for (std::size_t i = 0; i < 16; ++i)
    for (std::size_t c = 0; c < 3; ++c) most = std::max(most, std::abs(a[i][c] - b[i][c]));
  return most;
}

TEST(BlockCompression, Bc7BlocksAreLaidOutAsTheSpecificationSays) {
  // Mode 6: six zeros and a one; red's ends 0 and 127 of 7 bits with the lowest bits 0 and 1: 0 and 255.
  Texels ramp{};
  for (std::size_t i = 0; i < 16; ++i) ramp[i].fill(static_cast<float>(detail::kWeights[i]) * 255.0F / 64.0F);
  std::array<std::byte, 16> bytes{};
  encode_bc7(ramp, bytes.data());
  EXPECT_EQ(std::to_integer<int>(bytes[0]) & 127, 64);
  std::uint64_t low = 0, high = 0;
  std::memcpy(&low, bytes.data(), 8);
  std::memcpy(&high, bytes.data() + 8, 8);
  EXPECT_EQ(low >> 7 & 127, 0U);     // red of the first end
  EXPECT_EQ(low >> 14 & 127, 127U);  // of the second
  EXPECT_EQ(low >> 49 & 127, 127U);  // alpha
  EXPECT_EQ(low >> 63 & 1, 0U);      // the ends' lowest bits
  EXPECT_EQ(high & 1, 1U);
  for (std::uint64_t i = 1; i < 16; ++i) EXPECT_EQ(high >> (4 * i) & 15, i);
  EXPECT_LE(largest_error(through(kBc7, ramp), ramp), 0.5F);
}

TEST(BlockCompression, FlatBlocksStayFlat) {
  float worst_bc1 = 0;
  for (int code = 0; code < 256; ++code) {
    const auto v = static_cast<float>(code);
    EXPECT_EQ(largest_error(through(kBc7, flat(v, v, v)), flat(v, v, v)), 0) << code;
    const Texels mixed = flat(v, 255 - v, 128);
    EXPECT_LE(largest_error(through(kBc7, mixed), mixed), 1) << code;
    const Texels back = through(kBc1, mixed);
    EXPECT_EQ(back, flat(back[0][0], back[0][1], back[0][2]));
    worst_bc1 = std::max(worst_bc1, largest_error(back, mixed));
  }
  // 5 bits have steps of 8.2, thirds of neighbouring ones lie 2.75 apart.
  EXPECT_LE(worst_bc1, 2);
}

TEST(BlockCompression, TwoColoursAreKeptWithinTheStepsOfTheirEnds) {
  std::mt19937 random(3);
  for (int i = 0; i < 200; ++i) {
    std::array<float, 3> a{}, b{};
    for (std::size_t c = 0; c < 3; ++c) {
      a[c] = static_cast<float>(random() % 256);
      b[c] = static_cast<float>(random() % 256);
    }
    Texels texels{};
    for (Texels::value_type& texel : texels) texel = random() % 2 == 0 ? a : b;
    EXPECT_LE(largest_error(through(kBc7, texels), texels), 1);
    EXPECT_LE(largest_error(through(kBc1, texels), texels), 4.2F) << "half of 1/31, rounded";
  }
}

TEST(BlockCompression, CostsWhatThePicturesSay) {
  const tiles::Texture road{tiles::kRoad, 4096, 1, tiles::kWrap};
  std::vector<tiles::Rgba8> texels, back;
  tiles::make_texels(road, 0, 1900, 1000, 256, 256, texels);
  back.resize(texels.size());
  const auto psnr = [&](std::uint32_t format) {
    std::vector<std::byte> bytes(bytes_of(format, 256, 256));
    encode(format, first_byte(texels), 256, 256, bytes.data());
    EXPECT_TRUE(decode(format, bytes.data(), 256, 256, first_byte(back)));
    double sum = 0;
    for (std::size_t i = 0; i < texels.size(); ++i) {
      const int r = texels[i].r - back[i].r, g = texels[i].g - back[i].g, b = texels[i].b - back[i].b;
      sum += r * r + g * g + b * b;
    }
    return 10 * std::log10(255.0 * 255.0 * 3.0 * static_cast<double>(texels.size()) / std::max(sum, 1e-9));
  };
  const double bc1 = psnr(kBc1), bc7 = psnr(kBc7);
  std::printf("road: BC1 %.1f dB, BC7 %.1f dB\n", bc1, bc7);
  EXPECT_GT(bc1, 33);
  EXPECT_GT(bc7, 42);
  EXPECT_GT(psnr(kNone), 100);
}

TEST(BlockCompression, EqualTexelsAreEqualBytesWhereverTheyLie) {  // H7
  const tiles::Texture land{tiles::kTerrain, 4096, 1, tiles::kWrap};
  std::vector<tiles::Rgba8> left, right;
  // Two tiles of 64 with borders of 2: blocks from 62 to 66 are in both.
  tiles::make_texels(land, 0, -2, 0, 68, 68, left);
  tiles::make_texels(land, 0, 62, 0, 68, 68, right);
  for (const std::uint32_t format : {kBc1, kBc7}) {
    std::vector<std::byte> a(bytes_of(format, 68, 68)), b(a.size());
    encode(format, first_byte(left), 68, 68, a.data());
    encode(format, first_byte(right), 68, 68, b.data());
    const std::size_t block = format == kBc1 ? 8 : 16;
    for (std::size_t row = 0; row < 17; ++row)
      EXPECT_EQ(std::memcmp(a.data() + (17 * row + 16) * block, b.data() + 17 * row * block, block), 0);
  }
}

}  // namespace
