// SPDX-License-Identifier: Apache-2.0
// The hard cases of role texture_source: the function asked directly, at chosen coordinates, and while the gbuffer
// draws.
#include "parsed.hpp"
#include "roles/readme.hpp"
#include "roles/texture_source/asking.hpp"

#include <cstdio>
#include <set>

#include "shared/texture_tiles.hpp"

namespace {

using namespace asking;
namespace tiles = heddle::texture_tiles;

std::uint32_t code_of(float linear) {
  const double v = static_cast<double>(linear);
  const double encoded = v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
  return static_cast<std::uint32_t>(std::lround(encoded * 255));
}

struct Texel {
  std::uint32_t x = 0, y = 0, level = 0;
  friend bool operator==(const Texel&, const Texel&) = default;
};
Texel decoded(const Image& image, std::uint32_t px, std::uint32_t py) {
  const std::uint32_t code =
      code_of(image.at(px, py, 0)) | code_of(image.at(px, py, 1)) << 8U | code_of(image.at(px, py, 2)) << 16U;
  return {code & 1023U, code >> 10U & 1023U, code >> 20U};
}

/// uv of a pixel as the probe computes it: each operation rounded once.
glm::vec2 uv_of(const Camera& camera, std::uint32_t px, std::uint32_t py) {
  glm::vec2 uv{};
  for (int c = 0; c < 2; ++c) {
    const volatile float along = static_cast<float>(px) * static_cast<float>(camera.edge_u[c]);
    const volatile float down = static_cast<float>(py) * static_cast<float>(camera.edge_v[c]);
    const volatile float first = static_cast<float>(camera.corner[c]) + along;
    const volatile float sum = first + down;
    uv[c] = sum;
  }
  return uv;
}

std::uint32_t texel_of(float u, std::uint32_t extent, std::uint32_t level, std::uint32_t mode) {
  // Exact in float64: u has 24 bits, the extent is a power of two.
  const auto asked = static_cast<std::int64_t>(std::floor(static_cast<double>(u) * extent));
  return tiles::addressed(asked, extent, mode) >> level;
}

/// The level that a pixel wants, away from where rounding decides; -1 where it might.
int level_of(const Camera& camera, double extent, int coarsest) {
  const double longer = std::max(glm::length(camera.edge_u), glm::length(camera.edge_v)) * extent;
  const double lambda = std::log2(longer);
  if (std::abs(lambda - std::round(lambda)) < 1e-3) return -1;
  return std::clamp(static_cast<int>(std::ceil(lambda)), 0, coarsest);
}

constexpr const char* kExact =
    "params.filtering = \"nearest\"\nparams.anisotropy = 1\nparams.spacing = \"2\"\nparams.uploads = 64\nparams.window "
    "= 8\n";

TEST(TextureSource, AnswersTheTexelThatIsAskedForInEveryLevel) {  // H1, H2
  constexpr std::uint32_t kExtent = 16384;
  std::mt19937 random(11);
  for (const std::string mode : {"wrap", "mirror", "clamp"}) {
    TextureScene scene("{\"source\": \"uvgrid\", \"extent\": 16384, \"address\": \"" + mode + "\"}");
    const std::uint32_t address = mode == "wrap" ? tiles::kWrap : mode == "mirror" ? tiles::kMirror : tiles::kClamp;
    Graph graph(probe_graph("virtual", kExact));
    std::size_t wrong = 0, seen = 0;
    std::set<int> levels;
    for (int i = 0; i < 16; ++i) {
      const Camera camera = camera_at(random, std::exp2(-2 + 9.5 * static_cast<double>(random()) * 0x1p-32), kExtent);
      const int level = level_of(camera, kExtent, 7);
      if (level < 0) continue;
      levels.insert(level);
      look(graph, camera);
      settle(graph, scene.scene);
      const Image image = graph.read();
      for (std::uint32_t y = 0; y < kHeight; ++y) {
        for (std::uint32_t x = 0; x < kWidth; ++x) {
          const glm::vec2 uv = uv_of(camera, x, y);
          const auto m = static_cast<std::uint32_t>(level);
          const Texel expected{texel_of(uv.x, kExtent, m, address) & 1023U, texel_of(uv.y, kExtent, m, address) & 1023U,
                               m};
          wrong += decoded(image, x, y) == expected ? 0U : 1U;
          ++seen;
        }
      }
    }
    EXPECT_EQ(wrong, 0U) << mode << ", of " << seen;
    EXPECT_GE(levels.size(), 6U);
    EXPECT_GT(seen, 40000U);
  }
}

/// Every pixel shows its own place in some level from the wanted one up: never a slot that holds something else.
std::size_t out_of_place(const Image& image, const Camera& camera, std::uint32_t extent, double& excess) {
  std::size_t wrong = 0;
  const int wanted = level_of(camera, extent, 9);
  excess = 0;
  for (std::uint32_t y = 0; y < image.height; ++y) {
    for (std::uint32_t x = 0; x < image.width; ++x) {
      const glm::vec2 uv = uv_of(camera, x, y);
      const Texel shown = decoded(image, x, y);
      const Texel expected{texel_of(uv.x, extent, shown.level, tiles::kWrap) & 1023U,
                           texel_of(uv.y, extent, shown.level, tiles::kWrap) & 1023U, shown.level};
      wrong += shown == expected && (wanted < 0 || static_cast<int>(shown.level) >= wanted) ? 0U : 1U;
      excess += static_cast<int>(shown.level) - wanted;
    }
  }
  excess /= static_cast<double>(image.width) * image.height;
  return wrong;
}

TEST(TextureSource, NeverShowsAnotherPlaceOrAnOlderTileInARandomFlight) {  // H6
  constexpr std::uint32_t kExtent = 65536;
  TextureScene scene(R"({"source": "uvgrid", "extent": 65536})");
  Graph graph(probe_graph("virtual",
                          "params.filtering = \"nearest\"\nparams.anisotropy = 1\nparams.spacing = \"4\"\n"
                          "params.uploads = 3\nparams.window = 6\nparams.cache = 640\n"));
  std::mt19937 random(4);
  Camera camera;
  std::size_t wrong = 0, evicted = 0;
  for (int frame = 0; frame < 300; ++frame) {
    if (frame % 25 == 0) camera = camera_at(random, std::exp2(7.9 * static_cast<double>(random()) * 0x1p-32), kExtent);
    camera.corner.x = as_float(camera.corner.x + 5 * camera.edge_u.x);
    look(graph, camera);
    render(graph, scene.scene);
    double excess = 0;
    wrong += out_of_place(graph.read(), camera, kExtent, excess);
    evicted += counts(graph)["tiles_evicted"];
  }
  EXPECT_EQ(wrong, 0U);
  EXPECT_GT(evicted, 40U) << "the flight was no test of eviction";
}

TEST(TextureSource, ConvergesAfterACameraCutWithinItsBudget) {  // H6
  constexpr std::uint32_t kExtent = 65536;
  TextureScene scene(R"({"source": "uvgrid", "extent": 65536})");
  Graph graph(probe_graph("virtual",
                          "params.filtering = \"nearest\"\nparams.anisotropy = 1\nparams.spacing = \"2\"\n"
                          "params.uploads = 4\nparams.window = 8\n"));
  const Camera camera{{0.3, 0.3}, {as_float(5.0 / kExtent), 0}, {0, as_float(5.0 / kExtent)}};
  look(graph, camera);
  double excess = 0;
  int frame = 0;
  std::uint64_t uploaded = 0;
  std::string curve;
  do {
    render(graph, scene.scene, 0, 0, frame == 0);
    EXPECT_EQ(out_of_place(graph.read(), camera, kExtent, excess), 0U);
    uploaded += counts(graph)["tiles_uploaded"];
    curve += exact_text(std::round(100 * excess) / 100) + " ";
    ++frame;
  } while (excess >= 0.05 && frame < 60);
  std::printf("levels missing by frame: %s(%d tiles)\n", curve.c_str(), static_cast<int>(uploaded));
  // The tiles, four a frame; two frames of latency, four until each pixel has asked; the root is the first frame's.
  EXPECT_LE(frame, static_cast<int>((uploaded + 3) / 4) + 4 + 4);
}

TEST(TextureSource, GoesQuietBeforeAStillCameraToTheLastByte) {
  TextureScene scene(R"({"source": "terrain", "extent": 65536})");
  Graph graph(probe_graph("virtual", "params.spacing = \"2\"\nparams.window = 8\n"));
  const Camera camera{{0.3, 0.3}, {as_float(3.0 / 65536), 0}, {0, as_float(3.0 / 65536)}};
  look(graph, camera);
  settle(graph, scene.scene);
  const Image still = graph.image(scene.scene);
  const auto uploads_of = [&] { return stats(graph)["counters"]["uploaded_bytes"].get<std::uint64_t>(); };
  for (int frame = 0; frame < 12; ++frame) {
    render(graph, scene.scene);
    const auto now = counts(graph);
    EXPECT_EQ(now.at("tiles_uploaded") + now.at("table_edits") + now.at("tiles_evicted"), 0U);
    EXPECT_EQ(stats(graph)["counters"]["dispatches"], 1) << "the probe's own";
    EXPECT_LE(uploads_of(), 4096U) << "values alone: no texel, no cell";
    EXPECT_EQ(graph.read().pixels, still.pixels);
  }
}

TEST(TextureSource, WorkFollowsTheTilesAndNotTheSizeOfTheTexture) {
  std::map<std::uint32_t, std::pair<std::uint64_t, std::uint64_t>> work;
  for (const std::uint32_t extent : {4096U, 262144U}) {
    TextureScene scene("{\"source\": \"uvgrid\", \"extent\": " + std::to_string(extent) + "}");
    Graph graph(probe_graph("virtual", "params.spacing = \"2\"\nparams.window = 8\n"));
    // The same texels of level 0 from the corner on.
    look(graph, {{0, 0}, {as_float(3.0 / extent), 0}, {0, as_float(3.0 / extent)}});
    settle(graph, scene.scene);
    render(graph, scene.scene);
    work[extent] = {stats(graph)["counters"]["uploaded_bytes"], stats(graph)["counters"]["read_back_bytes"]};
  }
  EXPECT_EQ(work[4096], work[262144]);
}

TEST(TextureSource, WithHalfTheCacheItNeedsItIsCoarserAndStill) {  // H7
  constexpr std::uint32_t kExtent = 4096;
  TextureScene scene(R"({"source": "uvgrid", "extent": 4096})");
  const Camera camera{{0.3, 0.3}, {as_float(0.9 / kExtent), 0}, {0, as_float(0.9 / kExtent)}};
  for (const bool is_half : {false, true}) {
    // 784 tiles, and 9.
    Graph graph(probe_graph(
        "virtual", std::string(kExact) + "params.tile = \"64\"\nparams.cache = " + (is_half ? "216" : "2048") + "\n"));
    graph.set("extent=[256,128]");
    look(graph, camera);
    for (int frame = 0; frame < 30; ++frame) {
      render(graph, scene.scene);
      const auto now = counts(graph);
      if (frame > 15) {
        EXPECT_EQ(now.at("tiles_uploaded") + now.at("tiles_evicted"), 0U) << "thrashing";
      }
    }
    double excess = 0;
    EXPECT_EQ(out_of_place(graph.read(), camera, kExtent, excess), 0U);
    const auto last = counts(graph);
    std::printf("%d wanted, %d resident, bias %d: %.2f levels too coarse\n", static_cast<int>(last.at("tiles_wanted")),
                static_cast<int>(last.at("tiles_resident")), static_cast<int>(last.at("level_bias")), excess);
    if (!is_half) {
      EXPECT_EQ(excess, 0);
      EXPECT_EQ(last.at("level_bias"), 0U);
      EXPECT_GE(last.at("tiles_wanted"), 2U * 9U) << "not half the cache that is needed";
    } else {
      EXPECT_GT(last.at("level_bias"), 0U);
      EXPECT_LE(excess, static_cast<double>(last.at("level_bias")));
      EXPECT_GT(excess, 0.5);
    }
  }
}

TEST(TextureSource, IsTheReferencesPictureWhereAllTilesAreResident) {
  std::mt19937 random(17);
  struct Case {
    const char *source, *mode, *filtering;
    int taps;
  };
  for (const Case& c : {Case{"road", "wrap", "bilinear", 1}, Case{"road", "mirror", "trilinear", 4},
                        Case{"road", "clamp", "bilinear", 4}, Case{"ramp", "wrap", "trilinear", 1},
                        Case{"ramp", "mirror", "bilinear", 4}}) {
    const std::string named = std::string(c.source) + " " + c.mode + " " + c.filtering + " " + std::to_string(c.taps);
    TextureScene scene(R"({"extent": 1024, "source": ")" + std::string(c.source) + R"(", "address": ")" + c.mode +
                       "\"}");
    const std::string shared =
        std::string("params.filtering = \"") + c.filtering + "\"\nparams.anisotropy = " + std::to_string(c.taps) + "\n";
    Graph resident(probe_graph("resident", shared));
    Graph paged(probe_graph("virtual", shared + "params.spacing = \"2\"\nparams.uploads = 64\nparams.window = 8\n"));
    double worst = 1e30;
    for (int i = 0; i < 4; ++i) {
      Camera camera = camera_at(random, std::exp2(-1 + 3.5 * static_cast<double>(random()) * 0x1p-32), 1024);
      camera.edge_v *= 0.25 + 0.5 * i;
      camera.edge_v = {as_float(camera.edge_v.x), as_float(camera.edge_v.y)};
      look(resident, camera);
      look(paged, camera);
      settle(paged, scene.scene);
      worst = std::min(worst, psnr(paged.image(scene.scene), resident.image(scene.scene)));
    }
    std::printf("%s taps: PSNR %.1f dB\n", named.c_str(), worst);
    EXPECT_GE(worst, 60) << named;
  }
}

