// SPDX-License-Identifier: Apache-2.0
// The reference of ambient occlusion against closed forms: z-scores over independent scramblings, corrected for their
// number, and proof that the same procedure finds a planted bias. Needs no host and no device.
#include "ambient_occlusion/ray_traced/estimator.hpp"
#include "ambient_occlusion/ray_traced/tracer.hpp"
#include "shapes.hpp"

#include <heddle/records.h>

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <set>
#include <string>

namespace {

using namespace heddle::ambient_occlusion;
using glm::dvec3;
using std::numbers::pi;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Independent scramblings of one case: enough that the mean of so many bounded values is normal for the test's purpose.
constexpr std::uint32_t kSeeds = 1024;
constexpr std::uint32_t kSamples = 256;
// Chance that any of the cases fails though all are right; the seeds are fixed, so the outcome is too.
constexpr double kAlpha = 1e-3;

class Scene {
 public:
  explicit Scene(const shapes::Mesh& mesh, std::uint32_t flags = HEDDLE_SURFACE_OPAQUE)
      : flags_(mesh.indices.size(), flags) {
    EXPECT_TRUE(tracer.build({mesh.positions, mesh.indices, flags_})) << tracer.error();
  }

  double visibility(const SurfacePoint& point, double radius, Falloff falloff, std::uint32_t samples,
                    std::uint64_t seed) const {
    return estimate_visibility(point, radius, falloff, samples, seed,
                               [&](const dvec3& origin, double reach, RayBatch& batch) {
                                 tracer.trace(origin, reach, falloff != Falloff::kNone, batch);
                               });
  }

  Tracer tracer;

