// SPDX-License-Identifier: Apache-2.0
#include "light_tree.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace heddle::path_tracer {
namespace {

using glm::dvec3;
using std::numbers::pi;

constexpr std::size_t kBuckets = 12;
// From this depth on halves are of equal number, so that no trail needs more than 64 bits, nor the stack of meet().
constexpr std::uint32_t kDepthOfHalves = 28;

double sine_of(double cosine) {
  return std::sqrt(std::max(1.0 - cosine * cosine, 0.0));
}
/// cos(max(0, a - b)) by cosines and sines.
double cos_of_difference(double cos_a, double sin_a, double cos_b, double sin_b) {
  return cos_a > cos_b ? 1.0 : cos_a * cos_b + sin_a * sin_b;
}
double sin_of_difference(double cos_a, double sin_a, double cos_b, double sin_b) {
  return cos_a > cos_b ? 0.0 : sin_a * cos_b - cos_a * sin_b;
}

/// The smallest cone around the axes of both.
void join_axes(LightBounds& a, const LightBounds& b) {
  const double angle_a = std::acos(std::clamp(a.cos_spread, -1.0, 1.0));
  const double angle_b = std::acos(std::clamp(b.cos_spread, -1.0, 1.0));
  const double between = std::acos(std::clamp(glm::dot(a.axis, b.axis), -1.0, 1.0));
  if (std::min(between + angle_b, pi) <= angle_a) return;
  if (std::min(between + angle_a, pi) <= angle_b) {
    a.axis = b.axis;
    a.cos_spread = b.cos_spread;
    return;
  }
  const double angle = 0.5 * (angle_a + between + angle_b);
  const dvec3 around = glm::cross(a.axis, b.axis);
  const double length = glm::length(around);
  if (angle >= pi || length < 1e-12) {
    a.cos_spread = -1.0;
    return;
  }
  // Rodrigues' rotation of a's axis towards b's.
  const double turn = angle - angle_a;
  a.axis = glm::normalize(a.axis * std::cos(turn) + glm::cross(around / length, a.axis) * std::sin(turn));
  // Rounding must not lose an axis at the rim.
  a.cos_spread = std::max(std::cos(angle) - 1e-9, -1.0);
}

LightBounds joined(LightBounds a, const LightBounds& b) {
  if (a.intensity == 0.0 && !a.has_shape) return b;
  join_axes(a, b);
  a.low = glm::min(a.low, b.low);
  a.high = glm::max(a.high, b.high);
  a.cos_reach = std::min(a.cos_reach, b.cos_reach);
  a.intensity += b.intensity;
  a.range = std::max(a.range, b.range);
  a.is_two_sided = a.is_two_sided || b.is_two_sided;
  a.has_shape = a.has_shape || b.has_shape;
  return a;
}

/// What a node is worth avoiding: intensity times solid angle of its light times the surface of its box.
double cost_of(const LightBounds& bounds, double stretch) {
  const double spread = std::acos(std::clamp(bounds.cos_spread, -1.0, 1.0));
  const double reach = std::acos(std::clamp(bounds.cos_reach, -1.0, 1.0));
  const double w = std::min(spread + reach, pi), sine = std::sin(spread);
  const double angle =
      2.0 * pi * (1.0 - bounds.cos_spread) +
      0.5 * pi * (2.0 * w * sine - std::cos(spread - 2.0 * w) - 2.0 * spread * sine + bounds.cos_spread);
  const dvec3 size = bounds.high - bounds.low;
  const double surface = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
  return bounds.intensity * angle * stretch * surface;
}

}  // namespace

LightReach::LightReach(const LightBounds& bounds)
    : center_(0.5 * (bounds.low + bounds.high)),
      half_(bounds.high - center_),
      axis_(bounds.axis),
      radius_squared_(glm::dot(half_, half_)),
      // No nearer than the middle of the box's half.
      least_squared_(std::max(0.25 * radius_squared_, 1e-8)),
      range_squared_(bounds.range * bounds.range),
      cos_spread_(bounds.cos_spread),
      sin_spread_(sine_of(bounds.cos_spread)),
      cos_reach_(bounds.cos_reach),
      intensity_(bounds.intensity),
      is_two_sided_(bounds.is_two_sided),
      is_limited_(bounds.range < std::numeric_limits<double>::infinity()) {}

