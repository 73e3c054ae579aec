// SPDX-License-Identifier: Apache-2.0
// The scene's normal maps, and texture coordinates -> the bump there. What surface_sample.glsl shades with, in float64.
#pragma once

#include "scene_texture.hpp"

#include <heddle/pass.hpp>

#include <optional>
#include <vector>

/// Borrows from the host for one call of declare or execute.
class NormalMaps {
 public:
  heddle_status read(const heddle::pass::PassHost& host) {
    const auto* service = host.service<heddle_materials_service>(HEDDLE_MATERIALS_SERVICE);
    if (service == nullptr) return host.fail(HEDDLE_UNSUPPORTED, "this host has no service " HEDDLE_MATERIALS_SERVICE);
    heddle_scene_look look{};
    look.struct_size = sizeof look;
    if (const heddle_status status = service->look(host.raw(), &look); status != HEDDLE_OK) return status;
    maps_.assign(look.material_count, {});
    for (std::uint32_t m = 0; m < look.material_count; ++m) {
      heddle_scene_material material{};
      material.struct_size = sizeof material;
      if (const heddle_status status = service->material(host.raw(), m, &material); status != HEDDLE_OK) return status;
      const std::uint32_t texture = material.textures[HEDDLE_TEXTURE_NORMAL];
      if (texture == HEDDLE_NO_IMAGE) continue;
      Map& map = maps_[m].emplace();
      map.record = material.record;
      map.texture.struct_size = sizeof map.texture;
      if (const heddle_status status = service->texture(host.raw(), texture, &map.texture); status != HEDDLE_OK)
        return status;
    }
    return HEDDLE_OK;
  }

  [[nodiscard]] bool has(std::uint32_t material) const { return material < maps_.size() && maps_[material]; }
  /// Of a material that has one: the set of texture coordinates, 0 or 1.
  [[nodiscard]] std::uint32_t uv_set(std::uint32_t material) const {
    return maps_[material]->record->texture_uv_sets >> HEDDLE_TEXTURE_NORMAL & 1U;
  }
  /// Parts of the tangent, the bitangent and the normal, of any length.
  [[nodiscard]] glm::dvec3 bump(std::uint32_t material, const glm::dvec2& uv) const {
    const Map& map = *maps_[material];
    const glm::dvec2 at = scene_texture::transformed(*map.record, HEDDLE_TEXTURE_NORMAL, uv);
    glm::dvec3 bump = glm::dvec3(scene_texture::filter(map.texture, at)) * 2.0 - 1.0;
    bump.x *= static_cast<double>(map.record->normal_scale);
    bump.y *= static_cast<double>(map.record->normal_scale);
    return bump;
  }

 private:
  struct Map {
    const HeddleMaterial* record = nullptr;
    heddle_scene_texture texture{};
  };
  std::vector<std::optional<Map>> maps_;  // by material
};
