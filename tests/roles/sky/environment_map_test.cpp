// SPDX-License-Identifier: Apache-2.0
// sky/environment_map: the role's hard cases on made images, its filters against float64 quadrature over the same
// image, and surfaces lit by it against float64 quadrature of the same BRDF, with the approximation told from the
// sampling.
#include "environment.hpp"
#include "parsed.hpp"
#include "roles/rendering.hpp"

#include <dlfcn.h>
#include <heddle/plugin.h>
#include <heddle/services.h>
#include <nlohmann/json.hpp>

#include <cstdio>
#include <functional>

namespace {

using namespace rendering;
namespace map = environment_map;

constexpr std::uint32_t kWidth = 128, kHeight = 64;  // of the probe's answers

/// An equirectangular image of a function of direction, taken at the texels' centres.
struct Environment {
  std::uint32_t width, height;
  std::vector<float> rgba;

  Environment(std::uint32_t w, std::uint32_t h, const std::function<dvec3(const dvec3&)>& radiance)
      : width(w), height(h) {
    for (std::uint32_t y = 0; y < h; ++y)
      for (std::uint32_t x = 0; x < w; ++x) {
        const dvec3 value = radiance(map::direction_from_uv((x + 0.5) / w, (y + 0.5) / h));
        for (int c = 0; c < 3; ++c) rgba.push_back(static_cast<float>(value[c]));
        rgba.push_back(1.0F);
      }
  }
  void put_into(Scene& scene, double scale = 1.0, const dquat& rotation = dquat(1, 0, 0, 0)) const {
    heddle_environment environment{};
    environment.struct_size = sizeof environment;
    environment.width = width;
    environment.height = height;
    environment.channels = 4;
    environment.pixels = rgba.data();
    environment.scale = scale;
    const double q[4] = {rotation.x, rotation.y, rotation.z, rotation.w};
    std::copy_n(q, 4, environment.rotation);
    check(heddle_scene_set_environment(scene.handle, &environment));
  }
};

/// The image as it is shown, between the centres of texels: what every quadrature here integrates.
class Truth {
 public:
  explicit Truth(const Environment& image, std::uint32_t rows = 256)
      : padded_(map::pad({image.width, image.height, image.rgba})), radiance_(padded_, image.width, image.height) {
    for (std::uint32_t y = 0; y < rows; ++y)
      for (std::uint32_t x = 0; x < 2 * rows; ++x) {
        const dvec3 d = map::direction_from_uv((x + 0.5) / (2 * rows), (y + 0.5) / rows);
        const double solid_angle = (std::cos(kPi * y / rows) - std::cos(kPi * (y + 1) / rows)) * kPi / rows;
        const dvec3 light = radiance_(d) * solid_angle;
        if (light == dvec3(0.0)) continue;
        directions_.push_back(d);
        light_.push_back(light);
      }
  }
  [[nodiscard]] dvec3 radiance(const dvec3& d) const { return radiance_(d); }
  /// Sum of radiance times weight(direction) over the sphere.
  template <typename Weight>
  [[nodiscard]] dvec3 integral(const Weight& weight) const {
    dvec3 sum(0.0);
    for (std::size_t i = 0; i < directions_.size(); ++i) sum += light_[i] * weight(directions_[i]);
    return sum;
  }
  [[nodiscard]] dvec3 irradiance(const dvec3& n) const {
    return integral([&](const dvec3& d) { return std::max(glm::dot(n, d), 0.0); });
  }
  /// Mean over the lobe of half vectors drawn by D NoH around N = V = n, weighed by NoL.
  [[nodiscard]] dvec3 specular(const dvec3& n, double alpha) const {
    const auto weight = [&](double NoL) {
      const double base = 0.5 * (1.0 + NoL) * (alpha * alpha - 1.0) + 1.0;
      return NoL > 0.0 ? NoL / (base * base) : 0.0;
    };
    // Over the whole sphere, in x = sqrt(1 - NoL): narrow lobes have their weight near 0.
    constexpr int kSteps = 2000;
    double weights = 0.0;
    for (int i = 0; i < kSteps; ++i) {
      const double x = (i + 0.5) / kSteps;
      weights += weight(1.0 - x * x) * 2.0 * x / kSteps * 2.0 * kPi;
    }
    return integral([&](const dvec3& d) { return weight(glm::dot(n, d)); }) / weights;
  }

