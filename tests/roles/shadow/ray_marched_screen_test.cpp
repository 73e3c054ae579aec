// SPDX-License-Identifier: Apache-2.0
// ray_marched_screen against geometry: how its error falls with `steps`, models of few facets with smooth normals, and
// scenes of millimetres and of kilometres. Prints the table of the README.
#include "patch.hpp"

#include <algorithm>

namespace {

using namespace rendering;
using shadow_patch::ask;
using shadow_patch::contact;
using shadow_patch::Patch;

// ---- steps ----------------------------------------------------------------------------------------------------------

constexpr double kLength = 0.4;    // of the ray, metres
constexpr double kRayFade = 0.25;  // README: over the last quarter

/// A tall box, seen from the front along the plane of its right face, with light from the upper left: where a ray
/// enters it, the image's depth changes at once, at a pixel's border, and the ray keeps its depth.
struct FootOfABox {
  double unit = 1.0;  // metres for one
  Patch patch;

  explicit FootOfABox(double unit_metres = 1.0) : unit(unit_metres) {
    patch.corner = unit * dvec3(0.0005, 0, 0.2);
    patch.edge_u = unit * dvec3(0.4, 0, 0);
    patch.edge_v = unit * dvec3(0, 0, 0.08);
    patch.normal = {0, 1, 0};
    patch.camera = unit * dvec3(0, 0.5, 3);
    patch.grid = 512;
  }
  void build(Scene& scene) const {
    scene.add_floor({0, 0, 0}, 50.0 * unit);
    scene.add_box(unit * dvec3(-0.5, 0, -0.3), unit * dvec3(0, 1, 0.3));
    scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {1, -1, 0}));
    heddle_camera camera{};
    camera.struct_size = sizeof camera;
    for (int i = 0; i < 3; ++i) camera.position[i] = patch.camera[i];
    camera.rotation[3] = 1.0;
    camera.vertical_angle = 1.0;
    camera.near_distance = 0.01 * unit;
    std::uint32_t id = 0;
    check(heddle_scene_add_camera(scene.handle, nullptr, &camera, &id));
    check(heddle_scene_use_camera(scene.handle, id));
  }
  /// A ray of length `reach` from (x, 0, z) meets the box after sqrt(2) x, and its weight fades to the end.
  static double exact(double x, double reach) {
    return 1.0 - std::clamp((reach - std::sqrt(2.0) * x) / (kRayFade * reach), 0.0, 1.0);
  }
};

TEST(ContactShadowMeasured, ShadowIsShortByHalfAStepAndNoValueIsOffByMoreThanOne) {
  const FootOfABox foot;
  Scene scene;
  foot.build(scene);
  for (const bool dither : {true, false}) {
    for (const int steps : {4, 8, 16, 32, 64, 128}) {
      const Image image =
          ask(scene, foot.patch,
              contact(fmt::format("params.distance = {}\nparams.thickness = 0.4\nparams.stride = 1024.0\n"
                                  "params.steps = {}\nparams.dither = {}\n",
                                  kLength, steps, dither)));
      double short_by = 0;  // metres on the floor
      double squares = 0;
      double worst = 0;
      const std::uint32_t grid = foot.patch.grid;
      for (std::uint32_t y = 0; y < grid; ++y) {
        for (std::uint32_t x = 0; x < grid; ++x) {
          const double error = image.at(x, y) - FootOfABox::exact(foot.patch.point(x, y).x, kLength);
          short_by += error * foot.patch.edge_u.x / (grid * grid);
          squares += error * error / (grid * grid);
          worst = std::max(worst, std::abs(error));
        }
      }
      // A hit is found at most a step late, on average half a step, and late hits weigh less by their lag over the
      // fade.
      const double step = kLength / steps;
      const double expected = 0.5 * step / std::sqrt(2.0);
      std::printf("  steps %3d, dither %d: shadow short by %6.2f mm (expected %6.2f), RMSE %.4f, largest error %.3f\n",
                  steps, dither ? 1 : 0, 1e3 * short_by, 1e3 * expected, std::sqrt(squares), worst);
      EXPECT_NEAR(short_by / expected, 1.0, 0.1) << steps;
      EXPECT_LE(worst, std::min(1.0, step / (kRayFade * kLength)) + 1e-3) << steps;
    }
  }
}

