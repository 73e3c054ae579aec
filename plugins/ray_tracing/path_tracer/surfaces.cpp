// SPDX-License-Identifier: Apache-2.0
#include "surfaces.hpp"

#include "content_hash.hpp"

#include <algorithm>
#include <cmath>

namespace heddle::path_tracer {
namespace {

using glm::dvec2;
using glm::dvec3;
using glm::dvec4;

/// sRGB's transfer function (IEC 61966-2-1) of every byte.
const std::array<double, 256> kDecoded = [] {
  std::array<double, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i) {
    const double x = static_cast<double>(i) / 255.0;
    table[i] = x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4);
  }
  return table;
}();

std::int64_t wrapped(std::int64_t texel, std::int64_t size, std::uint32_t mode) {
  if (mode == HEDDLE_WRAP_CLAMP) return std::clamp<std::int64_t>(texel, 0, size - 1);
  const std::int64_t period = mode == HEDDLE_WRAP_MIRROR ? 2 * size : size;
  const std::int64_t place = ((texel % period) + period) % period;
  return place < size ? place : period - 1 - place;
}

dvec4 texel(const heddle_scene_texture& texture, std::int64_t column, std::int64_t row) {
  const auto x = static_cast<std::size_t>(wrapped(column, texture.width, texture.wrap[0]));
  const auto y = static_cast<std::size_t>(wrapped(row, texture.height, texture.wrap[1]));
  const std::uint8_t* rgba = texture.rgba + 4 * (y * texture.width + x);
  const double alpha = rgba[3] / 255.0;
  if (texture.is_srgb != 0) return {kDecoded[rgba[0]], kDecoded[rgba[1]], kDecoded[rgba[2]], alpha};
  return {rgba[0] / 255.0, rgba[1] / 255.0, rgba[2] / 255.0, alpha};
}

/// As a GPU filters the finest level: texel centres at halves.
dvec4 filter(const heddle_scene_texture& texture, const dvec2& uv) {
  // Beyond this, coordinates in float32 say nothing about texels any more.
  constexpr double kLimit = 1e6;
  const dvec2 at = glm::clamp(uv, -kLimit, kLimit) * dvec2(texture.width, texture.height) - 0.5;
  if (texture.is_nearest != 0)
    return texel(texture, std::llround(std::floor(at.x + 0.5)), std::llround(std::floor(at.y + 0.5)));
  const dvec2 low = glm::floor(at), t = at - low;
  const auto x = static_cast<std::int64_t>(low.x), y = static_cast<std::int64_t>(low.y);
  const dvec4 above = glm::mix(texel(texture, x, y), texel(texture, x + 1, y), t.x);
  const dvec4 below = glm::mix(texel(texture, x, y + 1), texel(texture, x + 1, y + 1), t.x);
  return glm::mix(above, below, t.y);
}

/// KHR_texture_transform of one texture; a matrix that is all zero stands for the base colour's.
dvec2 transformed(const HeddleMaterial& record, std::uint32_t slot, const dvec2& uv) {
  const float* matrix = record.uv_rotation_scale;
  const float* offset = record.uv_offset;
  const std::array<const float*, 5> matrices{record.uv_rotation_scale, record.uv_rotation_scale_1,
                                             record.uv_rotation_scale_2, record.uv_rotation_scale_3,
                                             record.uv_rotation_scale_4};
  const std::array<const float*, 5> offsets{record.uv_offset, record.uv_offset_1_2, record.uv_offset_1_2 + 2,
                                            record.uv_offset_3_4, record.uv_offset_3_4 + 2};
  const float* own = matrices[slot];
  if (own[0] != 0.0F || own[1] != 0.0F || own[2] != 0.0F || own[3] != 0.0F) {
    matrix = own;
    offset = offsets[slot];
  }
  const auto d = [](float x) { return static_cast<double>(x); };
  return {d(matrix[0]) * uv.x + d(matrix[2]) * uv.y + d(offset[0]),
          d(matrix[1]) * uv.x + d(matrix[3]) * uv.y + d(offset[1])};
}

dvec3 rgb(const float* values) {
  return {values[0], values[1], values[2]};
}

dvec3 unit_or(const dvec3& v, const dvec3& otherwise) {
  const double length = glm::length(v);
  return length > 0.0 ? v / length : otherwise;
}

}  // namespace

