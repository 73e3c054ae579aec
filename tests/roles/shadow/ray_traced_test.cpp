// SPDX-License-Identifier: Apache-2.0
// shadow/ray_traced against closed forms and float64 quadrature: penumbrae of lights of every shape, alpha masks, when
// the tree is made; and the depth maps against it. Prints the tables of the README.
#include "parsed.hpp"
#include "patch.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include <functional>

namespace {

using namespace rendering;
using shadow_patch::ask;
using shadow_patch::cascaded;
using shadow_patch::Patch;
using shadow_patch::ray_traced;
using shadow_patch::shadow_map;

/// A half plane, x < 0, over a floor under one light; a strip of the floor across the shadow's edge, along x.
struct HalfPlane {
  static constexpr double kHeight = 0.5;
  HeddleLight record;
  dvec3 position;
  Patch patch{{-0.3, 0, -0.01}, {0.6, 0, 0}, {0, 0, 0.02}, {0, 1, 0}};

  HalfPlane(const HeddleLight& of, const dvec3& at) : record(of), position(at) {
    patch.camera = {0.5, 2, 3};
    patch.grid = 64;
  }
  [[nodiscard]] Image rays(std::uint32_t samples, std::uint64_t seed = 0) const {
    Scene scene;
    scene.add_floor({0, 0, 0}, 20.0);
    scene.add_floor({-10, kHeight, 0}, 10.0);
    scene.add_light(record, position);
    scene.look(patch.camera, {0, 0, 0});
    Graph graph(fmt::format("extent = [{0}, {0}]\noutput = \"probe.values\"\n", patch.grid) +
                ray_traced(fmt::format("params.samples = {}\n", samples)) +
                "[[pass]]\nname = \"probe\"\nrole = \"probe\"\ntechnique = \"shadow\"\n" + patch.text());
    heddle_render_options options{};
    options.struct_size = sizeof options;
    options.seed = seed;
    check(heddle_render(graph.handle, scene.handle, &options));
    return graph.read();
  }

