// SPDX-License-Identifier: Apache-2.0
// Real commands on a device in check mode: the recorder sees what they touch, and under validation the layer sees the
// attachments as well.
#include "unit/vulkan/on_device.hpp"
#include "vulkan/hazard_recorder.hpp"

#include <gmock/gmock.h>

namespace heddle::vulkan {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class Checked : public testing::Test {
 protected:
  explicit Checked(bool validation = false) {
    DeviceOptions options;
    options.validation = validation;
    options.check = true;
    options.log = [this](Severity, std::string_view text) { said_.emplace_back(text); };
    device_ = std::make_unique<Device>(options);
    color_ = device_->make_image({VK_FORMAT_R8G8B8A8_UNORM, 16, 16, 1, 1, 0, false});
    device_->recorder()->name(color_.handle(), "color");
  }
  const heddle_vulkan& vk() { return device_->table(); }

  void change(VkCommandBuffer commands, VkImageLayout from, VkImageLayout to, VkPipelineStageFlags2 from_stages,
              VkAccessFlags2 from_access, VkPipelineStageFlags2 to_stages, VkAccessFlags2 to_access) {
    VkImageMemoryBarrier2 barrier{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2};
    barrier.srcStageMask = from_stages;
    barrier.srcAccessMask = from_access;
    barrier.dstStageMask = to_stages;
    barrier.dstAccessMask = to_access;
    barrier.oldLayout = from;
    barrier.newLayout = to;
    barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    barrier.image = color_.handle();
    barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
    dependency.imageMemoryBarrierCount = 1;
    dependency.pImageMemoryBarriers = &barrier;
    vk().CmdPipelineBarrier2(commands, &dependency);
  }
  void render(VkCommandBuffer commands, VkAttachmentLoadOp load) {
    VkRenderingAttachmentInfo attachment{VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO};
    attachment.imageView = color_.layer_view(0);
    attachment.imageLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
    attachment.loadOp = load;
    attachment.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
    attachment.clearValue.color = {{0.25F, 0.5F, 0.75F, 1.0F}};
    VkRenderingInfo info{VK_STRUCTURE_TYPE_RENDERING_INFO};
    info.renderArea.extent = {16, 16};
    info.layerCount = 1;
    info.colorAttachmentCount = 1;
    info.pColorAttachments = &attachment;
    vk().CmdBeginRendering(commands, &info);
    vk().CmdEndRendering(commands);
  }
  void to_target(VkCommandBuffer commands) {
    change(commands, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL,
           VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT, 0, VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT,
           VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT);
  }
  void to_source(VkCommandBuffer commands, VkPipelineStageFlags2 from, VkAccessFlags2 access) {
    change(commands, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, from, access,
           VK_PIPELINE_STAGE_2_COPY_BIT, VK_ACCESS_2_TRANSFER_READ_BIT);
  }
  std::vector<std::string> hazards() {
    std::vector<std::string> texts;
    for (const Diagnostic& diagnostic : device_->take_hazards()) texts.push_back(to_text(diagnostic));
    return texts;
  }