TEST(TextureSource, LongFootprintsTakeNothingFromTheNeighboursInTheCache) {  // H5
  TextureScene scene(R"({"source": "ramp", "extent": 4096})");
  // A cache in which each tile has other tiles around it, and footprints of 8 x 1 texels in all directions.
  Graph resident(probe_graph("resident", "params.anisotropy = 8\n"));
  Graph paged(probe_graph("virtual",
                          "params.anisotropy = 8\nparams.spacing = \"2\"\nparams.uploads = 64\nparams.window = 8\n"));
  std::mt19937 random(23);
  double worst = 0;
  for (int i = 0; i < 12; ++i) {
    const Camera round = camera_at(random, 7.9, 4096);
    Camera camera = round;
    camera.edge_v = {as_float(-round.edge_u.y / 7.95), as_float(round.edge_u.x / 7.95)};
    look(resident, camera);
    look(paged, camera);
    settle(paged, scene.scene);
    const Image a = paged.image(scene.scene), b = resident.image(scene.scene);
    for (std::uint32_t y = 0; y < kHeight; ++y)
      for (std::uint32_t x = 0; x < kWidth; ++x)
        for (std::uint32_t c = 0; c < 3; ++c)
          worst = std::max(worst, std::abs(code_at(a, x, y, c) - code_at(b, x, y, c)));
  }
  std::printf("largest difference with 8 taps: %.3f of 255\n", worst);
  EXPECT_LE(worst, 1);
}

