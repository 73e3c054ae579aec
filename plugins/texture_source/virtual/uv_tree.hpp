// SPDX-License-Identifier: Apache-2.0
// The scene's surfaces that show a texture, and a view -> the tiles that the view needs, before a pixel has asked: a
// quad-tree over the texture whose nodes know where in the world their part of it lies. It grows where views need it.
// Source  Mittring 2008, "Advanced Virtual Texture Topics": quad-tree in texture space, lambda = log2(texels a metre
// times
//         distance over focal length), split while lambda is below the level
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

#include "residency.hpp"

namespace heddle::virtual_texture {

using Point3 = std::array<double, 3>;

struct TexturedCorner {
  Point3 position{};              // metres, in the scene
  std::array<double, 2> texel{};  // of level 0, of the whole texture, before any wrapping
};

/// What looks: pixels see it in perspective.
struct Looker {
  Point3 origin{};                   // in the scene
  std::array<Point3, 3> axes{};      // right, up, backwards, unit
  std::array<double, 2> tangents{};  // of half the angle of view, across and down
  double focal_px = 1;               // pixels that a tangent of 1 spans
  double near_plane = 1e-3;          // metres
  bool ignores_direction = false;    // also what lies behind: a camera that turns finds all there
};

class UvTree {
 public:
  /// address as texture_tiles has it: 0 wrap, 1 mirror, 2 clamp. taps: along a footprint's long axis, at most.
  UvTree(std::uint32_t texture, std::uint32_t extent, std::uint32_t tile, std::uint32_t address, std::uint32_t taps)
      : texture_(texture), extent_(extent), tile_(tile), address_(address), taps_(taps) {
    root_level_ = static_cast<std::uint32_t>(std::countr_zero(extent / tile));
    nodes_.emplace_back();  // number 0 is no node
  }

  /// Parts beyond the texture's sides are folded to where their texels come from. What lies in one place of the texture
  /// and far apart in the world is to be of different sheets: each has boxes of its own, and so has each repetition.
  void add(const std::array<TexturedCorner, 3>& corners, std::uint32_t sheet = 0) {
    const double density = density_of(corners);
    // No place in the texture, or none in the world: no pixel asks for it.
    if (!(density > 0) || !std::isfinite(density)) return;
    Polygon whole{{corners.begin(), corners.end()}, density};
    if (address_ == kClampMode) {
      add_clamped(whole, sheet);
      return;
    }
    std::array<std::int64_t, 2> first{}, last{};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      double low = corners[0].texel[axis], high = low;
      for (const TexturedCorner& corner : corners) {
        low = std::min(low, corner.texel[axis]);
        high = std::max(high, corner.texel[axis]);
      }
      first[axis] = static_cast<std::int64_t>(std::floor(low / extent_));
      last[axis] = std::max(first[axis], static_cast<std::int64_t>(std::ceil(high / extent_)) - 1);
    }
    if ((last[0] - first[0] + 1) * (last[1] - first[1] + 1) > kMostRepeats) {
      // Repeated so often that all of the texture lies all over it.
      whole.is_everywhere = true;
      put(std::move(whole), {sheet, 0, 0});
      return;
    }
    for (std::int64_t y = first[1]; y <= last[1]; ++y)
      for (std::int64_t x = first[0]; x <= last[0]; ++x) {
        Polygon part =
            clipped(clipped(whole, 0, static_cast<double>(x) * extent_, static_cast<double>(x + 1) * extent_), 1,
                    static_cast<double>(y) * extent_, static_cast<double>(y + 1) * extent_);
        for (TexturedCorner& corner : part.corners) {
          corner.texel[0] = folded(corner.texel[0], x);
          corner.texel[1] = folded(corner.texel[1], y);
        }
        put(std::move(part), {sheet, x, y});
      }
  }

