// SPDX-License-Identifier: Apache-2.0
#include "light_shapes.hpp"

#include "hemisphere.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>

namespace heddle::path_tracer {
namespace {

using glm::dvec2;
using glm::dvec3;
using std::numbers::pi;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kLeastDistance = 1e-4;   // light.glsl: kLightMinimumDistance
constexpr double kLeastConeWidth = 1e-3;  // light.glsl: kLightMinimumConeWidth
// Below this solid angle, steradians, a rectangle is sampled by area: from there on its density changes by less than it
// would gain, and Ureña's angles begin to cancel.
constexpr double kSmallRectangle = 1e-3;
// Metres over a rectangle's plane below which a point is in it: squares of less vanish.
constexpr double kLeastHeight = 1e-100;

dvec3 vector_of(const float v[3]) {
  return {v[0], v[1], v[2]};
}

double d(float x) {
  return static_cast<double>(x);
}

double angular(const Light& light, double cosine) {
  const double width = std::max(d(light.record.cos_inner) - d(light.record.cos_outer), kLeastConeWidth);
  const double t = std::clamp((cosine - d(light.record.cos_outer)) / width, 0.0, 1.0);
  return light.record.type == HEDDLE_LIGHT_SPOT ? t * t : t * t * (3.0 - 2.0 * t);
}

/// Of metres, whose squares neither overflow nor vanish here: without the care, and the time, of std::hypot.
double length_of(double x, double y) {
  return std::sqrt(x * x + y * y);
}

dvec3 local_in_box(const Light& light, const dvec3& point) {
  const dvec3 from = point - light.position;
  return {glm::dot(from, light.tangent), glm::dot(from, light.bitangent), glm::dot(from, light.direction)};
}

/// The mean of the four texels around uv (top row first), as the rasterizer reads the finest level.
dvec3 texture_at(const Light& light, const dvec2& uv, std::span<const glm::vec4> texels) {
  if (light.texture == 0) return dvec3(1.0);
  const double w = light.texture_width, h = light.texture_height;
  const dvec2 at(std::clamp(uv.x * w - 0.5, 0.0, w - 1.0), std::clamp(uv.y * h - 0.5, 0.0, h - 1.0));
  const auto x0 = static_cast<std::uint64_t>(at.x), y0 = static_cast<std::uint64_t>(at.y);
  const std::uint64_t x1 = std::min<std::uint64_t>(x0 + 1, light.texture_width - 1);
  const std::uint64_t y1 = std::min<std::uint64_t>(y0 + 1, light.texture_height - 1);
  const auto texel = [&](std::uint64_t x, std::uint64_t y) {
    return dvec3(texels[light.texture + y * light.texture_width + x]);
  };
  const double s = at.x - static_cast<double>(x0), t = at.y - static_cast<double>(y0);
  return glm::mix(glm::mix(texel(x0, y0), texel(x1, y0), s), glm::mix(texel(x0, y1), texel(x1, y1), s), t);
}

/// A rectangle as seen from a point. Ureña, Fajardo and King 2013, "An Area-Preserving Parametrization for Spherical
/// Rectangles": equal areas of the unit square become equal solid angles.
class SphericalRectangle {
 public:
  SphericalRectangle(const Light& light, const dvec3& point)
      : half_(light.record.half_extent[0], light.record.half_extent[1]) {
    const dvec3 to_center = light.position - point;
    height_ = -glm::dot(to_center, light.direction);  // > 0 on the side that shines
    center_ = {glm::dot(to_center, light.tangent), glm::dot(to_center, light.bitangent)};
    if (height_ <= kLeastHeight || half_.x <= 0.0 || half_.y <= 0.0) return;
    area_ = 4.0 * half_.x * half_.y;
    const dvec2 nearest = glm::max(glm::abs(center_) - half_, dvec2(0.0));
    const double nearest_squared = glm::dot(nearest, nearest) + height_ * height_;
    // An upper bound of the solid angle.
    by_area_ = area_ * height_ < kSmallRectangle * nearest_squared * std::sqrt(nearest_squared);
    if (by_area_) return;
    x0_ = center_.x - half_.x;
    x1_ = center_.x + half_.x;
    y0_ = center_.y - half_.y;
    y1_ = center_.y + half_.y;
    // The rectangle lies at -height on the z axis of Ureña's frame. Normals of the four planes through its edges.
    const double z = -height_;
    const double n0 = -y0_ / length_of(y0_, z), n1 = x1_ / length_of(x1_, z);
    const double n2 = y1_ / length_of(y1_, z), n3 = -x0_ / length_of(x0_, z);
    b0_ = n0;
    b1_ = n2;
    const double g0 = std::acos(std::clamp(-n0 * n1, -1.0, 1.0)), g1 = std::acos(std::clamp(-n1 * n2, -1.0, 1.0));
    const double g2 = std::acos(std::clamp(-n2 * n3, -1.0, 1.0)), g3 = std::acos(std::clamp(-n3 * n0, -1.0, 1.0));
    k_ = 2.0 * pi - g2 - g3;
    solid_angle_ = g0 + g1 - k_;
    by_area_ = !(solid_angle_ > 0.0);
  }

