// SPDX-License-Identifier: Apache-2.0
// What ambient_occlusion/ssao makes of scenes: closed forms, the errors of each of its shortcuts, and the failures of
// the rivals that its defaults avoid. On the default device, through the C API.
#include "corner.hpp"
#include "parsed.hpp"
#include "rendering.hpp"

#include <nlohmann/json.hpp>

#include <array>
#include <numeric>

namespace {

using glm::dvec2;
using glm::dvec3;
using rendering::Camera;
using rendering::Graph;
using rendering::Image;
using rendering::Scene;
using rendering::Shape;

constexpr std::uint32_t kSize = 96;

std::string params(const std::string& list) {  // "radius = 1; points = 8" -> lines
  std::string text;
  std::size_t at = 0;
  while (at < list.size()) {
    const std::size_t end = std::min(list.find("; ", at), list.size());
    text += "params." + list.substr(at, end - at) + "\n";
    at = end + 2;
  }
  return text;
}

Image render(const Scene& scene, const std::string& list, std::uint32_t size = kSize) {
  Graph graph("ssao", size, params(list));
  return graph.render(scene);
}

double mean(const Image& image) {
  return std::accumulate(image.pixels.begin(), image.pixels.end(), 0.0) / static_cast<double>(image.pixels.size());
}

/// Of the pixels at least `margin` away from the border, beyond which reduced depths are those of the last texel.
double inner_mean(const Image& image, std::uint32_t margin) {
  double sum = 0.0;
  for (std::uint32_t y = margin; y < kSize - margin; ++y) {
    for (std::uint32_t x = margin; x < kSize - margin; ++x) sum += static_cast<double>(image.at(x, y));
  }
  return sum / std::pow(kSize - 2.0 * margin, 2.0);
}

/// The limit that the estimator converges to: many samples, the depth as it is, no blur, no limiter.
const std::string kLimit =
    "points = 4096; randomize = \"rotate\"; tile = 1; tight_share = 0; blur_passes = 0; limiter = \"none\"";
/// The published method with nothing of ours: no tangent plane, depth reduced to a quarter.
const std::string kPublished = "above_plane = false; depth_divisor = 4; limiter = \"none\"; tight_share = 0";

Shape box(const dvec3& low, const dvec3& high) {
  shapes::Mesh mesh;
  const dvec3 c = 0.5 * (low + high);
  const dvec3 h = 0.5 * (high - low);
  for (int axis = 0; axis < 3; ++axis) {
    dvec3 u(0), v(0), w(0);
    u[(axis + 1) % 3] = h[(axis + 1) % 3];
    v[(axis + 2) % 3] = h[(axis + 2) % 3];
    w[axis] = h[axis];
    mesh.add(shapes::quad(c + w, u, v));
    mesh.add(shapes::quad(c - w, v, u));
  }
  return rendering::flat(mesh);
}

Shape quad(const dvec3& center, const dvec3& u, const dvec3& v) {
  return rendering::flat(shapes::quad(center, u, v));
}

/// Stairs, crates, a ball, a cornice and a pillar in a corner: details of 5 cm to 2 m.
void add_room(Scene& scene) {
  scene.add(quad({0, 0, 0}, {4, 0, 0}, {0, 0, -4}));
  scene.add(quad({0, 2, -2}, {4, 0, 0}, {0, 2, 0}));
  scene.add(quad({-2, 2, 0}, {0, 0, -4}, {0, 2, 0}));
  for (int i = 0; i < 4; ++i) {
    scene.add(box({-2.0, 0.0, -2.0}, {-2.0 + 0.8 - 0.2 * i, 0.15 * (i + 1), 0.5}));
  }
  scene.add(box({0.3, 0.0, -1.6}, {0.9, 0.6, -1.0}));
  scene.add(box({0.45, 0.6, -1.5}, {0.8, 0.95, -1.15}));
  scene.add(box({-4, 1.6, -2}, {4, 1.65, -1.9}));
  scene.add(box({1.2, 0, -1.7}, {1.3, 1.6, -1.6}));
  Shape ball;
  ball.mesh = shapes::sphere({-0.4, 0.35, -0.6}, 0.35, 5);
  for (const glm::vec3& position : ball.mesh.positions) {
    ball.normals.emplace_back(glm::normalize(dvec3(position) - dvec3(-0.4, 0.35, -0.6)));
  }
  scene.add(ball);
}
const Camera kRoomCamera{{1.6, 1.7, 2.2}, {-0.1, 0.6, -1.0}, 0.9, 0.01, false};

/// Where the line of sight through a pixel's centre meets the plane y = 0.
dvec3 on_floor(const Camera& camera, double x, double y, std::uint32_t size) {
  const dvec3 z = -glm::normalize(camera.target - camera.position);
  const dvec3 right = glm::normalize(glm::cross(dvec3(0, 1, 0), z));
  const dvec3 up = glm::cross(z, right);
  const double t = std::tan(camera.vertical_angle / 2.0);
  const dvec3 d = -z + right * (t * ((x + 0.5) * 2.0 / size - 1.0)) - up * (t * ((y + 0.5) * 2.0 / size - 1.0));
  return camera.position - d * (camera.position.y / d.y);
}

TEST(SsaoImage, ACornerSeenFromAnywhereIsTheClosedForm) {
  for (const dvec3& eye : {dvec3(2.5, 2.0, 0.0), dvec3(1.0, 3.0, 1.5), dvec3(3.0, 1.0, -1.0)}) {
    Scene scene;
    scene.add(quad({10, 0, 0}, {10, 0, 0}, {0, 0, -20}));
    scene.add(quad({0, 10, 0}, {0, 0, -20}, {0, 10, 0}));
    const Camera camera{eye, {0.4, 0.0, 0.0}, 1.4, 0.01, false};
    scene.look(camera);
    const Image image = render(scene, "radius = 1; falloff = \"none\"; range = 1000; " + kLimit);
    std::array<double, 12> sum{};
    std::array<int, 12> count{};
    for (std::uint32_t y = 0; y < kSize; ++y) {
      for (std::uint32_t x = 0; x < kSize; ++x) {
        const dvec3 p = on_floor(camera, x, y, kSize);
        const double k = p.x;
        // Samples must stay in the picture.
        const bool is_inside = x > 30 && y > 30 && x < kSize - 30 && y < kSize - 30;
        if (!is_inside || k <= 0.02 || k >= 0.98) continue;
        const auto bin = static_cast<std::size_t>(k * 12.0);
        sum[bin] += 1.0 - static_cast<double>(image.at(x, y)) - corner::occlusion(k);
        ++count[bin];
      }
    }
    int bins = 0;
    for (std::size_t i = 0; i < 12; ++i) {
      if (count[i] < 8) continue;
      ++bins;
      EXPECT_NEAR(sum[i] / count[i], 0.0, 0.005) << "k " << (static_cast<double>(i) + 0.5) / 12.0;
    }
    EXPECT_GE(bins, 9);
  }
}

void add_tilted_plane(Scene& scene, double distance, double degrees) {
  const double a = degrees * std::numbers::pi / 180.0;
  scene.add(quad({0, 0, -distance}, {2000, 0, 0}, {0, 2000 * std::cos(a), -2000 * std::sin(a)}));
}

TEST(SsaoImage, PlanesAreOpenAndGreyWithoutWhatKeepsSamplesOutOfTheSurface) {
  for (const double distance : {1.0, 5.0, 30.0}) {
    for (const double tilt : {0.0, 45.0, 60.0, 75.0}) {
      Scene scene;
      add_tilted_plane(scene, distance, tilt);
      scene.look({{0, 0, 0}, {0, 0, -1}, 0.5, 0.01, false});
      EXPECT_GE(render(scene, "radius = 0.5").least(), 1.0F) << distance << " " << tilt;
      EXPECT_GE(render(scene, "radius = 0.5; depth_divisor = 4").least(), 1.0F) << distance << " " << tilt;
    }
  }
  Scene scene;
  add_tilted_plane(scene, 5.0, 0.0);
  scene.look({{0, 0, 0}, {0, 0, -1}, 0.5, 0.01, false});
  const std::string all = "; points = 64; radius = 0.5; falloff = \"none\"; range = 1000";
  EXPECT_NEAR(mean(render(scene, "hemisphere = \"none\"; above_plane = false" + all)), 0.5, 0.02);
  EXPECT_EQ(mean(render(scene, "hemisphere = \"flip\"; above_plane = false" + all)), 1.0);
  EXPECT_EQ(mean(render(scene, "hemisphere = \"basis\"; above_plane = false" + all)), 1.0);
}

// Mean occlusion that the published method feigns on a plane, right 0: pixels of 1080 lines over 60 degrees, radius 0.5
// m, up to 0.1 m full, from 0.6 m none, tilted by 75 degrees. Which filter of the reduced depth is how wrong, and that
// the tangent plane rights them all.
TEST(SsaoImage, FiltersOfTheReducedDepthFeignOcclusionOnSlopesAndTheTangentPlaneRightsIt) {
  struct Row {
    const char* name;
    const char* list;
    std::array<double, 4> feigned;  // float32 at 10 m, 100 m; float16 at 10 m, 100 m
  };
  // What a Monte Carlo model on the CPU gave for the same plane; orders of magnitude, so a factor of 1.5.
  const std::array<Row, 4> rows{{
      {"whole, nearest", "depth_divisor = 1", {0.0034, 0.034, 0.0029, 0.030}},
      {"point, nearest", "depth_divisor = 4", {0.0061, 0.064, 0.0058, 0.059}},
      {"mean, nearest", "depth_divisor = 4; depth_filter = \"mean\"", {0.0124, 0.086, 0.0145, 0.085}},
      {"max, nearest", "depth_divisor = 4; depth_filter = \"max\"", {0.0006, 0.008, 0.0010, 0.008}},
  }};
  // Bilinear fetches of means follow a slope exactly; what is left is float16. The model gave 0 0 0.0002 0.003.
  const std::string bilinear = "depth_divisor = 4; depth_filter = \"mean\"; depth_fetch = \"bilinear\"";
  const std::array<double, 4> most_bilinear{0.0005, 0.0005, 0.0005, 0.0045};
  std::array<double, 4> measured_bilinear{};
  std::array<std::array<double, 4>, 4> measured{};
  std::size_t column = 0;
  for (const char* format : {"float32", "float16"}) {
    for (const double distance : {10.0, 100.0}) {
      {
        Scene scene;
        add_tilted_plane(scene, distance, -75.0);
        const double angle = 2.0 * std::atan(std::tan(std::numbers::pi / 6.0) * kSize / 1080.0);
        scene.look({{0, 0, 0}, {0, 0, -1}, angle, 0.01, false});
        const std::string common = std::string(
                                       "radius = 0.5; falloff = \"power\"; range = 1.2; points = 64; tile = 64; "
                                       "blur_passes = 0; limiter = \"none\"; tight_share = 0; depth_format = \"") +
                                   format + "\"; ";
        measured_bilinear[column] = 1.0 - inner_mean(render(scene, common + bilinear + "; above_plane = false"), 16);
        for (std::size_t i = 0; i < rows.size(); ++i) {
          const std::string list = common + rows[i].list;
          measured[i][column] = 1.0 - inner_mean(render(scene, list + "; above_plane = false"), 16);
          if (column < 2) {
            EXPECT_EQ(mean(render(scene, list)), 1.0) << rows[i].name << " " << distance;
          }
        }
      }
      ++column;
    }
  }
  for (std::size_t c = 0; c < 4; ++c) EXPECT_LE(measured_bilinear[c], most_bilinear[c]) << c;
  std::printf("  %-15s float32 %.4f %.4f  float16 %.4f %.4f\n", "mean, bilinear", measured_bilinear[0],
              measured_bilinear[1], measured_bilinear[2], measured_bilinear[3]);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto& m = measured[i];
    std::printf("  %-15s float32 %.4f %.4f  float16 %.4f %.4f\n", rows[i].name, m[0], m[1], m[2], m[3]);
    for (std::size_t c = 0; c < 4; ++c)
      EXPECT_NEAR(std::log(m[c] / rows[i].feigned[c]), 0.0, std::log(1.5)) << rows[i].name << c;
  }
}

