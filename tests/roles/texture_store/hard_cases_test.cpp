// SPDX-License-Identifier: Apache-2.0
// The hard cases of role texture_store, through jobs as users run them.
#include "parsed.hpp"
#include "roles/readme.hpp"
#include "roles/texture_store/in_core.hpp"
#include "roles/texture_store/storing.hpp"
#include "unit/image/tiled_tiff.hpp"

#include "image/image.hpp"

#include <gmock/gmock.h>

#include <random>

namespace {

using namespace storing;
using heddle_test::InCore;
using rendering::parameter_table;
using rendering::readme_of;
using testing::HasSubstr;
namespace kernels = heddle::mip_kernels;
namespace blocks = heddle::block_compression;

constexpr const char* kKernels[] = {"box2", "gauss4", "sharpen4", "gauss3", "gauss5", "sharpen5"};
constexpr const char* kAddresses[] = {"wrap", "mirror", "clamp"};

std::string image_file(const std::string& name, std::uint32_t width, std::uint32_t height, std::uint32_t channels,
                       const std::function<float(std::uint32_t x, std::uint32_t y, std::uint32_t c)>& value) {
  heddle::image::Image image{width, height, channels, {}};
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x)
      for (std::uint32_t c = 0; c < channels; ++c) image.pixels.push_back(value(x, y, c));
  heddle::image::write(folder() / name, image);
  return "params.images = [\"" + (folder() / name).string() + "\"]\n";
}

float noise(std::uint32_t x, std::uint32_t y, std::uint32_t c) {
  return static_cast<float>((x * 7919 ^ y * 104729 ^ c * 31) * 2654435761U >> 24U) / 255.0F;
}

TEST(TextureStore, ConstantsAreThatConstantInEveryLevel) {  // H1
  for (const char* kernel : kKernels) {
    const Made made =
        make(image_file("flat.png", 512, 512, 3, [](auto, auto, auto c) { return static_cast<float>(c + 1) / 4; }) +
             "params.compression = \"none\"\nparams.kernel = \"" + kernel + "\"\n");
    for (std::uint32_t level = 0; level <= made.levels(0); ++level)
      for (const Rgba8& texel : made.tile(0, level, 0, 0)) ASSERT_EQ(texel, (Rgba8{64, 128, 191, 255})) << kernel;
  }
}

TEST(TextureStore, EveryTexelIsWhatABuildInMemoryHas) {  // H3, H4
  for (std::uint32_t kernel = 0; kernel < 6; ++kernel) {
    const std::uint32_t address = (kernel + 1) % 3;
    const Made made =
        make(image_file("noise.png", 512, 512, 3, noise) +
             "params.compression = \"none\"\nparams.tile = \"64\"\nparams.border = 5\nparams.kernel = \"" +
             kKernels[kernel] + "\"\nparams.address = \"" + kAddresses[address] + "\"\n");
    InCore whole{address, {{}}, {512}};
    for (std::uint32_t i = 0; i < 512 * 512; ++i) {
      const auto code = [&](std::uint32_t c) {
        return static_cast<std::uint8_t>(std::lround(noise(i % 512, i / 512, c) * 255));
      };
      whole.levels[0].push_back({code(0), code(1), code(2), 255});
    }
    ASSERT_EQ(made.levels(0), 3U);
    std::size_t wrong = 0, seen = 0;
    for (std::uint32_t level = 0; level <= 3; ++level) {
      if (level > 0) whole.halve(kernel);
      for (std::uint32_t y = 0; y < 8U >> level; ++y)
        for (std::uint32_t x = 0; x < 8U >> level; ++x) {
          const std::vector<Rgba8> tile = made.tile(0, level, x, y);
          for (std::int64_t j = 0; j < 74; ++j)
            for (std::int64_t i = 0; i < 74; ++i, ++seen)
              wrong += tile[static_cast<std::size_t>(74 * j + i)] ==
                               whole.at(level, 64 * std::int64_t{x} + i - 5, 64 * std::int64_t{y} + j - 5)
                           ? 0U
                           : 1U;
        }
    }
    EXPECT_EQ(wrong, 0U) << kKernels[kernel] << ", of " << seen;
  }
}

