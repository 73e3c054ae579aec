// SPDX-License-Identifier: Apache-2.0
// The hard cases of role light_assignment, by pictures: every technique gives the bits of the reference in
// lighting/deferred, lighting/forward and transparency/sorted, and loses no light that reaches a pixel.
#include "parsed.hpp"
#include "roles/light_assignment/random.hpp"
#include "roles/readme.hpp"
#include "roles/rendering.hpp"

#include <array>
#include <bit>
#include <functional>
#include <map>

namespace {

using namespace rendering;

constexpr std::uint32_t kWidth = 48, kHeight = 32;

struct Settings {
  std::string technique = "tiled";
  std::string lighting = "deferred";
  std::uint32_t width = kWidth, height = kHeight;
  std::string tile = "16", steps = "2", fewest = "0", memory = "4", depth = "gbuffer.depth";  // of tiled
  bool has_transparency = false;
  bool is_supersampled = false;
};

std::string graph_text(const Settings& s) {
  std::string text = "extent = [48, 32]\noutput = \"";
  text += s.is_supersampled ? "aa.radiance" : s.has_transparency ? "transparency.radiance" : "lighting.radiance";
  text +=
      "\"\n[[pass]]\nrole = \"gbuffer\"\ntechnique = \"raster\"\nparams.precision = \"float32\"\n"
      "[[pass]]\nname = \"lights\"\nrole = \"light_assignment\"\ntechnique = \"" +
      s.technique + "\"\n[[pass]]\nrole = \"lighting\"\ntechnique = \"" + s.lighting +
      "\"\nparams.precision = \"float32\"\n"
      "[[pass]]\nname = \"counted\"\nrole = \"light_count\"\ntechnique = \"heat_map\"\n";
  if (s.has_transparency) text += "[[pass]]\nrole = \"transparency\"\ntechnique = \"sorted\"\n";
  if (s.is_supersampled)
    text += "[[pass]]\nname = \"aa\"\nrole = \"antialiasing\"\ntechnique = \"supersampled\"\nparams.samples = 4\n";
  return text;
}

/// Graphs stay, by their text, for all scenes and sizes: their pipelines are the dear part. They end before their host,
/// which was registered first.
struct Graphs : testing::Environment {
  struct Made {
    explicit Made(const std::string& text) : graph(text) {}
    Graph graph;
    std::vector<std::string> settings;
  };
  static inline std::map<std::string, Made> made;
  void TearDown() override { made.clear(); }
};
const auto* const graphs = testing::AddGlobalTestEnvironment(new Graphs);

Graph& graph_of(const Settings& s) {
  const std::string text = graph_text(s);
  const auto [found, is_new] = Graphs::made.try_emplace(text, text);
  Graphs::Made& made = found->second;
  if (is_new && !s.is_supersampled) made.graph.keep("counted.count");
  std::vector<std::string> settings = {"extent=[" + std::to_string(s.width) + "," + std::to_string(s.height) + "]"};
  if (s.technique == "tiled")
    settings.insert(settings.end(), {"lights.params.tile=" + s.tile, "lights.params.steps=" + s.steps,
                                     "lights.params.fewest=" + s.fewest, "lights.params.memory=" + s.memory,
                                     "lights.inputs.depth=" + s.depth});
  for (std::size_t i = 0; i < settings.size(); ++i)
    if (i >= made.settings.size() || made.settings[i] != settings[i]) made.graph.set(settings[i]);
  made.settings = settings;
  return made.graph;
}

std::vector<std::uint32_t> bits_of(const Image& image) {
  std::vector<std::uint32_t> bits;
  bits.reserve(image.pixels.size());
  for (const float value : image.pixels) bits.push_back(std::bit_cast<std::uint32_t>(value));
  return bits;
}

std::size_t differing_pixels(const Image& a, const Image& b) {
  const std::vector<std::uint32_t> x = bits_of(a), y = bits_of(b);
  std::size_t count = x.size() == y.size() ? 0 : ~std::size_t{0};
  for (std::size_t i = 0; i < x.size() && count != ~std::size_t{0}; i += 4)
    count += std::equal(x.begin() + i, x.begin() + i + 4, y.begin() + i) ? 0 : 1;
  return count;
}

/// Means over pixels that meet a light.
struct Work {
  double met = 0, reaching = 0;
  std::size_t lost = 0, lit = 0;  // pixels
};

Work work_of(const Image& count, const Image& reference_count) {
  Work work;
  std::size_t surfaces = 0;
  for (std::size_t i = 0; i < count.pixels.size(); i += count.channels) {
    if (reference_count.pixels[i] == 0.0F && count.pixels[i] == 0.0F) continue;
    ++surfaces;
    work.met += static_cast<double>(count.pixels[i]);
    work.reaching += static_cast<double>(count.pixels[i + 1]);
    work.lost += count.pixels[i + 1] != reference_count.pixels[i + 1] ? 1 : 0;
    work.lit += reference_count.pixels[i + 1] > 0.0F ? 1 : 0;
  }
  work.met /= std::max<double>(1, static_cast<double>(surfaces));
  work.reaching /= std::max<double>(1, static_cast<double>(surfaces));
  return work;
}

/// The picture of `scene` by tiled is the reference's in bits, and each pixel meets every light that reaches it.
/// `frames`: lists have all the room that they want from the second on. Answers the work.
Work expect_the_reference(Scene& scene, const Settings& s, const std::string& what, int frames = 1) {
  Settings reference = s;
  reference.technique = "brute_force";
  const Image expected = graph_of(reference).image(scene);
  const Image expected_count = graph_of(reference).read("counted.count");
  Work work;
  for (int frame = 0; frame < frames; ++frame) {
    const Image image = graph_of(s).image(scene);
    EXPECT_EQ(differing_pixels(image, expected), 0U) << what << ", " << s.lighting << ", frame " << frame;
    work = work_of(graph_of(s).read("counted.count"), expected_count);
    EXPECT_EQ(work.lost, 0U) << what << ", frame " << frame;
  }
  return work;
}

/// A floor, pillars near and far, a ball, and sky above; lengths times `unit`.
void add_surfaces(Scene& scene, double unit = 1.0) {
  HeddleMaterial record = Scene::grey();
  record.roughness = 0.6F;
  scene.use_material(record);
  scene.add_floor(dvec3(0, -1, -6) * unit, 14.0 * unit);
  scene.add_box(dvec3(-1.6, -1, -3.2) * unit, dvec3(-1.2, 1.5, -2.8) * unit);
  scene.add_box(dvec3(0.5, -1, -9.0) * unit, dvec3(1.5, 1.0, -8.0) * unit);
  scene.add_box(dvec3(2.2, -1, -5.0) * unit, dvec3(2.4, 2.5, -4.8) * unit);
  scene.add_sphere(dvec3(0, -0.4, -4.5) * unit, 0.6 * unit, 24);
}

HeddleLight random_light(Random& random, double unit = 1.0) {
  const std::uint32_t type = random.below(9);
  HeddleLight record = light(type, random.direction(), random.uniform(0.5, 20.0));
  if (type != HEDDLE_LIGHT_DIRECTIONAL) {
    record.range = static_cast<float>(random.below(12) == 0 ? 0.0 : unit * random.log_uniform(0.05, 12.0));
    record.radius = static_cast<float>(unit * random.log_uniform(0.01, 0.5));
  }
  record.segment_length = static_cast<float>(unit * random.uniform(0.0, 2.0));
  for (float& half : record.half_extent) half = static_cast<float>(unit * random.log_uniform(0.05, 2.0));
  record.cos_outer = static_cast<float>(std::cos(random.uniform(0.02, 2.0)));
  record.cos_inner = record.cos_outer + static_cast<float>(random.uniform(-0.1, 0.3));
  // Some lights are as hard at their edges as they can be: there a rounding would show.
  if (type == HEDDLE_LIGHT_BOX && random.below(2) == 0) record.radius = 0.0F;
  for (float& channel : record.intensity) channel *= static_cast<float>(random.uniform(0.2, 1.0));
  return record;
}

/// In front of the camera, behind it and around it.
dvec3 random_place(Random& random) {
  return {random.uniform(-6, 6), random.uniform(-1.2, 3), random.uniform(-14, 3)};
}

TEST(LightAssignment, H1WithoutLightsNoCommandIsRecordedAndNoLibraryOpened) {
  const auto stats_of = [](const std::string& technique) {
    Scene scene;
    add_surfaces(scene);
    scene.look({0, 0, 0}, {0, -0.2, -1});
    Settings s;
    s.technique = technique;
    Graph graph(graph_text(s));
    graph.render(scene);
    graph.render(scene);
    const char* text = nullptr;
    check(heddle_stats(graph.handle, &text));
    return parsed::json(text);
  };
  const nlohmann::json none = stats_of("none");
  for (const char* technique : {"brute_force", "tiled"}) {
    const nlohmann::json with = stats_of(technique);
    EXPECT_EQ(with["counters"]["commands"], none["counters"]["commands"]) << technique;
    EXPECT_EQ(with["counters"]["live_buffers"], none["counters"]["live_buffers"]) << technique;
    EXPECT_EQ(with["memory"], none["memory"]) << technique;
    EXPECT_EQ(with["libraries"], none["libraries"]) << technique;
  }
}

TEST(LightAssignment, FewerLightsThanPayRecordNoCommand) {
  const auto dispatches = [](const std::string& technique) {
    Scene scene;
    add_surfaces(scene);
    scene.look({0, 0, 0}, {0, -0.2, -1});
    for (int i = 0; i < 3; ++i) scene.add_light(light(HEDDLE_LIGHT_POINT), {0, 1, -4});
    for (int i = 0; i < 40; ++i) scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL));
    Settings s;
    s.technique = technique;
    s.fewest = "16";
    Graph& graph = graph_of(s);
    graph.render(scene);
    const char* text = nullptr;
    check(heddle_stats(graph.handle, &text));
    return parsed::json(text)["counters"]["dispatches"].get<int>();
  };
  EXPECT_EQ(dispatches("tiled"), dispatches("none"));
}

