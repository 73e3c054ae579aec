// SPDX-License-Identifier: Apache-2.0
// Asks the function `shadow` at a grid of points, through the C API.
#pragma once

#include "roles/rendering.hpp"

#include <fmt/format.h>

namespace shadow_patch {

using namespace rendering;

/// All digits of float64: patches may be of millimetres.
inline std::string exact_text_of(const dvec3& v) {
  return fmt::format("[{:.16e}, {:.16e}, {:.16e}]", v.x, v.y, v.z);
}

/// A grid of points that asks `shadow`, relative to the camera, which is at `camera` in the scene.
struct Patch {
  dvec3 corner, edge_u, edge_v, normal;
  dvec3 camera = dvec3(0.0);
  std::uint32_t light = 0;
  bool is_sphere = false;    // centre `corner`, radius |edge_u|
  std::uint32_t grid = 128;  // points a side; also the extent of the main view

  [[nodiscard]] dvec3 point(std::uint32_t x, std::uint32_t y) const {
    const double u = (x + 0.5) / grid;
    const double v = (y + 0.5) / grid;
    return is_sphere ? corner + glm::length(edge_u) * direction(x, y) : corner + u * edge_u + v * edge_v;
  }
  [[nodiscard]] dvec3 direction(std::uint32_t x, std::uint32_t y) const {
    const double elevation = (0.5 - (y + 0.5) / grid) * kPi;
    const double azimuth = (x + 0.5) / grid * 2.0 * kPi;
    return {std::sin(azimuth) * std::cos(elevation), std::sin(elevation), -std::cos(azimuth) * std::cos(elevation)};
  }
  [[nodiscard]] std::string text() const {
    return "params.light = " + std::to_string(light) + "\nparams.shape = \"" +
           (is_sphere ? "sphere" : "parallelogram") + "\"\nparams.corner = " + exact_text_of(corner - camera) +
           "\nparams.edge_u = " + exact_text_of(edge_u) + "\nparams.edge_v = " + exact_text_of(edge_v) +
           "\nparams.normal = " + exact_text_of(normal) + "\n";
  }
};

/// Visibility on a patch. `passes`: the techniques' [[pass]] texts.
inline Image ask(Scene& scene, const Patch& patch, const std::string& passes) {
  Graph graph("extent = [" + std::to_string(patch.grid) + ", " + std::to_string(patch.grid) +
              "]\noutput = \"probe.values\"\n" + passes +
              "[[pass]]\nname = \"probe\"\nrole = \"probe\"\ntechnique = \"shadow\"\n" + patch.text());
  return graph.image(scene);
}

inline std::string shadow_map(const std::string& parameters = "") {
  return "[[pass]]\nname = \"shadow\"\nrole = \"shadow\"\ntechnique = \"shadow_map\"\n" + parameters;
}

inline std::string cascaded(const std::string& parameters = "") {
  return "[[pass]]\nname = \"shadow\"\nrole = \"shadow\"\ntechnique = \"cascaded\"\n" + parameters;
}

inline std::string ray_traced(const std::string& parameters = "") {
  return "[[pass]]\nname = \"shadow\"\nrole = \"shadow\"\ntechnique = \"ray_traced\"\n" + parameters;
}

/// Every technique that answers for such a light by the scene; `parameters`: of those that draw depth maps.
inline std::vector<std::string> techniques_of(std::uint32_t light_type, const std::string& parameters = "") {
  std::vector<std::string> passes{ray_traced(), shadow_map(parameters)};
  if (light_type == HEDDLE_LIGHT_DIRECTIONAL) passes.push_back(cascaded(parameters));
  return passes;
}

inline std::string contact(const std::string& parameters = "") {
  return "[[pass]]\nname = \"gbuffer\"\nrole = \"gbuffer\"\ntechnique = \"raster\"\n"
         "[[pass]]\nname = \"contact\"\nrole = \"shadow\"\ntechnique = \"ray_marched_screen\"\n" +
         parameters;
}

}  // namespace shadow_patch
