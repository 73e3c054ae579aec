// SPDX-License-Identifier: Apache-2.0
// The float64 service of surface_material/ggx against quadrature that knows only `evaluate`: energy of every lobe,
// densities, samples, reciprocity, and the ends of every range.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <heddle/plugin.h>
#include <heddle/services.h>

#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

namespace {

using std::numbers::pi;
using Vec3 = std::array<double, 3>;

constexpr uint32_t kDiffuse = 1, kSpecular = 2;

const heddle_surface_material_service& service() {
  static const heddle_surface_material_service* table = [] {
    const std::string path = HEDDLE_BUILD_DIR "/lib/heddle/plugins/surface_material/ggx/ggx.so";
    void* library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) throw std::runtime_error(dlerror());
    const auto entry = reinterpret_cast<heddle_entry_function>(dlsym(library, "heddle_entry"));
    const heddle_technique& technique = *entry()->techniques[0];
    EXPECT_STREQ(technique.id, "surface_material/ggx");
    return static_cast<const heddle_surface_material_service*>(technique.functions[0].service);
  }();
  return *table;
}

heddle_surface_point point(double roughness, double metalness, Vec3 base = {1, 1, 1}, double ior = 1.5) {
  heddle_surface_point p{};
  p.struct_size = sizeof p;
  for (std::size_t i = 0; i < 3; ++i) p.base_color[i] = base[i];
  p.metalness = metalness;
  p.roughness = roughness;
  p.ior = ior;
  return p;
}

Vec3 direction(double cosine, double azimuth) {
  const double sine = std::sqrt(std::max(0.0, 1.0 - cosine * cosine));
  return {sine * std::cos(azimuth), sine * std::sin(azimuth), cosine};
}

double evaluate(const heddle_surface_point& p, const Vec3& view, const Vec3& light, uint32_t lobe, uint32_t bounces) {
  double rgb[3];
  service().evaluate(&p, view.data(), light.data(), lobe, bounces, rgb);
  return rgb[0];
}

double albedo(const heddle_surface_point& p, double NoV, uint32_t lobe, uint32_t bounces) {
  double rgb[3];
  service().albedo(&p, NoV, lobe, bounces, rgb);
  return rgb[0];
}

/// Integral over the hemisphere of a lobe as narrow as GGX's: over halfway vectors, as the distribution itself spreads
/// them (tan = alpha sqrt(u / (1 - u))), by midpoints in u and in the azimuth, in which the integrand is periodic.
template <typename F>
double integrate_over_halfway(double NoV, double alpha, const F& f) {
  constexpr int kRadial = 600, kAzimuth = 256;  // error below 3e-4 for every case here, by doubling both
  const Vec3 view = direction(NoV, 0.0);
  double sum = 0.0;
  for (int i = 0; i < kRadial; ++i) {
    // More points where the distribution's tail is: u = 1 - (1 - t)^2.
    const double t = (i + 0.5) / kRadial;
    const double rest = (1.0 - t) * (1.0 - t);
    const double tan_squared = alpha * alpha * (1.0 - rest) / rest;
    const double NoH = 1.0 / std::sqrt(1.0 + tan_squared);
    const double a2 = alpha * alpha;
    const double D = a2 / (pi * std::pow(NoH * NoH * (a2 + tan_squared), 2));
    for (int j = 0; j < kAzimuth; ++j) {
      const Vec3 H = direction(NoH, 2.0 * pi * (j + 0.5) / kAzimuth);
      const double VoH = view[0] * H[0] + view[1] * H[1] + view[2] * H[2];
      const Vec3 light{2 * VoH * H[0] - view[0], 2 * VoH * H[1] - view[1], 2 * VoH * H[2] - view[2]};
      if (VoH <= 0.0 || light[2] <= 0.0) continue;
      sum += f(view, light) * 4.0 * VoH / (D * NoH) * 2.0 * (1.0 - t);
    }
  }
  return sum / (kRadial * kAzimuth);
}