bool Surfaces::update(const heddle_pass_host* host, const heddle_materials_service& service,
                      const heddle_snapshot& snapshot) {
  snapshot_ = &snapshot;
  heddle_scene_look look{};
  look.struct_size = sizeof look;
  attributes_ = {};
  attributes_.struct_size = sizeof attributes_;
  if (service.look(host, &look) != HEDDLE_OK || service.attributes(host, &snapshot, &attributes_) != HEDDLE_OK)
    return false;
  materials_.assign(look.material_count, {});
  for (std::uint32_t i = 0; i < look.material_count; ++i) {
    materials_[i].struct_size = sizeof(heddle_scene_material);
    if (service.material(host, i, &materials_[i]) != HEDDLE_OK) return false;
  }
  textures_.assign(look.texture_count, {});
  for (std::uint32_t i = 0; i < look.texture_count; ++i) {
    textures_[i].struct_size = sizeof(heddle_scene_texture);
    if (service.texture(host, i, &textures_[i]) != HEDDLE_OK) return false;
  }
  return true;
}

std::uint64_t Surfaces::hash() const {
  ContentHash hash;
  for (const heddle_scene_material& material : materials_) {
    hash.add(*material.record);
    hash.add(material.textures);
  }
  for (const heddle_scene_texture& texture : textures_) {
    hash.add(texture.width);
    hash.add(texture.height);
    hash.add(texture.is_srgb);
    hash.add(texture.wrap);
    hash.add(texture.is_nearest);
    hash.add_bytes(texture.rgba, std::size_t{4} * texture.width * texture.height);
  }
  return hash.value();
}

Surfaces::Corners Surfaces::corners(std::uint32_t triangle, double u, double v) const {
  const std::uint32_t* indices = snapshot_->indices + std::size_t{triangle} * 3;
  return {{indices[0], indices[1], indices[2]}, {1.0 - u - v, u, v}};
}

template <glm::length_t kSize>
glm::vec<kSize, double> Surfaces::interpolate(const float* values, const Corners& corners) const {
  glm::vec<kSize, double> sum(0.0);
  for (std::size_t k = 0; k < 3; ++k)
    for (glm::length_t i = 0; i < kSize; ++i)
      sum[i] += corners.weights[k] *
                static_cast<double>(values[std::size_t{corners.vertices[k]} * kSize + static_cast<std::size_t>(i)]);
  return sum;
}

std::optional<dvec4> Surfaces::sample(const heddle_scene_material& material, std::uint32_t slot,
                                      const Corners& corners) const {
  const std::uint32_t image = material.textures[slot];
  if (image >= textures_.size()) return std::nullopt;
  const bool uses_uv1 = (material.record->texture_uv_sets & (1U << slot)) != 0;
  const dvec2 uv = interpolate<2>(uses_uv1 ? attributes_.uvs_1 : snapshot_->uvs, corners);
  return filter(textures_[image], transformed(*material.record, slot, uv));
}

dvec4 Surfaces::vertex_color(const Corners& corners) const {
  constexpr std::uint32_t kWhite = 0xffffffffU;
  const std::uint32_t all[] = {attributes_.colors[corners.vertices[0]], attributes_.colors[corners.vertices[1]],
                               attributes_.colors[corners.vertices[2]]};
  if ((all[0] & all[1] & all[2]) == kWhite) return dvec4(1.0);
  dvec4 sum(0.0);
  for (std::size_t k = 0; k < 3; ++k)
    for (glm::length_t c = 0; c < 4; ++c)
      sum[c] += corners.weights[k] * ((all[k] >> (8U * static_cast<unsigned>(c))) & 255U) / 255.0;
  return sum;
}

bool Surfaces::can_shine(std::uint32_t triangle) const {
  const HeddleMaterial& record = *materials_[snapshot_->materials[triangle]].record;
  const bool is_dark = record.emissive[0] <= 0.0F && record.emissive[1] <= 0.0F && record.emissive[2] <= 0.0F;
  return !is_dark && (record.flags & HEDDLE_MATERIAL_UNLIT) == 0;
}

bool Surfaces::is_double_sided(std::uint32_t triangle) const {
  return (snapshot_->flags[triangle] & HEDDLE_SURFACE_DOUBLE_SIDED) != 0;
}

