// SPDX-License-Identifier: Apache-2.0
#include "compare/ssim.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "pictures.hpp"

namespace heddle::compare {
namespace {

/// The definition, by two loops over the window and central moments.
double by_definition(const image::Image& a, const image::Image& b, int x, int y) {
  const auto width = static_cast<int>(a.width), height = static_cast<int>(a.height);
  double sum = 0, mean_a = 0, mean_b = 0, variance_a = 0, variance_b = 0, covariance = 0;
  const auto over_window = [&](auto body) {
    for (int j = std::max(0, y - 5); j <= std::min(height - 1, y + 5); ++j) {
      for (int i = std::max(0, x - 5); i <= std::min(width - 1, x + 5); ++i) {
        const auto at = static_cast<std::size_t>(j * width + i);
        const double distance = (i - x) * (i - x) + (j - y) * (j - y);
        body(std::exp(-distance / 4.5), double{a.pixels[at]}, double{b.pixels[at]});
      }
    }
  };
  over_window([&](double weight, double p, double q) {
    sum += weight;
    mean_a += weight * p;
    mean_b += weight * q;
  });
  mean_a /= sum;
  mean_b /= sum;
  over_window([&](double weight, double p, double q) {
    variance_a += weight / sum * (p - mean_a) * (p - mean_a);
    variance_b += weight / sum * (q - mean_b) * (q - mean_b);
    covariance += weight / sum * (p - mean_a) * (q - mean_b);
  });
  return (2 * mean_a * mean_b + 1e-4) * (2 * covariance + 9e-4) /
         ((mean_a * mean_a + mean_b * mean_b + 1e-4) * (variance_a + variance_b + 9e-4));
}

TEST(Ssim, FollowsItsDefinitionUpToTheBorders) {
  const image::Image a = noise(17, 14, 1, 1), b = noise(17, 14, 1, 2);
  const std::vector<float> map = ssim(a, b, 1);
  for (int y = 0; y < 14; ++y) {
    for (int x = 0; x < 17; ++x)
      EXPECT_NEAR(map[static_cast<std::size_t>(y * 17 + x)], by_definition(a, b, x, y), 2e-7) << x << ", " << y;
  }
}

TEST(Ssim, OfEqualPicturesIsOne) {
  const image::Image a = noise(20, 30, 3, 3, 1000.0F);
  for (const float value : ssim(a, a, 2)) EXPECT_EQ(value, 1.0F);
}

TEST(Ssim, OfFlatPicturesIsTheLuminanceTerm) {
  for (const float value : ssim(constant(8, 8, {0.2F}), constant(8, 8, {0.8F}), 1))
    EXPECT_NEAR(value, (2 * 0.16 + 1e-4) / (0.04 + 0.64 + 1e-4), 1e-6);
}

TEST(Ssim, OfOnePixelIsTheLuminanceTerm) {
  EXPECT_NEAR(ssim(constant(1, 1, {0}), constant(1, 1, {1}), 1)[0], 1e-4 / (1 + 1e-4), 1e-9);
}

TEST(Ssim, IsTheMeanOverColoursWithoutAlpha) {
  const image::Image a = noise(12, 12, 4, 4), b = noise(12, 12, 4, 5);
  const auto channel = [](const image::Image& picture, std::size_t which) {
    image::Image one{picture.width, picture.height, 1, {}};
    for (std::size_t i = which; i < picture.pixels.size(); i += 4) one.pixels.push_back(picture.pixels[i]);
    return one;
  };
  const std::vector<float> all = ssim(a, b, 1);
  const auto r = ssim(channel(a, 0), channel(b, 0), 1), g = ssim(channel(a, 1), channel(b, 1), 1),
             blue = ssim(channel(a, 2), channel(b, 2), 1);
  for (std::size_t i = 0; i < all.size(); ++i) EXPECT_NEAR(all[i], (r[i] + g[i] + blue[i]) / 3, 1e-6);
}

TEST(Ssim, BitsDoNotDependOnThreads) {
  const image::Image a = noise(33, 70, 3, 6), b = noise(33, 70, 3, 7);
  EXPECT_EQ(ssim(a, b, 1), ssim(a, b, 4));
}

TEST(Ssim, DoesNotLoseSmallVarianceOnALargeMean) {
  // Values about 4096 whose differences are exact in float32: the variance is 2^-12 of nothing visible to a sum of
  // squares in float32.
  image::Image a = noise(16, 16, 1, 8), b = noise(16, 16, 1, 9);
  for (image::Image* picture : {&a, &b}) {
    for (float& value : picture->pixels) value = 4096.0F + std::round(value * 64.0F) / 64.0F;
  }
  const std::vector<float> map = ssim(a, b, 1);
  EXPECT_NEAR(map[8 * 16 + 8], by_definition(a, b, 8, 8), 1e-6);
}

}  // namespace
}  // namespace heddle::compare
