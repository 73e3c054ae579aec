// SPDX-License-Identifier: Apache-2.0
// The scene's components texture_source.virtual -> its textures, each once, and which material shows what part of
// which.
#pragma once

#include <heddle/pass.hpp>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <string>
#include <vector>

#include "texture_store.hpp"
#include "texture_tiles.hpp"

namespace heddle::texture_tiles {

inline constexpr const char* kComponent = "texture_source.virtual";
/// Charts begin on tiles of every size that techniques offer.
inline constexpr std::uint32_t kLargestTile = 256;

struct MaterialTexture {
  std::uint32_t material = 0;                              // id
  std::uint32_t texture = 0;                               // index
  std::uint32_t chart_size = 0, chart_x = 0, chart_y = 0;  // texels of level 0
};

struct SceneTextures {
  std::vector<Texture> textures;
  std::vector<MaterialTexture> materials;
};

/// frame NULL: in declare. Errors name the material and what is wrong with its component. store: what is bound, or
/// nothing.
inline heddle_status scene_textures(const pass::PassHost& host, heddle_frame* frame, const texture_store::Store* store,
                                    SceneTextures& out) {
  std::optional<pass::Components> table;
  if (const heddle_status status = pass::components(host, frame, kComponent, table); status != HEDDLE_OK) return status;
  out = {};
  for (std::uint32_t row = 0; row < table->count(); ++row) {
    if (table->owner_kind(row) != HEDDLE_OWNER_MATERIAL) continue;
    const auto number = [&](const char* name) { return static_cast<std::uint32_t>(table->values(row, name)[0]); };
    const auto wrong = [&](const char* property, std::uint32_t value, const std::string& expected) {
      return host.fail(HEDDLE_BAD_INPUT, "material " + std::to_string(table->owner(row)) + ": " + kComponent + "." +
                                             property + " is " + std::to_string(value) + "; expected: " + expected);
    };
    Texture texture{number("source"), number("extent"), number("seed"), number("address"), 0};
    if (texture.source == kStored) {
      const std::uint32_t image = number("image");
      const std::size_t count = store == nullptr ? 0 : store->textures.size();
      if (store == nullptr)
        return host.fail(HEDDLE_BAD_INPUT,
                         "material " + std::to_string(table->owner(row)) + ": " + kComponent +
                             ".source is \"stored\", and input 'store' is bound to nothing; expected: "
                             "inputs.store = \"image_store.toml#store\", or another job's artifact");
      if (image >= count) return wrong("image", image, "less than " + std::to_string(count) + ", which the store has");
      if (texture.address != store->header.address)
        return wrong("address", texture.address,
                     "that of the store, " + std::to_string(store->header.address) +
                         " (0 wrap, 1 mirror, 2 clamp), which its borders are made for");
      texture = {kStored, store->textures[image].extent, 0, texture.address, image};
    }
    if (!std::has_single_bit(texture.extent)) return wrong("extent", texture.extent, "a power of two");
    MaterialTexture material{table->owner(row), 0, number("chart_size"), number("chart_x"), number("chart_y")};
    if (material.chart_size == 0) material.chart_size = texture.extent;
    if (!std::has_single_bit(material.chart_size) || material.chart_size < kLargestTile)
      return wrong("chart_size", material.chart_size,
                   "a power of two from " + std::to_string(kLargestTile) + " on, or 0");
    for (const auto& [name, value] : {std::pair("chart_x", material.chart_x), std::pair("chart_y", material.chart_y)})
      if (value % material.chart_size != 0)
        return wrong(name, value, "a multiple of chart_size, " + std::to_string(material.chart_size));
    const auto found = std::ranges::find(out.textures, texture);
    material.texture = static_cast<std::uint32_t>(found - out.textures.begin());
    if (found == out.textures.end()) out.textures.push_back(texture);
    out.materials.push_back(material);
  }
  return HEDDLE_OK;
}

/// uvec4 a material, by id: how many records a table of them needs.
inline std::uint32_t material_end(const SceneTextures& scene) {
  std::uint32_t end = 0;
  for (const MaterialTexture& material : scene.materials) end = std::max(end, material.material + 1);
  return end;
}

/// Halvings from `size` texels to one tile.
inline std::uint32_t tile_levels(std::uint32_t size, std::uint32_t tile) {
  return static_cast<std::uint32_t>(std::countr_zero(size / tile));
}

}  // namespace heddle::texture_tiles
