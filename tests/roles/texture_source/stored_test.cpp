// SPDX-License-Identifier: Apache-2.0
// Textures from a store on disk: the same pictures as of textures that are made in place, nothing waits that should
// not, every read is of whole clusters, and what is wrong with a file is told.
#include "roles/texture_source/asking.hpp"
#include "roles/texture_store/storing.hpp"

#include "image/image.hpp"

#include <gmock/gmock.h>

#include <cstdio>

namespace {

using namespace asking;
using testing::HasSubstr;
namespace fs = std::filesystem;

std::string bound(const std::string& job) {
  return "inputs.store = \"" + job + "#store\"\n";
}
constexpr const char* kQuick = "params.spacing = \"2\"\nparams.uploads = 64\nparams.window = 8\n";

TEST(StoredTexture, IsToTheBitThePictureOfTheSameTextureMadeInPlace) {  // H9
  const std::string job =
      storing::job_file("road.toml", "params.source = \"road\"\nparams.extent = 2048\nparams.compression = \"none\"\n");
  TextureScene stored(R"({"source": "stored"})"), made(R"({"source": "road", "extent": 2048})");
  Graph a(probe_graph("virtual", bound(job) + kQuick)), b(probe_graph("virtual", kQuick));
  std::mt19937 random(8);
  for (int i = 0; i < 4; ++i) {
    // Magnified: of coarser levels the store has filtered ones.
    const Camera camera = camera_at(random, 0.9, 2048);
    look(a, camera);
    look(b, camera);
    settle(a, stored.scene);
    settle(b, made.scene);
    EXPECT_EQ(a.image(stored.scene).pixels, b.image(made.scene).pixels);
  }
}

double largest_difference(const Image& a, const Image& b) {
  double worst = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i)
    worst = std::max(worst, std::abs(static_cast<double>(a.pixels[i]) - static_cast<double>(b.pixels[i])));
  return worst;
}

TEST(StoredTexture, IsTheReferencesPictureInAllLevelsAddressesKernelsAndFormats) {
  struct Case {
    const char *kernel, *address, *compression, *filtering;
    int border;
  };
  std::mt19937 random(9);
  for (const Case& c : {Case{"box2", "wrap", "none", "trilinear", 4}, Case{"gauss3", "mirror", "none", "bilinear", 4},
                        Case{"sharpen4", "wrap", "bc7", "bilinear", 4},
                        Case{"sharpen5", "clamp", "none", "bilinear", 4}, Case{"gauss5", "wrap", "bc1", "trilinear", 2},
                        Case{"box2", "wrap", "bc7", "bilinear", 2}, Case{"gauss3", "wrap", "none", "nearest", 1}}) {
    const std::string job = storing::job_file(
        "land.toml", std::string("params.source = \"road\"\nparams.extent = 1024\nparams.kernel = \"") + c.kernel +
                         "\"\nparams.address = \"" + c.address + "\"\nparams.compression = \"" + c.compression +
                         "\"\nparams.border = " + std::to_string(c.border) + "\n");
    TextureScene scene(R"({"source": "stored", "address": ")" + std::string(c.address) + "\"}");
    const std::string shared = bound(job) + "params.filtering = \"" + c.filtering + "\"\nparams.anisotropy = 4\n";
    Graph resident(probe_graph("resident", shared));
    Graph paged(probe_graph("virtual", shared + kQuick)),
        unpacked(probe_graph("virtual", shared + kQuick + "params.compressed = false\n"));
    if (c.border < 4)
      for (Graph* graph : {&resident, &paged, &unpacked}) graph->set("source.params.anisotropy=1");
    double worst = 1e30, largest = 0, worst_unpacked = 1e30;
    for (int i = 0; i < 3; ++i) {
      Camera camera = camera_at(random, std::exp2(-1 + 3.5 * static_cast<double>(random()) * 0x1p-32), 1024);
      camera.edge_v = {as_float(0.4 * camera.edge_v.x), as_float(0.4 * camera.edge_v.y)};
      look(resident, camera);
      look(paged, camera);
      settle(paged, scene.scene);
      const Image p = paged.image(scene.scene), r = resident.image(scene.scene);
      worst = std::min(worst, psnr(p, r));
      largest = std::max(largest, 255 * largest_difference(p, r));
      look(unpacked, camera);
      settle(unpacked, scene.scene);
      worst_unpacked = std::min(worst_unpacked, psnr(unpacked.image(scene.scene), r));
    }
    std::printf("%s, %s, %s, %s, border %d: PSNR %.1f dB, unpacked %.1f dB, largest difference %.3f of 255\n", c.kernel,
                c.address, c.compression, c.filtering, c.border, worst, worst_unpacked, largest);
    EXPECT_GE(worst_unpacked, 60) << c.kernel;
    // Drivers may unpack blocks of sRGB to 8 bits of linear light.
    EXPECT_LE(largest, 1) << c.kernel;
  }
}

