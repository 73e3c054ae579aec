// SPDX-License-Identifier: Apache-2.0
// What holds for every pair. That the numbers are the authors' own: tests/python/test_flip_official.py.
#include "compare/flip.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pictures.hpp"

namespace heddle::compare {
namespace {

constexpr Exposures kTwoStops{-1, 1, 3};

std::vector<float> of(const image::Image& a, const image::Image& b) {
  return flip(a, b, kPixelsPerDegree, 1);
}

std::vector<float> hdr_of(const image::Image& a, const image::Image& b, const Exposures& exposures,
                          std::uint32_t threads = 1) {
  return hdr_flip(a, b, kPixelsPerDegree, exposures, ToneMapper::kAces, threads);
}

float largest(const std::vector<float>& map) {
  return *std::max_element(map.begin(), map.end());
}

TEST(Flip, OfEqualPicturesIsExactlyZero) {
  for (const std::uint32_t channels : {1U, 3U, 4U}) {
    const image::Image picture = noise(37, 23, channels, 1);
    EXPECT_EQ(largest(of(picture, picture)), 0.0F);
    EXPECT_EQ(largest(hdr_of(picture, picture, kTwoStops)), 0.0F);
  }
}

TEST(Flip, IsSymmetric) {
  const image::Image a = noise(31, 17, 3, 2), b = noise(31, 17, 3, 3);
  EXPECT_EQ(of(a, b), of(b, a));
}

TEST(Flip, BitsDoNotDependOnThreads) {
  const image::Image a = noise(70, 101, 3, 4), b = noise(70, 101, 3, 5);
  const std::vector<float> one = of(a, b);
  for (const std::uint32_t threads : {2U, 3U, 5U, 64U}) EXPECT_EQ(flip(a, b, kPixelsPerDegree, threads), one);
  EXPECT_EQ(hdr_of(a, b, kTwoStops, 3), hdr_of(a, b, kTwoStops, 1));
}

TEST(Flip, OfBlackAgainstWhiteFollowsFromTheFormula) {
  // No edges: FLIP is the colour term alone. HyAB of black and white is 100; c_max is green against blue, 41.27... ^
  // 0.7 with Lab of the sRGB primaries. Here worked out anew in float64, from the published matrix of sRGB.
  const auto lab = [](double x, double y, double z) {
    const double fx = std::cbrt(x / 0.950428545), fy = std::cbrt(y), fz = std::cbrt(z / 1.088900371);
    const double l = 116 * fy - 16;
    return std::array{l, 0.01 * l * 500 * (fx - fy), 0.01 * l * 200 * (fy - fz)};
  };
  const auto green = lab(0.357591, 0.715182, 0.119197), blue = lab(0.180451, 0.0721803, 0.950388);
  const double c_max = std::pow(std::abs(green[0] - blue[0]) + std::hypot(green[1] - blue[1], green[2] - blue[2]), 0.7);
  const double expected = 0.95 + (std::pow(100.0, 0.7) - 0.4 * c_max) / (c_max - 0.4 * c_max) * 0.05;
  for (const float value : of(constant(3, 2, {0, 0, 0}), constant(3, 2, {1, 1, 1}))) EXPECT_NEAR(value, expected, 2e-5);
}

TEST(Flip, GrayIsTheSameInOneChannelAndInThree) {
  const image::Image a = noise(20, 11, 1, 6), b = noise(20, 11, 1, 7);
  const auto triple = [](const image::Image& gray) {
    image::Image rgb{gray.width, gray.height, 3, {}};
    for (const float value : gray.pixels) rgb.pixels.insert(rgb.pixels.end(), 3, value);
    return rgb;
  };
  EXPECT_EQ(of(a, b), of(triple(a), triple(b)));
}

TEST(Flip, LeavesOutAlpha) {
  image::Image a = noise(9, 9, 4, 8);
  image::Image b = a;
  for (std::size_t i = 3; i < b.pixels.size(); i += 4) b.pixels[i] = 1.0F - b.pixels[i];
  EXPECT_EQ(largest(of(a, b)), 0.0F);
}

TEST(Flip, OfOnePixelIsThatOfAnyFlatPicture) {
  const std::vector<float> one = of(constant(1, 1, {0.2F, 0.5F, 0.7F}), constant(1, 1, {0.3F, 0.4F, 0.7F}));
  const std::vector<float> many = of(constant(40, 33, {0.2F, 0.5F, 0.7F}), constant(40, 33, {0.3F, 0.4F, 0.7F}));
  ASSERT_EQ(one.size(), 1U);
  EXPECT_GT(one[0], 0.0F);
  for (const float value : many) EXPECT_NEAR(value, one[0], 1e-5F);
}

TEST(Flip, ClampsWhatADisplayCannotShow) {
  const image::Image a = constant(4, 4, {-3.0F, 0.5F, 7.0F}), clamped = constant(4, 4, {0.0F, 0.5F, 1.0F});
  EXPECT_EQ(largest(of(a, clamped)), 0.0F);
}

TEST(Flip, IsWithinZeroAndOneAndOfNumbers) {
  for (unsigned seed = 0; seed < 8; ++seed) {
    const image::Image a = noise(23, 19, 3, seed, 1.0F), b = noise(23, 19, 3, seed + 100, 1e30F);
    for (const auto& map : {of(a, b), hdr_of(a, b, {-20, 20, 5})}) {
      for (const float value : map) {
        ASSERT_TRUE(value >= 0.0F && value <= 1.0F) << value;
      }
    }
  }
}

TEST(Flip, KnowsNoPicturesOfFiveColours) {
  const image::Image five = constant(2, 2, {0, 0, 0, 0, 0});
  EXPECT_EQ(error_from([&] { of(five, five); }),
            "error: 'flip' is a metric of colours\n"
            "  found:    images of 5 channels\n"
            "  expected: 1 (gray), 2 (gray, alpha), 3 (RGB) or 4 (RGB, alpha)");
}

TEST(HdrFlip, IsTheLargestOverItsExposures) {
  const image::Image a = noise(21, 13, 3, 9, 4.0F), b = noise(21, 13, 3, 10, 4.0F);
  std::vector<float> expected(std::size_t{21} * 13, 0.0F);
  for (const double exposure : {-1.0, 0.0, 1.0}) {
    const std::vector<float> at = hdr_of(a, b, {exposure, exposure, 1});
    std::transform(at.begin(), at.end(), expected.begin(), expected.begin(),
                   [](float x, float y) { return std::max(x, y); });
  }
  EXPECT_EQ(hdr_of(a, b, kTwoStops), expected);
}

TEST(HdrFlip, AnExposureIsAFactor) {
  const image::Image a = noise(21, 13, 3, 11), b = noise(21, 13, 3, 12);
  const auto scaled = [](image::Image picture) {
    for (float& value : picture.pixels) value *= 8.0F;
    return picture;
  };
  EXPECT_EQ(hdr_of(a, b, {3, 3, 1}), hdr_of(scaled(a), scaled(b), {0, 0, 1}));
}

TEST(HdrFlip, NegativeRadianceCountsAsNone) {
  EXPECT_EQ(largest(hdr_of(constant(4, 4, {-1, -2, -1e30F}), constant(4, 4, {0, 0, 0}), kTwoStops)), 0.0F);
}

TEST(Exposures, BringTheBrightestAndTheMedianPixelToTheKneeOfTheCurve) {
  // The curve itself, evaluated at luminance * 2^exposure, must give 0.85.
  const auto aces = [](double x) { return x * (0.9036 * x + 0.018) / (x * (0.8748 * x + 0.354) + 0.14); };
  image::Image reference = constant(5, 1, {0, 0, 0});
  for (std::size_t i = 0; i < 5; ++i)
    std::fill_n(reference.pixels.begin() + static_cast<std::ptrdiff_t>(3 * i), 3, std::exp2(static_cast<float>(2 * i)));
  const Exposures found = exposures_of(reference, ToneMapper::kAces);
  EXPECT_NEAR(aces(256 * std::exp2(found.start)), 0.85, 1e-6);
  EXPECT_NEAR(aces(16 * std::exp2(found.stop)), 0.85, 1e-6);
  EXPECT_EQ(found.count, 4U);
  const Exposures reinhard = exposures_of(reference, ToneMapper::kReinhard);
  EXPECT_NEAR(256 * std::exp2(reinhard.start) / (1 + 256 * std::exp2(reinhard.start)), 0.85, 1e-6);
}

TEST(Exposures, OfAMedianOfZeroAreThoseOfWhatIsNotBlack) {
  image::Image reference = constant(9, 1, {0, 0, 0});
  std::fill_n(reference.pixels.begin(), 3, 4.0F);
  std::fill_n(reference.pixels.begin() + 3, 3, 1.0F);
  std::fill_n(reference.pixels.begin() + 6, 3, 0.5F);
  const Exposures found = exposures_of(reference, ToneMapper::kAces);
  EXPECT_NEAR(found.stop - found.start, 2.0, 1e-6);  // from 4 to the median of {4, 1, 0.5}
  EXPECT_LE(found.count, 3U);
}

TEST(Exposures, OfABlackOrNegativeReferenceIsOne) {
  for (const float value : {0.0F, -5.0F}) {
    const Exposures found = exposures_of(constant(4, 4, {value, value, value}), ToneMapper::kAces);
    EXPECT_EQ(found.count, 1U);
    EXPECT_EQ(found.start, 0.0);
  }
}

TEST(Exposures, OfAConstantReferenceAreTwoAlike) {
  const Exposures found = exposures_of(constant(4, 4, {2, 2, 2}), ToneMapper::kHable);
  EXPECT_EQ(found.count, 2U);
  EXPECT_EQ(found.start, found.stop);
}

}  // namespace
}  // namespace heddle::compare
