// SPDX-License-Identifier: Apache-2.0
// An image -> a light's texture with its mip chain; the textures of a scene -> one value.
#include "scene/light_texture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "scene/mips.hpp"

namespace heddle::scene {
namespace {

// 85 MiB with its levels: less than the 128 MiB that every device's shaders reach.
constexpr std::uint32_t kMostTexels = 2048;
// Times an intensity of 1e18 and a solid angle it is still finite.
constexpr float kBrightest = 1e18F;

}  // namespace

std::shared_ptr<const LightTexture> make_light_texture(std::string_view what, std::uint32_t width, std::uint32_t height,
                                                       std::uint32_t channels, std::span<const float> pixels) {
  const auto is_side = [](std::uint32_t size) { return size >= 1 && size <= kMostTexels; };
  if (!is_side(width) || !is_side(height)) {
    throw Error(HEDDLE_BAD_INPUT, fmt::format("{}: its texture is {} x {} texels: expected 1 to {} each", what, width,
                                              height, kMostTexels));
  }
  if (channels != 1 && channels != 3 && channels != 4) {
    throw Error(HEDDLE_BAD_INPUT, fmt::format("{}: its texture has {} channels: expected 1, 3 or 4", what, channels));
  }
  const std::size_t count = std::size_t{width} * height;
  std::vector<glm::vec4> texels(count, glm::vec4(1.0F));
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      const float value = pixels[i * channels + (channels == 1 ? 0 : c)];
      if (!(value >= 0 && value <= kBrightest)) {
        throw Error(HEDDLE_BAD_INPUT, fmt::format("{}: its texture's texel {}, {} is {}: expected 0 to {}", what,
                                                  i % width, i / width, value, kBrightest));
      }
      texels[i][static_cast<glm::length_t>(c)] = value + 0.0F;
    }
  }
  auto made = std::make_shared<LightTexture>();
  made->width = width;
  made->height = height;
  made->level_count = mip_count(width, height);
  made->texels = make_mips(width, height, std::move(texels));
  made->revision = Scene::new_revision();
  return made;
}

std::vector<const LightTexture*> light_textures(const Scene& scene) {
  std::vector<const LightTexture*> textures;
  for (const Light& light : scene.lights) {
    if (light.texture == nullptr || light.record.type != HEDDLE_LIGHT_RECTANGLE) continue;
    if (std::find(textures.begin(), textures.end(), light.texture.get()) == textures.end()) {
      textures.push_back(light.texture.get());
    }
  }
  return textures;
}

std::uint32_t light_texture_number(const Light& light, std::span<const LightTexture* const> textures) {
  if (light.texture == nullptr || light.record.type != HEDDLE_LIGHT_RECTANGLE) return 0;
  const auto found = std::find(textures.begin(), textures.end(), light.texture.get());
  return found == textures.end() ? 0 : static_cast<std::uint32_t>(found - textures.begin()) + 1;
}

std::vector<std::byte> light_texture_elements(std::span<const LightTexture* const> textures) {
  static_assert(sizeof(HeddleLightTexture) == sizeof(glm::vec4));
  std::size_t elements = textures.size();
  std::vector<HeddleLightTexture> heads;
  for (const LightTexture* texture : textures) {
    heads.push_back({static_cast<std::uint32_t>(elements), texture->width, texture->height, texture->level_count});
    elements += texture->texels.size();
  }
  std::vector<std::byte> bytes;
  bytes.reserve(elements * sizeof(glm::vec4));
  const auto append = [&](std::span<const std::byte> part) { bytes.insert(bytes.end(), part.begin(), part.end()); };
  append(std::as_bytes(std::span(heads)));
  for (const LightTexture* texture : textures) append(std::as_bytes(std::span(texture->texels)));
  return bytes;
}

}  // namespace heddle::scene
