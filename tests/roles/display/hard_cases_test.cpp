// SPDX-License-Identifier: Apache-2.0
// The hard cases of role display, and display/linear's curve against float64.
#include "roles/rendering.hpp"

#include <filesystem>

namespace {

using namespace rendering;

/// Techniques that the build has, each as it shows the exposure's white point as white.
std::vector<std::string> techniques() {
  std::vector<std::string> all{"linear"};
  if (std::filesystem::exists(HEDDLE_BUILD_DIR "/lib/heddle/plugins/display/ocio")) {
    all.insert(all.end(), {"ocio", "ocio_table"});
  }
  return all;
}
std::string settings_of(const std::string& technique) {
  if (technique == "linear") return "technique = \"linear\"\n";
  return std::string("technique = \"ocio\"\nparams.view = \"none\"\n") +
         (technique == "ocio_table" ? "params.lut_size = 33\n" : "");
}

// White of EV100 3 is 1.2 * 8.
Image show(const std::string& technique, double white, double exposure) {
  Scene scene;
  scene.look({0, 0, 0}, {0, 0, -1});
  Graph graph(
      "extent = [64, 8]\noutput = \"display.color\"\n[[pass]]\nname = \"pattern\"\nrole = \"probe\"\ntechnique = "
      "\"pattern\"\nparams.white = " +
      std::to_string(white) + "\n[[pass]]\nname = \"display\"\nrole = \"display\"\n" + settings_of(technique) +
      "params.exposure = " + std::to_string(exposure) + "\ninputs.radiance = \"pattern.values\"\n");
  return graph.image(scene);
}

class HardCases : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Display, HardCases, testing::ValuesIn(techniques()),
                         [](const auto& test) { return test.param; });

TEST_P(HardCases, H1InfNegativeAndNanRadianceGiveColoursInRange) {
  const Image image = show(GetParam(), 9.6, 3.0);
  EXPECT_EQ(image.at(0, 3), 0.0F) << "NaN";
  EXPECT_EQ(image.at(1, 3), 1.0F) << "+Inf";
  EXPECT_EQ(image.at(2, 3), 0.0F) << "-Inf";
  EXPECT_EQ(image.at(3, 3), 0.0F) << "-1";
  EXPECT_EQ(image.at(6, 3), 0.0F) << "1e-30";
}

TEST_P(HardCases, H2BlackStaysExactlyZeroAndTheWhitePointExactlyOne) {
  for (const double exposure : {-10.0, 0.0, 15.0, 20.0}) {
    const Image image = show(GetParam(), 1.2 * std::exp2(exposure), exposure);
    for (std::uint32_t channel = 0; channel < 3; ++channel) {
      EXPECT_EQ(image.at(4, 0, channel), 0.0F) << exposure;
      EXPECT_EQ(image.at(5, 0, channel), 1.0F) << exposure;
    }
  }
}

TEST(DisplayLinear, EncodesARampAsTheStandardSays) {
  const Image image = show("linear", 9.6, 3.0);
  for (std::uint32_t x = 7; x < 64; ++x) {
    const double linear = x / 63.0;
    const double encoded = linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1.0 / 2.4) - 0.055;
    // Half a step of 8 bits, and 1e-5 where float32 rounds a tie the other way.
    for (std::uint32_t channel = 0; channel < 3; ++channel)
      EXPECT_NEAR(static_cast<double>(image.at(x, 2, channel)), encoded, 0.5 / 255.0 + 1e-5);
  }
}

}  // namespace