/// The largest step across a tile's side and inside tiles, as for tiles that are made.
std::pair<double, double> steps_of(const std::string& compression, int border) {
  const std::string job =
      storing::job_file("ramp.toml", "params.source = \"ramp\"\nparams.extent = 1024\nparams.compression = \"" +
                                         compression + "\"\nparams.border = " + std::to_string(border) + "\n");
  TextureScene scene(R"({"source": "stored"})");
  Graph paged(probe_graph("virtual", bound(job) + kQuick + "params.anisotropy = 1\n"));
  double across = 0, inside = 0;
  for (const double corner : {512.0, 384.0}) {
    look(paged, {{(corner - 8.125) / 1024, (corner - 6.125) / 1024}, {0.25 / 1024, 0}, {0, 0.25 / 1024}});
    settle(paged, scene.scene);
    const Image image = paged.image(scene.scene);
    for (std::uint32_t y = 0; y < kHeight; ++y) {
      for (std::uint32_t x = 0; x + 1 < kWidth; ++x) {
        const double left = corner - 8.125 + 0.25 * x;
        const bool is_edge = left < corner + 0.5 && left + 0.25 > corner - 0.5;
        double& worst = is_edge ? across : inside;
        worst = std::max(worst, std::abs(code_at(image, x + 1, y, 0) - code_at(image, x, y, 0)));
      }
    }
  }
  return {across, inside};
}

TEST(StoredTexture, TilesSidesShowNoSeamInBlocks) {  // H4
  for (const char* compression : {"bc1", "bc7"}) {
    for (const int border : {2, 4}) {
      const auto [across, inside] = steps_of(compression, border);
      std::printf("%s, border %d: largest step across %.3f, inside %.3f of 255\n", compression, border, across, inside);
      EXPECT_LE(across, inside + 1) << compression;
    }
    const auto [across, inside] = steps_of(compression, 0);
    std::printf("%s, border 0: largest step across %.3f, inside %.3f of 255\n", compression, across, inside);
    EXPECT_GT(across, inside + 1) << "without a border seams are known to show: else this is no test";
  }
}

TEST(StoredTexture, ReadsWholeClustersAndLittleMoreThanItNeeds) {
  const std::string job =
      storing::job_file("wide.toml", "params.source = \"ramp\"\nparams.extent = 2048\nparams.compression = \"bc7\"\n");
  TextureScene scene(R"({"source": "stored"})");
  Graph graph(probe_graph("virtual", bound(job) + "params.spacing = \"2\"\nparams.uploads = 4\nparams.window = 8\n"));
  std::mt19937 random(5);
  std::uint64_t read = 0, used = 0, uploaded = 0, in_flight = 0;
  for (int i = 0; i < 8; ++i) {
    look(graph, camera_at(random, 1.9, 2048));
    for (int frame = 0; frame < 12; ++frame) {
      render(graph, scene.scene, 0, 0, false);
      const auto now = counts(graph);
      read += now.at("bytes_read");
      used += now.at("bytes_used");
      uploaded += now.at("tiles_uploaded");
      in_flight = std::max(in_flight, now.at("tiles_in_flight"));
    }
  }
  std::printf("%d tiles, %.3f bytes read for each that was used, %d on their way at most\n", static_cast<int>(uploaded),
              static_cast<double>(read) / static_cast<double>(used), static_cast<int>(in_flight));
  EXPECT_GT(uploaded, 20U);
  EXPECT_EQ(read % 4096, 0U);
  EXPECT_LE(static_cast<double>(read), 1.25 * static_cast<double>(used));
  EXPECT_LE(in_flight, 4U * 3U);
}