 private:
  std::vector<float> padded_;
  map::Padded radiance_;
  std::vector<dvec3> directions_, light_;  // of what is not black
};

dvec3 direction_at(std::uint32_t x, std::uint32_t y) {
  const double elevation = (0.5 - (y + 0.5) / kHeight) * kPi, azimuth = (x + 0.5) / kWidth * 2.0 * kPi;
  return {std::sin(azimuth) * std::cos(elevation), std::sin(elevation), -std::cos(azimuth) * std::cos(elevation)};
}
double solid_angle(std::uint32_t y) {
  return (std::cos(kPi * y / kHeight) - std::cos(kPi * (y + 1) / kHeight)) * 2.0 * kPi / kWidth;
}
dvec3 value_at(const Image& image, std::uint32_t x, std::uint32_t y) {
  return {image.at(x, y, 0), image.at(x, y, 1), image.at(x, y, 2)};
}
dvec3 mean_over_sphere(const Image& image) {
  dvec3 sum(0.0);
  for (std::uint32_t y = 0; y < kHeight; ++y)
    for (std::uint32_t x = 0; x < kWidth; ++x) sum += value_at(image, x, y) * solid_angle(y);
  return sum / (4.0 * kPi);
}

class Sky {
 public:
  explicit Sky(const Environment& environment, const std::string& parameters = "", double scale = 1.0,
               const dquat& rotation = dquat(1, 0, 0, 0))
      : graph_(
            "extent = [128, 64]\noutput = \"probe.values\"\n[[pass]]\nrole = \"sky\"\ntechnique = "
            "\"environment_map\"\n" +
            parameters + "[[pass]]\nrole = \"probe\"\ntechnique = \"sky\"\n") {
    scene_.add_floor({0, 0, 0}, 1.0);
    scene_.look({0, 1, 3}, {0, 0, 0});
    environment.put_into(scene_, scale, rotation);
  }
  Image ask(const std::string& answer, double alpha = 0.5) {
    graph_.set("probe.params.alpha=" + std::to_string(alpha));
    graph_.set("probe.params.answer=" + answer);
    return graph_.image(scene_);
  }
  void turn(const Environment& environment, const dquat& rotation) { environment.put_into(scene_, 1.0, rotation); }
  [[nodiscard]] int dispatches() {
    const char* stats = nullptr;
    check(heddle_stats(graph_.handle, &stats));
    return parsed::json(stats)["counters"]["dispatches"].get<int>();
  }

