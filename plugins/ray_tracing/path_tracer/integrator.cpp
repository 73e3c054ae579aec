// SPDX-License-Identifier: Apache-2.0
#include "integrator.hpp"

#include "hemisphere.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace heddle::path_tracer {
namespace {

using glm::dvec2;
using glm::dvec3;

// Pairs of numbers: one for the pixel, then as many for each surface on a path, and two far behind them.
constexpr std::uint32_t kFirstPair = 1, kPairsASurface = 5, kVisibilityPair = 1U << 30U;
enum : std::uint32_t { kMaterialPair, kFatePair, kLightPair };  // of each kind of emitters one

// A path that only passes through things ends here: more layers than a scene has in one line, but for traps.
constexpr std::uint32_t kMostSurfaces = 4096;
// Roulette keeps no path for certain: even in a white box it ends.
constexpr double kLongestLife = 0.99;
// How far before a light's shape, relative to its distance, a surface may stand that is its picture.
constexpr double kShapeSlack = 1e-4;
const dvec3 kLuminance(0.2126, 0.7152, 0.0722);
// Float32 rays to a point end this much before it.
constexpr double kEndSlack = 0x1p-20;

double largest(const dvec3& v) {
  return std::max({v.x, v.y, v.z});
}
bool is_dark(const dvec3& v) {
  return !(v.x > 0.0 || v.y > 0.0 || v.z > 0.0);
}

/// (3) Veach and Guibas 1995, the power heuristic with exponent 2.
double weight(double pdf, double other) {
  if (!(pdf > 0.0)) return 0.0;
  const double ratio = other / pdf;
  return 1.0 / (1.0 + ratio * ratio);
}

}  // namespace

/// A surface in the frame of its normal.
struct Integrator::Shading {
  const Surface& surface;
  dvec3 origin;  // where rays leave on the viewer's side
  glm::dmat3 basis;
  dvec3 view;  // in the frame
  Shading(const Surface& shaded, const dvec3& to_viewer)
      : surface(shaded),
        origin(shaded.foot.above(shaded.is_front ? 1.0 : -1.0)),
        basis(sampling::basis_around(shaded.normal)),
        view(glm::transpose(basis) * to_viewer) {
    view.z = std::max(view.z, 0.0);
  }
};

Integrator::Reflection Integrator::evaluate(const Shading& shading, const dvec3& light) const {
  const heddle_surface_point* point = &shading.surface.point;
  const std::uint32_t compensates = settings.has_multiple_scattering ? 1 : 0;
  Reflection r;
  r.light = light;
  if (material->struct_size > offsetof(heddle_surface_material_service, evaluate_parts)) {
    material->evaluate_parts(point, &shading.view.x, &light.x, compensates, &r.diffuse.x, &r.specular.x, &r.pdf);
    return r;
  }
  material->evaluate(point, &shading.view.x, &light.x, 1, compensates, &r.diffuse.x);
  material->evaluate(point, &shading.view.x, &light.x, 2, compensates, &r.specular.x);
  r.pdf = material->pdf(point, &shading.view.x, &light.x);
  return r;
}

Integrator::Reflection Integrator::draw(const Shading& shading, const dvec2& u, double u_lobe) const {
  const heddle_surface_point* point = &shading.surface.point;
  Reflection r;
  if (material->struct_size > offsetof(heddle_surface_material_service, sample_parts)) {
    material->sample_parts(point, &shading.view.x, &u.x, u_lobe, settings.has_multiple_scattering ? 1 : 0, &r.light.x,
                           &r.diffuse.x, &r.specular.x, &r.pdf);
    return r;
  }
  material->sample(point, &shading.view.x, &u.x, u_lobe, &r.light.x, &r.pdf);
  return r.pdf > 0.0 ? evaluate(shading, r.light) : Reflection{};
}

dvec3 Integrator::passed(const Surface& surface, const dvec3& to_viewer) const {
  if (surface.transmission <= 0.0) return dvec3(0.0);
  heddle_surface_point black = surface.point;
  std::fill(std::begin(black.base_color), std::end(black.base_color), 0.0);
  black.metalness = 0.0;
  dvec3 specular;
  material->albedo(&black, std::clamp(glm::dot(surface.normal, to_viewer), 0.0, 1.0), 2,
                   settings.has_multiple_scattering ? 1 : 0, &specular.x);
  const dvec3 color(surface.point.base_color[0], surface.point.base_color[1], surface.point.base_color[2]);
  return surface.transmission * std::clamp(1.0 - specular.x, 0.0, 1.0) * color;
}

