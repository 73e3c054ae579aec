// SPDX-License-Identifier: Apache-2.0
// What people read when Vulkan, a driver or the validation layer is missing; what the layer finds when it is there.
#include "vulkan/loader.hpp"

#include "unit/vulkan/on_device.hpp"

#include <gmock/gmock.h>

#include <cstdlib>

namespace heddle::vulkan {
namespace {

/// Sets a variable for one test.
class Variable {
 public:
  Variable(const char* name, const char* value) : name_(name) {
    if (const char* const before = std::getenv(name)) {
      before_ = before;
      was_set_ = true;
    }
    setenv(name, value, 1);
  }
  ~Variable() {
    if (was_set_) {
      setenv(name_, before_.c_str(), 1);
    } else {
      unsetenv(name_);
    }
  }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  const char* name_;
  std::string before_;
  bool was_set_ = false;
};

TEST(Loader, SaysWhatToInstallWhenThereIsNoVulkan) {
  EXPECT_EQ(error_of([] { open_loader("libvulkan_missing.so.1"); }),
            "error: the Vulkan loader cannot be opened\n"
            "  found:    libvulkan_missing.so.1: cannot open shared object file: No such file or directory\n"
            "  expected: libvulkan_missing.so.1\n"
            "  help:     install a Vulkan loader and a driver; on Debian: apt install libvulkan1 mesa-vulkan-drivers");
}

TEST(Loader, RejectsALibraryThatIsNoLoader) {
  EXPECT_EQ(error_of([] { open_loader("libm.so.6"); }),
            "error: the Vulkan loader cannot be used\n"
            "  found:    libm.so.6 without vkGetInstanceProcAddr\n"
            "  help:     install a Vulkan loader and a driver; on Debian: apt install libvulkan1 mesa-vulkan-drivers");
}

TEST(Loader, SaysWhatToInstallWhenThereIsNoDriver) {
  const Variable old_name("VK_ICD_FILENAMES", "/nonexistent/driver.json");
  const Variable new_name("VK_DRIVER_FILES", "/nonexistent/driver.json");
  EXPECT_EQ(error_of([] { list_devices(); }),
            "error: no Vulkan driver is installed\n"
            "  help:     install a Vulkan loader and a driver; on Debian: apt install libvulkan1 mesa-vulkan-drivers");
}

TEST(Loader, SaysWhatToInstallWhenTheLayerIsMissing) {
  const Variable path("VK_LAYER_PATH", "/nonexistent");
  const std::vector<std::string> others = list_layers();
  EXPECT_EQ(error_of([] { const Device device(DeviceOptions{.device = "", .validation = true, .log = {}}); }),
            "error: the validation layer is not installed\n"
            "  found:    " +
                (others.empty() ? std::string("no layers") : "layers " + join_names(others)) +
                "\n"
                "  expected: VK_LAYER_KHRONOS_validation\n"
                "  help:     on Debian: apt install vulkan-validationlayers");
}

TEST(Loader, LeavesTheEnvironmentAsItWas) {
  const char* const before = std::getenv("NODEVICE_SELECT");
  const std::string saved = before != nullptr ? before : "(unset)";
  list_devices();
  const char* const after = std::getenv("NODEVICE_SELECT");
  EXPECT_EQ(saved, after != nullptr ? after : "(unset)");
}

TEST(Loader, BearsManyInstancesOneAfterTheOther) {
  const std::size_t devices = list_devices().size();
  for (int i = 0; i < 80; ++i) ASSERT_EQ(list_devices().size(), devices) << "instance " << i;
}

TEST(Loader, ListsDevicesWithWhatTheyLack) {
  const std::vector<DeviceInfo> devices = list_devices();
  ASSERT_FALSE(devices.empty());
  for (std::uint32_t i = 0; i < devices.size(); ++i) {
    EXPECT_EQ(devices[i].index, i);
    EXPECT_NE(devices[i].name, "");
    EXPECT_EQ(devices[i].is_usable, devices[i].missing.empty());
    if (devices[i].is_lavapipe) {
      EXPECT_EQ(devices[i].type, "cpu");
      EXPECT_TRUE(devices[i].is_usable) << devices[i].missing;
    }
  }
}

/// Here the layer shall speak, so its words are collected and not failures.
class Validation : public testing::Test {
 protected:
  void SetUp() override {
    const std::vector<std::string> layers = list_layers();
    if (std::find(layers.begin(), layers.end(), "VK_LAYER_KHRONOS_validation") == layers.end()) {
      GTEST_SKIP() << "the validation layer is not installed";
    }
    device_ = std::make_unique<Device>(DeviceOptions{
        .device = "", .validation = true, .log = [this](Severity severity, std::string_view) { heard_ = severity; }});
  }
  void fill(VkCommandBuffer commands, const Buffer& buffer, std::uint32_t value) {
    device_->table().CmdFillBuffer(commands, buffer.handle(), 0, VK_WHOLE_SIZE, value);
  }

