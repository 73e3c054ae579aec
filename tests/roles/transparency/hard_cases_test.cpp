// SPDX-License-Identifier: Apache-2.0
// The hard cases of role transparency for transparency/sorted, over lighting/deferred and lighting/forward.
#include "parsed.hpp"
#include "roles/rendering.hpp"

#include <nlohmann/json.hpp>

#include <map>

namespace {

using namespace rendering;

struct Options {
  std::string lighting = "deferred", precision = "float32", order = "triangles";
  bool has_sky = false, has_shadow = false, has_transparency = true;
};

std::string graph_text(const Options& options, std::uint32_t size = 32) {
  const std::string extent = std::to_string(size);
  return "extent = [" + extent + ", " + extent + "]\noutput = \"" +
         (options.has_transparency ? "transparency.radiance" : "lighting.radiance") +
         "\"\n[[pass]]\nname = \"material\"\nrole = \"surface_material\"\ntechnique = \"ggx\"\n" +
         (options.has_sky ? "[[pass]]\nrole = \"sky\"\ntechnique = \"uniform\"\n" : "") +
         "[[pass]]\nrole = \"gbuffer\"\ntechnique = \"raster\"\nparams.precision = \"float32\"\n" +
         (options.has_shadow ? "[[pass]]\nrole = \"shadow\"\ntechnique = \"shadow_map\"\n" : "") +
         "[[pass]]\nrole = \"lighting\"\ntechnique = \"" + options.lighting + "\"\nparams.precision = \"" +
         options.precision + "\"\n" +
         (options.has_transparency
              ? "[[pass]]\nrole = \"transparency\"\ntechnique = \"sorted\"\nparams.order = \"" + options.order + "\"\n"
              : "");
}

/// Sends `radiance` and reflects nothing; `coverage` below 0: opaque.
HeddleMaterial glow(double radiance, double coverage) {
  HeddleMaterial record = Scene::grey();
  record.flags = HEDDLE_MATERIAL_UNLIT | HEDDLE_MATERIAL_DOUBLE_SIDED;
  for (int i = 0; i < 3; ++i) record.base_color[i] = static_cast<float>(radiance);
  record.base_color[3] = static_cast<float>(std::max(coverage, 0.0));
  if (coverage >= 0.0) record.alpha_mode = HEDDLE_ALPHA_BLEND;
  return record;
}

/// Graphs that stay, by their text: what a graph compiles serves all its scenes. They end before their host, which was
/// registered first.
struct Graphs : testing::Environment {
  static inline std::map<std::string, Graph> made;
  void TearDown() override { made.clear(); }
};
const auto* const graphs = testing::AddGlobalTestEnvironment(new Graphs);

Image rendered(Scene& scene, const Options& options = {}, std::uint32_t size = 32) {
  const std::string text = graph_text(options, size);
  return Graphs::made.try_emplace(text, text).first->second.image(scene);
}

double middle(const Image& image, std::uint32_t channel = 0) {
  return static_cast<double>(image.at(image.width / 2, image.height / 2, channel));
}

TEST(Transparency, H1EqualLayersAddUpToTheClosedForm) {
  for (const char* order : {"unsorted", "instances", "triangles"})
    for (const int layers : {1, 2, 5, 12})
      for (const double coverage : {0.1, 0.5, 0.9}) {
        Scene scene;
        scene.use_material(glow(0.25, -1));
        scene.add_floor({0, -4, 0}, 20.0);
        scene.use_material(glow(0.75, coverage));
        for (int i = 0; i < layers; ++i) scene.add_floor({0, -3.0 + 0.1 * i, 0}, 10.0);
        scene.look({0, 0, 0}, {0, -1, 0}, 0.5);
        const double a = static_cast<double>(static_cast<float>(coverage));
        const double behind = std::pow(1.0 - a, layers);
        const Image exact = rendered(scene, {.order = order});
        // A float32 rounding for each product and each sum of a layer.
        EXPECT_NEAR(middle(exact), 0.75 * (1.0 - behind) + 0.25 * behind, layers * 2e-7) << layers << " of " << a;
        EXPECT_EQ(middle(exact, 3), 1.0);
        // Into float16 each layer loses up to 2^-10 of the sum, as does the picture behind.
        const Image half = rendered(scene, {.precision = "float16", .order = order});
        EXPECT_NEAR(middle(half), 0.75 * (1.0 - behind) + 0.25 * behind, (layers + 1) * 0.75 / 1024) << layers;
      }
}

TEST(Transparency, H1TheAlphaOfTheBackgroundIsTheShareThatLayersCover) {
  Scene scene;
  scene.use_material(glow(0.5, 0.25));
  for (const double height : {-3.0, -2.0, -1.0}) scene.add_floor({0, height, 0}, 10.0);
  scene.look({0, 0, 0}, {0, -1, 0}, 0.5);
  EXPECT_NEAR(middle(rendered(scene), 3), 1.0 - 0.75 * 0.75 * 0.75, 3e-7);
}

TEST(Transparency, H2CoverageZeroChangesNoBit) {
  const auto image = [](bool has_layer, const std::string& precision) {
    Scene scene;
    scene.add_floor({0, -4, 0}, 2.0);  // and background around it
    HeddleMaterial record = glow(0.5, 0.0);
    record.flags = 0;
    record.emissive[0] = 1000.0F;
    scene.use_material(record);
    if (has_layer) scene.add_floor({0, -3, 0}, 10.0);
    scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0.3, -1, 0.1}, 7.0));
    scene.look({0, 0, 0}, {0, -1, 0}, 1.5);
    return rendered(scene, {.precision = precision, .has_sky = true, .has_transparency = has_layer});
  };
  for (const char* precision : {"float16", "float32"})
    EXPECT_EQ(image(true, precision).pixels, image(false, precision).pixels);
}