 private:
  Scene scene_;
  Graph graph_;
};

const dvec3 kToSun = glm::normalize(dvec3(0.5, 0.6, -0.4));

/// Sky above, ground below, and a sun of `radius` radians.
dvec3 outdoors(const dvec3& d, double radius = 0.05, double sun = 2000.0) {
  const double up = 0.5 + 0.5 * d.y;
  dvec3 value = d.y > 0 ? glm::mix(dvec3(1.0, 0.9, 0.8), dvec3(0.2, 0.4, 1.0), up) : dvec3(0.15, 0.12, 0.1);
  if (glm::dot(d, kToSun) > std::cos(radius)) value += dvec3(1.0, 0.9, 0.7) * sun;
  return value;
}

TEST(EnvironmentMap, H4EvenLightIsTheSameFromEverywhere) {
  Sky sky(Environment(32, 16, [](const dvec3&) { return dvec3(1.0, 0.5, 0.25); }), "", 2.0);
  double worst = 0.0;
  const auto compare = [&](const Image& image, double expected) {
    for (std::uint32_t y = 0; y < kHeight; ++y)
      for (std::uint32_t x = 0; x < kWidth; ++x)
        for (std::uint32_t c = 0; c < 3; ++c)
          worst =
              std::max(worst, std::abs(static_cast<double>(image.at(x, y, c)) / (expected * std::pow(0.5, c)) - 1.0));
  };
  compare(sky.ask("radiance"), 2.0);
  compare(sky.ask("irradiance"), 2.0 * kPi);
  for (const double alpha : {0.0, 0.001, 0.05, 0.1406, 0.5, 0.9, 1.0}) compare(sky.ask("specular", alpha), 2.0);
  EXPECT_LT(worst, 1e-5);
  RecordProperty("worst", std::to_string(worst * 1e7) + "e-7");
}

TEST(EnvironmentMap, RadianceIsTheImageWithoutSeamAndCreaseHoweverItIsTurned) {
  // H6. Linear in the direction: between texels bilinear filtering errs by an eighth of the squared texel.
  const auto linear = [](const dvec3& d) { return dvec3(2.0 + d.x, 2.0 + d.y, 2.0 + d.z); };
  for (const std::uint32_t width : {64U, 63U}) {  // odd: half a turn is no whole number of texels
    const Environment image(width, 32, linear);
    for (const dquat& rotation : {dquat(1, 0, 0, 0), glm::angleAxis(2.0, glm::normalize(dvec3(1, 2, 3)))}) {
      Sky sky(image, "", 1.0, rotation);
      const Image radiance = sky.ask("radiance");
      double worst = 0.0;
      for (std::uint32_t y = 0; y < kHeight; ++y)
        for (std::uint32_t x = 0; x < kWidth; ++x) {
          const dvec3 expected = linear(glm::conjugate(rotation) * direction_at(x, y));
          for (int c = 0; c < 3; ++c) worst = std::max(worst, std::abs(value_at(radiance, x, y)[c] - expected[c]));
        }
      EXPECT_LT(worst, 0.125 * (2 * kPi / width) * (2 * kPi / width) * 2.0) << width;
    }
  }
}

TEST(EnvironmentMap, IrradianceOfLinearLightAndOfACosineLobeIsTheClosedForm) {
  const dvec3 up(0, 1, 0);
  const auto light = [&](const dvec3& d) { return dvec3(2.0 + d.x, 1.0 + d.z, std::max(glm::dot(d, up), 0.0)); };
  Sky sky(Environment(256, 128, light));
  const Image irradiance = sky.ask("irradiance");
  double worst = 0.0;
  for (std::uint32_t y = 0; y < kHeight; ++y)
    for (std::uint32_t x = 0; x < kWidth; ++x) {
      const dvec3 n = direction_at(x, y);
      // Cosine lobe and cosine law at an angle g: 2/3 (sin g + (pi - g) cos g).
      const double g = std::atan2(glm::length(glm::cross(n, up)), n.y);
      const dvec3 expected(kPi * 2.0 + 2.0 * kPi / 3.0 * n.x, kPi + 2.0 * kPi / 3.0 * n.z,
                           2.0 / 3.0 * (std::sin(g) + (kPi - g) * std::cos(g)));
      for (int c = 0; c < 3; ++c) worst = std::max(worst, std::abs(value_at(irradiance, x, y)[c] - expected[c]));
    }
  // Linear between texels of 1/16 at a face's middle: h^2/8 = 5e-4 of the second derivative 2 pi / 3 on either axis. At
  // an edge of the cube the texels' centres are d = 1/32 off it on both sides, and what is linear between them follows
  // the chord: off by (1 - (1 - d)^2) / 2 s / (s^2 + 2)^1.5 <= 0.0059 of the direction, times the gradient 2 pi / 3.
  EXPECT_LT(worst, 0.0125);
  RecordProperty("worst", std::to_string(worst));
}

TEST(EnvironmentMap, H5ASingleTexelLightsByTheCosineLawWithoutFireflies) {
  // At the seam's column, half way to the pole.
  Environment image(256, 128, [](const dvec3&) { return dvec3(0.0); });
  const std::size_t texel = (std::size_t{32} * 256 + 0) * 4;
  for (std::size_t c = 0; c < 3; ++c) image.rgba[texel + c] = 1e5F;
  const Truth truth(image, 1024);
  Sky sky(image);
  const Image irradiance = sky.ask("irradiance");
  const dvec3 towards = map::direction_from_uv(0.5 / 256, 32.5 / 128);
  const double peak = truth.irradiance(towards).x;
  double worst = 0.0;
  for (std::uint32_t y = 0; y < kHeight; ++y)
    for (std::uint32_t x = 0; x < kWidth; ++x) {
      const double expected = peak * std::max(glm::dot(towards, direction_at(x, y)), 0.0);
      worst = std::max(worst, std::abs(value_at(irradiance, x, y).x - expected) / peak);
    }
  // Where the cosine meets 0 half way between texels of h = 1/16: h / 4; the light is a tent of 0.0245 to either side,
  // which shows a sixth of that over the horizon; h^2/8 on either axis besides.
  EXPECT_LT(worst, 0.0156 + 0.0041 + 0.0010);
  RecordProperty("irradiance", std::to_string(worst));
  for (const int level : {2, 4, 6, 8}) {
    const double alpha = level / 8.0 * level / 8.0;
    const Image specular = sky.ask("specular", alpha);
    const double highest = truth.specular(towards, alpha).x;
    double off = 0.0;
    for (std::uint32_t y = 0; y < kHeight; y += 3)
      for (std::uint32_t x = 0; x < kWidth; x += 3)
        off = std::max(off, std::abs(value_at(specular, x, y).x - truth.specular(direction_at(x, y), alpha).x));
    EXPECT_LT(off, 0.05 * highest) << "alpha " << alpha;  // linear between texels of 1.4 degrees, lobes from 3.6 on
    RecordProperty("specular_" + std::to_string(level), std::to_string(off / highest));
  }
}

TEST(EnvironmentMap, FilteringKeepsTheEnergyOfTheWholeSphere) {
  // The lobe depends on the angle alone, so its mean over all directions is the image's.
  const Environment image(256, 128, [](const dvec3& d) { return outdoors(d); });
  const dvec3 mean = Truth(image).integral([](const dvec3&) { return 1.0; }) / (4.0 * kPi);
  Sky sky(image);
  for (const double alpha : {0.0625, 0.2, 0.5, 1.0}) {
    const dvec3 found = mean_over_sphere(sky.ask("specular", alpha));
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c] / mean[c], 1.0, 0.01) << alpha;
    RecordProperty("alpha_" + std::to_string(alpha), std::to_string(found.x / mean.x - 1.0));
  }
  const dvec3 irradiance = mean_over_sphere(sky.ask("irradiance"));
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(irradiance[c] / (kPi * mean[c]), 1.0, 2e-3);
}