/// Integral with the cosine of a lobe that depends on the light's elevation alone; NoL = t^3 crowds at the horizon.
template <typename F>
double integrate_over_elevation(double NoV, const F& f) {
  constexpr int kCount = 4000;
  const Vec3 view = direction(NoV, 0.0);
  double sum = 0.0;
  for (int i = 0; i < kCount; ++i) {
    const double t = (i + 0.5) / kCount;
    const double NoL = t * t * t;
    sum += f(view, direction(NoL, 0.0)) * NoL * 3.0 * t * t;  // azimuth 0: away from the mirror's direction
  }
  return 2.0 * pi * sum / kCount;
}

double alpha_of(double roughness) {
  return std::max(roughness * roughness, 1e-3);
}

double single_scattering(const heddle_surface_point& p, double NoV) {
  return integrate_over_halfway(NoV, alpha_of(p.roughness), [&](const Vec3& view, const Vec3& light) {
    return evaluate(p, view, light, kSpecular, 0) * light[2];
  });
}

double bounces(const heddle_surface_point& p, double NoV) {
  return integrate_over_elevation(NoV, [&](const Vec3& view, const Vec3& light) {
    return evaluate(p, view, light, kSpecular, 1) - evaluate(p, view, light, kSpecular, 0);
  });
}

double diffuse(const heddle_surface_point& p, double NoV) {
  return integrate_over_elevation(
      NoV, [&](const Vec3& view, const Vec3& light) { return evaluate(p, view, light, kDiffuse, 1); });
}

constexpr double kRoughness[] = {0.0, 0.05, 0.2, 0.45, 0.7, 1.0};
constexpr double kMetalness[] = {0.0, 0.5, 1.0};
constexpr double kCosines[] = {0.02, 0.1, 0.4, 0.8, 1.0};

TEST(SurfaceMaterialGgx, H1WhiteFurnaceEveryLobeReturnsItsEnergy) {
  double worst = 0.0;
  for (const double roughness : kRoughness)
    for (const double metalness : kMetalness)
      for (const double NoV : kCosines) {
        SCOPED_TRACE(testing::Message() << "roughness " << roughness << " metalness " << metalness << " NoV " << NoV);
        const heddle_surface_point white = point(roughness, metalness);
        const double one = single_scattering(white, NoV), more = bounces(white, NoV), rest = diffuse(white, NoV);
        worst = std::max(worst, std::abs(one + more + rest - 1.0));
        EXPECT_NEAR(one + more + rest, 1.0, 1e-3);  // the role's bound
        EXPECT_NEAR(one + more, albedo(white, NoV, kSpecular, 1), 1e-3);
        EXPECT_NEAR(rest, albedo(white, NoV, kDiffuse, 1), 1e-3);
        EXPECT_NEAR(albedo(white, NoV, 0, 1), 1.0, 1e-12);
      }
  RecordProperty("worst", std::to_string(worst));
}

TEST(SurfaceMaterialGgx, WithoutCompensationRoughMetalLosesWhatTheTableSays) {
  for (const double roughness : kRoughness)
    for (const double NoV : kCosines) {
      SCOPED_TRACE(testing::Message() << "roughness " << roughness << " NoV " << NoV);
      const heddle_surface_point metal = point(roughness, 1.0);
      const double one = single_scattering(metal, NoV);
      EXPECT_NEAR(one, albedo(metal, NoV, kSpecular, 0), 1e-3);
      EXPECT_LT(albedo(metal, NoV, 0, 0), 1.0);
    }
  // Heitz et al. 2016, "Multiple-Scattering Microfacet BSDFs with the Smith Model", figure 1: more than half is lost.
  EXPECT_LT(single_scattering(point(1.0, 1.0), 0.8), 0.5);
}