TEST(ContactShadowMeasured, ThingsOfMillimetresAreDarkAtTheirFootWithTheDefaults) {
  for (const double unit : {1e-3, 1e-2}) {
    SCOPED_TRACE(unit);
    const FootOfABox foot(unit);
    Scene scene;
    foot.build(scene);
    const Image image = ask(scene, foot.patch, contact());
    int decided = 0;
    int wrong = 0;
    for (std::uint32_t y = 0; y < foot.patch.grid; ++y) {
      for (std::uint32_t x = 0; x < foot.patch.grid; ++x) {
        const dvec3 p = foot.patch.point(x, y);
        // README equation (1): 16 steps of 4 pixels.
        const double depth = foot.patch.camera.z - p.z;
        const double reach = 16 * 4 * (2.0 * std::tan(0.5) / foot.patch.grid * depth);
        ASSERT_LT(reach, 0.3) << "the bound does not bind";
        const double step = reach / 16;
        const double entry = std::sqrt(2.0) * p.x;
        if (entry > (1.0 - kRayFade) * reach - step && entry < reach) continue;
        ++decided;
        wrong += std::abs(image.at(x, y) - FootOfABox::exact(p.x, reach)) > 1e-6 ? 1 : 0;
      }
    }
    EXPECT_EQ(wrong, 0) << "of " << decided;
    EXPECT_GT(decided, 100000);
  }
}

// ---- models of few facets -------------------------------------------------------------------------------------------

constexpr std::uint32_t kSize = 192;
constexpr double kAngle = 0.8;  // of the camera, radians

/// Radiance of the scene under the shadow passes alone; no sky.
Image picture(Scene& scene, const std::string& shadows) {
  Graph graph(
      "extent = [192, 192]\noutput = \"lighting.radiance\"\n[[pass]]\nrole = \"gbuffer\"\ntechnique = \"raster\"\n"
      "params.precision = \"float32\"\n" +
      shadows +
      "[[pass]]\nrole = \"surface_material\"\ntechnique = \"ggx\"\n"
      "[[pass]]\nrole = \"lighting\"\ntechnique = \"deferred\"\nparams.precision = \"float32\"\n");
  return graph.image(scene);
}
std::string contact_alone(const std::string& parameters) {
  return "[[pass]]\nname = \"contact\"\nrole = \"shadow\"\ntechnique = \"ray_marched_screen\"\n" + parameters;
}

/// Normals of the facets of Scene::add_sphere(0, 1, rings) that pixels show; 0 where they show none.
std::vector<dvec3> facets_of_sphere(std::uint32_t rings, const dvec3& eye) {
  const dvec3 forward = glm::normalize(-eye);
  const dvec3 right = glm::normalize(glm::cross(forward, dvec3(0, 1, 0)));
  const dvec3 up = glm::cross(right, forward);
  const auto vertex = [&](std::uint32_t i, std::uint32_t j) {
    const double theta = kPi * i / rings;
    const double phi = kPi * j / rings;
    return dvec3(std::sin(theta) * std::sin(phi), std::cos(theta), std::sin(theta) * std::cos(phi));
  };
  // A convex body is the intersection of its facets' half spaces: a ray enters at the last of the planes that it meets
  // from outside.
  std::vector<dvec3> normals;
  std::vector<double> offsets;
  for (std::uint32_t i = 0; i < rings; ++i) {
    for (std::uint32_t j = 0; j < 2 * rings; ++j) {
      const dvec3 a = vertex(i, j), b = vertex(i + 1, j), c = vertex(i + 1, j + 1), d = vertex(i, j + 1);
      const dvec3 n = glm::normalize(i == 0 ? glm::cross(b - a, c - a) : glm::cross(c - a, d - a));
      normals.push_back(n);
      offsets.push_back(glm::dot(n, i == 0 ? b : d));
    }
  }
  std::vector<dvec3> shown(std::size_t{kSize} * kSize, dvec3(0.0));
  for (std::uint32_t y = 0; y < kSize; ++y) {
    for (std::uint32_t x = 0; x < kSize; ++x) {
      const double tangent = std::tan(0.5 * kAngle);
      const dvec3 ray = forward + right * (tangent * (2.0 * (x + 0.5) / kSize - 1.0)) -
                        up * (tangent * (2.0 * (y + 0.5) / kSize - 1.0));
      double enter = 0;
      double leave = 1e9;
      dvec3 entered(0.0);
      for (std::size_t k = 0; k < normals.size(); ++k) {
        const double slope = glm::dot(normals[k], ray);
        const double t = (offsets[k] - glm::dot(normals[k], eye)) / slope;
        if (slope < 0 && t > enter) {
          enter = t;
          entered = normals[k];
        }
        if (slope > 0) leave = std::min(leave, t);
      }
      if (enter < leave) shown[std::size_t{y} * kSize + x] = entered;
    }
  }
  return shown;
}

