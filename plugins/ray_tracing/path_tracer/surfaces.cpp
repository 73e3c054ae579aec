// SPDX-License-Identifier: Apache-2.0
#include "surfaces.hpp"

#include "content_hash.hpp"
#include "scene_texture.hpp"

#include <algorithm>
#include <cmath>

namespace heddle::path_tracer {
namespace {

using glm::dvec2;
using glm::dvec3;
using glm::dvec4;

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
  return scene_texture::filter(textures_[image], scene_texture::transformed(*material.record, slot, uv));
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