 private:
  std::vector<std::uint32_t> flags_;
};

SurfacePoint point_at(const dvec3& origin, const dvec3& normal) {
  return {origin, glm::normalize(normal), glm::normalize(normal)};
}

/// Cosine-weighted share of the hemisphere that a sphere of `radius` at `distance`, `theta` off the normal, covers.
/// Above the horizon it is the projected disc, sin^2(half angle) cos(theta); a sphere that the horizon cuts adds the
/// boundary integral along the horizon (contour integration of the projected cap, Lambert's formula for both arcs).
double sphere_occlusion(double radius, double distance, double theta) {
  const double h = distance / radius;
  const double c = std::cos(theta);
  const double cut = 1.0 - h * h * c * c;  // > 0: the cap crosses the horizon
  if (cut <= 0.0) {
    return std::max(0.0, c) / (h * h);
  }
  const double g = std::sqrt(h * h - 1.0);
  return ((c * std::acos(-c * g / std::sin(theta)) - std::sqrt(cut) * g) / (h * h) + std::atan(std::sqrt(cut) / g)) /
         pi;
}

/// The same by quadrature over the cap's polar angle: the integral over its azimuth is elementary.
double sphere_occlusion_by_quadrature(double radius, double distance, double theta) {
  const double half_angle = std::asin(radius / distance);
  const auto ring = [&](double psi) {
    const double a = std::cos(theta) * std::cos(psi);
    const double b = std::sin(theta) * std::sin(psi);
    const double phi = a >= b ? pi : a <= -b ? 0.0 : std::acos(-a / b);
    return 2.0 * std::sin(psi) * (a * phi + b * std::sin(phi)) / pi;
  };
  constexpr int kIntervals = 200000;  // midpoint rule; the integrand has a square-root kink: error ~ 1e-8
  double sum = 0.0;
  for (int i = 0; i < kIntervals; ++i) {
    sum += ring((i + 0.5) * half_angle / kIntervals);
  }
  return sum * half_angle / kIntervals;
}

/// Infinite wall, its normal in the tangent plane, at distance c * radius: the directions with omega_x > c project to
/// a segment of the unit disc.
double wall_occlusion(double c) {
  return (std::acos(c) - c * std::sqrt(1.0 - c * c)) / pi;
}

/// The same with linear fall-off: 1/pi times the integral over x in (c, 1) of (1 - c/x) 2 sqrt(1 - x^2).
double wall_occlusion_linear(double c) {
  const double s = std::sqrt(1.0 - c * c);
  return (std::acos(c) + c * s - 2.0 * c * std::atanh(s)) / pi;
}

struct Case {
  std::string name;
  double truth;  // visibility
  std::function<double(std::uint64_t seed)> estimate;
};

std::vector<Case> closed_form_cases() {
  std::vector<Case> cases;
  // A rotated frame far from the origin of the scene: nothing may depend on axes or place.
  const dvec3 up = glm::normalize(dvec3(0.3, 0.8, -0.5));
  const dvec3 side = glm::normalize(glm::cross(up, dvec3(0.2, 0.1, 1.0)));
  const dvec3 place(37.0, -12.0, 55.0);

  struct Ball {
    double radius, distance, theta;
  };
  for (const Ball& ball : {Ball{1.0, 1.9, 0.0}, Ball{1.0, 2.0, 0.9}, Ball{0.5, 3.0, 0.6}, Ball{1.0, 1.05, 0.1},
                           Ball{1.0, 2.0, 1.3}, Ball{1.0, 1.2, 1.0}, Ball{1.0, 1.5, pi / 2}, Ball{1.0, 1.4, 1.9}}) {
    const dvec3 center = place + ball.distance * (std::cos(ball.theta) * up + std::sin(ball.theta) * side);
    auto scene = std::make_shared<Scene>(shapes::sphere(center, ball.radius, 6));
    cases.push_back({"sphere " + std::to_string(ball.radius) + " at " + std::to_string(ball.distance) + ", " +
                         std::to_string(ball.theta) + " rad",
                     1.0 - sphere_occlusion(ball.radius, ball.distance, ball.theta), [=](std::uint64_t seed) {
                       return scene->visibility(point_at(place, up), 100.0, Falloff::kNone, kSamples, seed);
                     }});
  }
  for (const double c : {0.1, 0.4, 0.8}) {
    for (const Falloff falloff : {Falloff::kNone, Falloff::kLinear}) {
      const double radius = 2.5;
      const dvec3 along = glm::cross(up, side);
      auto scene = std::make_shared<Scene>(shapes::quad(place + c * radius * side, 10.0 * up, 10.0 * along));
      cases.push_back({(falloff == Falloff::kNone ? "wall " : "wall, linear, ") + std::to_string(c),
                       1.0 - (falloff == Falloff::kNone ? wall_occlusion(c) : wall_occlusion_linear(c)),
                       [=](std::uint64_t seed) {
                         return scene->visibility(point_at(place, up), radius, falloff, kSamples, seed);
                       }});
    }
  }
  // A half plane that starts at a line on the floor, at -side, and leaves it at `tilt` against +side leaves open what
  // is below tilt, wherever the line is: (1 - cos tilt) / 2. Ending after 2e4 times the distance of the line, it lets
  // less than 1e-4 through.
  for (const double tilt : {0.7, 1.2, 2.4}) {
    const double reach = 2e4;
    const dvec3 rise = std::cos(tilt) * side + std::sin(tilt) * up;
    auto scene = std::make_shared<Scene>(
        shapes::quad(place - side + 0.5 * reach * rise, 0.5 * reach * rise, reach * glm::cross(up, side)));
    cases.push_back({"slope " + std::to_string(tilt), 0.5 * (1.0 - std::cos(tilt)), [=](std::uint64_t seed) {
                       return scene->visibility(point_at(place, up), kInfinity, Falloff::kNone, kSamples, seed);
                     }});
  }
  return cases;
}

struct Estimates {
  std::string name;
  double truth;
  std::vector<double> values;
};

const std::vector<Estimates>& estimates() {
  static const std::vector<Estimates> all = [] {
    std::vector<Estimates> made;
    std::uint64_t seed = 1;
    for (const Case& one : closed_form_cases()) {
      Estimates& entry = made.emplace_back(Estimates{one.name, one.truth, {}});
      for (std::uint32_t i = 0; i < kSeeds; ++i) {
        entry.values.push_back(one.estimate(mix_bits(seed++)));
      }
    }
    return made;
  }();
  return all;
}

double z_score(const std::vector<double>& values, double truth) {
  double mean = 0.0;
  for (const double value : values) {
    mean += value / static_cast<double>(values.size());
  }
  double variance = 0.0;
  for (const double value : values) {
    variance += (value - mean) * (value - mean) / static_cast<double>(values.size() - 1);
  }
  return (mean - truth) / std::sqrt(variance / static_cast<double>(values.size()));
}

/// |z| beyond which one of `count` independent two-sided tests is significant at kAlpha for all together (Sidak 1967).
double critical_z(std::size_t count) {
  const double alpha = 1.0 - std::pow(1.0 - kAlpha, 1.0 / static_cast<double>(count));
  double low = 0.0;
  double high = 10.0;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (std::erfc(middle / std::sqrt(2.0)) > alpha ? low : high) = middle;
  }
  return high;
}

