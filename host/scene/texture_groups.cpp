// SPDX-License-Identifier: Apache-2.0
// Textures -> arrays and descriptor sets: first the plan, then its images, views, samplers and sets.
#include "scene/texture_groups.hpp"

#include <algorithm>
#include <map>
#include <tuple>

#include "scene/mips.hpp"

namespace heddle::scene {
namespace {

/// How many halvings bring a size under the device's limit.
std::uint32_t first_mip(const Texture& texture, std::uint32_t maximum_size) {
  std::uint32_t level = 0;
  while ((std::max(texture.width, texture.height) >> level) > maximum_size) {
    ++level;
  }
  return level;
}

/// Joins a group in which every array is the same or absent on one side.
bool join(std::array<std::uint32_t, HEDDLE_TEXTURE_COUNT>& group,
          const std::array<std::uint32_t, HEDDLE_TEXTURE_COUNT>& wanted) {
  for (std::size_t i = 0; i < group.size(); ++i) {
    if (group[i] != HEDDLE_NONE && wanted[i] != HEDDLE_NONE && group[i] != wanted[i]) {
      return false;
    }
  }
  for (std::size_t i = 0; i < group.size(); ++i) {
    group[i] = group[i] == HEDDLE_NONE ? wanted[i] : group[i];
  }
  return true;
}

}  // namespace

TexturePlan plan_textures(const Scene& scene, std::uint32_t maximum_size, std::uint32_t maximum_layers) {
  TexturePlan plan;
  std::map<std::tuple<bool, std::array<std::uint32_t, 5>>, std::uint32_t> open;
  struct Slot {
    std::uint32_t array = HEDDLE_NONE, layer = HEDDLE_NO_TEXTURE;
  };
  std::vector<Slot> slots(scene.textures.size());
  const auto slot_of = [&](std::uint32_t index) {
    Slot& slot = slots.at(index);
    if (slot.array != HEDDLE_NONE) {
      return slot;
    }
    const Texture& texture = scene.textures[index];
    const std::uint32_t base = first_mip(texture, maximum_size);
    TexturePlan::Array wanted;
    wanted.is_srgb = texture.is_srgb;
    wanted.width = std::max(texture.width >> base, 1U);
    wanted.height = std::max(texture.height >> base, 1U);
    wanted.mips = mip_count(texture.width, texture.height) - base;
    wanted.wrap = texture.wrap;
    wanted.filter = texture.filter;
    const auto [entry, is_new] = open.try_emplace(
        {wanted.is_srgb, {wanted.width, wanted.height, wanted.wrap[0], wanted.wrap[1], wanted.filter}}, HEDDLE_NONE);
    if (is_new || plan.arrays[entry->second].textures.size() >= maximum_layers) {
      entry->second = static_cast<std::uint32_t>(plan.arrays.size());
      plan.arrays.push_back(std::move(wanted));
    }
    TexturePlan::Array& array = plan.arrays[entry->second];
    slot = {entry->second, static_cast<std::uint32_t>(array.textures.size())};
    array.textures.push_back(index);
    return slot;
  };

  for (const Material& material : scene.materials) {
    TexturePlan::Place place;
    std::array<std::uint32_t, HEDDLE_TEXTURE_COUNT> wanted{};
    for (std::size_t i = 0; i < HEDDLE_TEXTURE_COUNT; ++i) {
      const Slot slot = material.textures[i] == HEDDLE_NONE ? Slot() : slot_of(material.textures[i]);
      wanted[i] = slot.array;
      place.layers[i] = slot.layer;
    }
    const auto group =
        std::find_if(plan.groups.begin(), plan.groups.end(), [&](auto& candidate) { return join(candidate, wanted); });
    place.group = static_cast<std::uint32_t>(group - plan.groups.begin());
    if (group == plan.groups.end()) {
      plan.groups.push_back(wanted);
    }
    plan.places.push_back(place);
  }
  if (plan.groups.empty()) {
    plan.groups.emplace_back().fill(HEDDLE_NONE);
  }
  return plan;
}

TextureGroups::~TextureGroups() {
  clear();
  const heddle_vulkan& vk = device_.table();
  for (const auto& [key, sampler] : samplers_) {
    vk.DestroySampler(vk.device, sampler, nullptr);
  }
}

void TextureGroups::clear() {
  const heddle_vulkan& vk = device_.table();
  vk.DestroyDescriptorPool(vk.device, pool_, nullptr);
  pool_ = VK_NULL_HANDLE;
  sets_.clear();
  for (const Array& array : arrays_) {
    vk.DestroyImageView(vk.device, array.view, nullptr);
  }
  arrays_.clear();
}

VkSampler TextureGroups::sampler(const TexturePlan::Array& shape) {
  constexpr std::array<VkSamplerAddressMode, 3> kModes = {
      VK_SAMPLER_ADDRESS_MODE_REPEAT, VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT, VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE};
  // Just above 0: the finest level alone, and still a difference between minified and magnified (Vulkan 1.3, chapter
  // Samplers, on OpenGL's filters without mipmaps).
  constexpr float kFinestLevel = 0.25F;
  const std::uint32_t u = std::min(shape.wrap[0], 2U), v = std::min(shape.wrap[1], 2U);
  VkSampler& sampler = samplers_.try_emplace({u, v, shape.filter}, VK_NULL_HANDLE).first->second;
  if (sampler == VK_NULL_HANDLE) {
    const bool has_levels = (shape.filter & HEDDLE_FILTER_FINEST_LEVEL) == 0;
    const auto filter = [&](std::uint32_t bit) {
      return (shape.filter & bit) != 0 ? VK_FILTER_NEAREST : VK_FILTER_LINEAR;
    };
    VkSamplerCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO;
    info.magFilter = filter(HEDDLE_FILTER_NEAREST_MAGNIFIED);
    info.minFilter = filter(HEDDLE_FILTER_NEAREST_MINIFIED);
    info.mipmapMode = has_levels && (shape.filter & HEDDLE_FILTER_NEAREST_LEVEL) == 0 ? VK_SAMPLER_MIPMAP_MODE_LINEAR
                                                                                      : VK_SAMPLER_MIPMAP_MODE_NEAREST;
    info.addressModeU = kModes[u];
    info.addressModeV = kModes[v];
    info.addressModeW = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
    info.maxAnisotropy = 1.0F;
    info.maxLod = has_levels ? VK_LOD_CLAMP_NONE : kFinestLevel;
    const heddle_vulkan& vk = device_.table();
    vulkan::check(vk.CreateSampler(vk.device, &info, nullptr, &sampler), "vkCreateSampler");
  }
  return sampler;
}

TextureGroups::Array& TextureGroups::add_array(VkFormat format, const TexturePlan::Array& shape, std::uint32_t layers) {
  const heddle_vulkan& vk = device_.table();
  Array& array = arrays_.emplace_back();
  vulkan::ImageShape image;
  image.format = format;
  image.width = shape.width;
  image.height = shape.height;
  image.layers = layers;
  image.mips = shape.mips;
  image.usage = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
  array.image = device_.make_image(image);
  array.sampler = sampler(shape);
  VkImageViewCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
  info.image = array.image.handle();
  info.viewType = VK_IMAGE_VIEW_TYPE_2D_ARRAY;
  info.format = format;
  info.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, shape.mips, 0, layers};
  vulkan::check(vk.CreateImageView(vk.device, &info, nullptr, &array.view), "vkCreateImageView");
  return array;
}

