// SPDX-License-Identifier: Apache-2.0
// The hard cases of role function_image for every technique, and what the images hold.
#include "roles/rendering.hpp"

namespace {

using namespace rendering;

constexpr std::uint32_t kSize = 48;

/// `shadows`: TOML of passes of role shadow; `asked`: which of them the image is of.
std::string shadow_text(const std::string& shadows, const std::string& asked,
                        const std::string& output = "shown.image") {
  return "extent = [48, 48]\noutput = \"" + output +
         "\"\n[[pass]]\nrole = \"gbuffer\"\ntechnique = \"raster\"\nparams.precision = \"float32\"\n" + shadows +
         "[[pass]]\nname = \"material\"\nrole = \"surface_material\"\ntechnique = \"ggx\"\n"
         "[[pass]]\nrole = \"lighting\"\ntechnique = \"deferred\"\n"
         "[[pass]]\nname = \"shown\"\nrole = \"function_image\"\ntechnique = \"shadow\"\n" +
         asked;
}

std::string sky_text(const std::string& sky) {
  return "extent = [48, 48]\noutput = \"shown.image\"\n" + sky +
         "[[pass]]\nrole = \"gbuffer\"\ntechnique = \"raster\"\n"
         "[[pass]]\nname = \"shown\"\nrole = \"function_image\"\ntechnique = \"sky\"\n";
}

/// `provider`: TOML of a pass of role surface_material or light_assignment, whose image is shown.
std::string function_text(const std::string& role, const std::string& provider,
                          const std::string& output = "shown.image") {
  return "extent = [48, 48]\noutput = \"" + output +
         "\"\n[[pass]]\nrole = \"gbuffer\"\ntechnique = \"raster\"\nparams.precision = \"float32\"\n" + provider +
         "[[pass]]\nrole = \"lighting\"\ntechnique = \"deferred\"\nparams.precision = \"float32\"\n"
         "[[pass]]\nname = \"shown\"\nrole = \"function_image\"\ntechnique = \"" +
         role + "\"\n";
}

constexpr const char* kMaps = "[[pass]]\nname = \"maps\"\nrole = \"shadow\"\ntechnique = \"shadow_map\"\n";

/// A box of 2 x 2 m floats 1 m above a floor; the camera looks at the floor from below the box's height.
void look_under_a_box(Scene& scene) {
  scene.add_floor({0, 0, 0}, 20);
  scene.add_box({-1, 1, -1}, {1, 1.2, 1});
  scene.look({0, 0.8, 4}, {0, 0, 0}, 1.0);
}

/// Where the pixel sees the floor; y = 0 where it does not.
dvec3 floor_at(std::uint32_t x, std::uint32_t y) {
  const dvec3 from(0, 0.8, 4);
  const dvec3 forward = glm::normalize(-from);
  const dvec3 right = glm::normalize(glm::cross(forward, dvec3(0, 1, 0)));
  const double half = std::tan(0.5);
  const dvec3 ray = forward + right * ((2.0 * (x + 0.5) / kSize - 1.0) * half) +
                    glm::cross(right, forward) * ((1.0 - 2.0 * (y + 0.5) / kSize) * half);
  return ray.y < -0.02 ? from + ray * (-from.y / ray.y) : dvec3(100.0);
}

TEST(FunctionImage, H1WithoutATechniqueTheNeutralBodyAnswers) {
  Scene scene;
  look_under_a_box(scene);
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL));
  for (const std::string& text : {shadow_text("", ""), shadow_text(kMaps, "functions.shadow = []\n")}) {
    Graph graph(text);
    const Image image = graph.image(scene);
    ASSERT_EQ(image.channels, 1U);
    for (const float value : image.pixels) ASSERT_EQ(value, 1.0F);
  }
  Graph graph(sky_text(""));
  const Image image = graph.image(scene);
  ASSERT_EQ(image.channels, 4U);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) ASSERT_EQ(image.pixels[i], i % 4 == 3 ? 1.0F : 0.0F);
}

TEST(FunctionImage, H1WithoutAMaterialTheImageIsLambertsOfEachLight) {
  Scene scene;
  look_under_a_box(scene);
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0, -1, 0}, 2.0));
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0.6, -0.8, 0}, 3.0));
  Graph graph(function_text("surface_material", ""));
  Graph colors(function_text("surface_material", "", "gbuffer.base_color"));
  const Image image = graph.image(scene);
  const Image base = colors.image(scene);
  int floor_pixels = 0;
  for (std::uint32_t y = kSize / 2 + 1; y < kSize; ++y)
    for (std::uint32_t x = 0; x < kSize; ++x) {
      if (floor_at(x, y).x > 99.0) continue;
      const std::size_t i = 4 * (std::size_t{y} * kSize + x);
      const double expected = base.pixels[i] / 3.14159265358979 * (2.0 + 3.0 * 0.8);
      ASSERT_NEAR(image.pixels[i], expected, 1e-5 * expected) << x << ", " << y;  // octahedral normals: 2e-6
      ++floor_pixels;
    }
  EXPECT_GT(floor_pixels, 500);
}