TEST(StoredTexture, TilesOfOneContentShareASlotAndThePictureIsTheSame) {
  heddle::image::Image mask{1024, 1024, 1, {}};
  for (std::uint32_t i = 0; i < 1024 * 1024; ++i) {
    const std::uint32_t x = i % 1024, y = i / 1024;
    mask.pixels.push_back(x % 300 < 40 && y % 300 < 40 ? static_cast<float>((x * 7919 ^ y * 104729) % 256) / 255
                                                       : 0.25F);
  }
  heddle::image::write(storing::folder() / "mask.png", mask);
  const std::string parameters =
      "params.images = [\"" + (storing::folder() / "mask.png").string() + "\"]\nparams.tile = \"64\"\n";
  const std::string whole = storing::job_file("mask.toml", parameters),
                    shared = storing::job_file("shared.toml", parameters + "params.shared = true\n");
  TextureScene scene(R"({"source": "stored"})");
  // 49 slots, and a picture of 9 x 7 tiles of level 0, their ancestors besides.
  // Nearest texels, which do not depend on where in the cache they are.
  const std::string ways =
      "params.fade = 0.0\nparams.filtering = \"nearest\"\nparams.spacing = \"16\"\nparams.uploads = 64\n";
  const std::string cache = ways + "params.cache = 512\n";
  Graph a(probe_graph("virtual", bound(whole) + ways)), b(probe_graph("virtual", bound(shared) + cache)),
      small(probe_graph("virtual", bound(whole) + cache));
  std::uint64_t uploads_alone = 0, uploads_shared = 0;
  const Camera camera{{0.05, 0.05}, {as_float(0.99 / 1024), 0}, {0, as_float(0.99 / 1024)}};
  for (Graph* graph : {&a, &b, &small}) {
    graph->set("extent=[512,384]");
    look(*graph, camera);
    for (int frame = 0; frame < 9; ++frame) {
      render(*graph, scene.scene);
      if (graph == &a) uploads_alone += counts(a).at("tiles_uploaded");
      if (graph == &b) uploads_shared += counts(b).at("tiles_uploaded");
    }
  }
  EXPECT_EQ(a.read().pixels, b.read().pixels);
  EXPECT_EQ(counts(b).at("level_bias"), 0U);
  EXPECT_GT(counts(small).at("level_bias"), 0U) << "each by itself has no room";
  const auto now = counts(b);
  std::printf("%d tiles in %d slots; %d uploads, %d without sharing\n", static_cast<int>(now.at("tiles_resident")),
              static_cast<int>(now.at("slots_in_use")), static_cast<int>(uploads_shared),
              static_cast<int>(uploads_alone));
  EXPECT_LT(now.at("slots_in_use"), now.at("tiles_resident"));
  EXPECT_LT(uploads_shared, uploads_alone);
  EXPECT_EQ(counts(a).at("slots_in_use"), counts(a).at("tiles_resident"));
}

/// What is made while it lives is a live host's.
class LiveHost {
 public:
  LiveHost() : other_(Host::get().handle) {
    const std::string path = HEDDLE_BUILD_DIR "/lib/heddle/plugins:" HEDDLE_BUILD_DIR "/tests/plugins";
    heddle_host_options options{};
    options.struct_size = sizeof options;
    options.flags = HEDDLE_HOST_LIVE;
    options.plugin_path = path.c_str();
    EXPECT_EQ(heddle_create(&options, &Host::get().handle), HEDDLE_OK);
  }
  ~LiveHost() { heddle_destroy(std::exchange(Host::get().handle, other_)); }
  LiveHost(const LiveHost&) = delete;
  LiveHost& operator=(const LiveHost&) = delete;

 private:
  heddle_host* other_;
};

