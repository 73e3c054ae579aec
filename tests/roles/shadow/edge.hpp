// SPDX-License-Identifier: Apache-2.0
// The edge of a half plane's shadow on a floor: where depth maps put it, against geometry and the normal offset.
#pragma once

#include "normal_offset.hpp"
#include "patch.hpp"

#include <fmt/format.h>

namespace shadow_edge {

using namespace rendering;
using shadow_patch::ask;
using shadow_patch::Patch;

struct Filter {
  double incidence = kPi / 4;  // radians, of the light against the floor's normal
  std::uint32_t taps = 9;
  double radius = 1.5;  // texels
};

/// As the camera of Edge sees.
inline HeddleView camera_of_edge() {
  HeddleView camera{};
  camera.half_size[0] = camera.half_size[1] = static_cast<float>(std::tan(0.5));
  return camera;
}

/// A half plane, x < 0, half a metre over the floor, under a directional light that comes half a radian off its edge's
/// normal: an edge along a map's rows or columns would lie alike in all of its texels. The camera looks at the edge,
/// half a radian to each side.
class Edge {
 public:
  static constexpr double kHeight = 0.5;
  static constexpr double kCasterDistance = 10.0;  // metres; 200, the default, adds 0.2 mm of rounding slack
  static constexpr double kTexels = 48.0;          // side of the patch, in texels

  /// `parameters`: of the technique, beside the filter's. `texel`, `radius`: of the map that the patch lies in, metres.
  Edge(const Filter& filter, const std::string& technique, const std::string& parameters, double texel, double radius)
      : filter_(filter), radius_(radius), texel_(texel) {
    const double azimuth = 0.5;
    const double theta = filter.incidence;
    to_light_ = {std::sin(theta) * std::cos(azimuth), std::cos(theta), std::sin(theta) * std::sin(azimuth)};
    place_ = -kHeight * to_light_.x / to_light_.y;

    patch_.grid = 128;
    const double side = kTexels * texel_;
    patch_.corner = {place_ - 0.5 * side, 0, -0.5 * side};
    patch_.edge_u = {side, 0, 0};
    patch_.edge_v = {0, 0, side};
    patch_.normal = {0, 1, 0};
    const dvec3 centre(place_, 0, 0);
    patch_.camera = centre + dvec3(0.25, 1.0, 0.5);

    Scene scene;
    scene.add_floor({0, 0, 0}, 30.0);
    scene.add_floor({-10, kHeight, 0}, 10.0);
    scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, -to_light_));
    scene.look(patch_.camera, centre);
    image_ = ask(scene, patch_,
                 "[[pass]]\nname = \"shadow\"\nrole = \"shadow\"\ntechnique = \"" + technique + "\"\n" +
                     fmt::format("params.filter_taps = {}\nparams.filter_radius = {}\nparams.caster_distance = {}\n",
                                 filter.taps, filter.radius, kCasterDistance) +
                     parameters);
  }

  /// Metres of the map that one texel spans.
  [[nodiscard]] double texel() const { return texel_; }

  /// Metres on the floor by which the shadow is too long.
  [[nodiscard]] double displacement() const {
    double dark = 0;
    for_each([&](double, double visibility) { dark += 1.0 - visibility; });
    return (dark / points() - 0.5) * kTexels * texel_;
  }
  /// The same by equation (1): a lookup d off the floor meets the ray that reaches the floor d tan(incidence) farther.
  [[nodiscard]] double expected_displacement() const {
    const double from_light = radius_ + kCasterDistance;
    const double d =
        normal_offset_float64::normal_offset(filter_.radius, texel_, std::sin(filter_.incidence),
                                             glm::length(patch_.camera - dvec3(place_, 0, 0)) + from_light);
    return d * to_light_.x / to_light_.y;
  }
  /// Metres: wrongly lit area, |visibility - geometry|, of a metre of edge.
  [[nodiscard]] double wrong_width() const {
    double wrong = 0;
    for_each([&](double x, double visibility) { wrong += std::abs(visibility - (x < place_ ? 0.0 : 1.0)); });
    return wrong / points() * kTexels * texel_;
  }
  /// A tenth of a texel of the map, on the floor: what the steps of an edge drawn into texels leave over 48 of them
  /// where it crosses rows and columns at an angle.
  [[nodiscard]] double staircase() const { return 0.1 * texel_ / across(); }
  /// Root mean square, over the penumbra, of the visibility against a disk of `filter_radius` cut by the edge.
  [[nodiscard]] double profile_error() const {
    const double middle = place_ + expected_displacement();
    double sum = 0;
    int count = 0;
    for_each([&](double x, double visibility) {
      const double u = (x - middle) * across() / (filter_.radius * texel_);
      if (std::abs(u) >= 1.0) return;
      const double open = 0.5 + (u * std::sqrt(1.0 - u * u) + std::asin(u)) / kPi;
      sum += (visibility - open) * (visibility - open);
      ++count;
    });
    return std::sqrt(sum / count);
  }

 private:
  /// Metres across the edge in the map, of one on the floor along x.
  [[nodiscard]] double across() const { return to_light_.y / std::sqrt(1.0 - to_light_.z * to_light_.z); }
  [[nodiscard]] double points() const { return static_cast<double>(patch_.grid) * patch_.grid; }
  template <typename Visit>
  void for_each(Visit visit) const {
    for (std::uint32_t y = 0; y < patch_.grid; ++y) {
      for (std::uint32_t x = 0; x < patch_.grid; ++x) visit(patch_.point(x, y).x, image_.at(x, y));
    }
  }

  Filter filter_;
  dvec3 to_light_;
  double place_ = 0;  // x of the shadow's edge on the floor
  double radius_ = 0;
  double texel_ = 0;
  Patch patch_;
  Image image_;
};

inline void print_row(const char* knob, double value, const Edge& edge) {
  std::printf("  %s %4g: texel %6.2f mm, edge too long by %6.2f mm (expected %6.2f), wrongly lit %6.2f mm\n", knob,
              value, 1e3 * edge.texel(), 1e3 * edge.displacement(), 1e3 * edge.expected_displacement(),
              1e3 * edge.wrong_width());
}

}  // namespace shadow_edge