TEST(Transparency, H3CoverageOneIsThePictureOfTheOpaqueSurface) {
  const auto image = [](std::uint32_t alpha_mode, const std::string& lighting) {
    Scene scene;
    HeddleMaterial record = Scene::grey();
    record.roughness = 0.4F;
    record.metalness = 0.3F;
    record.emissive[1] = 0.1F;
    record.alpha_mode = alpha_mode;
    scene.use_material(record);
    scene.add_sphere({0, 0, -3}, 1.0, 48);
    scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0.3, -1, -0.4}, 3.0));
    scene.look({0, 0, 0}, {0, 0, -1}, 0.9);
    return rendered(scene,
                    {.lighting = lighting, .has_sky = true, .has_transparency = alpha_mode == HEDDLE_ALPHA_BLEND}, 64);
  };
  const Image blended = image(HEDDLE_ALPHA_BLEND, "deferred");
  const Image forward = image(HEDDLE_ALPHA_OPAQUE, "forward");
  const Image deferred = image(HEDDLE_ALPHA_OPAQUE, "deferred");
  double worst_forward = 0, worst_deferred = 0;
  int surfaces = 0;
  for (std::size_t i = 0; i < blended.pixels.size(); ++i) {
    surfaces += forward.pixels[i] != 1.0F ? 1 : 0;
    const double value = static_cast<double>(blended.pixels[i]);
    worst_forward =
        std::max(worst_forward, std::abs(value - static_cast<double>(forward.pixels[i])) / std::max(value, 1.0));
    // Position comes from depth there: the specular lobe moves by the rounding of a direction over its width.
    worst_deferred =
        std::max(worst_deferred, std::abs(value - static_cast<double>(deferred.pixels[i])) / std::max(value, 1.0));
  }
  EXPECT_GT(surfaces, 1000);
  // The same text on the same numbers, times 1, plus 0 times what is behind; but in another shader, whose sums the
  // compiler may order otherwise: some roundings of 2^-24.
  EXPECT_LT(worst_forward, 1e-6);
  EXPECT_LT(worst_deferred, 2e-4);
  RecordProperty("against_deferred", std::to_string(worst_deferred * 1e6) + "e-6");
}

TEST(Transparency, H4TheNearerLayerCoversTheFartherOneFromEitherSide) {
  for (const char* order : {"instances", "triangles"})
    for (const bool is_reversed : {false, true})
      for (const double side : {1.0, -1.0}) {
        Scene scene;
        // `upper` is 1, `lower` 0.25; named in either order.
        for (const bool is_upper : {is_reversed, !is_reversed}) {
          scene.use_material(glow(is_upper ? 1.0 : 0.25, 0.5));
          scene.add_floor({0, is_upper ? 1.0 : -1.0, 0}, 10.0);
        }
        scene.look({0, 4 * side, 0}, {0, 0, 0}, 0.5);
        const double near = side > 0 ? 1.0 : 0.25, far = side > 0 ? 0.25 : 1.0;
        EXPECT_NEAR(middle(rendered(scene, {.order = order})), 0.5 * near + 0.25 * far, 1e-6) << order << side;
      }
}

