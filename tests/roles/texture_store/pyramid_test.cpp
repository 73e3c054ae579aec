// SPDX-License-Identifier: Apache-2.0
// Kernels by their closed forms; levels that are built from blocks on a disk against those of a whole image in memory.
#include "texture_store/tiled/pyramid.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "roles/texture_store/in_core.hpp"

namespace {

using namespace heddle::texture_store;
namespace kernels = heddle::mip_kernels;
namespace tiles = heddle::texture_tiles;

/// One level of a function of the finer level's texel indices, w x h.
std::vector<float> halved(std::uint32_t kernel, std::uint32_t w, std::uint32_t h,
                          const std::function<float(int, int)>& value) {
  constexpr int kMargin = kernels::kMargin;
  const int wide = 2 * static_cast<int>(w) + 2 * kMargin, high = 2 * static_cast<int>(h) + 2 * kMargin;
  std::vector<float> from, to(std::size_t{3} * w * h), scratch;
  for (int plane = 0; plane < 3; ++plane)
    for (int y = 0; y < high; ++y)
      for (int x = 0; x < wide; ++x) from.push_back(static_cast<float>(plane + 1) * value(x - kMargin, y - kMargin));
  kernels::halve(kernel, w, h, from, to, scratch);
  return to;
}

TEST(MipKernels, KeepConstantsToTheBit) {  // H1
  for (std::uint32_t kernel = 0; kernel < kernels::kKernelCount; ++kernel)
    for (const float c : {0.25F, 1.0F / 3.0F, 0.1F, 0.0F}) {
      const std::vector<float> level = halved(kernel, 5, 3, [&](int, int) { return c; });
      for (std::size_t i = 0; i < 15; ++i) EXPECT_FLOAT_EQ(level[i], c) << kernel;
      // As codes nothing is left of what float32 rounds.
      EXPECT_EQ(code_of_linear(level[0]), code_of_linear(c));
    }
}

TEST(MipKernels, KeepRampsLinearAroundTheirTexelCentres) {  // H2
  for (std::uint32_t kernel = 0; kernel < kernels::kKernelCount; ++kernel) {
    // Even kernels stand between texels 2 i and 2 i + 1, odd ones on 2 i. All numbers are exact in float32.
    const float offset = kernels::is_vertex_centred(kernel) ? 0.0F : 0.5F;
    const std::vector<float> level =
        halved(kernel, 6, 4, [](int x, int y) { return static_cast<float>(16 * x + 64 * y); });
    for (int y = 0; y < 4; ++y)
      for (int x = 0; x < 6; ++x)
        for (int plane = 0; plane < 3; ++plane) {
          const float fx = 2.0F * static_cast<float>(x) + offset, fy = 2.0F * static_cast<float>(y) + offset;
          EXPECT_EQ(level[static_cast<std::size_t>(24 * plane + 6 * y + x)],
                    static_cast<float>(plane + 1) * (16 * fx + 64 * fy))
              << kernel;
        }
  }
}

TEST(MipKernels, WeightsAddUpAndAreSymmetric) {
  for (const kernels::Taps& taps : kernels::kTaps) {
    float sum = 0;
    for (std::uint32_t i = 0; i < taps.count; ++i) {
      sum += taps.weights[i];
      EXPECT_EQ(taps.weights[i], taps.weights[taps.count - 1 - i]);
    }
    EXPECT_EQ(sum, 1.0F);
    EXPECT_LE(-taps.first, static_cast<int>(kernels::kMargin));
    EXPECT_LE(taps.first + static_cast<int>(taps.count) - 2, static_cast<int>(kernels::kMargin));
  }
}

TEST(MipKernels, OddOnesLeaveTexelsWhereTheyAreInAllLevelsAndEvenOnesMoveThemByHalves) {
  for (std::uint32_t kernel = 0; kernel < kernels::kKernelCount; ++kernel) {
    // Texels that hold their own place, in texels of level 0; beyond its ends a level goes on as it does inside.
    const bool is_odd = kernels::is_vertex_centred(kernel);
    const auto place = [&](int i, int level) {
      const auto step = static_cast<float>(1 << level);
      return is_odd ? static_cast<float>(i) * step : (static_cast<float>(i) + 0.5F) * step - 0.5F;
    };
    for (int level = 0; level < 6; ++level) {
      const std::vector<float> next = halved(kernel, 8, 1, [&](int x, int) { return place(x, level); });
      for (int i = 0; i < 8; ++i) EXPECT_EQ(next[static_cast<std::size_t>(i)], place(i, level + 1)) << kernel;
    }
  }
}

/// A disk in memory that counts what it holds.
struct Memory {
  std::vector<std::byte> bytes;
  std::uint64_t reads = 0;
  Disk disk() {
    return {[this](std::uint64_t offset, std::span<const std::byte> from) {
              bytes.resize(std::max<std::size_t>(bytes.size(), offset + from.size()));
              std::ranges::copy(from, bytes.begin() + static_cast<std::ptrdiff_t>(offset));
            },
            [this](std::uint64_t offset, std::span<std::byte> to) {
              ASSERT_LE(offset + to.size(), bytes.size());
              std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(offset), to.size(), to.begin());
              ++reads;
            }};
  }
};

