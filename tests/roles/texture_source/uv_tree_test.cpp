// SPDX-License-Identifier: Apache-2.0
// The quad-tree in texture space against rays: it names every tile that a pixel asks for, and not many more.
#include "texture_source/virtual/uv_tree.hpp"

#include <gtest/gtest.h>
#include <glm/glm.hpp>

#include <cstdio>
#include <map>
#include <random>

namespace {

using namespace heddle::virtual_texture;
using glm::dvec2;
using glm::dvec3;

/// A parallelogram in the world and in the texture.
struct Sheet {
  dvec3 corner, across, down;
  dvec2 texel, texel_across, texel_down;  // of level 0, unwrapped
};

struct Setting {
  const char* name;
  std::uint32_t extent, tile, address, taps;
  std::vector<Sheet> sheets;
};

UvTree tree_of(const Setting& setting) {
  UvTree tree(0, setting.extent, setting.tile, setting.address, setting.taps);
  for (std::uint32_t number = 0; number < setting.sheets.size(); ++number) {
    const Sheet& s = setting.sheets[number];
    const auto corner = [&](double u, double v) {
      const dvec3 p = s.corner + u * s.across + v * s.down;
      const dvec2 t = s.texel + u * s.texel_across + v * s.texel_down;
      return TexturedCorner{{p.x, p.y, p.z}, {t.x, t.y}};
    };
    tree.add({corner(0, 0), corner(0, 1), corner(1, 1)}, number);
    tree.add({corner(0, 0), corner(1, 1), corner(1, 0)}, number);
  }
  return tree;
}

Looker looker_at(const dvec3& origin, const dvec3& target, double tangent_y, std::uint32_t width,
                 std::uint32_t height) {
  const dvec3 back = glm::normalize(origin - target);
  const dvec3 right = glm::normalize(glm::cross(dvec3(0, 1, 0), back)), up = glm::cross(back, right);
  Looker looker;
  looker.origin = {origin.x, origin.y, origin.z};
  looker.axes = {{{right.x, right.y, right.z}, {up.x, up.y, up.z}, {back.x, back.y, back.z}}};
  looker.tangents = {tangent_y * width / height, tangent_y};
  looker.focal_px = 0.5 * height / tangent_y;
  return looker;
}

double folded(double texel, double extent, std::uint32_t address) {
  if (address == 2) return std::clamp(texel, 0.0, extent - 1e-9);
  const double cell = std::floor(texel / extent), inside = texel - cell * extent;
  return address == 1 && std::fmod(std::abs(cell), 2) == 1 ? extent - inside - 1e-9 : inside;
}

/// Weights of tiles: how many pixels ask for each, by the formulas of texture_footprint.glsl in float64.
std::map<std::uint64_t, std::uint32_t> asked_by_pixels(const Setting& setting, const Looker& looker,
                                                       std::uint32_t width, std::uint32_t height) {
  std::map<std::uint64_t, std::uint32_t> asked;
  const auto vec = [](const Point3& p) { return dvec3(p[0], p[1], p[2]); };
  const dvec3 origin = vec(looker.origin), right = vec(looker.axes[0]), up = vec(looker.axes[1]),
              back = vec(looker.axes[2]);
  for (std::uint32_t py = 0; py < height; ++py) {
    for (std::uint32_t px = 0; px < width; ++px) {
      const auto ray = [&](double x, double y) {
        return (2 * x / width - 1) * looker.tangents[0] * right + (1 - 2 * y / height) * looker.tangents[1] * up - back;
      };
      double nearest = 1e30;
      const Sheet* hit = nullptr;
      const auto meet = [&](const Sheet& s, const dvec3& direction, dvec2& at) {
        const dvec3 normal = glm::cross(s.across, s.down);
        const double t = glm::dot(s.corner - origin, normal) / glm::dot(direction, normal);
        const dvec3 p = origin + t * direction - s.corner;
        const double aa = glm::dot(s.across, s.across), ab = glm::dot(s.across, s.down), bb = glm::dot(s.down, s.down);
        const double pa = glm::dot(p, s.across), pb = glm::dot(p, s.down), d = aa * bb - ab * ab;
        at = {(pa * bb - pb * ab) / d, (pb * aa - pa * ab) / d};
        return t;
      };
      for (const Sheet& s : setting.sheets) {
        dvec2 at;
        const double t = meet(s, ray(px + 0.5, py + 0.5), at);
        if (t > looker.near_plane && t < nearest && at.x >= 0 && at.y >= 0 && at.x <= 1 && at.y <= 1) {
          nearest = t;
          hit = &s;
        }
      }
      if (hit == nullptr) continue;
      const auto texel = [&](double x, double y) {
        dvec2 at;
        meet(*hit, ray(x, y), at);
        return hit->texel + at.x * hit->texel_across + at.y * hit->texel_down;
      };
      const dvec2 here = texel(px + 0.5, py + 0.5);
      const double h = 1e-3;
      const dvec2 dx = (texel(px + 0.5 + h, py + 0.5) - here) / h, dy = (texel(px + 0.5, py + 0.5 + h) - here) / h;
      double lambda = 0;
      if (setting.taps <= 1) {
        lambda = std::log2(std::max(glm::length(dx), glm::length(dy)));
      } else {
        const double square = glm::dot(dx, dx) + glm::dot(dy, dy), det = std::abs(dx.x * dy.y - dx.y * dy.x);
        const double a = std::sqrt(0.5 * (square + std::sqrt(std::max(square * square - 4 * det * det, 0.0))));
        lambda = std::log2(std::max(det / a, a / setting.taps));
      }
      const auto root = static_cast<double>(std::countr_zero(setting.extent / setting.tile));
      const auto level = static_cast<std::uint32_t>(std::clamp(std::ceil(lambda), 0.0, root));
      const double side = static_cast<double>(setting.tile << level);
      const Tile tile{0, level, static_cast<std::uint32_t>(folded(here.x, setting.extent, setting.address) / side),
                      static_cast<std::uint32_t>(folded(here.y, setting.extent, setting.address) / side)};
      ++asked[tile.key()];
    }
  }
  return asked;
}

TEST(UvTree, NamesEveryTileThatAPixelAsksForAndFewOthers) {
  const Sheet floor{{-20, 0, -20}, {40, 0, 0}, {0, 0, 40}, {0, 0}, {16384, 0}, {0, 16384}};
  const Sheet wall{{-20, 12, -20}, {40, 0, 0}, {0, -12, 0}, {-3000, 500}, {9000, 0}, {100, 5000}};
  Sheet stretched = floor;
  stretched.texel_down = {0, 2048};
  const Setting settings[] = {
      {"floor, 4 taps", 16384, 128, 0, 4, {floor}},
      {"floor, 1 tap", 16384, 128, 0, 1, {floor}},
      {"floor and wall, wrapped", 16384, 128, 0, 4, {floor, wall}},
      {"floor and wall, mirrored", 4096, 64, 1, 4, {floor, wall}},
      {"floor and wall, clamped", 4096, 128, 2, 8, {floor, wall}},
      {"eight times as long as wide", 16384, 128, 0, 4, {stretched}},
  };
  std::mt19937 random(6);
  const auto uniform = [&](double a, double b) { return a + (b - a) * static_cast<double>(random()) * 0x1p-32; };
  constexpr std::uint32_t kWidth = 96, kHeight = 54;
  for (const Setting& setting : settings) {
    UvTree tree = tree_of(setting), draws = tree_of(setting), map = tree_of(setting);
    std::uint64_t missed_by_map = 0, named_by_map = 0;
    std::size_t texels = 0;
    std::uint64_t weight = 0, missed = 0, wanted = 0, named = 0, visited = 0, missed_by_draws = 0, named_by_draws = 0;
    for (int i = 0; i < 30; ++i) {
      const dvec3 eye(uniform(-18, 18), std::exp(uniform(-2, 2.5)), uniform(-18, 18));
      const Looker looker =
          looker_at(eye, {uniform(-18, 18), uniform(-1, 3), uniform(-25, 10)}, uniform(0.3, 0.8), kWidth, kHeight);
      std::vector<Tile> found;
      tree.query(looker, 0, 1 << 20, found);
      visited += tree.visited();
      std::map<std::uint64_t, Tile> all;
      for (const Tile& tile : found) all.try_emplace(tile.key(), tile);
      named += all.size();
      for (Tile tile : found)
        while (tile.level < 7 && all.try_emplace((tile = tile.parent()).key(), tile).second) {
        }
      std::vector<Tile> by_map;
      map.query_map(looker, 0, 1 << 20, by_map);
      EXPECT_TRUE(i == 0 || map.visited() == texels) << "the same work for every view";
      texels = map.visited();
      named_by_map += by_map.size();
      std::map<std::uint64_t, Tile> all_by_map;
      for (std::size_t t = 0; t < by_map.size(); ++t) {
        EXPECT_TRUE(t == 0 || by_map[t].level <= by_map[t - 1].level) << "coarse ones first";
        for (Tile tile = by_map[t]; all_by_map.try_emplace(tile.key(), tile).second && tile.level < 7;)
          tile = tile.parent();
      }
      // A distance for each draw: what is named is no coarser, so it names each tile or one below it.
      std::vector<Tile> by_draws;
      draws.query(looker, 0, 1 << 20, by_draws, true);
      EXPECT_LE(draws.visited(), setting.sheets.size() * 64);
      std::map<std::uint64_t, Tile> all_by_draws;
      for (const Tile& tile : by_draws) all_by_draws.try_emplace(tile.key(), tile);
      named_by_draws += all_by_draws.size();
      for (Tile tile : by_draws)
        while (tile.level < 7 && all_by_draws.try_emplace((tile = tile.parent()).key(), tile).second) {
        }
      for (const auto& [key, pixels] : asked_by_pixels(setting, looker, kWidth, kHeight)) {
        missed_by_map += all_by_map.contains(key) ? 0U : pixels;
        missed_by_draws += all_by_draws.contains(key) ? 0U : pixels;
        weight += pixels;
        missed += all.contains(key) ? 0U : pixels;
        ++wanted;
      }
    }
    std::printf(
        "%s: %.3f %% of weight missed, %.1f tiles named for each that pixels asked for, %.0f nodes a view, %d grown\n",
        setting.name, 100.0 * static_cast<double>(missed) / static_cast<double>(weight),
        static_cast<double>(named) / static_cast<double>(wanted), static_cast<double>(visited) / 30,
        static_cast<int>(tree.node_count()));
    std::printf("  by draws: %.3f %%, %.0f tiles named for each\n",
                100.0 * static_cast<double>(missed_by_draws) / static_cast<double>(weight),
                static_cast<double>(named_by_draws) / static_cast<double>(wanted));
    std::printf("  by map: %.3f %%, %.1f tiles named for each, %d places\n",
                100.0 * static_cast<double>(missed_by_map) / static_cast<double>(weight),
                static_cast<double>(named_by_map) / static_cast<double>(wanted), static_cast<int>(texels));
    EXPECT_EQ(missed_by_draws, 0U) << setting.name;
    EXPECT_EQ(missed_by_map, 0U) << setting.name;
    EXPECT_LE(static_cast<double>(missed), 0.005 * static_cast<double>(weight)) << setting.name;
    // The bound on a pixel's part of a metre is at most 1 / cos^2 off at the picture's corners, a level and a bit.
    EXPECT_LE(static_cast<double>(named), 8 * static_cast<double>(wanted)) << setting.name;
    EXPECT_GT(weight, 20000U);
  }
}

TEST(UvTree, GrowsWhereItIsLookedAtAndForgetsNothingThatIsAddedLater) {
  const Sheet near{{-1, 0, -1}, {2, 0, 0}, {0, 0, 2}, {0, 0}, {1024, 0}, {0, 1024}};
  Setting setting{"", 65536, 128, 0, 4, {near}};
  UvTree tree = tree_of(setting);
  const Looker down = looker_at({0, 2, 0.001}, {0, 0, 0}, 0.6, 64, 64);
  std::vector<Tile> found;
  tree.query(down, 0, 1 << 20, found);
  EXPECT_LT(tree.node_count(), 500U) << "of 349,525";
  const std::size_t before = found.size();
  const auto corner = [](double x, double z, double u, double v) { return TexturedCorner{{x, 0.5, z}, {u, v}}; };
  tree.add({corner(-1, -1, 40000, 40000), corner(-1, 1, 40000, 41000), corner(1, 1, 41000, 41000)});
  found.clear();
  tree.query(down, 0, 1 << 20, found);
  EXPECT_GT(found.size(), before);
  found.clear();
  tree.query(down, 0, 5, found);
  EXPECT_EQ(found.size(), 5U) << "no more than asked for, coarse ones first";
  EXPECT_EQ(found[0].level, 9U);
}

TEST(UvTree, WhatHasNoAreaOrNoNumberIsAskedForByNobody) {
  UvTree tree(0, 4096, 128, 0, 4);
  const double nan = std::nan("");
  tree.add({TexturedCorner{{0, 0, 0}, {0, 0}}, TexturedCorner{{0, 0, 0}, {1, 0}}, TexturedCorner{{0, 0, 0}, {0, 1}}});
  tree.add({TexturedCorner{{0, 0, 0}, {5, 5}}, TexturedCorner{{1, 0, 0}, {5, 5}}, TexturedCorner{{0, 1, 0}, {5, 5}}});
  tree.add({TexturedCorner{{nan, 0, 0}, {0, 0}}, TexturedCorner{{1, 0, 0}, {1, 0}}, TexturedCorner{{0, 1, 0}, {0, 1}}});
  std::vector<Tile> found;
  tree.query(looker_at({0, 0, 3}, {0, 0, 0}, 0.5, 32, 32), 0, 100, found);
  EXPECT_TRUE(found.empty());
  // Repeated a thousand times along each side: everything, all over it.
  const auto corner = [](double x, double y) { return TexturedCorner{{x, y, 0}, {4096e3 * x, 4096e3 * y}}; };
  tree.add({corner(0, 0), corner(1, 0), corner(0, 1)});
  Looker sharp = looker_at({0.2, 0.2, 0.1}, {0.2, 0.2, 0}, 0.5, 32, 32);
  sharp.focal_px = 1e7;
  tree.query(sharp, 0, 1 << 20, found);
  EXPECT_EQ(found.size(), 1U + 4 + 16 + 64 + 256 + 1024) << "all tiles of all levels";
}

}  // namespace