TEST(EnvironmentMap, TurningCostsNoFilterAndTurnsAllAnswers) {
  const Environment image(64, 32, [](const dvec3& d) { return outdoors(d, 0.2, 20.0); });
  Sky sky(image);
  const Image before = sky.ask("specular", 0.3);
  EXPECT_EQ(sky.dispatches(), 2);                               // the filter's and the probe's
  sky.turn(image, glm::angleAxis(-0.5 * kPi, dvec3(0, 1, 0)));  // a quarter turn, clockwise from above: towards +X
  const Image after = sky.ask("specular", 0.3);
  EXPECT_EQ(sky.dispatches(), 1);
  for (std::uint32_t y = 0; y < kHeight; y += 5)
    for (std::uint32_t x = 0; x < kWidth; x += 7)
      for (std::uint32_t c = 0; c < 3; ++c)
        EXPECT_NEAR(after.at((x + kWidth / 4) % kWidth, y, c), before.at(x, y, c), 2e-5F * (1.0F + before.at(x, y, c)));
}

TEST(EnvironmentMap, FilteredLobesAreTheirMeansByQuadrature) {
  const Environment image(256, 128, [](const dvec3& d) { return outdoors(d); });
  const Truth truth(image);
  Sky sky(image);
  std::printf("alpha    rms error/rms  worst/largest   (levels of roughness i/8, and half way between)\n");
  for (const double level : {1.0, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0}) {
    const double alpha = level / 8.0 * level / 8.0;
    const Image specular = sky.ask("specular", alpha);
    double error_squares = 0.0, squares = 0.0, worst = 0.0, largest = 0.0;
    for (std::uint32_t y = 0; y < kHeight; ++y)
      for (std::uint32_t x = 0; x < kWidth; ++x) {
        // Every pixel around the sun, of the others one in 36.
        const bool is_near = glm::dot(direction_at(x, y), kToSun) > std::cos(0.5);
        if (!is_near && (y % 6 != 2 || x % 6 != 1)) continue;
        const double weight = solid_angle(y) * (is_near ? 1.0 : 36.0);
        const double expected = truth.specular(direction_at(x, y), alpha).y;
        const double error = value_at(specular, x, y).y - expected;
        error_squares += weight * error * error;
        squares += weight * expected * expected;
        worst = std::max(worst, std::abs(error));
        largest = std::max(largest, expected);
      }
    const double rms = std::sqrt(error_squares / squares);
    std::printf("%.4f   %.4f         %.4f\n", alpha, rms, worst / largest);
    if (level < 2.0) continue;  // the lobe is as narrow as a texel: README, known limits
    // On a level: samples, and linear filtering between texels of h = 1/32, h^2/8 of the second derivative 1 / alpha^2
    // of the peak on either axis. Between levels a mix (7) of two lobes stands for one between: by quadrature of the
    // lobes alone it errs by 0.102, 0.047 and 0.024 of the one's norm at levels 2.5, 3.5 and 4.5.
    const bool is_on_level = level == std::floor(level);
    const double mixed = level < 3.0 ? 0.102 : level < 4.0 ? 0.047 : 0.024;
    EXPECT_LT(rms, (is_on_level ? 0.0 : mixed) + 2.0 / (32 * 32 * 8) / (alpha * alpha) + 0.005) << "alpha " << alpha;
  }
}