TEST(ContactShadow, CoarseModelsWithSmoothNormalsAreShadowedAsTheirFacetsAre) {
  const dvec3 eye(0.9, 1.1, 2.4);
  for (const std::uint32_t rings : {5U, 8U, 12U}) {
    const std::vector<dvec3> facets = facets_of_sphere(rings, eye);
    for (const dvec3& towards : {dvec3(-0.8, 0.5, -0.3), dvec3(0.3, 1.0, 0.2), dvec3(-1.0, 0.1, 0.6)}) {
      SCOPED_TRACE(std::to_string(rings) + " rings, light from " + text_of(towards));
      const dvec3 L = glm::normalize(towards);
      Scene scene;
      scene.add_sphere({0, 0, 0}, 1.0, rings);
      scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, -L));
      scene.look(eye, {0, 0, 0}, kAngle);
      const Image open = picture(scene, "");
      const Image shadowed = picture(scene, contact_alone(""));
      int decided = 0;
      int wrong = 0;
      for (std::uint32_t y = 2; y < kSize - 2; ++y) {
        for (std::uint32_t x = 2; x < kSize - 2; ++x) {
          const auto same = [&](std::uint32_t a, std::uint32_t b) {
            return glm::dot(facets[std::size_t{b} * kSize + a], facets[std::size_t{y} * kSize + x]) > 1.0 - 1e-9;
          };
          // Three pixels in a row and in a column, this one among them, show one facet: the image then says its plane.
          const bool row = (same(x - 2, y) && same(x - 1, y)) || (same(x - 1, y) && same(x + 1, y)) ||
                           (same(x + 1, y) && same(x + 2, y));
          const bool column = (same(x, y - 2) && same(x, y - 1)) || (same(x, y - 1) && same(x, y + 1)) ||
                              (same(x, y + 1) && same(x, y + 2));
          const double NoL = glm::dot(facets[std::size_t{y} * kSize + x], L);
          // Dark by its own normal, or edge-on to the light: nothing to see, or both right.
          if (!row || !column || open.at(x, y) < 1e-4F || std::abs(NoL) < 0.02) continue;
          ++decided;
          const double visibility = shadowed.at(x, y) / open.at(x, y);
          if (std::abs(visibility - (NoL > 0 ? 1.0 : 0.0)) <= 1e-4) continue;
          if (++wrong <= 3) {
            ADD_FAILURE() << "pixel " << x << ' ' << y << ": visibility " << visibility << ", NoL of the facet " << NoL
                          << ", of the light " << open.at(x, y);
          }
        }
      }
      EXPECT_EQ(wrong, 0) << "of " << decided;
      EXPECT_GT(decided, 1000);
    }
  }
}

// ---- units ----------------------------------------------------------------------------------------------------------