/// The largest step from pixel to pixel across tiles' sides, and inside of tiles, in 255ths of the sRGB code.
std::pair<double, double> steps_of(const std::string& border) {
  TextureScene scene(R"({"source": "ramp", "extent": 4096})");
  Graph paged(probe_graph(
      "virtual", "params.spacing = \"2\"\nparams.window = 8\nparams.anisotropy = 1\nparams.border = " + border + "\n"));
  // A quarter of a texel a pixel, 16 texels in all, around the corner of four tiles.
  const Camera camera{{(1024.0 - 8.125) / 4096, (1024.0 - 6.125) / 4096}, {0.25 / 4096, 0}, {0, 0.25 / 4096}};
  look(paged, camera);
  settle(paged, scene.scene);
  const Image image = paged.image(scene.scene);
  double across = 0, inside = 0;
  for (std::uint32_t y = 0; y < kHeight; ++y) {
    for (std::uint32_t x = 0; x + 1 < kWidth; ++x) {
      const double left = (1024.0 - 8.125) + 0.25 * x;
      const bool is_edge = left < 1024.5 && left + 0.25 > 1023.5;
      double& worst = is_edge ? across : inside;
      worst = std::max(worst, std::abs(code_at(image, x + 1, y, 0) - code_at(image, x, y, 0)));
    }
  }
  return {across, inside};
}

