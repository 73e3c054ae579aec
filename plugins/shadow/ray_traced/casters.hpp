// SPDX-License-Identifier: Apache-2.0
// The scene's triangles -> what ray_traced.glsl walks: nodes, corners in the leaves' order, alpha masks as bits.
#pragma once

#include "bvh.hpp"

#include <heddle/plugin.h>

#include <string>

namespace ray_traced_shadow {

/// Three uvec4.
struct Triangle {
  std::array<float, 3> a;
  float uncertain;  // metres by which the corners may be off
  std::array<float, 3> b;
  std::uint32_t mask;  // 0: solid; else 1 + its first word, and 2^28 times log2 of the rows
  std::array<float, 3> c;
  std::uint32_t number;  // in the snapshot
};
static_assert(sizeof(Triangle) == 48, "three uvec4, as ray_traced.glsl reads them");

struct Casters {
  bvh::Tree tree;
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> masks;
  std::array<float, 4> ball{};  // holds all triangles: centre and radius, metres in the snapshot's frame
};

/// Of a storage buffer that every device has (VkPhysicalDeviceLimits::maxStorageBufferRange is 2^27 at least).
inline constexpr std::size_t kMostBytes = std::size_t{1} << 27U;

/// Whoever casts: masked triangles as 4^mask_levels micro-triangles, of which each is there or not by the alpha at its
/// middle. Triangles that are not finite or have no area cast nothing. False: `error` says why.
bool make_casters(bvh::Builder& builder, const heddle_snapshot& snapshot, heddle_alpha_test alpha_test,
                  std::uint32_t mask_levels, Casters& out, std::string& error);

}  // namespace ray_traced_shadow
