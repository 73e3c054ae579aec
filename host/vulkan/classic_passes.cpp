// SPDX-License-Identifier: Apache-2.0
// One render pass for each combination of attachments, one framebuffer for each set of views; kept until a view goes.
#include "vulkan/classic_passes.hpp"

#include "vulkan/device.hpp"

#include <algorithm>
#include <array>
#include <span>

namespace heddle::vulkan {
namespace {

template <typename Function>
void find(PFN_vkGetDeviceProcAddr get_proc_addr, VkDevice device, const char* name, Function& function) {
  function = reinterpret_cast<Function>(get_proc_addr(device, name));
}

const VkPipelineRenderingCreateInfo* rendering_of(const VkGraphicsPipelineCreateInfo& info) {
  for (const auto* next = static_cast<const VkBaseInStructure*>(info.pNext); next != nullptr; next = next->pNext)
    if (next->sType == VK_STRUCTURE_TYPE_PIPELINE_RENDERING_CREATE_INFO)
      return reinterpret_cast<const VkPipelineRenderingCreateInfo*>(next);
  return nullptr;
}

}  // namespace

ClassicPasses::ClassicPasses(const heddle_vulkan& driver, PFN_vkGetDeviceProcAddr get_proc_addr) : driver_(driver) {
  find(get_proc_addr, driver.device, "vkCreateRenderPass", create_pass_);
  find(get_proc_addr, driver.device, "vkDestroyRenderPass", destroy_pass_);
  find(get_proc_addr, driver.device, "vkCreateFramebuffer", create_framebuffer_);
  find(get_proc_addr, driver.device, "vkDestroyFramebuffer", destroy_framebuffer_);
  find(get_proc_addr, driver.device, "vkCmdBeginRenderPass", begin_);
  find(get_proc_addr, driver.device, "vkCmdEndRenderPass", end_);
}

ClassicPasses::~ClassicPasses() {
  for (const auto& [target, framebuffer] : framebuffers_) destroy_framebuffer_(driver_.device, framebuffer, nullptr);
  for (const auto& [description, pass] : passes_) destroy_pass_(driver_.device, pass, nullptr);
}

VkResult ClassicPasses::CreateImageView(const VkImageViewCreateInfo* info, const VkAllocationCallbacks* allocator,
                                        VkImageView* view) {
  const VkResult result = driver_.CreateImageView(driver_.device, info, allocator, view);
  const std::scoped_lock lock(mutex_);
  if (result == VK_SUCCESS) formats_[*view] = info->format;
  return result;
}

void ClassicPasses::DestroyImageView(VkImageView view, const VkAllocationCallbacks* allocator) {
  {
    const std::scoped_lock lock(mutex_);
    formats_.erase(view);
    std::erase_if(framebuffers_, [&](const auto& entry) {
      const bool has_view =
          std::find(entry.first.views.begin(), entry.first.views.end(), view) != entry.first.views.end();
      if (has_view) destroy_framebuffer_(driver_.device, entry.second, nullptr);
      return has_view;
    });
  }
  driver_.DestroyImageView(driver_.device, view, allocator);
}

VkRenderPass ClassicPasses::pass_for(const Description& description) {
  const auto known = passes_.find(description);
  if (known != passes_.end()) return known->second;
  std::vector<VkAttachmentDescription> attachments;
  const auto add = [&](const Attachment& attachment) -> VkAttachmentReference {
    if (attachment.format == VK_FORMAT_UNDEFINED) return {VK_ATTACHMENT_UNUSED, VK_IMAGE_LAYOUT_UNDEFINED};
    VkAttachmentDescription made{};
    made.format = attachment.format;
    made.samples = VK_SAMPLE_COUNT_1_BIT;
    made.loadOp = attachment.load;
    made.storeOp = attachment.store;
    made.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
    made.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
    // No transition by the pass: barriers have made the layout, and must have.
    made.initialLayout = made.finalLayout = attachment.layout;
    attachments.push_back(made);
    return {static_cast<std::uint32_t>(attachments.size() - 1), attachment.layout};
  };
  std::vector<VkAttachmentReference> colors;
  for (const Attachment& color : description.colors) colors.push_back(add(color));
  const VkAttachmentReference depth = add(description.depth);
  VkSubpassDescription subpass{};
  subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
  subpass.colorAttachmentCount = static_cast<std::uint32_t>(colors.size());
  subpass.pColorAttachments = colors.data();
  subpass.pDepthStencilAttachment = &depth;
  VkRenderPassCreateInfo info{VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO};
  info.attachmentCount = static_cast<std::uint32_t>(attachments.size());
  info.pAttachments = attachments.data();
  info.subpassCount = 1;
  info.pSubpasses = &subpass;
  VkRenderPass pass = VK_NULL_HANDLE;
  check(create_pass_(driver_.device, &info, nullptr, &pass), "vkCreateRenderPass");
  passes_.emplace(description, pass);
  return pass;
}

VkFramebuffer ClassicPasses::framebuffer_for(const Target& target) {
  const auto known = framebuffers_.find(target);
  if (known != framebuffers_.end()) return known->second;
  VkFramebufferCreateInfo info{VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO};
  info.renderPass = target.pass;
  info.attachmentCount = static_cast<std::uint32_t>(target.views.size());
  info.pAttachments = target.views.data();
  info.width = target.width;
  info.height = target.height;
  info.layers = target.layers;
  VkFramebuffer framebuffer = VK_NULL_HANDLE;
  check(create_framebuffer_(driver_.device, &info, nullptr, &framebuffer), "vkCreateFramebuffer");
  framebuffers_.emplace(target, framebuffer);
  return framebuffer;
}

VkResult ClassicPasses::CreateGraphicsPipelines(VkPipelineCache cache, std::uint32_t count,
                                                const VkGraphicsPipelineCreateInfo* infos,
                                                const VkAllocationCallbacks* allocator, VkPipeline* pipelines) {
  std::vector<VkGraphicsPipelineCreateInfo> changed(infos, infos + count);
  {
    const std::scoped_lock lock(mutex_);
    for (VkGraphicsPipelineCreateInfo& info : changed) {
      const VkPipelineRenderingCreateInfo* rendering = rendering_of(info);
      if (rendering == nullptr || info.renderPass != VK_NULL_HANDLE) continue;
      // Any pass with these formats will do: what is loaded and stored does not make passes incompatible.
      Description description;
      for (const VkFormat format : std::span(rendering->pColorAttachmentFormats, rendering->colorAttachmentCount))
        description.colors.push_back({format});
      description.depth = {rendering->depthAttachmentFormat};
      info.renderPass = pass_for(description);
    }
  }
  return driver_.CreateGraphicsPipelines(driver_.device, cache, count, changed.data(), allocator, pipelines);
}

ClassicPasses::Attachment ClassicPasses::describe(const VkRenderingAttachmentInfo& attachment) const {
  const auto format = formats_.find(attachment.imageView);
  if (attachment.imageView == VK_NULL_HANDLE || format == formats_.end()) return {};
  return {format->second, attachment.loadOp, attachment.storeOp, attachment.imageLayout};
}

void ClassicPasses::CmdBeginRendering(VkCommandBuffer commands, const VkRenderingInfo* info) {
  const std::scoped_lock lock(mutex_);
  Description description;
  Target target;
  std::vector<VkClearValue> clears;
  const auto add = [&](const VkRenderingAttachmentInfo& attachment) {
    const Attachment made = describe(attachment);
    if (made.format != VK_FORMAT_UNDEFINED) {
      target.views.push_back(attachment.imageView);
      clears.push_back(attachment.clearValue);
    }
    return made;
  };
  for (const VkRenderingAttachmentInfo& color : std::span(info->pColorAttachments, info->colorAttachmentCount))
    description.colors.push_back(add(color));
  if (info->pDepthAttachment != nullptr) description.depth = add(*info->pDepthAttachment);
  target.pass = pass_for(description);
  target.width = static_cast<std::uint32_t>(info->renderArea.offset.x) + info->renderArea.extent.width;
  target.height = static_cast<std::uint32_t>(info->renderArea.offset.y) + info->renderArea.extent.height;
  target.layers = info->layerCount;
  VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO};
  begin.renderPass = target.pass;
  begin.framebuffer = framebuffer_for(target);
  begin.renderArea = info->renderArea;
  begin.clearValueCount = static_cast<std::uint32_t>(clears.size());
  begin.pClearValues = clears.data();
  begin_(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
}

void ClassicPasses::CmdEndRendering(VkCommandBuffer commands) {
  end_(commands);
}

}  // namespace heddle::vulkan