TEST(StoredTexture, AFrameOfALiveHostNeverWaitsForTheDisk) {
  const std::string job =
      storing::job_file("live.toml", "params.source = \"ramp\"\nparams.extent = 2048\nparams.tile = \"64\"\n");
  const LiveHost live;
  TextureScene scene(R"({"source": "stored"})");
  Graph graph(probe_graph("virtual", bound(job) + "params.spacing = \"2\"\nparams.uploads = 32\nparams.window = 8\n"
                                                  "params.read_frames = 1\n"));
  std::mt19937 random(6);
  std::uint64_t waits = 0, requested = 0, uploaded = 0;
  for (int frame = 0; frame < 40; ++frame) {
    // Another place in each tenth frame: what is on its way is not wanted any more.
    if (frame % 10 == 0) look(graph, camera_at(random, 1.5, 2048));
    render(graph, scene.scene);
    const auto now = counts(graph);
    // The root comes when the store is opened: without it there would be nothing to show.
    if (frame > 0) waits += now.at("reads_waited_for");
    requested += now.at("tiles_requested");
    uploaded += now.at("tiles_uploaded");
    EXPECT_EQ(now.at("bytes_read") % 4096, 0U) << frame;
  }
  EXPECT_EQ(waits, 0U);
  EXPECT_GT(requested, 20U);
  EXPECT_GT(uploaded, 20U);
}

TEST(StoredTexture, ChartsCornersKeepTheirColourInAllLevelsOfOddKernels) {
  // Each texel of level 0 is one code away from the next, so codes tell how far a level's texels lie from where they
  // should be. A corner of a chart is a texel, and levels up to the fourth have one there.
  constexpr int kLevels = 4;
  for (const char* kernel : {"gauss3", "gauss5", "sharpen5", "box2", "gauss4", "sharpen4"}) {
    const bool is_odd = std::string(kernel).back() != '2' && std::string(kernel).back() != '4';
    const std::string job = storing::job_file(
        "charts.toml", std::string("params.source = \"ramp\"\nparams.extent = 2048\nparams.compression = \"none\"\n"
                                   "params.kernel = \"") +
                           kernel + "\"\n");
    double worst = 0;
    std::array<double, kLevels + 1> drift{};
    int corners = 0;
    for (const auto& [x, y] : {std::pair(1024, 256), std::pair(256, 1024)}) {
      TextureScene scene(R"({"source": "stored", "chart_size": 256, "chart_x": )" + std::to_string(x) +
                         R"(, "chart_y": )" + std::to_string(y) + "}");
      Graph paged(probe_graph("virtual", bound(job) + kQuick + "params.filtering = \"nearest\"\n"));
      std::array<double, 2> at_first{};
      for (int level = 0; level <= kLevels; ++level) {
        // Derivatives of a level's texel, all pixels at the corner itself: but for the first there is nothing to see.
        const double step = (1 << level) * 0.999 / 256;
        look(paged, {{0, 0}, {as_float(step), 0}, {0, as_float(step)}});
        settle(paged, scene.scene);
        const Image image = paged.image(scene.scene);
        for (const std::uint32_t channel : {0U, 1U}) {
          // Both places are far enough from where the ramp turns: what kernels see on both sides is straight.
          const double code = code_at(image, 0, 0, channel);
          if (level == 0) at_first[channel] = code;
          const double slope = ((channel == 0 ? x : y) % 380) < 190 ? 1 : -1;
          const double moved = (code - at_first[channel]) * slope;
          worst = std::max(worst, std::abs(moved));
          drift[static_cast<std::size_t>(level)] += moved;
          corners += level == 0 ? 1 : 0;
        }
      }
    }
    ASSERT_EQ(corners, 4);
    std::printf("%s: corners move by up to %.2f codes; in the mean", kernel, worst);
    for (double& moved : drift) std::printf(" %.2f", moved /= corners);
    std::printf("\n");
    for (int level = 0; level <= kLevels; ++level) {
      // Rounding to 8 bits in each level, and the ramp of codes being curved in linear light.
      const double moved = drift[static_cast<std::size_t>(level)];
      EXPECT_NEAR(moved, is_odd ? 0 : ((1 << level) - 1) / 2.0, 1) << kernel << ", level " << level;
    }
    EXPECT_EQ(worst < 0.01, is_odd) << kernel << ": the very code, of 8 bits";
  }
}

