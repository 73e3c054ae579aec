// SPDX-License-Identifier: Apache-2.0
// The hard cases of role sky, asked in all directions through the C API, and sky/procedural against its float64 twin.
#include "roles/rendering.hpp"

#include "atmosphere.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

namespace sky_float64 {

vec3 sun_transmittance(double height, double mu) {
  return sun_transmittance(height, mu, 1.0);
}
vec3 multiple_scattering(double, double) {
  return vec3(0.0);
}

#define float double
#include "radiance.glsl"
#undef float

}  // namespace sky_float64

namespace {

using namespace rendering;

constexpr std::uint32_t kWidth = 256;
constexpr std::uint32_t kHeight = 128;
constexpr double kIlluminance = 128000.0;  // default of sun_illuminance
/// RMS that the transmittance's 256 x 64 and the radiance's 128 x 256 texels leave, over radiance: README, "Measured".
constexpr double kTables = 5e-4;

dvec3 direction_at(std::uint32_t x, std::uint32_t y) {
  const double elevation = (0.5 - (y + 0.5) / kHeight) * kPi;
  const double azimuth = (x + 0.5) / kWidth * 2.0 * kPi;
  return {std::sin(azimuth) * std::cos(elevation), std::sin(elevation), -std::cos(azimuth) * std::cos(elevation)};
}
double solid_angle(std::uint32_t y) {
  // Exact for a row: the band between two elevations.
  const double top = (0.5 - static_cast<double>(y) / kHeight) * kPi;
  const double bottom = (0.5 - (y + 1.0) / kHeight) * kPi;
  return (std::sin(top) - std::sin(bottom)) * 2.0 * kPi / kWidth;
}
dvec3 value_at(const Image& image, std::uint32_t x, std::uint32_t y) {
  return {image.at(x, y, 0), image.at(x, y, 1), image.at(x, y, 2)};
}
double luminance(const dvec3& color) {
  return 0.2126 * color.x + 0.7152 * color.y + 0.0722 * color.z;
}

/// One sky, asked again and again.
class Sky {
 public:
  explicit Sky(const std::string& technique, const std::string& parameters = "")
      : graph_(
            "extent = [256, 128]\noutput = \"probe.values\"\n[[pass]]\nname = \"sky\"\nrole = \"sky\"\ntechnique = \"" +
            technique + "\"\n" + parameters + "[[pass]]\nname = \"probe\"\nrole = \"probe\"\ntechnique = \"sky\"\n") {
    scene_.add_floor({0, 0, 0}, 1.0);
    scene_.look({0, 1, 3}, {0, 0, 0});
  }
  void set(const std::string& setting) { graph_.set(setting); }
  Image ask(const std::string& answer) {
    graph_.set("probe.params.answer=" + answer);
    return graph_.image(scene_);
  }

 private:
  Scene scene_;
  Graph graph_;
};

void expect_finite_and_not_negative(const Image& image) {
  ASSERT_EQ(image.width, kWidth);
  int wrong = 0;
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    if (i % 4 != 3 && !(image.pixels[i] >= 0.0F && image.pixels[i] < 1e30F)) ++wrong;
  }
  EXPECT_EQ(wrong, 0);
}

TEST(SkyHardCases, H1AndH3EveryDirectionIsFiniteForEverySun) {
  for (const char* altitude : {"0", "1500", "80000"}) {
    Sky sky("procedural", std::string("params.altitude = ") + altitude + "\n");
    for (const char* elevation : {"-1.5707963", "-0.3", "-0.01", "0", "0.004", "0.5", "1.5707963"}) {
      SCOPED_TRACE(std::string(altitude) + " m, sun at " + elevation);
      sky.set(std::string("sky.params.sun_elevation=") + elevation);
      for (const char* answer : {"radiance", "irradiance", "specular"}) expect_finite_and_not_negative(sky.ask(answer));
    }
  }
}

