// SPDX-License-Identifier: Apache-2.0
// A snapshot to a tree of boxes over the triangles that cast.
#include "casters.hpp"

#include <algorithm>
#include <cmath>

namespace ray_traced_shadow {
namespace {

// The snapshot's corners are float32 of float64: half a unit in the last place. Whoever asks has transformed the same
// corners in float32 (a matrix, and the eye's offset), four roundings; twice that for what both agree on.
constexpr float kUncertainUlps = 8.0F;
constexpr float kHalfUlp = 0x1p-24F;

using Corners = std::array<std::array<float, 3>, 3>;

Corners corners_of(const heddle_snapshot& snapshot, std::uint32_t triangle) {
  Corners corners{};
  for (std::size_t k = 0; k < 3; ++k) {
    const float* position = snapshot.positions + std::size_t{snapshot.indices[std::size_t{triangle} * 3 + k]} * 3;
    std::copy_n(position, 3, corners[k].begin());
  }
  return corners;
}

bool has_area(const Corners& corners) {
  std::array<double, 3> p{}, q{};
  for (std::size_t k = 0; k < 3; ++k) {
    if (!std::isfinite(corners[0][k]) || !std::isfinite(corners[1][k]) || !std::isfinite(corners[2][k])) return false;
    p[k] = static_cast<double>(corners[1][k]) - static_cast<double>(corners[0][k]);
    q[k] = static_cast<double>(corners[2][k]) - static_cast<double>(corners[0][k]);
  }
  return p[1] * q[2] != p[2] * q[1] || p[2] * q[0] != p[0] * q[2] || p[0] * q[1] != p[1] * q[0];
}

bvh::Box box_of(const Corners& corners) {
  bvh::Box box{corners[0], corners[0]};
  for (const auto& corner : corners) {
    for (std::size_t k = 0; k < 3; ++k) {
      box.low[k] = std::min(box.low[k], corner[k]);
      box.high[k] = std::max(box.high[k], corner[k]);
    }
  }
  return box;
}

/// Bits of a triangle's micro-triangles, row by row, in whole words; empty where all are holes. *is_solid: none is.
std::vector<std::uint32_t> mask_of(const heddle_snapshot& snapshot, heddle_alpha_test test, std::uint32_t triangle,
                                   std::uint32_t levels, bool& is_solid) {
  const std::uint32_t side = 1U << levels;
  std::vector<std::uint32_t> bits((std::size_t{side} * side + 31) / 32, 0U);
  std::size_t place = 0, solid = 0;
  for (std::uint32_t row = 0; row < side; ++row) {
    for (std::uint32_t i = 0; i < 2 * (side - row) - 1; ++i, ++place) {
      const float middle = i % 2 == 0 ? 1.0F / 3.0F : 2.0F / 3.0F;
      const float u = (static_cast<float>(i / 2) + middle) / static_cast<float>(side);
      const float v = (static_cast<float>(row) + middle) / static_cast<float>(side);
      if (test(&snapshot, triangle, u, v) == 0) continue;
      bits[place / 32] |= 1U << (place % 32);
      ++solid;
    }
  }
  is_solid = solid == place;
  if (solid == 0) bits.clear();
  return bits;
}

}  // namespace

bool make_casters(bvh::Builder& builder, const heddle_snapshot& snapshot, heddle_alpha_test alpha_test,
                  std::uint32_t mask_levels, Casters& out, std::string& error) {
  out = {};
  std::vector<bvh::Box> boxes;
  std::vector<Triangle> triangles;
  for (std::uint32_t i = 0; i < snapshot.triangle_count; ++i) {
    if ((snapshot.flags[i] & HEDDLE_SURFACE_CASTS_SHADOW) == 0) continue;
    const Corners corners = corners_of(snapshot, i);
    if (!has_area(corners)) continue;
    std::uint32_t mask = 0;
    if ((snapshot.flags[i] & HEDDLE_SURFACE_MASKED) != 0 && alpha_test != nullptr) {
      bool is_solid = false;
      const auto bits = mask_of(snapshot, alpha_test, i, mask_levels, is_solid);
      if (bits.empty()) continue;
      if (!is_solid) {
        mask = static_cast<std::uint32_t>(out.masks.size() + 1) | mask_levels << 28U;
        out.masks.insert(out.masks.end(), bits.begin(), bits.end());
      }
    }
    float largest = 0;
    for (const auto& corner : corners) {
      for (const float x : corner) largest = std::max(largest, std::abs(x));
    }
    triangles.push_back({corners[0], kUncertainUlps * kHalfUlp * largest, corners[1], mask, corners[2], i});
    boxes.push_back(box_of(corners));
    if (triangles.size() * sizeof(Triangle) > kMostBytes || out.masks.size() * 4 > kMostBytes) {
      error =
          "the triangles that cast, or their alpha masks, need more than 128 MiB, which is all that shaders can "
          "read of a buffer; for masks, lower mask_levels";
      return false;
    }
  }
  if (!builder.build(boxes, out.tree)) {
    error = builder.error();
    return false;
  }
  out.triangles.reserve(triangles.size());
  for (const std::uint32_t place : out.tree.order) out.triangles.push_back(triangles[place]);
  if (!out.tree.nodes.empty()) {
    const bvh::Node& root = out.tree.nodes.front();
    float squared = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      out.ball[k] = 0.5F * root.low[k] + 0.5F * root.high[k];
      const float half = 0.5F * root.high[k] - 0.5F * root.low[k];
      squared += half * half;
    }
    out.ball[3] = 1.001F * std::sqrt(squared);
  }
  return true;
}

}  // namespace ray_traced_shadow
