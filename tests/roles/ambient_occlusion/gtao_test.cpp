// SPDX-License-Identifier: Apache-2.0
// gtao.glsl, compiled here as C++ (glm; literals are float by a compiler option, as in GLSL), against float64 and
// against the closed forms that judge the reference: both techniques converge to one quantity. Needs no device.
#include <glm/glm.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <set>
#include <vector>

namespace glsl {
using namespace glm;
#include "ambient_occlusion/gtao/gtao.glsl"
#include "shared/facing.glsl"
}  // namespace glsl

namespace {

using glm::dvec2;
using glm::dvec3;
using glm::ivec2;
using glm::vec2;
using glm::vec3;

// With literals float by option, these are double.
constexpr double operator""_d(long double value) {
  return static_cast<double>(value);
}
constexpr double operator""_d(unsigned long long value) {
  return static_cast<double>(value);
}

constexpr double pi = std::numbers::pi_v<double>;

double quadrature(const std::function<double(double)>& f, double from, double to) {
  constexpr int kIntervals = 4000;  // Simpson; smooth integrands: error far below 1e-10
  const double h = (to - from) / kIntervals;
  double sum = f(from) + f(to);
  for (int i = 1; i < kIntervals; ++i) {
    sum += f(from + i * h) * double(i % 2 == 1 ? 4 : 2);
  }
  return sum * h / 3_d;
}

vec2 sine_cosine(double beta) {
  return {static_cast<float>(std::sin(beta)), static_cast<float>(std::cos(beta))};
}

TEST(Gtao, AngleFromIsTheArcTangentInFloat32) {
  const double tolerance = 5e-7_d;  // 4e-8 of the series and one rounding of pi
  for (int i = 0; i <= 20000; ++i) {
    const double angle = pi * i / 20000_d;
    const double got =
        double(glsl::angle_from(static_cast<float>(std::sin(angle)), static_cast<float>(std::cos(angle))));
    // The argument's own rounding moves the angle by as much again.
    EXPECT_NEAR(got, angle, tolerance) << angle;
  }
  // Small angles keep their relative precision: an open plane must not turn grey.
  for (double angle = 1; angle > 1e-9_d; angle /= 3_d) {
    const double got =
        double(glsl::angle_from(static_cast<float>(std::sin(angle)), static_cast<float>(std::cos(angle))));
    EXPECT_NEAR(got / angle, 1_d, 2e-6_d) << angle;
  }
}

TEST(Gtao, OccludedArcEqualsQuadrature) {
  for (int g = -9; g <= 9; ++g) {
    const double gamma = g * pi / 20_d;
    for (const double projected : {1_d, 1_d / 3_d}) {
      for (int b = 0; b <= 20; ++b) {
        // From the tangent plane (gamma + pi/2) down to the elevation, towards the view direction (theta = 0).
        const double limit = gamma + pi / 2_d;
        const double beta = limit * b / 20_d;
        const double expected = quadrature(
            [&](double theta) { return projected * std::cos(theta - gamma) * std::sin(theta); }, limit - beta, limit);
        const float got = glsl::occluded_arc(static_cast<float>(projected * std::cos(gamma)),
                                             static_cast<float>(projected * std::sin(gamma)), sine_cosine(beta));
        EXPECT_NEAR(double(got), expected, 1e-6_d) << gamma << " " << beta;
      }
    }
  }
}

TEST(Gtao, OpenArcsAreBothSidesAndTheirMeanOverSlicesIsOne) {
  for (const double n_v : {1_d, 0.7_d, 0.2_d, 0.02_d}) {
    const double side = std::sqrt(1_d - n_v * n_v);
    double mean = 0;
    constexpr int kSlices = 720;
    for (int i = 0; i < kSlices; ++i) {
      const double n_t = side * std::cos((i + 0.5_d) * pi / kSlices);
      const double gamma = std::atan2(n_t, n_v);
      const double projected = std::hypot(n_t, n_v);
      const double expected =
          quadrature([&](double theta) { return projected * std::cos(theta - gamma) * std::abs(std::sin(theta)); },
                     gamma - pi / 2_d, gamma + pi / 2_d);
      const double got = double(glsl::open_arcs(static_cast<float>(n_v), static_cast<float>(n_t)));
      EXPECT_NEAR(got, expected, 2e-6_d) << n_v << " " << n_t;
      mean += got / kSlices;
      // Closing both sides completely leaves nothing, so visibility reaches 0 exactly where everything is closed.
      const auto close = [&](double sign) {
        const auto nv = static_cast<float>(n_v);
        const auto nt = static_cast<float>(sign * n_t);
        return double(glsl::occluded_arc(nv, nt, glsl::clamp_to_view(vec2(0, -1), nv, nt)));
      };
      EXPECT_NEAR(close(1) + close(-1), got, 1e-6_d) << n_v << " " << n_t;
    }
    EXPECT_NEAR(mean, 1_d, 0.0001_d) << n_v;
  }
}

TEST(Gtao, ElevationOfASampleIsItsAngleAboveTheTangentPlane) {
  const dvec3 v = glm::normalize(dvec3(0.2_d, -0.3_d, 1_d));
  for (const dvec3& raw : {dvec3(0, 0, 1), dvec3(1, 0, 0.3_d), dvec3(-0.5_d, 1, 0.1_d)}) {
    const dvec3 n = glm::normalize(raw);
    for (int i = 0; i < 500; ++i) {
      const dvec3 s = dvec3(std::sin(double(i)), std::cos(3_d * i), std::sin(7_d * i)) * (0.01_d * (i + 1));
      const dvec3 t = glm::normalize(s - glm::dot(s, v) * v);
      const double gamma = std::atan2(glm::dot(n, t), glm::dot(n, v));
      const double theta = std::atan2(glm::dot(s, t), glm::dot(s, v));
      const double beta = gamma + pi / 2_d - theta;
      const vec2 got = glsl::sample_elevation(vec3(s), vec3(n), vec3(v));
      EXPECT_NEAR(double(got.x), std::sin(beta), 1e-5_d) << i;
      EXPECT_NEAR(double(got.y), std::cos(beta), 1e-5_d) << i;
    }
  }
}

TEST(Gtao, SamplesOfThePlaneItselfHaveNoElevationAtAnyAngle) {
  // Directions beside the slice included: that is what pixels' centres give. Squared, this is what a plane loses.
  for (const double n_v : {1_d, 0.3_d, 0.03_d}) {
    const dvec3 n(std::sqrt(1_d - n_v * n_v), 0, n_v);
    const dvec3 in_plane_x = glm::normalize(glm::cross(dvec3(0, 1, 0), n));
    for (int i = 0; i < 200; ++i) {
      const double phi = i * pi / 100_d;
      const dvec3 s = in_plane_x * std::cos(phi) + dvec3(0, 1, 0) * std::sin(phi);
      const vec2 got = glsl::sample_elevation(vec3(s), vec3(n), vec3(0, 0, 1));
      EXPECT_NEAR(double(got.x), 0_d, 1e-5_d);
      EXPECT_GT(got.y, 0.99f);
    }
  }
}

/// Visibility by the functions of gtao.glsl with a known occluder: `occluder(v, t)` lists the samples of one side of a
/// slice from near to far.
double visibility_of(const dvec3& n, const dvec3& v, int slices, unsigned falloff, double radius,
                     const std::function<std::vector<dvec3>(const dvec3& t)>& occluder) {
  const dvec3 tangent = glm::normalize(glm::cross(v, dvec3(0.12_d, 0.7_d, -0.4_d)));
  const dvec3 bitangent = glm::cross(v, tangent);
  const auto n_v = static_cast<float>(glm::dot(n, v));
  double open = 0;
  double occluded = 0;
  for (int i = 0; i < slices; ++i) {
    const double phi = (i + 0.5_d) * pi / slices;
    const dvec3 along = std::cos(phi) * tangent + std::sin(phi) * bitangent;
    open += double(glsl::open_arcs(n_v, static_cast<float>(glm::dot(n, along))));
    for (const double sign : {1_d, -1_d}) {
      const dvec3 t = sign * along;
      const auto n_t = static_cast<float>(glm::dot(n, t));
      vec2 horizon(0, 1);
      double below = 0;
      for (const dvec3& sample : occluder(t)) {
        const vec3 s(sample);
        const float weight = glsl::occlusion_weight(falloff, glm::dot(s, s), static_cast<float>(radius));
        const vec2 elevation = glsl::sample_elevation(s, vec3(n), vec3(v));
        if (weight <= 0 || elevation.x <= 0 || elevation.y >= horizon.y) {
          continue;
        }
        horizon = elevation;
        const double arc = double(glsl::occluded_arc(n_v, n_t, glsl::clamp_to_view(horizon, n_v, n_t)));
        occluded += double(weight) * std::max(0_d, arc - below);
        below = arc;
      }
    }
  }
  return 1_d - occluded / open;
}

TEST(Gtao, ConvergesToTheClosedFormOfAWallWhateverTheView) {
  const dvec3 n(0, 1, 0);
  const double radius = 2;
  for (const dvec3& raw : {dvec3(0, 1, 0), dvec3(-1, 1, 0), dvec3(-0.4_d, 0.3_d, 1), dvec3(-1, 0.1_d, 0)}) {
    const dvec3 v = glm::normalize(raw);
    for (const double c : {0.2_d, 0.6_d}) {
      const double h = c * radius;  // the wall is the plane x = h
      const auto wall = [&](const dvec3& t) {
        std::vector<dvec3> samples;
        for (int i = 1; i < 4000; ++i) {  // by angle from the far tangent to v
          const double theta = pi * (1_d - i / 4000_d);
          const dvec3 direction = std::cos(theta) * v + std::sin(theta) * t;
          if (direction.x > 0.0001_d && direction.y > 0) {
            samples.push_back(direction * (h / direction.x));
          }
        }
        return samples;
      };
      const double s = std::sqrt(1_d - c * c);
      const double none = 1_d - (std::acos(c) - c * s) / pi;
      const double linear = 1_d - (std::acos(c) + c * s - 2_d * c * std::atanh(s)) / pi;
      // 64 slices of a shape with kinks, 4000 steps: errors of 2e-3 at most.
      EXPECT_NEAR(visibility_of(n, v, 64, 0, radius, wall), none, 0.002_d) << raw.x << " " << raw.y << " " << c;
      EXPECT_NEAR(visibility_of(n, v, 64, 1, radius, wall), linear, 0.002_d) << raw.x << " " << raw.y << " " << c;
    }
  }
}

TEST(Gtao, TheTileOfTheNoiseIsAnEvenSet) {
  std::set<unsigned> indices;
  std::set<std::pair<int, int>> boxes[5];
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 4; ++x) {
      indices.insert(glsl::tile_index(ivec2(x, y)));
      EXPECT_EQ(glsl::tile_index(ivec2(x, y)), glsl::tile_index(ivec2(x + 4, y + 8)));
      const vec2 noise = glsl::tile_noise(ivec2(x, y));
      for (int a = 0; a <= 4; ++a) {
        boxes[a].emplace(static_cast<int>(std::ldexp(noise.x, a)), static_cast<int>(std::ldexp(noise.y, 4 - a)));
      }
    }
  }
  EXPECT_EQ(indices.size(), 16U);
  for (const auto& box : boxes) {
    EXPECT_EQ(box.size(), 16U);  // a (0, 4, 2)-net
  }
}