TEST(SkyHardCases, H3NightIsDarkAndTwilightIsNot) {
  Sky sky("procedural", "params.sun_elevation = -0.35\n");  // 20 degrees: astronomical night
  const Image night = sky.ask("radiance");
  sky.set("sky.params.sun_elevation=-0.05");
  const Image twilight = sky.ask("radiance");
  EXPECT_LT(*std::max_element(night.pixels.begin(), night.pixels.end() - 1), 1.5F);
  double brightest_night = 0;
  double brightest_twilight = 0;
  for (std::uint32_t y = 0; y < kHeight; ++y) {
    for (std::uint32_t x = 0; x < kWidth; ++x) {
      brightest_night = std::max(brightest_night, luminance(value_at(night, x, y)));
      brightest_twilight = std::max(brightest_twilight, luminance(value_at(twilight, x, y)));
    }
  }
  EXPECT_LT(brightest_night, 1e-3);     // cd/m^2; a moonless sky without stars has less than this
  EXPECT_GT(brightest_twilight, 10.0);  // 3 degrees: one reads a newspaper
}

TEST(SkyHardCases, H2IrradianceIsTheCosineIntegralOfRadiance) {
  for (const char* elevation : {"1.2", "0.5", "0.05"}) {
    SCOPED_TRACE(elevation);
    Sky sky("procedural", std::string("params.sun_elevation = ") + elevation + "\n");
    const Image radiance = sky.ask("radiance");
    const Image irradiance = sky.ask("irradiance");
    for (std::uint32_t y = 3; y < kHeight; y += 20) {
      for (std::uint32_t x = 5; x < kWidth; x += 60) {
        const dvec3 n = direction_at(x, y);
        dvec3 sum(0.0);
        for (std::uint32_t j = 0; j < kHeight; ++j) {
          for (std::uint32_t i = 0; i < kWidth; ++i) {
            const double cosine = glm::dot(n, direction_at(i, j));
            if (cosine > 0.0) sum += value_at(radiance, i, j) * (cosine * solid_angle(j));
          }
        }
        // The README's bound: 2 %, from the 32 x 64 table and its 4096 directions.
        EXPECT_NEAR(luminance(value_at(irradiance, x, y)) / luminance(sum), 1.0, 0.02) << x << ' ' << y;
      }
    }
  }
}

TEST(SkyHardCases, UniformSkyIsExact) {
  Sky sky("uniform", "params.radiance = [2.0, 3.0, 4.0]\n");
  const Image radiance = sky.ask("radiance");
  const Image irradiance = sky.ask("irradiance");
  const Image specular = sky.ask("specular");
  for (std::uint32_t channel = 0; channel < 3; ++channel) {
    const auto expected = static_cast<float>(2 + channel);
    for (std::uint32_t y = 0; y < kHeight; y += 7) {
      EXPECT_EQ(radiance.at(y, y, channel), expected);
      EXPECT_EQ(specular.at(y, y, channel), expected);
      EXPECT_FLOAT_EQ(irradiance.at(y, y, channel), static_cast<float>(kPi) * expected);
    }
  }
}

TEST(ProceduralSky, SingleScatteringIsTheFloat64Twin) {
  for (const double sun_elevation : {0.9, 0.1}) {
    Sky sky("procedural",
            "params.multiple_scattering = false\nparams.sun_azimuth = 0.0\nparams.samples = 128\n"
            "params.ground_albedo = [0.0, 0.0, 0.0]\nparams.sun_elevation = " +
                std::to_string(sun_elevation) + "\n");
    const Image radiance = sky.ask("radiance");
    const dvec3 sun(0, std::sin(sun_elevation), -std::cos(sun_elevation));
    for (std::uint32_t y = 1; y < kHeight / 2; y += 6) {
      for (std::uint32_t x = 3; x < kWidth / 2; x += 30) {
        const dvec3 d = direction_at(x, y);
        const dvec3 expected = kIlluminance * sky_float64::radiance_along_ray(0.0, d.y, sun.y, glm::dot(d, sun), false,
                                                                              dvec3(0.0), dvec3(0.0), 1.0, 128);
        const dvec3 found = value_at(radiance, x, y);
        for (int channel = 0; channel < 3; ++channel) {
          // Two tables are read between: the transmittance's and the 128 x 256 map.
          EXPECT_NEAR(found[channel] / expected[channel], 1.0, 0.02) << x << ' ' << y << ' ' << channel;
        }
      }
    }
  }
}