double LightReach::importance(const dvec3& point, const dvec3& normal) const {
  const dvec3 to = center_ - point;
  if (is_limited_) {
    const dvec3 off = glm::max(glm::abs(to) - half_, dvec3(0.0));
    if (glm::dot(off, off) >= range_squared_) return 0.0;
  }
  const double squared = glm::dot(to, to);
  const double inverse = squared > 0.0 ? 1.0 / std::sqrt(squared) : 0.0;
  const dvec3 w = squared > 0.0 ? to * inverse : dvec3(0, 1, 0);
  double cos_ball = -1.0, sin_ball = 0.0;  // of the angle under which the box's ball is seen; from inside: everything
  if (squared > radius_squared_) {
    const double s2 = radius_squared_ * inverse * inverse;
    sin_ball = std::sqrt(s2);
    cos_ball = std::sqrt(std::max(1.0 - s2, 0.0));
  }

  double cos_axis = -glm::dot(axis_, w);
  if (is_two_sided_) cos_axis = std::abs(cos_axis);
  const double sin_axis = sine_of(cos_axis);
  const double cos_x = cos_of_difference(cos_axis, sin_axis, cos_spread_, sin_spread_);
  const double sin_x = sin_of_difference(cos_axis, sin_axis, cos_spread_, sin_spread_);
  const double cos_left = cos_of_difference(cos_x, sin_x, cos_ball, sin_ball);
  // A billionth of slack: what is 0 here is never drawn.
  if (cos_left < cos_reach_ - 1e-9) return 0.0;

  const double cos_normal = glm::dot(normal, w);
  const double cos_incident = cos_of_difference(cos_normal, sine_of(cos_normal), cos_ball, sin_ball);
  if (cos_incident < -1e-9) return 0.0;
  // Falls off towards its bounds, but not to 0.
  const double sent = std::max(cos_left, 1e-3), received = std::max(cos_incident, 1e-3);
  return intensity_ * sent * received / std::max(squared, least_squared_);
}

void LightTree::build(std::span<const LightBounds> bounds) {
  nodes_.clear();
  trails_.assign(bounds.size(), 0);
  leaves_.assign(bounds.size(), ~0U);
  std::vector<std::uint32_t> emitters;
  for (std::uint32_t i = 0; i < bounds.size(); ++i)
    if (bounds[i].intensity > 0.0) emitters.push_back(i);
  if (emitters.empty()) return;
  nodes_.reserve(2 * emitters.size());
  (void)build(bounds, emitters, 0, 0);
}