// ---- edges ----

/// A pillar 5 m away in front of a wall at 7 m: a gap of four radii.
void add_pillar_before_a_wall(Scene& scene) {
  scene.add(quad({0, 0, -7}, {40, 0, 0}, {0, 40, 0}));
  scene.add(box({-0.155, -40, -5.2}, {0.1, 40, -5.0}));
  scene.look({{0, 0, 0}, {0, 0, -1}, 0.6, 0.01, false});
}

TEST(SsaoImage, APillarFarInFrontOfAWallLeavesTheWallOpenUnlessDepthsAreAveraged) {
  Scene scene;
  add_pillar_before_a_wall(scene);
  const std::string common = "radius = 0.5; ";
  EXPECT_GE(render(scene, common + "points = 32").least(), 0.995F);
  for (const char* filter : {"point", "max", "median"}) {
    EXPECT_GE(render(scene, common + kPublished + "; depth_filter = \"" + filter + "\"").least(), 0.995F) << filter;
  }
  // Mixtures of 5 m and 7 m lie in front of the wall, some of them within the range: a halo.
  EXPECT_LT(render(scene, common + kPublished + "; depth_filter = \"mean\"; blur_passes = 0").least(), 0.9F);
}

TEST(SsaoImage, ACreaseBehindASilhouetteDoesNotBleedIntoTheForeground) {
  // A board 3 m in front of the crease of a floor and a wall; then the same without the wall.
  const auto foreground = [](bool has_crease, const std::string& blur) {
    Scene scene;
    scene.add(quad({0, -0.5, -20}, {40, 0, 0}, {0, 0, -20}));
    if (has_crease) scene.add(quad({0, 20, -6}, {40, 0, 0}, {0, 20.5, 0}));
    scene.add(quad({-0.8, 0, -3}, {0.8, 0, 0}, {0, 0.3, 0}));
    scene.look({{0, 0, 0}, {0, -0.1, -1}, 0.6, 0.01, false});
    return render(scene, "radius = 0.5; " + blur);
  };
  const auto bleeding = [&](const std::string& blur) {
    const Image with = foreground(true, blur);
    const Image without = foreground(false, blur);
    double most = 0.0;
    // The board fills the left of the image's middle rows; its border is where the crease is beside it.
    Scene board;
    board.add(quad({-0.8, 0, -3}, {0.8, 0, 0}, {0, 0.3, 0}));
    board.look({{0, 0, 0}, {0, -0.1, -1}, 0.6, 0.01, false});
    Graph graph("ssao", kSize, "");
    graph.keep("gbuffer.depth");
    static_cast<void>(graph.render(board));
    const Image depth = graph.read("gbuffer.depth");
    for (std::size_t i = 0; i < depth.pixels.size(); ++i) {
      if (std::isinf(depth.pixels[i])) continue;
      most = std::max(most, std::abs(static_cast<double>(with.pixels[i]) - static_cast<double>(without.pixels[i])));
    }
    return most;
  };
  for (const char* edges : {"plane", "depth"}) {
    EXPECT_LT(bleeding(std::string("blur_passes = 2; blur_edges = \"") + edges + "\""), 0.01) << edges;
  }
  EXPECT_LT(bleeding("blur_passes = 2; blur = \"square\""), 0.01);
  EXPECT_GT(bleeding("blur_passes = 2; blur = \"plain\""), 0.02) << "a plain Gaussian bleeds";
}

