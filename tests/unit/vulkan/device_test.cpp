// SPDX-License-Identifier: Apache-2.0
// The device as a whole: choice, features, formats, samplers, running commands, errors out of recording.
#include "unit/vulkan/on_device.hpp"

#include <cstdlib>
#include <optional>
#include <set>

namespace heddle::vulkan {
namespace {

class DeviceTest : public OnDevice {};

/// Nobody asks for a device while it lives.
class NoWish {
 public:
  NoWish() {
    if (const char* const value = std::getenv("HEDDLE_DEVICE")) saved_ = value;
    unsetenv("HEDDLE_DEVICE");
  }
  ~NoWish() {
    if (saved_) setenv("HEDDLE_DEVICE", saved_->c_str(), 1);
  }
  NoWish(const NoWish&) = delete;
  NoWish& operator=(const NoWish&) = delete;

 private:
  std::optional<std::string> saved_;
};

TEST_F(DeviceTest, IsLavapipeWhereItIsInstalledAndNothingElseIsAskedFor) {
  const NoWish nobody_asks;
  const auto chosen = make_device();
  bool is_installed = false;
  for (const DeviceInfo& info : list_devices()) is_installed = is_installed || info.is_lavapipe;
  EXPECT_EQ(chosen->info().is_lavapipe, is_installed);
  EXPECT_TRUE(chosen->info().is_usable);
}

TEST_F(DeviceTest, HasWhatTheHostNeeds) {
  EXPECT_TRUE(device_->features().shaderStorageImageWriteWithoutFormat);
  EXPECT_TRUE(device_->features().shaderStorageImageExtendedFormats);
  EXPECT_GE(device_->limits().maxPushConstantsSize, 128u);
  EXPECT_NE(device_->table().physical_device, VkPhysicalDevice{VK_NULL_HANDLE});
  EXPECT_NE(device_->queue(), VkQueue{VK_NULL_HANDLE});
}

TEST_F(DeviceTest, KnowsWhatFormatsCanDo) {
  EXPECT_TRUE(device_->has_format(
      VK_FORMAT_D32_SFLOAT, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT | VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT));
  EXPECT_FALSE(device_->has_format(VK_FORMAT_D32_SFLOAT, VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BIT));
  EXPECT_FALSE(device_->has_format(VK_FORMAT_UNDEFINED, VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT));
}

TEST_F(DeviceTest, HasFiveSamplers) {
  using Sampler = Device::Sampler;
  std::set<VkSampler> samplers;
  for (const Sampler which : {Sampler::kNearestClamp, Sampler::kLinearClamp, Sampler::kLinearRepeat,
                              Sampler::kLinearMirror, Sampler::kCompareClamp}) {
    samplers.insert(device_->sampler(which));
  }
  EXPECT_EQ(samplers.size(), 5u);
  EXPECT_EQ(samplers.count(VK_NULL_HANDLE), 0u);
}

TEST_F(DeviceTest, RunsAgainAfterRecordingThrew) {
  const Buffer buffer = device_->make_buffer(16, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, false);
  EXPECT_THROW(device_->run([&](VkCommandBuffer commands) {
    device_->table().CmdFillBuffer(commands, buffer.handle(), 0, VK_WHOLE_SIZE, 1);
    throw std::runtime_error("recording failed");
  }),
               std::runtime_error);
  EXPECT_EQ(device_->counters().submits, 0u);
  device_->run([&](VkCommandBuffer commands) {
    device_->table().CmdFillBuffer(commands, buffer.handle(), 0, VK_WHOLE_SIZE, 0x01020304);
  });
  const auto bytes = device_->read_back(buffer, 0, 16);
  EXPECT_EQ(bytes[0], std::byte{4});
  EXPECT_EQ(bytes[15], std::byte{1});
}

TEST_F(DeviceTest, CountsWhatOthersMove) {
  device_->count_upload(10);
  device_->count_read_back(20);
  EXPECT_EQ(device_->counters().uploaded_bytes, 10u);
  EXPECT_EQ(device_->counters().read_back_bytes, 20u);
}

}  // namespace
}  // namespace heddle::vulkan
