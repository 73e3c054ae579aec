// SPDX-License-Identifier: Apache-2.0
// Dynamic rendering -> render passes and framebuffers of Vulkan 1.0, underneath the table: for the validation layer,
// whose synchronization checks (1.3.239) see the attachments of those and not the ones of dynamic rendering.
#pragma once

#include <heddle/vulkan_table.h>

#include <map>
#include <mutex>
#include <vector>

namespace heddle::vulkan {

/// Stands in for some of the driver's functions. Attachments have one sample and are not resolved, as the host's are.
class ClassicPasses {
 public:
  ClassicPasses(const heddle_vulkan& driver, PFN_vkGetDeviceProcAddr get_proc_addr);
  ~ClassicPasses();
  ClassicPasses(const ClassicPasses&) = delete;
  ClassicPasses& operator=(const ClassicPasses&) = delete;

  VkResult CreateImageView(const VkImageViewCreateInfo* info, const VkAllocationCallbacks* allocator,
                           VkImageView* view);
  void DestroyImageView(VkImageView view, const VkAllocationCallbacks* allocator);
  VkResult CreateGraphicsPipelines(VkPipelineCache cache, std::uint32_t count,
                                   const VkGraphicsPipelineCreateInfo* infos, const VkAllocationCallbacks* allocator,
                                   VkPipeline* pipelines);
  void CmdBeginRendering(VkCommandBuffer commands, const VkRenderingInfo* info);
  void CmdEndRendering(VkCommandBuffer commands);

 private:
  struct Attachment {
    VkFormat format = VK_FORMAT_UNDEFINED;  // UNDEFINED: the slot is unused
    VkAttachmentLoadOp load = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
    VkAttachmentStoreOp store = VK_ATTACHMENT_STORE_OP_DONT_CARE;
    VkImageLayout layout = VK_IMAGE_LAYOUT_GENERAL;
    auto operator<=>(const Attachment&) const = default;
  };
  /// Colours in order, then the depth attachment.
  struct Description {
    std::vector<Attachment> colors;
    Attachment depth;
    auto operator<=>(const Description&) const = default;
  };
  struct Target {
    VkRenderPass pass = VK_NULL_HANDLE;
    std::vector<VkImageView> views;
    std::uint32_t width = 0, height = 0, layers = 0;
    auto operator<=>(const Target&) const = default;
  };

  VkRenderPass pass_for(const Description& description);
  VkFramebuffer framebuffer_for(const Target& target);
  Attachment describe(const VkRenderingAttachmentInfo& attachment) const;

  heddle_vulkan driver_;
  PFN_vkCreateRenderPass create_pass_;
  PFN_vkDestroyRenderPass destroy_pass_;
  PFN_vkCreateFramebuffer create_framebuffer_;
  PFN_vkDestroyFramebuffer destroy_framebuffer_;
  PFN_vkCmdBeginRenderPass begin_;
  PFN_vkCmdEndRenderPass end_;
  std::mutex mutex_;
  std::map<VkImageView, VkFormat> formats_;
  std::map<Description, VkRenderPass> passes_;
  std::map<Target, VkFramebuffer> framebuffers_;
};

}  // namespace heddle::vulkan