TEST(Transparency, H4TrianglesOfOneMeshComeInOrderToo) {
  for (const bool is_reversed : {false, true})
    for (const double side : {1.0, -1.0}) {
      // Two layers in one mesh: only the order of triangles tells them apart; radiance by vertex colour is not at hand,
      // so one of them is seen through alone where the other has ended.
      Scene scene;
      scene.use_material(glow(0.25, -1));
      scene.add_floor({0, side > 0 ? -4.0 : 4.0, 0}, 20.0);
      HeddleMaterial record = Scene::grey();
      record.flags = HEDDLE_MATERIAL_DOUBLE_SIDED;
      record.alpha_mode = HEDDLE_ALPHA_BLEND;
      record.base_color[3] = 0.5F;
      record.emissive[0] = 0.0F;
      scene.use_material(record);
      const float y0 = is_reversed ? 1.0F : -1.0F, y1 = -y0;
      // The upper one faces up, the lower one down; light comes from above and below in different strength.
      scene.add_mesh({-9, y0, -9, -9, y0, 9, 9, y0, 9, 9, y0, -9, -9, y1, -9, -9, y1, 9, 9, y1, 9, 9, y1, -9}, {},
                     {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7}, dmat4(1.0));
      HeddleLight lamp = light(HEDDLE_LIGHT_BOX, {0, -side, 0}, 10.0);
      lamp.half_extent[0] = lamp.half_extent[1] = 20.0F;
      lamp.half_extent[2] = 0.5F;
      scene.add_light(lamp, {0, 1.0, 0});  // lights the layer at y = 1 alone
      scene.look({0, 4 * side, 0}, {0, 0, 0}, 0.5);
      const Image both = rendered(scene);
      // The lit layer alone, in front or behind: L over black, over the floor.
      const bool is_lit_nearer = side > 0;
      const double lit = is_lit_nearer ? 2.0 * (middle(both) - 0.25 * 0.25)   // 0.5 L + 0.25 0 + 0.25 floor
                                       : 4.0 * (middle(both) - 0.25 * 0.25);  // 0.25 L + 0.5 0 + 0.25 floor
      Scene alone;
      record.alpha_mode = HEDDLE_ALPHA_OPAQUE;
      alone.use_material(record);
      alone.add_floor({0, 1, 0}, 9.0);
      alone.add_light(lamp, {0, 1.0, 0});
      alone.look({0, 4 * side, 0}, {0, 0, 0}, 0.5);
      const double opaque = middle(rendered(alone, {.has_transparency = false}));
      EXPECT_GT(opaque, 0.5);
      EXPECT_NEAR(lit, opaque, 1e-4 * opaque) << "side " << side << " reversed " << is_reversed;
    }
}

TEST(Transparency, H5LayersBehindOpaqueSurfacesAreHidden) {
  for (const char* lighting : {"deferred", "forward"}) {
    Scene scene;
    scene.use_material(glow(0.25, -1));
    scene.add_floor({0, -2, 0}, 20.0);
    scene.use_material(glow(1.0, 0.5));
    scene.add_floor({0, -3, 0}, 20.0);
    scene.look({0, 0, 0}, {0, -1, 0}, 0.5);
    EXPECT_EQ(middle(rendered(scene, {.lighting = lighting})), 0.25);
    scene.add_floor({0, -1, 0}, 20.0);
    EXPECT_NEAR(middle(rendered(scene, {.lighting = lighting})), 0.625, 1e-6);
  }
}

TEST(Transparency, H6ShadowsDarkenBlendedSurfacesAsTheyDoOpaqueOnes) {
  const auto image = [](std::uint32_t alpha_mode) {
    Scene scene;
    HeddleMaterial record = Scene::grey();
    record.alpha_mode = alpha_mode;
    scene.use_material(record);
    scene.add_floor({0, -3, 0}, 10.0);
    scene.use_material(Scene::grey());
    scene.add_box({-0.5, -2, -0.5}, {0.5, -1.8, 0.5});
    scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0.5, -1, 0.2}, 3.0));
    scene.look({0, 0, 0}, {0, -1, 0}, 1.2);
    return rendered(scene, {.has_shadow = true, .has_transparency = alpha_mode == HEDDLE_ALPHA_BLEND}, 64);
  };
  const Image blended = image(HEDDLE_ALPHA_BLEND), opaque = image(HEDDLE_ALPHA_OPAQUE);
  int dark = 0;
  for (std::uint32_t y = 0; y < 64; ++y)
    for (std::uint32_t x = 0; x < 64; ++x) {
      // A lookup in the map differs by the rounding of the position: a step of the filter's weight, not of a texel.
      EXPECT_NEAR(blended.at(x, y), opaque.at(x, y), 1e-3F) << x << ", " << y;
      dark += opaque.at(x, y) < 0.05F ? 1 : 0;
    }
  EXPECT_GT(dark, 50);
  EXPECT_LT(dark, 1500);
}

