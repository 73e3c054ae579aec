// SPDX-License-Identifier: Apache-2.0
// A texture -> its whole mip chain, by an area-weighted box filter in linear float; 8-bit ones are encoded again for
// each level.
#pragma once

#include "scene/scene.hpp"

namespace heddle::scene {

struct MipLevel {
  std::uint32_t width = 0, height = 0;
  std::vector<std::uint8_t> rgba;
};

/// 1 + floor(log2(longer side)).
std::uint32_t mip_count(std::uint32_t width, std::uint32_t height);

/// Level 0 (the texture's own bytes) to 1 x 1. Each level is averaged from the unrounded one above; texels of levels
/// with odd sizes share theirs by area, so no row is lost. Colour is averaged decoded, alpha and data as they are.
std::vector<MipLevel> make_mips(const Texture& texture);

/// The same of float texels, RGBA; all levels behind each other. No level has a texel beyond the texture's range.
std::vector<glm::vec4> make_mips(std::uint32_t width, std::uint32_t height, std::vector<glm::vec4> texels);

/// sRGB's transfer functions (IEC 61966-2-1).
float decode_srgb(std::uint8_t value);
std::uint8_t encode_srgb(float linear);

}  // namespace heddle::scene
