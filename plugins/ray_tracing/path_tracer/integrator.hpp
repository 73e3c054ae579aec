// SPDX-License-Identifier: Apache-2.0
// A ray of the camera -> the light along it, once: unbiased, split by what it did last and first. README (1) to (4).
#pragma once

#include "emitters.hpp"
#include "sampler.hpp"

namespace heddle::path_tracer {

constexpr std::int32_t kShadowOfAll = -2;  // of Settings::shadow_light

struct Settings {
  Points points = Points::kSobol;
  std::uint32_t most_bounces = 0;    // times that light is reflected; 0: as often as it is
  std::uint32_t roulette_from = 3;   // bounces that no path is ended before
  std::uint32_t metal_branches = 2;  // paths that go on from the first surface if that is metal
  bool has_multiple_scattering = true;
  bool glows = true;                // surfaces that glow light others, not only the camera
  bool has_blended_shadows = true;  // light that passes through blended surfaces is tinted by them
  bool finds_visibility = false;    // occlusion and shadow below
  double occlusion_radius = 0.5;    // m
  std::int32_t shadow_light = -1;   // HeddleLight::id; -1: the first that casts a shadow; or kShadowOfAll
};

/// Of one sample; radiance is the sum of the first four.
struct Estimate {
  glm::dvec3 emission{0.0};           // straight from what glows, and the background
  glm::dvec3 direct{0.0};             // reflected once
  glm::dvec3 indirect_diffuse{0.0};   // reflected more often, by the diffuse lobe at the first surface
  glm::dvec3 indirect_specular{0.0};  // ... by the specular one
  double coverage = 0.0;              // 1 where there is a surface that hides what is behind it
  double occlusion = 1.0;             // 1 open: nothing solid within the radius, cosine-weighted
  double shadow = 1.0;                // 1 lit by shadow_light, at the first surface
};

/// What was done, for counters.
struct Counts {
  std::uint64_t rays = 0, shadow_rays = 0, visibility_rays = 0;
  Queries* record = nullptr;  // takes what Embree is asked, if somebody wants to ask it again
};

class Integrator {
 public:
  const Geometry* geometry = nullptr;
  const Surfaces* surfaces = nullptr;
  const Emitters* emitters = nullptr;
  const heddle_surface_material_service* material = nullptr;
  Settings settings;

  [[nodiscard]] Estimate estimate(const Ray& camera_ray, const Sampler& sampler, Counts& counts) const;

 private:
  struct Shading;
  struct Walk;
  struct Seen;
  /// The background, for a path that meets nothing any more.
  void leave(const Walk& walk, Estimate& out) const;
  /// Sends the path on as the material draws; `fate`: for roulette, and for the lobe. False: it ends here.
  [[nodiscard]] bool reflect(Walk& walk, const Shading& shading, const glm::dvec2& u, const glm::dvec2& fate) const;
  /// From surface to surface until it ends.
  void follow(Walk& walk, const Sampler& sampler, Seen& seen, Estimate& out, Counts& counts) const;
  [[nodiscard]] glm::dvec3 light_directly(const Shading& shading, Emitters::Kind kind, const glm::dvec2& u,
                                          Counts& counts) const;
  [[nodiscard]] glm::dvec3 transmittance(Ray ray, Counts& counts) const;
  /// What the material does with one direction of light.
  struct Reflection {
    glm::dvec3 light{0.0}, diffuse{0.0}, specular{0.0};
    double pdf = 0.0;
  };
  [[nodiscard]] Reflection evaluate(const Shading& shading, const glm::dvec3& light) const;
  [[nodiscard]] Reflection draw(const Shading& shading, const glm::dvec2& u, double u_lobe) const;
  [[nodiscard]] glm::dvec3 passed(const Surface& surface, const glm::dvec3& to_viewer) const;
  void find_visibility(const Surface& surface, const Sampler& sampler, Estimate& out, Counts& counts) const;
};

}  // namespace heddle::path_tracer