TEST(SsaoImage, OnlyThePlanesDistanceBlursSteepSlopes) {
  // A floor seen at 2 degrees: depths of neighbours differ by more than any tolerance in depth.
  Scene scene;
  add_tilted_plane(scene, 40.0, 88.0);
  scene.look({{0, 0, 0}, {0, 0, -1}, 0.5, 0.01, false});
  // The noise of samples that are let into the surface is there to be blurred.
  const std::string noisy =
      "radius = 4; hemisphere = \"none\"; above_plane = false; falloff = \"none\"; range = 1000; points = 8; ";
  const auto roughness = [](const Image& image) {  // of neighbours in a column
    double sum = 0.0;
    for (std::uint32_t y = 60; y + 8 < kSize; ++y) {
      for (std::uint32_t x = 0; x < kSize; ++x) {
        const double d = static_cast<double>(image.at(x, y)) - static_cast<double>(image.at(x, y + 1));
        sum += d * d;
      }
    }
    return std::sqrt(sum);
  };
  const double before = roughness(render(scene, noisy + "blur_passes = 0"));
  EXPECT_LT(roughness(render(scene, noisy + "blur_passes = 2; blur_edges = \"plane\"")), 0.15 * before);
  EXPECT_GT(roughness(render(scene, noisy + "blur_passes = 2; blur_edges = \"depth\"; blur_distance = 0")),
            0.3 * before);
}