  /// Share of the irradiance on the floor that is not blocked, in float64: midpoints of the light's own measure.
  [[nodiscard]] double truth(const dvec3& p) const {
    constexpr int kSteps = 400;
    double sum = 0, weights = 0;
    const auto add = [&](const dvec3& direction, double weight) {
      weights += weight;
      sum += p.x + kHeight * direction.x / direction.y < 0.0 ? 0.0 : weight;
    };
    const dvec3 axis = record.type == HEDDLE_LIGHT_DIRECTIONAL
                           ? -dvec3(record.direction[0], record.direction[1], record.direction[2])
                           : glm::normalize(position - p);
    const dvec3 u = glm::normalize(glm::cross(axis, dvec3(0.3, 0.2, 0.9))), v = glm::cross(axis, u);
    const double sine = record.type == HEDDLE_LIGHT_SPHERE
                            ? static_cast<double>(record.radius) / glm::length(position - p)
                            : std::sin(static_cast<double>(record.radius));
    const double least = std::sqrt(1 - sine * sine);
    for (int i = 0; i < kSteps; ++i) {
      for (int k = 0; k < kSteps; ++k) {
        const double s = (i + 0.5) / kSteps, t = (k + 0.5) / kSteps;
        if (record.type == HEDDLE_LIGHT_RECTANGLE) {
          const dvec3 x(record.tangent[0], record.tangent[1], record.tangent[2]);
          const dvec3 d(record.direction[0], record.direction[1], record.direction[2]);
          const dvec3 q = position + (2 * s - 1) * static_cast<double>(record.half_extent[0]) * x +
                          (2 * t - 1) * static_cast<double>(record.half_extent[1]) * glm::cross(d, x) - p;
          const double r = glm::length(q);
          add(q / r, std::max(q.y / r, 0.0) * std::max(-glm::dot(d, q) / r, 0.0) / (r * r));
        } else {
          const double cosine = 1 - s * (1 - least), across = std::sqrt(1 - cosine * cosine), phi = 2 * kPi * t;
          const dvec3 direction = axis * cosine + across * (std::cos(phi) * u + std::sin(phi) * v);
          add(direction, std::max(direction.y, 0.0));
        }
      }
    }
    return sum / weights;
  }
};

std::vector<std::pair<const char*, HalfPlane>> soft_lights() {
  HeddleLight sun = light(HEDDLE_LIGHT_DIRECTIONAL, {0.3, -1, 0.1});
  sun.radius = 0.15F;
  HeddleLight ball = light(HEDDLE_LIGHT_SPHERE);
  ball.radius = 0.5F;
  HeddleLight panel = light(HEDDLE_LIGHT_RECTANGLE, {0.2, -1, 0});
  panel.half_extent[0] = 0.6F;
  panel.half_extent[1] = 0.3F;
  HalfPlane under_sun(sun, {});
  under_sun.patch.corner.x = HalfPlane::kHeight * 0.3 - 0.3;  // where the edge's shadow lies
  return {{"sun", under_sun}, {"sphere", HalfPlane(ball, {0, 3, 0})}, {"rectangle", HalfPlane(panel, {0, 3, 0})}};
}

TEST(RayTracedShadow, PenumbraeAreTheShareOfIrradianceThatPassesAHalfPlane) {
  for (const auto& [name, setting] : soft_lights()) {
    const Image image = setting.rays(64);
    double worst = 0;
    int between = 0;
    for (std::uint32_t x = 0; x < setting.patch.grid; ++x) {
      const double wanted = setting.truth(setting.patch.point(x, 0));
      // The rows differ by their scrambling alone (and by 2 cm along the edge).
      double sum = 0, squares = 0;
      for (std::uint32_t y = 0; y < setting.patch.grid; ++y) {
        const double value = image.at(x, y);
        sum += value;
        squares += value * value;
      }
      const double count = setting.patch.grid, mean = sum / count;
      const double error = std::sqrt(std::max(squares / count - mean * mean, 0.0) / count);
      // The quadrature of a step over 400 x 400 midpoints is off by 1/400 at most.
      EXPECT_NEAR(mean, wanted, 4.0 * error + 0.0025) << name << " at x " << setting.patch.point(x, 0).x;
      worst = std::max(worst, std::abs(mean - wanted));
      between += wanted > 0.02 && wanted < 0.98;
    }
    std::printf("  %s: largest error of a mean of 64 pixels %.4f, %d of 64 columns in the penumbra\n", name, worst,
                between);
    EXPECT_GT(between, 15) << name;
  }
}

TEST(RayTracedShadow, ErrorFallsFasterThanOfRandomRays) {
  for (const auto& [name, setting] : soft_lights()) {
    std::vector<double> wanted;
    for (std::uint32_t x = 0; x < setting.patch.grid; ++x) wanted.push_back(setting.truth(setting.patch.point(x, 0)));
    std::vector<double> errors;
    for (const std::uint32_t samples : {1U, 4U, 16U, 64U, 256U}) {
      const Image image = setting.rays(samples);
      double sum = 0;
      int count = 0;
      for (std::uint32_t x = 0; x < setting.patch.grid; ++x) {
        if (wanted[x] < 0.02 || wanted[x] > 0.98) continue;
        for (std::uint32_t y = 0; y < setting.patch.grid; ++y, ++count)
          sum += std::pow(static_cast<double>(image.at(x, y)) - wanted[x], 2);
      }
      errors.push_back(std::sqrt(sum / count));
      std::printf("  %s, samples %3u: RMSE in the penumbra %.4f\n", name, samples, errors.back());
    }
    // Of random rays the root of 256; points that fill the light evenly are better at an edge through it: N^-0.75.
    EXPECT_GT(errors.front() / errors.back(), std::pow(256.0, 0.65)) << name;
    for (std::size_t i = 1; i < errors.size(); ++i) EXPECT_LT(errors[i], 0.55 * errors[i - 1]) << name;
  }
}

TEST(RayTracedShadow, SeedsChangeTheNoiseAlone) {
  const HalfPlane setting = soft_lights()[1].second;
  const Image one = setting.rays(16, 1), other = setting.rays(16, 2);
  EXPECT_NE(one.pixels, other.pixels);
  EXPECT_EQ(one.pixels, setting.rays(16, 1).pixels);
}

TEST(RayTracedShadow, LightsWithoutSizeCastHardShadowsWhereGeometrySays) {
  struct Case {
    const char* name;
    HeddleLight record;
    dvec3 position;
    double edge;  // x of the shadow's edge on the floor
  };
  HeddleLight capsule = light(HEDDLE_LIGHT_CAPSULE);
  capsule.segment_length = 1.0F;
  capsule.tangent[0] = 0;
  capsule.tangent[2] = 1;
  HeddleLight box = light(HEDDLE_LIGHT_BOX, {1, -2, 0});
  box.half_extent[0] = box.half_extent[1] = box.half_extent[2] = 3.0F;
  HeddleLight short_box = box;
  short_box.half_extent[2] = 0.3F;  // begins below the half plane
  const double half = HalfPlane::kHeight;
  for (const Case& one :
       {Case{"sun", light(HEDDLE_LIGHT_DIRECTIONAL, {-1, -2, 0}), {}, -half / 2},
        Case{"point", light(HEDDLE_LIGHT_POINT), {0.5, 2, 0}, -0.5 * half / (2 - half)},
        Case{"spot", light(HEDDLE_LIGHT_SPOT), {0.5, 2, 0}, -0.5 * half / (2 - half)},
        Case{"cone", light(HEDDLE_LIGHT_CONE), {-0.5, 2, 0}, 0.5 * half / (2 - half)},
        Case{"capsule", capsule, {0.5, 2, 0}, -0.5 * half / (2 - half)}, Case{"box", box, {0, 1, 0}, half / 2},
        Case{"box that begins below", short_box, {0, 0, 0}, -10}}) {
    const HalfPlane setting(one.record, one.position);
    const Image image = setting.rays(16);
    for (std::uint32_t x = 0; x < setting.patch.grid; ++x) {
      const double off = setting.patch.point(x, 0).x - one.edge;
      if (std::abs(off) < 1e-4) continue;
      EXPECT_EQ(image.at(x, 7), off > 0 ? 1.0F : 0.0F) << one.name << " at " << off << " from the edge";
    }
  }
}

TEST(RayTracedShadow, ALampsOwnBodyCastsNothing) {
  // Spheres as large as their lights, drawn where they are; and a shade nearer than the scene says.
  for (const bool is_sphere : {true, false}) {
    Scene scene;
    scene.add_floor({0, 0, 0}, 10.0);
    scene.add_sphere({0, 2, 0}, is_sphere ? 0.3 : 0.015, 32);
    HeddleLight lamp = light(is_sphere ? HEDDLE_LIGHT_SPHERE : HEDDLE_LIGHT_POINT);
    lamp.radius = 0.3F;
    scene.add_light(lamp, {0, 2, 0});
    scene.look({0, 3, 4}, {0, 0, 0});
    Patch patch{{-2, 0, -2}, {4, 0, 0}, {0, 0, 4}, {0, 1, 0}};
    patch.camera = {0, 3, 4};
    patch.grid = 32;
    const Image image = ask(scene, patch, ray_traced());
    for (std::uint32_t i = 0; i < patch.grid * patch.grid; ++i) EXPECT_EQ(image.at(i % 32, i / 32), 1.0F) << is_sphere;
  }
}

TEST(RayTracedShadow, AlphaMasksCastTheirHolesTheFinerTheMoreLevels) {
  constexpr std::uint32_t kTexels = 256;
  constexpr double kRadius = 0.3;
  Scene scene;
  scene.add_floor({0, 0, 0}, 5.0);
  std::vector<std::uint8_t> rgba(std::size_t{kTexels} * kTexels * 4, 255);
  for (std::uint32_t y = 0; y < kTexels; ++y) {
    for (std::uint32_t x = 0; x < kTexels; ++x) {
      const double r = std::hypot((x + 0.5) / kTexels - 0.5, (y + 0.5) / kTexels - 0.5);
      rgba[(std::size_t{y} * kTexels + x) * 4 + 3] = r < kRadius ? 0 : 255;
    }
  }
  heddle_texture texture{};
  texture.struct_size = sizeof texture;
  texture.width = texture.height = kTexels;
  texture.rgba = rgba.data();
  std::uint32_t id = 0;
  check(heddle_scene_add_texture(scene.handle, nullptr, &texture, &id));
  HeddleMaterial leaf = Scene::grey();
  leaf.alpha_mode = HEDDLE_ALPHA_MASK;
  scene.use_material(leaf, id);
  scene.add_mesh({-0.5F, 1, -0.5F, -0.5F, 1, 0.5F, 0.5F, 1, 0.5F, 0.5F, 1, -0.5F}, {}, {0, 1, 2, 0, 2, 3}, dmat4(1.0),
                 {0, 0, 0, 1, 1, 1, 1, 0});
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL));
  scene.look({0, 3, 4}, {0, 0, 0});
  Patch patch{{-0.6, 0, -0.6}, {1.2, 0, 0}, {0, 0, 1.2}, {0, 1, 0}};
  patch.camera = {0, 3, 4};
  double last = 1;
  for (const std::uint32_t levels : {3U, 5U, 7U}) {
    const Image image = ask(scene, patch, ray_traced(fmt::format("params.mask_levels = {}\n", levels)));
    int wrong = 0;
    for (std::uint32_t y = 0; y < patch.grid; ++y) {
      for (std::uint32_t x = 0; x < patch.grid; ++x) {
        const dvec3 p = patch.point(x, y);
        const bool is_solid = std::max(std::abs(p.x), std::abs(p.z)) < 0.5 && std::hypot(p.x, p.z) > kRadius;
        if (image.at(x, y) == (is_solid ? 0.0F : 1.0F)) continue;
        ++wrong;
        // A micro-triangle is as wide as the quad over 2^levels, its middle at most 0.75 of that from its corners.
        EXPECT_LT(std::abs(std::hypot(p.x, p.z) - kRadius), 0.75 / (1U << levels) + 1.0 / kTexels) << levels;
      }
    }
    const double share = wrong / static_cast<double>(image.pixels.size() / 4);
    std::printf("  mask_levels %u: %.4f of the points wrong\n", levels, share);
    EXPECT_LT(share, 0.5 * last);
    last = std::max(share, 1e-3);
  }
}