dvec3 Integrator::transmittance(Ray ray, Counts& counts) const {
  ++counts.shadow_rays;
  if (geometry->is_blocked(ray, counts.record)) return dvec3(0.0);
  dvec3 share(1.0);
  if (!settings.has_blended_shadows || !geometry->has_blended()) return share;
  Hit hit;
  for (std::uint32_t i = 0; i < kMostSurfaces && geometry->find_blended(ray, hit, counts.record) && !is_dark(share);
       ++i) {
    const Surface surface = surfaces->at(*geometry, hit, -ray.direction);
    share *= (1.0 - surface.coverage) + surface.coverage * passed(surface, -ray.direction);
    ray.origin = surface.foot.above(surface.is_front ? -1.0 : 1.0);
    ray.length -= hit.distance;
    if (!(ray.length > 0.0)) break;
    ++counts.shadow_rays;
  }
  return share;
}

dvec3 Integrator::light_directly(const Shading& shading, Emitters::Kind kind, const dvec2& u, Counts& counts) const {
  const LightSample light = emitters->sample(kind, shading.origin, shading.surface.normal, u);
  if (!(light.probability > 0.0) || !(light.arrival.pdf > 0.0) || is_dark(light.arrival.value)) return dvec3(0.0);
  const dvec3 local = glm::transpose(shading.basis) * light.arrival.direction;
  if (local.z <= 0.0 || glm::dot(light.arrival.direction, shading.surface.facet) <= 0.0) return dvec3(0.0);
  const Reflection reflection = evaluate(shading, local);
  const dvec3 f = reflection.diffuse + reflection.specular;
  if (is_dark(f)) return dvec3(0.0);
  const double pdf = light.probability * light.arrival.pdf;
  dvec3 value = f * light.arrival.value * (local.z / pdf);
  if (light.has_size && light.can_be_met) value *= weight(pdf, reflection.pdf);
  if (light.casts_shadow) {
    Ray ray{shading.origin, light.arrival.direction, light.arrival.distance};
    ray.length *= 1.0 - (light.has_slack ? kShapeSlack : kEndSlack);
    value *= transmittance(ray, counts);
  }
  return value;
}

void Integrator::find_visibility(const Surface& surface, const Sampler& sampler, Estimate& out, Counts& counts) const {
  const dvec3 origin = surface.foot.above(surface.is_front ? 1.0 : -1.0);
  const dvec3 up = sampling::basis_around(surface.normal_geometric) *
                   sampling::sample_cosine_hemisphere(sampler.pair(kVisibilityPair));
  ++counts.visibility_rays;
  out.occlusion =
      glm::dot(up, surface.facet) > 0.0 && !geometry->is_blocked({origin, up, settings.occlusion_radius}, counts.record)
          ? 1.0
          : 0.0;
  const auto arrival_of = [&](const Light& light) {
    return light.has_size() ? sample_light(light, origin, sampler.pair(kVisibilityPair + 1), emitters->light_textures())
                            : arrival_without_size(light, origin);
  };
  const Light* meant = nullptr;
  Arrival arrival;
  if (settings.shadow_light == kShadowOfAll) {
    // One of all, by what its sample sends to the surface: drawn in one walk, the number used up as it goes.
    double sum = 0.0, u = sampler.pair(kVisibilityPair + 2).x;
    for (const Light& light : emitters->lights()) {
      const Arrival own = arrival_of(light);
      const double facing = glm::dot(own.direction, surface.normal_geometric);
      if (!(own.pdf > 0.0) || facing <= 0.0) continue;
      const double sent = glm::dot(own.value, kLuminance) * facing / own.pdf;
      if (!(sent > 0.0)) continue;
      sum += sent;
      const double share = sent / sum;
      const bool is_drawn = u < share;
      u = is_drawn ? u / share : (u - share) / (1.0 - share);
      if (is_drawn) {
        meant = &light;
        arrival = own;
      }
    }
    if (meant == nullptr || !meant->casts_shadow) return;
  } else {
    for (const Light& light : emitters->lights()) {
      const bool is_it = settings.shadow_light < 0
                             ? light.casts_shadow
                             : light.record.id == static_cast<std::uint32_t>(settings.shadow_light);
      if (!is_it) continue;
      meant = &light;
      arrival = arrival_of(light);
      break;
    }
    if (meant == nullptr || !(arrival.pdf > 0.0)) return;
  }
  ++counts.visibility_rays;
  const double slack = meant->is_shape() ? kShapeSlack : kEndSlack;
  out.shadow =
      glm::dot(arrival.direction, surface.facet) > 0.0 &&
              !geometry->is_blocked({origin, arrival.direction, arrival.distance * (1.0 - slack)}, counts.record)
          ? 1.0
          : 0.0;
}