TEST(SsaoImage, BeyondTheBorderNothingOccludesAndNothingStreaks) {
  // A wall beside the image's left border occludes the floor; a wider view knows it, this one does not.
  const auto view = [](double angle, std::uint32_t size, const std::string& list) {
    Scene scene;
    scene.add(quad({0, 0, -10}, {20, 0, 0}, {0, 0, -20}));
    scene.add(quad({-0.8, 5, -10}, {0, 0, -20}, {0, 5, 0}));
    scene.look({{0, 1, 0}, {0, 0.4, -1.2}, angle, 0.01, false});
    return render(scene, list, size);
  };
  const std::string list =
      "radius = 0.5; falloff = \"power\"; range = 1.2; points = 256; tile = 1; blur_passes = 0; limiter = \"none\"";
  const double angle = 0.9;
  const Image narrow = view(angle, 96, list);
  const Image wide = view(2.0 * std::atan(2.0 * std::tan(angle / 2.0)), 192, list);
  const Image clamped = view(angle, 96, list + "; border = \"clamp\"");
  double darkest = 0.0;
  double streak = 0.0;
  double guard = 0.0;
  for (std::uint32_t y = 0; y < 96; ++y) {
    for (std::uint32_t x = 0; x < 96; ++x) {
      const double truth = static_cast<double>(wide.at(x + 48, y + 48));
      const double d = static_cast<double>(narrow.at(x, y)) - truth;
      darkest = std::min(darkest, d);
      guard = std::max(guard, d);
      streak = std::min(streak, static_cast<double>(clamped.at(x, y)) - truth);
    }
  }
  std::printf(
      "  at the border: never darker than the wider view by more than %.3f, lighter by up to %.3f; clamped: darker "
      "by up to %.3f\n",
      -darkest, guard, -streak);
  EXPECT_GE(darkest, -0.02);
  EXPECT_GT(guard, 0.05) << "what is lost";
  EXPECT_LT(streak, -0.05) << "what the border's depth feigns";
}