TEST(EnvironmentMap, ImportanceTablesHoldTheShareOfEachTexelsLight) {
  const Environment image(64, 32, [](const dvec3& d) { return outdoors(d, 0.3, 100.0); });
  const std::vector<float> padded = map::pad({image.width, image.height, image.rgba});
  const map::Padded radiance(padded, 64, 32);
  const map::Importance tables = map::importance(radiance, 64, 32);
  EXPECT_EQ(tables.rows.back(), 1.0F);
  double total = 0.0;
  std::vector<double> expected;
  constexpr int kPoints = 16;
  for (std::uint32_t y = 0; y < 32; ++y)
    for (std::uint32_t x = 0; x < 64; ++x) {
      double sum = 0.0;
      for (int j = 0; j < kPoints; ++j)
        for (int i = 0; i < kPoints; ++i) {
          const double v = (y + (j + 0.5) / kPoints) / 32;
          const dvec3 color = radiance.at((x + (i + 0.5) / kPoints) / 64, v);
          sum += glm::dot(color, dvec3(0.2126, 0.7152, 0.0722)) * std::sin(kPi * v);
        }
      expected.push_back(sum);
      total += sum;
    }
  double largest = 0.0;
  for (const double share : expected) largest = std::max(largest, share / total);
  for (std::uint32_t y = 0; y < 32; ++y) {
    const double row = static_cast<double>(tables.rows[y]) - (y > 0 ? static_cast<double>(tables.rows[y - 1]) : 0.0);
    EXPECT_EQ(tables.columns[std::size_t{y} * 64 + 63], 1.0F);
    for (std::uint32_t x = 0; x < 64; ++x) {
      const std::size_t i = std::size_t{y} * 64 + x;
      const double before = x > 0 ? static_cast<double>(tables.columns[i - 1]) : 0.0;
      // Two points a texel each way are exact for what is linear between centres, but for the sine.
      EXPECT_NEAR(row * (static_cast<double>(tables.columns[i]) - before), expected[i] / total, 2e-3 * largest)
          << x << ' ' << y;
    }
  }
  // Without light all directions are alike.
  const std::vector<float> black(std::size_t{4} * 6 * 4, 0.0F);
  const map::Importance even = map::importance(map::Padded(black, 4, 2), 8, 4);
  EXPECT_EQ(even.columns[3], 0.5F);
  EXPECT_EQ(even.rows[1], 0.5F);
}

