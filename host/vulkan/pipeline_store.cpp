// SPDX-License-Identifier: Apache-2.0
#include "vulkan/pipeline_store.hpp"

#include "vulkan/device.hpp"

namespace heddle::vulkan {

PipelineStore::~PipelineStore() {
  for (const auto& [key, entry] : pipelines_) destroy(entry.objects);
  for (const auto& [bindings, layout] : layouts_) vk_.DestroyDescriptorSetLayout(vk_.device, layout, nullptr);
}

void PipelineStore::destroy(const PipelineObjects& objects) const {
  vk_.DestroyPipeline(vk_.device, objects.pipeline, nullptr);
  vk_.DestroyPipelineLayout(vk_.device, objects.layout, nullptr);
}

VkDescriptorSetLayout PipelineStore::set_layout(std::span<const VkDescriptorSetLayoutBinding> bindings) {
  std::vector<std::array<std::uint32_t, 4>> key;
  for (const VkDescriptorSetLayoutBinding& slot : bindings)
    key.push_back(
        {slot.binding, static_cast<std::uint32_t>(slot.descriptorType), slot.descriptorCount, slot.stageFlags});
  const std::scoped_lock lock(mutex_);
  VkDescriptorSetLayout& layout = layouts_[key];
  if (layout != VK_NULL_HANDLE) return layout;
  VkDescriptorSetLayoutCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO};
  info.bindingCount = static_cast<std::uint32_t>(bindings.size());
  info.pBindings = bindings.data();
  check(vk_.CreateDescriptorSetLayout(vk_.device, &info, nullptr, &layout), "vkCreateDescriptorSetLayout");
  return layout;
}

PipelineStore::Shared* PipelineStore::take(const std::string& key) {
  const std::scoped_lock lock(mutex_);
  const auto found = pipelines_.find(key);
  if (found == pipelines_.end()) return nullptr;
  if (found->second.users++ == 0) idle_.erase(found->second.given_back);
  return &*found;
}

PipelineStore::Shared* PipelineStore::add(const std::string& key, const PipelineObjects& made) {
  const std::scoped_lock lock(mutex_);
  const auto [place, is_new] = pipelines_.try_emplace(key, Entry{made, 0, 0});
  if (!is_new) {  // another thread made it meanwhile
    destroy(made);
    if (place->second.users == 0) idle_.erase(place->second.given_back);
  }
  ++place->second.users;
  return &*place;
}

void PipelineStore::give_back(Shared& shared) noexcept {
  const std::scoped_lock lock(mutex_);
  if (--shared.second.users > 0) return;
  shared.second.given_back = ++given_back_;
  idle_.emplace(shared.second.given_back, &shared);
  if (idle_.size() <= kIdleKept) return;
  Shared& oldest = *idle_.begin()->second;
  idle_.erase(idle_.begin());
  destroy(oldest.second.objects);
  pipelines_.erase(pipelines_.find(oldest.first));
}

}  // namespace heddle::vulkan