TEST(TextureSource, TilesSidesShowNoSeam) {  // H4
  for (const char* border : {"1", "2", "4"}) {
    const auto [across, inside] = steps_of(border);
    std::printf("border %s: largest step across %.3f, inside %.3f of 255\n", border, across, inside);
    EXPECT_LE(across, inside + 1);
  }
  const auto [across, inside] = steps_of("0");
  std::printf("border 0: largest step across %.3f, inside %.3f of 255\n", across, inside);
  EXPECT_GT(across, inside + 1) << "without a border seams are known to show: else this is no test";
}

TEST(TextureSource, DerivativesThatAreNoNumbersGiveATexel) {  // H3
  for (const char* technique : {"virtual", "resident"}) {
    TextureScene scene(R"({"source": "road", "extent": 1024})");
    Graph graph(probe_graph(technique, "params.anisotropy = 8\n"));
    look(graph, {{0.1, 0.2}, {0.001, 0}, {0, 0.001}});
    for (const double footprint : {0.0, 3e38, -3e38, 1e-38}) {
      graph.set("ask.params.footprint=" + exact_text(footprint));
      for (int i = 0; i < 6; ++i) render(graph, scene.scene);
      const Image image = graph.read();
      for (const float value : image.pixels) ASSERT_TRUE(value >= 0 && value <= 1) << technique << " " << footprint;
    }
  }
}

