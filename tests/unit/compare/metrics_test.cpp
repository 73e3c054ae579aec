// SPDX-License-Identifier: Apache-2.0
// Metrics against values worked out by hand.
#include "compare/metrics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace heddle::compare {
namespace {

using image::Image;

// All inputs are exact in float32, so only the float64 arithmetic of the formulas rounds.
constexpr double kRounding = 1e-14;

Image gray(std::uint32_t width, std::uint32_t height, std::vector<float> pixels) {
  return {width, height, 1, std::move(pixels)};
}

std::string error_of(const Image& a, const Image& b) {
  try {
    measure(a, b);
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), HEDDLE_BAD_INPUT);
    return error.what();
  }
  return "no error";
}

TEST(Metrics, EqualImagesHaveNoDifferenceAndInfinitePsnr) {
  const Image image = gray(2, 2, {0, 0.25F, 0.5F, 1});
  const Metrics metrics = measure(image, image);
  EXPECT_EQ(metrics.mse, 0);
  EXPECT_EQ(metrics.relmse, 0);
  EXPECT_EQ(metrics.maximum, 0);
  EXPECT_EQ(metrics.differing_pixels, 0U);
  EXPECT_TRUE(std::isinf(metrics.psnr) && metrics.psnr > 0);
}

TEST(Metrics, FollowTheirFormulas) {
  // Differences a - b: 0.5, 0, -0.25, 0. Squares: 0.25, 0, 0.0625, 0.
  const Metrics metrics = measure(gray(4, 1, {1, 0.5F, 0, 2}), gray(4, 1, {0.5F, 0.5F, 0.25F, 2}));
  EXPECT_NEAR(metrics.mse, 0.3125 / 4, kRounding);
  EXPECT_NEAR(metrics.rmse, std::sqrt(0.078125), kRounding);
  EXPECT_NEAR(metrics.relmse, (0.25 / 0.26 + 0.0625 / 0.0725) / 4, kRounding);
  EXPECT_NEAR(metrics.psnr, 10 * std::log10(1 / 0.078125), kRounding * 100);
  EXPECT_NEAR(metrics.mean_difference, 0.25 / 4, kRounding);
  EXPECT_EQ(metrics.maximum, 0.5);
  EXPECT_EQ(metrics.differing_pixels, 2U);
}

TEST(Metrics, MaximumIsFoundByPixelAndChannel) {
  Image a{3, 2, 4, std::vector<float>(24, 0.0F)};
  const Image b = a;
  a.pixels[(1 * 3 + 2) * 4 + 3] = -0.75F;  // x 2, y 1, alpha
  a.pixels[0] = 0.5F;
  const Metrics metrics = measure(a, b);
  EXPECT_EQ(metrics.maximum, 0.75);
  EXPECT_EQ(metrics.maximum_x, 2U);
  EXPECT_EQ(metrics.maximum_y, 1U);
  EXPECT_EQ(metrics.maximum_channel, 3U);
}

TEST(Metrics, PixelsAreCountedOnceHoweverManyChannelsDiffer) {
  const Image a{2, 1, 3, {1, 1, 1, 0, 0, 0}};
  const Image b{2, 1, 3, {0, 0, 0, 0, 0, 0}};
  EXPECT_EQ(measure(a, b).differing_pixels, 1U);
}

TEST(Metrics, PercentileIsTheNearestRank) {
  // 200 values 1/256 .. 200/256: rank ceil(0.99 * 200) = 198.
  std::vector<float> values(200);
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = static_cast<float>(i + 1) / 256.0F;
  }
  EXPECT_EQ(measure(gray(200, 1, values), gray(200, 1, std::vector<float>(200))).percentile_99, 198.0 / 256);
  // One value is its own percentile; 101 values: rank ceil(99.99) = 100.
  EXPECT_EQ(measure(gray(1, 1, {0.5F}), gray(1, 1, {0})).percentile_99, 0.5);
  values.resize(101);
  EXPECT_EQ(measure(gray(101, 1, values), gray(101, 1, std::vector<float>(101))).percentile_99, 100.0 / 256);
}

TEST(Metrics, SumsAreFloat64) {
  // A float32 sum of 2^24 ones and halves would stop growing; a float32 mean would be off in the third digit.
  constexpr std::uint32_t kSide = 4608;
  const Image a{kSide, kSide, 1, std::vector<float>(std::size_t{kSide} * kSide, 1.5F)};
  const Image b{kSide, kSide, 1, std::vector<float>(std::size_t{kSide} * kSide, 0.0F)};
  EXPECT_EQ(measure(a, b).mse, 2.25);
  EXPECT_EQ(measure(a, b).mean_difference, 1.5);
}

TEST(Metrics, DifferentShapesAreRefused) {
  EXPECT_EQ(error_of(gray(2, 1, {0, 0}), gray(1, 2, {0, 0})),
            "error: images of different shapes cannot be compared\n"
            "  found:    image a is 2 x 1 x 1, image b 1 x 2 x 1\n"
            "  expected: the same width, height and channels");
  EXPECT_THAT(error_of({}, {}), testing::HasSubstr("an image without pixels cannot be compared"));
  EXPECT_THAT(error_of(gray(2, 1, {0}), gray(2, 1, {0, 0})), testing::HasSubstr("without pixels"));
}

TEST(Metrics, NonFiniteValuesAreNamed) {
  Image b{2, 2, 3, std::vector<float>(12)};
  const Image a = b;
  b.pixels[(1 * 2 + 1) * 3 + 2] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(error_of(a, b),
            "error: a value of image b (the reference) is not finite\n"
            "  found:    nan at x 1, y 1, channel 2\n"
            "  expected: finite values");
  b.pixels[(1 * 2 + 1) * 3 + 2] = std::numeric_limits<float>::infinity();
  EXPECT_THAT(error_of(b, a), testing::HasSubstr("inf at x 1, y 1, channel 2"));
}

TEST(Difference, IsTheMagnitudeOfEachValue) {
  const Image result = difference(gray(2, 1, {0.25F, 1}), gray(2, 1, {0.75F, 0.5F}));
  EXPECT_THAT(result.pixels, testing::ElementsAre(0.5F, 0.5F));
  EXPECT_EQ(result.width, 2U);
}

TEST(MetricsJson, HasEveryMetricAndNullForInfinity) {
  const Image image = gray(1, 1, {0.5F});
  EXPECT_EQ(to_json(measure(image, image)),
            R"({"mse": 0, "rmse": 0, "relmse": 0, "psnr": null, "mean_difference": 0, "maximum": 0, )"
            R"("maximum_at": {"x": 0, "y": 0, "channel": 0}, "percentile_99": 0, "differing_pixels": 0})");
  EXPECT_THAT(to_json(measure(gray(1, 1, {1}), image)), testing::HasSubstr(R"("mse": 0.25, "rmse": 0.5)"));
}

}  // namespace
}  // namespace heddle::compare
