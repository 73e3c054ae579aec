// SPDX-License-Identifier: Apache-2.0
// The hard cases of role lighting for lighting/deferred and lighting/forward over gbuffer/raster and
// surface_material/ggx, and closed forms of what they add up: one light on one surface, mirror images of area lights,
// emission, unlit surfaces.
#include "roles/rendering.hpp"

#include <dlfcn.h>
#include <heddle/plugin.h>
#include <heddle/services.h>

#include <limits>

namespace {

using namespace rendering;

/// All tests run for every technique of the role.
class Lighting : public ::testing::TestWithParam<const char*> {
 protected:
  static std::string graph_text(std::uint32_t width, std::uint32_t height, bool has_sky);
};
INSTANTIATE_TEST_SUITE_P(Techniques, Lighting, ::testing::Values("deferred", "forward"),
                         [](const auto& test) { return std::string(test.param); });

std::string Lighting::graph_text(std::uint32_t width, std::uint32_t height, bool has_sky) {
  return "extent = [" + std::to_string(width) + ", " + std::to_string(height) +
         "]\noutput = \"lighting.radiance\"\n"
         "[[pass]]\nname = \"material\"\nrole = \"surface_material\"\ntechnique = \"ggx\"\n" +
         std::string(has_sky ? "[[pass]]\nname = \"sky\"\nrole = \"sky\"\ntechnique = \"uniform\"\n" : "") +
         "[[pass]]\nname = \"gbuffer\"\nrole = \"gbuffer\"\ntechnique = \"raster\"\nparams.precision = \"float32\"\n"
         "[[pass]]\nname = \"lighting\"\nrole = \"lighting\"\ntechnique = \"" +
         GetParam() + "\"\nparams.precision = \"float32\"\n";
}

HeddleMaterial white(double roughness, double metalness) {
  HeddleMaterial record = Scene::grey();
  record.base_color[0] = record.base_color[1] = record.base_color[2] = 1.0F;
  record.roughness = static_cast<float>(roughness);
  record.metalness = static_cast<float>(metalness);
  return record;
}

dvec3 decode_octahedral(double x, double y) {
  dvec3 v(x, y, 1.0 - std::abs(x) - std::abs(y));
  const double fold = std::max(-v.z, 0.0);
  v.x -= std::copysign(fold, v.x);
  v.y -= std::copysign(fold, v.y);
  return glm::normalize(v);
}

/// From the camera at the origin that looks along -Z.
dvec3 view_ray(const Image& image, std::uint32_t x, std::uint32_t y, double vertical_angle) {
  const double half = std::tan(0.5 * vertical_angle);
  return glm::normalize(dvec3((2.0 * (x + 0.5) / image.width - 1.0) * half * image.width / image.height,
                              (1.0 - 2.0 * (y + 0.5) / image.height) * half, -1.0));
}

TEST_P(Lighting, H1WhiteFurnaceShowsOneWithinOnePercent) {
  Scene scene;
  const double roughness[] = {0.0, 0.1, 0.3, 0.6, 1.0}, metalness[] = {0.0, 0.5, 1.0};
  for (int i = 0; i < 5; ++i)
    for (int j = 0; j < 3; ++j) {
      scene.use_material(white(roughness[i], metalness[j]));
      scene.add_sphere({i - 2.0, j - 1.0, -6.0}, 0.45, 96);
    }
  scene.look({0, 0, 0}, {0, 0, -1}, 0.6);
  Graph graph(graph_text(320, 192, true));
  graph.keep("gbuffer.normal");
  const Image radiance = graph.image(scene);
  const Image normal = graph.read("gbuffer.normal");
  int surfaces = 0;
  double worst = 0.0;
  for (std::uint32_t y = 0; y < radiance.height; ++y)
    for (std::uint32_t x = 0; x < radiance.width; ++x) {
      const bool is_surface = radiance.at(x, y, 3) == 1.0F;
      const dvec3 N =
          decode_octahedral(static_cast<double>(normal.at(x, y, 0)), static_cast<double>(normal.at(x, y, 1)));
      if (is_surface && -glm::dot(N, view_ray(radiance, x, y, 0.6)) < 0.05) continue;
      surfaces += is_surface ? 1 : 0;
      for (std::uint32_t channel = 0; channel < 3; ++channel) {
        const double value = static_cast<double>(radiance.at(x, y, channel));
        worst = std::max(worst, std::abs(value - 1.0));
        ASSERT_NEAR(value, 1.0, 0.01) << x << ", " << y;  // the role's bound
      }
    }
  EXPECT_GT(surfaces, 10000);
  RecordProperty("worst", std::to_string(worst * 1e6) + "e-6");
}

TEST_P(Lighting, H1LightFromEverywhereAddsUpToOneLampByLamp) {
  // The same furnace without the environment: directional lights on a Fibonacci sphere, 4 pi / n lux each.
  constexpr int kLights = 1500;
  Graph graph(graph_text(32, 32, false));
  graph.keep("gbuffer.normal");
  for (const double roughness : {0.5, 1.0})
    for (const double metalness : {0.0, 1.0}) {
      Scene scene;
      scene.use_material(white(roughness, metalness));
      scene.add_sphere({0, 0, -3}, 1.0, 96);
      for (int i = 0; i < kLights; ++i) {
        const double z = 1.0 - 2.0 * (i + 0.5) / kLights, phi = i * kPi * (3.0 - std::sqrt(5.0));
        const double r = std::sqrt(1.0 - z * z);
        scene.add_light(
            light(HEDDLE_LIGHT_DIRECTIONAL, {r * std::cos(phi), r * std::sin(phi), z}, 4.0 * kPi / kLights));
      }
      scene.look({0, 0, 0}, {0, 0, -1}, 0.8);
      const Image radiance = graph.image(scene);
      const Image normal = graph.read("gbuffer.normal");
      double worst = 0.0;
      int surfaces = 0;
      for (std::uint32_t y = 0; y < radiance.height; ++y)
        for (std::uint32_t x = 0; x < radiance.width; ++x) {
          const dvec3 N =
              decode_octahedral(static_cast<double>(normal.at(x, y, 0)), static_cast<double>(normal.at(x, y, 1)));
          if (radiance.at(x, y, 3) == 0.0F || -glm::dot(N, view_ray(radiance, x, y, 0.8)) < 0.05) continue;
          ++surfaces;
          worst = std::max(worst, std::abs(static_cast<double>(radiance.at(x, y)) - 1.0));
        }
      EXPECT_GT(surfaces, 300);
      EXPECT_LT(worst, 0.01) << "roughness " << roughness << " metalness " << metalness;
      RecordProperty("worst", std::to_string(worst));
    }
}

TEST_P(Lighting, H2LightIsExactlyZeroBeyondTheRangeAndOutsideTheCone) {
  Graph graph(graph_text(128, 128, false));
  for (const std::uint32_t type : {HEDDLE_LIGHT_POINT, HEDDLE_LIGHT_SPOT, HEDDLE_LIGHT_CONE, HEDDLE_LIGHT_WEDGE,
                                   HEDDLE_LIGHT_BOX, HEDDLE_LIGHT_CAPSULE, HEDDLE_LIGHT_SPHERE}) {
    Scene scene;
    scene.add_floor({0, -1, 0}, 50.0);
    HeddleLight record = light(type, {0, -1, 0}, 100.0);
    record.range = 2.0F;
    record.radius = 0.1F;
    record.segment_length = 0.5F;
    record.half_extent[0] = record.half_extent[1] = 1.0F;
    record.half_extent[2] = 1.5F;
    scene.add_light(record, {0, 0, -6});
    scene.look({0, 0, 0}, {0, 0, -1}, 1.0);
    const Image image = graph.image(scene);
    int lit = 0;
    for (std::uint32_t y = 65; y < 128; ++y)
      for (std::uint32_t x = 0; x < 128; ++x) {
        const dvec3 ray = view_ray(image, x, y, 1.0);
        const dvec3 to_light = dvec3(0, 0, -6) - ray / -ray.y;
        ASSERT_TRUE(std::isfinite(image.at(x, y)));
        // A capsule is nearer by half its segment; 1e-5: the floor's depth in float32.
        const double reach = 2.0 + (type == HEDDLE_LIGHT_CAPSULE || type == HEDDLE_LIGHT_WEDGE ? 0.25 : 0.0) + 1e-5;
        const bool has_cone = type == HEDDLE_LIGHT_SPOT || type == HEDDLE_LIGHT_CONE;
        if (glm::length(to_light) >= reach || (has_cone && to_light.y / glm::length(to_light) < 0.6 - 1e-5)) {
          ASSERT_EQ(image.at(x, y), 0.0F) << "type " << type << " at " << x << ", " << y;
        }
        lit += image.at(x, y) > 0.0F ? 1 : 0;
      }
    EXPECT_GT(lit, 50) << "type " << type;
  }
}

TEST_P(Lighting, H3ALightAtTheSurfaceItselfGivesFiniteRadiance) {
  Graph graph(graph_text(33, 33, false));
  for (std::uint32_t type = HEDDLE_LIGHT_POINT; type <= HEDDLE_LIGHT_RECTANGLE; ++type)
    for (const double roughness : {0.0, 1.0}) {
      Scene scene;
      scene.use_material(white(roughness, 0.5));
      scene.add_floor({0, -1, 0}, 5.0);
      HeddleLight record = light(type, {0, 1, 0}, 1e4);
      record.half_extent[0] = record.half_extent[1] = record.half_extent[2] = 0.5F;
      // The middle pixel of an odd image sees exactly the light's place.
      scene.add_light(record, {0, -1, 0});
      scene.look({0, 0, 0}, {0, -1, 0}, 1.0);
      const Image image = graph.image(scene);
      for (const float value : image.pixels) ASSERT_TRUE(std::isfinite(value) && value >= 0.0F) << "type " << type;
    }
}

TEST_P(Lighting, H4WithoutLightsTheImageIsEmissionAndEnvironment) {
  for (const bool has_sky : {false, true}) {
    Scene scene;
    HeddleMaterial record = white(0.5, 0.0);
    record.emissive[0] = 5.0F;
    record.emissive[1] = 0.25F;
    scene.use_material(record);
    scene.add_floor({0, -1, 0}, 5.0);
    scene.look({0, 0, 0}, {0, -1, 0}, 0.5);
    Graph graph(graph_text(16, 16, has_sky));
    const Image image = graph.image(scene);
    const double environment = has_sky ? 1.0 : 0.0;
    EXPECT_NEAR(static_cast<double>(image.at(8, 8, 0)), 5.0 + environment, 0.01 * environment);
    EXPECT_NEAR(static_cast<double>(image.at(8, 8, 1)), 0.25 + environment, 0.01 * environment);
    EXPECT_NEAR(static_cast<double>(image.at(8, 8, 2)), environment, 0.01 * environment);
  }
}

TEST_P(Lighting, ADirectionalLightGivesTheServicesBrdfTimesItsIrradiance) {
  void* library = dlopen(HEDDLE_BUILD_DIR "/lib/heddle/plugins/surface_material/ggx/ggx.so", RTLD_NOW | RTLD_LOCAL);
  ASSERT_NE(library, nullptr) << dlerror();
  const auto entry = reinterpret_cast<heddle_entry_function>(dlsym(library, "heddle_entry"));
  const auto& service =
      *static_cast<const heddle_surface_material_service*>(entry()->techniques[0]->functions[0].service);
  for (const double roughness : {0.3, 0.8}) {
    Scene scene;
    HeddleMaterial record = Scene::grey();
    record.roughness = static_cast<float>(roughness);
    record.metalness = 0.25F;
    scene.use_material(record);
    scene.add_floor({0, -1, 0}, 50.0);
    const dvec3 direction = glm::normalize(dvec3(0.5, -1, -0.3));
    scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, direction, 10.0));
    scene.look({0, 0, 0}, {0, -1, 0}, 1.2);
    Graph graph(graph_text(32, 32, false));
    const Image image = graph.image(scene);
    heddle_surface_point point{};
    point.struct_size = sizeof point;
    point.base_color[0] = point.base_color[1] = point.base_color[2] = 0.5;
    point.metalness = 0.25;
    point.roughness = roughness;
    point.ior = 1.5;
    for (std::uint32_t y = 0; y < 32; ++y)
      for (std::uint32_t x = 0; x < 32; ++x) {
        // Looking down with -Z up in the image: image right is +X, image up is -Z.
        const dvec3 ray = view_ray(image, x, y, 1.2);
        const double view[3] = {-ray.x, -ray.y, -ray.z};  // axes x, -z, y of the scene
        const double from[3] = {-direction.x, direction.z, -direction.y};
        double f[3];
        service.evaluate(&point, view, from, 0, 1, f);
        const double expected = f[0] * 10.0 * from[2];
        // Float32 directions against a lobe of alpha >= 0.09, and the table's interpolation on the device.
        EXPECT_NEAR(static_cast<double>(image.at(x, y)), expected, 1e-3 * expected) << x << ", " << y;
      }
  }
}

