// SPDX-License-Identifier: Apache-2.0
// display/ocio on the device against OpenColorIO's CPU path: displays, views, config files, baked tables, and what
// people are told.
#include "display/ocio/transform.hpp"
#include "roles/rendering.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace {

using namespace rendering;
using ocio_display::Request;
using ocio_display::Transform;

constexpr double kExposure = 3.0;  // white: 1.2 * 8
constexpr std::uint32_t kSize = 64;

std::string graph_text(const std::string& params) {
  return "extent = [64, 64]\noutput = \"display.color\"\n[[pass]]\nname = \"colors\"\nrole = \"probe\"\ntechnique = "
         "\"colors\"\n[[pass]]\nname = \"display\"\nrole = \"display\"\ntechnique = \"ocio\"\nparams.exposure = 3\n"
         "inputs.radiance = \"colors.values\"\n" +
         params;
}

Image show(const std::string& params) {
  Scene scene;
  scene.look({0, 0, 0}, {0, 0, -1});
  Graph graph(graph_text(params));
  return graph.image(scene);
}

/// The colours of probe/colors, exposed.
std::vector<float> exposed_colors(double lowest = -12.0, double highest = 10.0) {
  const auto value_of = [&](std::uint32_t index) {
    const double value = index == 0 ? 0.0 : std::exp2(lowest + (highest - lowest) * (index - 1.0) / 14.0);
    return static_cast<float>(value / (1.2 * std::exp2(kExposure)));
  };
  std::vector<float> colors;
  for (std::uint32_t y = 0; y < kSize; ++y) {
    for (std::uint32_t x = 0; x < kSize; ++x) {
      colors.insert(colors.end(), {value_of(x % 16), value_of(y % 16), value_of((x / 16 + 4 * (y / 16)) % 16)});
    }
  }
  return colors;
}

/// What the CPU path of the library makes of them, clipped to [0, 1].
std::vector<float> expected_colors(const Request& request) {
  std::vector<float> colors = exposed_colors();
  Transform(request).apply(colors);
  for (float& c : colors) c = std::clamp(c, 0.0F, 1.0F);
  return colors;
}

double greatest_difference(const Image& image, const std::vector<float>& expected) {
  double most = 0.0;
  for (std::uint32_t i = 0; i < kSize * kSize; ++i) {
    for (std::uint32_t c = 0; c < 3; ++c) {
      const double got = static_cast<double>(image.pixels[std::size_t{i} * image.channels + c]);
      most = std::max(most, std::abs(got - static_cast<double>(expected[std::size_t{i} * 3 + c])));
    }
  }
  return most;
}

// Half a step of the output's format, and what float32 differs between two orders of the same operations: 4e-6 in [0,
// 1] where nothing is steep.
constexpr double kHalfStepOf8 = 0.5 / 255.0 + 1e-5, kHalfStepOf16 = 0.5 / 65535.0 + 1e-5;

TEST(Ocio, EveryViewOnSrgbIsTheCpuPaths) {
  for (std::uint32_t view = 0; ocio_display::kViewNames[view] != nullptr; ++view) {
    const std::string name = ocio_display::kViewNames[view];
    const Image image = show("params.view = \"" + name + "\"\n");
    EXPECT_LT(greatest_difference(image, expected_colors({0, view})), kHalfStepOf8) << name;
  }
}

TEST(Ocio, EveryDisplayOfAnAcesViewIsTheCpuPaths) {
  for (std::uint32_t display = 0; ocio_display::kDisplayNames[display] != nullptr; ++display) {
    const std::string name = ocio_display::kDisplayNames[display];
    const std::uint32_t view = ocio_display::needs_16_bits(display) ? 4 : 0;
    const Image image =
        show("params.display = \"" + name + "\"\nparams.view = \"" + ocio_display::kViewNames[view] + "\"\n");
    EXPECT_LT(greatest_difference(image, expected_colors({display, view})),
              ocio_display::needs_16_bits(display) ? kHalfStepOf16 : kHalfStepOf8)
        << name;
  }
}

TEST(Ocio, GamutCompressionIsTheCpuPaths) {
  Request request;
  request.compresses_gamut = true;
  const std::vector<float> expected = expected_colors(request);
  EXPECT_LT(greatest_difference(show("params.gamut_compression = true\n"), expected), kHalfStepOf8);
  EXPECT_GT(greatest_difference(show(""), expected), 0.02) << "it does something";
}