TEST(RayTraced, ClosedFormOfACutSphereEqualsQuadrature) {
  for (const double theta : {0.0, 0.5, 1.0, 1.3, pi / 2, 1.9}) {
    for (const double distance : {1.05, 1.2, 2.0, 5.0}) {
      EXPECT_NEAR(sphere_occlusion(1.0, distance, theta), sphere_occlusion_by_quadrature(1.0, distance, theta), 1e-7)
          << distance << " " << theta;
    }
  }
}

TEST(RayTraced, AgreesWithClosedForms) {
  const double critical = critical_z(estimates().size());
  for (const Estimates& one : estimates()) {
    const double z = z_score(one.values, one.truth);
    RecordProperty(one.name, std::to_string(z));
    std::printf("  %-45s truth %.6f  z %6.2f (critical %.2f)\n", one.name.c_str(), one.truth, z, critical);
    EXPECT_LT(std::abs(z), critical) << one.name;
  }
}

TEST(RayTraced, TheSameProcedureFindsABiasOfTwoPercent) {
  // Of visibility: in every single case. Of occlusion, which is small in most of them: somewhere, as one failure is
  // enough for the procedure to fail.
  const double critical = critical_z(estimates().size());
  for (const double factor : {0.98, 1.02}) {
    int found = 0;
    for (const Estimates& one : estimates()) {
      std::vector<double> of_visibility;
      std::vector<double> of_occlusion;
      for (const double value : one.values) {
        of_visibility.push_back(factor * value);
        of_occlusion.push_back(1.0 - factor * (1.0 - value));
      }
      EXPECT_GT(std::abs(z_score(of_visibility, one.truth)), critical) << one.name;
      found += std::abs(z_score(of_occlusion, one.truth)) > critical ? 1 : 0;
    }
    EXPECT_GE(found, 10) << "of " << estimates().size();
  }
}

TEST(RayTraced, EverythingIsClosedInsideASphereAndOpenInEmptySpace) {
  const Scene inside(shapes::sphere({0, 0, 0}, 1.0, 4));
  const Scene outside(shapes::sphere({0, 10, 0}, 1.0, 4));
  for (std::uint64_t seed = 0; seed < 64; ++seed) {
    const dvec3 normal = glm::normalize(dvec3(std::cos(double(seed)), std::sin(2.0 * double(seed)), 0.3));
    EXPECT_EQ(inside.visibility(point_at(-0.9 * normal, normal), 2.0, Falloff::kNone, 256, seed), 0.0);
    EXPECT_EQ(outside.visibility(point_at({0, 0, 0}, normal), 2.0, Falloff::kNone, 256, seed), 1.0);
    EXPECT_EQ(outside.visibility(point_at({0, 0, 0}, normal), 2.0, Falloff::kLinear, 256, seed), 1.0);
  }
}

TEST(RayTraced, OccludesFromBothSides) {
  const Scene front(shapes::quad({1, 0, 0}, {0, 5, 0}, {0, 0, 5}));
  const Scene back(shapes::quad({1, 0, 0}, {0, 0, 5}, {0, 5, 0}));
  const SurfacePoint point = point_at({0, 0, 0}, {0, 1, 0});
  const double visibility = front.visibility(point, 3.0, Falloff::kLinear, 256, 5);
  EXPECT_LT(visibility, 0.9);
  EXPECT_EQ(visibility, back.visibility(point, 3.0, Falloff::kLinear, 256, 5));
}