/// A path on its way.
struct Integrator::Walk {
  Ray ray;
  dvec3 beta{1.0};           // what light that comes along the ray is worth
  dvec3 diffuse_share{0.0};  // of beta: what the first surface's diffuse lobe reflects
  std::uint32_t event = 0;   // surfaces met
  std::uint32_t bounces = 0;
  // The last surface that reflected: rays through layers go on from there.
  dvec3 from{0.0}, from_normal{0.0};
  double from_pdf = 0.0, travelled = 0.0;

  void add(const dvec3& radiance, Estimate& out) const {
    const dvec3 light = beta * radiance;
    if (bounces == 0) {
      out.emission += light;
    } else if (bounces == 1) {
      out.direct += light;
    } else {
      const dvec3 diffuse = light * diffuse_share;
      out.indirect_diffuse += diffuse;
      out.indirect_specular += light - diffuse;
    }
  }
};

/// What the camera's ray meets before it is reflected, or a layer lets it pass.
struct Integrator::Seen {
  double uncovered = 1.0;
  bool is_first = true;      // no solid surface yet
  bool is_past_all = false;  // nor ever one: the camera looks at the background
};

void Integrator::leave(const Walk& walk, Estimate& out) const {
  const dvec3& direction = walk.ray.direction;
  if (walk.bounces == 0) {
    walk.add(emitters->sky().radiance(direction), out);
    return;
  }
  if (emitters->sky().shines()) {
    const Emitters::Background seen = emitters->background(direction);
    walk.add(seen.radiance * weight(walk.from_pdf, seen.pdf), out);
  }
  emitters->meet_discs(walk.from, walk.from_normal, direction,
                       [&](const dvec3& value, double other) { walk.add(value * weight(walk.from_pdf, other), out); });
}

bool Integrator::reflect(Walk& walk, const Shading& shading, const dvec2& u, const dvec2& fate) const {
  const Reflection reflection = draw(shading, u, fate.y);
  if (!(reflection.pdf > 0.0)) return false;
  const dvec3 direction = glm::normalize(shading.basis * reflection.light);
  if (glm::dot(direction, shading.surface.facet) <= 0.0) return false;
  const dvec3 f = reflection.diffuse + reflection.specular;
  if (walk.bounces == 1) {
    for (glm::length_t c = 0; c < 3; ++c) walk.diffuse_share[c] = f[c] > 0.0 ? reflection.diffuse[c] / f[c] : 0.0;
  }
  walk.beta *= f * (reflection.light.z / reflection.pdf);
  if (is_dark(walk.beta)) return false;
  if (walk.bounces >= settings.roulette_from) {
    const double life = std::min(3.0 * largest(walk.beta), kLongestLife);
    if (fate.x >= life) return false;
    walk.beta /= life;
  }
  walk.from = shading.origin;
  walk.from_normal = shading.surface.normal;
  walk.from_pdf = reflection.pdf;
  walk.travelled = 0.0;
  walk.ray = {shading.origin, direction};
  return true;
}

