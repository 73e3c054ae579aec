// SPDX-License-Identifier: Apache-2.0
// Questions to a material record: its textures' transforms, what it covers.
#include <algorithm>

#include "scene/scene.hpp"

namespace heddle::scene {
namespace {

/// Places of a texture's transform in the record, which has no arrays of its own for GLSL's sake.
template <typename Record>
auto places(Record& record, std::uint32_t texture) {
  switch (texture) {
    case HEDDLE_TEXTURE_METALLIC_ROUGHNESS:
      return std::pair(&record.uv_rotation_scale_1[0], &record.uv_offset_1_2[0]);
    case HEDDLE_TEXTURE_NORMAL:
      return std::pair(&record.uv_rotation_scale_2[0], &record.uv_offset_1_2[2]);
    case HEDDLE_TEXTURE_OCCLUSION:
      return std::pair(&record.uv_rotation_scale_3[0], &record.uv_offset_3_4[0]);
    case HEDDLE_TEXTURE_EMISSIVE:
      return std::pair(&record.uv_rotation_scale_4[0], &record.uv_offset_3_4[2]);
    default:
      return std::pair(&record.uv_rotation_scale[0], &record.uv_offset[0]);
  }
}

}  // namespace

TextureTransform texture_transform(const HeddleMaterial& record, std::uint32_t texture) {
  const auto [matrix, offset] = places(record, texture);
  TextureTransform transform;
  std::copy_n(matrix, 4, transform.matrix.begin());
  std::copy_n(offset, 2, transform.offset.begin());
  const bool is_absent =
      texture != HEDDLE_TEXTURE_BASE_COLOR && std::all_of(matrix, matrix + 4, [](float value) { return value == 0; });
  return is_absent ? texture_transform(record, HEDDLE_TEXTURE_BASE_COLOR) : transform;
}

void set_texture_transform(HeddleMaterial& record, std::uint32_t texture, const TextureTransform& transform) {
  const auto [matrix, offset] = places(record, texture);
  std::copy(transform.matrix.begin(), transform.matrix.end(), matrix);
  std::copy(transform.offset.begin(), transform.offset.end(), offset);
}

bool is_blended(const HeddleMaterial& material) {
  return material.alpha_mode == HEDDLE_ALPHA_BLEND || material.transmission > 0;
}

std::uint32_t surface_flags(const HeddleMaterial& material) {
  std::uint32_t flags = HEDDLE_SURFACE_OPAQUE | HEDDLE_SURFACE_CASTS_SHADOW;
  if (is_blended(material)) {
    flags = HEDDLE_SURFACE_BLENDED;
  } else if (material.alpha_mode == HEDDLE_ALPHA_MASK) {
    flags = HEDDLE_SURFACE_MASKED | HEDDLE_SURFACE_CASTS_SHADOW;
  }
  return flags | ((material.flags & HEDDLE_MATERIAL_DOUBLE_SIDED) != 0 ? HEDDLE_SURFACE_DOUBLE_SIDED : 0U);
}

}  // namespace heddle::scene