TEST(SurfaceMaterialGgx, BouncesSumTheSeriesOfReflections) {
  // After k bounces inside, each reflecting F on average, the share E of what is left gets out.
  constexpr int kCount = 2000;
  for (const double roughness : {0.3, 0.6, 1.0})
    for (const double f0 : {0.1, 0.5, 0.9}) {
      const heddle_surface_point metal = point(roughness, 1.0, {f0, f0, f0}), white = point(roughness, 1.0);
      double E = 0.0, F = 0.0, mean = 0.0;
      for (int i = 0; i < kCount; ++i) {
        const double NoV = (i + 0.5) / kCount, weight = 2.0 * NoV / kCount;
        E += weight * albedo(white, NoV, kSpecular, 0);
        F += weight * (f0 + (1.0 - f0) * std::pow(1.0 - NoV, 5));
        mean += weight * (albedo(metal, NoV, kSpecular, 1) - albedo(metal, NoV, kSpecular, 0));
      }
      double expected = 0.0;
      for (int k = 1; k < 400; ++k) expected += std::pow(F, k + 1) * std::pow(1.0 - E, k) * E;
      EXPECT_NEAR(mean, expected, 2e-4) << "roughness " << roughness << " f0 " << f0;  // the table's interpolation
    }
}

TEST(SurfaceMaterialGgx, DarkAndColouredPointsNeverGainEnergy) {
  for (const double roughness : kRoughness)
    for (const double metalness : kMetalness)
      for (const double NoV : kCosines)
        for (const double ior : {1.0, 1.33, 2.4, 3.0}) {
          const heddle_surface_point p = point(roughness, metalness, {0.0, 0.18, 1.0}, ior);
          double rgb[3];
          service().albedo(&p, NoV, 0, 1, rgb);
          for (const double value : rgb) {
            EXPECT_GE(value, 0.0);
            EXPECT_LE(value, 1.0 + 1e-12);
          }
        }
}

TEST(SurfaceMaterialGgx, DensityAndMissedSamplesAddUpToOne) {
  for (const double roughness : {0.2, 0.5, 1.0})
    for (const double metalness : {0.0, 1.0})
      for (const double NoV : {0.1, 0.5, 1.0}) {
        SCOPED_TRACE(testing::Message() << "roughness " << roughness << " metalness " << metalness << " NoV " << NoV);
        const heddle_surface_point p = point(roughness, metalness, {0.8, 0.8, 0.8});
        const double inside = integrate_over_halfway(
            NoV, alpha_of(roughness),
            [&](const Vec3& view, const Vec3& light) { return service().pdf(&p, view.data(), light.data()); });
        const Vec3 view = direction(NoV, 0.0);
        constexpr int kGrid = 64;
        int missed = 0;
        for (int i = 0; i < kGrid * kGrid * kGrid; ++i) {
          const double u[2] = {(i % kGrid + 0.5) / kGrid, (i / kGrid % kGrid + 0.5) / kGrid};
          double light[3], density = 0.0;
          service().sample(&p, view.data(), u, (i / kGrid / kGrid + 0.5) / kGrid, light, &density);
          missed += density == 0.0 ? 1 : 0;
        }
        // Cells on the border of missed samples, 2 / kGrid of them, are wrong by their part on the other side, to both
        // sides alike.
        EXPECT_NEAR(inside + static_cast<double>(missed) / (kGrid * kGrid * kGrid), 1.0, 4e-3);
      }
}

