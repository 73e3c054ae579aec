// SPDX-License-Identifier: Apache-2.0
// Images through the module: what is written is read back, textures keep their bytes, failures say what to do.
#include "image/image.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>

namespace heddle::image {
namespace {

class ImageFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("heddle_image_test_" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::filesystem::path path(const char* name) const { return folder_ / name; }
  [[nodiscard]] std::vector<std::byte> bytes_of(const char* name) const {
    std::ifstream stream(path(name), std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
    const auto* data = reinterpret_cast<const std::byte*>(text.data());
    return {data, data + text.size()};
  }
  [[nodiscard]] std::size_t files() const {
    const std::filesystem::directory_iterator folder(folder_);
    return static_cast<std::size_t>(std::distance(begin(folder), end(folder)));
  }

  std::filesystem::path folder_;
};

template <typename Call>
std::string error_of(const Call& call, heddle_status status) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), status);
    return error.what();
  }
  return "no error";
}

// The module is opened once for a process, so what happens without it can be seen only before: first test of the file.
TEST_F(ImageFile, MissingModuleNamesThePackage) {
  setenv("HEDDLE_IMAGE_MODULE", "/nowhere/libheddle_image.so", 1);
  const std::string message = error_of([&] { write(path("a.png"), {1, 1, 1, {0.5F}}); }, HEDDLE_FAILED);
  unsetenv("HEDDLE_IMAGE_MODULE");
  EXPECT_THAT(message, testing::HasSubstr("cannot open the image module '/nowhere/libheddle_image.so'"));
  EXPECT_THAT(message, testing::HasSubstr("libopenimageio2.4"));
  EXPECT_EQ(files(), 0U);
}

TEST_F(ImageFile, ALibraryThatIsNoModuleIsRefused) {
  setenv("HEDDLE_IMAGE_MODULE", "libm.so.6", 1);
  const std::string message = error_of([&] { write(path("a.png"), {1, 1, 1, {0.5F}}); }, HEDDLE_FAILED);
  unsetenv("HEDDLE_IMAGE_MODULE");
  EXPECT_THAT(message, testing::HasSubstr("'libm.so.6' is not the image module of this version of Heddle"));
}

TEST_F(ImageFile, ExrKeepsEveryBitOfFloat32) {
  const Image image{2, 2, 3, {0, -1.5F, 1e-30F, 1e30F, 0.1F, 65504, 1, 2, 3, -0.25F, 1.0F / 3, 7}};
  write(path("a.exr"), image);
  const Image back = read(path("a.exr"));
  EXPECT_EQ(back.width, 2U);
  EXPECT_EQ(back.height, 2U);
  EXPECT_EQ(back.channels, 3U);
  EXPECT_EQ(back.pixels, image.pixels);
  EXPECT_EQ(files(), 1U) << "a temporary file stayed";
}

TEST_F(ImageFile, EveryNumberOfChannelsComesBack) {
  for (std::uint32_t channels = 1; channels <= 4; ++channels) {
    Image image{3, 2, channels, {}};
    for (std::uint32_t i = 0; i < 6 * channels; ++i) {
      image.pixels.push_back(static_cast<float>(i) / 255.0F);
    }
    for (const char* name : {"a.exr", "a.png"}) {
      write(path(name), image);
      const Image back = read(path(name));
      EXPECT_EQ(back.channels, channels) << name;
      EXPECT_EQ(back.pixels, image.pixels) << name << " with " << channels << " channels";
    }
  }
}

TEST_F(ImageFile, PngClampsAndRoundsToNearest) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();
  // 100.4, 100.6 of 255; below 0, above 1, infinite, not a number.
  write(path("a.png"), {7, 1, 1, {100.4F / 255, 100.6F / 255, -3, 4, kInfinity, kNan, 1}});
  EXPECT_THAT(read(path("a.png")).pixels, testing::ElementsAre(100 / 255.0F, 101 / 255.0F, 0, 1, 1, 0, 1));
}

TEST_F(ImageFile, ColourIsNotMultipliedByAlpha) {
  write(path("a.png"), {1, 1, 4, {200 / 255.0F, 100 / 255.0F, 50 / 255.0F, 0}});
  EXPECT_THAT(read(path("a.png")).pixels, testing::ElementsAre(200 / 255.0F, 100 / 255.0F, 50 / 255.0F, 0));
  EXPECT_THAT(decode8(bytes_of("a.png"), "a").rgba, testing::ElementsAre(200, 100, 50, 0));
}