  Severity heard_ = Severity::kInfo;
  std::unique_ptr<Device> device_;
};

TEST_F(Validation, FindsHazardsWithinASubmit) {
  const Buffer buffer = device_->make_buffer(256, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, false);
  EXPECT_THAT(device_->take_validation_errors(), testing::IsEmpty());
  device_->run([&](VkCommandBuffer commands) {
    fill(commands, buffer, 1);
    fill(commands, buffer, 2);
  });
  EXPECT_THAT(device_->take_validation_errors(),
              testing::Contains(testing::HasSubstr("SYNC-HAZARD-WRITE-AFTER-WRITE")));
  EXPECT_EQ(heard_, Severity::kError);
  EXPECT_THAT(device_->take_validation_errors(), testing::IsEmpty()) << "taken errors are forgotten";
}

TEST_F(Validation, FindsHazardsBetweenSubmits) {
  // run() waits for its fence and hides hazards from the host's view; two submits without a wait do not.
  const heddle_vulkan& vk = device_->table();
  const Buffer buffer = device_->make_buffer(256, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, false);
  VkCommandPoolCreateInfo pool_info{};
  pool_info.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO;
  pool_info.queueFamilyIndex = device_->queue_family();
  VkCommandPool pool = VK_NULL_HANDLE;
  check(vk.CreateCommandPool(vk.device, &pool_info, nullptr, &pool), "vkCreateCommandPool");
  VkCommandBufferAllocateInfo allocate{};
  allocate.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
  allocate.commandPool = pool;
  allocate.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
  allocate.commandBufferCount = 2;
  std::array<VkCommandBuffer, 2> commands{};
  check(vk.AllocateCommandBuffers(vk.device, &allocate, commands.data()), "vkAllocateCommandBuffers");
  for (const VkCommandBuffer each : commands) {
    VkCommandBufferBeginInfo begin{};
    begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    check(vk.BeginCommandBuffer(each, &begin), "vkBeginCommandBuffer");
    fill(each, buffer, 1);
    check(vk.EndCommandBuffer(each), "vkEndCommandBuffer");
    VkCommandBufferSubmitInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_SUBMIT_INFO;
    info.commandBuffer = each;
    VkSubmitInfo2 submit{};
    submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO_2;
    submit.commandBufferInfoCount = 1;
    submit.pCommandBufferInfos = &info;
    check(vk.QueueSubmit2(device_->queue(), 1, &submit, VK_NULL_HANDLE), "vkQueueSubmit2");
  }
  check(vk.QueueWaitIdle(device_->queue()), "vkQueueWaitIdle");
  vk.DestroyCommandPool(vk.device, pool, nullptr);
  EXPECT_THAT(device_->take_validation_errors(),
              testing::Contains(testing::HasSubstr("SYNC-HAZARD-WRITE-AFTER-WRITE")));
}

TEST(Check, NamesTheCallTheResultAndWhatToDo) {
  check(VK_SUCCESS, "vkAnything");
  EXPECT_EQ(error_of([] { check(VK_ERROR_DEVICE_LOST, "vkQueueSubmit2"); }),
            "error: vkQueueSubmit2 failed with VK_ERROR_DEVICE_LOST\n"
            "  help:     the driver gave the device up, mostly after an endless loop or an access out of bounds in a "
            "shader; make a new device, and look with validation");
  EXPECT_EQ(error_of([] { check(VK_ERROR_OUT_OF_DEVICE_MEMORY, "vkAllocateMemory"); }),
            "error: vkAllocateMemory failed with VK_ERROR_OUT_OF_DEVICE_MEMORY\n"
            "  help:     use a smaller extent or fewer textures, or close other programs");
  EXPECT_EQ(error_of([] { check(static_cast<VkResult>(-1000), "vkAnything"); }),
            "error: vkAnything failed with VkResult -1000");
}

}  // namespace
}  // namespace heddle::vulkan