// ---- footprint ----

TEST(SsaoImage, ItsRadiusIsAPlaceInTheSceneNotOnTheScreen) {
  // The same crease from 3 m and from 6 m, seen through half the angle, so that pixels match.
  const auto crease = [](double distance, const std::string& list) {
    Scene scene;
    scene.add(quad({5, 0, 0}, {5, 0, 0}, {0, 0, -10}));
    scene.add(quad({0, 5, 0}, {0, 0, -10}, {0, 5, 0}));
    const dvec3 direction = glm::normalize(dvec3(1.0, 1.2, 0.0));
    scene.look({dvec3(0.5, 0.2, 0.0) + distance * direction, {0.5, 0.2, 0.0}, 0.7, 0.01, false});
    return render(scene, list);
  };
  const std::string list = "radius = 1; points = 256; tile = 4; footprint = 10";
  const Image near = crease(3.0, list);
  const Image far = crease(6.0, list);
  double sum = 0.0;
  for (std::uint32_t y = 24; y < 72; ++y) {
    for (std::uint32_t x = 24; x < 72; ++x) {
      // Twice as far: half the offset from the middle; means of two pixels because the middle is between pixels.
      const double a = 0.5 * (static_cast<double>(near.at(x, y)) + static_cast<double>(near.at(x ^ 1U, y)));
      const double b = static_cast<double>(far.at((x + 48) / 2, (y + 48) / 2));
      sum += a - b;
    }
  }
  EXPECT_NEAR(sum / (48 * 48), 0.0, 0.03);
  // With the limiter active a close-up loses its radius.
  EXPECT_GT(mean(crease(1.5, "radius = 1; points = 64; footprint = 0.02")),
            mean(crease(1.5, "radius = 1; points = 64; footprint = 10")) + 0.02);
}

TEST(SsaoImage, AWallAtTheEyeIsOpenThoughSamplesLieBehindTheEye) {
  for (const char* limiter : {"none", "radius", "samples"}) {
    Scene scene;
    add_tilted_plane(scene, 0.1, 30.0);
    scene.look({{0, 0, 0}, {0, 0, -1}, 0.9, 0.01, false});
    const Image image = render(scene, std::string("radius = 2; limiter = \"") + limiter + "\"");
    EXPECT_EQ(image.least(), 1.0F) << limiter;
  }
}

// ---- two sets, noise, the whole ----

