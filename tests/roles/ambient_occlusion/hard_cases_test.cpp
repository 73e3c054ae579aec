// SPDX-License-Identifier: Apache-2.0
// Every technique of the role runs every hard case of role.toml, on the default device, through the C API.
#include "parsed.hpp"
#include "rendering.hpp"
#include "roles/readme.hpp"

#include <numbers>

namespace {

using glm::dvec3;
using rendering::Camera;
using rendering::Graph;
using rendering::Image;
using rendering::Scene;
using rendering::Shape;
using Json = nlohmann::json;

constexpr std::uint32_t kSize = 96;

Json list() {
  const char* text = "";
  rendering::require(heddle_list(rendering::host(), &text));
  return parsed::json(text);
}

std::vector<std::string> techniques() {
  const Json all = list();
  for (const Json& role : all["roles"]) {
    if (role["name"] == "ambient_occlusion") {
      std::vector<std::string> names = role["techniques"].get<std::vector<std::string>>();
      std::erase(names, "none");
      std::erase(names, "baked");  // looks up what a job has made of a scene: baked_test.cpp
      return names;
    }
  }
  return {};
}

/// A screen-space technique knows what the image shows and nothing else; the reference knows all.
bool sees_only_the_image(const std::string& technique) {
  return technique != "ray_traced";
}

Shape plane(double half_size = 2000.0) {
  return rendering::flat(shapes::quad({0, 0, 0}, {half_size, 0, 0}, {0, 0, -half_size}));
}

Shape ball(const dvec3& center, double radius, int level, bool is_inward = false) {
  Shape shape;
  shape.mesh = shapes::sphere(center, radius, level);
  for (const glm::vec3& position : shape.mesh.positions) {
    const glm::vec3 normal(glm::normalize(dvec3(position) - center));
    shape.normals.push_back(is_inward ? -normal : normal);
  }
  if (is_inward) {
    for (glm::uvec3& triangle : shape.mesh.indices) {
      std::swap(triangle.y, triangle.z);
    }
  }
  return shape;
}

/// What ssao converges to at the point (0, 0, -1) of the unit sphere, seen from (0, 0, eye) along -Z with a square
/// image of this half angle: it counts points around the surface point that the image shows something in front of, in
/// the wide set or the tight one of a quarter of the radius; points behind the eye or beyond the border are open.
double sampled_visibility_in_a_sphere(double eye, double half_angle, double radius) {
  // The limiter: a quarter of the image's height.
  const double most_radius = 0.25 * 2.0 * std::tan(half_angle) * (eye + 1.0);
  const auto occlusion = [&](double wanted, double range) {
    const double r = std::min(wanted, most_radius);
    int closed = 0;
    constexpr int kHeights = 400, kAzimuths = 64, kLengths = 50;
    for (int i = 0; i < kHeights; ++i) {
      for (int j = 0; j < kAzimuths; ++j) {
        for (int k = 0; k < kLengths; ++k) {
          const double z = (i + 0.5) / kHeights;
          const double phi = 2.0 * std::numbers::pi * (j + 0.5) / kAzimuths;
          const double length = r * (0.5 + 0.5 * (k + 0.5) / kLengths);
          const double s = std::sqrt(1.0 - z * z);
          const dvec3 p = dvec3(0, 0, -1) + length * dvec3(s * std::cos(phi), s * std::sin(phi), z);
          const double depth = eye - p.z;
          if (depth <= 0.01) continue;
          const double most = std::max(std::abs(p.x), std::abs(p.y)) / depth;
          if (most > std::tan(half_angle)) continue;
          // The sphere along the line of sight: eye + t d.
          const dvec3 d = glm::normalize(p - dvec3(0, 0, eye));
          const double b = eye * d.z;
          const double t = -b + std::sqrt(b * b + 1.0 - eye * eye);
          const double behind = depth + t * d.z;
          closed += behind > 0.0 && behind <= range * r ? 1 : 0;
        }
      }
    }
    return static_cast<double>(closed) / (kHeights * kAzimuths * kLengths);
  };
  return 1.0 - std::max(occlusion(radius, 1.5), occlusion(0.25 * radius, 3.0));
}

/// A floor, two walls and a ball: corners, contact, a silhouette in front of a wall, and no background.
std::vector<Shape> corner() {
  return {rendering::flat(shapes::quad({0, 0, 0}, {4, 0, 0}, {0, 0, -4})),
          rendering::flat(shapes::quad({0, 2, -2}, {4, 0, 0}, {0, 2, 0})),
          rendering::flat(shapes::quad({-2, 2, 0}, {0, 0, -4}, {0, 2, 0})), ball({0.2, 0.6, -0.8}, 0.6, 5)};
}
const Camera kCornerCamera{{2.0, 1.8, 2.5}, {-0.4, 0.5, -1.0}, 0.9, 0.01, false};

// Least visibility of a convex ball: only the angle between smooth normals and facets, 0.5 degrees here, closes
// anything, 2e-5 of the hemisphere, which one ray of the default 64 may happen to hit.
constexpr float kConvex = 1.0F - 1.0F / 64.0F;

void expect_in_range(const Image& image) {
  for (const float value : image.pixels) {
    ASSERT_TRUE(value >= 0.0F && value <= 1.0F) << value;
  }
}

class HardCases : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(AmbientOcclusion, HardCases, testing::ValuesIn(techniques()),
                         [](const auto& test) { return test.param; });

TEST_P(HardCases, H1AnInfinitePlaneSeenAtAnyAngleIsOpen) {
  for (const double angle : {90.0, 60.0, 30.0, 10.0, 3.0, 1.0}) {
    for (const char* falloff : {"none", "linear"}) {
      Scene scene;
      scene.add(plane());
      const double a = angle * std::numbers::pi / 180.0;
      scene.look({{0, 2.0, 0}, {std::cos(a), 2.0 - std::sin(a), 0.0}, 0.7, 0.01, false});
      Graph graph(GetParam(), kSize, std::string("params.radius = 3\nparams.falloff = \"") + falloff + "\"");
      const Image image = graph.render(scene);
      // Rays that start above a plane never meet it: exactly 1. Horizons lose the square of the elevation that the
      // rounding of depth and normals feigns, and one step of 16 bits.
      EXPECT_GE(image.least(), sees_only_the_image(GetParam()) ? 1.0F - 2e-3F : 1.0F) << angle << " " << falloff;
      expect_in_range(image);
    }
  }
}

TEST_P(HardCases, H2InsideAClosedSphereSmallerThanTheRadiusEverythingIsClosed) {
  Scene scene;
  scene.add(ball({0, 0, 0}, 1.0, 6, true));
  const double half_angle = 1.2;  // near the wall, and wide: the image shows almost all of the sphere
  const double eye = 0.9;
  scene.look({{0, 0, eye}, {0, 0, 0}, 2.0 * half_angle, 0.01, false});
  Graph graph(GetParam(), kSize, "params.radius = 4");
  const Image image = graph.render(scene);
  expect_in_range(image);
  if (!sees_only_the_image(GetParam())) {
    EXPECT_EQ(image.greatest(), 0.0F);
    return;
  }
  if (GetParam() == "ssao") {
    // 16 points, 4 of them tight, over a tile of 16 pixels: a standard deviation of sqrt(0.25 / 64) at most.
    EXPECT_NEAR(image.at(kSize / 2, kSize / 2), sampled_visibility_in_a_sphere(eye, half_angle, 4.0), 0.06);
    return;
  }
  // The middle of the image is (0, 0, -1). The border of the image shows the sphere's points of this polar angle around
  // it, whose elevation seen from there is half of the angle: what the image shows closes everything below it. Corners
  // show more, so the truth for this image lies between the two.
  const auto open_above = [&](double tangent) {
    // Eye + s (sin, -cos) meets the unit sphere.
    const double angle = std::atan(tangent);
    const double b = eye * std::cos(angle);
    const double s = b + std::sqrt(b * b + 1.0 - eye * eye);
    const double polar = std::atan2(s * std::sin(angle), s * std::cos(angle) - eye);
    const double elevation = polar / 2.0;
    return std::cos(elevation) * std::cos(elevation);
  };
  const double most = open_above(std::tan(half_angle));
  const double least = open_above(std::tan(half_angle) * std::sqrt(2.0));
  // The last step of a side ends up to one step before the border: 0.05.
  EXPECT_LT(image.at(kSize / 2, kSize / 2), most + 0.05);
  EXPECT_GT(image.at(kSize / 2, kSize / 2), least - 0.01);
}

TEST_P(HardCases, H3APixelWithoutSurfaceIsOpenAndDoesNotDarkenItsNeighbours) {
  Scene scene;
  scene.add(ball({0, 0, -4}, 1.0, 6));
  scene.look({{0, 0, 0}, {0, 0, -1}, 0.9, 0.01, false});
  Graph graph(GetParam(), kSize, "params.radius = 1");
  graph.keep("gbuffer.depth");
  const Image image = graph.render(scene, "ao.visibility");
  const Image depth = graph.read("gbuffer.depth");
  int background = 0;
  double closed = 0.0;
  for (std::uint32_t y = 0; y < kSize; ++y) {
    for (std::uint32_t x = 0; x < kSize; ++x) {
      if (std::isinf(depth.at(x, y))) {
        ++background;
        EXPECT_EQ(image.at(x, y), 1.0F) << x << " " << y;
      } else {
        EXPECT_GE(image.at(x, y), kConvex) << x << " " << y;
        closed += 1.0 - static_cast<double>(image.at(x, y));
      }
    }
  }
  EXPECT_LT(closed / (kSize * kSize - background), 1e-3);
  EXPECT_GT(background, 1000);
  EXPECT_LT(background, static_cast<int>(kSize * kSize) - 1000);
}

TEST_P(HardCases, H3AnEdgeInFrontOfAFarWallLeavesTheWallOpen) {
  // The ball is ten radii in front of the wall: neither a halo on the wall nor a dark rim on the ball.
  Scene scene;
  scene.add(ball({0, 0, -4}, 1.0, 6));
  scene.add(rendering::flat(shapes::quad({0, 0, -15}, {30, 0, 0}, {0, 30, 0})));
  scene.look({{0, 0, 0}, {0, 0, -1}, 0.9, 0.01, false});
  Graph graph(GetParam(), kSize, "params.radius = 1");
  EXPECT_GE(graph.render(scene).least(), kConvex);
}

TEST_P(HardCases, H4ASurfaceFarAwayAndOneAtTheNearPlaneGiveValuesInRange) {
  for (const double distance : {0.0101, 0.02, 1.0, 1000.0, 20000.0}) {
    for (const double radius : {1e-3, 0.5, 100.0}) {
      Scene scene;
      scene.add(rendering::flat(shapes::quad({0, 0, -distance}, {3 * distance, 0, 0}, {0, 3 * distance, 0})));
      scene.look({{0, 0, 0}, {0, 0, -1}, 0.9, 0.01, false});
      Graph graph(GetParam(), kSize, "params.radius = " + std::to_string(radius));
      const Image image = graph.render(scene);
      expect_in_range(image);
      EXPECT_GE(image.least(), sees_only_the_image(GetParam()) ? 1.0F - 2e-3F : 1.0F) << distance << " " << radius;
    }
  }
  // Both at once, and a corner at each.
  Scene scene;
  for (const Shape& shape : corner()) {
    scene.add(shape, 0.01);
    scene.add(shape, 1000.0);
  }
  scene.look({{0.02, 0.018, 0.025}, {-0.004, 0.005, -0.01}, 0.9, 0.01, false});
  Graph graph(GetParam(), kSize, "params.radius = 0.5");
  expect_in_range(graph.render(scene));
}

TEST_P(HardCases, H5TheSceneScaledWithRadiusAndCameraGivesTheSameImage) {
  for (const char* falloff : {"none", "linear"}) {
    std::vector<Image> images;
    for (const double unit : {1.0, 1e-3, 1e3}) {
      Scene scene;
      for (const Shape& shape : corner()) {
        scene.add(shape, unit);
      }
      scene.look(kCornerCamera, unit);
      Graph graph(GetParam(), kSize,
                  "params.radius = " + std::to_string(0.7 * unit) + "\nparams.falloff = \"" + falloff + "\"");
      images.push_back(graph.render(scene));
    }
    for (std::size_t i = 1; i < images.size(); ++i) {
      // Rounding moves single samples across an edge or the radius: 1 in 64 rays, or one horizon of the tile.
      EXPECT_LT(rendering::rmse(images[0], images[i]), 2e-3) << falloff << " " << i;
      EXPECT_LT(rendering::greatest_difference(images[0], images[i]), 0.1) << falloff << " " << i;
    }
  }
}

TEST_P(HardCases, TheSceneMovedByAHundredKilometresGivesTheSameImage) {
  std::vector<Image> images;
  for (const dvec3& offset : {dvec3(0, 0, 0), dvec3(1e5, -3e4, 8e4)}) {
    Scene scene;
    for (const Shape& shape : corner()) {
      scene.add(shape, 1.0, offset);
    }
    scene.look(kCornerCamera, 1.0, offset);
    Graph graph(GetParam(), kSize, "params.radius = 0.7");
    images.push_back(graph.render(scene));
  }
  EXPECT_LT(rendering::rmse(images[0], images[1]), 2e-3);
  EXPECT_LT(rendering::greatest_difference(images[0], images[1]), 0.1);
}

TEST_P(HardCases, TheSameInputTwiceGivesTheSameBytes) {
  Scene scene;
  for (const Shape& shape : corner()) {
    scene.add(shape);
  }
  scene.look(kCornerCamera);
  Graph first(GetParam(), kSize, "params.radius = 0.7");
  const Image once = first.render(scene);
  EXPECT_EQ(once.pixels, first.render(scene).pixels);
  Graph second(GetParam(), kSize, "params.radius = 0.7");
  EXPECT_EQ(once.pixels, second.render(scene).pixels);
}

TEST_P(HardCases, AnOrthographicViewAgreesWithTheReference) {
  Scene scene;
  for (const Shape& shape : corner()) {
    scene.add(shape);
  }
  Camera camera = kCornerCamera;
  camera.is_orthographic = true;
  camera.vertical_angle = 1.6;
  scene.look(camera);
  Graph reference("ray_traced", kSize, "params.radius = 0.7\nparams.samples = 256");
  Graph graph(GetParam(), kSize, "params.radius = 0.7");
  EXPECT_LT(rendering::rmse(graph.render(scene), reference.render(scene)), 0.08);
}

TEST_P(HardCases, NobodyWhoReadsItCostsNothing) {
  Scene scene;
  scene.add(plane());
  scene.look({{0, 2, 0}, {1, 1, 0}, 0.7, 0.01, false});
  Graph graph(GetParam(), kSize, "", "gbuffer.depth");
  static_cast<void>(graph.render(scene));
  const Json stats = parsed::json(graph.stats());
  for (const Json& library : stats["libraries"]) {
    EXPECT_EQ(library.get<std::string>().find("ambient_occlusion"), std::string::npos) << library;
  }
}

TEST_P(HardCases, TheTableOfParametersInItsReadmeIsTheDescriptors) {
  const std::string id = "ambient_occlusion/" + GetParam();
  const std::string table = rendering::parameter_table(list(), id);
  EXPECT_NE(table, "");
  EXPECT_NE(rendering::readme_of(id).find(table), std::string::npos) << "the README should have\n" << table;
}

TEST(AmbientOcclusion, GtaoApproachesTheReferenceAsItsKnobsRise) {
  Scene scene;
  for (const Shape& shape : corner()) {
    scene.add(shape);
  }
  scene.look(kCornerCamera);
  for (const char* falloff : {"none", "linear"}) {
    const std::string params = std::string("params.radius = 0.7\nparams.falloff = \"") + falloff + "\"\n";
    Graph reference("ray_traced", kSize, params + "params.samples = 1024");
    const Image truth = reference.render(scene);
    double last = 1.0;
    std::vector<double> errors;
    for (const auto& [directions, steps] : {std::pair{1, 2}, {2, 4}, {4, 8}, {8, 16}, {16, 64}}) {
      Graph graph(
          "gtao", kSize,
          params + "params.directions = " + std::to_string(directions) + "\nparams.steps = " + std::to_string(steps));
      const double error = rendering::rmse(graph.render(scene), truth);
      std::printf("  falloff %-6s directions %2d steps %2d: RMSE %.4f\n", falloff, directions, steps, error);
      // Monotone but for the noise floor of what the image does not show.
      EXPECT_LT(error, last * 1.02) << falloff << " " << directions << " " << steps;
      last = error;
      errors.push_back(error);
    }
    EXPECT_LT(errors.back(), 0.6 * errors.front());
  }
}

TEST(AmbientOcclusion, SsaoApproachesItsLimitAndTheReferenceAsItsKnobsRise) {
  Scene scene;
  for (const Shape& shape : corner()) {
    scene.add(shape);
  }
  scene.look(kCornerCamera);
  for (const char* falloff : {"none", "linear"}) {
    const std::string params = std::string("params.radius = 0.7\nparams.falloff = \"") + falloff + "\"\n";
    Graph reference("ray_traced", kSize, params + "params.samples = 1024");
    const Image truth = reference.render(scene);
    Graph unbounded("ssao", kSize,
                    params +
                        "params.points = 4096\nparams.randomize = \"rotate\"\nparams.tile = 1\n"
                        "params.blur_passes = 0");
    const Image limit = unbounded.render(scene);
    std::printf("  falloff %-6s limit: RMSE %.4f to the reference\n", falloff, rendering::rmse(limit, truth));
    double last = 1.0;
    for (const int points : {8, 16, 32, 64, 128}) {
      // Without the blur, whose own error has nothing to do with their number.
      Graph graph("ssao", kSize, params + "params.blur_passes = 0\nparams.points = " + std::to_string(points));
      const Image noisy = graph.render(scene);
      graph.set("ao.params.blur_passes=1");
      const Image image = graph.render(scene);
      const double error = rendering::rmse(noisy, limit);
      std::printf("  falloff %-6s points %3d: RMSE %.4f to the limit without blur; %.4f to the reference with it\n",
                  falloff, points, error, rendering::rmse(image, truth));
      EXPECT_LT(error, 0.85 * last) << falloff << " " << points;
      last = error;
    }
    for (const char* knob : {"depth_divisor", "evaluate_divisor"}) {
      last = 1.0;
      for (const int divisor : {4, 2, 1}) {
        Graph graph("ssao", kSize, params + "params." + knob + " = " + std::to_string(divisor));
        const double error = rendering::rmse(graph.render(scene), truth);
        std::printf("  falloff %-6s %-16s %d: RMSE %.4f to the reference\n", falloff, knob, divisor, error);
        EXPECT_LT(error, last) << falloff << " " << knob << " " << divisor;
        last = error;
      }
    }
  }
}

TEST(AmbientOcclusion, TheReferenceItselfConvergesWithItsSamples) {
  Scene scene;
  for (const Shape& shape : corner()) {
    scene.add(shape);
  }
  scene.look(kCornerCamera);
  Graph reference("ray_traced", kSize, "params.radius = 0.7\nparams.samples = 1024");
  const Image truth = reference.render(scene, nullptr, 1);
  double last = 1.0;
  for (const int samples : {1, 4, 16, 64, 256}) {
    Graph graph("ray_traced", kSize, "params.radius = 0.7\nparams.samples = " + std::to_string(samples));
    const double error = rendering::rmse(graph.render(scene, nullptr, 2), truth);
    std::printf("  samples %4d: RMSE %.5f\n", samples, error);
    // Independent samples would halve it from rung to rung.
    EXPECT_LT(error, 0.5 * last) << samples;
    last = error;
  }
}

}  // namespace
