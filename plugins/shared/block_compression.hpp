// SPDX-License-Identifier: Apache-2.0
// Blocks of 4 x 4 texels <-> BC1 (8 bytes) and BC7 of mode 6 (16 bytes). A block's bytes depend on its texels alone, so
// equal texels are equal blocks wherever they lie. Alpha is not kept: BC1 has none, and here BC7's is opaque within one
// step of 255.
// Source  Khronos Data Format Specification 1.3, sections 18.1 (BC1) and 20 (BC7, BPTC): layouts and weights;
//         the fit: principal axis, then least squares for given indices (Simon Brown 2006, "DXT Compression
//         Techniques")
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>

namespace heddle::block_compression {

/// As parameters name them.
enum Format : std::uint32_t { kNone, kBc1, kBc7 };

using Texels = std::array<std::array<float, 3>, 16>;  // codes, 0 to 255

inline constexpr std::uint32_t kSide = 4;  // of a block, texels

constexpr std::uint64_t bytes_of(std::uint32_t format, std::uint32_t width, std::uint32_t height) {
  const std::uint64_t blocks = std::uint64_t{width / kSide} * (height / kSide);
  return format == kNone ? std::uint64_t{4} * width * height : blocks * (format == kBc1 ? 8 : 16);
}

namespace detail {

using Color = std::array<float, 3>;

struct Line {
  Color a{}, b{};
};

/// Ends of the texels' extent along their principal axis.
inline Line principal_line(const Texels& texels) {
  Color mean{};
  for (const Color& t : texels)
    for (std::size_t c = 0; c < 3; ++c) mean[c] += t[c] / 16.0F;
  std::array<float, 6> m{};  // xx xy xz yy yz zz
  for (const Color& t : texels) {
    const float x = t[0] - mean[0], y = t[1] - mean[1], z = t[2] - mean[2];
    m[0] += x * x, m[1] += x * y, m[2] += x * z, m[3] += y * y, m[4] += y * z, m[5] += z * z;
  }
  // Power iteration, from the channel that varies most: never at right angles to the axis that is looked for.
  Color axis = m[0] >= m[3] && m[0] >= m[5] ? Color{m[0], m[1], m[2]}
               : m[3] >= m[5]               ? Color{m[1], m[3], m[4]}
                                            : Color{m[2], m[4], m[5]};
  for (int i = 0; i < 6; ++i) {
    const Color next{m[0] * axis[0] + m[1] * axis[1] + m[2] * axis[2], m[1] * axis[0] + m[3] * axis[1] + m[4] * axis[2],
                     m[2] * axis[0] + m[4] * axis[1] + m[5] * axis[2]};
    const float longest = std::max({std::abs(next[0]), std::abs(next[1]), std::abs(next[2])});
    if (!(longest > 0)) break;
    for (std::size_t c = 0; c < 3; ++c) axis[c] = next[c] / longest;
  }
  const float length2 = axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2];
  if (!(length2 > 0)) return {mean, mean};
  float low = std::numeric_limits<float>::max(), high = std::numeric_limits<float>::lowest();
  for (const Color& t : texels) {
    const float along =
        ((t[0] - mean[0]) * axis[0] + (t[1] - mean[1]) * axis[1] + (t[2] - mean[2]) * axis[2]) / length2;
    low = std::min(low, along);
    high = std::max(high, along);
  }
  Line line;
  for (std::size_t c = 0; c < 3; ++c) {
    line.a[c] = std::clamp(mean[c] + low * axis[c], 0.0F, 255.0F);
    line.b[c] = std::clamp(mean[c] + high * axis[c], 0.0F, 255.0F);
  }
  return line;
}

/// The line whose points at these weights (of b) come nearest to the texels; `line` where all weights are equal.
inline Line least_squares(const Texels& texels, const std::array<float, 16>& weights, const Line& line) {
  float aa = 0, ab = 0, bb = 0;
  Color ta{}, tb{};
  for (std::size_t i = 0; i < 16; ++i) {
    const float w = weights[i], v = 1.0F - w;
    aa += v * v, ab += v * w, bb += w * w;
    for (std::size_t c = 0; c < 3; ++c) {
      ta[c] += v * texels[i][c];
      tb[c] += w * texels[i][c];
    }
  }
  const float determinant = aa * bb - ab * ab;
  if (!(determinant > 1e-4F)) return line;
  Line out;
  for (std::size_t c = 0; c < 3; ++c) {
    out.a[c] = std::clamp((ta[c] * bb - tb[c] * ab) / determinant, 0.0F, 255.0F);
    out.b[c] = std::clamp((tb[c] * aa - ta[c] * ab) / determinant, 0.0F, 255.0F);
  }
  return out;
}

using Palette = std::array<std::array<std::int32_t, 3>, 16>;

/// Each texel's nearest colour; the squared error of them all.
inline float nearest(const Texels& texels, const Palette& palette, std::size_t count,
                     std::array<std::uint8_t, 16>& indices) {
  float total = 0;
  for (std::size_t i = 0; i < 16; ++i) {
    float best = std::numeric_limits<float>::max();
    for (std::size_t p = 0; p < count; ++p) {
      float error = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        const float d = texels[i][c] - static_cast<float>(palette[p][c]);
        error += d * d;
      }
      if (error < best) {
        best = error;
        indices[i] = static_cast<std::uint8_t>(p);
      }
    }
    total += best;
  }
  return total;
}