struct Counts {
  std::uint64_t trees = 0, triangles = 0;
  bool operator==(const Counts&) const = default;
};
Counts counts_of(Graph& graph, Scene& scene) {
  graph.render(scene);
  const char* text = nullptr;
  check(heddle_stats(graph.handle, &text));
  Counts counts;
  const nlohmann::json stats = parsed::json(text);
  for (const auto& count : stats["counts"])
    (count["name"] == "trees_built" ? counts.trees : counts.triangles) = count["count"].get<std::uint64_t>();
  return counts;
}

TEST(RayTracedShadow, MakesItsTreeWhenTrianglesChangeAndALightCastsAndElseNever) {
  Scene scene;
  scene.add_floor({0, 0, 0}, 5.0);
  scene.add_box({-0.5, 1, -0.5}, {0.5, 1.1, 0.5});
  HeddleLight lamp = light(HEDDLE_LIGHT_POINT);
  lamp.flags = 0;
  scene.add_light(lamp, {0, 3, 0});
  scene.look({0, 3, 4}, {0, 0, 0});
  Patch patch{{-0.1, 0, -0.1}, {0.2, 0, 0}, {0, 0, 0.2}, {0, 1, 0}};
  patch.camera = {0, 3, 4};
  patch.grid = 16;
  Graph graph("extent = [16, 16]\noutput = \"probe.values\"\n" + ray_traced() +
              "[[pass]]\nname = \"probe\"\nrole = \"probe\"\ntechnique = \"shadow\"\n" + patch.text());
  EXPECT_EQ(counts_of(graph, scene), (Counts{0, 0})) << "no light casts";
  EXPECT_EQ(graph.read().at(3, 3), 1.0F);
  scene.add_light(light(HEDDLE_LIGHT_POINT), {0, 3, 0});
  graph.set("probe.params.light=1");
  EXPECT_EQ(counts_of(graph, scene), (Counts{1, 14}));
  EXPECT_EQ(graph.read().at(3, 3), 0.0F);
  scene.look({0, 3, 4.5}, {0, 0, 0});
  EXPECT_EQ(counts_of(graph, scene), (Counts{0, 0})) << "the camera moves";
  scene.add_box({2, 0, 2}, {3, 1, 3});
  EXPECT_EQ(counts_of(graph, scene), (Counts{1, 26}));
  graph.set("shadow.params.samples=64");
  EXPECT_EQ(counts_of(graph, scene), (Counts{0, 0}));
}