void Integrator::follow(Walk& walk, const Sampler& sampler, Seen& seen, Estimate& out, Counts& counts) const {
  for (; walk.event < kMostSurfaces; ++walk.event) {
    const std::uint32_t dimension = kFirstPair + walk.event * kPairsASurface;
    Hit hit;
    ++counts.rays;
    const bool is_hit = geometry->find_nearest(walk.ray, hit, counts.record);
    const double reached = is_hit ? walk.travelled + hit.distance : walk.ray.length;

    // Lights' own shapes stand in nobody's way, and the camera does not see them.
    if (walk.bounces > 0)
      emitters->meet(walk.from, walk.from_normal, walk.ray.direction, walk.travelled * (1.0 + kShapeSlack),
                     reached * (1.0 + kShapeSlack),
                     [&](const dvec3& value, double pdf) { walk.add(value * weight(walk.from_pdf, pdf), out); });
    if (!is_hit) {
      seen.is_past_all = walk.bounces == 0;
      leave(walk, out);
      return;
    }

    const dvec3 to_viewer = -walk.ray.direction;
    Surface surface = surfaces->at(*geometry, hit, to_viewer);
    const auto pass_through = [&](const dvec3& share) {
      walk.beta *= share;
      walk.travelled = reached;
      walk.ray.origin = surface.foot.above(surface.is_front ? -1.0 : 1.0);
    };
    // The camera looks through backs, as rasterizers cull them; light does not.
    if (walk.bounces == 0 && !surface.is_front && !surface.is_double_sided) {
      pass_through(dvec3(1.0));
      continue;
    }

    if (surface.is_unlit) {
      walk.add(surface.emissive * surface.coverage, out);
    } else if (!is_dark(surface.emissive) && (walk.bounces == 0 || settings.glows)) {
      const double pdf = walk.bounces > 0 ? emitters->pdf_triangle(walk.from, walk.from_normal, hit.triangle,
                                                                   surface.foot, walk.ray.direction, reached)
                                          : 0.0;
      walk.add(surface.emissive * (surface.coverage * (walk.bounces > 0 ? weight(walk.from_pdf, pdf) : 1.0)), out);
    }
    if (seen.is_first && settings.finds_visibility && walk.bounces == 0 && !surface.is_blended) {
      find_visibility(surface, sampler, out, counts);
      seen.is_first = false;
    }

    const dvec3 through =
        surface.is_blended ? (1.0 - surface.coverage) + surface.coverage * passed(surface, to_viewer) : dvec3(0.0);
    if (walk.bounces == 0) seen.uncovered *= surface.is_blended ? 1.0 - surface.coverage : 0.0;
    const bool can_reflect = !surface.is_unlit && surface.coverage > 0.0 &&
                             (settings.most_bounces == 0 || walk.bounces < settings.most_bounces);
    if (!can_reflect) {
      if (is_dark(through)) return;
      pass_through(through);
      continue;
    }
    for (double& channel : surface.point.base_color) channel *= 1.0 - surface.transmission;

    const Shading shading(surface, to_viewer);
    walk.beta *= surface.coverage;
    ++walk.bounces;  // for what add() counts it as
    for (const Emitters::Kind kind : Emitters::kKinds) {
      if (!emitters->has(kind)) continue;
      const std::uint32_t pair = dimension + kLightPair + static_cast<std::uint32_t>(kind);
      walk.add(light_directly(shading, kind, sampler.pair(pair), counts), out);
    }

    // Pass on or reflect, by what either may bring. The rest of the number is as even as it was.
    dvec2 fate = sampler.pair(dimension + kFatePair);
    if (surface.is_blended) {
      dvec3 albedo;
      material->albedo(&surface.point, shading.view.z, 0, settings.has_multiple_scattering ? 1 : 0, &albedo.x);
      const double pass = largest(through), reflect = surface.coverage * largest(albedo);
      if (!(pass + reflect > 0.0)) return;
      const double reflects = reflect / (pass + reflect);
      if (fate.y >= reflects) {
        --walk.bounces;
        walk.beta /= surface.coverage;
        pass_through(through / (1.0 - reflects));
        continue;
      }
      walk.beta /= reflects;
      fate.y /= reflects;
    }

    // Where the first surface is metal, all that the path is still worth comes by the way that it takes. Not where a
    // choice to reflect came before: it is of the same number as the branches' lobes.
    if (walk.bounces == 1 && settings.metal_branches > 1 && !surface.is_blended && surface.point.metalness > 0.5) {
      walk.beta /= settings.metal_branches;
      ++walk.event;
      for (std::uint32_t i = 0; i < settings.metal_branches; ++i) {
        Walk branch = walk;
        const Sampler own = sampler.branch(i, settings.metal_branches);
        const dvec2 own_fate(fate.x, own.pair(dimension + kFatePair).y);
        if (reflect(branch, shading, own.pair(dimension + kMaterialPair), own_fate))
          follow(branch, own, seen, out, counts);
      }
      return;
    }
    if (!reflect(walk, shading, sampler.pair(dimension + kMaterialPair), fate)) return;
  }
}

Estimate Integrator::estimate(const Ray& camera_ray, const Sampler& sampler, Counts& counts) const {
  Estimate out;
  Walk walk;
  walk.ray = camera_ray;
  Seen seen;
  follow(walk, sampler, seen, out, counts);
  double uncovered = seen.uncovered;
  // What lies behind a layer that reflected covers too, and is the first solid surface.
  const bool lacks_visibility = settings.finds_visibility && seen.is_first && !seen.is_past_all;
  if ((walk.bounces > 0 && uncovered > 0.0 && uncovered < 1.0) || lacks_visibility) {
    Ray behind = camera_ray;
    uncovered = 1.0;
    Hit hit;
    bool is_open = true;  // no solid surface yet
    for (std::uint32_t i = 0; i < kMostSurfaces && is_open && (uncovered > 0.0 || lacks_visibility); ++i) {
      ++counts.rays;
      if (!geometry->find_nearest(behind, hit, counts.record)) break;
      const Surface surface = surfaces->at(*geometry, hit, -behind.direction);
      if (surface.is_front || surface.is_double_sided) {
        uncovered *= surface.is_blended ? 1.0 - surface.coverage : 0.0;
        is_open = surface.is_blended;
        if (!is_open && lacks_visibility) find_visibility(surface, sampler, out, counts);
      }
      behind.origin = surface.foot.above(surface.is_front ? -1.0 : 1.0);
    }
  }
  out.coverage = 1.0 - uncovered;
  return out;
}

}  // namespace heddle::path_tracer