TEST(ProceduralSky, SpecularIsTheLobeAverageOfRadiance) {
  Sky sky("procedural", "params.sun_elevation = 0.6\nparams.filter_samples = 1024\n");
  const Image radiance = sky.ask("radiance");
  for (const double alpha : {0.09, 0.3, 0.8}) {
    sky.set("probe.params.alpha=" + std::to_string(alpha));
    const Image specular = sky.ask("specular");
    for (std::uint32_t y = 10; y < kHeight; y += 36) {
      for (std::uint32_t x = 7; x < kWidth; x += 80) {
        const dvec3 n = direction_at(x, y);
        // Average over directions L: H = normalize(N + L), density D NoH / (4 VoH) = D / 4 with V = N, weight NoL.
        dvec3 sum(0.0);
        double weights = 0;
        for (std::uint32_t j = 0; j < kHeight; ++j) {
          for (std::uint32_t i = 0; i < kWidth; ++i) {
            const dvec3 l = direction_at(i, j);
            const double NoL = glm::dot(n, l);
            if (NoL <= 0.0) continue;
            const double NoH2 = 0.5 * (1.0 + NoL);
            const double base = NoH2 * (alpha * alpha - 1.0) + 1.0;
            const double weight = NoL * alpha * alpha / (base * base) * solid_angle(j);
            sum += value_at(radiance, i, j) * weight;
            weights += weight;
          }
        }
        // Between two layers of the table the lobe is a mix of two lobes: 5 %.
        EXPECT_NEAR(luminance(value_at(specular, x, y)) / luminance(sum / weights), 1.0, 0.05)
            << alpha << ' ' << x << ' ' << y;
      }
    }
  }
}

/// Relative errors of luminance over chosen directions.
struct Errors {
  double squares = 0;
  double largest = 0;
  int count = 0;
  void add(const dvec3& found, const dvec3& expected) {
    const double error = luminance(found) / luminance(expected) - 1.0;
    squares += error * error;
    largest = std::max(largest, std::abs(error));
    ++count;
  }
  [[nodiscard]] double rms() const { return std::sqrt(squares / count); }
};

TEST(ProceduralSky, SamplesApproachTheIntegralAtSecondOrder) {
  // Once scattered light, of which the integral is known: what the image holds, tables and interpolation in it, against
  // the float64 twin with 1024 stretches, whose own error is (1024 / 256)^2 = 16 times below that of the ladder's end.
  for (const double sun_elevation : {0.9, 0.1}) {
    Sky sky("procedural",
            "params.multiple_scattering = false\nparams.sun_azimuth = 0.0\nparams.ground_albedo = [0.0, 0.0, 0.0]\n"
            "params.sun_elevation = " +
                std::to_string(sun_elevation) + "\n");
    const dvec3 sun(0, std::sin(sun_elevation), -std::cos(sun_elevation));
    const auto once_scattered = [&](const dvec3& d, int stretches) {
      return kIlluminance * sky_float64::radiance_along_ray(0.0, d.y, sun.y, glm::dot(d, sun), false, dvec3(0.0),
                                                            dvec3(0.0), 1.0, stretches);
    };
    std::vector<std::array<std::uint32_t, 2>> pixels;
    std::vector<dvec3> truth;
    for (std::uint32_t y = 1; y < kHeight / 2; y += 9) {
      for (std::uint32_t x = 3; x < kWidth / 2; x += 40) {
        pixels.push_back({x, y});
        truth.push_back(once_scattered(direction_at(x, y), 1024));
      }
    }
    double last_twin = 0;
    for (const int samples : {8, 16, 32, 64, 128, 256}) {
      sky.set("sky.params.samples=" + std::to_string(samples));
      const Image radiance = sky.ask("radiance");
      Errors image;
      Errors twin;
      for (std::size_t i = 0; i < pixels.size(); ++i) {
        image.add(value_at(radiance, pixels[i][0], pixels[i][1]), truth[i]);
        twin.add(once_scattered(direction_at(pixels[i][0], pixels[i][1]), samples), truth[i]);
      }
      std::printf("  sun at %.1f, samples %3d: RMS %.3f %%, largest %.3f %%; without tables RMS %.4f %%\n",
                  sun_elevation, samples, 100 * image.rms(), 100 * image.largest, 100 * twin.rms());
      // The midpoint of each stretch: twice as many, a quarter of the error. The first step is not in the limit yet,
      // and the ozone's profile has corners.
      if (last_twin > 0) {
        EXPECT_LT(twin.rms(), last_twin / 3.0) << samples;
      }
      // The tables add what they add, whatever the samples.
      EXPECT_LT(image.rms(), twin.rms() + kTables) << samples;
      last_twin = twin.rms();
    }
  }
}

