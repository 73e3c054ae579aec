// SPDX-License-Identifier: Apache-2.0
// Textures -> mip chains on the CPU. Blits would not do: lavapipe's brighten rgba8 by half a step a level.
#include "scene/mips.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace heddle::scene {
namespace {

double srgb_to_linear(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

struct SrgbTables {
  std::array<float, 256> decoded{};
  // limit[k]: the smallest linear value that rounds to code k.
  std::array<float, 257> limit{};
  // Code at the beginning of each of the buckets that 0..1 is cut into; at most two codes lie in one.
  static constexpr std::size_t kBuckets = 4096;
  std::array<std::uint8_t, kBuckets + 1> first{};

  SrgbTables() {
    for (std::size_t k = 0; k < 256; ++k) {
      decoded[k] = static_cast<float>(srgb_to_linear(static_cast<double>(k) / 255.0));
      limit[k] = k == 0 ? -1.0F : static_cast<float>(srgb_to_linear((static_cast<double>(k) - 0.5) / 255.0));
    }
    limit[256] = 2.0F;
    std::size_t code = 0;
    for (std::size_t bucket = 0; bucket <= kBuckets; ++bucket) {
      const float start = static_cast<float>(bucket) / static_cast<float>(kBuckets);
      while (start >= limit[code + 1]) {
        ++code;
      }
      first[bucket] = static_cast<std::uint8_t>(code);
    }
  }
};

const SrgbTables& tables() {
  static const SrgbTables made;
  return made;
}

/// Which texels of the larger side a texel of the smaller one covers, and by how much.
struct Taps {
  std::uint32_t first = 0, count = 0;
  std::array<float, 3> weight{};
};

std::vector<Taps> make_taps(std::uint32_t from, std::uint32_t to) {
  std::vector<Taps> taps(to);
  const double ratio = static_cast<double>(from) / static_cast<double>(to);  // 1, 2, or between 2 and 3
  for (std::uint32_t i = 0; i < to; ++i) {
    const double begin = i * ratio, end = (i + 1) * ratio;
    Taps& tap = taps[i];
    tap.first = static_cast<std::uint32_t>(begin);
    for (std::uint32_t k = tap.first; k < from && tap.count < 3; ++k) {
      const double covered = std::min<double>(end, k + 1.0) - std::max<double>(begin, k);
      if (covered <= 1e-9) {
        break;
      }
      tap.weight[tap.count++] = static_cast<float>(covered / ratio);
    }
  }
  return taps;
}

struct FloatLevel {
  std::uint32_t width = 0, height = 0;
  std::vector<glm::vec4> texels;
};

/// Half the size, both directions at once; `load(index)` gives a texel of the larger level.
template <typename Load>
FloatLevel halve(std::uint32_t width, std::uint32_t height, const Load& load) {
  FloatLevel half{std::max(width / 2, 1U), std::max(height / 2, 1U), {}};
  half.texels.resize(std::size_t{half.width} * half.height);
  const std::vector<Taps> across = make_taps(width, half.width), down = make_taps(height, half.height);
  for (std::uint32_t y = 0; y < half.height; ++y) {
    for (std::uint32_t x = 0; x < half.width; ++x) {
      glm::vec4 sum(0.0F);
      for (std::uint32_t j = 0; j < down[y].count; ++j) {
        const std::size_t row = std::size_t{down[y].first + j} * width + across[x].first;
        glm::vec4 row_sum(0.0F);
        for (std::uint32_t i = 0; i < across[x].count; ++i) {
          row_sum += load(row + i) * across[x].weight[i];
        }
        sum += row_sum * down[y].weight[j];
      }
      half.texels[std::size_t{y} * half.width + x] = sum;
    }
  }
  return half;
}

MipLevel encode(const FloatLevel& level, bool is_srgb) {
  MipLevel encoded{level.width, level.height, std::vector<std::uint8_t>(level.texels.size() * 4)};
  for (std::size_t i = 0; i < level.texels.size(); ++i) {
    for (int c = 0; c < 4; ++c) {
      const float value = level.texels[i][c];
      encoded.rgba[i * 4 + static_cast<std::size_t>(c)] =
          is_srgb && c < 3 ? encode_srgb(value) : static_cast<std::uint8_t>(std::min(value, 1.0F) * 255.0F + 0.5F);
    }
  }
  return encoded;
}

}  // namespace

float decode_srgb(std::uint8_t value) {
  return tables().decoded[value];
}

std::uint8_t encode_srgb(float linear) {
  const SrgbTables& t = tables();
  const float clamped = linear > 0.0F ? std::min(linear, 1.0F) : 0.0F;
  std::size_t code = t.first[static_cast<std::size_t>(clamped * static_cast<float>(SrgbTables::kBuckets))];
  while (clamped >= t.limit[code + 1]) {
    ++code;
  }
  return static_cast<std::uint8_t>(code);
}

std::uint32_t mip_count(std::uint32_t width, std::uint32_t height) {
  return static_cast<std::uint32_t>(std::bit_width(std::max({width, height, 1U})));
}

std::vector<MipLevel> make_mips(const Texture& texture) {
  const std::uint32_t count = mip_count(texture.width, texture.height);
  std::vector<MipLevel> mips;
  mips.reserve(count);
  mips.push_back({texture.width, texture.height, texture.rgba});
  if (count == 1) {
    return mips;
  }
  std::array<float, 256> data{};
  for (std::size_t i = 0; i < data.size(); ++i) {
    data[i] = static_cast<float>(i) / 255.0F;
  }
  const std::array<float, 256>& color = texture.is_srgb ? tables().decoded : data;
  FloatLevel level = halve(texture.width, texture.height, [&](std::size_t texel) {
    const std::uint8_t* from = texture.rgba.data() + texel * 4;
    return glm::vec4(color[from[0]], color[from[1]], color[from[2]], data[from[3]]);
  });
  mips.push_back(encode(level, texture.is_srgb));
  while (mips.size() < count) {
    level = halve(level.width, level.height, [&](std::size_t texel) { return level.texels[texel]; });
    mips.push_back(encode(level, texture.is_srgb));
  }
  return mips;
}

std::vector<glm::vec4> make_mips(std::uint32_t width, std::uint32_t height, std::vector<glm::vec4> texels) {
  glm::vec4 low = texels.front(), high = low;
  for (const glm::vec4& texel : texels) {
    low = glm::min(low, texel);
    high = glm::max(high, texel);
  }
  std::size_t above = 0;
  for (std::uint32_t count = mip_count(width, height); count > 1; --count) {
    const FloatLevel half = halve(width, height, [&](std::size_t texel) { return texels[above + texel]; });
    above = texels.size();
    // Weights are rounded: without the bounds a constant would change by an ulp.
    for (const glm::vec4& texel : half.texels) texels.push_back(glm::clamp(texel, low, high));
    width = half.width;
    height = half.height;
  }
  return texels;
}

}  // namespace heddle::scene
