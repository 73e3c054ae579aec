// SPDX-License-Identifier: Apache-2.0
// Images part by part: any rectangle is what the whole image has there, whatever kind of file; mistakes name the file.
#include "image/image.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <random>

#include "unit/image/tiled_tiff.hpp"

namespace heddle::image {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class ImageParts : public testing::Test {
 protected:
  ImageParts() : folder_(fs::temp_directory_path() / ("heddle_image_parts_" + std::to_string(getpid()))) {
    fs::create_directories(folder_);
  }
  ~ImageParts() override { fs::remove_all(folder_); }
  [[nodiscard]] fs::path path(const char* name) const { return folder_ / name; }

  fs::path folder_;
};

heddle_image_part part_of(std::uint32_t level, std::uint32_t x, std::uint32_t y, std::uint32_t width,
                          std::uint32_t height, std::uint32_t samples) {
  return {sizeof(heddle_image_part), level, x, y, width, height, samples, 0};
}

std::vector<float> floats_of(const OpenImage& file, std::uint32_t x, std::uint32_t y, std::uint32_t width,
                             std::uint32_t height) {
  std::vector<float> out(std::size_t{4} * width * height);
  file.read(part_of(0, x, y, width, height, HEDDLE_IMAGE_FLOATS), out.data(), std::uint64_t{16} * width);
  return out;
}

std::string error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST_F(ImageParts, AreWhatTheWholeImageHasThere) {
  std::mt19937 random(3);
  const auto uniform = [&] { return static_cast<float>(random()) * 0x1p-32F; };
  for (const char* name : {"a.png", "a.exr", "a.tif"}) {
    for (const std::uint32_t channels : {1U, 2U, 3U, 4U}) {
      Image image{37, 29, channels, {}};
      for (std::uint32_t i = 0; i < 37 * 29 * channels; ++i) image.pixels.push_back(uniform());
      write(path(name), image);
      const Image whole = read(path(name));
      const OpenImage file(path(name));
      const heddle_image_level level = file.level(0);
      EXPECT_EQ(level.width, 37U);
      EXPECT_EQ(level.height, 29U);
      EXPECT_EQ(level.channels, channels);
      EXPECT_EQ(level.is_float, std::string(name) == "a.png" ? 0U : 1U);
      EXPECT_EQ(level.sample_bits, std::string(name) == "a.png" ? 8U : 32U);
      std::size_t wrong = 0;
      for (int i = 0; i < 20; ++i) {
        const auto below = [&](std::uint32_t end) { return static_cast<std::uint32_t>(random() % end); };
        const std::uint32_t x = below(37), y = below(29), width = 1 + below(37 - x), height = 1 + below(29 - y);
        const std::vector<float> part = floats_of(file, x, y, width, height);
        for (std::uint32_t row = 0; row < height; ++row) {
          for (std::uint32_t column = 0; column < width; ++column) {
            const float* from = whole.pixels.data() + (std::size_t{37} * (y + row) + x + column) * channels;
            const float* to = part.data() + std::size_t{4} * (std::size_t{row} * width + column);
            const float expected[4] = {from[0], channels < 3 ? from[0] : from[1], channels < 3 ? from[0] : from[2],
                                       channels == 2   ? from[1]
                                       : channels == 4 ? from[3]
                                                       : 1.0F};
            wrong += std::equal(expected, expected + 4, to) ? 0U : 1U;
          }
        }
      }
      EXPECT_EQ(wrong, 0U) << name << ", " << channels << " channels";
    }
  }
}

TEST_F(ImageParts, BytesOfAnEightBitFileAreItsOwn) {
  Image image{16, 16, 1, {}};
  for (int i = 0; i < 256; ++i) image.pixels.push_back(static_cast<float>(i) / 255.0F);
  write(path("a.png"), image);
  const OpenImage file(path("a.png"));
  std::vector<std::uint8_t> out(std::size_t{5 * 4 * 3}, 7);
  file.read(part_of(0, 3, 2, 4, 3, HEDDLE_IMAGE_BYTES), out.data(), 5 * 4);
  for (std::uint32_t y = 0; y < 3; ++y) {
    for (std::uint32_t x = 0; x < 4; ++x) {
      const std::uint8_t* texel = out.data() + 4 * (5 * y + x);
      EXPECT_EQ(texel[0], 16 * (y + 2) + x + 3);
      EXPECT_EQ(texel[2], texel[0]);
      EXPECT_EQ(texel[3], 255);
    }
    EXPECT_EQ(out[4 * (5 * y + 4)], 7) << "beyond the row's part";
  }
}

TEST_F(ImageParts, OfTiledFilesNeedNoMoreMemoryThanTheirTiles) {
  // 12 GiB of texels in a file of 2 MiB, as all tiles share one.
  const auto texel = [](std::uint32_t x, std::uint32_t y, std::uint8_t* rgb) {
    rgb[0] = static_cast<std::uint8_t>(x);
    rgb[1] = static_cast<std::uint8_t>(y);
    rgb[2] = 99;
  };
  heddle_test::write_tiled_tiff(path("huge.tif"), {{65536, 65536, 256, true, texel}, {100, 60, 32, false, texel}});
  const OpenImage file(path("huge.tif"));
  const heddle_image_level level = file.level(0);
  EXPECT_EQ(level.width, 65536U);
  EXPECT_EQ(level.block_width, 256U);
  EXPECT_EQ(level.block_height, 256U);
  std::vector<std::uint8_t> out(std::size_t{4} * 300 * 300);
  file.read(part_of(0, 65236, 65000, 300, 300, HEDDLE_IMAGE_BYTES), out.data(), 1200);
  for (std::uint32_t y = 0; y < 300; y += 13)
    for (std::uint32_t x = 0; x < 300; x += 7) {
      const std::uint8_t* found = out.data() + std::size_t{4} * (300 * y + x);
      EXPECT_EQ(found[0], (65236 + x) & 255U);
      EXPECT_EQ(found[1], (65000 + y) & 255U);
      EXPECT_EQ(found[2], 99);
    }
  EXPECT_THAT(error_of([&] { (void)file.level(7); }), HasSubstr("level 7 of"));
}

TEST_F(ImageParts, MistakesNameFileAndReason) {
  EXPECT_THAT(error_of([&] { const OpenImage none(path("none.png")); }),
              HasSubstr("none.png: error: there is no such"));
  std::ofstream(path("text.png")) << "no image at all";
  EXPECT_THAT(error_of([&] { const OpenImage text(path("text.png")); }),
              HasSubstr("text.png: error: the image cannot be read"));
  Image image{8, 4096, 3, std::vector<float>(std::size_t{8} * 4096 * 3, 0.5F)};
  for (std::size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = static_cast<float>(i * 7919 % 256) / 255.0F;
  write(path("cut.png"), image);
  fs::resize_file(path("cut.png"), fs::file_size(path("cut.png")) / 2);
  const OpenImage cut(path("cut.png"));
  EXPECT_THAT(error_of([&] { (void)floats_of(cut, 0, 0, 8, 4096); }),
              HasSubstr("cut.png: error: the image cannot be read"));
  write(path("small.png"), {2, 2, 1, {0, 0, 0, 0}});
  const OpenImage small(path("small.png"));
  EXPECT_THAT(error_of([&] { (void)floats_of(small, 1, 0, 2, 1); }), HasSubstr("a part of 2 x 2 pixels"));
}

}  // namespace
}  // namespace heddle::image
