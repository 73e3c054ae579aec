// SPDX-License-Identifier: Apache-2.0
// All levels of a texture, the whole of each in memory, filtered texel by texel from the definition of the kernel: what
// a build out of core must equal to the bit.
#pragma once

#include <cstdint>
#include <vector>

#include "texture_store/tiled/pyramid.hpp"

namespace heddle_test {

using heddle::texture_tiles::addressed;
using heddle::texture_tiles::Rgba8;

struct InCore {
  std::uint32_t address = 0;
  std::vector<std::vector<Rgba8>> levels;
  std::vector<std::uint32_t> extents;

  [[nodiscard]] const Rgba8& at(std::uint32_t level, std::int64_t x, std::int64_t y) const {
    const std::uint32_t extent = extents[level];
    return levels[level][std::size_t{extent} * addressed(y, extent, address) + addressed(x, extent, address)];
  }
  void halve(std::uint32_t kernel) {
    const auto finer = static_cast<std::uint32_t>(levels.size()) - 1;
    const std::uint32_t extent = extents.back() / 2;
    const heddle::mip_kernels::Taps& taps = heddle::mip_kernels::kTaps[kernel];
    const auto& linear = heddle::texture_store::linear_of_codes();
    std::vector<Rgba8> out;
    for (std::int64_t y = 0; y < extent; ++y) {
      for (std::int64_t x = 0; x < extent; ++x) {
        float rgb[3] = {};
        for (int c = 0; c < 3; ++c) {
          for (std::uint32_t j = 0; j < taps.count; ++j) {
            float row = 0;
            for (std::uint32_t i = 0; i < taps.count; ++i) {
              const Rgba8& texel = at(finer, 2 * x + taps.first + i, 2 * y + taps.first + j);
              row += taps.weights[i] * linear[c == 0 ? texel.r : c == 1 ? texel.g : texel.b];
            }
            rgb[c] += taps.weights[j] * row;
          }
        }
        using heddle::texture_store::code_of_linear;
        out.push_back({code_of_linear(rgb[0]), code_of_linear(rgb[1]), code_of_linear(rgb[2]), 255});
      }
    }
    levels.push_back(std::move(out));
    extents.push_back(extent);
  }
};

}  // namespace heddle_test
