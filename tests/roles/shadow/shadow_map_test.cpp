// SPDX-License-Identifier: Apache-2.0
// How far shadow_map is from geometry as its knobs rise: the edge of a half plane's shadow on a floor, whose
// displacement README equation (1) says. Prints the tables of the README.
#include "patch.hpp"

#include "views.hpp"

#include <fmt/format.h>

namespace shadow_map_float64 {
using namespace glm;
#define float double
#include "normal_offset.glsl"
#undef float
}  // namespace shadow_map_float64

namespace {

using namespace rendering;
using shadow_patch::ask;
using shadow_patch::Patch;

struct Settings {
  double incidence = kPi / 4;  // radians, of the light against the floor's normal
  std::uint32_t resolution = 1024;
  std::uint32_t cascades = 3;
  std::uint32_t filter_taps = 9;
  double filter_radius = 1.5;
};

/// A half plane, x < 0, half a metre over the floor, under a directional light that comes half a radian off its edge's
/// normal: an edge along a map's rows or columns would lie alike in all of its texels.
class Edge {
 public:
  static constexpr double kHeight = 0.5;
  static constexpr double kDistance = 60.0;        // default of `distance`, metres
  static constexpr double kCasterDistance = 10.0;  // metres; 200, the default, adds 0.2 mm of rounding slack
  static constexpr double kTexels = 48.0;          // side of the patch, in texels

  explicit Edge(const Settings& settings) : settings_(settings) {
    const double azimuth = 0.5;
    const double theta = settings.incidence;
    to_light_ = {std::sin(theta) * std::cos(azimuth), std::cos(theta), std::sin(theta) * std::sin(azimuth)};
    place_ = -kHeight * to_light_.x / to_light_.y;

    const double resolution = settings.resolution;
    const double reach = kDistance / std::pow(shadow_map::kCascadeRatio, settings.cascades - 1.0);
    HeddleView camera{};
    camera.half_size[0] = camera.half_size[1] = static_cast<float>(std::tan(0.5));
    radius_ = depth_maps::bounding_sphere(camera, reach).radius;
    // As cascade_view: a border for the filter, and half a texel on each side for the grid that stands still.
    const double inside = resolution - 2.0 * depth_maps::guard_texels(settings.filter_radius);
    texel_ = 2.0 * radius_ / inside * (resolution / (resolution - 1.0));

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
    image_ = ask(
        scene, patch_,
        shadow_patch::shadow_map(fmt::format(
            "params.resolution = {}\nparams.cascades = {}\nparams.filter_taps = {}\nparams.filter_radius = {}\n"
            "params.caster_distance = {}\n",
            settings.resolution, settings.cascades, settings.filter_taps, settings.filter_radius, kCasterDistance)));
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
    const double d = shadow_map_float64::normal_offset(settings_.filter_radius, texel_, std::sin(settings_.incidence),
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
      const double u = (x - middle) * across() / (settings_.filter_radius * texel_);
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

  Settings settings_;
  dvec3 to_light_;
  double place_ = 0;  // x of the shadow's edge on the floor
  double radius_ = 0;
  double texel_ = 0;
  Patch patch_;
  Image image_;
};

void print_row(const char* knob, double value, const Edge& edge) {
  std::printf("  %s %4g: texel %6.2f mm, edge too long by %6.2f mm (expected %6.2f), wrongly lit %6.2f mm\n", knob,
              value, 1e3 * edge.texel(), 1e3 * edge.displacement(), 1e3 * edge.expected_displacement(),
              1e3 * edge.wrong_width());
}

TEST(ShadowMapMeasured, EdgeIsDisplacedByTheNormalOffsetAtEveryIncidence) {
  // Under steeper light the map's axes are the scene's, and the edge is drawn along a row: off by up to half a texel.
  for (const double degrees : {30.0, 45.0, 60.0}) {
    for (const double radius : {0.0, 1.5, 4.0}) {
      Settings settings;
      settings.incidence = degrees * kPi / 180.0;
      settings.filter_radius = radius;
      settings.filter_taps = radius > 0.0 ? 16 : 1;
      const Edge edge(settings);
      EXPECT_NEAR(edge.displacement(), edge.expected_displacement(), edge.staircase())
          << degrees << " degrees, radius " << radius;
    }
  }
}

TEST(ShadowMapMeasured, ErrorIsOfFirstOrderInTheTexelAsResolutionRises) {
  double last = 0;
  for (const std::uint32_t resolution : {512U, 1024U, 2048U, 4096U}) {
    Settings settings;
    settings.resolution = resolution;
    const Edge edge(settings);
    print_row("resolution", resolution, edge);
    EXPECT_NEAR(edge.displacement(), edge.expected_displacement(), edge.staircase()) << resolution;
    // Half the texel, half the error; the border of the maps, 9 texels each, makes it a little more than half.
    if (last > 0) {
      EXPECT_NEAR(last / edge.wrong_width(), 2.0, 0.15) << resolution;
    }
    last = edge.wrong_width();
  }
}

TEST(ShadowMapMeasured, EachCascadeMakesTheNearErrorAThird) {
  double last = 0;
  for (const std::uint32_t cascades : {1U, 2U, 3U, 4U}) {
    Settings settings;
    settings.cascades = cascades;
    const Edge edge(settings);
    print_row("cascades", cascades, edge);
    EXPECT_NEAR(edge.displacement(), edge.expected_displacement(), edge.staircase()) << cascades;
    if (last > 0) {
      EXPECT_NEAR(last / edge.wrong_width(), 3.0, 0.15) << cascades;
    }
    last = edge.wrong_width();
  }
}

TEST(ShadowMapMeasured, TapsApproachTheDisk) {
  std::vector<double> errors;
  for (const std::uint32_t taps : {1U, 4U, 9U, 16U, 25U, 49U}) {
    Settings settings;
    settings.filter_taps = taps;
    settings.filter_radius = 4.0;
    const Edge edge(settings);
    errors.push_back(edge.profile_error());
    std::printf("  filter_taps %2u: RMSE of the penumbra %.4f\n", taps, errors.back());
    if (errors.size() < 3) continue;
    // Taps spread evenly: faster than random ones, whose error goes with the root of their number. One tap is the
    // centre.
    EXPECT_LT(errors.back(), errors[1] / std::sqrt(taps / 4.0)) << taps;
  }
}

}  // namespace
