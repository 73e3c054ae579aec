// SPDX-License-Identifier: Apache-2.0
// A depth map in host memory and the elements -> their sums, by the very arithmetic of the shaders.
#pragma once

#include "bake_elements.hpp"
#include "params.h"

#include <span>

namespace baked_visibility {

struct DepthMap {
  const void* texels = nullptr;  // rows without gaps
  bool is_16_bit = false;        // else float32
  std::uint32_t side = 0;
};

/// `row`: the direction's four vec4 (params.h). How many elements looked at a texel.
std::uint64_t compare_depths(const DepthMap& map, std::span<const glm::vec4> row, const BakePush& push,
                             std::span<const glm::vec4> elements, std::span<Sums> sums);

/// Sums of what `split.frag.glsl` added up, 4 bytes an element.
void collect_split(std::span<const std::uint8_t> target, std::span<Sums> sums);

}  // namespace baked_visibility
