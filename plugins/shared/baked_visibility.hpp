// SPDX-License-Identifier: Apache-2.0
// The artifact of role bake_visibility: for each instance of the scene, values on the surface of its mesh, as bytes;
// and back, checked. Pure.
//
// The bytes are a BakedHead and, each after the other, its instances, triangles, lattice and values. A value belongs to
// a point of a lattice on a triangle (barycentric steps of 1 / resolution; resolution 1: its corners), or to a texel of
// an instance's own tile.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace baked_visibility {

inline constexpr std::uint32_t kMagic = 0x31564248;  // "HBV1"
inline constexpr std::uint32_t kNothing = 0, kLattice = 1, kTexels = 2;

struct BakedHead {
  std::uint32_t magic = kMagic;
  std::uint32_t instance_count = 0, triangle_count = 0, lattice_count = 0, value_count = 0;
  std::uint32_t direction_count = 0;
  std::uint32_t reserved[2] = {};
};
/// As shaders read it: two uvec4.
struct BakedInstance {
  std::uint32_t kind = kNothing;
  std::uint32_t first_value = 0;
  std::uint32_t first_triangle = 0, triangle_count = 0;  // kLattice: of its mesh, among all triangles
  std::uint32_t width = 0, height = 0;                   // kTexels: of its tile, row after row
  std::uint32_t uv_set = 0, reserved = 0;                // kTexels
};
/// As shaders read it: four uvec4, the last nine numbers being float32.
struct BakedTriangle {
  std::uint32_t first_lattice = 0;  // whose entries are values, counted from the instance's first
  std::uint32_t resolution = 1;
  std::uint32_t reserved[5] = {};
  float corners[9] = {};  // object space, metres
};
struct BakedValue {
  float visibility = 1;           // 0 closed .. 1 open
  std::int16_t bent[2] = {0, 0};  // mean open direction, world axes, octahedral, snorm16
};
static_assert(sizeof(BakedHead) == 32 && sizeof(BakedInstance) == 32 && sizeof(BakedTriangle) == 64 &&
              sizeof(BakedValue) == 8);

struct Baked {
  std::uint32_t direction_count = 0;
  std::vector<BakedInstance> instances;
  std::vector<BakedTriangle> triangles;
  std::vector<std::uint32_t> lattice;
  std::vector<BakedValue> values;
};

/// Entries of a triangle's lattice before its row j: row j has resolution + 1 - j of them, i steps along the first
/// edge; point (i, j) is (1 - (i + j) / r, i / r, j / r).
constexpr std::uint32_t lattice_row(std::uint32_t resolution, std::uint32_t j) {
  return j * (resolution + 1) - j * (j - 1) / 2;
}
constexpr std::uint32_t lattice_size(std::uint32_t resolution) {
  return (resolution + 1) * (resolution + 2) / 2;
}

/// A direction, of any length, as two numbers (plugins/shared/octahedral.glsl); (0, 0, 0) is +Z.
inline std::array<std::int16_t, 2> pack_direction(const std::array<double, 3>& v) {
  const double length = std::abs(v[0]) + std::abs(v[1]) + std::abs(v[2]);
  if (!(length > 0)) return {0, 0};
  std::array<double, 2> p{v[0] / length, v[1] / length};
  if (v[2] < 0) p = {(1 - std::abs(p[1])) * (p[0] >= 0 ? 1 : -1), (1 - std::abs(p[0])) * (p[1] >= 0 ? 1 : -1)};
  return {static_cast<std::int16_t>(std::lround(p[0] * 32767)), static_cast<std::int16_t>(std::lround(p[1] * 32767))};
}
/// Unit.
inline std::array<double, 3> unpack_direction(const std::int16_t packed[2]) {
  const double x = packed[0] / 32767.0, y = packed[1] / 32767.0;
  std::array<double, 3> v{x, y, 1 - std::abs(x) - std::abs(y)};
  const double fold = std::fmax(-v[2], 0.0);
  v[0] -= v[0] >= 0 ? fold : -fold;
  v[1] -= v[1] >= 0 ? fold : -fold;
  const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  return {v[0] / length, v[1] / length, v[2] / length};
}

inline std::vector<std::byte> to_bytes(const Baked& baked) {
  const BakedHead head{.instance_count = static_cast<std::uint32_t>(baked.instances.size()),
                       .triangle_count = static_cast<std::uint32_t>(baked.triangles.size()),
                       .lattice_count = static_cast<std::uint32_t>(baked.lattice.size()),
                       .value_count = static_cast<std::uint32_t>(baked.values.size()),
                       .direction_count = baked.direction_count};
  std::vector<std::byte> bytes;
  const auto add = [&](const auto& items) {
    const auto more = std::as_bytes(std::span(items));
    bytes.insert(bytes.end(), more.begin(), more.end());
  };
  add(std::span(&head, 1));
  add(baked.instances);
  add(baked.triangles);
  add(baked.lattice);
  add(baked.values);
  return bytes;
}

/// Every number that another one is found by is checked. Nothing, and why, for bytes that are no such artifact.
inline std::optional<Baked> from_bytes(std::span<const std::byte> bytes, std::string& out_problem) {
  BakedHead head;
  const auto fail = [&](const char* problem) {
    out_problem = problem;
    return std::nullopt;
  };
  if (bytes.size() < sizeof head) return fail("it is too short for its head");
  std::memcpy(&head, bytes.data(), sizeof head);
  if (head.magic != kMagic) return fail("it does not begin as an artifact of role bake_visibility does");
  const std::uint64_t wanted = sizeof head + std::uint64_t{head.instance_count} * sizeof(BakedInstance) +
                               std::uint64_t{head.triangle_count} * sizeof(BakedTriangle) +
                               std::uint64_t{head.lattice_count} * 4 +
                               std::uint64_t{head.value_count} * sizeof(BakedValue);
  if (bytes.size() != wanted) return fail("its length is not what its head says");
  Baked baked;
  std::size_t at = sizeof head;
  const auto take = [&](auto& items, std::uint32_t count) {
    items.resize(count);
    const std::size_t size = items.size() * sizeof items[0];
    if (size > 0) std::memcpy(items.data(), bytes.data() + at, size);
    at += size;
  };
  baked.direction_count = head.direction_count;
  take(baked.instances, head.instance_count);
  take(baked.triangles, head.triangle_count);
  take(baked.lattice, head.lattice_count);
  take(baked.values, head.value_count);
  for (const BakedTriangle& triangle : baked.triangles)
    if (triangle.resolution == 0 || triangle.resolution > 4096 ||
        std::uint64_t{triangle.first_lattice} + lattice_size(triangle.resolution) > head.lattice_count)
      return fail("a triangle has a lattice that is not there");
  for (const BakedInstance& instance : baked.instances) {
    if (std::uint64_t{instance.first_triangle} + instance.triangle_count > head.triangle_count)
      return fail("an instance has triangles that are not there");
    if (instance.kind == kTexels &&
        (instance.width == 0 || instance.height == 0 ||
         instance.first_value + std::uint64_t{instance.width} * instance.height > head.value_count))
      return fail("an instance has texels that are not there");
    if (instance.kind != kLattice) continue;
    for (std::uint32_t t = 0; t < instance.triangle_count; ++t) {
      const BakedTriangle& triangle = baked.triangles[instance.first_triangle + t];
      for (std::uint32_t i = 0; i < lattice_size(triangle.resolution); ++i)
        if (std::uint64_t{instance.first_value} + baked.lattice[triangle.first_lattice + i] >= head.value_count)
          return fail("an instance has values that are not there");
    }
  }
  return baked;
}

}  // namespace baked_visibility
