// SPDX-License-Identifier: Apache-2.0
// A texture of any size -> texels of any rectangle of any of its levels, sRGB, made from nothing but their place: a
// virtual texture of 256 K texels needs no disk. Integers and float32 sums in a fixed order, so bytes repeat.
// Source  fBm: Ebert et al. 2003, "Texturing and Modeling", chapter 2; its octaves end where a texel is as large as
// they
//         are (the same, chapter 2, "clamping"); stripes are box-filtered in closed form.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

namespace heddle::texture_tiles {

// As role.toml orders them.
enum : std::uint32_t { kTerrain, kRoad, kRamp, kUvGrid, kStored };
enum : std::uint32_t { kWrap, kMirror, kClamp };

struct Texture {
  std::uint32_t source = kTerrain;
  std::uint32_t extent = 65536;  // texels of level 0 along each side, a power of two
  std::uint32_t seed = 0;
  std::uint32_t address = kWrap;
  std::uint32_t image = 0;  // kStored: its number in the store, which has its texels
  friend bool operator==(const Texture&, const Texture&) = default;
};

struct Rgba8 {
  std::uint8_t r = 0, g = 0, b = 0, a = 255;
  friend bool operator==(const Rgba8&, const Rgba8&) = default;
};

/// Of texels as four bytes each.
inline std::uint8_t* first_byte(std::vector<Rgba8>& texels) {
  return reinterpret_cast<std::uint8_t*>(texels.data());
}
inline const std::uint8_t* first_byte(const std::vector<Rgba8>& texels) {
  return reinterpret_cast<const std::uint8_t*>(texels.data());
}

/// A texel's index in a level of `extent` texels, which may lie outside.
inline std::uint32_t addressed(std::int64_t i, std::int64_t extent, std::uint32_t mode) {
  if (mode == kClamp) return static_cast<std::uint32_t>(std::clamp<std::int64_t>(i, 0, extent - 1));
  if (mode == kMirror) {
    const std::int64_t folded = i & (2 * extent - 1);
    return static_cast<std::uint32_t>(folded >= extent ? 2 * extent - 1 - folded : folded);
  }
  return static_cast<std::uint32_t>(i & (extent - 1));
}

namespace detail {

inline float hashed(std::uint32_t x, std::uint32_t y, std::uint32_t salt) {
  std::uint32_t h = x * 0x9E3779B1U ^ y * 0x85EBCA77U ^ salt * 0xC2B2AE3DU;
  h ^= h >> 15;
  h *= 0x2C1B3C6DU;
  h ^= h >> 12;
  h *= 0x297A2D39U;
  h ^= h >> 15;
  return static_cast<float>(h >> 8) * (1.0F / 16777216.0F);
}

inline float smooth(float t) {
  return t * t * (3.0F - 2.0F * t);
}
inline float step(float low, float high, float x) {
  return smooth(std::clamp((x - low) / (high - low), 0.0F, 1.0F));
}

/// One axis of a rectangle against a lattice of `cells` over `extent` texels: the cell and how far into it.
struct Lattice {
  std::vector<std::uint32_t> cell;
  std::vector<float> weight;
  Lattice(const std::vector<std::uint32_t>& texels, std::uint32_t extent, std::uint32_t cells)
      : cell(texels.size()), weight(texels.size()) {
    const float scale = static_cast<float>(cells) / static_cast<float>(extent);
    const std::uint32_t per_cell = std::max(extent / cells, 1U);
    for (std::size_t i = 0; i < texels.size(); ++i) {
      cell[i] = texels[i] / per_cell;
      const std::uint32_t inside = texels[i] - cell[i] * per_cell;
      weight[i] = smooth((static_cast<float>(inside) + 0.5F) * scale);
    }
  }
};

/// Adds octaves of value noise from `first` to `last` cells a side, each of amplitude `gain` of the one before; its
/// mean is a half of the amplitudes' sum, which is returned. Octaves finer than two texels add their mean.
inline float add_octaves(std::vector<float>& sum, const std::vector<std::uint32_t>& xs,
                         const std::vector<std::uint32_t>& ys, std::uint32_t extent, std::uint32_t first,
                         std::uint32_t last, float gain, std::uint32_t salt) {
  float amplitude = 1.0F, total = 0.0F;
  for (std::uint32_t cells = first; cells <= last; cells *= 2, amplitude *= gain) {
    total += amplitude;
    if (cells * 2 > extent) {
      for (float& value : sum) value += 0.5F * amplitude;
      continue;
    }
    const Lattice x(xs, extent, cells), y(ys, extent, cells);
    std::size_t at = 0;
    for (std::size_t row = 0; row < ys.size(); ++row) {
      const std::uint32_t below = y.cell[row], above = (below + 1) & (cells - 1);
      std::uint32_t cell = ~0U;
      float left = 0, right = 0;
      for (std::size_t column = 0; column < xs.size(); ++column, ++at) {
        if (x.cell[column] != cell) {
          cell = x.cell[column];
          const std::uint32_t next = (cell + 1) & (cells - 1), octave = salt + cells;
          left = std::lerp(hashed(cell, below, octave), hashed(cell, above, octave), y.weight[row]);
          right = std::lerp(hashed(next, below, octave), hashed(next, above, octave), y.weight[row]);
        }
        sum[at] += amplitude * (left + (right - left) * x.weight[column]);
      }
    }
  }
  return total;
}

struct Linear {
  float r = 0, g = 0, b = 0;
};
inline Linear mix(const Linear& a, const Linear& b, float t) {
  return {a.r + (b.r - a.r) * t, a.g + (b.g - a.g) * t, a.b + (b.b - a.b) * t};
}

/// sRGB codes of linear values by a table: the code whose value is the nearest.
class Encoder {
 public:
  Encoder() {
    for (std::size_t code = 0; code < 255; ++code) {
      // Halfway between two codes, in linear light.
      border_[code] =
          static_cast<float>((linear(static_cast<double>(code)) + linear(static_cast<double>(code) + 1)) / 2);
    }
    for (std::size_t i = 0; i < first_.size(); ++i) {
      const float value = static_cast<float>(i) / static_cast<float>(first_.size());
      first_[i] = static_cast<std::uint8_t>(std::upper_bound(border_.begin(), border_.end(), value) - border_.begin());
    }
  }
  [[nodiscard]] std::uint8_t code(float value) const {
    const float clamped = std::clamp(value, 0.0F, 1.0F);
    std::size_t found =
        first_[std::min(static_cast<std::size_t>(clamped * static_cast<float>(first_.size())), first_.size() - 1)];
    while (found < 255 && clamped >= border_[found]) ++found;
    return static_cast<std::uint8_t>(found);
  }

