// SPDX-License-Identifier: Apache-2.0
// A device for tests, under the validation layer where it is installed; what the layer says fails the test, up to and
// including the device's end.
#pragma once

#include "vulkan/device.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace heddle::vulkan {

class OnDevice : public testing::Test {
 protected:
  static bool has_validation() {
    const std::vector<std::string> layers = list_layers();
    return std::find(layers.begin(), layers.end(), "VK_LAYER_KHRONOS_validation") != layers.end();
  }

  OnDevice() : device_(make_device()) {}
  ~OnDevice() override {
    device_.reset();
    for (const std::string& message : said_) ADD_FAILURE() << message;
  }

  std::unique_ptr<Device> make_device() {
    DeviceOptions options;
    options.validation = has_validation();
    options.log = [this](Severity, std::string_view text) { said_.emplace_back(text); };
    return std::make_unique<Device>(options);
  }

  std::vector<std::string> said_;
  std::unique_ptr<Device> device_;
};

template <typename Call>
std::string error_of(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return to_text(error.diagnostics());
  }
  return "no error";
}

/// Bytes that differ from place to place and from seed to seed.
inline std::vector<std::byte> pattern(std::size_t size, std::uint32_t seed) {
  std::vector<std::byte> bytes(size);
  std::uint32_t state = seed * 2654435761u + 1;
  for (std::byte& byte : bytes) {
    state = state * 1664525u + 1013904223u;
    byte = static_cast<std::byte>(state >> 24);
  }
  return bytes;
}

}  // namespace heddle::vulkan
