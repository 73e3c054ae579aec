// SPDX-License-Identifier: Apache-2.0
#include "compare.hpp"

#include <cmath>
#include <cstring>

namespace baked_visibility {

namespace depth_test {
using glm::vec4;
using std::floor;
using std::sqrt;
#define precise
#include "depth_test.glsl"
#undef precise
}  // namespace depth_test

namespace {

float depth_at(const DepthMap& map, int x, int y) {
  const std::size_t at = static_cast<std::size_t>(y) * map.side + static_cast<std::size_t>(x);
  if (map.is_16_bit) {
    std::uint16_t step = 0;
    std::memcpy(&step, static_cast<const std::byte*>(map.texels) + 2 * at, sizeof step);
    return static_cast<float>(step) / 65535.0F;
  }
  float depth = 0;
  std::memcpy(&depth, static_cast<const std::byte*>(map.texels) + 4 * at, sizeof depth);
  return depth;
}

}  // namespace

std::uint64_t compare_depths(const DepthMap& map, std::span<const glm::vec4> row, const BakePush& push,
                             std::span<const glm::vec4> elements, std::span<Sums> sums) {
  std::uint64_t tests = 0;
  const auto side = static_cast<int>(map.side);
  for (std::size_t e = 0; e < sums.size(); ++e) {
    const glm::vec4& position = elements[BAKE_VECTORS_PER_ELEMENT * e];
    const glm::vec4& direction = row[3];
    const float h = depth_test::cosine(elements[BAKE_VECTORS_PER_ELEMENT * e + 1], direction);
    if (!(h > 0.0F)) continue;
    sums[e].weight += static_cast<double>(h);
    const float slope = depth_test::cosine(elements[BAKE_VECTORS_PER_ELEMENT * e + 2], direction);
    if (!(slope > 0.0F)) continue;
    const int x = depth_test::texel_of(depth_test::project(row[0], position), side);
    const int y = depth_test::texel_of(depth_test::project(row[1], position), side);
    if (x >= 0 && y >= 0 && x < side && y < side) {
      ++tests;
      const float bias = depth_test::depth_bias(slope, push.bias_slope, push.bias_constant, push.bias_limit);
      if (!depth_test::is_open(depth_test::project(row[2], position), depth_at(map, x, y), bias, push.depth_steps))
        continue;
    }
    sums[e].open += static_cast<double>(h);
    for (int c = 0; c < 3; ++c)
      sums[e].bent[static_cast<std::size_t>(c)] += static_cast<double>(h) * static_cast<double>(direction[c]);
  }
  return tests;
}

void collect_split(std::span<const std::uint8_t> target, std::span<Sums> sums) {
  for (std::size_t e = 0; e < sums.size(); ++e) {
    sums[e].weight += (16 * target[4 * e] + target[4 * e + 1]) / 255.0;
    sums[e].open += (16 * target[4 * e + 2] + target[4 * e + 3]) / 255.0;
  }
}

}  // namespace baked_visibility
