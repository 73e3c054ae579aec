// SPDX-License-Identifier: Apache-2.0
// plugins/shared/texture_footprint.glsl and texture_source/virtual/tile_table.glsl, compiled here as C++ (glm; literals
// are float by a compiler option, as in GLSL), against integers and float64. Needs no device.
#include <glm/glm.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <random>
#include <string>

namespace glsl {
using namespace glm;
#include "texture_source/virtual/tile_table.glsl"
}  // namespace glsl

namespace {

using glm::ivec2;
using glm::vec2;
using glsl::TextureFootprint;
using glsl::TexturePlace;

constexpr double operator""_d(long double value) {
  return static_cast<double>(value);
}

constexpr int kTile = 128, kBorder = 4, kPitch = kTile + 2 * kBorder;

/// Distance in texels of the cache between where the place is looked up and where it should be, one axis: the slot is
/// the last of a cache of 8192.
double error_of(float u, double exact, int extent, int level, float chart_size, int first) {
  const TexturePlace place = glsl::texture_place(vec2(u, u), ivec2(first), chart_size, extent, glsl::kAddressWrap);
  const glsl::TileEntry entry{ivec2(59, 59), level};
  const glsl::CachePlace at = glsl::cache_place(entry, place, kTile, kBorder);
  const double level_texel = exact * extent / std::exp2(static_cast<double>(level));
  const double inside = level_texel - std::floor(level_texel / kTile) * kTile;
  const float sum = static_cast<float>(at.texel.x) + at.within.x;
  // A coordinate that rounds to the next tile is found in that one, as far away as it rounds.
  return std::abs(std::remainder(static_cast<double>(sum) - (59.0_d * kPitch + kBorder + inside), 1.0_d * kTile));
}

struct Curve {
  double table = 0, chart = 0, scaled = 0, half = 0;
};

/// Largest errors over places between `extent` - 1 and `extent` texels and others: what the table finds from one float
/// of the whole texture and from one of an eighth of it, and what a scale and a bias of the whole texture would find in
/// float32 and with the bias rounded to float16.
Curve errors_of(int extent) {
  Curve worst;
  std::mt19937_64 random(1);
  for (int i = 0; i < 200000; ++i) {
    // A place that neither float knows exactly.
    const double exact = (0.875_d + 0.125_d * (static_cast<double>(random() >> 11U) * 0x1p-53)) * (1 - 0x1p-30);
    const float u = static_cast<float>(exact);
    worst.table = std::max(worst.table, error_of(u, exact, extent, 0, static_cast<float>(extent), 0));
    const float local = static_cast<float>((exact - 0.875_d) * 8);
    worst.chart =
        std::max(worst.chart, error_of(local, exact, extent, 0, static_cast<float>(extent / 8), extent / 8 * 7));
    const double texel = exact * extent, tile = std::floor(texel / kTile);
    const double ideal = 59.0_d * kPitch + kBorder + (texel - tile * kTile);
    const float scale = static_cast<float>(extent);
    const float bias = static_cast<float>(59.0_d * kPitch + kBorder - tile * kTile);
    const volatile float product = u * scale;
    worst.scaled = std::max(worst.scaled, std::abs(static_cast<double>(product + bias) - ideal));
    const double grid = std::exp2(std::floor(std::log2(std::abs(static_cast<double>(bias)) + 1)) - 10);
    const float rounded = static_cast<float>(std::round(static_cast<double>(bias) / grid) * grid);
    worst.half = std::max(worst.half, std::abs(static_cast<double>(product + rounded) - ideal));
  }
  return worst;
}

TEST(TileTable, TranslationErrorIsThatOfTheCoordinateAlone) {
  for (const int extent : {4096, 16384, 65536, 262144}) {
    const Curve curve = errors_of(extent);
    std::printf("%7d texels: table %.6f, chart of an eighth %.6f, scale and bias %.6f, bias in float16 %.3f texel\n",
                extent, curve.table, curve.chart, curve.scaled, curve.half);
    // Half a unit of u below 1 and half a unit of the cache's coordinate below 8192.
    EXPECT_LE(curve.table, static_cast<double>(extent) * 0x1p-25 + 0x1p-12 + 1e-9_d);
    EXPECT_LE(curve.chart, static_cast<double>(extent) / 8 * 0x1p-25 + 0x1p-12 + 1e-9_d);
    if (extent >= 16384) {
      EXPECT_GE(curve.half, 1);
    }
  }
  EXPECT_LT(errors_of(262144).chart, 1.0_d / 256);
  EXPECT_GT(errors_of(262144).table, 1.0_d / 256) << "one float32 of 256 K texels is known not to do";
}

TEST(TileTable, EveryTextureLevelAndTileHasACellOfItsOwn) {
  for (const int n : {0, 1, 3, 6}) {
    std::vector<int> seen(((std::size_t{4} << (2 * static_cast<std::size_t>(n))) - 1) / 3, 0);
    for (int level = 0; level <= n; ++level)
      for (int y = 0; y < 1 << (n - level); ++y)
        for (int x = 0; x < 1 << (n - level); ++x) ++seen.at(glsl::cell_of(n, level, ivec2(x, y)));
    for (const int count : seen) EXPECT_EQ(count, 1);
  }
  EXPECT_EQ(glsl::cells_before(12, 12), (64U * 1024U * 1024U / 4U - 1U) * 4U / 3U);
}

TEST(TileTable, EntriesComeBackForEverySlotAndLevel) {
  for (unsigned level = 0; level < 16; ++level)
    for (unsigned slot = 0; slot < 256; ++slot) {
      const glsl::TileEntry entry = glsl::unpack_entry(glsl::pack_entry(slot, 255 - slot, level));
      EXPECT_EQ(entry.slot, ivec2(static_cast<int>(slot), static_cast<int>(255 - slot)));
      EXPECT_EQ(entry.level, static_cast<int>(level));
    }
}

/// What the place should be, in float64: exact, because u is a float and the extent a power of two.
std::int64_t folded(double texel, std::int64_t extent, unsigned mode) {
  auto i = static_cast<std::int64_t>(std::floor(texel));
  if (mode == glsl::kAddressClamp) return std::min(std::max<std::int64_t>(i, 0), extent - 1);
  const std::int64_t period = mode == glsl::kAddressMirror ? 2 * extent : extent;
  i = ((i % period) + period) % period;
  return i >= extent ? period - 1 - i : i;
}

TEST(TexturePlace, IsTheFloorOfTheExactProductOnEveryTileEdgeAndAtRandom) {  // H2
  constexpr int kExtent = 65536;
  std::mt19937 random(5);
  std::vector<float> us = {0, -0.0F, 1, -1, 2, 0x1p-149F, -0x1p-149F};
  for (int k = -600; k <= 1200; ++k) {
    const float edge = static_cast<float>(k) / 512.0F;
    us.push_back(edge);
    us.push_back(std::nextafter(edge, -4.0F));
    us.push_back(std::nextafter(edge, 4.0F));
  }
  for (int i = 0; i < 1000000; ++i) us.push_back(static_cast<float>(static_cast<double>(random()) * 0x1p-32 * 6 - 3));
  std::size_t wrong = 0;
  for (const unsigned mode : {glsl::kAddressWrap, glsl::kAddressMirror, glsl::kAddressClamp}) {
    for (const float u : us) {
      const TexturePlace place = glsl::texture_place(vec2(u, u), ivec2(0), kExtent, kExtent, mode);
      wrong += place.texel.x != folded(static_cast<double>(u) * kExtent, kExtent, mode) ? 1U : 0U;
      wrong += place.within.x < 0 || place.within.x >= 1 ? 1U : 0U;
      for (const int level : {1, 5, 9})
        wrong += glsl::place_in_level(place, level).texel.x != place.texel.x >> level ? 1U : 0U;
    }
  }
  EXPECT_EQ(wrong, 0U);
}

TEST(TexturePlace, OfWhatIsNoNumberIsATexel) {  // H3
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  for (const float u : {nan, inf, -inf, 1e30F, -1e30F}) {
    const TexturePlace place = glsl::texture_place(vec2(u, 0.25F), ivec2(0), 4096, 4096, glsl::kAddressWrap);
    EXPECT_EQ(place.texel, ivec2(0, 1024));
  }
  for (const float d : {nan, inf, -inf, 1e25F})
    for (const int taps : {1, 8}) {
      const TextureFootprint footprint = glsl::texture_footprint(vec2(d, 1), vec2(0, 1), taps, 7);
      EXPECT_EQ(glsl::footprint_level(footprint.lambda, 0, 7), 7);
      EXPECT_GE(footprint.taps, 1);
    }
  for (const int taps : {1, 8}) {
    const TextureFootprint footprint = glsl::texture_footprint(vec2(0), vec2(0), taps, 7);
    EXPECT_EQ(glsl::footprint_level(footprint.lambda, 0, 7), 0);
    EXPECT_EQ(footprint.taps, 1);
  }
}

TEST(TextureFootprint, HasTheAxesOfTheEllipseAndNoTapIsWiderThanItsTexel) {
  std::mt19937 random(9);
  const auto uniform = [&] { return static_cast<double>(random()) * 0x1p-31 - 1; };
  for (int i = 0; i < 100000; ++i) {
    const double scale = std::exp2(10 * uniform());
    const vec2 dx(static_cast<float>(scale * uniform()), static_cast<float>(scale * uniform()));
    const vec2 dy(static_cast<float>(scale * uniform()), static_cast<float>(scale * uniform()));
    const TextureFootprint footprint = glsl::texture_footprint(dx, dy, 16, 20);
    // Singular values of [dx dy] in float64.
    const glm::dvec2 a(dx), b(dy);
    const double sum = dot(a, a) + dot(b, b), det = std::abs(a.x * b.y - a.y * b.x);
    const double long_axis = std::sqrt(0.5_d * (sum + std::sqrt(std::max(sum * sum - 4 * det * det, 0.0_d))));
    EXPECT_NEAR(static_cast<double>(glm::length(footprint.major)) / long_axis, 1, 1e-5_d);
    const double rho = std::max(det / long_axis, long_axis / 16);
    // The determinant cancels where dx and dy are nearly parallel; then the other bound is the larger one.
    EXPECT_NEAR(static_cast<double>(footprint.lambda), std::log2(rho), 1e-4_d);
    const int level = glsl::footprint_level(footprint.lambda, 0, 20);
    const double step = long_axis / footprint.taps / std::exp2(static_cast<double>(level));
    EXPECT_LE(step, 1.0_d + 2e-3_d);
    // (H5) The outermost tap and its own filter stay within the border.
    const int within = glsl::taps_within_border(16, 4, 1);
    EXPECT_EQ(within, 8);
    const TextureFootprint bounded = glsl::texture_footprint(dx, dy, within, 20);
    const vec2 last =
        glsl::tap_offset(bounded, vec2(1), bounded.taps - 1, glsl::footprint_level(bounded.lambda, 0, 20));
    EXPECT_LE(glm::length(last) + 0.5F, 4.0F + 8e-3F);
  }
  EXPECT_EQ(glsl::taps_within_border(16, 1, 1), 2);
  EXPECT_EQ(glsl::taps_within_border(16, 8, 2), 8);
}

/// Of taps around places in a tile with `border` texels of its neighbours, how many reach into another slot.
std::size_t contaminated(int taps, int border) {
  std::mt19937 random(2);
  const auto uniform = [&] { return static_cast<float>(static_cast<double>(random()) * 0x1p-32); };
  std::size_t found = 0;
  for (int i = 0; i < 20000; ++i) {
    const float angle = 6.2831853F * uniform(), length = static_cast<float>(taps) * (0.5F + 0.5F * uniform());
    const vec2 along(std::cos(angle), std::sin(angle));
    const TextureFootprint footprint =
        glsl::texture_footprint(length * along, uniform() * vec2(-along.y, along.x), taps, 9);
    const int level = glsl::footprint_level(footprint.lambda, 0, 9);
    const float tile = 128;
    const vec2 middle(tile * uniform(), tile * uniform());
    for (int tap = 0; tap < footprint.taps; ++tap) {
      const vec2 at = middle + glsl::tap_offset(footprint, vec2(1), tap, level);
      const float reach = 0.5F - 1e-3F, low = -static_cast<float>(border), high = tile + static_cast<float>(border);
      found += std::min(at.x, at.y) - reach < low || std::max(at.x, at.y) + reach > high ? 1U : 0U;
    }
  }
  return found;
}

TEST(TextureFootprint, EightTapsNeedABorderOfFourTexels) {  // H5
  EXPECT_EQ(contaminated(8, 4), 0U);
  EXPECT_GT(contaminated(8, 1), 0U) << "else the test sees nothing";
  EXPECT_EQ(contaminated(glsl::taps_within_border(8, 1, 1), 1), 0U);
}

}  // namespace
