// SPDX-License-Identifier: Apache-2.0
#include "compare/compare.hpp"

#include "compare/metrics.hpp"
#include "json.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "pictures.hpp"

namespace heddle::compare {
namespace {

Options with(std::vector<std::string> metrics) {
  Options options;
  options.metrics = std::move(metrics);
  return options;
}

Json values(const image::Image& a, const image::Image& b, const Options& options = {}) {
  return parse_json(compare(a, b, options).json)["metrics"];
}

TEST(Compare, ComputesWhatIsAskedForInThatOrder) {
  const image::Image a = constant(2, 2, {0.5F}), b = constant(2, 2, {0.25F});
  const Json found = values(a, b, with({"maximum", "rmse"}));
  std::vector<std::string> names;
  for (const auto& [name, metric] : found.items()) names.push_back(name);
  EXPECT_THAT(names, testing::ElementsAre("maximum", "rmse"));
  EXPECT_EQ(found["rmse"]["value"], 0.25);
  EXPECT_EQ(found["rmse"]["formula"], "sqrt(mean (a-b)^2)");
}

TEST(Compare, WithoutNamesComputesAllThatNeedNoEncoding) {
  const image::Image a = noise(5, 4, 2, 1), b = noise(5, 4, 2, 2);
  const Json found = values(a, b);
  for (const char* name : {"mse", "rmse", "relmse", "psnr", "ssim", "mean_difference", "maximum", "percentile_50",
                           "percentile_95", "percentile_99", "differing_pixels"})
    EXPECT_TRUE(found.contains(name)) << name;
  EXPECT_FALSE(found.contains("flip"));
  const Metrics expected = measure(a, b);
  EXPECT_EQ(found["mse"]["value"], expected.mse);
  EXPECT_EQ(found["relmse"]["value"], expected.relmse);
  EXPECT_EQ(found["percentile_99"]["value"], expected.percentile_99);
  EXPECT_EQ(found["maximum"]["pixel"], (Json{expected.maximum_x, expected.maximum_y}));
}

TEST(Compare, PsnrOfEqualPicturesIsNoNumber) {
  const image::Image a = noise(3, 3, 3, 1);
  EXPECT_TRUE(values(a, a, with({"psnr"}))["psnr"]["value"].is_null());
}

TEST(Compare, PercentilesMayBeAnyNumber) {
  std::vector<float> steps(1000);
  for (std::size_t i = 0; i < steps.size(); ++i) steps[i] = static_cast<float>(i + 1);
  const image::Image a{1000, 1, 1, steps}, b{1000, 1, 1, std::vector<float>(1000)};
  const Json found = values(a, b, with({"percentile_99.9", "percentile_100", "percentile_0.01", "percentile_50"}));
  EXPECT_EQ(found["percentile_99.9"]["value"], 999);
  EXPECT_EQ(found["percentile_100"]["value"], 1000);
  EXPECT_EQ(found["percentile_0.01"]["value"], 1);
  EXPECT_EQ(found["percentile_50"]["value"], 500);
}

TEST(Compare, SaysWithWhatFlipWasMeasured) {
  const image::Image a = noise(8, 8, 3, 1), b = noise(8, 8, 3, 2);
  Options options = with({"flip", "hdr_flip"});
  options.exposures = Exposures{-2, 3, 4};
  options.tone_mapper = ToneMapper::kHable;
  const Json found = values(a, b, options);
  EXPECT_NEAR(found["flip"]["pixels_per_degree"].get<double>(), 67.0206, 1e-4);
  EXPECT_EQ(found["hdr_flip"]["start_exposure"], -2);
  EXPECT_EQ(found["hdr_flip"]["stop_exposure"], 3);
  EXPECT_EQ(found["hdr_flip"]["exposures"], 4);
  EXPECT_EQ(found["hdr_flip"]["tone_mapper"], "hable");
}

TEST(Compare, BlackAndConstantPicturesHaveNumbersEverywhere) {
  const image::Image black = constant(7, 5, {0, 0, 0}), white = constant(7, 5, {1, 1, 1});
  const auto all = with({"mse", "relmse", "ssim", "maximum", "flip", "hdr_flip"});
  for (const auto& [a, b] : {std::pair(black, black), std::pair(black, white), std::pair(white, black)}) {
    const Json found = values(a, b, all);
    for (const auto& [name, metric] : found.items()) EXPECT_TRUE(metric["value"].is_number()) << name;
  }
  EXPECT_EQ(values(black, black, all)["hdr_flip"]["value"], 0);
}

TEST(Compare, ErrorImagesHoldWhatTheirMetricSays) {
  Options options = with({"mse", "rmse", "relmse", "mean_difference", "ssim", "flip"});
  options.keeps_maps = true;
  const Comparison found = compare(constant(2, 1, {0.25F}), constant(2, 1, {0.75F}), options);
  EXPECT_THAT(found.maps.at("mse").pixels, testing::Each(0.25F));
  EXPECT_THAT(found.maps.at("rmse").pixels, testing::Each(0.5F));
  EXPECT_THAT(found.maps.at("relmse").pixels, testing::Each(testing::FloatEq(0.25F / 0.5725F)));
  EXPECT_THAT(found.maps.at("mean_difference").pixels, testing::Each(-0.5F));
  const double ssim = (2 * 0.1875 + 1e-4) / (0.625 + 1e-4);
  EXPECT_THAT(found.maps.at("ssim").pixels, testing::Each(testing::FloatNear(static_cast<float>(1 - ssim), 1e-6F)));
  EXPECT_EQ(found.maps.at("flip").channels, 1U);
}

TEST(Compare, RefusesWhatItDoesNotKnow) {
  const image::Image a = constant(1, 1, {0});
  EXPECT_EQ(
      error_from([&] { compare(a, a, with({"rsme"})); }),
      "error: there is no metric 'rsme'\n"
      "  expected: one of mse, rmse, relmse, psnr, ssim, mean_difference, maximum, percentile_P, differing_pixels, "
      "flip, hdr_flip\n"
      "  help:     did you mean 'rmse'?");
  EXPECT_EQ(error_from([&] { compare(a, a, with({"percentile_101"})); }),
            "error: 'percentile_101' is no percentile\n"
            "  expected: a number above 0, at most 100, as in percentile_99.9");
  Options options;
  options.exposures = Exposures{2, 1, 3};
  EXPECT_EQ(error_from([&] { compare(a, a, options); }),
            "error: HDR-FLIP's exposures make no sense\n"
            "  found:    2 to 1 stops, 3 of them\n"
            "  expected: -100 <= start <= stop <= 100, and 1 to 1000 of them; one only where start is stop");
  options.exposures = Exposures{std::numeric_limits<double>::quiet_NaN(), 1, 3};
  EXPECT_THAT(error_from([&] { compare(a, a, options); }), testing::HasSubstr("nan to 1 stops"));
  options = {};
  options.pixels_per_degree = -1;
  EXPECT_EQ(error_from([&] { compare(a, a, options); }),
            "error: FLIP's viewing conditions make no sense\n"
            "  found:    -1 pixels per degree\n"
            "  expected: 1 to 1000");
}

TEST(Compare, NonFiniteValuesAreNamedAndCounted) {
  image::Image a = constant(3, 2, {0, 0, 0});
  const image::Image b = a;
  a.pixels[7] = std::numeric_limits<float>::infinity();
  a.pixels[16] = a.pixels[17] = std::numeric_limits<float>::quiet_NaN();
  for (const char* metric : {"mse", "ssim", "flip", "hdr_flip"}) {
    EXPECT_EQ(error_from([&] { compare(a, b, with({metric})); }),
              "error: a value of image a is not finite\n"
              "  found:    inf at x 2, y 0, channel 1, and 2 more\n"
              "  expected: finite values");
  }
}

TEST(FalseColors, GrowLighterFromBlackToWhite) {
  image::Image map{101, 1, 1, {}};
  for (int i = 0; i <= 100; ++i) map.pixels.push_back(static_cast<float>(i) / 50.0F);
  const image::Image colors = false_colors(map, 2.0);
  const auto luminance = [&](std::size_t i) {
    const auto linear = [](float value) {
      return value <= 0.04045F ? value / 12.92F : std::pow((value + 0.055F) / 1.055F, 2.4F);
    };
    return 0.2126F * linear(colors.pixels[3 * i]) + 0.7152F * linear(colors.pixels[3 * i + 1]) +
           0.0722F * linear(colors.pixels[3 * i + 2]);
  };
  EXPECT_EQ(luminance(0), 0.0F);
  EXPECT_NEAR(luminance(100), 1.0F, 1e-6F);
  for (std::size_t i = 1; i <= 100; ++i) EXPECT_GT(luminance(i), luminance(i - 1)) << i;
}

TEST(FalseColors, OfNothingAreBlack) {
  const image::Image zero = constant(2, 2, {0});
  EXPECT_THAT(false_colors(zero, 0.0).pixels, testing::Each(0.0F));
}

}  // namespace
}  // namespace heddle::compare
