// SPDX-License-Identifier: Apache-2.0
// surface_material.glsl on the device against the float64 service, over NoL, roughness, metalness, views and lobes.
#include "roles/rendering.hpp"

#include <dlfcn.h>
#include <heddle/plugin.h>
#include <heddle/services.h>

namespace {

using namespace rendering;

const heddle_surface_material_service& service() {
  static const heddle_surface_material_service* table = [] {
    void* library = dlopen(HEDDLE_BUILD_DIR "/lib/heddle/plugins/surface_material/ggx/ggx.so", RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) throw std::runtime_error(dlerror());
    const auto entry = reinterpret_cast<heddle_entry_function>(dlsym(library, "heddle_entry"));
    return static_cast<const heddle_surface_material_service*>(entry()->techniques[0]->functions[0].service);
  }();
  return *table;
}

constexpr std::uint32_t kGrid = 64;

struct Case {
  const char* answer;
  double n_dot_v, azimuth, metalness;
  bool multiple_scattering;
};

Image ask(const Case& c) {
  Scene scene;
  scene.look({0, 0, 0}, {0, 0, -1});
  Graph graph(
      "extent = [64, 64]\noutput = \"probe.values\"\n[[pass]]\nname = \"material\"\nrole = "
      "\"surface_material\"\ntechnique = \"ggx\"\nparams.multiple_scattering = " +
      std::string(c.multiple_scattering ? "true" : "false") +
      "\n[[pass]]\nname = \"probe\"\nrole = \"probe\"\ntechnique = \"surface_material\"\nparams.answer = \"" +
      c.answer + "\"\nparams.n_dot_v = " + std::to_string(c.n_dot_v) +
      "\nparams.azimuth = " + std::to_string(c.azimuth) + "\nparams.metalness = " + std::to_string(c.metalness) +
      "\nparams.base_color = [0.9, 0.5, 0.04]\n");
  return graph.image(scene);
}

TEST(SurfaceMaterialGgxShader, EqualsTheServiceAtEveryPoint) {
  double worst = 0.0;
  for (const char* answer : {"brdf", "diffuse", "specular", "environment"})
    for (const double n_dot_v : {0.0, 0.05, 0.6, 1.0})
      for (const double azimuth : {0.5, 3.14159})
        for (const double metalness : {0.0, 0.7})
          for (const bool bounces : {false, true}) {
            const Case c{answer, n_dot_v, azimuth, metalness, bounces};
            const Image image = ask(c);
            ASSERT_EQ(image.width, kGrid);
            const std::string name = answer;
            const std::uint32_t lobe = name == "diffuse" ? 1U : name == "specular" ? 2U : 0U;
            for (std::uint32_t y = 0; y < kGrid; ++y)
              for (std::uint32_t x = 0; x < kGrid; ++x) {
                heddle_surface_point point{};
                point.struct_size = sizeof point;
                const double base[3] = {0.9, 0.5, 0.04};
                std::copy(base, base + 3, point.base_color);
                point.metalness = metalness;
                point.roughness = (y + 0.5) / kGrid;
                point.ior = 1.5;
                const double NoL = (x + 0.5) / kGrid, sine = std::sqrt(1.0 - NoL * NoL);
                const double view[3] = {std::sqrt(1.0 - n_dot_v * n_dot_v), 0.0, n_dot_v};
                const double light[3] = {sine * std::cos(azimuth), sine * std::sin(azimuth), NoL};
                double expected[3];
                if (name == "environment")
                  service().albedo(&point, n_dot_v, 0, bounces ? 1 : 0, expected);
                else
                  service().evaluate(&point, view, light, lobe, bounces ? 1 : 0, expected);
                // V + L is off by 2^-23 in float32 and H by that over its length; the lobe changes by 2 / alpha a
                // radian at its steepest. 2e-4 covers the table's weights (1/256 steps on some GPUs).
                const double alpha = std::max(point.roughness * point.roughness, 1e-3);
                const double sum = std::sqrt(std::pow(view[0] + light[0], 2) + std::pow(view[1] + light[1], 2) +
                                             std::pow(view[2] + light[2], 2));
                const double relative = 2e-4 + std::exp2(-23.0) / sum * 4.0 / alpha;
                for (std::uint32_t channel = 0; channel < 3; ++channel) {
                  const double value = static_cast<double>(image.at(x, y, channel));
                  const double error = std::abs(value - expected[channel]);
                  ASSERT_LE(error, relative * expected[channel] + 2e-6)
                      << answer << " NoV " << n_dot_v << " NoL " << NoL << " azimuth " << azimuth << " roughness "
                      << point.roughness << " metalness " << metalness << ": " << value << " for " << expected[channel];
                  worst = std::max(worst, error / (relative * expected[channel] + 2e-6));
                }
              }
          }
  RecordProperty("worst_share_of_bound", std::to_string(worst));
}

}  // namespace