TEST(FunctionImage, SurfaceMaterialIsLightingWithoutShadows) {
  Scene scene;
  look_under_a_box(scene);
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0.3, -1, 0.2}, 5.0));
  const std::string ggx = "[[pass]]\nname = \"material\"\nrole = \"surface_material\"\ntechnique = \"ggx\"\n";
  Graph graph(function_text("surface_material", ggx));
  Graph lit(function_text("surface_material", ggx, "lighting.radiance"));
  const Image image = graph.image(scene);
  const Image expected = lit.image(scene);
  double sum = 0.0;
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    ASSERT_NEAR(image.pixels[i], expected.pixels[i], 1e-5 * std::max(1.0F, expected.pixels[i])) << i;
    sum += i % 4 == 3 ? 0.0 : image.pixels[i];
  }
  EXPECT_GT(sum, 100.0);
}

TEST(FunctionImage, LightAssignmentIsWhatArrivesAndALostLightIsMissing) {
  Scene scene;
  look_under_a_box(scene);
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0, -1, 0}, 2.0));
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0, 1, 0}, 0.5));  // from below: it arrives, on a plane that faces it
  Graph all(function_text("light_assignment", ""));
  const Image image = all.image(scene);
  ASSERT_EQ(image.channels, 1U);
  EXPECT_NEAR(image.at(kSize / 2, kSize - 1), 2.5, 1e-6);
  EXPECT_EQ(image.at(kSize / 2, 0), 0.0F);
  Graph tiled(function_text("light_assignment", "[[pass]]\nrole = \"light_assignment\"\ntechnique = \"tiled\"\n"));
  EXPECT_EQ(tiled.image(scene).pixels, image.pixels);
}

TEST(FunctionImage, H2IsTheSameWhateverElseIsAskedFor) {
  Scene scene;
  look_under_a_box(scene);
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0.3, -1, 0.2}));
  Graph alone(shadow_text(kMaps, ""));
  Graph beside(shadow_text(kMaps, "", "lighting.radiance"));
  beside.keep("shown.image");
  const Image expected = alone.image(scene);
  beside.render(scene);
  EXPECT_EQ(beside.read("shown.image").pixels, expected.pixels);
}

TEST(FunctionImage, ShadowIsTheMeanOverLightsByWhatTheySend) {
  Scene scene;
  look_under_a_box(scene);
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0, -1, 0}, 1.0));
  HeddleLight through = light(HEDDLE_LIGHT_DIRECTIONAL, {0.6, -0.8, 0}, 3.0);
  through.flags = 0;  // casts no shadow
  scene.add_light(through);
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0, 1, 0}, 1e6));  // from below: it does not arrive
  Graph graph(shadow_text(kMaps, "functions.shadow = [\"maps\"]\n"));
  const Image image = graph.image(scene);
  const double below = 3.0 * 0.8 / (1.0 + 3.0 * 0.8);
  int dark = 0;
  int lit = 0;
  for (std::uint32_t y = 0; y < kSize; ++y)
    for (std::uint32_t x = 0; x < kSize; ++x) {
      const dvec3 p = floor_at(x, y);
      const double edge = std::max(std::abs(p.x), std::abs(p.z)) - 1.0;
      // Nearer to the edge the maps' filter blends.
      if (edge < -0.1 && y > kSize / 2) {
        ASSERT_NEAR(image.at(x, y), below, 1e-5) << x << ", " << y;
        ++dark;
      } else if (edge > 0.1 && p.z > 0.0 && p.z < 4.0) {
        // A weighted mean of ones: dividing by the weights may be off by 2.5 units in the last place.
        ASSERT_NEAR(image.at(x, y), 1.0F, 3 * 0x1p-23) << x << ", " << y;
        ++lit;
      }
    }
  EXPECT_GT(dark, 15);
  EXPECT_GT(lit, 50);
}

TEST(FunctionImage, SkyIsWhatEachRayMeetsWhateverStandsBeforeIt) {
  Scene scene;
  look_under_a_box(scene);
  Graph graph(sky_text("[[pass]]\nrole = \"sky\"\ntechnique = \"uniform\"\nparams.radiance = [1.5, 2.5, 3.5]\n"));
  const Image image = graph.image(scene);
  for (std::size_t i = 0; i < image.pixels.size(); i += 4) {
    ASSERT_EQ(image.pixels[i], 1.5F);
    ASSERT_EQ(image.pixels[i + 1], 2.5F);
    ASSERT_EQ(image.pixels[i + 2], 3.5F);
  }
}

}  // namespace