TEST(Ocio, WithoutAViewSrgbIsTheStandardsCurve) {
  const Image image = show("params.view = \"none\"\n");
  const std::vector<float> exposed = exposed_colors();
  for (std::size_t i = 0; i < exposed.size() / 3; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      const double x = std::clamp(static_cast<double>(exposed[i * 3 + c]), 0.0, 1.0);
      const double encoded = x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1.0 / 2.4) - 0.055;
      // The matrices there and back leave 1e-6 of the brightest channel, 107 times white here, in the others.
      EXPECT_NEAR(static_cast<double>(image.pixels[i * image.channels + c]), encoded, 1.5 / 255.0) << i << " " << c;
    }
  }
}

TEST(Ocio, HalfAStopMoreShowsMidGreyAsTheStandardsCurveDoes) {
  const float grey = 0.18F * static_cast<float>(std::exp2(0.55));
  std::vector<float> rgb{grey, grey, grey};
  Transform({}).apply(rgb);
  EXPECT_NEAR(rgb[1], 1.055 * std::pow(0.18, 1.0 / 2.4) - 0.055, 0.005);
}

TEST(Ocio, AcesShowsBlackAsZeroGreysAsGreyAndItsOwnWhiteAsOne) {
  Scene scene;
  scene.look({0, 0, 0}, {0, 0, -1});
  // White at 17 times the exposure's: ACES SDR reaches 1 at 16.3.
  Graph graph(
      "extent = [64, 8]\noutput = \"display.color\"\n[[pass]]\nname = \"pattern\"\nrole = \"probe\"\ntechnique = "
      "\"pattern\"\nparams.white = 163.2\n[[pass]]\nname = \"display\"\nrole = \"display\"\ntechnique = \"ocio\"\n"
      "params.exposure = 3\ninputs.radiance = \"pattern.values\"\n");
  for (const char* table : {"0", "33", "65"}) {
    graph.set(std::string("display.params.lut_size=") + table);
    const Image image = graph.image(scene);
    EXPECT_EQ(image.at(0, 3), 0.0F) << "NaN";
    EXPECT_EQ(image.at(1, 3), 1.0F) << "+Inf";
    EXPECT_EQ(image.at(2, 3), 0.0F) << "-Inf";
    EXPECT_EQ(image.at(3, 3), 0.0F) << "-1";
    EXPECT_EQ(image.at(4, 3), 0.0F) << "black";
    EXPECT_EQ(image.at(5, 3), 1.0F) << "ACES white";
    float last = 0.0F;
    for (std::uint32_t x = 7; x < 64; ++x) {
      EXPECT_GE(image.at(x, 0), last) << x;
      // The white of D65, adapted to ACES' and back: one step of 8 bits.
      EXPECT_NEAR(image.at(x, 0, 0), image.at(x, 0, 1), 1.01F / 255.0F) << x;
      EXPECT_NEAR(image.at(x, 0, 2), image.at(x, 0, 1), 1.01F / 255.0F) << x;
      last = image.at(x, 0);
    }
  }
}

TEST(Ocio, BakedTablesApproachTheTransformAsTheyGrow) {
  const std::vector<float> expected = expected_colors({});
  double last = 1.0;
  for (const std::uint32_t size : {17U, 33U, 65U, 129U}) {
    const Image image = show("params.lut_size = " + std::to_string(size) + "\n");
    double squares = 0.0;
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const double got = static_cast<double>(image.pixels[i / 3 * image.channels + i % 3]);
      squares += (got - static_cast<double>(expected[i])) * (got - static_cast<double>(expected[i]));
    }
    const double rmse = std::sqrt(squares / static_cast<double>(expected.size()));
    std::printf("  table of %3u: RMSE %.5f, at most %.4f\n", size, rmse, greatest_difference(image, expected));
    EXPECT_LT(rmse, last) << size;
    last = rmse;
  }
  // Rounding to 8 bits alone is 1 / 255 / sqrt(12) = 0.0011.
  EXPECT_LT(last, 0.0015);
}

TEST(Ocio, TheShaperIsItsInversesInverse) {
  for (double x = 0.0; x <= 1024.0; x = 1.7 * x + 1e-4) {
    EXPECT_NEAR(ocio_display::unshape(ocio_display::shape(x)), x, 1e-12 * (1.0 + x));
  }
  EXPECT_EQ(ocio_display::shape(0.0), 0.0);
  EXPECT_EQ(ocio_display::unshape(0.0), 0.0);
  EXPECT_EQ(ocio_display::shape(1024.0), 1.0);
}

// ---- config files ----