TEST(LightAssignment, H2LightsBehindAndAroundTheCameraAreMetWhereTheyReach) {
  for (const char* lighting : {"deferred", "forward"}) {
    Settings s;
    s.lighting = lighting;
    for (std::uint32_t type = HEDDLE_LIGHT_POINT; type <= HEDDLE_LIGHT_RECTANGLE; ++type) {
      for (const dvec3& place : {dvec3(0, 0, 0), dvec3(0, 0, 1.5), dvec3(0.1, -0.2, -0.05)}) {
        Scene scene;
        add_surfaces(scene);
        scene.look({0, 0, 0}, {0, -0.2, -1});
        HeddleLight record = light(type, {0, -0.3, -1}, 20.0);
        record.range = 6.0F;
        record.radius = 0.2F;
        record.segment_length = 1.0F;
        record.half_extent[0] = record.half_extent[1] = 1.5F;
        record.half_extent[2] = 5.0F;
        scene.add_light(record, place);
        const Work work = expect_the_reference(scene, s, "type " + std::to_string(type));
        EXPECT_GT(work.lit, 10U) << type << " at " << text_of(place);
      }
    }
  }
}

TEST(LightAssignment, H3RangesOfAThousandthAndOfAMillionGiveTheReference) {
  Random random(3);
  Scene scene;
  add_surfaces(scene);
  scene.look({0, 0, 0}, {0, -0.2, -1});
  for (int i = 0; i < 40; ++i) {
    HeddleLight record = random_light(random);
    record.range = static_cast<float>(std::array{1e-3, 1e-1, 1e2, 1e6}[static_cast<std::size_t>(i) % 4]);
    scene.add_light(record, random_place(random) * (i % 4 == 3 ? 1e3 : 1.0));
  }
  EXPECT_GT(expect_the_reference(scene, {}, "ranges").lit, 100U);
}

