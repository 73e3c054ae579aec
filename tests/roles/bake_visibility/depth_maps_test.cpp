// SPDX-License-Identifier: Apache-2.0
// bake_visibility/depth_maps: its pipelines against each other, its maps against rays, texels, and the ramp.
#include "baking.hpp"

#include "compare.hpp"

#include <fmt/format.h>

namespace {

using namespace baking;

/// A grid of boxes of different heights on a floor.
void add_city(Scene& scene) {
  scene.add_floor(dvec3(0), 4);
  for (int x = -2; x <= 2; ++x)
    for (int z = -2; z <= 2; ++z) {
      const double height = 0.5 + 0.4 * ((3 * x + 5 * z + 40) % 5);
      scene.add_box(dvec3(1.4 * x - 0.45, 0, 1.4 * z - 0.45), dvec3(1.4 * x + 0.45, height, 1.4 * z + 0.45));
    }
}

const std::vector<std::string> kCity{"spacing=1", "resolution=256", "fill=false"};

std::vector<std::string> with(std::vector<std::string> settings, const std::vector<std::string>& more) {
  settings.insert(settings.end(), more.begin(), more.end());
  return settings;
}

double largest_difference(const Result& a, const Result& b) {
  EXPECT_EQ(a.baked.values.size(), b.baked.values.size());
  double most = 0;
  for (std::size_t v = 0; v < std::min(a.baked.values.size(), b.baked.values.size()); ++v)
    most = std::max(most, std::abs(static_cast<double>(a.baked.values[v].visibility) -
                                   static_cast<double>(b.baked.values[v].visibility)));
  return most;
}

TEST(DepthMaps, EveryPipelineSeesTheSameBits) {
  Scene scene;
  add_city(scene);
  for (const int seed : {1, 2, 3, 4}) {
    // Of a single direction visibility is a bit.
    const std::vector<std::string> settings =
        with(kCity, {"directions=1", "set=random", "seed=" + std::to_string(seed)});
    const Result expected = bake(scene, "depth_maps", settings);
    std::size_t closed = 0;
    for (const BakedValue& value : expected.baked.values) {
      EXPECT_TRUE(value.visibility == 0 || value.visibility == 1);
      closed += value.visibility == 0 ? 1 : 0;
    }
    EXPECT_GT(closed, 20U);
    for (const char* pipeline : {"cpu_compare", "gpu_compare", "split_ramp"}) {
      const Result other = bake(scene, "depth_maps", with(settings, {std::string("pipeline=") + pipeline}));
      std::size_t differing = 0;
      for (std::size_t v = 0; v < other.baked.values.size(); ++v)
        differing += other.baked.values[v].visibility != expected.baked.values[v].visibility ? 1 : 0;
      // Weights below half of 1/255 are no weight in 8 bits, so such elements are open there.
      EXPECT_LE(differing, std::string(pipeline) == "cpu_compare" ? 0U : other.baked.values.size() / 500) << pipeline;
    }
  }
}

TEST(DepthMaps, SumsOf8BitsAreWithinTheirRoundingAndReadBackASixteenthAsOften) {
  Scene scene;
  add_city(scene);
  const std::vector<std::string> settings = with(kCity, {"directions=256"});
  const Result floats = bake(scene, "depth_maps", settings);
  const Result cpu = bake(scene, "depth_maps", with(settings, {"pipeline=cpu_compare"}));
  const Result each = bake(scene, "depth_maps", with(settings, {"pipeline=gpu_compare"}));
  const Result split = bake(scene, "depth_maps", with(settings, {"pipeline=split_ramp"}));
  const Result full = bake(scene, "depth_maps", with(settings, {"pipeline=split_ramp", "passes=17"}));
  // Float32 sums of 256 terms against float64 ones.
  EXPECT_LT(largest_difference(floats, cpu), 2e-6);
  // A weight is rounded by at most 1/510, with no direction of its own: sqrt(128) / (510 sqrt(3)) over weights of 64,
  // by half of which each is off. Of thousands of elements the worst is some six times the mean.
  const double bits = largest_difference(floats, split);
  EXPECT_LT(bits, 6 * std::sqrt(128.0) / (510 * std::sqrt(3.0)) / 64);
  EXPECT_GT(bits, 0);
  double squares = 0;
  for (std::size_t v = 0; v < floats.baked.values.size(); ++v)
    squares += std::pow(static_cast<double>(floats.baked.values[v].visibility - split.baked.values[v].visibility), 2);
  const double rms = std::sqrt(squares / static_cast<double>(floats.baked.values.size()));
  fmt::print("8 bits: rms {:.1e}, most {:.1e}\n", rms, bits);
  EXPECT_LT(rms, 1.5e-4);
  // Integers: the same whenever they are read back, 17 times 15 being 255.
  EXPECT_EQ(largest_difference(each, split), 0);
  EXPECT_EQ(largest_difference(full, split), 0);
  EXPECT_EQ(floats.report["read_backs"], 1);
  EXPECT_EQ(each.report["read_backs"], 256);
  EXPECT_EQ(split.report["read_backs"], 16);
  EXPECT_EQ(cpu.report["read_backs"], 256);
  EXPECT_EQ(each.report["read_bytes"], 16 * split.report["read_bytes"].get<double>());
  EXPECT_EQ(cpu.report["read_bytes"], 256.0 * 256 * 256 * 4);
  EXPECT_EQ(cpu.report["tests"], floats.report["tests"]);
  const double asked = 256 * floats.report["elements"].get<double>();
  EXPECT_NEAR(floats.report["tests"].get<double>() / asked, 0.5, 0.01) << "what is behind an element is not looked up";
  for (const Result* result : {&floats, &cpu, &each, &split})
    fmt::print("read backs {}, bytes {}\n", result->report["read_backs"].dump(), result->report["read_bytes"].dump());
}

TEST(DepthMaps, EightBitsHoldNoMoreThan17Passes) {
  heddle_graph* graph = nullptr;
  const char* setting = "bake.params.passes=18";
  EXPECT_EQ(heddle_graph_parse(rendering::Host::get().handle, job("depth_maps").c_str(), "job.toml", "/tmp", &setting,
                               1, &graph),
            HEDDLE_BAD_INPUT);
  // Why: what 18 passes of the largest half would be.
  EXPECT_EQ(17 * 15, 255);
  EXPECT_GT(18 * 15, 255);
}

TEST(DepthMaps, HalvesOfAWeightAreTheWeight) {
  std::vector<Sums> sums(256);
  std::vector<std::uint8_t> target;
  for (int code = 0; code < 256; ++code)
    for (const int half : {code / 16, code % 16, code / 16, code % 16})
      target.push_back(static_cast<std::uint8_t>(half));
  collect_split(target, sums);
  for (int code = 0; code < 256; ++code) {
    EXPECT_DOUBLE_EQ(sums[static_cast<std::size_t>(code)].weight, code / 255.0);
    EXPECT_DOUBLE_EQ(sums[static_cast<std::size_t>(code)].open, code / 255.0);
  }
}

TEST(DepthMaps, MissLessOfWhatRaysSeeTheFinerTheyAre) {
  Scene scene;
  add_city(scene);
  double before = 1;
  for (const int resolution : {128, 512, 2048}) {
    std::size_t asked = 0, differing = 0;
    for (const int seed : {1, 2, 3, 4}) {
      const std::vector<std::string> settings{"spacing=0.5", "fill=false", "directions=1", "set=random",
                                              "seed=" + std::to_string(seed)};
      const Result maps = bake(scene, "depth_maps", with(settings, {"resolution=" + std::to_string(resolution)}));
      const Result rays = bake(scene, "ray_traced", settings);
      for (std::size_t v = 0; v < rays.baked.values.size(); ++v, ++asked)
        differing += rays.baked.values[v].visibility != maps.baked.values[v].visibility ? 1 : 0;
    }
    const double share = static_cast<double>(differing) / static_cast<double>(asked);
    fmt::print("{:5} texels: {:.3f} % of {} differ\n", resolution, 100 * share, asked);
    EXPECT_LE(share, before);
    before = share;
  }
  EXPECT_LT(before, 0.01);
}

TEST(DepthMaps, CoarseDepthLosesContacts) {
  // A board over a floor: what is under its middle sees nothing, unless that is below a step of depth.
  const std::vector<std::string> formats{"d32", "d24", "d16", "d8"};
  std::map<std::pair<double, std::string>, double> seen;
  for (const double gap : {0.1, 0.03, 0.008, 0.003, 0.001, 1e-4}) {
    Scene scene;
    scene.add_floor(dvec3(0), 1);
    scene.add_floor(dvec3(0, gap, 0), 0.9);  // of no thickness, as maps hold what lies uppermost
    std::string row = fmt::format("{:6} m:", gap);
    for (const std::string& format : formats) {
      const Result result =
          bake(scene, "depth_maps",
               {"spacing=2", "resolution=512", "directions=64", "fill=false", "depth_format=" + format});
      double& middle = seen[{gap, format}] = 1;
      for (const Point& p : points(result.baked, 0))
        if (glm::length(p.position) < 0.01) middle = p.visibility;
      row += fmt::format(" {} {:.3f}", format, middle);
    }
    fmt::print("{}\n", row);
    // What has fewer steps sees less of what is near.
    for (std::size_t f = 1; f < formats.size(); ++f)
      EXPECT_GE((seen[{gap, formats[f]}]), (seen[{gap, formats[f - 1]}])) << gap << ' ' << formats[f];
  }
  // A step of 8 bits is 2.9 m / 255. From 16 bits on, 0.04 mm, what decides is the bias of a texel, 5.7 mm.
  EXPECT_LT((seen[{0.03, "d8"}]), 0.05);
  EXPECT_GT((seen[{0.008, "d8"}]), 0.2);
  for (const double gap : {0.1, 0.03, 0.008, 0.003, 0.001, 1e-4}) {
    EXPECT_NEAR((seen[{gap, "d16"}]), (seen[{gap, "d32"}]), 0.02) << gap;
    EXPECT_NEAR((seen[{gap, "d24"}]), (seen[{gap, "d32"}]), 0.001) << gap;
  }
  EXPECT_LT((seen[{0.008, "d16"}]), 0.05);
  EXPECT_GT((seen[{0.003, "d32"}]), 0.5);
}

/// A box with an atlas of six charts in 3 x 2 cells, each with a margin.
void add_charted_box(Scene& scene, double margin) {
  std::vector<float> positions, uvs;
  std::vector<std::uint32_t> indices;
  for (int axis = 0; axis < 3; ++axis)
    for (const int side : {0, 1}) {
      const auto first = static_cast<std::uint32_t>(positions.size() / 3);
      for (int corner = 0; corner < 4; ++corner) {
        std::array<float, 3> p{};
        const double u = corner == 1 || corner == 2 ? 1 : 0, v = corner >= 2 ? 1 : 0;
        p[static_cast<std::size_t>(axis)] = side == 1 ? 0.5F : -0.5F;
        p[static_cast<std::size_t>((axis + 1) % 3)] = static_cast<float>(u - 0.5);
        p[static_cast<std::size_t>((axis + 2) % 3)] = static_cast<float>(v - 0.5);
        positions.insert(positions.end(), p.begin(), p.end());
        uvs.push_back(static_cast<float>((axis + margin + u * (1 - 2 * margin)) / 3));
        uvs.push_back(static_cast<float>((side + margin + v * (1 - 2 * margin)) / 2));
      }
      for (const std::uint32_t i : {0U, 1U, 2U, 0U, 2U, 3U}) indices.push_back(first + (side == 1 ? i : 3U - i));
    }
  scene.add_mesh(positions, {}, indices, glm::translate(dmat4(1.0), dvec3(0, 0.5, 0)), uvs);
}

TEST(DepthMaps, TexelsCoverWhatBilinearLookupsTouch) {
  Scene scene;
  add_charted_box(scene, 0.1);
  const Result result =
      bake(scene, "depth_maps", {"elements=texels", "spacing=0.05", "directions=64", "resolution=256"});
  const BakedInstance& record = result.baked.instances[0];
  ASSERT_EQ(record.kind, kTexels);
  // A convex body: every texel that a lookup can touch is open, the gutter too.
  for (std::uint32_t i = 0; i < record.width * record.height; ++i)
    EXPECT_GE(result.baked.values[record.first_value + i].visibility, 1 - 1.0 / 64);
}

/// A flat floor in two charts side by side under a ball: both sides of the seam, and slivers of 0.3 texels.
void add_split_floor(Scene& scene, std::uint32_t strips) {
  std::vector<float> positions, uvs, normals;
  std::vector<std::uint32_t> indices;
  for (std::uint32_t s = 0; s < strips; ++s) {
    const double x0 = static_cast<double>(s) / strips, x1 = (s + 1.0) / strips;
    const auto first = static_cast<std::uint32_t>(positions.size() / 3);
    for (const auto& [x, v] : {std::pair(x0, 0.0), std::pair(x1, 0.0), std::pair(x1, 1.0), std::pair(x0, 1.0)}) {
      for (const double c : {4 * x - 2, 0.0, 4 * v - 2}) positions.push_back(static_cast<float>(c));
      for (const float c : {0.0F, 1.0F, 0.0F}) normals.push_back(c);
      // Two charts: the halves lie apart.
      const double u = (s < strips / 2 ? 0.02 + 0.45 * 2 * x : 0.53 + 0.45 * (2 * x - 1));
      uvs.push_back(static_cast<float>(u));
      uvs.push_back(static_cast<float>(0.05 + 0.9 * v));
    }
    for (const std::uint32_t i : {0U, 2U, 1U, 0U, 3U, 2U}) indices.push_back(first + i);
  }
  scene.add_mesh(positions, normals, indices, dmat4(1.0), uvs);
}

double lookup(const Result& result, double u, double v) {
  const BakedInstance& tile = result.baked.instances[0];
  const double x = std::clamp(u * tile.width - 0.5, 0.0, tile.width - 1.0);
  const double y = std::clamp(v * tile.height - 0.5, 0.0, tile.height - 1.0);
  const auto x0 = static_cast<std::uint32_t>(x), y0 = static_cast<std::uint32_t>(y);
  const auto at = [&](std::uint32_t i, std::uint32_t j) {
    return static_cast<double>(
        result.baked.values[tile.first_value + std::min(j, tile.height - 1) * tile.width + std::min(i, tile.width - 1)]
            .visibility);
  };
  return (at(x0, y0) * (1 - x + x0) + at(x0 + 1, y0) * (x - x0)) * (1 - y + y0) +
         (at(x0, y0 + 1) * (1 - x + x0) + at(x0 + 1, y0 + 1) * (x - x0)) * (y - y0);
}

TEST(DepthMaps, TexelsAgreeOnBothSidesOfASeamAndInSlivers) {
  Result coarse;
  for (const std::uint32_t strips : {2U, 256U}) {  // 256: 0.3 texels each, and less
    Scene scene;
    add_split_floor(scene, strips);
    scene.add_sphere(dvec3(0, 1.5, 0), 0.8, 32);
    Result result = bake(scene, "depth_maps", {"elements=texels", "spacing=0.05", "directions=2048", "resolution=512"});
    ASSERT_EQ(result.baked.instances[0].kind, kTexels) << strips;
    // Neighbours differ by whole directions, h / 512 each of 2048: with 256 a seam shows that instead.
    double worst = 0;
    for (int i = 1; i < 64; ++i) {
      const double v = 0.05 + 0.9 * i / 64.0;
      const double left = lookup(result, 0.02 + 0.45, v), right = lookup(result, 0.53, v);
      EXPECT_TRUE(std::isfinite(left) && std::isfinite(right));
      worst = std::max(worst, std::abs(left - right));
    }
    fmt::print("{} strips: {:.4f} at the seam\n", strips, worst);
    EXPECT_LE(worst, 2 / 255.0 + 1e-6) << strips;
    if (strips == 2) {
      coarse = std::move(result);
      continue;
    }
    ASSERT_EQ(result.baked.instances[0].width, coarse.baked.instances[0].width);
    double most = 0;
    for (int i = 0; i < 64; ++i)
      for (int j = 0; j < 64; ++j) {
        const double u = 0.03 + 0.43 * i / 63.0, v = 0.06 + 0.88 * j / 63.0;
        most = std::max(most, std::abs(lookup(result, u, v) - lookup(coarse, u, v)));
      }
    fmt::print("slivers: {:.4f} from the whole chart\n", most);
    EXPECT_LE(most, 1 / 255.0);
  }
}

TEST(DepthMaps, WhatLacksCoordinatesOfItsOwnGetsALattice) {
  Scene scene;
  scene.add_box(dvec3(-1), dvec3(1));  // no coordinates at all
  const Result result = bake(scene, "depth_maps", {"elements=texels", "spacing=0.5", "directions=16"});
  EXPECT_EQ(result.baked.instances[0].kind, kLattice);
}

TEST(DepthMaps, BentNormalsLeanAwayFromWhatOccludes) {
  Scene scene;
  scene.add_floor(dvec3(0, 0, 1), 1);
  scene.add_box(dvec3(-2, 0, -0.2), dvec3(2, 2, 0));
  const Result result = bake(scene, "depth_maps", {"spacing=0.25", "directions=256", "resolution=512"});
  for (const Point& p : points(result.baked, 0)) {
    if (std::abs(p.position.x) > 0.01 || std::abs(p.position.z) > 0.9) continue;
    EXPECT_GT(p.bent.z, 0.1);
    EXPECT_NEAR(p.bent.x, 0, 0.02);
    EXPECT_GT(p.bent.y, 0.5);
  }
}

}  // namespace