/// The same where the palette is a line of 16 nearly even steps: the nearest is next to where the texel falls on it.
inline float nearest_on_line(const Texels& texels, const Palette& palette, std::array<std::uint8_t, 16>& indices) {
  Color axis{};
  float length2 = 0, start = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const auto first = static_cast<float>(palette[0][c]);
    axis[c] = static_cast<float>(palette[15][c]) - first;
    length2 += axis[c] * axis[c];
    start += axis[c] * first;
  }
  const float scale = length2 > 0 ? 15.0F / length2 : 0.0F;
  float total = 0;
  for (std::size_t i = 0; i < 16; ++i) {
    const float along = (texels[i][0] * axis[0] + texels[i][1] * axis[1] + texels[i][2] * axis[2] - start) * scale;
    const auto middle = static_cast<std::int32_t>(std::clamp(along + 0.5F, 0.0F, 15.0F));
    float best = std::numeric_limits<float>::max();
    for (std::int32_t p = std::max(middle - 1, 0); p <= std::min(middle + 1, 15); ++p) {
      const auto& color = palette[static_cast<std::size_t>(p)];
      float error = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        const float d = texels[i][c] - static_cast<float>(color[c]);
        error += d * d;
      }
      if (error < best) {
        best = error;
        indices[i] = static_cast<std::uint8_t>(p);
      }
    }
    total += best;
  }
  return total;
}

inline constexpr std::array<std::int32_t, 16> kWeights = {0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64};

/// 7 bits a channel, and a lowest bit that all channels share.
struct Bc7End {
  std::array<std::uint32_t, 3> value{};  // 8 bits
};
inline Bc7End bc7_end(const Color& color) {
  Bc7End best;
  float least = std::numeric_limits<float>::max();
  for (std::uint32_t p = 0; p < 2; ++p) {
    Bc7End end;
    float error = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const float steps = std::clamp(std::floor((color[c] - static_cast<float>(p)) / 2.0F + 0.5F), 0.0F, 127.0F);
      end.value[c] = static_cast<std::uint32_t>(steps) * 2 + p;
      const float d = color[c] - static_cast<float>(end.value[c]);
      error += d * d;
    }
    if (error < least) {
      least = error;
      best = end;
    }
  }
  return best;
}

inline Palette bc7_palette(const Bc7End& a, const Bc7End& b) {
  Palette palette{};
  for (std::size_t p = 0; p < 16; ++p)
    for (std::size_t c = 0; c < 3; ++c)
      palette[p][c] = (static_cast<std::int32_t>(a.value[c]) * (64 - kWeights[p]) +
                       static_cast<std::int32_t>(b.value[c]) * kWeights[p] + 32) >>
                      6;
  return palette;
}

