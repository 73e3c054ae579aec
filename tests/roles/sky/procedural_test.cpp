// SPDX-License-Identifier: Apache-2.0
// sky/procedural's shader functions, read as float64 C++, against an integral that knows the Earth only as a sphere in
// Cartesian coordinates, in long double.
#include "atmosphere.hpp"

#include <gtest/gtest.h>

#include <array>

namespace sky_float64 {

// What radiance.glsl asks for, without tables: single scattering in an atmosphere of this haze.
double test_mie_density = 1.0;
vec3 sun_transmittance(double height, double mu) {
  return sun_transmittance(height, mu, test_mie_density);
}
vec3 multiple_scattering(double, double) {
  return vec3(0.0);
}

#define float double
#include "radiance.glsl"
#undef float

}  // namespace sky_float64

namespace {

using sky_float64::vec2;
using sky_float64::vec3;
using Real = long double;
using Vector = std::array<Real, 3>;

Vector operator+(const Vector& a, const Vector& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
Vector operator*(Real s, const Vector& a) {
  return {s * a[0], s * a[1], s * a[2]};
}
Real dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Real height_of(const Vector& p) {
  return std::sqrt(dot(p, p)) - Real(SKY_GROUND_RADIUS);
}

/// First t > 0 where the ray meets a sphere round the origin, or -1.
Real meet_sphere(const Vector& p, const Vector& d, Real radius) {
  const Real b = dot(p, d);
  const Real discriminant = b * b - dot(p, p) + radius * radius;
  if (discriminant < 0) return -1;
  const Real root = std::sqrt(discriminant);
  if (-b - root > 1e-9L) return -b - root;
  return -b + root > 1e-9L ? -b + root : -1;
}

/// Extinction of one colour at a height, 1/km, straight from the constants.
Real extinction(Real height, int channel, Real mie_density) {
  constexpr std::array<Real, 3> kRayleigh = {SKY_RAYLEIGH_R, SKY_RAYLEIGH_G, SKY_RAYLEIGH_B};
  constexpr std::array<Real, 3> kOzone = {SKY_OZONE_R, SKY_OZONE_G, SKY_OZONE_B};
  const auto c = static_cast<std::size_t>(channel);
  const Real ozone = std::max(Real(0), 1 - std::abs(height - Real(SKY_OZONE_CENTRE)) / Real(SKY_OZONE_HALF_WIDTH));
  return kRayleigh[c] * std::exp(-height / Real(SKY_RAYLEIGH_HEIGHT)) +
         mie_density * Real(SKY_MIE_EXTINCTION) * std::exp(-height / Real(SKY_MIE_HEIGHT)) + kOzone[c] * ozone;
}

Real optical_depth_between(const Vector& p, const Vector& d, Real end, int channel, Real mie_density, int steps) {
  Real sum = 0;
  for (int i = 0; i < steps; ++i) {
    sum += extinction(height_of(p + ((i + Real(0.5)) * end / steps) * d), channel, mie_density);
  }
  return sum * end / steps;
}

/// Single scattering towards a viewer at p, from a ray that misses the ground, over the sun's illuminance.
Real single_scattering(const Vector& p, const Vector& view, const Vector& sun, int channel, Real mie_density,
                       int steps) {
  constexpr std::array<Real, 3> kRayleigh = {SKY_RAYLEIGH_R, SKY_RAYLEIGH_G, SKY_RAYLEIGH_B};
  const Real top = Real(SKY_GROUND_RADIUS) + Real(SKY_THICKNESS);
  const Real end = meet_sphere(p, view, top);
  const Real pi = 3.14159265358979323846L;
  const Real nu = dot(view, sun);
  const Real g = SKY_MIE_ANISOTROPY;
  const Real rayleigh_phase = 3 / (16 * pi) * (1 + nu * nu);
  const Real mie_phase =
      3 / (8 * pi) * (1 - g * g) * (1 + nu * nu) / ((2 + g * g) * std::pow(1 + g * g - 2 * g * nu, Real(1.5)));
  Real radiance = 0;
  Real depth = 0;
  for (int i = 0; i < steps; ++i) {
    const Real dt = end / steps;
    const Vector q = p + ((i + Real(0.5)) * dt) * view;
    const Real h = height_of(q);
    const Real sigma = extinction(h, channel, mie_density);
    depth += 0.5L * sigma * dt;
    if (meet_sphere(q, sun, Real(SKY_GROUND_RADIUS)) < 0) {
      const Real to_sun = optical_depth_between(q, sun, meet_sphere(q, sun, top), channel, mie_density, 400);
      const Real scattered =
          kRayleigh[static_cast<std::size_t>(channel)] * std::exp(-h / Real(SKY_RAYLEIGH_HEIGHT)) * rayleigh_phase +
          mie_density * Real(SKY_MIE_SCATTERING) * std::exp(-h / Real(SKY_MIE_HEIGHT)) * mie_phase;
      radiance += std::exp(-depth - to_sun) * scattered * dt;
    }
    depth += 0.5L * sigma * dt;
  }
  return radiance;
}

Vector direction_at(Real elevation, Real azimuth) {
  return {std::sin(azimuth) * std::cos(elevation), std::sin(elevation), -std::cos(azimuth) * std::cos(elevation)};
}

vec3 shader_radiance(double height, double elevation, double azimuth, double sun_elevation, int steps) {
  const Vector view = direction_at(elevation, azimuth);
  const Vector sun = direction_at(sun_elevation, 0);
  return sky_float64::radiance_along_ray(height, std::sin(elevation), std::sin(sun_elevation),
                                         static_cast<double>(dot(view, sun)), false, vec3(0.0), vec3(0.0),
                                         sky_float64::test_mie_density, steps);
}

TEST(Atmosphere, HeightAlongARayIsThatOfTheSphere) {
  for (const double height : {0.0, 0.001, 2.0, 50.0}) {
    for (const double mu : {-0.05, 0.0, 0.02, 0.5, 1.0}) {
      for (const double t : {0.001, 1.0, 30.0, 400.0}) {
        const Vector p = {0, Real(SKY_GROUND_RADIUS) + height, 0};
        const Vector d = {std::sqrt(1 - Real(mu) * mu), mu, 0};
        const auto expected = static_cast<double>(height_of(p + Real(t) * d));
        if (expected < 0) continue;  // underground
        // 1e-9 km: a micrometre, from float64 sums of 4e7 km^2.
        EXPECT_NEAR(sky_float64::height_along(height, mu, t), expected, 1e-9) << height << ' ' << mu << ' ' << t;
      }
    }
  }
}

TEST(Atmosphere, RaysEndWhereTheyMeetTheSpheres) {
  for (const double height : {0.0, 0.5, 20.0, 99.0}) {
    for (const double mu : {-1.0, -0.4, -0.2, 0.0, 0.3, 1.0}) {
      const Vector p = {0, Real(SKY_GROUND_RADIUS) + height, 0};
      const Vector d = {std::sqrt(1 - Real(mu) * mu), mu, 0};
      const auto top = static_cast<double>(meet_sphere(p, d, Real(SKY_GROUND_RADIUS) + Real(SKY_THICKNESS)));
      EXPECT_NEAR(sky_float64::distance_to_top(height, mu), top, 1e-9 * top);
      if (mu >= sky_float64::horizon_mu(height) || height == 0.0) continue;
      const auto ground = static_cast<double>(meet_sphere(p, d, Real(SKY_GROUND_RADIUS)));
      EXPECT_NEAR(sky_float64::distance_to_ground(height, mu), ground, 1e-9 * ground);
    }
  }
}

TEST(Atmosphere, TransmittanceIsThatOfTheSphericalShells) {
  for (const double height : {0.0, 1.0, 12.0}) {
    for (const double mu : {0.0, 0.01, 0.1, 1.0}) {
      const Vector p = {0, Real(SKY_GROUND_RADIUS) + height, 0};
      const Vector d = {std::sqrt(1 - Real(mu) * mu), mu, 0};
      const Real end = meet_sphere(p, d, Real(SKY_GROUND_RADIUS) + Real(SKY_THICKNESS));
      // 128 steps, as transmittance.comp.glsl takes.
      const vec3 shader =
          exp(-sky_float64::optical_depth(height, mu, sky_float64::distance_to_top(height, mu), 1.0, 128));
      for (int channel = 0; channel < 3; ++channel) {
        const auto expected = static_cast<double>(std::exp(-optical_depth_between(p, d, end, channel, 1, 20000)));
        // The steps' own error: the midpoint rule leaves 5e-4 of the sun at the horizon, and less above.
        EXPECT_NEAR(shader[channel], expected, 1e-3) << height << ' ' << mu << ' ' << channel;
      }
    }
  }
}

TEST(Atmosphere, SingleScatteringEqualsTheIntegralInSpace) {
  for (const double haze : {1.0, 4.0}) {
    sky_float64::test_mie_density = haze;
    for (const double sun_elevation : {0.1, 0.8}) {
      for (const double elevation : {0.03, 0.3, 1.4}) {
        for (const double azimuth : {sun_elevation < 0.5 ? 0.1 : 2.0}) {
          const vec3 fine = shader_radiance(0.0, elevation, azimuth, sun_elevation, 512);
          const vec3 usual = shader_radiance(0.0, elevation, azimuth, sun_elevation, 32);
          for (int channel = 0; channel < 3; ++channel) {
            const auto expected =
                static_cast<double>(single_scattering({0, Real(SKY_GROUND_RADIUS), 0}, direction_at(elevation, azimuth),
                                                      direction_at(sun_elevation, 0), channel, haze, 1500));
            EXPECT_NEAR(fine[channel] / expected, 1.0, 2e-3) << haze << sun_elevation << elevation << azimuth;
            // The default of the knob `samples`: the bound that the README states.
            EXPECT_NEAR(usual[channel] / expected, 1.0, 1e-2) << haze << sun_elevation << elevation << azimuth;
          }
        }
      }
    }
  }
  sky_float64::test_mie_density = 1.0;
}

TEST(Atmosphere, MoreStepsComeCloserToTheIntegral) {
  const vec3 truth = shader_radiance(0.0, 0.05, 1.0, 0.4, 4096);
  double last = 1e9;
  for (const int steps : {8, 16, 32, 64, 128, 256}) {
    const double error = length(shader_radiance(0.0, 0.05, 1.0, 0.4, steps) - truth);
    EXPECT_LT(error, last) << steps;
    last = error;
  }
}

TEST(Atmosphere, StretchWeightIsItsIntegralForThinAndThickAir) {
  for (const double sigma : {0.0, 1e-9, 1e-4, 0.02, 3.0}) {
    for (const double dt : {1e-3, 1.0, 300.0}) {
      const double expected = sigma * dt < 1e-12 ? dt : -std::expm1(-sigma * dt) / sigma;
      // The series is left at a depth of 1e-3, where its third term is 1.7e-7.
      EXPECT_NEAR(sky_float64::stretch_weight(vec3(sigma), dt).x / expected, 1.0, 2e-7) << sigma << ' ' << dt;
    }
  }
}

TEST(Atmosphere, PhaseFunctionsIntegrateToOne) {
  double rayleigh = 0;
  double mie = 0;
  constexpr int kSteps = 200000;
  for (int i = 0; i < kSteps; ++i) {
    const double nu = 2.0 * (i + 0.5) / kSteps - 1.0;
    rayleigh += sky_float64::phase_rayleigh(nu) * 4.0 * sky_float64::kSkyPi / kSteps;
    mie += sky_float64::phase_mie(nu) * 4.0 * sky_float64::kSkyPi / kSteps;
  }
  EXPECT_NEAR(rayleigh, 1.0, 1e-6);
  EXPECT_NEAR(mie, 1.0, 1e-6);
}

TEST(Atmosphere, NoonSunGivesAHundredKiloluxAndSunsetIsRed) {
  const vec3 noon = 128000.0 * sky_float64::sun_transmittance(0.0, std::sin(1.0), 1.0);
  const double illuminance = 0.2126 * noon.x + 0.7152 * noon.y + 0.0722 * noon.z;
  EXPECT_GT(illuminance, 95e3);  // clear noon: 100 to 110 klx on a plane that faces the sun
  EXPECT_LT(illuminance, 115e3);
  const vec3 sunset = sky_float64::sun_transmittance(0.0, std::sin(0.01), 1.0);
  EXPECT_GT(sunset.x, 2.0 * sunset.y);
  EXPECT_GT(sunset.y, 2.0 * sunset.z);
  const vec3 zenith = shader_radiance(0.0, 1.5, 0.0, 0.8, 64);
  EXPECT_GT(zenith.z, 2.0 * zenith.x);
}

TEST(Atmosphere, SunSetsSmoothlyToNothing) {
  double last = 1e9;
  for (double elevation = 0.03; elevation > -0.03; elevation -= 0.0005) {
    const vec3 light = sky_float64::sun_transmittance(0.0, std::sin(elevation), 1.0);
    EXPECT_GE(light.x, 0.0);
    EXPECT_LE(light.x, last);
    last = light.x;
  }
  EXPECT_EQ(last, 0.0);
}

TEST(SkyMapping, TransmittanceTableFindsItsRaysAgain) {
  for (const double height : {0.0, 0.01, 5.0, 60.0, 99.9}) {
    for (double mu = sky_float64::horizon_mu(height) + 1e-3; mu <= 1.0; mu += 0.037) {
      const vec2 ray = sky_float64::transmittance_ray(sky_float64::transmittance_coordinate(height, mu));
      EXPECT_NEAR(ray.x, height, 1e-6);
      EXPECT_NEAR(ray.y, mu, 1e-6);
    }
  }
}

TEST(SkyMapping, EveryTexelOfTheMapIsFoundAtItsDirection) {
  const vec2 size(128.0, 256.0);
  for (const double height : {0.0, 0.4, 30.0}) {
    const double horizon = sky_float64::horizon_elevation(height);
    for (int y = 0; y < 256; ++y) {
      for (const int x : {0, 1, 64, 127}) {
        const sky_float64::vec3 angles = sky_float64::sky_map_angles({x, y}, horizon, size);
        // The first rows of both halves are the horizon itself: step off it to either side, by less than their spacing.
        const double side = y == 0 ? 1e-9 : y == 128 ? -1e-9 : 0.0;
        const vec2 uv = sky_float64::sky_map_coordinate(vec2(angles.x, angles.y + side), horizon, size);
        EXPECT_NEAR(uv.x * size.x, x + 0.5, 1e-6);
        EXPECT_NEAR(uv.y * size.y, y + 0.5, 0.01);
      }
    }
  }
}

TEST(SkyMapping, DirectionsAreMeasuredFromTheSun) {
  for (const double sun_azimuth : {-2.0, 0.0, 0.7, 3.0}) {
    const sky_float64::vec3 sun(std::sin(sun_azimuth) * std::cos(0.4), std::sin(0.4),
                                -std::cos(sun_azimuth) * std::cos(0.4));
    const vec2 angles = sky_float64::sky_angles(sun, sun_azimuth);
    EXPECT_NEAR(angles.x, 0.0, 1e-7);
    EXPECT_NEAR(angles.y, 0.4, 1e-12);
    const vec2 opposite = sky_float64::sky_angles(sky_float64::vec3(-sun.x, sun.y, -sun.z), sun_azimuth);
    EXPECT_NEAR(opposite.x, sky_float64::kSkyPi, 1e-7);
  }
}

}  // namespace