TEST(LightAssignment, H4SkyAndDepthsNearAndFarInOneTileLoseNoLight) {
  // The pillar's edges cut tiles; lights stand at it, at the wall behind, and between.
  Scene scene;
  add_surfaces(scene);
  scene.look({0, 0.3, 0}, {0, 0, -1});
  for (int i = 0; i < 60; ++i) {
    HeddleLight record = light(HEDDLE_LIGHT_POINT, {0, -1, 0}, 2.0);
    record.range = 0.8F;
    scene.add_light(record, {-1.4 + 0.06 * i, 0.2, -2.6 - 0.1 * i});
  }
  const Work work = expect_the_reference(scene, {}, "mixed depth");
  EXPECT_GT(work.lit, 100U);
  EXPECT_LT(work.met, 20.0);
}

TEST(LightAssignment, H5OddSizesAndOnePixelGiveTheReference) {
  Random random(5);
  Scene scene;
  add_surfaces(scene);
  scene.look({0, 0, 0}, {0, -0.2, -1});
  for (int i = 0; i < 40; ++i) scene.add_light(random_light(random), random_place(random));
  constexpr std::array<std::uint32_t, 2> kSizes[] = {{1, 1}, {33, 17}, {47, 1}, {1, 31}};
  constexpr const char* kTiles[] = {"16", "8", "32", "8"};
  for (std::size_t i = 0; i < 4; ++i) {
    Settings s;
    s.width = kSizes[i][0];
    s.height = kSizes[i][1];
    s.tile = kTiles[i];
    expect_the_reference(scene, s, std::to_string(s.width) + " x " + std::to_string(s.height));
  }
}

