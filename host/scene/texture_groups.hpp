// SPDX-License-Identifier: Apache-2.0
// The textures of a scene's materials -> 2D arrays by (format, size, sampler), and one descriptor set for each
// combination of five arrays that some material needs: without descriptor indexing, draws are merged by it.
#pragma once

#include <heddle/plugin.h>

#include <map>

#include "scene/scene.hpp"
#include "vulkan/device.hpp"

namespace heddle::scene {

/// Where the textures of materials go, before any device is asked: which arrays, which layers, which groups.
struct TexturePlan {
  struct Array {
    bool is_srgb = false;
    std::uint32_t width = 0, height = 0, mips = 0;
    std::array<std::uint32_t, 2> wrap{0, 0};
    std::uint32_t filter = 0;
    std::vector<std::uint32_t> textures;  // by layer
  };
  struct Place {
    std::array<std::uint32_t, HEDDLE_TEXTURE_COUNT> layers{};  // HEDDLE_NO_TEXTURE
    std::uint32_t group = 0;
  };
  std::vector<Array> arrays;
  /// By group: the array of each texture, HEDDLE_NONE where no material of the group has one. At least one group.
  std::vector<std::array<std::uint32_t, HEDDLE_TEXTURE_COUNT>> groups;
  std::vector<Place> places;  // by material
};

/// Textures larger than `maximum_size` are placed by the first mip that fits; arrays hold at most `maximum_layers`.
/// Materials that lack a texture join any group that agrees in the others.
TexturePlan plan_textures(const Scene& scene, std::uint32_t maximum_size, std::uint32_t maximum_layers);

/// The plan made real on a device.
class TextureGroups {
 public:
  using Place = TexturePlan::Place;

  TextureGroups(vulkan::Device& device, VkDescriptorSetLayout layout) : device_(device), layout_(layout) {}
  ~TextureGroups();
  TextureGroups(const TextureGroups&) = delete;
  TextureGroups& operator=(const TextureGroups&) = delete;

  void rebuild(const Scene& scene);
  [[nodiscard]] const Place& place(std::size_t material) const { return plan_.places.at(material); }
  [[nodiscard]] VkDescriptorSet set(std::uint32_t group) const { return sets_.at(group); }

 private:
  struct Array {
    vulkan::Image image;
    VkImageView view = VK_NULL_HANDLE;  // 2D array also for one layer
    VkSampler sampler = VK_NULL_HANDLE;
  };
  void clear();
  /// Image, view and sampler of an empty array.
  Array& add_array(VkFormat format, const TexturePlan::Array& shape, std::uint32_t layers);
  VkSampler sampler(const TexturePlan::Array& shape);
  void write_sets();

  vulkan::Device& device_;
  VkDescriptorSetLayout layout_;
  TexturePlan plan_;
  std::vector<Array> arrays_;                                   // the plan's, then one white texel
  std::map<std::array<std::uint32_t, 3>, VkSampler> samplers_;  // by wrap in u and v, and filter
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
  std::vector<VkDescriptorSet> sets_;
};

}  // namespace heddle::scene
