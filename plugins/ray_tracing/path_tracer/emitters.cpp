// SPDX-License-Identifier: Apache-2.0
#include "emitters.hpp"

#include "owen_sobol.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

namespace heddle::path_tracer {
namespace {

using glm::dvec2;
using glm::dvec3;
using std::numbers::pi;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kBelowOne = 1.0 - 0x1p-53;
constexpr int kProbesASide = 4;  // of a glowing triangle's texture, squared: how bright it is on the whole

double mean_of(const dvec3& rgb) {
  return (rgb.x + rgb.y + rgb.z) / 3.0;
}

/// Even over a triangle: Heitz 2019, "A Low-Distortion Map Between Triangle and Square".
dvec2 sample_triangle(const dvec2& u) {
  const double b0 = u.x < u.y ? 0.5 * u.x : u.x - 0.5 * u.y;
  const double b1 = u.x < u.y ? u.y - 0.5 * u.x : 0.5 * u.y;
  return {b1, 1.0 - b0 - b1};
}

/// u.x with bits that points of 32 bits do not have: one of many lights takes its place from what a choice leaves of
/// it.
double refined(const dvec2& u) {
  const std::uint64_t bits = sampling::mix_bits(std::bit_cast<std::uint64_t>(u.y));
  return std::clamp(u.x + (static_cast<double>(bits >> 11U) * 0x1p-53 - 0.5) * 0x1p-32, 0.0, kBelowOne);
}

/// Intensity 0: the light is not of the tree, or dark.
LightBounds bounds_of(const Light& light) {
  LightBounds bounds;
  const double value = mean_of(light.intensity);
  dvec3 reach(0.0);
  bounds.axis = glm::length(light.direction) > 1e-6 ? glm::normalize(light.direction) : dvec3(0, -1, 0);
  bounds.range = light.range > 0.0 ? light.range : kInfinity;
  const double inner = std::acos(std::clamp(static_cast<double>(light.record.cos_inner), -1.0, 1.0));
  const double outer = std::acos(std::clamp(static_cast<double>(light.record.cos_outer), -1.0, 1.0));
  switch (light.record.type) {
    case HEDDLE_LIGHT_POINT:
      bounds.intensity = value;
      break;
    case HEDDLE_LIGHT_CAPSULE:
      bounds.intensity = value;
      reach = glm::abs(light.tangent) * (0.5 * static_cast<double>(light.record.segment_length));
      break;
    case HEDDLE_LIGHT_SPOT:
    case HEDDLE_LIGHT_CONE:
    case HEDDLE_LIGHT_WEDGE:
      bounds.intensity = value;
      // Bright up to the inner angle; the cosine of what is beyond never falls to the bound before the light does.
      bounds.cos_spread = std::cos(std::min(inner, outer));
      bounds.cos_reach = std::cos(std::min(std::max(outer - inner, 0.0) + 0.05, 0.5 * pi));
      if (light.record.type == HEDDLE_LIGHT_WEDGE)
        reach = glm::abs(light.tangent) * (0.5 * static_cast<double>(light.record.segment_length));
      break;
    case HEDDLE_LIGHT_SPHERE:
      bounds.intensity = value * pi * light.radius * light.radius;
      bounds.has_shape = true;
      reach = dvec3(light.radius);
      break;
    case HEDDLE_LIGHT_RECTANGLE: {
      const double x = static_cast<double>(light.record.half_extent[0]);
      const double y = static_cast<double>(light.record.half_extent[1]);
      bounds.intensity = value * 4.0 * x * y;
      bounds.cos_spread = 1.0;
      bounds.has_shape = true;
      reach = glm::abs(light.tangent) * x + glm::abs(light.bitangent) * y;
      break;
    }
    default:
      break;
  }
  bounds.low = light.position - reach;
  bounds.high = light.position + reach;
  return bounds;
}

}  // namespace

void Emitters::update(std::span<const HeddleLight> lights, std::span<const glm::vec4> light_textures,
                      const dvec3& origin, const Geometry& geometry, const Surfaces& surfaces, const SkyMap& sky,
                      bool glows) {
  sky_ = &sky;
  geometry_ = &geometry;
  surfaces_ = &surfaces;
  textures_.assign(light_textures.begin(), light_textures.end());
  lights_.clear();
  outside_.clear();
  triangles_.clear();
  emitter_of_.clear();
  std::vector<LightBounds> bounds;
  for (const HeddleLight& record : lights) {
    const auto index = static_cast<std::uint32_t>(lights_.size());
    lights_.emplace_back(record, origin, textures_);
    bounds.push_back(bounds_of(lights_.back()));
    const bool is_dark = !(mean_of(lights_.back().intensity) > 0.0);
    if ((record.type == HEDDLE_LIGHT_DIRECTIONAL || record.type == HEDDLE_LIGHT_BOX) && !is_dark)
      outside_.push_back(index);
  }
  for (std::uint32_t triangle = 0; glows && triangle < geometry.triangle_count(); ++triangle) {
    if (!surfaces.can_shine(triangle)) continue;
    double sum = 0.0;
    for (int i = 0; i < kProbesASide * kProbesASide; ++i) {
      const dvec2 at = sample_triangle(
          {(i % kProbesASide + 0.5) / kProbesASide, (i / kProbesASide + 0.5) / kProbesASide});  // NOLINT
      sum += mean_of(surfaces.emissive(triangle, at.x, at.y));
    }
    const Foot foot = geometry.foot(triangle, 1.0 / 3.0, 1.0 / 3.0);
    LightBounds bound;
    bound.intensity = foot.area * sum / (kProbesASide * kProbesASide);
    // What looks dark to the probes is left to rays that meet it.
    if (!(bound.intensity > 0.0)) continue;
    bound.low = dvec3(kInfinity);
    bound.high = -bound.low;
    for (const dvec2& corner : {dvec2(0, 0), dvec2(1, 0), dvec2(0, 1)}) {
      const dvec3 p = geometry.foot(triangle, corner.x, corner.y).position;
      bound.low = glm::min(bound.low, p);
      bound.high = glm::max(bound.high, p);
    }
    bound.axis = foot.facet;
    bound.cos_spread = 1.0;
    bound.range = kInfinity;
    bound.is_two_sided = surfaces.is_double_sided(triangle);
    if (emitter_of_.empty()) emitter_of_.assign(geometry.triangle_count(), ~0U);
    emitter_of_[triangle] = static_cast<std::uint32_t>(bounds.size());
    triangles_.push_back(triangle);
    bounds.push_back(bound);
  }
  tree_.build(bounds);
}

double Emitters::weight_of(const Light& light, const dvec3& point, const dvec3& normal) const {
  const double value = mean_of(light.intensity);
  if (light.record.type == HEDDLE_LIGHT_BOX && !light.is_in_box(point)) return 0.0;
  // The sine of a sum of angles is at most the sum of the first's sine and the second.
  const double cosine = -glm::dot(normal, light.direction) + (light.is_disc() ? light.radius : 0.0);
  return cosine > 0.0 ? value * std::max(cosine, 1e-3) : 0.0;
}

Emitters::Weights Emitters::weigh(const dvec3& point, const dvec3& normal) const {
  Weights weights;
  for (const std::uint32_t i : outside_) {
    const double weight = weight_of(lights_[i], point, normal);
    weights.sum += weight;
    weights.count += weight > 0.0 ? 1U : 0U;
  }
  return weights;
}

LightSample Emitters::sample_light_of(const Light& light, double probability, const dvec3& point,
                                      const dvec2& u) const {
  LightSample sample;
  sample.probability = probability;
  sample.has_size = light.has_size();
  sample.arrival = sample.has_size ? sample_light(light, point, u, textures_) : arrival_without_size(light, point);
  sample.casts_shadow = light.casts_shadow;
  // What passes through everything is not met in the order of a ray's hits.
  sample.can_be_met = light.casts_shadow;
  sample.has_slack = light.is_shape();
  return sample;
}

LightSample Emitters::sample_near(const dvec3& point, const dvec3& normal, const dvec2& u_whole) const {
  const LightTree::Choice choice = tree_.choose(point, normal, refined(u_whole));
  if (choice.probability <= 0.0) return {};
  const dvec2 u(choice.rest, u_whole.y);
  if (choice.emitter < lights_.size()) return sample_light_of(lights_[choice.emitter], choice.probability, point, u);
  LightSample sample;
  sample.probability = choice.probability;
  const std::uint32_t triangle = triangles_[choice.emitter - lights_.size()];
  const dvec2 at = sample_triangle(u);
  const Foot foot = geometry_->foot(triangle, at.x, at.y);
  const double side = glm::dot(point - foot.position, foot.facet) >= 0.0 ? 1.0 : -1.0;
  sample.has_size = sample.can_be_met = true;
  if (side < 0.0 && !surfaces_->is_double_sided(triangle)) return sample;
  const dvec3 to = foot.above(side) - point;
  sample.arrival.distance = glm::length(to);
  sample.arrival.direction = to / std::max(sample.arrival.distance, 1e-300);
  const double cosine = std::abs(glm::dot(sample.arrival.direction, foot.facet));
  if (cosine > 0.0) sample.arrival.pdf = sample.arrival.distance * sample.arrival.distance / (cosine * foot.area);
  sample.arrival.value = surfaces_->emissive(triangle, at.x, at.y);
  return sample;
}

LightSample Emitters::sample_far(const dvec3& point, const dvec3& normal, const dvec2& u) const {
  const Weights weights = weigh(point, normal);
  const Light* chosen = nullptr;
  double rest = refined(u), share = 0.0;
  for (const std::uint32_t i : outside_) {
    const double own = weights.share(weight_of(lights_[i], point, normal));
    if (!(own > 0.0)) continue;
    // Rounding may leave a hair of u to nobody: the last one takes it.
    chosen = &lights_[i];
    share = own;
    if (rest < own) break;
    rest -= own;
  }
  if (chosen == nullptr) return {};
  return sample_light_of(*chosen, share, point, {std::min(rest / share, kBelowOne), u.y});
}

LightSample Emitters::sample_sky(const dvec2& u) const {
  const SkyMap::Drawn drawn = sky_->sample(u);
  LightSample sample;
  sample.arrival = {drawn.direction, kInfinity, drawn.radiance, drawn.pdf};
  sample.probability = 1.0;
  sample.has_size = sample.can_be_met = true;
  return sample;
}

LightSample Emitters::sample(Kind kind, const dvec3& point, const dvec3& normal, const dvec2& u) const {
  switch (kind) {
    case Kind::kSky:
      return sample_sky(u);
    case Kind::kNear:
      return sample_near(point, normal, u);
    case Kind::kFar:
      break;
  }
  return sample_far(point, normal, u);
}

Emitters::Background Emitters::background(const dvec3& direction) const {
  if (!has(Kind::kSky)) return {sky_->radiance(direction), 0.0};
  const SkyMap::Drawn seen = sky_->look(direction);
  return {seen.radiance, seen.pdf};
}

double Emitters::pdf_triangle(const dvec3& point, const dvec3& normal, std::uint32_t triangle, const Foot& foot,
                              const dvec3& direction, double distance) const {
  if (emitter_of_.empty() || emitter_of_[triangle] == ~0U) return 0.0;
  const double cosine = std::abs(glm::dot(direction, foot.facet));
  if (!(cosine > 0.0)) return 0.0;
  const double probability = tree_.probability(point, normal, emitter_of_[triangle]);
  return distance * distance / (cosine * foot.area) * probability;
}

}  // namespace heddle::path_tracer