TEST(Gtao, TheWindowOfTheDenoiserWeighsEveryPixelOfTheTileAlike) {
  for (int shift_y = 0; shift_y < 4; ++shift_y) {
    for (int shift_x = 0; shift_x < 4; ++shift_x) {
      float weight[16] = {};
      for (int y = -2; y <= 2; ++y) {
        for (int x = -2; x <= 2; ++x) {
          weight[glsl::tile_index(ivec2(x + shift_x + 8, y + shift_y + 8))] += glsl::denoise_weight(x, y);
        }
      }
      for (const float one : weight) {
        EXPECT_EQ(one, 1.0f);
      }
    }
  }
}

TEST(Gtao, StepsNeverTouchThePixelItselfAndStayWithinTheirLength) {
  for (const float length : {1.5f, 20.0f, 900.0f}) {
    for (const int steps : {1, 8, 256}) {
      float last = 0.999f;
      for (int i = 0; i < steps; ++i) {
        const float d = glsl::step_distance(i, steps, 0.5f, length);
        EXPECT_GT(d, last);
        EXPECT_LE(d, length);
        last = d;
      }
    }
  }
}

TEST(Gtao, NormalsThatInterpolationTurnedAwayAreSeenEdgeOn) {
  const vec3 v(0, 0, 1);
  const vec3 away = glm::normalize(vec3(1.0f, 0.0f, -0.2f));
  const vec3 bent = glsl::face_viewer(away, v);
  EXPECT_GT(glm::dot(bent, v), 0.0f);
  EXPECT_NEAR(glm::length(bent), 1.0f, 1e-6f);
  const vec3 facing = glm::normalize(vec3(1.0f, 0.0f, 0.2f));
  EXPECT_EQ(glsl::face_viewer(facing, v), facing);
}

}  // namespace