double largest_change(const Image& a, const Image& b) {
  double worst = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i)
    worst = std::max(worst, std::abs(static_cast<double>(a.pixels[i] - b.pixels[i])));
  return worst;
}

TEST(TextureSource, TilesFadeInInsteadOfPopping) {
  TextureScene scene(R"({"source": "road", "extent": 4096})");
  const Camera far{{0.5, 0.5}, {2.0 / 4096, 0}, {0, 2.0 / 4096}}, near{{0.5, 0.5}, {1.0 / 4096, 0}, {0, 1.0 / 4096}};
  std::map<std::string, double> change;
  for (const std::string fade : {"0.0", "0.25"}) {
    Graph graph(probe_graph("virtual", "params.spacing = \"2\"\nparams.window = 8\nparams.fade = " + fade + "\n"));
    look(graph, far);
    settle(graph, scene.scene);
    look(graph, near);
    double time = 0;
    const auto step = [&] { render(graph, scene.scene, time += 1.0 / 60, 1.0 / 60); };
    step();
    Image before = graph.read();
    for (int frame = 0; frame < 40; ++frame) {
      step();
      const Image now = graph.read();
      const double moved = largest_change(before, now);
      change[fade] = std::max(change[fade], moved);
      if (frame > 25) {
        EXPECT_EQ(moved, 0) << "after the fade's end";
      }
      before = now;
    }
  }
  std::printf("largest change in a frame: %.4f popping, %.4f fading\n", change["0.0"], change["0.25"]);
  EXPECT_GE(change["0.0"], 4 * change["0.25"]);
  EXPECT_GT(change["0.0"], 0);
}

TEST(TextureSource, IsSettledWhereTimeRestsAndWhereItWentBack) {
  TextureScene scene(R"({"source": "road", "extent": 4096})");
  const Camera far{{0.5, 0.5}, {2.0 / 4096, 0}, {0, 2.0 / 4096}}, near{{0.5, 0.5}, {1.0 / 4096, 0}, {0, 1.0 / 4096}};
  const std::string parameters = "params.spacing = \"2\"\nparams.window = 8\nparams.fade = ";
  Graph whole(probe_graph("virtual", parameters + "0.0\n"));
  look(whole, near);
  settle(whole, scene.scene);
  const Image settled = whole.read();
  constexpr double kStep = 1.0 / 60;
  struct Case {
    const char* what;
    double time, step;
    int frames;
  };
  // The first frame at rest shows all that is there; time that jumped back and goes on fades as it would have.
  for (const Case& one :
       {Case{"rests", 10.25, 0, 1}, Case{"runs back", 10.2, -kStep, 1}, Case{"went back, and goes on", 1, kStep, 20}}) {
    Graph graph(probe_graph("virtual", parameters + "0.25\n"));
    look(graph, far);
    settle(graph, scene.scene);
    look(graph, near);
    for (int frame = 0; frame < 12; ++frame) render(graph, scene.scene, 10 + frame * kStep, kStep);
    EXPECT_GT(largest_change(graph.read(), settled), 0) << one.what << ": half-faded at first";
    for (int frame = 0; frame < one.frames; ++frame) render(graph, scene.scene, one.time + frame * one.step, one.step);
    EXPECT_EQ(graph.read().pixels, settled.pixels) << one.what;
    for (int frame = 0; frame < 4; ++frame) {
      render(graph, scene.scene, one.time + frame * kStep, kStep);
      EXPECT_EQ(graph.read().pixels, settled.pixels) << one.what << ", and goes on: nothing fades anew";
      EXPECT_EQ(stats(graph)["counters"]["dispatches"], 1) << "the probe's own";
    }
  }
}

