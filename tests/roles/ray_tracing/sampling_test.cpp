// SPDX-License-Identifier: Apache-2.0
// What ray_tracing/path_tracer draws from: densities integrate to 1 and are those of the samples, choices among lights
// add up, nothing that lights a point is left out, the sky is drawn as bright as it is, sums know their own error.
#include "ray_tracing/path_tracer/film.hpp"
#include "ray_tracing/path_tracer/light_shapes.hpp"
#include "ray_tracing/path_tracer/light_tree.hpp"
#include "ray_tracing/path_tracer/sampler.hpp"
#include "ray_tracing/path_tracer/sky_map.hpp"

#include <gtest/gtest.h>

#include <numbers>

namespace {

using namespace heddle::path_tracer;
using glm::dvec2;
using glm::dvec3;
using std::numbers::pi;

dvec2 number(std::uint64_t i, std::uint64_t stream = 0) {
  const std::uint64_t x = sampling::mix_bits(i * 2654435761U + stream * 0x9e3779b97f4a7c15ULL);
  return {static_cast<double>(x >> 11U) * 0x1p-53, static_cast<double>(sampling::mix_bits(x) >> 11U) * 0x1p-53};
}

dvec3 even_direction(std::uint64_t i) {
  const dvec2 u = number(i, 99);
  const double z = 1 - 2 * u.x, s = std::sqrt(1 - z * z);
  return {s * std::cos(2 * pi * u.y), z, s * std::sin(2 * pi * u.y)};
}

Light rectangle(double half_x, double half_y, const dvec3& center) {
  HeddleLight record{};
  record.type = HEDDLE_LIGHT_RECTANGLE;
  record.direction[1] = -1.0F;
  record.tangent[0] = 1.0F;
  record.half_extent[0] = static_cast<float>(half_x);
  record.half_extent[1] = static_cast<float>(half_y);
  record.intensity[0] = record.intensity[1] = record.intensity[2] = 1.0F;
  for (int i = 0; i < 3; ++i) record.position_rel[i] = static_cast<float>(center[i]);
  return {record, dvec3(0.0), {}};
}

Light ball(double radius, const dvec3& center) {
  Light light = rectangle(0, 0, center);
  HeddleLight record = light.record;
  record.type = HEDDLE_LIGHT_SPHERE;
  record.radius = static_cast<float>(radius);
  return {record, dvec3(0.0), {}};
}

TEST(PathTracerLights, SamplesOfAShapeAreMetAgainWithTheSameDensityAndValue) {
  for (const Light& light :
       {rectangle(0.5, 0.3, {0, 1, 0}), rectangle(0.5, 0.3, {3, 0.2, 1}), rectangle(2, 2, {0, 0.01, 0}),
        rectangle(0.01, 0.02, {1, 5, 2}), ball(0.5, {0, 2, 0}), ball(0.1, {5, 5, 5}), ball(3, {0, 1, 0})}) {
    for (std::uint64_t i = 0; i < 2000; ++i) {
      const Arrival sample = sample_light(light, dvec3(0.0), number(i), {});
      ASSERT_GT(sample.pdf, 0.0);
      ASSERT_NEAR(glm::length(sample.direction), 1.0, 1e-12);
      // A hair from the rim may be missed.
      const Arrival met = meet_light(light, dvec3(0.0), sample.direction, 0.0, 1e30, {});
      if (met.pdf == 0.0) continue;
      ASSERT_NEAR(met.pdf, sample.pdf, 1e-6 * sample.pdf);
      ASSERT_NEAR(met.distance, sample.distance, 1e-6 * sample.distance);
      ASSERT_NEAR(met.value.x, sample.value.x, 1e-9);
    }
  }
}

TEST(PathTracerLights, DensitiesOverAllDirectionsAddUpToOne) {
  constexpr std::uint64_t kCount = 400000;
  for (const Light& light : {rectangle(0.5, 0.3, {0, 1, 0}), rectangle(0.9, 0.5, {0.8, 0.3, 0.4}),
                             rectangle(2, 2, {0, 0.1, 0}), ball(0.5, {0, 1, 0}), ball(3, {0, 1, 0})}) {
    double sum = 0.0, squares = 0.0;
    for (std::uint64_t i = 0; i < kCount; ++i) {
      const double pdf = 4 * pi * meet_light(light, dvec3(0.0), even_direction(i), 0.0, 1e30, {}).pdf;
      sum += pdf;
      squares += pdf * pdf;
    }
    const double mean = sum / kCount, error = std::sqrt((squares / kCount - mean * mean) / kCount);
    EXPECT_NEAR(mean, 1.0, 4.5 * error + 1e-9);
  }
}

TEST(PathTracerLights, SamplesAreSpreadAsTheirDensitySays) {
  // The mean of 1 / pdf is the solid angle; that of cosine / pdf is Lambert's form factor of a parallel rectangle above
  // its corner: 1/2 (a atan(b / sqrt(1 + a^2)) / sqrt(1 + a^2) + the same exchanged).
  for (const double height : {0.2, 1.0, 3.0}) {
    const double a = 0.8 / height, b = 0.6 / height;
    const Light light = rectangle(0.4, 0.3, {0.4, height, 0.3});
    double sum = 0.0, squares = 0.0;
    constexpr std::uint64_t kCount = 200000;
    for (std::uint64_t i = 0; i < kCount; ++i) {
      const Arrival sample = sample_light(light, dvec3(0.0), number(i), {});
      const double value = sample.direction.y / sample.pdf;
      sum += value;
      squares += value * value;
    }
    const double ra = std::sqrt(1 + a * a), rb = std::sqrt(1 + b * b);
    const double truth = 0.5 * (a / ra * std::atan(b / ra) + b / rb * std::atan(a / rb));
    const double mean = sum / kCount, error = std::sqrt((squares / kCount - mean * mean) / kCount);
    EXPECT_NEAR(mean, truth, 4.5 * error + 1e-6);
    EXPECT_GT(std::abs(mean - 1.02 * truth), 4.5 * error) << "a bias of 2 % would be seen";
  }
}

std::vector<LightBounds> many_lights(std::size_t count) {
  std::vector<LightBounds> all;
  for (std::uint64_t i = 0; i < count; ++i) {
    LightBounds bounds;
    const dvec2 u = number(i, 1), v = number(i, 2);
    const dvec3 center(20 * u.x - 10, 20 * u.y - 10, 20 * v.x - 10);
    const double size = v.y < 0.5 ? 0.0 : 0.3;
    bounds.low = center - size;
    bounds.high = center + size;
    bounds.intensity = i % 97 == 0 ? 0.0 : 0.1 + v.y;
    bounds.range = i % 3 == 0 ? 4.0 : std::numeric_limits<double>::infinity();
    if (i % 2 == 0) {
      bounds.axis = even_direction(i);
      bounds.cos_spread = i % 4 == 0 ? 1.0 : 0.8;
    }
    bounds.is_two_sided = i % 5 == 0;
    bounds.has_shape = size > 0.0;
    all.push_back(bounds);
  }
  return all;
}

TEST(PathTracerLightTree, ProbabilitiesAddUpToOneAndAreThoseOfTheChoices) {
  for (const std::size_t count : {std::size_t{1}, std::size_t{2}, std::size_t{1000}}) {
    const std::vector<LightBounds> lights = many_lights(count + 1);  // number 0 is dark
    LightTree tree;
    tree.build(lights);
    double kept = 0.0;
    for (std::uint64_t i = 0; i < 50; ++i) {
      const dvec3 point = 12.0 * (2.0 * dvec3(number(i, 5), number(i, 6).x) - 1.0), normal = even_direction(i + 7);
      double sum = 0.0;
      for (std::uint32_t k = 0; k < lights.size(); ++k) sum += tree.probability(point, normal, k);
      // Where a branch turns out to hold nothing its share is lost, never given to another.
      EXPECT_LE(sum, 1.0 + 1e-9);
      kept += sum / 50.0;
      for (std::uint64_t j = 0; j < 20; ++j) {
        const LightTree::Choice choice = tree.choose(point, normal, number(j, i + 50).x);
        const double again = choice.probability > 0.0 ? tree.probability(point, normal, choice.emitter) : 0.0;
        EXPECT_NEAR(choice.probability, again, 1e-9 * choice.probability);
      }
    }
    if (count == 1000) {
      EXPECT_GT(kept, 0.6);
    }
  }
}

TEST(PathTracerLightTree, WhatCanLightAPointCanBeChosen) {
  const std::vector<LightBounds> lights = many_lights(2000);
  LightTree tree;
  tree.build(lights);
  for (std::uint64_t i = 0; i < 200; ++i) {
    const dvec3 point = 12.0 * (2.0 * dvec3(number(i, 5), number(i, 6).x) - 1.0), normal = even_direction(i + 7);
    for (std::uint32_t k = 1; k < lights.size(); ++k) {
      const dvec3 to = 0.5 * (lights[k].low + lights[k].high) - point;
      const double distance = glm::length(to), cosine = -glm::dot(lights[k].axis, to) / distance;
      const double turned = std::acos(std::clamp(lights[k].is_two_sided ? std::abs(cosine) : cosine, -1.0, 1.0));
      const bool is_lit = lights[k].intensity > 0.0 && distance < lights[k].range && glm::dot(to, normal) > 0.0 &&
                          turned - std::acos(lights[k].cos_spread) < 0.5 * pi;
      ASSERT_TRUE(!is_lit || tree.probability(point, normal, k) > 0.0) << k;
    }
  }
}

TEST(PathTracerLightTree, ARayMeetsAllShapesOnItsWay) {
  const std::vector<LightBounds> lights = many_lights(500);
  LightTree tree;
  tree.build(lights);
  for (std::uint64_t i = 0; i < 300; ++i) {
    const dvec3 origin = 12.0 * (2.0 * dvec3(number(i, 5), number(i, 6).x) - 1.0);
    const dvec3 direction = i < 6 ? dvec3(i == 0, i == 1, i >= 2) : even_direction(i);
    std::vector<int> met(lights.size(), 0);
    tree.meet(origin, direction, 15.0, [&](std::uint32_t k) { ++met[k]; });
    for (std::uint32_t k = 1; k < lights.size(); ++k) {
      ASSERT_LE(met[k], 1);
      if (!lights[k].has_shape || lights[k].intensity == 0.0) continue;
      const dvec3 center = 0.5 * (lights[k].low + lights[k].high);
      const double along = glm::dot(center - origin, direction);
      // The ball within the box.
      const bool is_met = along > 0.0 && along < 15.0 && glm::length(origin + along * direction - center) < 0.29;
      ASSERT_TRUE(!is_met || met[k] == 1) << k;
    }
  }
}

TEST(PathTracerSky, DirectionsAreDrawnAsBrightAsTheyAre) {
  constexpr std::uint32_t kWidth = 16, kHeight = 8;
  std::vector<float> rgba(std::size_t{4} * kWidth * kHeight, 0.0F);
  for (std::size_t i = 0; i < std::size_t{kWidth} * kHeight; ++i)
    for (std::size_t c = 0; c < 3; ++c)
      rgba[4 * i + c] = static_cast<float>(i % 7 == 3 ? 0.0 : number(i, c).x * (i == 40 ? 500 : 1));
  SkyMap sky;
  sky.set(kWidth, kHeight, rgba.data());
  double by_sky = 0.0, by_sky_squares = 0.0, evenly = 0.0, even_squares = 0.0, pdfs = 0.0, pdf_squares = 0.0;
  constexpr std::uint64_t kCount = 300000;
  for (std::uint64_t i = 0; i < kCount; ++i) {
    const SkyMap::Drawn drawn = sky.sample(number(i));
    ASSERT_GT(drawn.pdf, 0.0);
    const SkyMap::Drawn seen = sky.look(drawn.direction);
    ASSERT_NEAR(drawn.pdf, seen.pdf, 1e-6 * drawn.pdf);
    // Within a texel of at most 500 the value changes by that much, and the place is told to 1e-12 of one.
    for (glm::length_t c = 0; c < 3; ++c) {
      ASSERT_NEAR(drawn.radiance[c], seen.radiance[c], 1e-8);
      ASSERT_EQ(seen.radiance[c], sky.radiance(drawn.direction)[c]);
    }
    const double a = sky.radiance(drawn.direction).x / drawn.pdf;
    by_sky += a / kCount;
    by_sky_squares += a * a / kCount;
    const dvec3 d = even_direction(i);
    const double b = sky.radiance(d).x * 4 * pi, p = sky.pdf(d) * 4 * pi;
    ASSERT_TRUE(b == 0.0 || p > 0.0);
    evenly += b / kCount;
    even_squares += b * b / kCount;
    pdfs += p / kCount;
    pdf_squares += p * p / kCount;
  }
  const double var = (by_sky_squares - by_sky * by_sky) / kCount, even_var = (even_squares - evenly * evenly) / kCount;
  EXPECT_NEAR(by_sky, evenly, 4.5 * std::sqrt(var + even_var));
  EXPECT_LT(var, 0.2 * even_var);
  EXPECT_NEAR(pdfs, 1.0, 4.5 * std::sqrt((pdf_squares - pdfs * pdfs) / kCount));
}

TEST(PathTracerSky, AnEvenSkyIsExactlyEven) {
  std::vector<float> rgba(std::size_t{4} * 32 * 16, 0.7F);
  SkyMap sky;
  sky.set(32, 16, rgba.data());
  EXPECT_TRUE(sky.is_even());
  for (std::uint64_t i = 0; i < 1000; ++i) EXPECT_EQ(sky.radiance(even_direction(i)).x, static_cast<double>(0.7F));
  for (const dvec3& pole : {dvec3(0, 1, 0), dvec3(0, -1, 0)}) {
    EXPECT_EQ(sky.radiance(pole).x, static_cast<double>(0.7F));
    EXPECT_GT(sky.pdf(pole), 0.0);
  }
  rgba.back() = 0.5F;  // alpha says nothing
  sky.set(32, 16, rgba.data());
  EXPECT_TRUE(sky.is_even());
  rgba[rgba.size() - 2] = std::nextafter(0.7F, 1.0F);
  sky.set(32, 16, rgba.data());
  EXPECT_FALSE(sky.is_even());
}

TEST(PathTracerSamples, AnyPowerOfTwoOfAScramblingFillsTheSquareEvenly) {
  for (std::uint32_t dimension : {0U, 5U, 77U}) {
    for (const std::uint32_t count : {16U, 64U}) {
      // Every elementary box of a (0, m, 2)-net holds one point.
      std::uint32_t log2 = 0;
      while ((1U << log2) < count) ++log2;
      for (std::uint32_t across = 0; across <= log2; ++across) {
        std::vector<int> boxes(count, 0);
        for (std::uint32_t i = 0; i < count; ++i) {
          const dvec2 u = Sampler(Points::kSobol, 1234, std::uint64_t{i} * kReplicates + 1).pair(dimension);
          const auto x = static_cast<std::size_t>(u.x * (1U << across));
          const auto y = static_cast<std::size_t>(u.y * (1U << (log2 - across)));
          ++boxes[x * (std::size_t{1} << (log2 - across)) + y];
        }
        for (const int box : boxes) ASSERT_EQ(box, 1);
      }
    }
  }
}

TEST(PathTracerFilm, TheVarianceIsThatOfTheMean) {
  // 400 pixels of numbers with variance 1/12: their means' spread is what the film says of each on the whole.
  for (const std::uint32_t samples : {3U, 8U, 20U, 64U}) {
    double told = 0.0, spread = 0.0;
    constexpr int kPixels = 4000;
    for (int pixel = 0; pixel < kPixels; ++pixel) {
      PixelSums sums;
      for (std::uint32_t i = 0; i < samples; ++i) {
        Estimate estimate;
        estimate.direct = dvec3(number(i, 1000 + static_cast<std::uint64_t>(pixel)).x);
        sums.add(i, estimate);
      }
      told += sums.variance(samples).x / kPixels;
      spread += std::pow(sums.mean(samples).x - 0.5, 2) / kPixels;
    }
    EXPECT_NEAR(told, 1.0 / 12 / samples, 0.07 / 12 / samples) << samples;
    EXPECT_NEAR(spread, 1.0 / 12 / samples, 0.1 / 12 / samples) << samples;
  }
  EXPECT_TRUE(std::isinf(PixelSums{}.variance(1).x));
}

}  // namespace
