// SPDX-License-Identifier: Apache-2.0
// Images on rectangle lights: checked, filtered, and as the scene's value `light_textures`.
#pragma once

#include "scene/scene.hpp"

namespace heddle::scene {

/// `what` names it in errors: "light 'screen'". Pixels as in heddle_image. Throws Error(HEDDLE_BAD_INPUT) with the
/// first texel that is negative, not finite or too large.
std::shared_ptr<const LightTexture> make_light_texture(std::string_view what, std::uint32_t width, std::uint32_t height,
                                                       std::uint32_t channels, std::span<const float> pixels);

/// Textures of the scene's rectangles, each once, in the order of the lights.
std::vector<const LightTexture*> light_textures(const Scene& scene);
/// 1 + the light's place in that list; 0: none.
std::uint32_t light_texture_number(const Light& light, std::span<const LightTexture* const> textures);
/// Heads (HeddleLightTexture), then texels.
std::vector<std::byte> light_texture_elements(std::span<const LightTexture* const> textures);

}  // namespace heddle::scene