TEST(RayTraced, AHoleOfTheAlphaMaskLetsRaysThrough) {
  const shapes::Mesh wall = shapes::quad({1, 0, 0}, {0, 10, 0}, {0, 0, 10});
  Scene scene(wall, HEDDLE_SURFACE_MASKED);
  const SurfacePoint point = point_at({0, 0, 0}, {0, 1, 0});
  const double solid = scene.visibility(point, 3.0, Falloff::kNone, 1024, 3);
  EXPECT_NEAR(solid, 1.0 - wall_occlusion(1.0 / 3.0), 0.01);
  // The hole is what lies at z > 0: half of the occlusion, by symmetry.
  scene.tracer.set_alpha_test({[](void* user, std::uint32_t triangle, float u, float v) {
                                 const auto& mesh = *static_cast<const shapes::Mesh*>(user);
                                 const glm::uvec3 c = mesh.indices[triangle];
                                 const glm::vec3 p = (1 - u - v) * mesh.positions[c.x] + u * mesh.positions[c.y] +
                                                     v * mesh.positions[c.z];
                                 return p.z <= 0.0F;
                               },
                               const_cast<shapes::Mesh*>(&wall)});
  EXPECT_NEAR(1.0 - scene.visibility(point, 3.0, Falloff::kNone, 1024, 3), 0.5 * (1.0 - solid), 0.005);
  EXPECT_NEAR(1.0 - scene.visibility(point, 3.0, Falloff::kLinear, 1024, 3), 0.5 * wall_occlusion_linear(1.0 / 3.0),
              0.005);
}

TEST(RayTraced, BlendedSurfacesDoNotOcclude) {
  const Scene scene(shapes::quad({1, 0, 0}, {0, 10, 0}, {0, 0, 10}), HEDDLE_SURFACE_BLENDED);
  EXPECT_EQ(scene.visibility(point_at({0, 0, 0}, {0, 1, 0}), 3.0, Falloff::kNone, 64, 1), 1.0);
}

TEST(RayTraced, APlaneNeverOccludesItself) {
  // Planes of 20 km, tilted, near and far from the origin, in units of 1 m, 1 mm and 1 km; points are off the plane by
  // what a depth image may be off: 1e-6 of the distance.
  for (const double unit : {1e-3, 1.0, 1e3}) {
    for (const dvec3& normal : {dvec3(0, 1, 0), glm::normalize(dvec3(0.1, 1, 0.3)), glm::normalize(dvec3(3, 1, -2))}) {
      for (const double offset : {0.0, 700.0}) {
        const glm::dmat3 frame = basis_around(normal);
        const Scene scene(shapes::quad(unit * offset * normal, unit * 1e4 * frame[0], unit * 1e4 * frame[1]));
        for (std::uint32_t i = 0; i < 200; ++i) {
          const glm::dvec2 u = Sobol2(9).point(i);
          const double distance = unit * std::pow(10.0, 4.0 * u.x - 1.0);
          const dvec3 foot = unit * offset * normal + distance * 0.5 * (frame[0] * std::cos(7 * u.y) + frame[1] * u.y);
          const double grazing = 0.01 + u.y;
          const dvec3 view = -glm::normalize(grazing * normal + frame[0]);
          const dvec3 point = foot + view * (distance * 1e-6 * (i % 2 == 0 ? 1.0 : -1.0));
          const SurfacePoint start = scene.tracer.anchor(point, view, normal, distance * 1e-5);
          EXPECT_EQ(scene.visibility(start, unit, Falloff::kNone, 64, i), 1.0) << unit << " " << offset << " " << i;
          // ... and the offset stays small beside the size of the plane's coordinates.
          EXPECT_LT(glm::dot(start.origin - foot, normal), unit * 2e4 * 1e-6);
        }
      }
    }
  }
}

TEST(RayTraced, AnchorsToTheSurfaceThatThePointBelongsTo) {
  shapes::Mesh mesh = shapes::quad({0, 0, 0}, {5, 0, 0}, {0, 0, -5});
  mesh.add(shapes::quad({0, 0.01, 0}, {1, 0, 0}, {0, 0, -1}));
  const Scene scene(mesh);
  const dvec3 view = glm::normalize(dvec3(0.2, -1, 0.1));
  const SurfacePoint low = scene.tracer.anchor({0.3, 1e-4, 0.2}, view, {0, 1, 0}, 5e-4);
  EXPECT_NEAR(low.origin.y, 0.0, 5e-6);
  const SurfacePoint high = scene.tracer.anchor({0.3, 0.0101, 0.2}, view, {0, 1, 0}, 5e-4);
  EXPECT_NEAR(high.origin.y, 0.01, 5e-6);
  // Nothing near: the point itself, lifted by the tolerance.
  const SurfacePoint none = scene.tracer.anchor({0.3, 3.0, 0.2}, view, {0, 1, 0}, 5e-4);
  EXPECT_DOUBLE_EQ(none.origin.y, 3.0 + 5e-4);
}