class BitWriter {
 public:
  explicit BitWriter(std::byte* out) : out_(out) {}
  void put(std::uint32_t value, std::uint32_t bits) {
    for (std::uint32_t i = 0; i < bits; ++i, ++at_)
      if ((value >> i & 1U) != 0) out_[at_ / 8] |= std::byte{1} << (at_ % 8);
  }

 private:
  std::byte* out_;
  std::uint32_t at_ = 0;
};

class BitReader {
 public:
  explicit BitReader(const std::byte* in) : in_(in) {}
  std::uint32_t take(std::uint32_t bits) {
    std::uint32_t value = 0;
    for (std::uint32_t i = 0; i < bits; ++i, ++at_)
      value |= static_cast<std::uint32_t>(std::to_integer<std::uint32_t>(in_[at_ / 8]) >> (at_ % 8) & 1U) << i;
    return value;
  }

 private:
  const std::byte* in_;
  std::uint32_t at_ = 0;
};

/// Eight bits of each channel of a colour in 5, 6, 5.
inline std::array<std::int32_t, 3> from_565(std::uint32_t packed) {
  const std::uint32_t r = packed >> 11 & 31U, g = packed >> 5 & 63U, b = packed & 31U;
  return {static_cast<std::int32_t>(r << 3 | r >> 2), static_cast<std::int32_t>(g << 2 | g >> 4),
          static_cast<std::int32_t>(b << 3 | b >> 2)};
}
inline std::uint32_t to_565(const Color& color) {
  const auto steps = [](float value, float most) {
    return static_cast<std::uint32_t>(std::floor(std::clamp(value, 0.0F, 255.0F) / 255.0F * most + 0.5F));
  };
  return steps(color[0], 31) << 11 | steps(color[1], 63) << 5 | steps(color[2], 31);
}
/// In the order of indices: a, b, two thirds of a, two thirds of b. a > b, else only a.
inline Palette bc1_palette(std::uint32_t a, std::uint32_t b) {
  Palette palette{};
  const auto first = from_565(a), last = from_565(b);
  for (std::size_t c = 0; c < 3; ++c) {
    palette[0][c] = first[c];
    palette[1][c] = last[c];
    palette[2][c] = (2 * first[c] + last[c]) / 3;
    palette[3][c] = (first[c] + 2 * last[c]) / 3;
  }
  return palette;
}

/// For each code the two steps whose point at a third comes nearest to it: a flat block is better off between two
/// colours.
template <std::size_t kSteps>
struct FlatEnds {
  std::array<std::uint8_t, 256> a{}, b{};
  FlatEnds() {
    constexpr std::int32_t kMost = static_cast<std::int32_t>(kSteps) - 1;
    const auto wide = [](std::int32_t s) { return kSteps == 32 ? (s << 3 | s >> 2) : (s << 2 | s >> 4); };
    for (std::int32_t code = 0; code < 256; ++code) {
      std::int32_t least = 1 << 20;
      for (std::int32_t i = 0; i <= kMost; ++i) {
        for (std::int32_t j = 0; j <= kMost; ++j) {
          // Of equal ones those that lie close together.
          const std::int32_t error = 64 * std::abs((2 * wide(i) + wide(j)) / 3 - code) + std::abs(i - j);
          if (error >= least) continue;
          least = error;
          a[static_cast<std::size_t>(code)] = static_cast<std::uint8_t>(i);
          b[static_cast<std::size_t>(code)] = static_cast<std::uint8_t>(j);
        }
      }
    }
  }
};

}  // namespace detail