/// A still life that is `unit` metres where the one of unit 1 has a metre; of lights as well.
void add_still_life(Scene& scene, double unit) {
  scene.add_floor({0, 0, 0}, 40.0 * unit);
  scene.add_box(unit * dvec3(-1.4, 0, -0.3), unit * dvec3(-0.8, 1, 0.3));
  scene.add_box(unit * dvec3(0.9, 0, 0.2), unit * dvec3(1.5, 0.3, 0.8));
  for (int i = 0; i < 9; ++i) {
    const double x = -0.9 + 0.22 * i;
    scene.add_box(unit * dvec3(x, 0, 1.6), unit * dvec3(x + 0.03, 0.35, 1.63));
  }
  scene.add_sphere(unit * dvec3(0.15, 0.45, 0), 0.45 * unit, 8);
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0.8, -0.7, 0.5}));
  scene.add_light(light(HEDDLE_LIGHT_POINT, {0, -1, 0}, unit * unit), unit * dvec3(0.5, 1.2, 1.0));
  heddle_camera camera{};
  camera.struct_size = sizeof camera;
  const dvec3 from = dvec3(1.2, 1.5, 4.2);
  const dquat rotation = glm::quatLookAt(glm::normalize(dvec3(0, 0.3, 0.3) - from), dvec3(0, 1, 0));
  for (int i = 0; i < 3; ++i) camera.position[i] = unit * from[i];
  camera.rotation[0] = rotation.x;
  camera.rotation[1] = rotation.y;
  camera.rotation[2] = rotation.z;
  camera.rotation[3] = rotation.w;
  camera.vertical_angle = kAngle;
  camera.near_distance = 0.01 * unit;
  std::uint32_t id = 0;
  check(heddle_scene_add_camera(scene.handle, nullptr, &camera, &id));
  check(heddle_scene_use_camera(scene.handle, id));
}

Image still_life(double unit, const std::string& parameters) {
  Scene scene;
  add_still_life(scene, unit);
  return picture(scene, contact_alone(parameters));
}

/// Share of pixels that differ by more than a thousandth. Both pictures are made of the same decisions, each of which
/// rounding turns over only where a ray is within a few float32 steps of a depth or of a pixel's border: with 16
/// samples for two lights, each within 2^-22 of 192 pixels of a border, at most 32 * 2 * 192 * 2^-22 = 0.3 % of the
/// pixels could.
double differing(const Image& a, const Image& b) {
  EXPECT_EQ(a.pixels.size(), b.pixels.size());
  int count = 0;
  for (std::size_t i = 0; i < a.pixels.size(); i += a.channels) {
    EXPECT_TRUE(std::isfinite(a.pixels[i]) && std::isfinite(b.pixels[i]));
    if (std::abs(a.pixels[i] - b.pixels[i]) > 1e-3F * std::max(a.pixels[i], b.pixels[i])) ++count;
  }
  return static_cast<double>(count) * a.channels / static_cast<double>(a.pixels.size());
}
constexpr double kTurnedOver = 0.003;

TEST(ContactShadow, H6SceneOfMillimetresOrKilometresIsThatOfMetres) {
  const auto parameters = [](double unit) {
    return fmt::format("params.distance = {:e}\nparams.thickness = {:e}\n", 0.3 * unit, 0.1 * unit);
  };
  const Image metres = still_life(1.0, parameters(1.0));
  EXPECT_GT(differing(metres, still_life(1.0, "params.distance = 1e-6\n")), 0.02) << "nothing is shadowed";
  for (const double unit : {1e-3, 1e3}) {
    const double share = differing(metres, still_life(unit, parameters(unit)));
    std::printf("  unit %g m: %.3f %% of the pixels differ\n", unit, 100 * share);
    EXPECT_LE(share, kTurnedOver) << unit;
  }
}

TEST(ContactShadow, DefaultsOfMetresServeMillimetresAsTheirOwnWould) {
  // Where the ray's length in pixels decides, `distance` and `thickness` count by their ratio alone.
  const Image metres = still_life(1.0, "params.distance = 300.0\nparams.thickness = 100.0\n");
  const double share = differing(metres, still_life(1e-3, ""));
  std::printf("  defaults at 1 mm: %.3f %% of the pixels differ\n", 100 * share);
  EXPECT_LE(share, kTurnedOver);
}

}  // namespace