TEST(Transparency, H7ClearWhiteDielectricsVanishInTheWhiteFurnace) {
  Scene scene;
  for (int i = 0; i < 4; ++i) {
    HeddleMaterial record = Scene::grey();
    record.base_color[0] = record.base_color[1] = record.base_color[2] = 1.0F;
    record.flags = HEDDLE_MATERIAL_DOUBLE_SIDED;
    record.roughness = 0.1F + 0.3F * static_cast<float>(i);
    record.transmission = i == 3 ? 0.5F : 1.0F;
    scene.use_material(record);
    scene.add_sphere({i - 1.5, 0.2 * i, -5.0 - i}, 0.8, 64);
  }
  scene.look({0, 0, 0}, {0, 0, -1}, 0.7);
  const Image image = rendered(scene, {.has_sky = true}, 96);
  double worst = 0;
  int covered = 0;
  for (std::uint32_t y = 0; y < 96; ++y)
    for (std::uint32_t x = 0; x < 96; ++x) {
      covered += image.at(x, y, 3) == 1.0F ? 1 : 0;
      for (std::uint32_t c = 0; c < 3; ++c)
        worst = std::max(worst, std::abs(static_cast<double>(image.at(x, y, c)) - 1.0));
    }
  EXPECT_GT(covered, 1000);
  EXPECT_LT(worst, 1e-5);  // up to eight layers of float32 sums of two albedos that add up to 1
  RecordProperty("worst", std::to_string(worst * 1e6) + "e-6");
}

TEST(Transparency, TintIsTheBaseColourTimesWhatTheSpecularLayerLeaves) {
  Scene scene;
  scene.use_material(glow(0.5, -1));
  scene.add_floor({0, -4, 0}, 20.0);
  HeddleMaterial record = Scene::grey();
  record.base_color[0] = 1.0F;
  record.base_color[1] = 0.25F;
  record.base_color[2] = 0.0F;
  record.roughness = 0.2F;
  record.transmission = 1.0F;
  scene.use_material(record);
  scene.add_floor({0, -3, 0}, 10.0);
  scene.look({0, 0, 0}, {0, -1, 0}, 0.1);
  const Image image = rendered(scene);
  // Reflectance of glass at normal incidence, 0.04, of which the lobe of roughness 0.2 returns nearly all.
  EXPECT_NEAR(middle(image, 0), 0.5 * 0.96, 5e-4);
  EXPECT_NEAR(middle(image, 1), 0.25 * middle(image, 0), 1e-6);
  EXPECT_EQ(middle(image, 2), 0.0);
}

TEST(Transparency, H8ScenesWithoutBlendedSurfacesPayNothing) {
  const auto run = [](bool has_transparency, Image& image) {
    Scene scene;
    scene.add_sphere({0, 0, -3}, 1.0, 16);
    scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0.3, -1, -0.4}, 3.0));
    scene.look({0, 0, 0}, {0, 0, -1}, 0.9);
    const std::string display = "[[pass]]\nrole = \"display\"\ntechnique = \"linear\"\n";
    std::string text = graph_text({.has_sky = true, .has_transparency = has_transparency}) + display;
    const std::string output = has_transparency ? "transparency.radiance" : "lighting.radiance";
    text.replace(text.find(output), output.size(), "display.color");
    Graph graph(text);
    image = graph.image(scene);
    const char* stats = nullptr;
    check(heddle_stats(graph.handle, &stats));
    nlohmann::json json = parsed::json(stats);
    for (const char* of_the_process : {"pipelines_total", "pipeline_total_ms"}) json["counters"].erase(of_the_process);
    return std::pair(json["counters"], std::pair(json["libraries"], json["memory"]));
  };
  Image with, without;
  const auto counted_with = run(true, with), counted_without = run(false, without);
  EXPECT_EQ(with.pixels, without.pixels);
  EXPECT_EQ(counted_with.first, counted_without.first);
  EXPECT_EQ(counted_with.second, counted_without.second);
}

}  // namespace