 private:
  static double linear(double code) {
    const double encoded = code / 255.0;
    return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
  }
  std::array<float, 255> border_{};
  std::array<std::uint8_t, 1024> first_{};
};

/// Length that [low, high] and [a, b] share.
inline float shared(float low, float high, float a, float b) {
  return std::max(std::min(high, b) - std::max(low, a), 0.0F);
}

/// The road over the terrain: asphalt, two white lines at its sides and a broken one in its middle, each box-filtered
/// over the texel. Its middle winds; lengths are of the whole texture.
class Road {
 public:
  Road(std::uint32_t extent, std::uint32_t level_extent, std::uint32_t y)
      : half_(0.5F / static_cast<float>(level_extent)) {
    const double v = (y + 0.5) / level_extent, turn = 2.0 * std::numbers::pi;
    middle_ = static_cast<float>(0.5 + 0.02 * std::sin(turn * 3.0 * v) + 0.006 * std::sin(turn * 11.0 * v));
    width_ = kHalfWidth / static_cast<float>(extent);
    // Dashes of a third of their period.
    const double period = 12.0 * static_cast<double>(width_), at = v - static_cast<double>(half_);
    const double end = v + static_cast<double>(half_), third = period / 3.0;
    const auto covered = [&](double x) {
      const double whole = std::floor(x / period);
      return whole * third + std::min(x - whole * period, third);
    };
    dash_ = static_cast<float>((covered(end) - covered(at)) / (end - at));
  }
  void paint(Linear& color, float u, float grain) const {
    const float low = u - middle_ - half_, high = u - middle_ + half_, texel = 2.0F * half_;
    const float asphalt = shared(low, high, -width_, width_) / texel;
    if (asphalt <= 0.0F) return;
    const float tone = 0.035F + 0.05F * grain;
    color = mix(color, {tone, tone, tone * 1.04F}, asphalt);
    const float line = width_ * 0.03F, side = width_ * 0.9F;
    const float sides =
        (shared(low, high, -side - line, -side + line) + shared(low, high, side - line, side + line)) / texel;
    const float dashes = shared(low, high, -line, line) / texel * dash_;
    color = mix(color, {0.62F, 0.61F, 0.57F}, std::min(sides + dashes, 1.0F) * (0.75F + 0.25F * grain));
  }