std::uint32_t LightTree::build(std::span<const LightBounds> bounds, std::span<std::uint32_t> emitters,
                               std::uint64_t trail, std::uint32_t depth) {
  const auto self = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  if (emitters.size() == 1) {
    nodes_[self] = {LightReach(bounds[emitters[0]]), bounds[emitters[0]], 0, emitters[0], true};
    trails_[emitters[0]] = trail;
    leaves_[emitters[0]] = self;
    return self;
  }
  dvec3 low(std::numeric_limits<double>::infinity()), high(-low);
  const auto center_of = [&](std::uint32_t emitter) { return 0.5 * (bounds[emitter].low + bounds[emitter].high); };
  dvec3 box_low = low, box_high = high;
  for (const std::uint32_t emitter : emitters) {
    low = glm::min(low, center_of(emitter));
    high = glm::max(high, center_of(emitter));
    box_low = glm::min(box_low, bounds[emitter].low);
    box_high = glm::max(box_high, bounds[emitter].high);
  }
  const dvec3 size = high - low, box_size = box_high - box_low;
  const double longest = std::max({box_size.x, box_size.y, box_size.z});

  double best = std::numeric_limits<double>::infinity();
  glm::length_t best_axis = 0;
  std::size_t best_bucket = 0;
  const auto bucket_of = [&](std::uint32_t emitter, glm::length_t axis) {
    const double t = (center_of(emitter)[axis] - low[axis]) / size[axis];
    return std::min(static_cast<std::size_t>(t * kBuckets), kBuckets - 1);
  };
  for (glm::length_t axis = 0; axis < 3 && depth < kDepthOfHalves; ++axis) {
    if (!(size[axis] > 0.0)) continue;
    std::array<LightBounds, kBuckets> buckets{};
    for (const std::uint32_t emitter : emitters) {
      LightBounds& bucket = buckets[bucket_of(emitter, axis)];
      bucket = joined(bucket, bounds[emitter]);
    }
    const double stretch = longest / std::max(box_size[axis], 1e-300);
    for (std::size_t split = 0; split + 1 < kBuckets; ++split) {
      LightBounds below{}, above{};
      for (std::size_t i = 0; i < kBuckets; ++i) {
        LightBounds& side = i <= split ? below : above;
        if (buckets[i].intensity > 0.0) side = joined(side, buckets[i]);
      }
      if (below.intensity == 0.0 || above.intensity == 0.0) continue;
      const double cost = cost_of(below, stretch) + cost_of(above, stretch);
      if (cost < best) {
        best = cost;
        best_axis = axis;
        best_bucket = split;
      }
    }
  }
  std::size_t middle = emitters.size() / 2;
  if (best < std::numeric_limits<double>::infinity()) {
    const auto end = std::partition(emitters.begin(), emitters.end(), [&](std::uint32_t emitter) {
      return bucket_of(emitter, best_axis) <= best_bucket;
    });
    middle = static_cast<std::size_t>(end - emitters.begin());
  }
  if (middle == 0 || middle == emitters.size()) middle = emitters.size() / 2;
  (void)build(bounds, emitters.first(middle), trail, depth + 1);
  const std::uint32_t second = build(bounds, emitters.subspan(middle), trail | (1ULL << depth), depth + 1);
  nodes_[self].child = second;
  nodes_[self].bounds = joined(nodes_[self + 1].bounds, nodes_[second].bounds);
  nodes_[self].reach = LightReach(nodes_[self].bounds);
  return self;
}

LightTree::Choice LightTree::choose(const dvec3& point, const dvec3& normal, double u) const {
  if (nodes_.empty()) return {};
  Choice choice{0, 1.0};
  std::uint32_t self = 0;
  while (!nodes_[self].is_leaf) {
    const std::uint32_t second = nodes_[self].child;
    const double a = nodes_[self + 1].reach.importance(point, normal);
    const double b = nodes_[second].reach.importance(point, normal);
    if (!(a + b > 0.0)) return {};
    const double share = a / (a + b);
    // The rest of u is as even as u was.
    if (u < share) {
      u /= share;
      choice.probability *= share;
      self = self + 1;
    } else {
      u = std::min((u - share) / (1.0 - share), 1.0 - 0x1p-53);
      choice.probability *= 1.0 - share;
      self = second;
    }
  }
  // The root of one emitter has not been asked.
  if (self == 0 && !(nodes_[0].reach.importance(point, normal) > 0.0)) return {};
  choice.emitter = nodes_[self].emitter;
  choice.rest = u;
  return choice;
}

double LightTree::probability(const dvec3& point, const dvec3& normal, std::uint32_t emitter) const {
  if (emitter >= leaves_.size() || leaves_[emitter] == ~0U) return 0.0;
  std::uint64_t trail = trails_[emitter];
  double probability = 1.0;
  std::uint32_t self = 0;
  if (nodes_[0].is_leaf) return nodes_[0].reach.importance(point, normal) > 0.0 ? 1.0 : 0.0;
  for (; !nodes_[self].is_leaf; trail >>= 1U) {
    const std::uint32_t second = nodes_[self].child;
    const double a = nodes_[self + 1].reach.importance(point, normal);
    const double b = nodes_[second].reach.importance(point, normal);
    if (!(a + b > 0.0)) return 0.0;
    const double share = a / (a + b);
    probability *= (trail & 1U) != 0 ? 1.0 - share : share;
    self = (trail & 1U) != 0 ? second : self + 1;
  }
  return probability;
}

}  // namespace heddle::path_tracer