TEST(TextureSource, MoreWishesThanTheListHoldsMakeItGrowAndLoseNothingThatIsThere) {
  TextureScene scene(R"({"source": "terrain", "extent": 65536})");
  Graph graph(probe_graph("virtual", "params.spacing = \"2\"\nparams.window = 8\n"));
  graph.set("extent=[320,240]");  // 19,200 wishes a frame, and room for 4096
  look(graph, {{0.3, 0.3}, {1.0 / 65536, 0}, {0, 1.0 / 65536}});
  std::uint64_t resident = 0;
  for (int frame = 0; frame < 14; ++frame) {
    render(graph, scene.scene);
    EXPECT_GE(counts(graph)["tiles_resident"], resident) << "growing dropped tiles";
    resident = counts(graph)["tiles_resident"];
  }
  const nlohmann::json said = stats(graph);
  EXPECT_EQ(said["lists"].size(), 1U);
  for (const auto& list : said["lists"]) {
    EXPECT_EQ(list["overflow"], 0);
    EXPECT_EQ(list["count"], 19200);
  }
}

/// A floor with uv, seen at an angle.
struct Plane {
  Scene scene;
  explicit Plane(bool is_virtual) {
    scene.add_mesh({-40, 0, 40, 40, 0, 40, 40, 0, -40, -40, 0, -40}, {}, {0, 1, 2, 0, 2, 3}, dmat4(1.0),
                   {0, 1, 1, 1, 1, 0, 0, 0});
    if (is_virtual)
      check(heddle_scene_set_component(scene.handle, HEDDLE_OWNER_MATERIAL, 0, "texture_source.virtual",
                                       R"({"source": "road", "extent": 2048})"));
    scene.look({0, 2, 10}, {0, 0, 0});
  }
};
std::string frame_graph(const std::string& technique) {
  return "extent = [96, 64]\noutput = \"gbuffer.base_color\"\n" +
         (technique.empty()
              ? ""
              : "[[pass]]\nname = \"source\"\nrole = \"texture_source\"\ntechnique = \"" + technique + "\"\n") +
         "[[pass]]\nrole = \"gbuffer\"\ntechnique = \"raster\"\nparams.precision = \"float32\"\n";
}

TEST(TextureSource, TheGbufferAsksForTilesWhileItDraws) {
  Plane plane(true);
  Graph resident(frame_graph("resident")), paged(frame_graph("virtual")), none(frame_graph(""));
  paged.set("source.params.spacing=\"2\"");
  settle(paged, plane.scene);
  const Image a = paged.image(plane.scene), b = resident.image(plane.scene), c = none.image(plane.scene);
  std::printf("gbuffer: PSNR %.1f dB\n", psnr(a, b));
  EXPECT_GE(psnr(a, b), 60);
  EXPECT_LT(psnr(c, b), 30) << "without the pass the floor is grey";
  EXPECT_GT(counts(paged)["tiles_resident"], 8U);
}