TEST_F(ImageFile, TexturesAreExpandedToRgba) {
  write(path("g.png"), {2, 1, 1, {10 / 255.0F, 20 / 255.0F}});
  EXPECT_THAT(decode8(bytes_of("g.png"), "g").rgba, testing::ElementsAre(10, 10, 10, 255, 20, 20, 20, 255));
  write(path("ga.png"), {1, 1, 2, {10 / 255.0F, 20 / 255.0F}});
  EXPECT_THAT(decode8(bytes_of("ga.png"), "ga").rgba, testing::ElementsAre(10, 10, 10, 20));
  write(path("rgb.png"), {1, 2, 3, {1, 0, 0, 0, 0, 1}});
  const Image8 image = decode8(bytes_of("rgb.png"), "rgb");
  EXPECT_EQ(image.width, 1U);
  EXPECT_EQ(image.height, 2U);
  EXPECT_THAT(image.rgba, testing::ElementsAre(255, 0, 0, 255, 0, 0, 255, 255));
}

TEST_F(ImageFile, JpegDecodesFromMemory) {
  write(path("a.jpg"), {16, 8, 3, std::vector<float>(16 * 8 * 3, 0.5F)});
  const Image8 image = decode8(bytes_of("a.jpg"), "a");
  ASSERT_EQ(image.rgba.size(), 16U * 8 * 4);
  // A flat grey survives compression within two steps of quantization.
  EXPECT_NEAR(image.rgba[0], 128, 2);
  EXPECT_EQ(image.rgba[3], 255);
}

TEST_F(ImageFile, CutOffTexturesAreErrorsNotCrashes) {
  Image image{32, 32, 4, {}};
  std::uint32_t noise = 1;  // what does not compress
  for (std::uint32_t i = 0; i < 32 * 32 * 4; ++i) {
    noise = noise * 1664525 + 1013904223;
    image.pixels.push_back(static_cast<float>(noise >> 24) / 255.0F);
  }
  write(path("a.png"), image);
  const std::vector<std::byte> whole = bytes_of("a.png");
  ASSERT_GT(whole.size(), 1000U);
  for (std::size_t size = 0; size + 64 < whole.size(); size += 61) {
    const std::span<const std::byte> part(whole.data(), size);
    EXPECT_NE(error_of([&] { decode8(part, "cut"); }, HEDDLE_BAD_INPUT), "no error") << size << " bytes";
  }
}

TEST_F(ImageFile, UnknownBytesAreNamed) {
  const std::array<std::byte, 5> bytes{};
  EXPECT_EQ(error_of([&] { decode8(bytes, "model.glb: image 3"); }, HEDDLE_BAD_INPUT),
            "model.glb: image 3: error: the image is of no known kind\n"
            "  found:    5 bytes that begin like none\n"
            "  expected: PNG or JPEG");
}

TEST_F(ImageFile, MissingAndBrokenFilesAreErrors) {
  EXPECT_EQ(error_of([&] { read(path("none.png")); }, HEDDLE_BAD_INPUT),
            path("none.png").string() + ": error: there is no such image");
  std::ofstream(path("text.png")) << "no image";
  EXPECT_THAT(error_of([&] { read(path("text.png")); }, HEDDLE_BAD_INPUT),
              testing::HasSubstr("text.png: error: the image cannot be read\n  found:"));
}

TEST_F(ImageFile, FailedWritesLeaveNothingBehind) {
  write(path("a.png"), {1, 1, 1, {1}});
  EXPECT_THAT(error_of(
                  [&] {
                    write(path("a.nokind"), {1, 1, 1, {1}});
                  },
                  HEDDLE_BAD_INPUT),
              testing::HasSubstr("a.nokind: error: the image cannot be written"));
  EXPECT_NE(error_of([&] { write(path("none/a.png"), {1, 1, 1, {1}}); }, HEDDLE_BAD_INPUT), "no error");
  EXPECT_THAT(error_of(
                  [&] {
                    write(path("a.png"), {2, 1, 1, {1}});
                  },
                  HEDDLE_BAD_INPUT),
              testing::HasSubstr("the image to be written has no proper shape"));
  EXPECT_EQ(files(), 1U);
  EXPECT_THAT(read(path("a.png")).pixels, testing::ElementsAre(1));
}

}  // namespace
}  // namespace heddle::image