dvec3 Surfaces::emissive(std::uint32_t triangle, double u, double v) const {
  const heddle_scene_material& material = materials_[snapshot_->materials[triangle]];
  if (!can_shine(triangle)) return dvec3(0.0);
  dvec3 sum = rgb(material.record->emissive);
  if (const auto texel = sample(material, HEDDLE_TEXTURE_EMISSIVE, corners(triangle, u, v))) sum *= dvec3(*texel);
  return glm::max(sum, 0.0);
}

Surface Surfaces::at(const Geometry& geometry, const Hit& hit, const dvec3& to_viewer) const {
  const heddle_scene_material& material = materials_[snapshot_->materials[hit.triangle]];
  const HeddleMaterial& record = *material.record;
  const Corners where = corners(hit.triangle, hit.u, hit.v);
  Surface s;
  s.foot = geometry.foot(hit.triangle, hit.u, hit.v);
  s.is_front = glm::dot(s.foot.facet, to_viewer) >= 0.0;
  s.facet = s.is_front ? s.foot.facet : -s.foot.facet;
  const std::uint32_t flags = snapshot_->flags[hit.triangle];
  s.is_double_sided = (flags & HEDDLE_SURFACE_DOUBLE_SIDED) != 0;
  s.is_blended = (flags & HEDDLE_SURFACE_BLENDED) != 0;
  s.is_unlit = (record.flags & HEDDLE_MATERIAL_UNLIT) != 0;

  dvec4 color(record.base_color[0], record.base_color[1], record.base_color[2], record.base_color[3]);
  color *= vertex_color(where);
  if (const auto texel = sample(material, HEDDLE_TEXTURE_BASE_COLOR, where)) color *= *texel;
  double metalness = static_cast<double>(record.metalness), roughness = static_cast<double>(record.roughness);
  if (const auto texel = sample(material, HEDDLE_TEXTURE_METALLIC_ROUGHNESS, where)) {
    roughness *= texel->g;
    metalness *= texel->b;
  }

  const double side = s.is_front ? 1.0 : -1.0;
  const dvec3 along = interpolate<3>(snapshot_->normals, where);
  s.normal_geometric = side * unit_or(along, s.foot.facet);
  s.normal = s.normal_geometric;
  if (const auto texel = sample(material, HEDDLE_TEXTURE_NORMAL, where)) {
    const dvec4 tangent = interpolate<4>(attributes_.tangents, where);
    if (glm::dot(dvec3(tangent), dvec3(tangent)) > 0.0) {
      dvec3 bump = dvec3(*texel) * 2.0 - 1.0;
      bump.x *= static_cast<double>(record.normal_scale);
      bump.y *= static_cast<double>(record.normal_scale);
      const dvec3 bitangent = tangent.w * glm::cross(along, dvec3(tangent));
      const dvec3 mapped = bump.x * dvec3(tangent) + bump.y * bitangent + bump.z * along;
      s.normal = side * unit_or(mapped, s.foot.facet);
    }
  }
  const double NoV = glm::dot(s.normal, to_viewer);
  if (NoV < 0.0) s.normal = unit_or(s.normal - to_viewer * NoV, s.facet);

  s.point.struct_size = sizeof s.point;
  for (int c = 0; c < 3; ++c) s.point.base_color[c] = std::clamp(color[c], 0.0, 1.0);
  s.point.metalness = std::clamp(metalness, 0.0, 1.0);
  s.point.roughness = std::clamp(roughness, 0.0, 1.0);
  s.point.ior = std::max(static_cast<double>(record.ior), 1.0);
  if (record.alpha_mode == HEDDLE_ALPHA_BLEND) s.coverage = std::clamp(color.a, 0.0, 1.0);
  s.transmission = std::clamp(static_cast<double>(record.transmission), 0.0, 1.0) * (1.0 - s.point.metalness);
  if (s.is_unlit) {
    s.transmission = 0.0;
    s.emissive = glm::clamp(dvec3(color), 0.0, 1.0);
  } else if (s.is_front || s.is_double_sided) {
    s.emissive = emissive(hit.triangle, hit.u, hit.v);
  }
  return s;
}

}  // namespace heddle::path_tracer