/// `out`: 16 bytes.
inline void encode_bc7(const Texels& texels, std::byte* out) {
  using namespace detail;
  Line line = principal_line(texels);
  Bc7End best_a, best_b;
  std::array<std::uint8_t, 16> best{}, indices{};
  float least = std::numeric_limits<float>::max();
  for (int round = 0; round < 3; ++round) {
    const Bc7End a = bc7_end(line.a), b = bc7_end(line.b);
    const float error = nearest_on_line(texels, bc7_palette(a, b), indices);
    if (error >= least) break;
    least = error;
    best = indices;
    best_a = a;
    best_b = b;
    std::array<float, 16> weights{};
    for (std::size_t i = 0; i < 16; ++i) weights[i] = static_cast<float>(kWeights[indices[i]]) / 64.0F;
    line = least_squares(texels, weights, line);
  }
  // Ends share their lowest bit among channels: what is flat may need the two around it.
  if (least > 0 && texels == [&] {
        Texels flat;
        flat.fill(texels[0]);
        return flat;
      }()) {
    Color low = texels[0], high = texels[0];
    for (std::size_t c = 0; c < 3; ++c)
      if (static_cast<std::int32_t>(low[c]) % 2 == 0) low[c] = std::max(low[c] - 1, 1.0F), high[c] += 1;
    const Bc7End a = bc7_end(low), b = bc7_end(high);
    if (const float error = nearest(texels, bc7_palette(a, b), 16, indices); error < least) {
      best = indices;
      best_a = a;
      best_b = b;
    }
  }
  // The first index has no highest bit.
  if (best[0] >= 8) {
    std::swap(best_a, best_b);
    for (std::uint8_t& index : best) index = static_cast<std::uint8_t>(15 - index);
  }
  std::memset(out, 0, 16);
  BitWriter bits(out);
  bits.put(1U << 6U, 7);
  for (std::size_t c = 0; c < 3; ++c) {
    bits.put(best_a.value[c] >> 1U, 7);
    bits.put(best_b.value[c] >> 1U, 7);
  }
  bits.put(127, 7);
  bits.put(127, 7);
  bits.put(best_a.value[0] & 1U, 1);
  bits.put(best_b.value[0] & 1U, 1);
  for (std::size_t i = 0; i < 16; ++i) bits.put(best[i], i == 0 ? 3 : 4);
}

/// Of mode 6; other modes are never written here. Returns false for them.
inline bool decode_bc7(const std::byte* block, Texels& texels) {
  using namespace detail;
  BitReader bits(block);
  if (bits.take(7) != 1U << 6U) return false;
  Bc7End a, b;
  for (std::size_t c = 0; c < 3; ++c) {
    a.value[c] = bits.take(7) << 1U;
    b.value[c] = bits.take(7) << 1U;
  }
  (void)bits.take(14);
  const std::uint32_t low_a = bits.take(1), low_b = bits.take(1);
  for (std::size_t c = 0; c < 3; ++c) {
    a.value[c] |= low_a;
    b.value[c] |= low_b;
  }
  const Palette palette = bc7_palette(a, b);
  for (std::size_t i = 0; i < 16; ++i) {
    const auto& color = palette[bits.take(i == 0 ? 3 : 4)];
    for (std::size_t c = 0; c < 3; ++c) texels[i][c] = static_cast<float>(color[c]);
  }
  return true;
}

