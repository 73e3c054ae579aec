// SPDX-License-Identifier: Apache-2.0
// plugins/shared/light_volume.glsl, compiled here as C++ (glm; literals are float by a compiler option, as in GLSL),
// against the definition of each shape in float64: no light is missed that reaches a point of a cell, and how many are
// listed for nothing. Needs no device.
#include "random.hpp"

#include <glm/glm.hpp>

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdio>
#include <numbers>
#include <string>
#include <vector>

namespace glsl {
using namespace glm;
#define VULKAN  // the records as shaders see them
#include <heddle/records.h>
#undef VULKAN
#include "shared/light_volume.glsl"
}  // namespace glsl

namespace {

using glm::dmat3;
using glm::dvec3;
using glm::vec3;
using glsl::FrustumCell;
using glsl::HeddleLight;
using glsl::HeddleView;
using glsl::LightVolume;

// With literals float by option, these are double.
constexpr double operator""_d(long double value) {
  return static_cast<double>(value);
}
constexpr double operator""_d(unsigned long long value) {
  return static_cast<double>(value);
}
constexpr double kPi = std::numbers::pi_v<double>;

/// A camera at the origin that looks along -Z: a cell's axes are the world's with z turned.
HeddleView plain_view() {
  HeddleView view{};
  view.view_from_rel = view.rel_from_view = glm::mat4(1.0F);
  return view;
}
/// Rounds, whatever the optimizer makes of a conversion there and back (GCC 12 leaves both out where it vectorizes).
vec3 float_of(const dvec3& v) {
  const volatile float x = static_cast<float>(v.x), y = static_cast<float>(v.y), z = static_cast<float>(v.z);
  return {x, y, z};
}
dvec3 world_from_cell(const dvec3& p) {
  return {p.x, p.y, -p.z};
}

/// A tile of 16 pixels of a 1280 x 720 image with 1 radian of height, and a range of depths, of metres times `unit`.
FrustumCell random_cell(Random& random, double unit, bool is_orthographic) {
  const double half_y = is_orthographic ? 5_d * unit : std::tan(0.5_d), half_x = half_y * 1280_d / 720_d;
  const double x = random.below(80), y = random.below(45);
  FrustumCell cell{};
  cell.is_orthographic = is_orthographic;
  cell.bounds = {static_cast<float>((x / 40_d - 1_d) * half_x), static_cast<float>(((x + 1_d) / 40_d - 1_d) * half_x),
                 static_cast<float>((y / 22.5_d - 1_d) * half_y),
                 static_cast<float>(((y + 1_d) / 22.5_d - 1_d) * half_y)};
  const double thickness[] = {0_d, 1e-3_d, 0.1_d, 0.5_d, 2_d};
  cell.near_distance = static_cast<float>(unit * random.log_uniform(0.1_d, 50_d));
  cell.far_distance = cell.near_distance * static_cast<float>(std::exp(thickness[random.below(5)]));
  return cell;
}

dvec3 point_of(const FrustumCell& cell, double u, double v, double w) {
  const double x = std::lerp(double(cell.bounds.x), double(cell.bounds.y), u);
  const double y = std::lerp(double(cell.bounds.z), double(cell.bounds.w), v);
  const double z = std::lerp(double(cell.near_distance), double(cell.far_distance), w);
  return cell.is_orthographic ? dvec3(x, y, z) : dvec3(x * z, y * z, z);
}

constexpr std::uint32_t kTypes[] = {HEDDLE_LIGHT_POINT,   HEDDLE_LIGHT_SPOT,     HEDDLE_LIGHT_SPHERE,
                                    HEDDLE_LIGHT_CAPSULE, HEDDLE_LIGHT_CONE,     HEDDLE_LIGHT_WEDGE,
                                    HEDDLE_LIGHT_BOX,     HEDDLE_LIGHT_RECTANGLE};
constexpr const char* kTypeNames[] = {"point", "spot", "sphere", "capsule", "cone", "wedge", "box", "rectangle"};

bool has_cone(std::uint32_t type) {
  return type == HEDDLE_LIGHT_SPOT || type == HEDDLE_LIGHT_CONE || type == HEDDLE_LIGHT_WEDGE;
}
bool has_segment(std::uint32_t type) {
  return type == HEDDLE_LIGHT_CAPSULE || type == HEDDLE_LIGHT_WEDGE;
}

/// Without its position.
HeddleLight random_light(Random& random, std::uint32_t type, double unit) {
  HeddleLight light{};
  light.type = type;
  light.intensity = vec3(1.0F);
  const dvec3 d = random.direction(), t = glm::normalize(glm::cross(d, random.direction()));
  light.direction = float_of(d);
  light.tangent = float_of(t);
  light.range = static_cast<float>(unit * random.log_uniform(0.1_d, 30_d));
  light.radius = light.range * 0.1F;
  if (has_segment(type)) light.segment_length = static_cast<float>(unit * random.log_uniform(1e-3_d, 10_d));
  for (int i = 0; i < 3; ++i) light.half_extent[i] = static_cast<float>(unit * random.log_uniform(0.05_d, 5_d));
  if (type == HEDDLE_LIGHT_BOX && random.below(2) == 0) light.range = 0.0F;
  if (has_cone(type)) {
    // Half angles up to a right one, and beyond.
    light.cos_outer = static_cast<float>(std::cos(random.uniform(0.02_d, random.below(4) == 0 ? 3_d : 0.5_d * kPi)));
    light.cos_inner = light.cos_outer + 0.1F;
  }
  return light;
}

/// The definition: whether a light at the origin reaches p, by light.glsl without its rounding.
bool reaches(const HeddleLight& light, const dvec3& p) {
  const dvec3 d(light.direction), t(light.tangent);
  if (light.type == HEDDLE_LIGHT_BOX) {
    const double local[] = {glm::dot(p, t), glm::dot(p, glm::cross(d, t)), glm::dot(p, d)};
    for (int i = 0; i < 3; ++i)
      if (std::abs(local[i]) >= double(light.half_extent[i])) return false;
    return light.range <= 0.0F || glm::length(p) < double(light.range);
  }
  const double half = has_segment(light.type) ? 0.5_d * double(light.segment_length) : 0_d;
  const dvec3 v = p - t * std::clamp(glm::dot(p, t), -half, half);
  const double distance = glm::length(v);
  if (light.range > 0.0F && distance >= double(light.range)) return false;
  if (light.type == HEDDLE_LIGHT_RECTANGLE) return glm::dot(p, d) > 0_d;
  return !has_cone(light.type) || glm::dot(v, d) > distance * double(light.cos_outer);
}

/// A point of the surface of a light at the origin; its direction to the inside is not asked for.
dvec3 surface_point(Random& random, const HeddleLight& light) {
  const dvec3 d(light.direction), t(light.tangent), b = glm::cross(d, t);
  const double along = has_segment(light.type) ? random.uniform(-0.5_d, 0.5_d) * double(light.segment_length) : 0_d;
  const double range = double(light.range);
  if (light.type == HEDDLE_LIGHT_BOX) {
    double q[3];
    for (double& x : q) x = random.uniform(-1_d, 1_d);
    q[random.below(3)] = random.below(2) == 0 ? 1_d : -1_d;  // a face; edges and corners by the second and third draw
    if (random.below(2) == 0) q[random.below(3)] = 1_d;
    const dvec3 p = t * (q[0] * double(light.half_extent.x)) + b * (q[1] * double(light.half_extent.y)) +
                    d * (q[2] * double(light.half_extent.z));
    const double size = glm::length(p);
    return range > 0_d && size > range ? p * (range / size) : p;
  }
  dvec3 w = random.direction();
  double r = range;
  if (has_cone(light.type) || light.type == HEDDLE_LIGHT_RECTANGLE) {
    const double cos_outer = has_cone(light.type) ? double(light.cos_outer) : 0_d;
    const double phi = random.uniform(0_d, 2_d * kPi);
    const dvec3 u = t * std::cos(phi) + b * std::sin(phi);
    const bool is_on_cap = random.below(2) == 0;
    const double cosine = is_on_cap ? random.uniform(cos_outer, 1_d) : cos_outer;
    w = d * cosine + u * std::sqrt(std::max(1_d - cosine * cosine, 0_d));
    if (!is_on_cap) r = range * random.uniform(0_d, 1_d);
  }
  return t * along + w * r;
}

bool is_listed(const HeddleLight& light, const FrustumCell& cell, std::uint32_t steps) {
  const LightVolume volume = glsl::light_volume(light, plain_view());
  if (volume.kind == glsl::kLightReachesNothing) return false;
  if (volume.kind == glsl::kLightReachesAll) return true;
  const glm::vec2 depths = glsl::light_depths(volume);
  if (depths.y < cell.near_distance || depths.x > cell.far_distance) return false;
  for (const bool is_y : {false, true}) {
    const int first = is_y ? 2 : 0;
    if (glsl::light_is_beyond(volume, cell.is_orthographic, is_y, cell.bounds[first], 1.0F)) return false;
    if (glsl::light_is_beyond(volume, cell.is_orthographic, is_y, cell.bounds[first + 1], -1.0F)) return false;
  }
  FrustumCell clipped = cell;
  clipped.near_distance = std::max(cell.near_distance, std::max(depths.x, 0.0F));
  clipped.far_distance = std::min(cell.far_distance, depths.y);
  return !glsl::light_misses_cell(volume, clipped, steps);
}

TEST(LightVolume, NeverMissesACellWhosePointTheSurfaceTouches) {
  // Lights are placed so that a point of their surface, moved by `inside` of its distance, is a point of the cell, most
  // often a corner. -3e-7: beyond the surface by what light.glsl may round.
  Random random(11);
  const double insides[] = {-3e-7_d, 0_d, 1e-7_d, 1e-6_d, 1e-3_d, 0.3_d};
  int inside_by_definition = 0;
  for (int i = 0; i < 100000; ++i) {
    const double unit = std::array{1e-3_d, 1_d, 1e3_d}[random.below(3)];
    const FrustumCell cell = random_cell(random, unit, i % 5 == 0);
    const std::size_t type = random.below(8);
    HeddleLight light = random_light(random, kTypes[type], unit);
    double at[3];
    for (double& x : at) x = random.below(3) == 0 ? random.uniform(0_d, 1_d) : random.below(2);
    const dvec3 target = world_from_cell(point_of(cell, at[0], at[1], at[2]));
    const dvec3 offset = surface_point(random, light) * (1_d - insides[random.below(6)]);
    light.position_rel = float_of(target - offset);
    for (const std::uint32_t steps : {0U, 4U, 32U}) {
      ASSERT_TRUE(is_listed(light, cell, steps)) << kTypeNames[type] << " " << i << " steps " << steps;
    }
    // The point of a shader is of float32 itself.
    const vec3 point = float_of(target);
    const bool is_inside = reaches(light, dvec3(point) - dvec3(light.position_rel));
    inside_by_definition += is_inside ? 1 : 0;
    ASSERT_TRUE(glsl::light_is_near(light, point) || !is_inside) << kTypeNames[type] << " " << i;
  }
  EXPECT_GT(inside_by_definition, 50000);
}

TEST(LightVolume, NeverMissesACellWithinALightWithoutEnd) {
  Random random(12);
  for (int i = 0; i < 50000; ++i) {
    const FrustumCell cell = random_cell(random, 1_d, i % 5 == 0);
    const std::size_t type = random.below(8);
    HeddleLight light = random_light(random, kTypes[type], 1_d);
    light.range = 0.0F;
    light.position_rel = float_of(random.direction() * random.log_uniform(0.1_d, 1e4_d));
    const dvec3 p =
        world_from_cell(point_of(cell, random.uniform(0_d, 1_d), random.uniform(0_d, 1_d), random.uniform(0_d, 1_d)));
    const vec3 point = float_of(p);
    if (!reaches(light, dvec3(point) - dvec3(light.position_rel))) continue;
    ASSERT_TRUE(is_listed(light, cell, 16)) << kTypeNames[type] << " " << i;
    ASSERT_TRUE(glsl::light_is_near(light, point)) << kTypeNames[type] << " " << i;
  }
}

TEST(LightVolume, DegenerateRecordsAreListedWhereLightGlslMayLight) {
  // No length, no axes, angles exchanged, of no width: whatever lights a point is listed for its cell.
  Random random(13);
  for (int i = 0; i < 50000; ++i) {
    const FrustumCell cell = random_cell(random, 1_d, false);
    const std::size_t type = random.below(8);
    HeddleLight light = random_light(random, kTypes[type], 1_d);
    switch (random.below(6)) {
      case 0:
        light.direction = vec3(0.0F);
        break;
      case 1:
        light.tangent = vec3(0.0F);
        break;
      case 2:
        light.segment_length = 0.0F;
        break;
      case 3:
        light.cos_outer = -1.0F;
        break;
      case 4:
        light.cos_inner = -light.cos_outer;
        break;
      default:
        light.direction *= 0.5F;
        break;
    }
    const dvec3 p = world_from_cell(point_of(cell, random.below(2), random.below(2), random.below(2)));
    light.position_rel = float_of(p + random.direction() * random.uniform(0_d, 1.2_d) * double(light.range));
    const vec3 point = float_of(p);
    if (!reaches(light, dvec3(point) - dvec3(light.position_rel))) continue;
    ASSERT_TRUE(is_listed(light, cell, 16)) << kTypeNames[type] << " " << i;
    ASSERT_TRUE(glsl::light_is_near(light, point)) << kTypeNames[type] << " " << i;
  }
}

// ---- how tight ----

/// The same bodies in float64, and the least distance between two: Gilbert, Johnson and Keerthi's idea in its simplest
/// form (Frank and Wolfe with exact line search) from several starts; a separating direction is a proof.
struct Body {
  const HeddleLight& light;
  dvec3 position;
  [[nodiscard]] dvec3 support(const dvec3& n) const {
    const dvec3 d(light.direction), t(light.tangent), b = glm::cross(d, t);
    const double half = has_segment(light.type) ? 0.5_d * double(light.segment_length) : 0_d;
    const dvec3 on_segment = position + t * std::copysign(half, glm::dot(n, t));
    const double range = double(light.range);
    if (light.type == HEDDLE_LIGHT_BOX) {
      dvec3 corner(0_d);
      const dvec3 axes[] = {t, b, d};
      for (int i = 0; i < 3; ++i) corner += axes[i] * std::copysign(double(light.half_extent[i]), glm::dot(n, axes[i]));
      return on_segment + corner;
    }
    double cos_outer = has_cone(light.type) ? double(light.cos_outer) : -1_d;
    if (light.type == HEDDLE_LIGHT_RECTANGLE) cos_outer = 0_d;
    if (cos_outer < 0_d) return on_segment + n * range;
    const double cosine = glm::dot(n, d);
    if (cosine >= cos_outer) return on_segment + n * range;
    const dvec3 u = n - d * cosine;
    const dvec3 rim = d * cos_outer + u * (std::sqrt(1_d - cos_outer * cos_outer) / std::max(glm::length(u), 1e-30_d));
    return glm::dot(rim, n) > 0_d ? on_segment + rim * range : on_segment;
  }
};

bool are_apart(const Body& body, const FrustumCell& cell) {
  // What lies nearer or farther than the whole body has no part in it.
  const double nearest_depth = -body.support({0_d, 0_d, 1_d}).z, farthest_depth = -body.support({0_d, 0_d, -1_d}).z;
  const double near = std::max(double(cell.near_distance), nearest_depth);
  const double far = std::min(double(cell.far_distance), farthest_depth);
  if (near > far) return true;
  std::vector<dvec3> corners;
  for (const double u : {0_d, 1_d})
    for (const double v : {0_d, 1_d})
      for (const double depth : {near, far}) {
        const double x = std::lerp(double(cell.bounds.x), double(cell.bounds.y), u);
        corners.push_back(
            world_from_cell({x * depth, std::lerp(double(cell.bounds.z), double(cell.bounds.w), v) * depth, depth}));
      }
  const auto cell_support = [&](const dvec3& n) {
    dvec3 best = corners[0];
    for (const dvec3& p : corners)
      if (glm::dot(p, n) < glm::dot(best, n)) best = p;
    return best;
  };
  const auto separates = [&](const dvec3& n) { return glm::dot(n, cell_support(n) - body.support(n)) > 0_d; };
  // The faces of both, the cone's side as each corner sees it; then steps of Chung and Wang from two directions; then
  // of Frank and Wolfe from the nearest pair that was seen.
  std::vector<dvec3> faces;
  for (int i = 0; i < 2; ++i) {
    const double sign = i == 0 ? 1_d : -1_d;
    faces.push_back(sign * dvec3(1_d, 0_d, double(cell.bounds[i])));
    faces.push_back(sign * dvec3(0_d, 1_d, double(cell.bounds[2 + i])));
    for (const dvec3& axis : {dvec3(0_d, 0_d, 1_d), dvec3(body.light.direction), dvec3(body.light.tangent),
                              glm::cross(dvec3(body.light.direction), dvec3(body.light.tangent))})
      faces.push_back(sign * axis);
  }
  for (const dvec3& corner : corners) {
    const dvec3 d(body.light.direction), away = corner - body.position, across = away - d * glm::dot(away, d);
    const double cos_outer = double(body.light.cos_outer);
    faces.push_back(across / glm::length(across) * cos_outer - d * std::sqrt(1_d - cos_outer * cos_outer));
  }
  for (const dvec3& face : faces)
    if (separates(glm::normalize(face))) return true;
  const dvec3 middle = 0.5_d * (corners[0] + corners[7]);
  dvec3 nearest = middle - body.position;
  for (const double ahead : {0_d, 0.5_d}) {
    dvec3 n = glm::normalize(middle - body.position - ahead * double(body.light.range) * dvec3(body.light.direction));
    for (int i = 0; i < 1000; ++i) {
      const dvec3 r = cell_support(n) - body.support(n);
      if (glm::dot(n, r) > 0_d) return true;
      const double size = glm::length(r);
      if (size == 0_d) return false;
      if (size < glm::length(nearest)) nearest = r;
      n = glm::normalize(n - 2_d * glm::dot(n, r / size) * (r / size));
    }
  }
  for (int i = 0; i < 4000; ++i) {
    const double size = glm::length(nearest);
    if (size < 1e-9_d) return false;
    const dvec3 n = nearest / size;
    if (separates(n)) return true;
    const dvec3 step = cell_support(n) - body.support(n) - nearest;
    nearest += step * std::clamp(-glm::dot(nearest, step) / std::max(glm::dot(step, step), 1e-300_d), 0_d, 1_d);
  }
  return false;
}

TEST(LightVolume, ListsFewMoreThanWhatTouches) {
  Random random(14);
  constexpr std::uint32_t kSteps[] = {0, 1, 2, 4, 8, 16};
  std::printf("listed over touched: lights near 16-pixel tiles of 1280 x 720\n%-10s", "steps");
  for (const std::uint32_t steps : kSteps) std::printf("%8u", steps);
  std::printf("\n");
  double total[std::size(kSteps)] = {}, all_touched = 0;
  for (std::size_t type = 0; type < std::size(kTypes); ++type) {
    double listed[std::size(kSteps)] = {}, touched = 0;
    for (int i = 0; i < 800; ++i) {
      const FrustumCell cell = random_cell(random, 1_d, false);
      HeddleLight light = random_light(random, kTypes[type], 1_d);
      if (light.type == HEDDLE_LIGHT_BOX) light.range = 0.0F;
      double reach = double(light.range);
      if (light.type == HEDDLE_LIGHT_BOX) reach = double(glm::length(light.half_extent));
      const dvec3 p = world_from_cell(point_of(cell, 0.5_d, 0.5_d, 0.5_d));
      light.position_rel = float_of(p + random.direction() * reach * random.uniform(0_d, 1.5_d));
      const bool is_touched = !are_apart({light, dvec3(light.position_rel)}, cell);
      touched += is_touched ? 1_d : 0_d;
      for (std::size_t s = 0; s < std::size(kSteps); ++s) {
        const bool is_in_list = is_listed(light, cell, kSteps[s]);
        listed[s] += is_in_list ? 1_d : 0_d;
        ASSERT_TRUE(is_in_list || !is_touched) << kTypeNames[type] << " " << i;
      }
    }
    std::printf("%-10s", kTypeNames[type]);
    for (std::size_t s = 0; s < std::size(kSteps); ++s) {
      std::printf("%8.3f", listed[s] / touched);
      total[s] += listed[s];
    }
    std::printf("\n");
    all_touched += touched;
    EXPECT_LT(listed[3] / touched, 1.1_d) << kTypeNames[type];
    EXPECT_LE(listed[5], listed[3]);
    EXPECT_LE(listed[3], listed[0]);
  }
  std::printf("%-10s", "all");
  for (const double listed : total) std::printf("%8.3f", listed / all_touched);
  std::printf("\n");
}

}  // namespace
