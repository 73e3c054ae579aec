// SPDX-License-Identifier: Apache-2.0
// Textures that are taken finer because a pixel has many samples: which level is taken, by textures that show it, and
// what that is worth.
#include "roles/antialiasing/samples.hpp"
#include "shared/camera_loop.hpp"

#include <iostream>
#include <map>

namespace {

using namespace antialiasing;

constexpr int kSize = 32;

/// A wall of 2 x 2 m whose uv counts metres, seen from 1 m so that the picture is 1 m high.
void add_wall(Scene& scene, float uv_offset = 0.0F) {
  const float a = -1.0F + uv_offset, b = 1.0F + uv_offset;
  scene.add_mesh({-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0}, {}, {0, 1, 2, 0, 2, 3}, dmat4(1.0),
                 {a, b, b, b, b, a, a, a});
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0, 0, -1}, 3.0));
  scene.look({0, 0, 1}, {0, 0, 0}, 2 * std::atan(0.5));
}

/// Squares of so many texels, white and black, opaque and not, in a texture of `size` texels.
std::uint32_t add_checker(Scene& scene, std::uint32_t size, std::uint32_t square) {
  std::vector<std::uint8_t> texels(std::size_t{4} * size * size);
  for (std::uint32_t y = 0; y < size; ++y)
    for (std::uint32_t x = 0; x < size; ++x)
      std::fill_n(texels.begin() + std::ptrdiff_t{4} * (y * size + x), 4, (x / square + y / square) % 2 == 0 ? 255 : 0);
  heddle_texture texture{};
  texture.struct_size = sizeof texture;
  texture.width = texture.height = size;
  texture.rgba = texels.data();
  std::uint32_t id = 0;
  check(heddle_scene_add_texture(scene.handle, nullptr, &texture, &id));
  return id;
}

/// All samples in the centre of the pixel, so that nothing but the level differs; what passes made is of the last one.
std::vector<std::string> still_samples(int count, double share, const std::vector<std::string>& more = {}) {
  std::vector<std::string> settings =
      at_once("multiframe", count, {"aa.params.radius=1e-6", "aa.params.texture_lod_bias=" + std::to_string(share)});
  settings.insert(settings.end(), more.begin(), more.end());
  return settings;
}

