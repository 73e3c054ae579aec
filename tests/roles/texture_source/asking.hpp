// SPDX-License-Identifier: Apache-2.0
// The function texture_source asked at the pixels of a parallelogram in texture coordinates.
#pragma once

#include "parsed.hpp"
#include "roles/rendering.hpp"

#include <heddle/components.h>

#include <nlohmann/json.hpp>

#include <map>
#include <random>

namespace asking {

using namespace rendering;

constexpr std::uint32_t kWidth = 64, kHeight = 48;

inline std::string exact_text(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", value);
  const std::string said = text;
  return said.find_first_of(".en") == std::string::npos ? said + ".0" : said;
}
inline std::string pair_text(const glm::dvec2& v) {
  return "[" + exact_text(v.x) + ", " + exact_text(v.y) + ", 0.0]";
}

inline std::string probe_graph(const std::string& technique, const std::string& parameters) {
  return "extent = [64, 48]\noutput = \"ask.values\"\n[[pass]]\nname = \"source\"\nrole = \"texture_source\"\n"
         "technique = \"" +
         technique + "\"\n" + parameters + "[[pass]]\nname = \"ask\"\nrole = \"probe\"\ntechnique = \"texture\"\n";
}

/// A scene whose material 0 has the component, with a lit floor so that there is something to look at.
struct TextureScene {
  Scene scene;
  explicit TextureScene(const std::string& properties) {
    scene.add_floor({0, 0, 0}, 1);
    set(0, properties);
  }
  void set(std::uint32_t material, const std::string& properties) {
    check(heddle_scene_set_component(scene.handle, HEDDLE_OWNER_MATERIAL, material, "texture_source.virtual",
                                     properties.c_str()));
  }
};

/// uv of pixel (0, 0), and steps of it to the next pixel in x and in y; all floats.
struct Camera {
  glm::dvec2 corner{0, 0}, edge_u{0, 0}, edge_v{0, 0};
};

inline void look(Graph& graph, const Camera& camera) {
  graph.set("ask.params.corner=" + pair_text(camera.corner));
  graph.set("ask.params.edge_u=" + pair_text(camera.edge_u));
  graph.set("ask.params.edge_v=" + pair_text(camera.edge_v));
}

inline double as_float(double value) {
  return static_cast<double>(static_cast<float>(value));
}

/// A parallelogram around `centre`, `texels` of level 0 from pixel to pixel, turned and sheared.
inline Camera camera_at(std::mt19937& random, double texels, double extent) {
  const auto uniform = [&] { return static_cast<double>(random()) * 0x1p-32; };
  const double angle = 2 * kPi * uniform(), step = texels / extent;
  const double shear = 0.3 * uniform(), other = angle + kPi / 2 + shear;
  Camera camera;
  camera.edge_u = {as_float(step * std::cos(angle)), as_float(step * std::sin(angle))};
  camera.edge_v = {as_float(step * std::cos(other)), as_float(step * std::sin(other))};
  camera.corner = {as_float(3 * uniform() - 1), as_float(3 * uniform() - 1)};
  return camera;
}

inline nlohmann::json stats(Graph& graph) {
  const char* text = nullptr;
  check(heddle_stats(graph.handle, &text));
  return parsed::json(text);
}
inline std::map<std::string, std::uint64_t> counts(Graph& graph) {
  std::map<std::string, std::uint64_t> found;
  const nlohmann::json said = stats(graph);
  for (const auto& one : said["counts"]) found[one["name"]] = one["count"].get<std::uint64_t>();
  return found;
}

inline void render(Graph& graph, Scene& scene, double time = 0, double step = 0, bool is_cut = false) {
  heddle_render_options options{};
  options.struct_size = sizeof options;
  options.time = time;
  options.time_step = step;
  options.cut = is_cut ? 1 : 0;
  check(heddle_render(graph.handle, scene.handle, &options));
}

/// Renders until all pixels have asked and nothing is missing any more: 4 frames for spacing 2, 2 of latency.
inline int settle(Graph& graph, Scene& scene, int pixels_in_turn = 4) {
  int frames = 0;
  for (int quiet = 0; quiet < pixels_in_turn + 3 && frames < 400; ++frames) {
    render(graph, scene);
    const auto now = counts(graph);
    quiet = now.at("tiles_uploaded") == 0 && now.at("tiles_missing") == 0 ? quiet + 1 : 0;
  }
  EXPECT_LT(frames, 400) << "never settled";
  return frames;
}

inline double psnr(const Image& a, const Image& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    const double d = static_cast<double>(a.pixels[i]) - static_cast<double>(b.pixels[i]);
    sum += d * d;
  }
  return -10 * std::log10(std::max(sum / static_cast<double>(a.pixels.size()), 1e-30));
}

inline double code_at(const Image& image, std::uint32_t x, std::uint32_t y, std::uint32_t channel) {
  const double v = static_cast<double>(image.at(x, y, channel));
  return 255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055);
}

}  // namespace asking