TEST(RayTraced, FacetOfAnInterpolatedNormalBlocksWhatGoesThroughIt) {
  // A normal tilted by t against its open facet loses (1 - cos t) / 2.
  const Scene scene(shapes::quad({0, 0, 0}, {50, 0, 0}, {0, 0, -50}));
  const double tilt = 0.4;
  const dvec3 normal(std::sin(tilt), std::cos(tilt), 0.0);
  const SurfacePoint start = scene.tracer.anchor({1, 0, 2}, {0, -1, 0}, normal, 1e-3);
  EXPECT_NEAR(scene.visibility(start, 1.0, Falloff::kNone, 4096, 1), 0.5 * (1.0 + std::cos(tilt)), 1e-3);
}

TEST(Sobol2, ScrambledPointsFillEveryElementaryInterval) {
  // A (0, 6, 2)-net: each of the 2^a x 2^(6-a) boxes holds exactly one of 64 points, for every scrambling.
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const Sobol2 sobol(seed);
    for (int a = 0; a <= 6; ++a) {
      std::set<std::pair<int, int>> boxes;
      for (std::uint32_t i = 0; i < 64; ++i) {
        const glm::dvec2 u = sobol.point(i);
        boxes.emplace(static_cast<int>(std::ldexp(u.x, a)), static_cast<int>(std::ldexp(u.y, 6 - a)));
      }
      EXPECT_EQ(boxes.size(), 64U) << seed << " " << a;
    }
  }
}

TEST(Sobol2, FirstPointIsUniformOverSeeds) {
  // Chi-square over 16 x 16 boxes with 65536 seeds: 255 degrees of freedom, mean 255, standard deviation 22.6; five of
  // them either way is a chance of 1e-6.
  std::array<int, 256> count{};
  for (std::uint32_t seed = 0; seed < 65536; ++seed) {
    const glm::dvec2 u = Sobol2(pixel_seed(7, seed % 256, seed / 256)).point(0);
    ++count[static_cast<std::size_t>(u.x * 16) * 16 + static_cast<std::size_t>(u.y * 16)];
  }
  double chi = 0.0;
  for (const int n : count) {
    chi += (n - 256.0) * (n - 256.0) / 256.0;
  }
  EXPECT_NEAR(chi, 255.0, 5 * 22.6);
}

TEST(RayTraced, ErrorFallsFasterThanThatOfIndependentSamples) {
  // What the sequence is for: 16 times the samples cut the error of independent samples by 4, and that of the net by
  // more. Sphere above the plane, RMS over the scramblings.
  const Scene scene(shapes::sphere({0, 1.9, 0}, 1.0, 6));
  const double truth = 1.0 - sphere_occlusion(1.0, 1.9, 0.0);
  const auto rms = [&](std::uint32_t samples) {
    double sum = 0.0;
    for (std::uint64_t seed = 0; seed < 128; ++seed) {
      const double error =
          scene.visibility(point_at({0, 0, 0}, {0, 1, 0}), 10.0, Falloff::kNone, samples, seed) - truth;
      sum += error * error / 128.0;
    }
    return std::sqrt(sum);
  };
  const double coarse = rms(16);
  const double fine = rms(256);
  EXPECT_GT(coarse / fine, 5.0) << coarse << " " << fine;
}

TEST(RayTraced, SameSeedAndPixelGiveTheSameBits) {
  const Scene scene(shapes::sphere({0, 2, 0}, 1.0, 4));
  const SurfacePoint point = point_at({0, 0, 0}, {0, 1, 0});
  const double first = scene.visibility(point, 10.0, Falloff::kLinear, 64, pixel_seed(1, 2, 3));
  EXPECT_EQ(first, scene.visibility(point, 10.0, Falloff::kLinear, 64, pixel_seed(1, 2, 3)));
  EXPECT_NE(first, scene.visibility(point, 10.0, Falloff::kLinear, 64, pixel_seed(1, 3, 2)));
  EXPECT_NE(first, scene.visibility(point, 10.0, Falloff::kLinear, 64, pixel_seed(2, 2, 3)));
}

}  // namespace
