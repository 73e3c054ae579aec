// SPDX-License-Identifier: Apache-2.0
// The chain of passes as a careful person would record it without a graph: what the host's own frame is held against.
#pragma once

#include "session.hpp"
#include "vulkan/shader.hpp"

namespace heddle::bench {

struct Chain {
  std::uint32_t passes = 1, width = 64, height = 64;
  int iterations = 1;
  bool is_empty = false;
};

struct FrameTime {
  double wall_ms = 0;    // all
  double submit_ms = 0;  // from the submission to the fence
  double cpu_ms = 0;     // of the calling thread: recording, submitting, and next to nothing of waiting
};

/// The same shaders, pipelines, formats and bindings as technique chain/work. All that can be made beforehand is:
/// images, memory of their own, descriptor sets. A frame records, for each pass: one barrier call that hands over the
/// image before and opens its own, the pipeline, the set, the dispatch.
class HandRecorded {
 public:
  HandRecorded(Session& session, const Chain& chain);
  ~HandRecorded();
  HandRecorded(const HandRecorded&) = delete;
  HandRecorded& operator=(const HandRecorded&) = delete;
  FrameTime frame();
  /// The last pass's image as float32, after a frame.
  [[nodiscard]] std::vector<float> read();

 private:
  void make_pipeline(bool reads_previous);
  void make_set(std::uint32_t pass);

  Session& session_;
  vulkan::Device& device_;
  Chain chain_;
  vulkan::PipelineMaker maker_;
  std::array<vulkan::CompiledShader, 2> shaders_;  // the first pass's, and that of all others
  std::array<vulkan::Pipeline, 2> pipelines_;
  std::vector<vulkan::Image> images_;
  vulkan::Buffer parameters_;
  std::vector<VkDescriptorSet> sets_;
  VkDescriptorPool descriptor_pool_ = VK_NULL_HANDLE;
  VkCommandPool command_pool_ = VK_NULL_HANDLE;
  VkCommandBuffer commands_ = VK_NULL_HANDLE;
  VkFence fence_ = VK_NULL_HANDLE;
};

}  // namespace heddle::bench