TEST(SsaoImage, TheDarkerSetWinsAndCreasesGainContrast) {
  Scene scene;
  add_room(scene);
  scene.look(kRoomCamera);
  constexpr std::uint32_t kFine = 192;
  // The same offsets for each set, whether alone or not: seeds of the sets differ by the number of tight offsets.
  const std::string curve =
      "radius = 1; falloff = \"power\"; range = 1.2; tight_range = 1.2; tile = 1; blur_passes = 0; ";
  const std::string common = curve + "points = 64; ";
  const Image both = render(scene, common + "tight_share = 0.25; combine = \"after_blur\"", kFine);
  const Image early = render(scene, common + "tight_share = 0.25; combine = \"before_blur\"", kFine);
  EXPECT_LT(rendering::greatest_difference(both, early), 1e-4) << "without a blur there is no before and after";
  const Image wide = render(scene, curve + "points = 48; tight_share = 0; seed = 16", kFine);
  for (std::size_t i = 0; i < both.pixels.size(); ++i) {
    ASSERT_LE(both.pixels[i], wide.pixels[i] + 1.0F / 255.0F) << i;
  }
  // Creases: within 4 cm of where floor and wall meet. Contrast: how much darker than half a metre away.
  const auto contrast = [&](const Image& image) {
    double crease = 0.0, open = 0.0;
    int crease_count = 0, open_count = 0;
    for (std::uint32_t y = 0; y < kFine; ++y) {
      for (std::uint32_t x = 0; x < kFine; ++x) {
        const dvec3 p = on_floor(kRoomCamera, x, y, kFine);
        if (p.z < -2.0 || p.x < 1.4 || p.x > 3.5) continue;
        if (p.z < -1.9) {
          crease += static_cast<double>(image.at(x, y));
          ++crease_count;
        } else if (p.z > -1.7 && p.z < -1.5) {
          open += static_cast<double>(image.at(x, y));
          ++open_count;
        }
      }
    }
    EXPECT_GT(crease_count, 8);
    return open / open_count - crease / crease_count;
  };
  std::printf("  contrast of creases: both sets %.3f, wide set alone %.3f\n", contrast(both), contrast(wide));
  EXPECT_GT(contrast(both), 1.5 * contrast(wide));
}

TEST(SsaoImage, TheBlurBringsItNearerToItsLimit) {
  Scene scene;
  add_room(scene);
  scene.look(kRoomCamera);
  const std::string common = "radius = 0.5; tight_share = 0; limiter = \"none\"; points = 16; blur_passes = ";
  const Image limit = render(scene, "radius = 0.5; " + kLimit);
  std::array<double, 5> errors{};
  for (int passes = 0; passes < 5; ++passes) {
    errors[static_cast<std::size_t>(passes)] = rendering::rmse(render(scene, common + std::to_string(passes)), limit);
    std::printf("  blur passes %d: RMSE to the limit %.4f\n", passes, errors[static_cast<std::size_t>(passes)]);
  }
  EXPECT_LT(errors[1], 0.7 * errors[0]) << "less noise";
  EXPECT_LT(errors[2], errors[0]);
  EXPECT_GT(errors[4], errors[1]) << "less detail";
}

