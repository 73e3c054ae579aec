// SPDX-License-Identifier: Apache-2.0
// glTF materials -> material records; their textures decoded by the image module.
#include "scene/gltf_materials.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "image/image.hpp"

namespace heddle::scene::gltf {
namespace {

constexpr double kDefaultIor = 1.5;  // KHR_materials_ior
constexpr double kLargest = 3.0e38;  // that a float32 holds, with a digit to spare

constexpr std::array<const char*, HEDDLE_TEXTURE_COUNT> kTextureNames = {"base colour", "metallic-roughness", "normal",
                                                                         "occlusion", "emissive"};

const tinygltf::Value* find(const tinygltf::ExtensionMap& extensions, const char* extension) {
  const auto found = extensions.find(extension);
  return found == extensions.end() || !found->second.IsObject() ? nullptr : &found->second;
}

std::array<double, 2> pair_of(const tinygltf::Value& object, const char* key, double otherwise) {
  std::array<double, 2> pair = {otherwise, otherwise};
  if (object.Has(key) && object.Get(key).IsArray() && object.Get(key).ArrayLen() == 2) {
    for (int i = 0; i < 2; ++i) {
      if (const tinygltf::Value& value = object.Get(key).Get(i); value.IsNumber()) {
        pair[static_cast<std::size_t>(i)] = value.GetNumberAsDouble();
      }
    }
  }
  return pair;
}

/// "Counter-clockwise" is meant as seen in the image, whose v points down: u' = cos u + sin v, v' = cos v - sin u,
/// after the scale. The matrix in the extension's first text turned the other way; the implementations agree on this
/// one.
TextureTransform transform_of(const tinygltf::ExtensionMap& extensions) {
  TextureTransform transform;
  if (const tinygltf::Value* object = find(extensions, "KHR_texture_transform")) {
    const std::array<double, 2> scale = pair_of(*object, "scale", 1.0), offset = pair_of(*object, "offset", 0.0);
    const double angle = extension_number(extensions, "KHR_texture_transform", "rotation", 0.0);
    const double c = std::cos(angle), s = std::sin(angle);
    transform.matrix = {static_cast<float>(c * scale[0]), static_cast<float>(-s * scale[0]),
                        static_cast<float>(s * scale[1]), static_cast<float>(c * scale[1])};
    transform.offset = {static_cast<float>(offset[0]), static_cast<float>(offset[1])};
  }
  return transform;
}

/// A minifying filter without mips in its name shows the finest level alone.
std::uint32_t filter_of(const tinygltf::Sampler& sampler) {
  std::uint32_t filter = sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST ? HEDDLE_FILTER_NEAREST_MAGNIFIED : 0U;
  switch (sampler.minFilter) {
    case TINYGLTF_TEXTURE_FILTER_NEAREST:
      return filter | HEDDLE_FILTER_NEAREST_MINIFIED | HEDDLE_FILTER_FINEST_LEVEL;
    case TINYGLTF_TEXTURE_FILTER_LINEAR:
      return filter | HEDDLE_FILTER_FINEST_LEVEL;
    case TINYGLTF_TEXTURE_FILTER_NEAREST_MIPMAP_NEAREST:
      return filter | HEDDLE_FILTER_NEAREST_MINIFIED | HEDDLE_FILTER_NEAREST_LEVEL;
    case TINYGLTF_TEXTURE_FILTER_LINEAR_MIPMAP_NEAREST:
      return filter | HEDDLE_FILTER_NEAREST_LEVEL;
    case TINYGLTF_TEXTURE_FILTER_NEAREST_MIPMAP_LINEAR:
      return filter | HEDDLE_FILTER_NEAREST_MINIFIED;
    default:
      return filter;
  }
}

std::uint32_t wrap_of(int gltf_wrap) {
  switch (gltf_wrap) {
    case TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT:
      return 1;
    case TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE:
      return 2;
    default:
      return 0;
  }
}

}  // namespace

double extension_number(const tinygltf::ExtensionMap& extensions, const char* extension, const char* key,
                        double otherwise) {
  const tinygltf::Value* object = find(extensions, extension);
  if (object == nullptr || !object->Has(key) || !object->Get(key).IsNumber()) {
    return otherwise;
  }
  const double number = object->Get(key).GetNumberAsDouble();
  return std::isfinite(number) ? number : otherwise;
}

std::uint32_t MaterialImport::import_texture(int index, bool is_srgb) {
  if (index < 0) {
    return HEDDLE_NONE;
  }
  const tinygltf::Model& model = document_.model;
  if (static_cast<std::size_t>(index) >= model.textures.size()) {
    document_.fail(fmt::format("there is no texture {}", index), fmt::format("{} textures", model.textures.size()));
  }
  const tinygltf::Texture& texture = model.textures[static_cast<std::size_t>(index)];
  if (texture.source < 0) {
    document_.warn(fmt::format("texture {} has an image only through an extension, and is left out", index));
    return HEDDLE_NONE;
  }
  if (static_cast<std::size_t>(texture.source) >= model.images.size()) {
    document_.fail(fmt::format("texture {} shows image {}, which does not exist", index, texture.source),
                   fmt::format("{} images", model.images.size()));
  }
  std::array<std::uint32_t, 2> wrap{0, 0};
  std::uint32_t filter = 0;
  if (texture.sampler >= 0) {
    if (static_cast<std::size_t>(texture.sampler) >= model.samplers.size()) {
      document_.fail(fmt::format("texture {} uses sampler {}, which does not exist", index, texture.sampler),
                     fmt::format("{} samplers", model.samplers.size()));
    }
    const tinygltf::Sampler& sampler = model.samplers[static_cast<std::size_t>(texture.sampler)];
    wrap = {wrap_of(sampler.wrapS), wrap_of(sampler.wrapT)};
    filter = filter_of(sampler);
  }
  const auto image = static_cast<std::size_t>(texture.source);
  const auto [entry, is_new] = textures_.try_emplace({image, is_srgb, wrap[0], wrap[1], filter},
                                                     static_cast<std::uint32_t>(scene_.textures.size()));
  if (is_new) {
    const tinygltf::Image& source = model.images[image];
    Texture added;
    added.name = !source.name.empty() ? source.name : !source.uri.empty() ? source.uri : fmt::format("image {}", image);
    added.is_srgb = is_srgb;
    added.wrap = wrap;
    added.filter = filter;
    scene_.textures.push_back(std::move(added));
    uses_.push_back({image, entry->second});
  }
  return entry->second;
}

std::uint32_t MaterialImport::import(int index) {
  if (const auto found = materials_.find(index); found != materials_.end()) {
    return found->second;
  }
  const tinygltf::Model& model = document_.model;
  if (index >= 0 && static_cast<std::size_t>(index) >= model.materials.size()) {
    document_.fail(fmt::format("there is no material {}", index), fmt::format("{} materials", model.materials.size()));
  }
  const tinygltf::Material standard;
  const tinygltf::Material& source = index < 0 ? standard : model.materials[static_cast<std::size_t>(index)];
  const tinygltf::PbrMetallicRoughness& pbr = source.pbrMetallicRoughness;
  Material material;
  material.name = index < 0 ? "default" : source.name.empty() ? fmt::format("material {}", index) : source.name;
  HeddleMaterial& record = material.record;

  const auto in_range = [&](double value, double low, double high, const char* what) {
    // Written so that NaN becomes the lower end.
    const double clamped = value > low ? std::min(value, high) : low;
    if (!(clamped == value)) {
      document_.warn(
          fmt::format("material '{}': its {} is {}, out of range: {} used", material.name, what, value, clamped));
    }
    return static_cast<float>(clamped);
  };
  const auto unit_range = [&](double value, const char* what) { return in_range(value, 0.0, 1.0, what); };
  for (std::size_t i = 0; i < 4; ++i) {
    record.base_color[i] = i < pbr.baseColorFactor.size() ? unit_range(pbr.baseColorFactor[i], "base colour") : 1.0F;
  }
  const double strength =
      extension_number(source.extensions, "KHR_materials_emissive_strength", "emissiveStrength", 1.0);
  for (std::size_t i = 0; i < 3; ++i) {
    const double factor = i < source.emissiveFactor.size() ? source.emissiveFactor[i] : 0.0;
    record.emissive[i] = in_range(factor * strength, 0.0, kLargest, "emission");
  }
  record.metalness = unit_range(pbr.metallicFactor, "metalness");
  record.roughness = unit_range(pbr.roughnessFactor, "roughness");
  record.normal_scale = static_cast<float>(source.normalTexture.scale);
  record.occlusion_strength = unit_range(source.occlusionTexture.strength, "occlusion strength");
  // A cutoff above 1 is legal: everything is a hole.
  record.alpha_cutoff = in_range(source.alphaCutoff, 0.0, kLargest, "alpha cutoff");
  double ior = extension_number(source.extensions, "KHR_materials_ior", "ior", kDefaultIor);
  if (ior == 0) {
    document_.warn(
        fmt::format("material '{}': its index of refraction is 0, which reflects all light and is not known "
                    "here: {} used",
                    material.name, kDefaultIor));
    ior = kDefaultIor;
  }
  record.ior = in_range(ior, 1.0, kLargest, "index of refraction");
  record.transmission = unit_range(
      extension_number(source.extensions, "KHR_materials_transmission", "transmissionFactor", 0.0), "transmission");
  if (const tinygltf::Value* transmission = find(source.extensions, "KHR_materials_transmission");
      transmission != nullptr && transmission->Has("transmissionTexture")) {
    document_.warn(
        fmt::format("material '{}': the transmission texture is not used, the factor alone is", material.name));
  }
  record.flags = (source.doubleSided ? HEDDLE_MATERIAL_DOUBLE_SIDED : 0U) |
                 (source.extensions.count("KHR_materials_unlit") != 0 ? HEDDLE_MATERIAL_UNLIT : 0U);
  if (source.alphaMode == "MASK") {
    record.alpha_mode = HEDDLE_ALPHA_MASK;
  } else if (source.alphaMode == "BLEND") {
    record.alpha_mode = HEDDLE_ALPHA_BLEND;
  } else if (source.alphaMode != "OPAQUE") {
    document_.fail(fmt::format("material '{}' has an unknown alpha mode", material.name), source.alphaMode,
                   "OPAQUE, MASK or BLEND");
  }

  const std::array<int, HEDDLE_TEXTURE_COUNT> textures = {
      pbr.baseColorTexture.index, pbr.metallicRoughnessTexture.index, source.normalTexture.index,
      source.occlusionTexture.index, source.emissiveTexture.index};
  const std::array<int, HEDDLE_TEXTURE_COUNT> sets = {
      pbr.baseColorTexture.texCoord, pbr.metallicRoughnessTexture.texCoord, source.normalTexture.texCoord,
      source.occlusionTexture.texCoord, source.emissiveTexture.texCoord};
  const std::array<const tinygltf::ExtensionMap*, HEDDLE_TEXTURE_COUNT> infos = {
      &pbr.baseColorTexture.extensions, &pbr.metallicRoughnessTexture.extensions, &source.normalTexture.extensions,
      &source.occlusionTexture.extensions, &source.emissiveTexture.extensions};
  for (std::uint32_t i = 0; i < HEDDLE_TEXTURE_COUNT; ++i) {
    const bool is_srgb = i == HEDDLE_TEXTURE_BASE_COLOR || i == HEDDLE_TEXTURE_EMISSIVE;
    material.textures[i] = import_texture(textures[i], is_srgb);
    const TextureTransform transform = transform_of(*infos[i]);
    set_texture_transform(record, i, transform);
    if (material.textures[i] == HEDDLE_NONE) {
      continue;
    }
    const auto is_finite = [](float value) { return std::isfinite(value); };
    if (!std::all_of(transform.matrix.begin(), transform.matrix.end(), is_finite) ||
        !std::all_of(transform.offset.begin(), transform.offset.end(), is_finite)) {
      document_.fail(
          fmt::format("material '{}': the transform of its {} texture is not finite", material.name, kTextureNames[i]));
    }
    const double set = extension_number(*infos[i], "KHR_texture_transform", "texCoord", sets[i]);
    if (set == 1.0) {
      record.texture_uv_sets |= 1U << i;
    } else if (set != 0.0) {
      document_.warn(
          fmt::format("material '{}': the {} texture wants coordinates {}, of which there are 0 and 1; 0 used",
                      material.name, kTextureNames[i], set));
    }
  }
  if (!std::isfinite(record.normal_scale)) {
    document_.fail(fmt::format("material '{}': the scale of its normal map is not finite", material.name));
  }
  const auto id = static_cast<std::uint32_t>(scene_.materials.size());
  record.id = id;
  scene_.materials.push_back(std::move(material));
  materials_.emplace(index, id);
  return id;
}

void MaterialImport::decode_textures() {
  std::stable_sort(uses_.begin(), uses_.end(), [](const Use& a, const Use& b) { return a.image < b.image; });
  for (std::size_t first = 0; first < uses_.size();) {
    const std::size_t image = uses_[first].image;
    std::size_t end = first;
    while (end < uses_.size() && uses_[end].image == image) {
      ++end;
    }
    document_.report("decoding the textures",
                     0.5 + 0.5 * static_cast<double>(first) / static_cast<double>(uses_.size()));
    const std::string name =
        fmt::format("{}: image {} '{}'", document_.file, image, scene_.textures[uses_[first].texture].name);
    // Each use keeps its own copy, 4 bytes a texel.
    const std::uint64_t uses = end - first;
    image::Image8 decoded = image::decode8(image_bytes(document_, image), name, document_.bytes_left() / 4 / uses);
    document_.spend(decoded.rgba.size() * uses, name);
    for (std::size_t use = first; use < end; ++use) {
      Texture& texture = scene_.textures[uses_[use].texture];
      texture.width = decoded.width;
      texture.height = decoded.height;
      texture.rgba = use + 1 == end ? std::move(decoded.rgba) : decoded.rgba;
    }
    first = end;
  }
}

}  // namespace heddle::scene::gltf