TEST(SurfaceMaterialGgx, SamplesFollowTheDensity) {
  constexpr int kElevations = 12, kAzimuths = 16, kSamples = 200000;
  for (const double roughness : {0.35, 0.6, 1.0})
    for (const double metalness : {0.0, 1.0})
      for (const double NoV : {0.15, 0.7}) {
        SCOPED_TRACE(testing::Message() << "roughness " << roughness << " metalness " << metalness << " NoV " << NoV);
        const heddle_surface_point p = point(roughness, metalness, {0.5, 0.5, 0.5});
        const Vec3 view = direction(NoV, 0.3);
        std::vector<double> expected(kElevations * kAzimuths + 1), seen(expected.size());
        double inside = 0.0;
        for (int bin = 0; bin < kElevations * kAzimuths; ++bin) {
          constexpr int kSub = 24;
          double sum = 0.0;
          for (int s = 0; s < kSub * kSub; ++s) {
            const double cosine = (bin / kAzimuths + (s / kSub + 0.5) / kSub) / kElevations;
            const double azimuth = 2.0 * pi * (bin % kAzimuths + (s % kSub + 0.5) / kSub) / kAzimuths;
            sum += service().pdf(&p, view.data(), direction(cosine, azimuth).data());
          }
          const auto index = static_cast<std::size_t>(bin);
          expected[index] = kSamples * sum / (kSub * kSub) * 2.0 * pi / (kElevations * kAzimuths);
          inside += expected[index];
        }
        expected.back() = kSamples - inside;
        std::mt19937_64 random(20240607);
        std::uniform_real_distribution<double> uniform(0.0, 1.0);
        for (int i = 0; i < kSamples; ++i) {
          const double u[2] = {uniform(random), uniform(random)};
          double light[3], density = 0.0;
          service().sample(&p, view.data(), u, uniform(random), light, &density);
          std::size_t bin = seen.size() - 1;
          if (density > 0.0) {
            const double azimuth = std::atan2(light[1], light[0]) / (2.0 * pi);
            const auto row = std::min(static_cast<int>(light[2] * kElevations), kElevations - 1);
            const auto column = static_cast<int>((azimuth - std::floor(azimuth)) * kAzimuths) % kAzimuths;
            bin = static_cast<std::size_t>(row * kAzimuths + column);
          }
          seen[bin] += 1.0;
        }
        double chi_squared = 0.0;
        int degrees = -1;
        double small_expected = 0.0, small_seen = 0.0;
        for (std::size_t i = 0; i < seen.size(); ++i) {
          if (expected[i] < 10.0) {  // pooled: the statistic needs counts
            small_expected += expected[i];
            small_seen += seen[i];
            continue;
          }
          chi_squared += (seen[i] - expected[i]) * (seen[i] - expected[i]) / expected[i];
          ++degrees;
        }
        if (small_expected > 10.0) {
          chi_squared += (small_seen - small_expected) * (small_seen - small_expected) / small_expected;
          ++degrees;
        }
        // Wilson and Hilferty 1931; 12 cases, so 1e-5 a case (z 4.3) keeps a false alarm below 1.2e-4.
        const double k = degrees;
        const double z = (std::cbrt(chi_squared / k) - (1.0 - 2.0 / (9.0 * k))) / std::sqrt(2.0 / (9.0 * k));
        EXPECT_LT(z, 4.3) << "chi^2 " << chi_squared << " for " << degrees << " degrees of freedom";
      }
}

TEST(SurfaceMaterialGgx, H4ExchangingViewAndLightChangesNothing) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int i = 0; i < 2000; ++i) {
    const heddle_surface_point p =
        point(uniform(random), uniform(random), {uniform(random), uniform(random), uniform(random)});
    const Vec3 a = direction(uniform(random), 2.0 * pi * uniform(random));
    const Vec3 b = direction(uniform(random), 2.0 * pi * uniform(random));
    const double forward = evaluate(p, a, b, 0, 1), back = evaluate(p, b, a, 0, 1);
    EXPECT_NEAR(forward, back, 1e-9 * std::max(forward, back) + 1e-15);  // rounding of H times the lobe's slope
  }
}