TEST(ProceduralSky, FilterSamplesApproachTheirIntegrals) {
  Sky sky("procedural", "params.sun_elevation = 0.6\n");
  const Image radiance = sky.ask("radiance");
  // Of the second layer, which is then not mixed with another.
  constexpr double kAlpha = 4.0 / 49.0;
  sky.set("probe.params.alpha=" + fmt::format("{:.9f}", kAlpha));
  // Planes and lobes against sums over the 256 x 128 directions of the probe.
  const auto average = [&](const dvec3& n, auto weight_of) {
    dvec3 sum(0.0);
    double weights = 0;
    for (std::uint32_t j = 0; j < kHeight; ++j) {
      for (std::uint32_t i = 0; i < kWidth; ++i) {
        const double cosine = glm::dot(n, direction_at(i, j));
        if (cosine <= 0.0) continue;
        const double weight = weight_of(cosine) * solid_angle(j);
        sum += value_at(radiance, i, j) * weight;
        weights += weight;
      }
    }
    return sum / weights;
  };
  std::vector<std::array<std::uint32_t, 2>> pixels;
  std::vector<dvec3> planes;
  std::vector<dvec3> lobes;
  for (std::uint32_t y = 6; y < kHeight; y += 13) {
    for (std::uint32_t x = 5; x < kWidth / 2; x += 30) {
      const dvec3 n = direction_at(x, y);
      pixels.push_back({x, y});
      planes.push_back(kPi * average(n, [](double cosine) { return cosine; }));
      lobes.push_back(average(n, [&](double NoL) {
        const double NoH2 = 0.5 * (1.0 + NoL);
        const double base = NoH2 * (kAlpha * kAlpha - 1.0) + 1.0;
        return NoL * kAlpha * kAlpha / (base * base);
      }));
    }
  }
  std::vector<double> irradiance_errors;
  std::vector<double> specular_errors;
  for (const int samples : {32, 64, 128, 256, 512, 1024}) {
    sky.set("sky.params.filter_samples=" + std::to_string(samples));
    const Image irradiance = sky.ask("irradiance");
    const Image specular = sky.ask("specular");
    Errors on_planes;
    Errors over_lobes;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      on_planes.add(value_at(irradiance, pixels[i][0], pixels[i][1]), planes[i]);
      over_lobes.add(value_at(specular, pixels[i][0], pixels[i][1]), lobes[i]);
    }
    std::printf(
        "  filter_samples %4d: irradiance RMS %.3f %%, largest %.3f %%; specular RMS %.3f %%, largest %.3f %%\n",
        samples, 100 * on_planes.rms(), 100 * on_planes.largest, 100 * over_lobes.rms(), 100 * over_lobes.largest);
    irradiance_errors.push_back(on_planes.rms());
    specular_errors.push_back(over_lobes.rms());
  }
  // Down to what the tables of 32 x 64 and 64 x 96 leave.
  for (std::size_t i = 1; i < specular_errors.size(); ++i) {
    EXPECT_LT(irradiance_errors[i], 1.05 * irradiance_errors[i - 1]);
    EXPECT_LT(specular_errors[i], 1.05 * specular_errors[i - 1]);
  }
}