TEST(TextureStore, TakesImagesOfAnyShapeAndKind) {  // H2, H5
  // A ramp in linear light, in a file of floats that is no square: stretched, and a ramp still.
  const auto ramp = [](std::uint32_t x, std::uint32_t y, std::uint32_t c) {
    return c == 1 ? static_cast<float>(y) / 299.0F : static_cast<float>(x) / 400.0F;
  };
  const Made made = make(image_file("ramp.exr", 401, 300, 3, ramp) +
                         "params.compression = \"none\"\nparams.tile = \"64\"\nparams.address = \"clamp\"\n");
  EXPECT_EQ(made.store.textures[0].extent, 512U);
  EXPECT_EQ(made.report[0]["values"]["width"], 401);
  EXPECT_THAT(made.report[0]["message"].get<std::string>(), HasSubstr("stretched to a square"));
  const auto& linear = heddle::texture_store::linear_of_codes();
  for (std::uint32_t level = 0; level <= 3; ++level) {
    double worst = 0;
    const std::uint32_t tiles = 8U >> level;
    for (std::uint32_t t = 0; t < tiles; ++t) {
      const std::vector<Rgba8> tile = made.tile(0, level, t, t);
      for (std::uint32_t i = 0; i < 64; ++i) {
        const Rgba8& texel = tile[72 * (4 + i) + 4 + i];
        // The image's pixel at the texel's centre, both counted from the side.
        const double centre = (64.0 * t + i + 0.5) * (1U << level) / 512;
        const double x = centre * 401 - 0.5, y = centre * 300 - 0.5;
        if (x < 12 || x > 388 || y < 12 || y > 287) continue;  // near the sides kernels see what lies beyond
        worst = std::max({worst, std::abs(linear[texel.r] - x / 400), std::abs(linear[texel.g] - y / 299)});
      }
    }
    // Codes of sRGB are at most 1/110 of linear light apart; each level rounds to the nearest once more.
    EXPECT_LE(worst, (level + 1) * 0.5 / 110 + 1e-4) << "level " << level;
  }
  // One pixel, grey with alpha, 8 bits: all is its colour.
  const Made dot = make(image_file("dot.png", 1, 1, 2, [](auto, auto, auto c) { return c == 0 ? 0.4F : 0.1F; }) +
                        "params.compression = \"none\"\n");
  EXPECT_EQ(dot.store.textures[0].extent, 256U);
  for (const Rgba8& texel : dot.tile(0, 0, 1, 1)) ASSERT_EQ(texel, (Rgba8{102, 102, 102, 255}));
  // Infinite and negative floats and NaN are colours too.
  const Made wild = make(image_file("wild.exr", 8, 8, 3,
                                    [](std::uint32_t x, auto, auto) {
                                      return x == 2 ? INFINITY : x == 4 ? NAN : x == 6 ? -INFINITY : 0.5F;
                                    }) +
                         "params.compression = \"none\"\n");
  for (const Rgba8& texel : wild.tile(0, 1, 0, 0)) ASSERT_EQ(texel.a, 255);
  // A file with tiles, read by them.
  heddle_test::write_tiled_tiff(folder() / "tiled.tif",
                                {{512, 512, 64, false, [](std::uint32_t x, std::uint32_t y, std::uint8_t* rgb) {
                                    for (std::uint32_t c = 0; c < 3; ++c)
                                      rgb[c] = static_cast<std::uint8_t>(std::lround(noise(x, y, c) * 255));
                                  }}});
  const Made tiled =
      make("params.images = [\"" + (folder() / "tiled.tif").string() + "\"]\nparams.compression = \"none\"\n");
  const Made rows = make(image_file("noise.png", 512, 512, 3, noise) + "params.compression = \"none\"\n");
  EXPECT_EQ(tiled.store.header.contents, rows.store.header.contents);
}

TEST(TextureStore, SeveralImagesAreSeveralTextures) {
  const std::string red = image_file("red.png", 300, 300, 3, [](auto, auto, auto c) { return c == 0 ? 1.0F : 0.0F; });
  (void)image_file("blue.png", 600, 600, 3, [](auto, auto, auto c) { return c == 2 ? 1.0F : 0.0F; });
  const Made made = make("params.images = [\"" + (folder() / "red.png").string() + "\", \"" +
                         (folder() / "blue.png").string() + "\"]\nparams.compression = \"bc1\"\n");
  ASSERT_EQ(made.store.textures.size(), 2U);
  EXPECT_EQ(made.store.textures[1].extent, 1024U);
  EXPECT_EQ(made.tile(0, 2, 0, 0)[5], (Rgba8{255, 0, 0, 255}));
  EXPECT_EQ(made.tile(1, 0, 7, 7)[5], (Rgba8{0, 0, 255, 255}));
  EXPECT_EQ(made.report.size(), 2U);
  EXPECT_EQ(fs::file_size(made.file),
            made.store.stride() * (heddle::texture_store::tile_count(2) + heddle::texture_store::tile_count(3)));
}

TEST(TextureStore, BlocksThatTilesShareAreTheSameBytes) {  // H7
  for (const char* compression : {"bc1", "bc7"}) {
    const std::size_t block = std::string(compression) == "bc1" ? 8 : 16;
    for (const std::uint32_t border : {2U, 4U}) {
      const Made made = make(std::string("params.source = \"road\"\nparams.extent = 1024\nparams.compression = \"") +
                             compression + "\"\nparams.border = " + std::to_string(border) + "\n");
      const std::vector<std::byte> left = made.bytes(0, 0, 3, 2), right = made.bytes(0, 0, 4, 2);
      const std::size_t across = made.store.pitch() / 4, shared = border / 2;
      for (std::size_t row = 0; row < across; ++row)
        EXPECT_EQ(std::memcmp(left.data() + (across * (row + 1) - shared) * block, right.data() + across * row * block,
                              shared * block),
                  0);
      std::printf("%s, border %u: %.1f dB\n", compression, border, made.report[0]["values"]["psnr_db"].get<double>());
      EXPECT_GT(made.report[0]["values"]["psnr_db"].get<double>(), block == 8 ? 33 : 42);
    }
  }
}

