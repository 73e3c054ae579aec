// SPDX-License-Identifier: Apache-2.0
// A texture of the scene, as heddle/materials.h gives it, and texture coordinates -> its value there, of the finest
// level, as a GPU filters it. In float64.
#pragma once

#include <heddle/materials.h>

#include <glm/glm.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace scene_texture {

namespace detail {

/// sRGB's transfer function (IEC 61966-2-1) of every byte.
inline const std::array<double, 256> kDecoded = [] {
  std::array<double, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i) {
    const double x = static_cast<double>(i) / 255.0;
    table[i] = x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4);
  }
  return table;
}();

inline std::int64_t wrapped(std::int64_t texel, std::int64_t size, std::uint32_t mode) {
  if (mode == HEDDLE_WRAP_CLAMP) return std::clamp<std::int64_t>(texel, 0, size - 1);
  const std::int64_t period = mode == HEDDLE_WRAP_MIRROR ? 2 * size : size;
  const std::int64_t place = ((texel % period) + period) % period;
  return place < size ? place : period - 1 - place;
}

inline glm::dvec4 texel(const heddle_scene_texture& texture, std::int64_t column, std::int64_t row) {
  const auto x = static_cast<std::size_t>(wrapped(column, texture.width, texture.wrap[0]));
  const auto y = static_cast<std::size_t>(wrapped(row, texture.height, texture.wrap[1]));
  const std::uint8_t* rgba = texture.rgba + 4 * (y * texture.width + x);
  const double alpha = rgba[3] / 255.0;
  if (texture.is_srgb != 0) return {kDecoded[rgba[0]], kDecoded[rgba[1]], kDecoded[rgba[2]], alpha};
  return {rgba[0] / 255.0, rgba[1] / 255.0, rgba[2] / 255.0, alpha};
}

}  // namespace detail

/// As a GPU filters the finest level: texel centres at halves.
inline glm::dvec4 filter(const heddle_scene_texture& texture, const glm::dvec2& uv) {
  // Beyond this, coordinates in float32 say nothing about texels any more.
  constexpr double kLimit = 1e6;
  const glm::dvec2 at = glm::clamp(uv, -kLimit, kLimit) * glm::dvec2(texture.width, texture.height) - 0.5;
  if (texture.is_nearest != 0)
    return detail::texel(texture, std::llround(std::floor(at.x + 0.5)), std::llround(std::floor(at.y + 0.5)));
  const glm::dvec2 low = glm::floor(at), t = at - low;
  const auto x = static_cast<std::int64_t>(low.x), y = static_cast<std::int64_t>(low.y);
  const glm::dvec4 above = glm::mix(detail::texel(texture, x, y), detail::texel(texture, x + 1, y), t.x);
  const glm::dvec4 below = glm::mix(detail::texel(texture, x, y + 1), detail::texel(texture, x + 1, y + 1), t.x);
  return glm::mix(above, below, t.y);
}

/// KHR_texture_transform of one texture; a matrix that is all zero stands for the base colour's.
inline glm::dvec2 transformed(const HeddleMaterial& record, std::uint32_t slot, const glm::dvec2& uv) {
  const float* matrix = record.uv_rotation_scale;
  const float* offset = record.uv_offset;
  const std::array<const float*, 5> matrices{record.uv_rotation_scale, record.uv_rotation_scale_1,
                                             record.uv_rotation_scale_2, record.uv_rotation_scale_3,
                                             record.uv_rotation_scale_4};
  const std::array<const float*, 5> offsets{record.uv_offset, record.uv_offset_1_2, record.uv_offset_1_2 + 2,
                                            record.uv_offset_3_4, record.uv_offset_3_4 + 2};
  const float* own = matrices[slot];
  if (own[0] != 0.0F || own[1] != 0.0F || own[2] != 0.0F || own[3] != 0.0F) {
    matrix = own;
    offset = offsets[slot];
  }
  const auto d = [](float x) { return static_cast<double>(x); };
  return {d(matrix[0]) * uv.x + d(matrix[2]) * uv.y + d(offset[0]),
          d(matrix[1]) * uv.x + d(matrix[3]) * uv.y + d(offset[1])};
}

}  // namespace scene_texture