TEST(SsaoImage, ItsGrainHardlySwimsWhileTheCameraPans) {
  // The pattern is fixed to the screen, so what the blur leaves of it moves over the surfaces. An orthographic camera
  // shifts the image by fractions of a pixel and does not change what it shows.
  constexpr int kFrames = 64;
  constexpr double kHalfHeight = 1.2;
  constexpr double kPixel = 2.0 * kHalfHeight / kSize;
  const auto swim = [&](const std::string& list) {
    Scene scene;
    add_room(scene);
    const dvec3 eye(1.6, 1.7, 2.2);
    const dvec3 z = glm::normalize(eye - dvec3(-0.1, 0.6, -1.0));
    const dvec3 right = glm::normalize(glm::cross(dvec3(0, 1, 0), z));
    const dvec3 up = glm::cross(z, right);
    std::vector<double> sum(kSize * kSize), squares(kSize * kSize);
    Image first_depth;
    Graph graph("ssao", kSize, params("radius = 0.5; " + list));
    graph.keep("gbuffer.depth");
    for (int frame = 0; frame < kFrames; ++frame) {
      const dvec2 shift(0.37 * frame, 0.21 * frame);  // pixels, to the right and up
      const dvec3 position = eye + (right * shift.x + up * shift.y) * kPixel;
      scene.look({position, position - z, kHalfHeight, 0.01, true});
      const Image image = graph.render(scene, "ao.visibility");
      if (frame == 0) first_depth = graph.read("gbuffer.depth");
      for (std::uint32_t y = 0; y < kSize; ++y) {
        for (std::uint32_t x = 0; x < kSize; ++x) {
          // The place that was at (x, y) in the first frame, between four pixels.
          const double px = std::clamp(x - shift.x, 0.0, kSize - 1.001);
          const double py = std::clamp(y + shift.y, 0.0, kSize - 1.001);
          const auto ix = static_cast<std::uint32_t>(px);
          const auto iy = static_cast<std::uint32_t>(py);
          const double tx = px - ix;
          const double ty = py - iy;
          const auto at = [&](std::uint32_t i, std::uint32_t j) { return static_cast<double>(image.at(i, j)); };
          const double value = (1 - ty) * ((1 - tx) * at(ix, iy) + tx * at(ix + 1, iy)) +
                               ty * ((1 - tx) * at(ix, iy + 1) + tx * at(ix + 1, iy + 1));
          sum[y * kSize + x] += value / kFrames;
          squares[y * kSize + x] += value * value / kFrames;
        }
      }
    }
    // On floor, walls and the tops of boxes, a few pixels away from silhouettes, and in the picture all the time.
    double variance = 0.0;
    int count = 0;
    for (std::uint32_t y = 4; y + 28 < kSize; ++y) {
      for (std::uint32_t x = 28; x + 4 < kSize; ++x) {
        bool is_even = true;
        for (std::uint32_t j = y - 3; j <= y + 3; ++j) {
          for (std::uint32_t i = x - 3; i <= x + 3; ++i) {
            is_even = is_even && std::abs(first_depth.at(i, j) - first_depth.at(x, y)) < 0.15F;
          }
        }
        if (!is_even) continue;
        variance += std::max(0.0, squares[y * kSize + x] - sum[y * kSize + x] * sum[y * kSize + x]);
        ++count;
      }
    }
    EXPECT_GT(count, 500);
    return std::sqrt(variance / count);
  };
  const double noisy = swim("blur_passes = 0");
  const double blurred = swim("blur_passes = 1");
  const double twice = swim("blur_passes = 2");
  std::printf("  standard deviation of a place over 64 frames: %.4f, blurred once %.4f, twice %.4f\n", noisy, blurred,
              twice);
  EXPECT_LT(twice, 0.02);
  EXPECT_LT(blurred, 0.6 * noisy);
}

TEST(SsaoImage, ItRanksPlacesAsRaysDo) {
  Scene scene;
  add_room(scene);
  scene.look(kRoomCamera);
  const Image image = render(scene, "radius = 0.5");
  Graph reference("ray_traced", kSize, params("radius = 0.5; samples = 256"));
  const Image truth = reference.render(scene);
  // Spearman's correlation; where both are open there is no order.
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < truth.pixels.size(); ++i) {
    if (std::min(truth.pixels[i], image.pixels[i]) < 0.99F) places.push_back(i);
  }
  const auto ranks = [&](const Image& of) {
    std::vector<std::size_t> order(places.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return of.pixels[places[a]] < of.pixels[places[b]]; });
    std::vector<double> rank(places.size());
    for (std::size_t i = 0; i < order.size(); ++i) rank[order[i]] = static_cast<double>(i);
    return rank;
  };
  const std::vector<double> a = ranks(image);
  const std::vector<double> b = ranks(truth);
  const double middle = (static_cast<double>(places.size()) - 1.0) / 2.0;
  double product = 0.0, square = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    product += (a[i] - middle) * (b[i] - middle);
    square += (a[i] - middle) * (a[i] - middle);
  }
  std::printf("  rank correlation with rays %.3f, RMSE %.4f\n", product / square, rendering::rmse(image, truth));
  EXPECT_GT(product / square, 0.8);
  // The largest disagreements, for the README: where and which way.
  std::sort(places.begin(), places.end(), [&](std::size_t i, std::size_t j) {
    return std::abs(image.pixels[i] - truth.pixels[i]) > std::abs(image.pixels[j] - truth.pixels[j]);
  });
  for (std::size_t i = 0; i < 6; ++i) {
    std::printf("    pixel %2zu,%2zu: %.2f, rays %.2f\n", places[i] % kSize, places[i] / kSize,
                static_cast<double>(image.pixels[places[i]]), static_cast<double>(truth.pixels[places[i]]));
  }
}