TEST(SurfaceMaterialGgx, WhatIsAnsweredAtOnceIsWhatIsAnsweredOneByOne) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (uint32_t i = 0; i < 500; ++i) {
    const heddle_surface_point p =
        point(uniform(random), uniform(random), {uniform(random), uniform(random), uniform(random)});
    const Vec3 view = direction(uniform(random) - 0.05, 6.0 * uniform(random));
    const Vec3 light = direction(uniform(random) - 0.05, 6.0 * uniform(random));
    const uint32_t compensates = i & 1;
    double diffuse[3], specular[3], expected[3], pdf;
    service().evaluate_parts(&p, view.data(), light.data(), compensates, diffuse, specular, &pdf);
    EXPECT_EQ(pdf, service().pdf(&p, view.data(), light.data()));
    service().evaluate(&p, view.data(), light.data(), kDiffuse, compensates, expected);
    for (int c = 0; c < 3; ++c) EXPECT_EQ(diffuse[c], expected[c]);
    service().evaluate(&p, view.data(), light.data(), kSpecular, compensates, expected);
    for (int c = 0; c < 3; ++c) EXPECT_EQ(specular[c], expected[c]);

    const double u[2] = {uniform(random), uniform(random)}, u_lobe = uniform(random);
    double sampled[3], again[3], density;
    service().sample(&p, view.data(), u, u_lobe, sampled, &density);
    service().sample_parts(&p, view.data(), u, u_lobe, compensates, again, diffuse, specular, &pdf);
    EXPECT_EQ(pdf, density);
    for (int c = 0; c < 3; ++c) EXPECT_EQ(again[c], sampled[c]);
    service().evaluate(&p, view.data(), sampled, kSpecular, compensates, expected);
    for (int c = 0; c < 3; ++c) EXPECT_EQ(specular[c], density > 0.0 ? expected[c] : 0.0);
  }
}

TEST(SurfaceMaterialGgx, H2H3GrazingViewsAndPolishedSurfacesAreFinite) {
  for (const double roughness : {0.0, 1e-6, 0.01, 0.5, 1.0})
    for (const double NoV : {0.0, 1e-300, 1e-12, 1e-6, 1.0})
      for (const double NoL : {0.0, 1e-300, 1e-12, 1e-6, 0.5, 1.0})
        for (const double azimuth : {0.0, 1.0, pi})
          for (const double ior : {0.0, 1.0, 1.5, 3.0}) {
            const heddle_surface_point p = point(roughness, 0.5, {1, 0, 1}, ior);
            double rgb[3];
            const Vec3 view = direction(NoV, 0.0), light = direction(NoL, azimuth);
            service().evaluate(&p, view.data(), light.data(), 0, 1, rgb);
            for (const double value : rgb) EXPECT_TRUE(std::isfinite(value) && value >= 0.0) << value;
            EXPECT_TRUE(std::isfinite(service().pdf(&p, view.data(), light.data())));
            const double u[2] = {0.999999, azimuth / 7.0};
            double sampled[3], density;
            service().sample(&p, view.data(), u, 0.1, sampled, &density);
            EXPECT_TRUE(std::isfinite(density) && std::isfinite(sampled[0] + sampled[1] + sampled[2]));
            service().albedo(&p, NoV, 0, 1, rgb);
            for (const double value : rgb) EXPECT_TRUE(std::isfinite(value) && value >= 0.0) << value;
          }
}

TEST(SurfaceMaterialGgx, BelowTheHorizonEverythingIsZero) {
  const heddle_surface_point p = point(0.5, 0.5);
  const Vec3 up = direction(0.5, 0.0), down = direction(-0.5, 1.0);
  EXPECT_EQ(evaluate(p, up, down, 0, 1), 0.0);
  EXPECT_EQ(evaluate(p, down, up, 0, 1), 0.0);
  EXPECT_EQ(service().pdf(&p, up.data(), down.data()), 0.0);
  EXPECT_EQ(service().pdf(&p, down.data(), up.data()), 0.0);
  EXPECT_EQ(albedo(p, -0.1, 0, 1), 0.0);
}

}  // namespace