TEST(RayTracedShadow, TellsWhereStepsRunOut) {
  HalfPlane setting = soft_lights()[1].second;
  setting.patch.grid = 16;
  const auto ask_with = [&](std::uint32_t samples) {
    Scene scene;
    scene.add_floor({0, 0, 0}, 20.0);
    scene.add_floor({-10, HalfPlane::kHeight, 0}, 10.0);
    // Dust between floor and light, along a sequence that fills space evenly: boxes that few rays meet and all pass.
    for (int i = 1; i <= 300; ++i) {
      const dvec3 even = glm::fract(static_cast<double>(i) * dvec3(0.8191725134, 0.6710436067, 0.5497004779));
      const dvec3 at = dvec3(-0.6, 0.6, -0.6) + even * dvec3(1.2, 1.8, 1.2);
      scene.add_box(at, at + 0.01);
    }
    scene.add_light(setting.record, setting.position);
    scene.look(setting.patch.camera, {0, 0, 0});
    return ask(scene, setting.patch, ray_traced(fmt::format("params.samples = {}\n", samples)));
  };
  Host::get().log.clear();
  const Image few = ask_with(256);
  EXPECT_THAT(Host::get().log, testing::Each(testing::Not(testing::HasSubstr("steps"))));
  const Image many = ask_with(4096);
  double difference = 0;
  for (std::size_t i = 0; i < few.pixels.size(); i += 4) {
    EXPECT_TRUE(many.pixels[i] >= 0.0F && many.pixels[i] <= 1.0F);
    difference = std::max(difference, static_cast<double>(std::abs(few.pixels[i] - many.pixels[i])));
  }
  EXPECT_LT(difference, 0.05) << "the rays that were done are as even as any";
  std::vector<std::string> told;
  for (const std::string& line : Host::get().log) {
    if (line.find("steps") != std::string::npos) told.push_back(line);
  }
  ASSERT_EQ(told.size(), 1U);
  EXPECT_THAT(told[0],
              testing::HasSubstr(" pixels take more steps than a shader has, and see the mean of the rays that "
                                 "were done; lower 'samples', or let fewer lights cast shadows"));
}