TEST(LightAssignment, H6ConesOfAnyAnglesAndAxesOfAnyLengthGiveTheReference) {
  Random random(6);
  for (const char* lighting : {"deferred", "forward"}) {
    Scene scene;
    add_surfaces(scene);
    scene.look({0, 0, 0}, {0, -0.2, -1});
    for (int i = 0; i < 60; ++i) {
      HeddleLight record = light(std::array{HEDDLE_LIGHT_SPOT, HEDDLE_LIGHT_CONE, HEDDLE_LIGHT_WEDGE, HEDDLE_LIGHT_BOX,
                                            HEDDLE_LIGHT_CAPSULE}[static_cast<std::size_t>(i) % 5],
                                 random.direction(), 10.0);
      record.range = static_cast<float>(random.uniform(0.5, 6.0));
      record.segment_length = 1.0F;
      for (float& half : record.half_extent) half = 0.7F;
      record.cos_outer = std::array{1.0F, -1.0F, -0.5F, 0.0F, 0.999F, 1.5F}[random.below(6)];
      record.cos_inner = std::array{1.0F, -1.0F, 0.5F}[random.below(3)];
      const float length = std::array{1.0F, 0.0F, 0.3F, 2.0F}[random.below(4)];
      for (float& d : record.direction) d *= length;
      const float tangent = std::array{1.0F, 0.0F, 1.5F}[random.below(3)];
      for (float& t : record.tangent) t *= tangent;
      scene.add_light(record, random_place(random));
    }
    Settings s;
    s.lighting = lighting;
    EXPECT_GT(expect_the_reference(scene, s, "degenerate").lit, 100U);
  }
}

TEST(LightAssignment, H7FarFromTheOriginAndInOtherUnitsThePictureIsTheReference) {
  for (const double unit : {1e-3, 1.0, 1e3})
    for (const double distance : {0.0, 1e5}) {
      Random random(7);
      Scene scene(dvec3(distance, 0.0, -distance));
      add_surfaces(scene, unit);
      heddle_camera camera{};
      camera.struct_size = sizeof camera;
      camera.position[0] = distance;
      camera.position[2] = -distance;
      camera.rotation[3] = 1.0;
      camera.vertical_angle = 1.0;
      camera.near_distance = 0.01 * unit;
      std::uint32_t id = 0;
      check(heddle_scene_add_camera(scene.handle, nullptr, &camera, &id));
      check(heddle_scene_use_camera(scene.handle, id));
      for (int i = 0; i < 50; ++i) scene.add_light(random_light(random, unit), random_place(random) * unit);
      // One that is itself 100 km away, and reaches half as far again.
      HeddleLight record = light(HEDDLE_LIGHT_SPOT, {0, 0, 1}, 1e11);
      record.range = 1.5e5F;
      scene.add_light(record, {0, 0, -1e5});
      const Work work = expect_the_reference(scene, {}, "unit " + std::to_string(unit));
      EXPECT_GT(work.lit, 100U);
      EXPECT_LT(work.met, 40.0);
    }
}

class ManyLights : public ::testing::TestWithParam<std::uint32_t> {};
INSTANTIATE_TEST_SUITE_P(Numbers, ManyLights, ::testing::Values(1024U, 65536U));