TEST(Pyramid, IsToTheBitWhatTheWholeImageInMemoryGives) {  // H3, H4
  constexpr std::uint32_t kExtent = 512, kLast = 3;
  std::mt19937 random(5);
  for (std::uint32_t kernel = 0; kernel < kernels::kKernelCount; ++kernel) {
    const std::uint32_t address = kernel % 3;
    heddle_test::InCore whole{address, {{}}, {kExtent}};
    for (std::uint32_t i = 0; i < kExtent * kExtent; ++i)
      whole.levels[0].push_back({static_cast<std::uint8_t>(random()), static_cast<std::uint8_t>(i),
                                 static_cast<std::uint8_t>(i / kExtent), 255});
    Memory memory;
    Pyramid pyramid(kExtent, kLast, address, memory.disk());
    // In parts that do not end where blocks do.
    for (std::uint32_t y = 0; y < kExtent; y += 96)
      pyramid.write(0, 0, y, kExtent, std::min(96U, kExtent - y), whole.levels[0].data() + std::size_t{kExtent} * y);
    std::uint64_t made = 0;
    pyramid.build(kernel, [&](std::uint64_t texels) { made += texels; });
    EXPECT_EQ(made, 256U * 256 + 128 * 128 + 64 * 64);
    std::vector<Rgba8> part(80 * 80);
    for (std::uint32_t level = 0; level <= kLast; ++level) {
      if (level > 0) whole.halve(kernel);
      std::size_t wrong = 0;
      const auto extent = static_cast<std::int64_t>(kExtent >> level);
      for (std::int64_t y = -8; y < extent; y += 64) {
        for (std::int64_t x = -8; x < extent; x += 64) {
          pyramid.read(level, x, y, 80, 80, part.data());
          for (std::int64_t i = 0; i < 80 * 80; ++i)
            wrong += part[static_cast<std::size_t>(i)] == whole.at(level, x + i % 80, y + i / 80) ? 0U : 1U;
        }
      }
      EXPECT_EQ(wrong, 0U) << "kernel " << kernel << ", level " << level;
    }
  }
}

TEST(Pyramid, ReadsEveryBlockFewTimesInTheOrderOfTiles) {  // H6: its memory is bounded, and that is enough
  constexpr std::uint32_t kExtent = 8192;
  // Only the offsets matter: nothing is copied, nothing is held.
  std::uint64_t reads = 0, most = 0;
  const Disk disk{
      [&](std::uint64_t offset, std::span<const std::byte> from) { most = std::max(most, offset + from.size()); },
      [&](std::uint64_t, std::span<std::byte>) { ++reads; }};
  Pyramid pyramid(kExtent, 6, tiles::kWrap, disk);
  EXPECT_LT(static_cast<double>(most), 4.0 * kExtent * kExtent * 4 / 3 + 5 * 262144);
  std::vector<Rgba8> part(136 * 136);
  for (std::uint64_t code = 0; code < 64 * 64; ++code)
    pyramid.read(0, std::int64_t{morton_x(code)} * 128 - 4, std::int64_t{morton_y(code)} * 128 - 4, 136, 136,
                 part.data());
  // 1024 blocks, 128 of them in memory.
  EXPECT_LT(reads, 2 * 1024U);
  std::printf("%.2f reads a block\n", static_cast<double>(reads) / 1024);
}

}  // namespace