TEST(EnvironmentMap, WhatIsTakenFromTheCubeAndWhatStaysAddUp) {
  const Environment image(128, 64, [](const dvec3& d) { return outdoors(d); });
  const std::vector<float> padded = map::pad({image.width, image.height, image.rgba});
  map::Cube cube = map::cube_from_image(map::Padded(padded, 128, 64), 64);
  const auto energy = [](const map::Cube& c) {
    dvec3 sum(0.0);
    for (std::uint32_t face = 0; face < 6; ++face)
      for (std::uint32_t y = 0; y < c.size; ++y)
        for (std::uint32_t x = 0; x < c.size; ++x)
          sum += c.texels[c.index(face, x, y)] * map::cube_solid_angle(c.size, x, y);
    return sum;
  };
  const dvec3 before = energy(cube);
  EXPECT_NEAR(before.x / Truth(image).integral([](const dvec3&) { return 1.0; }).x, 1.0, 2e-3);
  dvec3 after(0.0);
  const auto deltas = map::take_brightest(cube, 16);
  EXPECT_LE(deltas.size(), 16U);
  for (const map::Delta& delta : deltas) after += delta.irradiance;
  after += energy(cube);
  EXPECT_NEAR(after.x, before.x, 1e-12 * before.x);
  EXPECT_NEAR(energy(map::half(cube)).x, energy(cube).x, 1e-12 * before.x);
}

// ---- surfaces ----

const heddle_surface_material_service& material_service() {
  static void* library = dlopen(HEDDLE_BUILD_DIR "/lib/heddle/plugins/surface_material/ggx/ggx.so", RTLD_NOW);
  if (library == nullptr) throw std::runtime_error(dlerror());
  const auto entry = reinterpret_cast<heddle_entry_function>(dlsym(library, "heddle_entry"));
  return *static_cast<const heddle_surface_material_service*>(entry()->techniques[0]->functions[0].service);
}

std::string lit_graph(const std::string& lighting, const std::string& sky = "environment_map") {
  return "extent = [8, 8]\noutput = \"lighting.radiance\"\n"
         "[[pass]]\nname = \"material\"\nrole = \"surface_material\"\ntechnique = \"ggx\"\n"
         "[[pass]]\nrole = \"sky\"\ntechnique = \"" +
         sky + "\"\n" +
         "[[pass]]\nrole = \"gbuffer\"\ntechnique = \"raster\"\nparams.precision = \"float32\"\n"
         "[[pass]]\nrole = \"lighting\"\ntechnique = \"" +
         lighting + "\"\nparams.precision = \"float32\"\n";
}

TEST(EnvironmentMap, LitSurfacesAgainstQuadratureOfTheSameBrdf) {
  const Environment image(256, 128, [](const dvec3& d) { return outdoors(d, 0.15, 30.0); });
  const Truth truth(image, 192);
  std::printf("metalness roughness NoV | quadrature | split sum, exact | sampled | forward = deferred\n");
  Graph deferred(lit_graph("deferred")), forward(lit_graph("forward"));
  Scene scene;  // a floor for each material: what is made of the image serves all
  image.put_into(scene);
  double place = 0.0;
  for (const double metalness : {0.0, 1.0})
    for (const double roughness : {0.25, 0.5, 0.75, 1.0}) {
      HeddleMaterial record = Scene::grey();
      record.roughness = static_cast<float>(roughness);
      record.metalness = static_cast<float>(metalness);
      scene.use_material(record);
      place += 200.0;
      scene.add_floor({place, 0, 0}, 50.0);
      for (const double NoV : {0.25, 0.6, 0.95}) {
        const dvec3 V = dvec3(std::sqrt(1.0 - NoV * NoV), NoV, 0.0);
        scene.look(dvec3(place, 0, 0) + V, {place, 0, 0}, 1e-3);
        const Image lit = deferred.image(scene);
        const Image drawn = forward.image(scene);
        const double found = static_cast<double>(lit.at(4, 4, 1));
        EXPECT_NEAR(static_cast<double>(drawn.at(4, 4, 1)), found, 1e-5 * found);

        heddle_surface_point point{};
        point.struct_size = sizeof point;
        point.base_color[0] = point.base_color[1] = point.base_color[2] = 0.5;
        point.metalness = metalness;
        point.roughness = roughness;
        point.ior = 1.5;
        // The floor's normal is +Y; the service's is +Z.
        const auto to_service = [](const dvec3& d, double(&out)[3]) {
          out[0] = d.x;
          out[1] = -d.z;
          out[2] = d.y;
        };
        double view[3];
        to_service(V, view);
        const double expected = truth
                                    .integral([&](const dvec3& d) {
                                      if (d.y <= 0.0) return 0.0;
                                      double from[3], f[3];
                                      to_service(d, from);
                                      material_service().evaluate(&point, view, from, 0, 1, f);
                                      return f[1] * d.y;
                                    })
                                    .y;
        // The split: the same light, averaged exactly, times the lobes' albedos.
        double single[3], specular[3], diffuse[3];
        material_service().albedo(&point, NoV, 2, 0, single);
        material_service().albedo(&point, NoV, 2, 1, specular);
        material_service().albedo(&point, NoV, 1, 1, diffuse);
        const double alpha = roughness * roughness;
        const dvec3 D = glm::normalize(
            glm::mix(dvec3(0, 1, 0), dvec3(-V.x, V.y, 0.0), (1.0 - alpha) * (std::sqrt(1.0 - alpha) + alpha)));
        const double split = single[1] * truth.specular(D, alpha).y +
                             (diffuse[1] + specular[1] - single[1]) * truth.irradiance({0, 1, 0}).y / kPi;
        std::printf("%.0f  %.2f  %.2f | %.5f | %+.4f | %+.4f\n", metalness, roughness, NoV, expected,
                    split / expected - 1.0, found / split - 1.0);
        EXPECT_NEAR(found / split, 1.0, 0.03);    // sampling, filtering, interpolation
        EXPECT_NEAR(split / expected, 1.0, 0.3);  // what the README says of it
      }
    }
}