TEST(TextureSource, TheTreeKnowsInTheFirstFrameWhatPixelsAskForInTheThird) {
  Plane plane(true);
  Graph resident(frame_graph("resident"));
  const Image expected = resident.image(plane.scene);
  std::map<std::string, int> first_right;
  for (const std::string query : {"view", "tree", "both", "draws", "map"}) {
    Graph paged(frame_graph("virtual"));
    for (const char* setting : {"source.inputs.eye=\"scene.camera\"", "source.params.spacing=\"2\"",
                                "source.params.uploads=128", "source.params.fade=0.0"})
      paged.set(setting);
    paged.set("source.params.query=\"" + query + "\"");
    first_right[query] = -1;
    for (int frame = 0; frame < 12; ++frame) {
      render(paged, plane.scene, 0, 0, frame == 0);
      if (first_right[query] < 0 && psnr(paged.read(), expected) >= 60) first_right[query] = frame;
      if (query != "view" && query != "both") {
        const nlohmann::json lists = stats(paged)["lists"];
        EXPECT_FALSE(lists.empty());
        for (const auto& list : lists) EXPECT_EQ(list["count"], 0) << "no pixel asks";
      }
    }
    const auto now = counts(paged);
    std::printf("%s: right from frame %d on, %d tiles resident\n", query.c_str(), first_right[query],
                static_cast<int>(now.at("tiles_resident")));
    EXPECT_EQ(now.contains("tiles_named"), query != "view");
  }
  EXPECT_EQ(first_right["tree"], 0);
  EXPECT_EQ(first_right["both"], 0);
  EXPECT_EQ(first_right["draws"], 0);
  EXPECT_EQ(first_right["map"], 0);
  EXPECT_GE(first_right["view"], 2);
}

TEST(TextureSource, WhatComesIntoViewIsRightAtOnceUnlessPixelsHaveToAsk) {
  std::map<std::string, int> first_right;
  for (const std::string query : {"view", "tree", "both", "draws", "map"}) {
    Plane plane(true);
    Graph resident(frame_graph("resident")), paged(frame_graph("virtual"));
    for (const char* setting : {"source.inputs.eye=\"scene.camera\"", "source.params.spacing=\"2\"",
                                "source.params.uploads=128", "source.params.fade=0.0"})
      paged.set(setting);
    paged.set("source.params.query=\"" + query + "\"");
    // Up into the sky, then back: no cut, the cache is what it was.
    plane.scene.look({0, 2, 10}, {0, 90, 10});
    for (int frame = 0; frame < 8; ++frame) render(paged, plane.scene, 0, 0, frame == 0);
    const auto before = counts(paged).at("tiles_resident");
    plane.scene.look({0, 2, 10}, {0, 0, 0});
    const Image expected = resident.image(plane.scene);
    first_right[query] = -1;
    for (int frame = 0; frame < 12 && first_right[query] < 0; ++frame) {
      render(paged, plane.scene);
      if (psnr(paged.read(), expected) >= 60) first_right[query] = frame;
    }
    std::printf("%s: %d tiles resident before, %d after; right in frame %d\n", query.c_str(), static_cast<int>(before),
                static_cast<int>(counts(paged).at("tiles_resident")), first_right[query]);
    EXPECT_EQ(before, 1U) << query << ": the root alone";
  }
  for (const char* query : {"tree", "both", "draws", "map"}) EXPECT_EQ(first_right[query], 0) << query;
  // Two frames of latency, and as many as it takes until all pixels of a square have asked.
  EXPECT_GE(first_right["view"], 2);
  EXPECT_LE(first_right["view"], 2 + 4);
}