  /// Appends what `looker` needs if levels are rounded up less `bias`, at most `most` tiles, coarse ones first. Whole
  /// sheets: their nearest place says the level of all of it, and no node is looked at by itself.
  void query(const Looker& looker, double bias, std::size_t most, std::vector<Tile>& out,
             bool has_whole_sheets = false) {
    struct Visit {
      std::uint32_t node = 0;
      double wanted = 0;  // level
    };
    const auto wanted_of = [&](std::uint32_t node) {
      return std::max(std::ceil(least_lambda(nodes_[node], looker) - bias), 0.0);
    };
    std::vector<Visit> level, finer;
    for (const auto& [key, root] : roots_) level.push_back({root, wanted_of(root)});
    visited_ = roots_.size();
    const std::size_t end = out.size() + most;
    while (!level.empty()) {
      finer.clear();
      for (const auto& [index, wanted] : level) {
        if (out.size() >= end) return;
        if (wanted == std::numeric_limits<double>::infinity()) continue;
        const Node node = head(nodes_[index]);
        if (wanted <= node.level || node.level == root_level_) out.push_back({texture_, node.level, node.x, node.y});
        if (node.level == 0 || wanted >= node.level) continue;
        grow(index);
        for (std::uint32_t i = 0; i < 4; ++i) {
          const std::uint32_t child = nodes_[index].children[i];
          if (child == 0) continue;
          visited_ += has_whole_sheets ? 0 : 1;
          finer.push_back({child, has_whole_sheets ? wanted : wanted_of(child)});
        }
      }
      std::swap(level, finer);
    }
  }
  /// The same by a map over the texture, whose texels know where in the world they lie: each says which level it needs,
  /// of those that lie one over the other the finest counts, and tiles below a texel are all wanted if it needs them.
  /// As much work for one view as for another.
  void query_map(const Looker& looker, double bias, std::size_t most, std::vector<Tile>& out) {
    const std::uint32_t map_level = root_level_ > kMapLevels ? root_level_ - kMapLevels : 0;
    if (map_.empty()) {
      for (const auto& [key, root] : roots_) map_.push_back(root);
      for (std::uint32_t level = root_level_; level > map_level; --level) {
        std::vector<std::uint32_t> finer;
        for (const std::uint32_t index : map_) {
          grow(index);
          for (const std::uint32_t child : nodes_[index].children)
            if (child != 0) finer.push_back(child);
        }
        map_ = std::move(finer);
      }
    }
    visited_ = map_.size();
    std::map<std::pair<std::uint32_t, std::uint32_t>, double> texels;
    for (const std::uint32_t index : map_) {
      const double lambda = least_lambda(nodes_[index], looker);
      const auto found = texels.try_emplace({nodes_[index].x, nodes_[index].y}, lambda).first;
      found->second = std::min(found->second, lambda);
    }
    std::map<std::uint64_t, Tile> named;
    for (const auto& [place, lambda] : texels) {
      if (lambda == std::numeric_limits<double>::infinity()) continue;
      const auto level =
          static_cast<std::uint32_t>(std::clamp(std::ceil(lambda - bias), 0.0, static_cast<double>(root_level_)));
      const std::uint32_t down = level < map_level ? map_level - level : 0,
                          up = level > map_level ? level - map_level : 0;
      for (std::uint32_t y = 0; y < 1U << down; ++y)
        for (std::uint32_t x = 0; x < 1U << down && named.size() < most; ++x) {
          const Tile tile{texture_, level, (place.first >> up << down) + x, (place.second >> up << down) + y};
          named.try_emplace(tile.key(), tile);
        }
    }
    // Keys begin with the level.
    for (auto tile = named.rbegin(); tile != named.rend(); ++tile) out.push_back(tile->second);
  }
  [[nodiscard]] std::size_t node_count() const { return nodes_.size(); }
  /// Nodes whose level was worked out by the last query.
  [[nodiscard]] std::size_t visited() const { return visited_; }

 private:
  static constexpr std::uint32_t kMirrorMode = 1, kClampMode = 2;
  static constexpr std::int64_t kMostRepeats = 64;
  static constexpr std::uint32_t kMapLevels = 6;  // of the tree that the map is below its root: 64 x 64 texels

  struct Polygon {
    std::vector<TexturedCorner> corners;
    double density = 0;  // texels of level 0 that a pixel's metre covers, at least
    bool is_everywhere = false;
  };
  struct Node {
    std::uint32_t level = 0, x = 0, y = 0;
    std::vector<std::uint32_t> polygons;
    std::array<std::uint32_t, 4> children{};  // 0: nothing lies there, or not grown yet
    Point3 low{std::numeric_limits<double>::max(), std::numeric_limits<double>::max(),
               std::numeric_limits<double>::max()};
    Point3 high{std::numeric_limits<double>::lowest(), std::numeric_limits<double>::lowest(),
                std::numeric_limits<double>::lowest()};
    double density = std::numeric_limits<double>::infinity();
    bool is_grown = false;
  };
  static Node head(const Node& node) {
    Node out;
    out.level = node.level, out.x = node.x, out.y = node.y;
    return out;
  }