  [[nodiscard]] bool is_seen() const { return height_ > 0.0 && area_ > 0.0; }
  [[nodiscard]] double height() const { return height_; }

  /// Point of the plane, in the light's axes from its centre.
  [[nodiscard]] dvec2 sample(const dvec2& u) const {
    if (by_area_) return (2.0 * u - 1.0) * half_;
    const double au = u.x * solid_angle_ + k_;
    const double fu = (std::cos(au) * b0_ - b1_) / std::sin(au);
    const double cu = std::clamp(std::copysign(1.0 / std::sqrt(fu * fu + b0_ * b0_), fu), -1.0, 1.0);
    const double z = -height_;
    const double xu = std::clamp(-(cu * z) / std::max(std::sqrt(1.0 - cu * cu), 1e-12), x0_, x1_);
    const double dist = length_of(xu, z);
    const double h0 = y0_ / length_of(dist, y0_), h1 = y1_ / length_of(dist, y1_);
    const double hv = h0 + u.y * (h1 - h0), hv2 = hv * hv;
    const double yv = hv2 < 1.0 - 1e-12 ? hv * dist / std::sqrt(1.0 - hv2) : y1_;
    return dvec2(xu, std::clamp(yv, y0_, y1_)) - center_;
  }
  /// Per steradian, of the direction to a point of the plane.
  [[nodiscard]] double pdf(const dvec2& place) const {
    if (!by_area_) return 1.0 / solid_angle_;
    const dvec2 offset = center_ + place;
    const double squared = glm::dot(offset, offset) + height_ * height_;
    return squared * std::sqrt(squared) / (height_ * area_);
  }