TEST_P(Lighting, AMirrorShowsTheRadianceOfAreaLightsAndNothingBesideThem) {
  for (const std::uint32_t type : {HEDDLE_LIGHT_SPHERE, HEDDLE_LIGHT_RECTANGLE}) {
    Scene scene;
    scene.use_material(white(0.0, 1.0));
    scene.add_floor({0, -1, 0}, 50.0);
    HeddleLight record = light(type, {0, -1, 0}, 10.0);
    record.radius = 0.5F;
    record.half_extent[0] = record.half_extent[1] = 0.5F;
    scene.add_light(record, {0, 2, -4});  // its image is at (0, -4, -4)
    scene.look({0, 0, 0}, {0, -4, -4}, 0.8);
    Graph graph(graph_text(65, 65, false));
    const Image image = graph.image(scene);
    // The formula is exact where the light is small and seen at the half vector's own angle; here it is 0.1 wide.
    EXPECT_NEAR(static_cast<double>(image.at(32, 32)), 10.0, 0.5) << "type " << type;
    EXPECT_LT(image.at(2, 2), 0.05F) << "type " << type;
  }
}

TEST_P(Lighting, UnlitSurfacesShowTheirBaseColourUnderAnyLight) {
  Scene scene;
  HeddleMaterial record = Scene::grey();
  record.flags = HEDDLE_MATERIAL_UNLIT;
  record.emissive[0] = 3.0F;
  scene.use_material(record);
  scene.add_floor({0, -1, 0}, 5.0);
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0, -1, 0}, 1000.0));
  scene.look({0, 0, 0}, {0, -1, 0}, 0.5);
  Graph graph(graph_text(16, 16, true));
  const Image image = graph.image(scene);
  for (std::uint32_t channel = 0; channel < 3; ++channel) EXPECT_EQ(image.at(8, 8, channel), 0.5F);
}

}  // namespace