/// 1 where a mask is set: in a few blobs of a side of 1024, elsewhere nothing, or all.
float mask(std::uint32_t x, std::uint32_t y, std::uint32_t) {
  const bool is_in = (x % 512 - 200) * (x % 512 - 200) + (y % 512 - 90) * (y % 512 - 90) < 900;
  return y >= 768 ? 1.0F : is_in ? noise(x, y, 0) : 0.0F;
}

TEST(TextureStore, TilesWithEqualBytesAreKeptOnce) {
  for (const char* compression : {"none", "bc7"}) {
    const std::string job = image_file("mask.png", 1024, 1024, 1, mask) +
                            "params.tile = \"64\"\nparams.compression = \"" + compression + "\"\n";
    const Made whole = make(job), shared = make(job + "params.shared = true\n");
    ASSERT_EQ(whole.levels(0), 4U);
    EXPECT_TRUE(whole.store.index.empty());
    const double tiles = shared.report[0]["values"]["tiles"], kept = shared.report[0]["values"]["kept"];
    std::printf("%s: %.0f of %.0f tiles kept, 1 in %.1f\n", compression, kept, tiles, tiles / kept);
    EXPECT_EQ(whole.report[0]["values"]["kept"], tiles);
    EXPECT_LT(kept, tiles / 4);
    EXPECT_EQ(fs::file_size(shared.file), static_cast<std::uint64_t>(kept) * shared.store.stride());
    for (std::uint32_t level = 0; level <= 4; ++level)
      for (std::uint32_t y = 0; y < 16U >> level; ++y)
        for (std::uint32_t x = 0; x < 16U >> level; ++x)
          ASSERT_EQ(shared.bytes(0, level, x, y), whole.bytes(0, level, x, y)) << compression << ' ' << level;
  }
}

TEST(TextureStore, MistakesNameFileAndReasonAndLeaveNoStore) {  // H8
  const auto stores = [] {
    std::size_t count = 0;
    for (const auto& entry : fs::recursive_directory_iterator(folder() / "cache"))
      count += entry.path().extension() == ".store" || entry.path().extension() == ".new" ? 1U : 0U;
    return count;
  };
  (void)make("params.source = \"ramp\"\nparams.extent = 256\n");
  const std::size_t before = stores();
  EXPECT_THAT(mistake("params.images = [\"/nowhere/a.png\"]\n"),
              HasSubstr("/nowhere/a.png: error: there is no such image"));
  std::ofstream(folder() / "text.png") << "no image";
  EXPECT_THAT(mistake("params.images = [\"" + (folder() / "text.png").string() + "\"]\n"),
              HasSubstr("text.png: error: the image cannot be read"));
  (void)image_file("cut.png", 300, 2000, 3, noise);
  fs::resize_file(folder() / "cut.png", fs::file_size(folder() / "cut.png") / 2);
  EXPECT_THAT(mistake("params.images = [\"" + (folder() / "cut.png").string() + "\"]\n"),
              HasSubstr("cut.png: error: the image cannot be read"));
  EXPECT_THAT(mistake("params.border = 3\n"), HasSubstr("params.border is 3, and two tiles share whole blocks"));
  EXPECT_THAT(mistake("params.extent = 1000\n"), HasSubstr("params.extent is 1000; expected: a power of two"));
  EXPECT_EQ(stores(), before);
}

TEST(TextureStore, IsMadeAgainWhereItsFileIsGoneCutOffOrItsImageHasChanged) {
  const std::string job = image_file("changing.png", 256, 256, 3, noise) + "params.compression = \"none\"\n";
  const Made first = make(job);
  const auto reused = [&] {
    Scene scene;
    const Graph graph(job_text(job));
    const char* text = nullptr;
    check(heddle_job_run(graph.handle, scene.handle, nullptr, &text));
    return parsed::json(text)["artifacts"][0]["origin"].get<std::string>();
  };
  EXPECT_EQ(reused(), "cache");
  fs::resize_file(first.file, fs::file_size(first.file) - 1);
  EXPECT_EQ(reused(), "made");
  EXPECT_EQ(reused(), "cache");
  fs::remove(first.file);
  EXPECT_EQ(reused(), "made");
  (void)image_file("changing.png", 256, 256, 3, [](auto, auto, auto) { return 0.0F; });
  const Made other = make(job);
  EXPECT_NE(other.file, first.file);
  EXPECT_EQ(other.tile(0, 0, 0, 0)[0], (Rgba8{0, 0, 0, 255}));
}

TEST(TextureStore, ReadmeTellsTheParametersAsTheyAre) {
  const char* text = nullptr;
  check(heddle_list(rendering::Host::get().handle, &text));
  const std::string table = parameter_table(parsed::json(text), "texture_store/tiled");
  EXPECT_NE(table, "");
  EXPECT_NE(readme_of("texture_store/tiled").find(table), std::string::npos) << "should have\n" << table;
}

}  // namespace
