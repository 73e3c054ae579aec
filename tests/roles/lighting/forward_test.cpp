// SPDX-License-Identifier: Apache-2.0
// lighting/forward against lighting/deferred on one scene with everything that lighting meets, and its depth, drawn by
// itself or taken from the gbuffer.
#include "parsed.hpp"
#include "roles/rendering.hpp"

#include <nlohmann/json.hpp>

namespace {

using namespace rendering;

/// deferred.toml as shipped but for its size, and the sky, whose tables take a second to make.
std::string graph_text(const std::string& technique, const std::string& precision, const std::string& more = {}) {
  return "extends = \"deferred.toml\"\nextent = [96, 64]\noutput = \"lighting.radiance\"\n"
         "[[pass]]\nname = \"sky\"\ntechnique = \"uniform\"\nparams.radiance = [0.2, 0.3, 0.5]\n"
         "[[pass]]\nname = \"gbuffer\"\nparams.precision = \"" +
         std::string(precision == "float32" ? "float32" : "packed") +
         "\"\n[[pass]]\nname = \"lighting\"\ntechnique = \"" + technique + "\"\nparams.precision = \"" + precision +
         "\"\n" + more;
}

void fill(Scene& scene) {
  HeddleMaterial record = Scene::grey();
  record.flags = HEDDLE_MATERIAL_DOUBLE_SIDED;
  scene.use_material(record);
  scene.add_floor({0, -1, -4}, 8.0);
  record.flags = 0;
  for (int i = 0; i < 4; ++i) {
    record.roughness = 0.25F * static_cast<float>(i + 1);
    record.metalness = i % 2 == 0 ? 0.0F : 1.0F;
    record.base_color[i % 3] = 0.9F;
    record.emissive[2] = i == 3 ? 0.4F : 0.0F;
    record.flags = i == 2 ? HEDDLE_MATERIAL_UNLIT : 0U;
    scene.use_material(record);
    scene.add_sphere({1.1 * i - 1.7, -0.5, -4.0 - 0.3 * i}, 0.5, 48);
  }
  // A masked wall whose holes show what is behind.
  const std::uint8_t texels[] = {255, 200, 150, 255, 0, 0, 0, 0, 0, 0, 0, 0, 255, 200, 150, 255};
  heddle_texture texture{};
  texture.struct_size = sizeof texture;
  texture.width = texture.height = 2;
  texture.is_srgb = 1;
  texture.rgba = texels;
  std::uint32_t id = 0;
  check(heddle_scene_add_texture(scene.handle, nullptr, &texture, &id));
  record = Scene::grey();
  record.alpha_mode = HEDDLE_ALPHA_MASK;
  scene.use_material(record, id);
  scene.add_mesh({-3, -1, -6, 3, -1, -6, 3, 1, -6, -3, 1, -6}, {}, {0, 1, 2, 0, 2, 3}, dmat4(1.0),
                 {0, 0, 4, 0, 4, 2, 0, 2});
  scene.use_material(Scene::grey());
  scene.add_box({-0.3, -1, -3}, {0.3, -0.4, -2.6});
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0.4, -1, -0.3}, 2.0));
  HeddleLight lamp = light(HEDDLE_LIGHT_SPHERE, {0, -1, 0}, 40.0);
  lamp.radius = 0.2F;
  scene.add_light(lamp, {1, 1, -3});
  lamp = light(HEDDLE_LIGHT_RECTANGLE, {0.3, -1, 0}, 20.0);
  lamp.half_extent[0] = lamp.half_extent[1] = 0.3F;
  scene.add_light(lamp, {-1, 1, -3});
  scene.add_light(light(HEDDLE_LIGHT_SPOT, {0, -1, -0.2}, 5.0), {0, 1.5, -4});
  scene.look({0, 0.4, 0}, {0, -0.4, -4}, 0.9);
}

Image rendered(const std::string& text) {
  Scene scene;
  fill(scene);
  Graph graph(text);
  return graph.image(scene);
}

/// Share of pixels that differ by more than `bound`, relative to at least 1.
double share_beyond(const Image& a, const Image& b, double bound) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.pixels.size(); i += 4) {
    double worst = 0;
    for (std::size_t c = 0; c < 4; ++c) {
      const double x = static_cast<double>(a.pixels[i + c]), y = static_cast<double>(b.pixels[i + c]);
      worst = std::max(worst, std::abs(x - y) / std::max(y, 1.0));
    }
    count += worst > bound ? 1 : 0;
  }
  return static_cast<double>(count) / static_cast<double>(a.pixels.size() / 4);
}

TEST(LightingForward, IsThePictureOfDeferredBySwappingOneWord) {
  const Image forward = rendered(graph_text("forward", "float32"));
  const Image deferred = rendered(graph_text("deferred", "float32"));
  // All but the pixels where the rounding of a position moves a shadow's edge: filter taps in the map and steps on the
  // screen compare depths, and a comparison jumps.
  EXPECT_LT(share_beyond(forward, deferred, 1e-3), 0.01);
  RecordProperty("beyond_1e_3", std::to_string(share_beyond(forward, deferred, 1e-3)));
  RecordProperty("beyond_1e_5", std::to_string(share_beyond(forward, deferred, 1e-5)));
  // Every pixel is surface in both or in neither.
  for (std::size_t i = 3; i < forward.pixels.size(); i += 4) ASSERT_EQ(forward.pixels[i], deferred.pixels[i]);
}

TEST(LightingForward, DiffersFromPackedDeferredByThePackingAlone) {
  // 8 bits of colour and roughness and 16 of normals are steps of 1/255 and 2^-15; a narrow lobe makes more of them.
  const Image forward = rendered(graph_text("forward", "float16"));
  const Image deferred = rendered(graph_text("deferred", "float16"));
  EXPECT_LT(share_beyond(forward, deferred, 0.02), 0.01);
  RecordProperty("beyond_0.02", std::to_string(share_beyond(forward, deferred, 0.02)));
}

TEST(LightingForward, DrawsTheSameDepthAsTheGbuffer) {
  const Image taken = rendered(graph_text("forward", "float32"));
  const Image own = rendered(graph_text("forward", "float32", "inputs.depth_buffer = \"none\"\n"));
  EXPECT_EQ(taken.pixels, own.pixels);
}

TEST(LightingForward, NeedsNoGbuffer) {
  const std::string more =
      "inputs.depth_buffer = \"none\"\n[[pass]]\nname = \"ao\"\ntechnique = \"none\"\n"
      "[[pass]]\nname = \"contact\"\ntechnique = \"none\"\n";
  Scene scene;
  fill(scene);
  Graph graph(graph_text("forward", "float32", more));
  const Image image = graph.image(scene);
  EXPECT_GT(image.at(48, 50), 0.0F);
  const char* stats = nullptr;
  check(heddle_stats(graph.handle, &stats));
  const nlohmann::json libraries = parsed::json(stats)["libraries"];
  EXPECT_FALSE(libraries.empty());
  for (const auto& library : libraries)
    EXPECT_EQ(library.get<std::string>().find("/gbuffer/"), std::string::npos) << library;
}

}  // namespace
