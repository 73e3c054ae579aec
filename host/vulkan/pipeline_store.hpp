// SPDX-License-Identifier: Apache-2.0
// Set layouts and pipelines of a device, each made once for everybody who asks for the same. Making pipelines is most
// of what a plan costs: a plan that goes back to what an earlier one had, and the next graph of a host, find them made.
#pragma once

#include <heddle/vulkan_table.h>

#include <array>
#include <cstdint>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace heddle::vulkan {

/// Set layouts are the store's.
struct PipelineObjects {
  VkPipeline pipeline = VK_NULL_HANDLE;
  VkPipelineLayout layout = VK_NULL_HANDLE;
  std::array<VkDescriptorSetLayout, 4> sets{};
  VkPipelineBindPoint bind_point = VK_PIPELINE_BIND_POINT_COMPUTE;
};

/// Any thread may call it.
class PipelineStore {
 public:
  struct Entry {
    PipelineObjects objects;
    std::uint32_t users = 0;
    std::uint64_t given_back = 0;  // when: the number of give_back; while nobody uses it
  };
  using Shared = std::pair<const std::string, Entry>;  // stays where it is while it has users

  /// `table` outlives it.
  explicit PipelineStore(const heddle_vulkan& table) : vk_(table) {}
  ~PipelineStore();
  PipelineStore(const PipelineStore&) = delete;
  PipelineStore& operator=(const PipelineStore&) = delete;

  /// The same handle for the same bindings, until the store ends.
  VkDescriptorSetLayout set_layout(std::span<const VkDescriptorSetLayoutBinding> bindings);

  /// `key` is a name of everything that the pipeline is made of. One more user; null: there is none.
  Shared* take(const std::string& key);
  /// Its first user; from here on the store destroys it. What is there under that key already is answered in its place.
  Shared* add(const std::string& key, const PipelineObjects& made);
  /// One user less. Nothing that was submitted uses it any more.
  void give_back(Shared& shared) noexcept;

 private:
  /// Of a few graphs: one that has all of the default techniques makes 15.
  static constexpr std::size_t kIdleKept = 64;
  void destroy(const PipelineObjects& objects) const;

  const heddle_vulkan& vk_;
  std::mutex mutex_;
  std::map<std::vector<std::array<std::uint32_t, 4>>, VkDescriptorSetLayout> layouts_;
  std::map<std::string, Entry> pipelines_;
  std::map<std::uint64_t, Shared*> idle_;  // by Entry::given_back
  std::uint64_t given_back_ = 0;
};

}  // namespace heddle::vulkan