TEST(TextureSource, EveryWayOfCopyingAndOfEditingTheTableGivesTheSameBytes) {
  constexpr std::uint32_t kExtent = 16384;
  TextureScene scene(R"({"source": "uvgrid", "extent": 16384})");
  std::vector<std::vector<float>> expected;
  std::uint64_t most_tiles = 0;
  for (const char* table : {"gpu", "cpu"}) {
    for (const char* copies : {"one_copy", "copy_each"}) {
      Graph graph(
          probe_graph("virtual", std::string("params.filtering = \"nearest\"\nparams.uploads = 5\nparams.window = 4\n"
                                             "params.cache = 640\nparams.table = \"") +
                                     table + "\"\nparams.copies = \"" + copies + "\"\n"));
      std::mt19937 random(12);
      std::uint64_t sent = 0, evicted = 0;
      const std::uint64_t tile_bytes = 136 * 136 * 4;
      Camera camera;
      for (std::size_t frame = 0; frame < 48; ++frame) {
        if (frame % 8 == 0) camera = camera_at(random, std::exp2(6 * static_cast<double>(random()) * 0x1p-32), kExtent);
        look(graph, camera);
        render(graph, scene.scene);
        const auto now = counts(graph);
        evicted += now.at("tiles_evicted");
        // What a frame costs is that of a tile for each that comes, or a command for all.
        const std::uint64_t tiles = now.at("tiles_uploaded");
        const auto count = [&](const char* name) { return now.contains(name) ? now.at(name) : 0; };
        EXPECT_EQ(count("tile_bytes_staged"), tiles * tile_bytes) << frame;
        EXPECT_EQ(count("tile_copies"), std::string(copies) == "copy_each" ? tiles : std::min<std::uint64_t>(tiles, 1));
        most_tiles = std::max(most_tiles, tiles);
        if (const auto found = now.find("table_bytes_sent"); found != now.end()) sent += found->second;
        if (expected.size() <= frame)
          expected.push_back(graph.read().pixels);
        else
          ASSERT_EQ(graph.read().pixels, expected[frame]) << table << ", " << copies << ", frame " << frame;
      }
      std::printf("%s, %s: %d tiles evicted, %d bytes of the table sent\n", table, copies, static_cast<int>(evicted),
                  static_cast<int>(sent));
      EXPECT_GT(evicted, 5U) << "no test of evictions";
      EXPECT_EQ(sent > 0, std::string(table) == "cpu");
    }
  }
  EXPECT_EQ(most_tiles, 5U) << "of none to all that may come in a frame";
}

TEST(TextureSource, ATreeNeedsAViewInPerspective) {
  Plane plane(true);
  Graph graph(frame_graph("virtual"));
  graph.set("source.params.query=\"tree\"");
  EXPECT_NE(heddle_render(graph.handle, plane.scene.handle, nullptr), HEDDLE_OK);
  EXPECT_NE(std::string(heddle_error(Host::get().handle)).find("input 'eye' is bound to nothing; expected: inputs.eye"),
            std::string::npos)
      << heddle_error(Host::get().handle);
}

TEST(TextureSource, WithoutSuchAMaterialThereIsNothing) {  // H8
  Plane plane(false);
  Graph paged(frame_graph("virtual")), none(frame_graph(""));
  for (int frame = 0; frame < 3; ++frame) {
    render(paged, plane.scene);
    render(none, plane.scene);
  }
  EXPECT_EQ(paged.read().pixels, none.read().pixels);
  const nlohmann::json with = stats(paged), without = stats(none);
  EXPECT_EQ(with["counters"], without["counters"]);
  EXPECT_EQ(with["memory"], without["memory"]);
  for (const auto& library : with["libraries"])
    EXPECT_EQ(library.dump().find("texture_source"), std::string::npos) << library.dump();
}

TEST(TextureSource, ErrorsNameTheMaterialAndWhatIsExpected) {
  const std::pair<const char*, const char*> cases[] = {
      {R"({"extent": 1000})", "material 0: texture_source.virtual.extent is 1000; expected: a power of two"},
      {R"({"chart_size": 100})",
       "material 0: texture_source.virtual.chart_size is 100; expected: a power of two from 256 on, or 0"},
      {R"({"chart_size": 1024, "chart_x": 512})",
       "material 0: texture_source.virtual.chart_x is 512; expected: a multiple of chart_size, 1024"},
  };
  for (const auto& [properties, message] : cases) {
    TextureScene scene(properties);
    for (const char* technique : {"virtual", "resident"}) {
      Graph graph(probe_graph(technique, ""));
      EXPECT_NE(heddle_render(graph.handle, scene.scene.handle, nullptr), HEDDLE_OK);
      EXPECT_NE(std::string(heddle_error(Host::get().handle)).find(message), std::string::npos)
          << heddle_error(Host::get().handle);
    }
  }
}

TEST(TextureSource, ReadmesTellTheParametersAsTheyAre) {
  const char* text = nullptr;
  check(heddle_list(Host::get().handle, &text));
  const nlohmann::json all = parsed::json(text);
  for (const char* id : {"texture_source/virtual", "texture_source/resident"}) {
    const std::string table = parameter_table(all, id);
    EXPECT_NE(table, "");
    EXPECT_NE(readme_of(id).find(table), std::string::npos) << id << " should have\n" << table;
  }
}

}  // namespace