TEST_P(ManyLights, H8TheLastOneLightsItsPixels) {
  Scene scene;
  add_surfaces(scene);
  scene.look({0, 0, 0}, {0, -0.2, -1});
  HeddleLight record = light(HEDDLE_LIGHT_POINT, {0, -1, 0}, 10.0);
  record.range = 0.1F;
  for (std::uint32_t i = 0; i + 1 < GetParam(); ++i) scene.add_light(record, {50.0 + i % 256, 40.0 + i / 256, 30.0});
  record.range = 4.0F;
  scene.add_light(record, {0, 0.5, -4});
  for (const char* lighting : {"deferred", "forward"}) {
    Settings s;
    s.lighting = lighting;
    s.width = 24;
    s.height = 16;
    s.tile = "8";
    // In the first frame lists have no room for 65,536 lights in 6 tiles; in the second they have.
    s.memory = "0.05";
    const Work work = expect_the_reference(scene, s, "last of many", 2);
    EXPECT_GT(work.lit, 50U);
    EXPECT_EQ(work.met, 1.0);  // of pixels that meet any
  }
}

TEST(LightAssignment, ListsWithoutRoomLoseNoLightAndHaveItInTheNextFrame) {
  Random random(9);
  Scene scene;
  add_surfaces(scene);
  scene.look({0, 0, 0}, {0, -0.2, -1});
  constexpr int kLights = 1500;  // 47 words and 2 of summary for 96 tiles: 38 KB
  for (int i = 0; i < kLights; ++i) {
    HeddleLight record = random_light(random);
    if (record.type == HEDDLE_LIGHT_DIRECTIONAL || record.range == 0.0F) record = light(HEDDLE_LIGHT_POINT);
    record.range = 0.2F;
    for (float& half : record.half_extent) half *= 0.1F;
    scene.add_light(record, random_place(random));
  }
  Settings s;
  s.width = 96;
  s.height = 64;
  s.tile = "8";
  s.memory = "0.01";
  Host::get().log.clear();
  EXPECT_GT(expect_the_reference(scene, s, "room", 2).lit, 200U);
  EXPECT_TRUE(Host::get().log.empty());
}

TEST(LightAssignment, H9SurfacesInFrontOfTheDepthGetTheLightsThere) {
  Random random(10);
  for (int set = 0; set < 4; ++set) {
    Scene scene;
    add_surfaces(scene);
    HeddleMaterial record = Scene::grey();
    record.alpha_mode = HEDDLE_ALPHA_BLEND;
    record.base_color[3] = 0.5F;
    record.flags = HEDDLE_MATERIAL_DOUBLE_SIDED;
    scene.use_material(record);
    for (const float z : {-1.0F, -2.2F, -6.0F})
      scene.add_mesh({-4, -1, z, 4, -1, z, 4, 3, z, -4, 3, z}, {}, {0, 1, 2, 0, 2, 3}, dmat4(1.0));
    scene.look({0, 0, 0}, {0, 0, -1});
    // At the panes, not as far as what is behind them.
    for (int i = 0; i < 40; ++i) {
      HeddleLight lamp = random_light(random);
      if (lamp.type == HEDDLE_LIGHT_DIRECTIONAL) continue;
      lamp.range = 0.7F;
      scene.add_light(lamp, {random.uniform(-1, 1), random.uniform(-0.5, 0.5), random.uniform(-2.4, -0.8)});
    }
    for (const char* lighting : {"deferred", "forward"}) {
      Settings s;
      s.lighting = lighting;
      s.has_transparency = true;
      expect_the_reference(scene, s, "panes");
      // The panes are lit: without lights the picture is another.
      Settings plain = s;
      plain.technique = "none";
      EXPECT_EQ(differing_pixels(graph_of(plain).image(scene), graph_of(s).image(scene)), 0U);
    }
  }
}

