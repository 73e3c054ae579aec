// SPDX-License-Identifier: Apache-2.0
// What the tests of the role share: graphs around the supersampler, and frames of them.
#pragma once

#include "parsed.hpp"
#include "roles/rendering.hpp"

#include <nlohmann/json.hpp>

namespace antialiasing {

using namespace rendering;

/// Samples of role edge, then the supersampler; the output is its radiance, float32.
inline std::string edge_text(const std::string& technique, int width = 64, int height = 64) {
  return "extent = [" + std::to_string(width) + ", " + std::to_string(height) +
         "]\noutput = \"aa.radiance\"\n[[pass]]\nname = \"edge\"\nrole = \"edge\"\ntechnique = \"" + technique +
         "\"\n[[pass]]\nname = \"aa\"\nrole = \"antialiasing\"\ntechnique = \"supersampled\"\n";
}

/// The deferred graph with the supersampler, lit by an even sky; the output is radiance.
inline std::string scene_text(int size = 64) {
  return "extends = \"supersampled.toml\"\nextent = [" + std::to_string(size) + ", " + std::to_string(size) +
         "]\noutput = \"aa.radiance\"\n[[pass]]\nname = \"lighting\"\nparams.precision = \"float32\"\n[[pass]]\nname = "
         "\"sky\"\ntechnique = \"uniform\"\n";
}

/// A box over a floor, turned so that its edges run in all directions.
inline void build(Scene& scene) {
  scene.add_floor({0, 0, 0}, 4.0);
  scene.add_box({-0.5, 0.2, -0.5}, {0.5, 1.2, 0.5});
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {-0.4, -1.0, -0.3}, 3.0));
  scene.look({2.1, 1.9, 2.7}, {0, 0.5, 0}, 0.7);
}

inline void render(Graph& graph, Scene& scene, std::uint32_t flags = 0, bool is_cut = false, double time = 0,
                   std::uint64_t seed = 0) {
  heddle_render_options options{};
  options.struct_size = sizeof options;
  options.flags = flags;
  options.cut = is_cut ? 1 : 0;
  options.time = time;
  options.seed = seed;
  check(heddle_render(graph.handle, scene.handle, &options));
}

inline nlohmann::json stats(Graph& graph) {
  const char* text = nullptr;
  check(heddle_stats(graph.handle, &text));
  return parsed::json(text);
}

inline std::string samples(int count) {
  return "aa.params.samples=" + std::to_string(count);
}

/// Settings for a technique that takes all samples in the first frame.
inline std::vector<std::string> at_once(const std::string& technique, int count,
                                        const std::vector<std::string>& more = {}) {
  std::vector<std::string> settings{"aa.technique=" + technique, samples(count)};
  if (technique == "multiframe") settings.emplace_back("aa.params.samples_per_frame=0");
  settings.insert(settings.end(), more.begin(), more.end());
  return settings;
}

}  // namespace antialiasing