TEST(StoredTexture, FramesRepeatToTheBitWhateverTheDiskDoes) {
  const std::string job =
      storing::job_file("again.toml", "params.source = \"road\"\nparams.extent = 1024\nparams.tile = \"64\"\n");
  TextureScene scene(R"({"source": "stored"})");
  std::vector<std::vector<float>> first;
  for (int run = 0; run < 2; ++run) {
    Graph graph(probe_graph("virtual", bound(job) + "params.spacing = \"2\"\nparams.uploads = 2\nparams.window = 8\n"));
    Camera camera{{0.3, 0.3}, {1.5 / 1024, 0}, {0, 1.5 / 1024}};
    for (std::size_t frame = 0; frame < 20; ++frame) {
      camera.corner.x = as_float(camera.corner.x + 40.0 / 1024);
      look(graph, camera);
      render(graph, scene.scene, static_cast<double>(frame) / 60, 1.0 / 60);
      if (run == 0)
        first.push_back(graph.read().pixels);
      else
        EXPECT_EQ(graph.read().pixels, first[frame]) << frame;
    }
  }
}

std::string error_of(Graph& graph, Scene& scene, int frames) {
  for (int frame = 0; frame < frames; ++frame)
    if (heddle_render(graph.handle, scene.handle, nullptr) != HEDDLE_OK) return heddle_error(Host::get().handle);
  return "no error";
}

TEST(StoredTexture, ErrorsNameTheFileAndWhatIsWrongWithIt) {  // H9
  const std::string parameters = "params.source = \"terrain\"\nparams.extent = 1024\nparams.seed = 77\n";
  const storing::Made made = storing::make(parameters);
  const std::string job = storing::job_file("broken.toml", parameters);
  TextureScene scene(R"({"source": "stored"})");
  const Camera camera{{0.3, 0.3}, {0.9 / 1024, 0}, {0, 0.9 / 1024}};
  // A byte of each tile of the finest level, behind the coarser ones.
  const auto size = fs::file_size(made.file);
  {
    std::fstream file(made.file, std::ios::in | std::ios::out | std::ios::binary);
    for (std::uint64_t tile = heddle::texture_store::tile_count(2); tile < heddle::texture_store::tile_count(3);
         ++tile) {
      file.seekp(static_cast<std::streamoff>(tile * made.store.stride() + 1000));
      file.put('\x5a').put('\x5a').put('\x5b');
    }
  }
  {
    Graph graph(probe_graph("virtual", bound(job) + kQuick));
    look(graph, camera);
    EXPECT_THAT(error_of(graph, scene.scene, 20),
                AllOf(HasSubstr(made.file.string() + " was changed since it was made: tile "),
                      HasSubstr("of level 0 of texture 0"), HasSubstr("its bytes are not those that were written")));
    Graph resident(probe_graph("resident", bound(job)));
    EXPECT_THAT(error_of(resident, scene.scene, 1), HasSubstr(" was changed since it was made: tile 0, 0 of level 0"));
  }
  {
    Graph graph(probe_graph("virtual", bound(job) + kQuick));
    look(graph, camera);
    render(graph, scene.scene);
    fs::resize_file(made.file, size / 8);
    EXPECT_THAT(error_of(graph, scene.scene, 20),
                AllOf(HasSubstr(made.file.string() + ": error: the store was cut off since it was opened"),
                      HasSubstr("remove the file: the job makes it again")));
  }
  // A new run finds that it is damaged, and makes it again.
  Graph again(probe_graph("virtual", bound(job) + kQuick));
  look(again, camera);
  settle(again, scene.scene);
  EXPECT_EQ(fs::file_size(made.file), size);

  const std::pair<const char*, const char*> cases[] = {
      {R"({"source": "stored", "image": 1})", "material 0: texture_source.virtual.image is 1; expected: less than 1, "},
      {R"({"source": "stored", "address": "clamp"})",
       "material 0: texture_source.virtual.address is 2; expected: that of the store, 0 "},
  };
  for (const auto& [properties, message] : cases) {
    TextureScene wrong(properties);
    Graph graph(probe_graph("virtual", bound(job)));
    EXPECT_THAT(error_of(graph, wrong.scene, 1), HasSubstr(message));
  }
  Graph unbound(probe_graph("virtual", ""));
  EXPECT_THAT(error_of(unbound, scene.scene, 1),
              HasSubstr("input 'store' is bound to nothing; expected: inputs.store = "));
}

}  // namespace