/// A config with a matrix, a one-dimensional and a three-dimensional table.
class ConfigFile : public testing::Test {
 protected:
  ConfigFile() : folder_(std::filesystem::temp_directory_path() / "heddle-ocio-test") {
    std::filesystem::create_directories(folder_);
    std::ofstream curve(folder_ / "curve.spi1d");
    curve << "Version 1\nFrom 0.0 1.0\nLength 64\nComponents 1\n{\n";
    for (int i = 0; i < 64; ++i) curve << std::pow(i / 63.0, 1.0 / 2.2) << "\n";
    curve << "}\n";
    std::ofstream cube(folder_ / "look.cube");
    cube << "LUT_3D_SIZE 9\n";
    for (int b = 0; b < 9; ++b) {
      for (int g = 0; g < 9; ++g) {
        for (int r = 0; r < 9; ++r) {
          cube << 0.9 * r / 8.0 + 0.1 * g / 8.0 << " " << std::pow(g / 8.0, 1.2) << " "
               << b / 8.0 * (1.0 - 0.2 * r / 8.0) << "\n";
        }
      }
    }
    std::ofstream(folder_ / "test.ocio") << R"(ocio_profile_version: 2
search_path: .
roles:
  default: scene
  scene_linear: scene
displays:
  screen:
    - !<View> {name: curve, colorspace: curve}
    - !<View> {name: look, colorspace: look}
  paper:
    - !<View> {name: plain, colorspace: scene}
colorspaces:
  - !<ColorSpace>
    name: scene
  - !<ColorSpace>
    name: curve
    from_scene_reference: !<FileTransform> {src: curve.spi1d, interpolation: linear}
  - !<ColorSpace>
    name: look
    from_scene_reference: !<GroupTransform>
      children:
        - !<FileTransform> {src: curve.spi1d, interpolation: linear}
        - !<FileTransform> {src: look.cube, interpolation: linear}
)";
  }
  ~ConfigFile() override { std::filesystem::remove_all(folder_); }
  std::string params(const std::string& more) const {
    return "params.config = \"" + (folder_ / "test.ocio").string() + "\"\n" + more;
  }
  std::string error_of(const std::string& lines) const {
    heddle_host* host = Host::get().handle;
    heddle_graph* graph = nullptr;
    check(heddle_graph_parse(host, graph_text(lines).c_str(), "test.toml", folder_.c_str(), nullptr, 0, &graph));
    Scene scene;
    scene.look({0, 0, 0}, {0, 0, -1});
    EXPECT_EQ(heddle_render(graph, scene.handle, nullptr), HEDDLE_BAD_INPUT);
    std::string text = heddle_error(host);
    heddle_graph_destroy(graph);
    return text;
  }
  std::filesystem::path folder_;
};

TEST_F(ConfigFile, ItsViewsWithTablesAreTheCpuPaths) {
  for (const char* view : {"curve", "look"}) {
    Request request;
    request.config = (folder_ / "test.ocio").string();
    request.config_source = "scene";
    request.config_view = view;
    const Image image =
        show(params(std::string("params.config_source = \"scene\"\nparams.config_view = \"") + view + "\"\n"));
    EXPECT_LT(greatest_difference(image, expected_colors(request)), kHalfStepOf16) << view;
  }
}

TEST_F(ConfigFile, MistakesNameWhatTheConfigHas) {
  const std::string place = "test.toml:7:1: error: pass 'display' (display/ocio): ";
  const std::string config = "config '" + (folder_ / "test.ocio").string() + "': ";
  EXPECT_EQ(error_of("params.config = \"test.ocio\"\n"),
            place + config +
                "config_source is \"\"; expected the colour space of the config that is linear Rec.709, one of scene, "
                "curve, look");
  EXPECT_EQ(error_of(params("params.config_source = \"scene\"\nparams.config_display = \"scren\"\n")),
            place + config + "config_display is \"scren\"; expected one of screen, paper");
  EXPECT_EQ(error_of(params("params.config_source = \"scene\"\nparams.config_view = \"plain\"\n")),
            place + config + "config_view is \"plain\"; display 'screen' has curve, look");
  EXPECT_THAT(error_of("params.config = \"no.ocio\"\n"),
              testing::StartsWith(place + "OpenColorIO: Error could not read '" + (folder_ / "no.ocio").string()));
  EXPECT_EQ(error_of("params.lut_size = 1\n"),
            place + "lut_size is 1; expected 0, for no table, or 2 and more: a table of one node has no cells");
}

}  // namespace
