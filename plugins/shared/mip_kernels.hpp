// SPDX-License-Identifier: Apache-2.0
// A level of a texture -> the next coarser one: separable kernels over texels of the finer level, in linear light.
// Even kernels stand between texels, so that texel i of a level lies over texels 2 i and 2 i + 1 of the finer one, as
// levels of the hardware do. Odd ones stand on texel 2 i: texel centres of a level are texel centres of all finer ones.
// Source  Mittring 2008, "Advanced Virtual Texture Topics": 2x2, 4x4 and 3x3, 5x5 kernels, Gauss and sharpening;
// weights
//         of 3x3 from there, the others binomial, or binomial less what it has beyond the neighbours
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace heddle::mip_kernels {

/// As parameters name them; even ones first.
enum Kernel : std::uint32_t { kBox2, kGauss4, kSharpen4, kGauss3, kGauss5, kSharpen5 };
inline constexpr std::uint32_t kKernelCount = 6;

struct Taps {
  std::uint32_t count = 0;
  std::int32_t first = 0;  // of the finer level's texels, counted from 2 i
  std::array<float, 5> weights{};
};

inline constexpr std::array<Taps, kKernelCount> kTaps = {{
    {2, 0, {0.5F, 0.5F}},
    {4, -1, {0.125F, 0.375F, 0.375F, 0.125F}},
    {4, -1, {-0.125F, 0.625F, 0.625F, -0.125F}},
    {3, -1, {0.25F, 0.5F, 0.25F}},
    {5, -2, {0.0625F, 0.25F, 0.375F, 0.25F, 0.0625F}},
    {5, -2, {-0.125F, 0.25F, 0.75F, 0.25F, -0.125F}},
}};

/// Texels of a level sit on texels of the finer one: the place of texel i is i 2^level, not (i + 1/2) 2^level - 1/2.
constexpr bool is_vertex_centred(std::uint32_t kernel) {
  return kernel >= kGauss3;
}
/// Texels of the finer level beyond 2 i and 2 i + 1 that are read on each side, at most.
inline constexpr std::uint32_t kMargin = 2;

/// `from`: three planes of (2 w + 2 kMargin) x (2 h + 2 kMargin) texels around those of the part; `to`: of w x h.
inline void halve(std::uint32_t kernel, std::uint32_t w, std::uint32_t h, std::span<const float> from,
                  std::span<float> to, std::vector<float>& scratch) {
  const Taps& taps = kTaps[kernel];
  const std::size_t wide = 2 * std::size_t{w} + 2 * kMargin, high = 2 * std::size_t{h} + 2 * kMargin;
  scratch.resize(high * w);
  for (std::size_t plane = 0; plane < 3; ++plane) {
    const float* in = from.data() + plane * wide * high;
    for (std::size_t y = 0; y < high; ++y) {
      const float* row = in + y * wide + static_cast<std::size_t>(static_cast<std::int32_t>(kMargin) + taps.first);
      for (std::size_t x = 0; x < w; ++x) {
        float sum = 0;
        for (std::size_t k = 0; k < taps.count; ++k) sum += taps.weights[k] * row[2 * x + k];
        scratch[y * w + x] = sum;
      }
    }
    float* out = to.data() + plane * w * std::size_t{h};
    for (std::size_t y = 0; y < h; ++y) {
      const float* rows =
          scratch.data() + (2 * y + static_cast<std::size_t>(static_cast<std::int32_t>(kMargin) + taps.first)) * w;
      for (std::size_t x = 0; x < w; ++x) {
        float sum = 0;
        for (std::size_t k = 0; k < taps.count; ++k) sum += taps.weights[k] * rows[k * w + x];
        out[y * w + x] = sum;
      }
    }
  }
}

}  // namespace heddle::mip_kernels