double linear(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

TEST(TextureLodBias, IsOfTheSamplesNumberButInTheFirst) {
  EXPECT_EQ(sampling::sample_lod_bias(0, 64, 1), 0);
  EXPECT_EQ(sampling::sample_lod_bias(1, 64, 1), -3);
  EXPECT_EQ(sampling::sample_lod_bias(63, 64, 0.5), -1.5);
  EXPECT_EQ(sampling::sample_lod_bias(1, 64, 0), 0);
  EXPECT_EQ(sampling::sample_lod_bias(1, 65536, 1), -8);
}

TEST(TextureLodBias, TakesTheLevelThatTheNumberOfSamplesAllows) {
  // A pixel is 32 texels wide, which is level 5, and squares are of 16: level 5 is grey, level 4 is white in the
  // middles of pixels, and trilinear filters mix the two as the level's fraction says; lavapipe's is off by up to 0.1.
  Scene scene;
  HeddleMaterial white = Scene::grey();
  std::fill_n(white.base_color, 3, 1.0F);
  scene.use_material(white, add_checker(scene, 1024, 16));
  add_wall(scene, 8.0F / 1024);
  const auto base_color = [&](const std::vector<std::string>& settings) {
    Graph graph(scene_text(kSize), settings);
    graph.keep("gbuffer.base_color");
    graph.render(scene);
    const Image image = graph.read("gbuffer.base_color");
    for (std::uint32_t i = 4; i < 28; ++i) EXPECT_NEAR(image.at(i, 31 - i), image.at(16, 16), 1.0 / 255) << i;
    return linear(image.at(16, 16));
  };
  EXPECT_NEAR(base_color(still_samples(1, 1)), 0.5, 0.01);
  EXPECT_NEAR(base_color(still_samples(2, 1)), 0.75, 0.06) << "level 4.5";
  EXPECT_NEAR(base_color(still_samples(4, 1)), 1.0, 0.01) << "level 4";
  EXPECT_NEAR(base_color(still_samples(4, 0.5)), 0.75, 0.06);
  EXPECT_NEAR(base_color(still_samples(16, 1)), 1.0, 0.01) << "level 3 has the same squares";
  EXPECT_NEAR(base_color(still_samples(16, 0)), 0.5, 0.01);
}

TEST(TextureLodBias, HoldsForForwardLightingAndForHolesInItsDepthToo) {
  // Light along the normal and no reflection beside the diffuse one: radiance is as bright as the texture.
  float lit = 0;  // of white
  for (const std::uint32_t mode : {HEDDLE_ALPHA_OPAQUE, HEDDLE_ALPHA_MASK}) {
    Scene scene;
    HeddleMaterial white = Scene::grey();
    std::fill_n(white.base_color, 3, 1.0F);
    white.ior = 1.0F;
    white.alpha_mode = mode;
    white.alpha_cutoff = 0.75F;  // grey is a hole, white is none
    scene.use_material(white, add_checker(scene, 1024, 16));
    add_wall(scene, 8.0F / 1024);
    const auto seen = [&](double share, bool is_forward) {
      std::vector<std::string> more;
      if (is_forward) more = {"lighting.technique=forward"};
      Graph graph(scene_text(kSize), still_samples(16, share, more));
      // The mean has one sample without bias.
      return graph.image(scene).at(16, 16);
    };
    for (const bool is_forward : {false, true}) {
      const float coarse = seen(0, is_forward), fine = seen(1, is_forward);
      if (mode == HEDDLE_ALPHA_MASK) {
        EXPECT_NEAR(fine, (coarse + 15 * lit) / 16, 0.02 * lit) << is_forward;  // all of coarse look through holes
        EXPECT_GT(std::abs(coarse - lit), 0.1 * lit) << is_forward;
      } else {
        EXPECT_NEAR(fine / coarse, (15 * 1.0 + 0.5) / 16 / 0.5, 0.05) << (is_forward ? "forward" : "deferred");
        lit = fine * 16 / 15.5F;
      }
    }
    EXPECT_NEAR(seen(1, true), seen(1, false), 0.01 * seen(1, false)) << "alpha mode " << mode;
  }
}

TEST(TextureLodBias, AsksForFinerTexelsOfTexturesThatAreNoImages) {
  // 24 texels a pixel: level ceil(log2 24) = 5, and one less for each factor 4 of samples.
  const std::string source =
      "[[pass]]\nname = \"source\"\nrole = \"texture_source\"\ntechnique = \"resident\"\nbefore = \"gbuffer\"\n"
      "params.filtering = \"nearest\"\nparams.anisotropy = 1\nparams.bias = 0\n";
  Scene scene;
  HeddleMaterial white = Scene::grey();
  std::fill_n(white.base_color, 3, 1.0F);
  scene.use_material(white);
  check(heddle_scene_set_component(scene.handle, HEDDLE_OWNER_MATERIAL, 1, "texture_source.virtual",
                                   R"({"source": "uvgrid", "extent": 8192, "chart_size": 1024})"));
  // 1 m is 768 texels: uv counts 4/3 m.
  const float h = 0.75F;
  scene.add_mesh({-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0}, {}, {0, 1, 2, 0, 2, 3}, dmat4(1.0),
                 {0, 2 * h, 2 * h, 2 * h, 2 * h, 0, 0, 0});
  scene.look({0, 0, 1}, {0, 0, 0}, 2 * std::atan(0.5));
  const auto level = [&](int count, double share) {
    Graph graph(scene_text(kSize) + source, still_samples(count, share));
    graph.keep("gbuffer.base_color");
    graph.render(scene);
    const Image image = graph.read("gbuffer.base_color");
    // 24 bits: x and y modulo 1024, then the level.
    return std::lround(image.at(9, 20, 2) * 255) >> 4;
  };
  EXPECT_EQ(level(1, 1), 5);
  EXPECT_EQ(level(4, 1), 4);
  EXPECT_EQ(level(16, 1), 3);
  EXPECT_EQ(level(16, 0.5), 4);
  EXPECT_EQ(level(16, 0), 5);
}

TEST(TextureLodBias, IsTheSameInBothTechniques) {
  Scene scene;
  scene.use_material(Scene::grey(), add_checker(scene, 256, 4));
  add_wall(scene);
  Graph reference(scene_text(kSize), {samples(7)});
  Graph graph(scene_text(kSize), at_once("multiframe", 7, {"aa.params.kernel=r2", "aa.params.centred=false"}));
  EXPECT_EQ(graph.image(scene).pixels, reference.image(scene).pixels);
  Graph without(scene_text(kSize), {samples(7), "aa.params.texture_lod_bias=0"});
  EXPECT_NE(without.image(scene).pixels, reference.image(scene).pixels);
}

TEST(TextureLodBias, LowersTheErrorOfACheckeredFloorUpToTheHorizon) {
  Scene scene;
  HeddleMaterial white = Scene::grey();
  std::fill_n(white.base_color, 3, 1.0F);
  scene.use_material(white, add_checker(scene, 64, 32));
  constexpr float kHalf = 200;
  scene.add_mesh({-kHalf, 0, -kHalf, -kHalf, 0, kHalf, kHalf, 0, kHalf, kHalf, 0, -kHalf}, {}, {0, 1, 2, 0, 2, 3},
                 dmat4(1.0), {0, 0, 0, kHalf, kHalf, kHalf, kHalf, 0});
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {-0.4, -1.0, -0.3}, 3.0));
  scene.look({0.3, 1.5, 0.2}, {10, 0.7, 3}, 0.8);
  const auto seen = [&](int count, double share) {
    Graph graph(scene_text(64), {samples(count), "aa.params.texture_lod_bias=" + std::to_string(share)});
    return graph.image(scene);
  };
  const Image truth = seen(1024, 1);
  std::map<std::pair<int, double>, double> errors;
  for (const int count : {4, 16, 64}) {
    std::cout << "| " << count;
    for (const double share : {0.0, 0.5, 1.0}) {
      const Image image = seen(count, share);
      double squares = 0, power = 0;
      for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        if (i % 4 == 3) continue;
        squares += std::pow(image.pixels[i] - truth.pixels[i], 2);
        power += std::pow(truth.pixels[i], 2);
      }
      errors[{count, share}] = std::sqrt(squares / power);
      std::cout << " | " << errors[{count, share}];
    }
    std::cout << " |\n";
  }
  for (const int count : {4, 16, 64}) EXPECT_LT((errors[{count, 1.0}]), (errors[{count, 0.0}])) << count;
  // Without it the error of the filters stays, however many samples there are.
  EXPECT_GT((errors[{64, 0.0}]), (0.5 * errors[{16, 0.0}]));
  EXPECT_LT((errors[{64, 1.0}]), (0.6 * errors[{16, 1.0}]));
}

}  // namespace