TEST(ProceduralSky, NoMoreLightArrivesThanTheSunSends) {
  for (const double sun_elevation : {0.1, 0.5, 1.2}) {
    Sky sky("procedural",
            "params.ground_albedo = [0.0, 0.0, 0.0]\nparams.sun_elevation = " + std::to_string(sun_elevation) + "\n");
    const Image irradiance = sky.ask("irradiance");
    const dvec3 from_sky = value_at(irradiance, 0, 0);  // straight up
    const dvec3 from_sun =
        kIlluminance * std::sin(sun_elevation) * sky_float64::sun_transmittance(0.0, std::sin(sun_elevation), 1.0);
    for (int channel = 0; channel < 3; ++channel) {
      EXPECT_LT(from_sky[channel] + from_sun[channel], kIlluminance * std::sin(sun_elevation));
    }
    // A clear sky gives a tenth to a half as much as the sun; at 29 and 69 degrees 8 to 20 klx.
    if (sun_elevation > 0.4) {
      EXPECT_GT(luminance(from_sky), 5e3);
      EXPECT_LT(luminance(from_sky), 20e3);
    }
    EXPECT_GT(from_sky.z, from_sky.x);  // blue
  }
}

TEST(ProceduralSky, MultipleScatteringBrightensAndMoreOverBrightGround) {
  for (const char* elevation : {"0.05", "0.3", "1.2"}) {
    SCOPED_TRACE(elevation);
    Sky sky("procedural",
            std::string("params.ground_albedo = [0.0, 0.0, 0.0]\nparams.sun_elevation = ") + elevation + "\n");
    const double dark = luminance(value_at(sky.ask("irradiance"), 0, 0));
    sky.set("sky.params.ground_albedo=[0.8, 0.8, 0.8]");
    const double bright = luminance(value_at(sky.ask("irradiance"), 0, 0));
    sky.set("sky.params.multiple_scattering=false");
    const double once = luminance(value_at(sky.ask("irradiance"), 0, 0));
    // Vertical optical depth of green air is 0.1: each further scattering has some 10 to 30 % of the light before it.
    EXPECT_GT(dark / once, 1.05);
    EXPECT_LT(dark / once, 1.4);
    EXPECT_GT(bright, 1.01 * dark);
  }
}

TEST(ProceduralSky, AzimuthTurnsTheSky) {
  Sky sky("procedural", "params.sun_azimuth = 0.0\nparams.sun_elevation = 0.3\n");
  const Image before = sky.ask("radiance");
  sky.set("sky.params.sun_azimuth=1.5707963267948966");  // a quarter of the image: 64 pixels, towards +X
  const Image after = sky.ask("radiance");
  for (std::uint32_t y = 0; y < kHeight; y += 5) {
    for (std::uint32_t x = 0; x < kWidth; x += 9) {
      const double turned = luminance(value_at(after, (x + 64) % kWidth, y));
      EXPECT_NEAR(turned / luminance(value_at(before, x, y)), 1.0, 1e-3) << x << ' ' << y;
    }
  }
}

TEST(ProceduralSky, KeepsItsImagesUntilAParameterChanges) {
  Sky sky("procedural", "params.sun_elevation = 0.3\n");
  const Image first = sky.ask("specular");
  EXPECT_EQ(first.pixels, sky.ask("specular").pixels);
  sky.set("sky.params.sun_elevation=0.6");
  EXPECT_NE(first.pixels, sky.ask("specular").pixels);
  sky.set("sky.params.sun_elevation=0.3");
  EXPECT_EQ(first.pixels, sky.ask("specular").pixels);
}

}  // namespace