void TextureGroups::rebuild(const Scene& scene) {
  clear();
  plan_ = plan_textures(scene, device_.limits().maxImageDimension2D, device_.limits().maxImageArrayLayers);
  for (const TexturePlan::Array& planned : plan_.arrays) {
    Array& array = add_array(planned.is_srgb ? VK_FORMAT_R8G8B8A8_SRGB : VK_FORMAT_R8G8B8A8_UNORM, planned,
                             static_cast<std::uint32_t>(planned.textures.size()));
    for (std::uint32_t layer = 0; layer < planned.textures.size(); ++layer) {
      const std::vector<MipLevel> mips = make_mips(scene.textures[planned.textures[layer]]);
      const std::size_t base = mips.size() - planned.mips;
      for (std::uint32_t mip = 0; mip < planned.mips; ++mip) {
        device_.upload(array.image, layer, mip, std::as_bytes(std::span(mips[base + mip].rgba)));
      }
    }
  }
  // What a shader finds behind a texture that no material of the group has: white, which it does not use.
  TexturePlan::Array texel;
  texel.width = texel.height = texel.mips = 1;
  const std::array<std::uint8_t, 4> white = {255, 255, 255, 255};
  device_.upload(add_array(VK_FORMAT_R8G8B8A8_UNORM, texel, 1).image, 0, 0, std::as_bytes(std::span(white)));
  write_sets();
}

void TextureGroups::write_sets() {
  const heddle_vulkan& vk = device_.table();
  const auto count = static_cast<std::uint32_t>(plan_.groups.size());
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, count * HEDDLE_TEXTURE_COUNT};
  VkDescriptorPoolCreateInfo pool_info{};
  pool_info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
  pool_info.maxSets = count;
  pool_info.poolSizeCount = 1;
  pool_info.pPoolSizes = &size;
  vulkan::check(vk.CreateDescriptorPool(vk.device, &pool_info, nullptr, &pool_), "vkCreateDescriptorPool");
  const std::vector<VkDescriptorSetLayout> layouts(count, layout_);
  VkDescriptorSetAllocateInfo allocate_info{};
  allocate_info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
  allocate_info.descriptorPool = pool_;
  allocate_info.descriptorSetCount = count;
  allocate_info.pSetLayouts = layouts.data();
  sets_.resize(count);
  vulkan::check(vk.AllocateDescriptorSets(vk.device, &allocate_info, sets_.data()), "vkAllocateDescriptorSets");
  for (std::uint32_t group = 0; group < count; ++group) {
    std::array<VkDescriptorImageInfo, HEDDLE_TEXTURE_COUNT> images{};
    for (std::size_t i = 0; i < images.size(); ++i) {
      const std::uint32_t index = plan_.groups[group][i];
      const Array& array = index == HEDDLE_NONE ? arrays_.back() : arrays_[index];
      images[i] = {array.sampler, array.view, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL};
    }
    std::array<VkWriteDescriptorSet, HEDDLE_TEXTURE_COUNT> writes{};
    for (std::uint32_t i = 0; i < writes.size(); ++i) {
      writes[i].sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
      writes[i].dstSet = sets_[group];
      writes[i].dstBinding = i;
      writes[i].descriptorCount = 1;
      writes[i].descriptorType = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
      writes[i].pImageInfo = &images[i];
    }
    vk.UpdateDescriptorSets(vk.device, static_cast<std::uint32_t>(writes.size()), writes.data(), 0, nullptr);
  }
}

}  // namespace heddle::scene