TEST(LightAssignment, H10ARandomSetOfLightsGivesTheBitsOfTheReferenceInAHundredCases) {
  Random random(1);
  double met = 0, all = 0, reaching = 0;
  std::size_t lit = 0;
  for (int set = 0; set < 100; ++set) {
    Scene scene;
    add_surfaces(scene);
    scene.look({random.uniform(-1, 1), random.uniform(-0.5, 1), random.uniform(-0.5, 0.5)},
               {random.uniform(-2, 2), random.uniform(-1, 0), -5}, random.uniform(0.4, 1.6));
    const std::uint32_t count = 1 + random.below(100);
    for (std::uint32_t i = 0; i < count; ++i) scene.add_light(random_light(random), random_place(random));
    for (const char* lighting : {"deferred", "forward"}) {
      Settings s;
      s.lighting = lighting;
      const Work work = expect_the_reference(scene, s, "set " + std::to_string(set));
      met += work.met;
      reaching += work.reaching;
      lit += work.lit;
      all += count;
      if (set % 10 != 0) continue;
      // The neutral function meets every light, to the same bits.
      Settings plain = s;
      plain.technique = "none";
      EXPECT_EQ(differing_pixels(graph_of(plain).image(scene), graph_of(s).image(scene)), 0U) << set;
      const Image image = graph_of(s).read();
      for (const float value : image.pixels) ASSERT_TRUE(std::isfinite(value));
    }
  }
  EXPECT_GT(lit, 100000U);
  RecordProperty("all_lights", std::to_string(all / 200));
  RecordProperty("met", std::to_string(met / 200));
  RecordProperty("reaching", std::to_string(reaching / 200));
  EXPECT_LT(met, 0.5 * all);
}

TEST(LightAssignment, ForwardWithoutDepthWalksWholeColumns) {
  Random random(21);
  Scene scene;
  add_surfaces(scene);
  scene.look({0, 0, 0}, {0, -0.2, -1});
  for (int i = 0; i < 60; ++i) scene.add_light(random_light(random), random_place(random));
  Settings s;
  const double with_depth = expect_the_reference(scene, s, "with depth").met;
  s.depth = "none";
  for (const char* lighting : {"deferred", "forward"}) {
    s.lighting = lighting;
    const double columns = expect_the_reference(scene, s, "columns").met;
    EXPECT_GT(columns, with_depth);
    EXPECT_LT(columns, 60.0);
  }
}

TEST(LightAssignment, OrthographicAndJitteredViewsGiveTheReference) {
  Random random(22);
  Scene scene;
  add_surfaces(scene);
  scene.look({0, 0, 0}, {0, -0.2, -1});
  for (int i = 0; i < 60; ++i) scene.add_light(random_light(random), random_place(random));
  Settings s;
  s.is_supersampled = true;
  Settings reference = s;
  reference.technique = "brute_force";
  EXPECT_EQ(differing_pixels(graph_of(s).image(scene), graph_of(reference).image(scene)), 0U);

  heddle_camera camera{};
  camera.struct_size = sizeof camera;
  camera.is_orthographic = 1;
  camera.position[2] = 1.0;
  camera.rotation[3] = 1.0;
  camera.vertical_angle = 2.5;
  std::uint32_t id = 0;
  check(heddle_scene_add_camera(scene.handle, nullptr, &camera, &id));
  check(heddle_scene_use_camera(scene.handle, id));
  for (const char* lighting : {"deferred", "forward"}) {
    Settings parallel;
    parallel.lighting = lighting;
    const Work work = expect_the_reference(scene, parallel, "orthographic");
    EXPECT_GT(work.lit, 100U);
    EXPECT_LT(work.met, 50.0);
  }
}

TEST(LightAssignment, MoreStepsAndSmallerTilesMeetFewerLightsToTheSameBits) {
  Random random(23);
  Scene scene;
  add_surfaces(scene);
  scene.look({0, 0, 0}, {0, -0.2, -1});
  for (int i = 0; i < 100; ++i) scene.add_light(random_light(random), random_place(random));
  double last = 1e9;
  for (const char* steps : {"0", "1", "4", "16"}) {
    Settings s;
    s.steps = steps;
    const double met = expect_the_reference(scene, s, "steps").met;
    EXPECT_LE(met, last);
    last = met;
  }
  last = 1e9;
  for (const char* tile : {"32", "16", "8"}) {
    Settings s;
    s.tile = tile;
    const double met = expect_the_reference(scene, s, "tile").met;
    EXPECT_LT(met, last);
    last = met;
  }
}

TEST(LightAssignment, TheReadmesTableOfParametersIsTheDescriptors) {
  const char* text = nullptr;
  check(heddle_list(Host::get().handle, &text));
  const std::string table = parameter_table(parsed::json(text), "light_assignment/tiled");
  ASSERT_FALSE(table.empty());
  EXPECT_NE(readme_of("light_assignment/tiled").find(table), std::string::npos) << table;
}

}  // namespace