/// `out`: 8 bytes.
inline void encode_bc1(const Texels& texels, std::byte* out) {
  using namespace detail;
  static const FlatEnds<32> kFive;
  static const FlatEnds<64> kSix;
  static constexpr std::array<float, 4> kOfB = {0.0F, 1.0F, 1.0F / 3.0F, 2.0F / 3.0F};
  std::uint32_t best_a = 0, best_b = 0;
  std::array<std::uint8_t, 16> best{}, indices{};
  float least = std::numeric_limits<float>::max();
  const auto attempt = [&](std::uint32_t a, std::uint32_t b) {
    if (a < b) std::swap(a, b);
    // Equal ends would mean three colours and black.
    const float error = nearest(texels, bc1_palette(a, b), a == b ? 1 : 4, indices);
    if (error >= least) return false;
    least = error;
    best = indices;
    best_a = a;
    best_b = b;
    return true;
  };
  Line line = principal_line(texels);
  for (int round = 0; round < 3; ++round) {
    const std::uint32_t a = to_565(line.a), b = to_565(line.b);
    if (!attempt(a, b)) break;
    std::array<float, 16> weights{};
    // Of the line's b, which may have become the first end.
    for (std::size_t i = 0; i < 16; ++i) weights[i] = a < b ? 1.0F - kOfB[indices[i]] : kOfB[indices[i]];
    line = least_squares(texels, weights, line);
  }
  std::array<std::size_t, 3> code{};
  for (std::size_t c = 0; c < 3; ++c) {
    float mean = 0;
    for (const Color& t : texels) mean += t[c] / 16.0F;
    code[c] = static_cast<std::size_t>(std::clamp(mean + 0.5F, 0.0F, 255.0F));
  }
  attempt(static_cast<std::uint32_t>(kFive.a[code[0]]) << 11U | static_cast<std::uint32_t>(kSix.a[code[1]]) << 5U |
              kFive.a[code[2]],
          static_cast<std::uint32_t>(kFive.b[code[0]]) << 11U | static_cast<std::uint32_t>(kSix.b[code[1]]) << 5U |
              kFive.b[code[2]]);
  std::uint64_t packed = std::uint64_t{best_a} | std::uint64_t{best_b} << 16U;
  for (std::size_t i = 0; i < 16; ++i) packed |= std::uint64_t{best[i]} << (32 + 2 * i);
  std::memcpy(out, &packed, sizeof packed);
}

inline void decode_bc1(const std::byte* block, Texels& texels) {
  std::uint64_t packed = 0;
  std::memcpy(&packed, block, sizeof packed);
  const auto palette = detail::bc1_palette(packed & 65535U, packed >> 16 & 65535U);
  for (std::size_t i = 0; i < 16; ++i)
    for (std::size_t c = 0; c < 3; ++c) texels[i][c] = static_cast<float>(palette[packed >> (32 + 2 * i) & 3U][c]);
}

/// Rows of rgba8 texels -> a format's bytes; width and height are multiples of 4 unless it is kNone.
inline void encode(std::uint32_t format, const std::uint8_t* rgba, std::uint32_t width, std::uint32_t height,
                   std::byte* out) {
  if (format == kNone) {
    std::memcpy(out, rgba, std::size_t{4} * width * height);
    return;
  }
  Texels texels;
  for (std::uint32_t y = 0; y < height; y += kSide) {
    for (std::uint32_t x = 0; x < width; x += kSide) {
      for (std::size_t i = 0; i < 16; ++i) {
        const std::uint8_t* texel = rgba + 4 * (std::size_t{width} * (y + i / kSide) + x + i % kSide);
        texels[i] = {static_cast<float>(texel[0]), static_cast<float>(texel[1]), static_cast<float>(texel[2])};
      }
      if (format == kBc1)
        encode_bc1(texels, out);
      else
        encode_bc7(texels, out);
      out += format == kBc1 ? 8 : 16;
    }
  }
}

/// The way back, opaque. False if the bytes are not what `encode` writes.
inline bool decode(std::uint32_t format, const std::byte* bytes, std::uint32_t width, std::uint32_t height,
                   std::uint8_t* rgba) {
  if (format == kNone) {
    std::memcpy(rgba, bytes, std::size_t{4} * width * height);
    return true;
  }
  Texels texels{};
  bool is_good = true;
  for (std::uint32_t y = 0; y < height; y += kSide) {
    for (std::uint32_t x = 0; x < width; x += kSide) {
      if (format == kBc1)
        decode_bc1(bytes, texels);
      else
        is_good = decode_bc7(bytes, texels) && is_good;
      bytes += format == kBc1 ? 8 : 16;
      for (std::size_t i = 0; i < 16; ++i) {
        std::uint8_t* texel = rgba + 4 * (std::size_t{width} * (y + i / kSide) + x + i % kSide);
        for (std::size_t c = 0; c < 3; ++c) texel[c] = static_cast<std::uint8_t>(texels[i][c]);
        texel[3] = 255;
      }
    }
  }
  return is_good;
}

}  // namespace heddle::block_compression