 private:
  dvec2 half_, center_{0.0};
  double height_ = 0.0, area_ = 0.0, solid_angle_ = 0.0;
  bool by_area_ = true;
  double x0_ = 0.0, x1_ = 0.0, y0_ = 0.0, y1_ = 0.0, b0_ = 0.0, b1_ = 0.0, k_ = 0.0;
};

dvec3 rectangle_value(const Light& light, const dvec3& point, const dvec2& place, std::span<const glm::vec4> texels) {
  const dvec3 to_center = light.position - point;
  const dvec2 half(light.record.half_extent[0], light.record.half_extent[1]);
  const dvec2 uv = 0.5 + dvec2(0.5, -0.5) * place / half;
  return light.intensity * light.window(glm::dot(to_center, to_center)) * texture_at(light, uv, texels);
}

Arrival sample_rectangle(const Light& light, const dvec3& point, const dvec2& u, std::span<const glm::vec4> texels) {
  const SphericalRectangle seen(light, point);
  if (!seen.is_seen()) return {};
  const dvec2 place = seen.sample(u);
  const dvec3 to = light.position + light.tangent * place.x + light.bitangent * place.y - point;
  const double distance = glm::length(to);
  return {to / distance, distance, rectangle_value(light, point, place, texels), seen.pdf(place)};
}

struct Ball {
  double distance_squared, sine_squared;  // of the centre; of the angular radius
  bool is_inside;
  Ball(const Light& light, const dvec3& point) {
    const dvec3 to_center = light.position - point;
    distance_squared = glm::dot(to_center, to_center);
    is_inside = distance_squared <= light.radius * light.radius;
    sine_squared = is_inside ? 1.0 : light.radius * light.radius / distance_squared;
  }
  /// From inside it shines from everywhere.
  [[nodiscard]] double pdf() const { return is_inside ? 0.25 / pi : 1.0 / (2.0 * pi * one_minus_cos(sine_squared)); }
};

/// Along unit `direction`; < 0: misses.
double distance_to_ball(const Light& light, const dvec3& point, const dvec3& direction) {
  const dvec3 to_center = light.position - point;
  const double along = glm::dot(to_center, direction);
  const dvec3 off = to_center - along * direction;
  const double inside = light.radius * light.radius - glm::dot(off, off);
  if (inside < 0.0) return -1.0;
  const double half = std::sqrt(inside);
  return along - half > 0.0 ? along - half : along + half;
}

Arrival sample_ball(const Light& light, const dvec3& point, const dvec2& u) {
  if (light.radius <= 0.0) return {};
  const Ball ball(light, point);
  const double azimuth = 2.0 * pi * u.y;
  const double lost = ball.is_inside ? 2.0 * u.x : u.x * one_minus_cos(ball.sine_squared);  // 1 - cosine
  const double sine = std::sqrt(std::max(lost * (2.0 - lost), 0.0));
  const dvec3 axis = ball.is_inside ? dvec3(0, 1, 0) : (light.position - point) / std::sqrt(ball.distance_squared);
  Arrival arrival;
  arrival.direction = glm::normalize(sampling::basis_around(axis) *
                                     dvec3(sine * std::cos(azimuth), sine * std::sin(azimuth), 1.0 - lost));
  arrival.distance = distance_to_ball(light, point, arrival.direction);
  // At the rim rounding may miss by a hair.
  if (arrival.distance < 0.0)
    arrival.distance = std::sqrt(std::max(ball.distance_squared - light.radius * light.radius, 0.0));
  arrival.value = light.intensity * light.window(ball.distance_squared);
  arrival.pdf = ball.pdf();
  return arrival;
}

double disc_sine_squared(const Light& light) {
  const double sine = std::sin(std::min(light.radius, 0.5 * pi));
  return sine * sine;
}

/// (9) The even radiance of a disc that lights a plane facing it by `intensity`.
Arrival disc_arrival(const Light& light, const dvec3& direction) {
  const double s2 = disc_sine_squared(light);
  return {direction, kInfinity, light.intensity / (pi * s2), 1.0 / (2.0 * pi * one_minus_cos(s2))};
}

Arrival sample_disc(const Light& light, const dvec2& u) {
  const double lost = u.x * one_minus_cos(disc_sine_squared(light));
  const double sine = std::sqrt(std::max(lost * (2.0 - lost), 0.0)), azimuth = 2.0 * pi * u.y;
  return disc_arrival(light, glm::normalize(sampling::basis_around(-light.direction) *
                                            dvec3(sine * std::cos(azimuth), sine * std::sin(azimuth), 1.0 - lost)));
}

}  // namespace

Light::Light(const HeddleLight& given, const dvec3& origin, std::span<const glm::vec4> light_textures)
    : record(given),
      position(origin + vector_of(given.position_rel)),
      direction(vector_of(given.direction)),
      tangent(vector_of(given.tangent)),
      bitangent(glm::cross(direction, tangent)),
      intensity(vector_of(given.intensity)),
      range(d(given.range)),
      radius(d(given.radius)),
      casts_shadow((given.flags & HEDDLE_LIGHT_CASTS_SHADOW) != 0) {
  if (given.texture == 0 || given.texture > light_textures.size()) return;
  HeddleLightTexture head;
  std::memcpy(&head, &light_textures[given.texture - 1], sizeof head);
  texture = head.first;
  texture_width = head.width;
  texture_height = head.height;
}

bool Light::has_size() const {
  return is_shape() || (record.type == HEDDLE_LIGHT_DIRECTIONAL && radius > 0.0);
}

double Light::window(double distance_squared) const {
  if (range <= 0.0) return 1.0;
  const double q = distance_squared / (range * range);
  return q >= 1.0 ? 0.0 : 1.0 - q * q;
}

bool Light::is_in_box(const dvec3& point) const {
  const dvec3 local = glm::abs(local_in_box(*this, point));
  return local.x < d(record.half_extent[0]) && local.y < d(record.half_extent[1]) && local.z < d(record.half_extent[2]);
}

Arrival arrival_without_size(const Light& light, const dvec3& point) {
  Arrival arrival{-light.direction, kInfinity, light.intensity, 1.0};
  switch (light.record.type) {
    case HEDDLE_LIGHT_DIRECTIONAL:
      return arrival;
    case HEDDLE_LIGHT_BOX: {
      if (!light.is_in_box(point)) return {};
      const dvec3 local = local_in_box(light, point);
      const dvec3 inside = dvec3(vector_of(light.record.half_extent)) - glm::abs(local);
      const dvec3 fade = light.radius > 0.0 ? glm::min(inside / light.radius, dvec3(1.0)) : dvec3(1.0);
      const dvec3 to = light.position - point;
      arrival.distance = std::max(local.z + d(light.record.half_extent[2]), 0.0);
      arrival.value *= fade.x * fade.y * fade.z * light.window(glm::dot(to, to));
      return arrival;
    }
    case HEDDLE_LIGHT_POINT:
    case HEDDLE_LIGHT_SPOT:
    case HEDDLE_LIGHT_CAPSULE:
    case HEDDLE_LIGHT_CONE:
    case HEDDLE_LIGHT_WEDGE:
      break;
    default:
      return {};
  }
  const bool is_capsule = light.record.type == HEDDLE_LIGHT_CAPSULE;
  dvec3 nearest = light.position;
  if (is_capsule || light.record.type == HEDDLE_LIGHT_WEDGE) {
    const double half = 0.5 * d(light.record.segment_length);
    nearest += light.tangent * std::clamp(glm::dot(point - light.position, light.tangent), -half, half);
  }
  const dvec3 to = nearest - point;
  const double squared = glm::dot(to, to);
  arrival.distance = std::sqrt(squared);
  if (squared > 1e-30) arrival.direction = to / arrival.distance;
  const double least = is_capsule ? std::max(kLeastDistance, light.radius) : kLeastDistance;
  double factor = light.window(squared) / std::max(squared, least * least);
  if (light.record.type != HEDDLE_LIGHT_POINT && !is_capsule)
    factor *= angular(light, -glm::dot(arrival.direction, light.direction));
  arrival.value *= factor;
  if (factor <= 0.0) return {};
  return arrival;
}

Arrival sample_light(const Light& light, const dvec3& point, const dvec2& u,
                     std::span<const glm::vec4> light_textures) {
  if (light.record.type == HEDDLE_LIGHT_SPHERE) return sample_ball(light, point, u);
  if (light.record.type == HEDDLE_LIGHT_RECTANGLE) return sample_rectangle(light, point, u, light_textures);
  return sample_disc(light, u);
}

Arrival meet_light(const Light& light, const dvec3& point, const dvec3& direction, double first, double length,
                   std::span<const glm::vec4> light_textures) {
  if (light.record.type == HEDDLE_LIGHT_SPHERE) {
    if (light.radius <= 0.0) return {};
    const double distance = distance_to_ball(light, point, direction);
    if (!(distance > first && distance <= length)) return {};
    const Ball ball(light, point);
    return {direction, distance, light.intensity * light.window(ball.distance_squared), ball.pdf()};
  }
  if (light.record.type == HEDDLE_LIGHT_RECTANGLE) {
    // Along the plane: infinite, or no number, and not met. Most rays miss: how large the light is seen comes last.
    const double distance = glm::dot(light.position - point, light.direction) / glm::dot(direction, light.direction);
    if (!(distance > first && distance <= length)) return {};
    const dvec3 on = point + direction * distance - light.position;
    const dvec2 place(glm::dot(on, light.tangent), glm::dot(on, light.bitangent));
    if (std::abs(place.x) > d(light.record.half_extent[0]) || std::abs(place.y) > d(light.record.half_extent[1]))
      return {};
    const SphericalRectangle seen(light, point);
    if (!seen.is_seen()) return {};
    return {direction, distance, rectangle_value(light, point, place, light_textures), seen.pdf(place)};
  }
  // A disc, infinitely far away.
  const dvec3 off = direction + light.direction;  // chord: |off|^2 = 2 (1 - cos)
  if (0.5 * glm::dot(off, off) > one_minus_cos(disc_sine_squared(light))) return {};
  return disc_arrival(light, direction);
}

}  // namespace heddle::path_tracer
