// SPDX-License-Identifier: Apache-2.0
// The hard cases of role display, and display/linear's curve against float64.
#include "roles/rendering.hpp"

namespace {

using namespace rendering;

// White of EV100 3 is 1.2 * 8.
Image show(double white, double exposure) {
  Scene scene;
  scene.look({0, 0, 0}, {0, 0, -1});
  Graph graph(
      "extent = [64, 8]\noutput = \"display.color\"\n[[pass]]\nname = \"pattern\"\nrole = \"probe\"\ntechnique = "
      "\"pattern\"\nparams.white = " +
      std::to_string(white) +
      "\n[[pass]]\nname = \"display\"\nrole = \"display\"\ntechnique = \"linear\"\nparams.exposure = " +
      std::to_string(exposure) + "\ninputs.radiance = \"pattern.values\"\n");
  return graph.image(scene);
}

TEST(Display, H1InfNegativeAndNanRadianceGiveColoursInRange) {
  const Image image = show(9.6, 3.0);
  EXPECT_EQ(image.at(0, 3), 0.0F) << "NaN";
  EXPECT_EQ(image.at(1, 3), 1.0F) << "+Inf";
  EXPECT_EQ(image.at(2, 3), 0.0F) << "-Inf";
  EXPECT_EQ(image.at(3, 3), 0.0F) << "-1";
  EXPECT_EQ(image.at(6, 3), 0.0F) << "1e-30";
}

TEST(Display, H2BlackStaysExactlyZeroAndTheWhitePointExactlyOne) {
  for (const double exposure : {-10.0, 0.0, 15.0, 20.0}) {
    const Image image = show(1.2 * std::exp2(exposure), exposure);
    EXPECT_EQ(image.at(4, 0), 0.0F) << exposure;
    EXPECT_EQ(image.at(5, 0), 1.0F) << exposure;
  }
}

TEST(DisplayLinear, EncodesARampAsTheStandardSays) {
  const Image image = show(9.6, 3.0);
  for (std::uint32_t x = 7; x < 64; ++x) {
    const double linear = x / 63.0;
    const double encoded = linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1.0 / 2.4) - 0.055;
    // Half a step of 8 bits, and 1e-5 where float32 rounds a tie the other way.
    for (std::uint32_t channel = 0; channel < 3; ++channel)
      EXPECT_NEAR(static_cast<double>(image.at(x, 2, channel)), encoded, 0.5 / 255.0 + 1e-5);
  }
}

}  // namespace