  std::vector<std::string> said_;
  std::unique_ptr<Device> device_;
  Image color_;
};

TEST_F(Checked, UploadsAndReadBacksOfTheHostAreCovered) {
  const std::vector<std::byte> texels = pattern(16 * 16 * 4, 1);
  device_->upload(color_, 0, 0, texels);
  EXPECT_EQ(device_->read_back(color_, 0, 0, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL), texels);
  const Buffer buffer = device_->make_buffer(256, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, false);
  device_->upload(buffer, 16, std::span(texels).first(64));
  device_->upload(buffer, 16, std::span(texels).first(64));
  EXPECT_THAT(device_->read_back(buffer, 16, 64), testing::ElementsAreArray(std::span(texels).first(64)));
  EXPECT_THAT(hazards(), IsEmpty());
}

TEST_F(Checked, ClearedAttachmentIsCopiedBehindItsBarrier) {
  device_->run([&](VkCommandBuffer commands) {
    to_target(commands);
    render(commands, VK_ATTACHMENT_LOAD_OP_CLEAR);
    to_source(commands, VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT, VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT);
  });
  EXPECT_EQ(device_->read_back(color_, 0, 0, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL)[1], std::byte{128});
  EXPECT_THAT(hazards(), IsEmpty());
}

TEST_F(Checked, BarrierFromTheWrongStageIsFound) {
  device_->run([&](VkCommandBuffer commands) {
    to_target(commands);
    render(commands, VK_ATTACHMENT_LOAD_OP_CLEAR);
    to_source(commands, VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT, VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT);
  });
  EXPECT_THAT(hazards(), ElementsAre(HasSubstr("'color' changes its layout while vkCmdBeginRendering may still use")));
}

TEST_F(Checked, AttachmentThatIsLoadedBeforeAnythingWroteItIsFound) {
  device_->run([&](VkCommandBuffer commands) {
    change(commands, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL,
           VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT, 0, VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT,
           VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT | VK_ACCESS_2_COLOR_ATTACHMENT_READ_BIT);
    render(commands, VK_ATTACHMENT_LOAD_OP_LOAD);
  });
  EXPECT_THAT(hazards(), ElementsAre(HasSubstr("'color' is read, and its contents are undefined")));
}

TEST_F(Checked, PausedCommandsAreNotPartOfTheProof) {
  device_->run([&](VkCommandBuffer commands) {
    to_target(commands);
    render(commands, VK_ATTACHMENT_LOAD_OP_CLEAR);
    const hazard::Recorder::Pause pause(device_->recorder());
    render(commands, VK_ATTACHMENT_LOAD_OP_CLEAR);
  });
  EXPECT_THAT(hazards(), IsEmpty());
}

TEST_F(Checked, ObjectsThatComeAndGoLeaveNothingBehind) {
  for (int i = 0; i < 100; ++i) {
    const Image image = device_->make_image({VK_FORMAT_R8G8B8A8_UNORM, 16, 16, 1, 1, 0, false});
    device_->upload(image, 0, 0, pattern(16 * 16 * 4, 1));
    const Buffer buffer = device_->make_buffer(256, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, false);
    device_->upload(buffer, 0, pattern(256, 2));
  }
  EXPECT_THAT(hazards(), IsEmpty()) << "memory that one object leaves to the next is no hazard once the device is done";
}

TEST(Unchecked, DeviceWithoutCheckModeRecordsNothing) {
  const auto device = std::make_unique<Device>(DeviceOptions{});
  EXPECT_EQ(device->recorder(), nullptr);
  EXPECT_THAT(device->take_hazards(), IsEmpty());
}

// ---- render passes in place of dynamic rendering, for the layer ----

class CheckedUnderValidation : public Checked {
 protected:
  CheckedUnderValidation() : Checked(OnLayers::has_validation()) {
    if (!OnLayers::has_validation()) skip_ = true;
  }
  struct OnLayers : OnDevice {
    using OnDevice::has_validation;
    void TestBody() override {}
  };
  bool skip_ = false;
};

TEST_F(CheckedUnderValidation, LayerIsSilentWhereBarriersAreThere) {
  if (skip_) GTEST_SKIP() << "the validation layer is not installed";
  device_->run([&](VkCommandBuffer commands) {
    to_target(commands);
    render(commands, VK_ATTACHMENT_LOAD_OP_CLEAR);
    to_source(commands, VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT, VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT);
  });
  EXPECT_EQ(device_->read_back(color_, 0, 0, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL)[1], std::byte{128});
  EXPECT_THAT(device_->take_validation_errors(), IsEmpty());
  EXPECT_THAT(hazards(), IsEmpty());
}

TEST_F(CheckedUnderValidation, LayerSeesABarrierThatDoesNotWaitForAttachments) {
  if (skip_) GTEST_SKIP() << "the validation layer is not installed";
  device_->run([&](VkCommandBuffer commands) {
    to_target(commands);
    render(commands, VK_ATTACHMENT_LOAD_OP_CLEAR);
    to_source(commands, VK_PIPELINE_STAGE_2_NONE, VK_ACCESS_2_NONE);  // waits for nothing
  });
  EXPECT_THAT(device_->take_validation_errors(), testing::Contains(HasSubstr("SYNC-HAZARD-WRITE")))
      << "with dynamic rendering it says nothing";
  EXPECT_THAT(hazards(), Not(IsEmpty()));
}

}  // namespace
}  // namespace heddle::vulkan