TEST(EnvironmentMap, ScenesWithoutEnvironmentPayNothing) {
  const auto run = [](const std::string& text, Image& image) {
    Scene scene;
    scene.add_floor({0, -1, 0}, 5.0);
    scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0, -1, 0}, 3.0));
    scene.look({0, 0, 0}, {0, -1, -1});
    Graph graph(text);
    image = graph.image(scene);
    const char* stats = nullptr;
    check(heddle_stats(graph.handle, &stats));
    auto json = parsed::json(stats);
    for (const char* of_the_process : {"pipelines_total", "pipeline_total_ms"}) json["counters"].erase(of_the_process);
    return std::tuple(json["counters"], json["libraries"], json["memory"]);
  };
  Image with, without;
  const auto counted_with = run(lit_graph("deferred"), with);
  const auto counted_without = run(lit_graph("deferred", "none"), without);
  EXPECT_EQ(with.pixels, without.pixels);
  EXPECT_EQ(counted_with, counted_without);
}

TEST(EnvironmentMap, AnEnvironmentThatNoPassReadsIsNamed) {
  Scene scene;
  Environment(4, 2, [](const dvec3&) { return dvec3(1.0); }).put_into(scene);
  scene.add_floor({0, -1, 0}, 5.0);
  scene.look({0, 0, 0}, {0, -1, -1});
  Graph graph(lit_graph("deferred", "uniform"));
  Host::get().log.clear();
  graph.render(scene);
  ASSERT_EQ(Host::get().log.size(), 1U);
  EXPECT_EQ(Host::get().log[0],
            "test.toml: the scene has an environment, and no pass of this graph reads it; graph 'environment' does, "
            "with technique sky/environment_map");
}

TEST(EnvironmentMap, BadEnvironmentsAreRefused) {
  Scene scene;
  heddle_environment environment{};
  environment.struct_size = sizeof environment;
  const auto refused = [&] {
    EXPECT_EQ(heddle_scene_set_environment(scene.handle, &environment), HEDDLE_BAD_INPUT);
    return std::string(heddle_error(Host::get().handle));
  };
  EXPECT_EQ(refused(), "error: the environment is 0 x 0 texels: expected 1 to 16384 each, and pixels");
  std::vector<float> pixels(2 * 1 * 4, 1.0F);
  environment.width = 2;
  environment.height = 1;
  environment.pixels = pixels.data();
  environment.channels = 2;
  EXPECT_EQ(refused(), "error: the environment has 2 channels: expected 1, 3 or 4");
  environment.channels = 4;
  pixels[4] = -0.5F;
  EXPECT_EQ(refused(), "error: the environment's texel 1, 0 is -0.5: expected radiance, finite and not negative");
  pixels[4] = 0.5F;
  environment.scale = -1.0;
  EXPECT_EQ(refused(),
            "error: the environment's scale is -1, its rotation 0 0 0 0: expected finite numbers, and a scale that is "
            "not negative");
}

}  // namespace