  /// What `texture_footprint` makes of a pixel that sees one metre of the surface from in front: seen at an angle it
  /// covers more. Of the two stretches s >= t of the map from metres to texels.
  [[nodiscard]] double density_of(const std::array<TexturedCorner, 3>& corners) const {
    std::array<Point3, 2> edge{};
    std::array<std::array<double, 2>, 2> texel{};
    for (std::size_t i = 0; i < 2; ++i) {
      for (std::size_t c = 0; c < 3; ++c) edge[i][c] = corners[i + 1].position[c] - corners[0].position[c];
      for (std::size_t c = 0; c < 2; ++c) texel[i][c] = corners[i + 1].texel[c] - corners[0].texel[c];
    }
    // Along the first edge, and at right angles to it in the triangle's plane.
    const double along = std::sqrt(dot(edge[0], edge[0]));
    if (!(along > 0)) return 0;
    const double shift = dot(edge[0], edge[1]) / along;
    const double away2 = dot(edge[1], edge[1]) - shift * shift;
    if (!(away2 > 0)) return 0;
    const double away = std::sqrt(away2);
    std::array<std::array<double, 2>, 2> map{};  // texels a metre
    for (std::size_t c = 0; c < 2; ++c) {
      map[0][c] = texel[0][c] / along;
      map[1][c] = (texel[1][c] - map[0][c] * shift) / away;
    }
    const double square = map[0][0] * map[0][0] + map[0][1] * map[0][1] + map[1][0] * map[1][0] + map[1][1] * map[1][1];
    const double determinant = std::abs(map[0][0] * map[1][1] - map[0][1] * map[1][0]);
    const double longer =
        std::sqrt(0.5 * (square + std::sqrt(std::max(square * square - 4 * determinant * determinant, 0.0))));
    if (!(longer > 0)) return 0;
    // With one tap the longer of the derivatives along x and y counts: no shorter than their quadratic mean.
    if (taps_ <= 1) return std::sqrt(0.5 * square);
    return std::max(determinant / longer, longer / taps_);
  }
  static double dot(const Point3& a, const Point3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

  [[nodiscard]] double folded(double texel, std::int64_t cell) const {
    const double inside = std::clamp(texel - static_cast<double>(cell) * extent_, 0.0, static_cast<double>(extent_));
    return address_ == kMirrorMode && (cell & 1) != 0 ? extent_ - inside : inside;
  }

  /// Between two values of one coordinate.
  static Polygon clipped(const Polygon& polygon, std::size_t axis, double low, double high) {
    Polygon out{polygon.corners, polygon.density};
    for (const auto& [limit, sign] : {std::pair(low, 1.0), std::pair(high, -1.0)}) {
      const std::vector<TexturedCorner> from = std::move(out.corners);
      out.corners.clear();
      for (std::size_t i = 0; i < from.size(); ++i) {
        const TexturedCorner &a = from[i], &b = from[(i + 1) % from.size()];
        const double at_a = sign * (a.texel[axis] - limit), at_b = sign * (b.texel[axis] - limit);
        if (at_a >= 0) out.corners.push_back(a);
        if ((at_a > 0 && at_b < 0) || (at_a < 0 && at_b > 0)) {
          const double t = at_a / (at_a - at_b);
          TexturedCorner cut;
          for (std::size_t c = 0; c < 3; ++c) cut.position[c] = a.position[c] + t * (b.position[c] - a.position[c]);
          for (std::size_t c = 0; c < 2; ++c) cut.texel[c] = a.texel[c] + t * (b.texel[c] - a.texel[c]);
          cut.texel[axis] = limit;
          out.corners.push_back(cut);
        }
      }
    }
    return out;
  }

  /// In nine parts: what is beyond a side shows the texels at it.
  void add_clamped(const Polygon& whole, std::uint32_t sheet) {
    constexpr double kFar = std::numeric_limits<double>::max();
    const double extent = extent_;
    const std::array<std::pair<double, double>, 3> parts = {{{-kFar, 0.0}, {0.0, extent}, {extent, kFar}}};
    for (const auto& [left, right] : parts)
      for (const auto& [top, bottom] : parts) {
        Polygon part = clipped(clipped(whole, 0, left, right), 1, top, bottom);
        for (TexturedCorner& corner : part.corners)
          for (double& texel : corner.texel) texel = std::clamp(texel, 0.0, extent);
        put(std::move(part), {sheet, left < 0 ? -1 : left > 0 ? 1 : 0, top < 0 ? -1 : top > 0 ? 1 : 0});
      }
  }

  using RootKey = std::tuple<std::uint32_t, std::int64_t, std::int64_t>;  // sheet, repetition

  void put(Polygon polygon, const RootKey& key) {
    if (polygon.corners.empty()) return;
    map_.clear();
    const auto [found, is_new] = roots_.try_emplace(key, static_cast<std::uint32_t>(nodes_.size()));
    if (is_new) {
      nodes_.emplace_back();
      nodes_.back().level = root_level_;
    }
    Node& root = nodes_[found->second];
    // Children that have grown do not know it.
    root.children = {};
    root.is_grown = false;
    enclose(root, polygon);
    root.polygons.push_back(static_cast<std::uint32_t>(polygons_.size()));
    polygons_.push_back(std::move(polygon));
  }

  static void enclose(Node& node, const Polygon& polygon) {
    for (const TexturedCorner& corner : polygon.corners)
      for (std::size_t c = 0; c < 3; ++c) {
        node.low[c] = std::min(node.low[c], corner.position[c]);
        node.high[c] = std::max(node.high[c], corner.position[c]);
      }
    node.density = std::min(node.density, polygon.density);
  }

  void grow(std::uint32_t index) {
    if (nodes_[index].is_grown) return;
    nodes_[index].is_grown = true;
    const Node parent = nodes_[index];
    const double side = static_cast<double>(std::uint64_t{tile_} << (parent.level - 1));
    for (std::uint32_t i = 0; i < 4; ++i) {
      Node child = {parent.level - 1, 2 * parent.x + (i & 1U), 2 * parent.y + (i >> 1U), {}, {}};
      const double left = child.x * side, top = child.y * side;
      for (const std::uint32_t number : parent.polygons) {
        const Polygon& polygon = polygons_[number];
        if (polygon.is_everywhere) {
          enclose(child, polygon);
          child.polygons.push_back(number);
          continue;
        }
        const auto is_beyond = [&](std::size_t axis, double low) {
          return std::ranges::all_of(polygon.corners, [&](const auto& corner) { return corner.texel[axis] < low; }) ||
                 std::ranges::all_of(polygon.corners,
                                     [&](const auto& corner) { return corner.texel[axis] > low + side; });
        };
        if (is_beyond(0, left) || is_beyond(1, top)) continue;
        const Polygon part = clipped(clipped(polygon, 0, left, left + side), 1, top, top + side);
        if (part.corners.empty()) continue;
        enclose(child, part);
        child.polygons.push_back(number);
      }
      if (child.polygons.empty()) continue;
      nodes_[index].children[i] = static_cast<std::uint32_t>(nodes_.size());
      nodes_.push_back(std::move(child));
    }
    // The children have what is needed of it; a root's stay, for `put`.
    if (parent.level != root_level_) nodes_[index].polygons = {};
  }

  /// The least level that a pixel could ask for of what lies in the node's box; infinite if it is out of view.
  [[nodiscard]] static double least_lambda(const Node& node, const Looker& looker) {
    if (node.low[0] > node.high[0]) return std::numeric_limits<double>::infinity();
    double nearest2 = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double beyond = std::max({node.low[c] - looker.origin[c], looker.origin[c] - node.high[c], 0.0});
      nearest2 += beyond * beyond;
    }
    double reach = std::max(std::sqrt(nearest2), looker.near_plane);
    if (!looker.ignores_direction) {
      double least_depth = std::numeric_limits<double>::max(), farthest = 0;
      std::array<double, 2> inside_low{}, inside_high{};
      inside_low.fill(-std::numeric_limits<double>::max());
      inside_high.fill(-std::numeric_limits<double>::max());
      double deepest = -std::numeric_limits<double>::max();
      for (std::uint32_t corner = 0; corner < 8; ++corner) {
        Point3 to{};
        for (std::size_t c = 0; c < 3; ++c)
          to[c] = ((corner >> c & 1U) != 0 ? node.high[c] : node.low[c]) - looker.origin[c];
        const double depth = -dot(to, looker.axes[2]);
        deepest = std::max(deepest, depth);
        least_depth = std::min(least_depth, depth);
        farthest = std::max(farthest, std::sqrt(dot(to, to)));
        for (std::size_t axis = 0; axis < 2; ++axis) {
          const double at = dot(to, looker.axes[axis]), edge = depth * looker.tangents[axis];
          inside_low[axis] = std::max(inside_low[axis], edge + at);
          inside_high[axis] = std::max(inside_high[axis], edge - at);
        }
      }
      const bool is_out = deepest < looker.near_plane || inside_low[0] < 0 || inside_low[1] < 0 || inside_high[0] < 0 ||
                          inside_high[1] < 0;
      if (is_out) return std::numeric_limits<double>::infinity();
      // Off the axis a pixel sees a smaller angle: cos a times its part of a metre at depth z, and no less than
      // z^2 / r of a box whose nearest depth is z and whose farthest corner is r away.
      const double depth = std::max(least_depth, looker.near_plane);
      const double most = 1 + looker.tangents[0] * looker.tangents[0] + looker.tangents[1] * looker.tangents[1];
      reach = std::max(depth * depth / std::max(farthest, depth), std::max(reach / most, looker.near_plane));
    }
    return std::log2(node.density * reach / looker.focal_px);
  }

  std::uint32_t texture_, extent_, tile_, address_, taps_, root_level_ = 0;
  std::vector<Polygon> polygons_;
  std::vector<Node> nodes_;
  std::map<RootKey, std::uint32_t> roots_;
  std::vector<std::uint32_t> map_;  // nodes that are its texels; empty: not made yet
  std::size_t visited_ = 0;
};

}  // namespace heddle::virtual_texture