TEST(SsaoImage, EverySettingIsInRangeOnImagesThatNothingDivides) {
  for (const auto& [width, height] : {std::pair{95U, 53U}, std::pair{1U, 1U}, std::pair{5U, 67U}}) {
    for (const char* list :
         {"radius = 0.5", "depth_divisor = 4; evaluate_divisor = 4", "depth_divisor = 3; evaluate_divisor = 2",
          "depth_divisor = 4; depth_filter = \"checkerboard\"; depth_format = \"float16\"; depth_fetch = \"bilinear\"",
          "depth_divisor = 2; depth_filter = \"min\"; hemisphere = \"none\"; above_plane = false",
          "blur = \"square\"; blur_passes = 3; falloff = \"quadratic\"; full = 0",
          "falloff = \"power\"; full = 2; range = 2; power = 0; tight_share = 0.75",
          "falloff = \"curve\"; border = \"clamp\"",
          "randomize = \"none\"; hemisphere = \"basis\"; limiter = \"samples\"; points = 1",
          "directions = \"octants\"; contrast = 3; blur = \"plain\"; tile = 1", "radius = 1e6", "radius = 1e-6"}) {
      Scene scene;
      add_room(scene);
      scene.look(kRoomCamera);
      Graph graph("ssao", kSize, params(list));
      graph.set("extent=[" + std::to_string(width) + ", " + std::to_string(height) + "]");
      const Image image = graph.render(scene);
      for (const float value : image.pixels) {
        ASSERT_TRUE(value >= 0.0F && value <= 1.0F) << list << " " << width << " " << value;
      }
    }
  }
}

TEST(SsaoImage, ReducedImagesOfAPlaneAreOpenToTheLastColumn) {
  for (const char* list : {"depth_divisor = 4", "evaluate_divisor = 4", "depth_divisor = 4; evaluate_divisor = 4",
                           "depth_divisor = 2; depth_filter = \"max\""}) {
    Scene scene;
    add_tilted_plane(scene, 5.0, 60.0);
    scene.look({{0, 0, 0}, {0, 0, -1}, 0.5, 0.01, false});
    Graph graph("ssao", kSize, params(list));
    graph.set("extent=[95, 53]");
    EXPECT_EQ(graph.render(scene).least(), 1.0F) << list;
  }
}

// ---- what the scene does not call for ----

TEST(SsaoImage, ItsWorkDoesNotGrowWithTheObjects) {
  std::vector<nlohmann::json> counters;
  for (const int objects : {5, 200}) {
    Scene scene;
    scene.add(quad({0, 0, 0}, {20, 0, 0}, {0, 0, -20}));
    for (int i = 0; i < objects; ++i) {
      const double x = -8.0 + 16.0 * (i % 20) / 20.0;
      const double z = -8.0 + 16.0 * (i / 20) / 10.0;
      scene.add(box({x, 0, z}, {x + 0.3, 0.8, z + 0.3}));
    }
    scene.look({{0, 20, 20}, {0, 0, 0}, 0.9, 0.01, false});
    Graph graph("ssao", kSize, "");
    static_cast<void>(graph.render(scene));
    static_cast<void>(graph.render(scene));
    counters.push_back(parsed::json(graph.stats())["counters"]);
  }
  for (const char* counter : {"dispatches", "barriers", "renderings", "live_images"}) {
    EXPECT_EQ(counters[0][counter], counters[1][counter]) << counter;
  }
}

TEST(SsaoImage, EmissionAndLightsThatDoNotAskForItStayBitForBitAndNoneIsAsIfItWereNotThere) {
  const std::string tail =
      "[[pass]]\nname = \"material\"\nrole = \"surface_material\"\ntechnique = \"ggx\"\n[[pass]]\nrole = "
      "\"lighting\"\ntechnique = \"deferred\"\n";
  Scene scene;
  add_room(scene);
  scene.look(kRoomCamera);
  heddle_light light{};
  light.struct_size = sizeof light;
  light.position[0] = 1.0;
  light.position[1] = 1.5;
  light.record.type = HEDDLE_LIGHT_POINT;
  std::fill(std::begin(light.record.intensity), std::end(light.record.intensity), 100.0F);
  std::uint32_t id = 0;
  rendering::require(heddle_scene_add_light(scene.raw(), nullptr, &light, &id));
  Graph with("ssao", kSize, tail, "lighting.radiance");
  const Image lit = with.render(scene);
  EXPECT_GT(lit.greatest(), 0.0F);
  // Without a sky there is no ambient light to occlude.
  with.set("ao.technique=none");
  EXPECT_EQ(with.render(scene).pixels, lit.pixels);
  const nlohmann::json stats = parsed::json(with.stats());
  EXPECT_EQ(stats["counters"]["dispatches"], 0) << "the whole chain is gone";
  for (const auto& library : stats["libraries"]) {
    EXPECT_EQ(library.get<std::string>().find("ambient_occlusion"), std::string::npos) << library;
  }
}

}  // namespace