 private:
  static constexpr float kHalfWidth = 192.0F;  // texels of level 0
  float half_, middle_ = 0, width_ = 0, dash_ = 0;
};

inline void landscape(const Texture& texture, std::uint32_t level, const std::vector<std::uint32_t>& xs,
                      const std::vector<std::uint32_t>& ys, std::vector<Rgba8>& out) {
  static const Encoder kEncoder;
  const std::uint32_t extent = texture.extent >> level;
  const std::uint32_t salt = texture.seed * 7919U;
  std::vector<float> land(out.size(), 0.0F), wet(out.size(), 0.0F), grain(out.size(), 0.0F);
  const std::uint32_t finest = texture.extent / 2;
  const float land_sum = add_octaves(land, xs, ys, extent, 8, std::min(finest, 4096U), 0.55F, salt + 1U);
  const float wet_sum = add_octaves(wet, xs, ys, extent, 16, std::min(finest, 256U), 0.5F, salt + 2U);
  const float grain_sum = add_octaves(grain, xs, ys, extent, std::min(finest, 8192U), finest, 0.8F, salt + 3U);
  std::size_t at = 0;
  for (const std::uint32_t y : ys) {
    const Road road(texture.extent, extent, y);
    for (const std::uint32_t x : xs) {
      const float h = land[at] / land_sum, w = wet[at] / wet_sum, g = grain[at] / grain_sum;
      const Linear grass = mix({0.055F, 0.085F, 0.022F}, {0.13F, 0.15F, 0.04F}, g);
      const Linear soil = mix({0.11F, 0.07F, 0.04F}, {0.26F, 0.19F, 0.12F}, g);
      const Linear rock = mix({0.13F, 0.125F, 0.12F}, {0.34F, 0.33F, 0.31F}, g);
      Linear color = mix(soil, grass, step(0.42F, 0.52F, w));
      color = mix(color, rock, step(0.52F, 0.6F, h + 0.1F * (g - 0.5F)));
      const float shade = 0.7F + 0.6F * g;
      color = {color.r * shade, color.g * shade, color.b * shade};
      if (texture.source == kRoad) road.paint(color, (static_cast<float>(x) + 0.5F) / static_cast<float>(extent), g);
      out[at++] = {kEncoder.code(color.r), kEncoder.code(color.g), kEncoder.code(color.b), 255};
    }
  }
}

/// One step of 8 bits a texel in each level, up and down again: no filter can hide a seam.
inline std::uint8_t ramp(std::uint32_t i) {
  const std::uint32_t folded = i % 380U;
  return static_cast<std::uint8_t>(32U + (folded < 190U ? folded : 380U - folded));
}

}  // namespace detail

/// Texels of `level` from (x, y) on, row by row: width x height of them, those outside by the texture's address mode.
/// out is resized. Levels from 0, the finest, to that of one texel.
inline void make_texels(const Texture& texture, std::uint32_t level, std::int64_t x, std::int64_t y,
                        std::uint32_t width, std::uint32_t height, std::vector<Rgba8>& out) {
  const std::uint32_t extent = std::max(texture.extent >> level, 1U);
  std::vector<std::uint32_t> xs(width), ys(height);
  for (std::uint32_t i = 0; i < width; ++i) xs[i] = addressed(x + i, extent, texture.address);
  for (std::uint32_t i = 0; i < height; ++i) ys[i] = addressed(y + i, extent, texture.address);
  out.resize(std::size_t{width} * height);
  if (texture.source == kTerrain || texture.source == kRoad) {
    detail::landscape(texture, level, xs, ys, out);
    return;
  }
  std::size_t at = 0;
  for (const std::uint32_t v : ys) {
    for (const std::uint32_t u : xs) {
      if (texture.source == kRamp) {
        out[at++] = {detail::ramp(u), detail::ramp(v), detail::ramp(u + v), 255};
        continue;
      }
      const std::uint32_t code = (u & 1023U) | (v & 1023U) << 10U | level << 20U;
      out[at++] = {static_cast<std::uint8_t>(code), static_cast<std::uint8_t>(code >> 8U),
                   static_cast<std::uint8_t>(code >> 16U), 255};
    }
  }
}

}  // namespace heddle::texture_tiles