TEST(RayTracedShadow, DepthMapsComeNearerToItAsTheirResolutionRises) {
  Scene scene;
  scene.add_floor({0, 0, 0}, 10.0);
  scene.add_box({-0.8, 0.4, -0.3}, {-0.2, 0.9, 0.4});
  scene.add_sphere({0.5, 0.6, 0}, 0.35, 64);
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0.4, -1, 0.23}));
  scene.add_light(light(HEDDLE_LIGHT_POINT), {-0.5, 3, 0.6});
  scene.look({0, 2, 4}, {0, 0, 0});
  Patch patch{{-1.5, 0, -1.5}, {3, 0, 0}, {0, 0, 3}, {0, 1, 0}};
  patch.camera = {0, 2, 4};
  for (const auto& [technique, index] : {std::pair("shadow_map", 0U), {"shadow_map", 1U}, {"cascaded", 0U}}) {
    patch.light = index;
    const Image truth = ask(scene, patch, ray_traced());
    const bool is_point = index == 1;
    double last = 0;
    for (const std::uint32_t resolution : {256U, 512U, 1024U, 2048U}) {
      // The point light's maps before the sun's, which need none then.
      const std::string parameters =
          fmt::format("params.resolution = {}\n{}", resolution,
                      is_point ? "params.views = 6\nparams.cascades = 0\nparams.smallest = 2048\n" : "");
      const Image image =
          ask(scene, patch, technique == std::string("cascaded") ? cascaded(parameters) : shadow_map(parameters));
      double sum = 0;
      for (std::size_t i = 0; i < image.pixels.size(); i += 4)
        sum += static_cast<double>(std::abs(image.pixels[i] - truth.pixels[i]));
      const double error = sum / (128.0 * 128.0);
      std::printf("  %s, %s, resolution %4u: mean error %.5f\n", technique, is_point ? "point" : "sun", resolution,
                  error);
      if (last > 0) {
        EXPECT_LT(error, 0.65 * last) << technique << index << " " << resolution;
      }
      last = error;
    }
  }
}

}  // namespace
