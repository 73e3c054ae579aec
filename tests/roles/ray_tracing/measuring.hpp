// SPDX-License-Identifier: Apache-2.0
// Frames of ray_tracing/path_tracer -> means with their standard errors, and what tests compare them with.
#pragma once

#include "parsed.hpp"
#include "roles/rendering.hpp"

#include <dlfcn.h>
#include <heddle/plugin.h>
#include <heddle/services.h>

#include <nlohmann/json.hpp>

namespace ray_tracing {

using namespace rendering;

inline const heddle_surface_material_service& material_service() {
  static const auto* const service = [] {
    void* library = dlopen(HEDDLE_BUILD_DIR "/lib/heddle/plugins/surface_material/ggx/ggx.so", RTLD_NOW | RTLD_LOCAL);
    const auto entry = reinterpret_cast<heddle_entry_function>(dlsym(library, "heddle_entry"));
    return static_cast<const heddle_surface_material_service*>(entry()->techniques[0]->functions[0].service);
  }();
  return *service;
}

/// `sky`: the lines of a pass of role sky, "" for none; `params`: "params.x = 1" lines of the tracer.
inline std::string graph_text(const std::string& params, const std::string& sky = "", std::uint32_t extent = 8,
                              const std::string& material = "") {
  const std::string size = std::to_string(extent);
  return "extent = [" + size + ", " + size + "]\noutput = \"pt.radiance\"\n" +
         (sky.empty() ? std::string() : "[[pass]]\nname = \"sky\"\nrole = \"sky\"\n" + sky + "\n") +
         "[[pass]]\nname = \"material\"\nrole = \"surface_material\"\ntechnique = \"ggx\"\n" + material +
         "\n[[pass]]\nname = \"pt\"\nrole = \"ray_tracing\"\ntechnique = \"path_tracer\"\n" + params + "\n";
}
inline const char* const kEvenSky = "technique = \"uniform\"";

struct Measured {
  dvec3 mean{0.0}, standard_error{0.0};
};

/// Over all pixels of radiance.
inline Measured mean_of(const Image& radiance, const Image& variance) {
  Measured measured;
  const double count = static_cast<double>(radiance.width) * radiance.height;
  for (std::uint32_t y = 0; y < radiance.height; ++y)
    for (std::uint32_t x = 0; x < radiance.width; ++x)
      for (std::uint32_t c = 0; c < 3; ++c) {
        measured.mean[static_cast<int>(c)] += static_cast<double>(radiance.at(x, y, c)) / count;
        measured.standard_error[static_cast<int>(c)] += static_cast<double>(variance.at(x, y, c)) / (count * count);
      }
  measured.standard_error = glm::sqrt(measured.standard_error);
  return measured;
}

inline Measured measure(Scene& scene, const std::string& text) {
  Graph graph(text);
  graph.keep("pt.variance");
  graph.render(scene);
  return mean_of(graph.read("pt.radiance"), graph.read("pt.variance"));
}

inline std::uint64_t counter(const Graph& graph, const std::string& name) {
  const char* json = nullptr;
  check(heddle_stats(graph.handle, &json));
  const nlohmann::json stats = parsed::json(json);
  for (const auto& one : stats["counts"])
    if (one["name"] == name) return one["count"].get<std::uint64_t>();
  return 0;
}

inline HeddleMaterial surface(double color, double roughness, double metalness, double ior = 1.5) {
  HeddleMaterial record = Scene::grey();
  for (int c = 0; c < 3; ++c) record.base_color[c] = static_cast<float>(color);
  record.roughness = static_cast<float>(roughness);
  record.metalness = static_cast<float>(metalness);
  record.ior = static_cast<float>(ior);
  return record;
}

inline heddle_surface_point point_of(const HeddleMaterial& record) {
  heddle_surface_point point{};
  point.struct_size = sizeof point;
  for (int c = 0; c < 3; ++c) point.base_color[c] = static_cast<double>(record.base_color[c]);
  point.metalness = static_cast<double>(record.metalness);
  point.roughness = static_cast<double>(record.roughness);
  point.ior = static_cast<double>(record.ior);
  return point;
}

}  // namespace ray_tracing
