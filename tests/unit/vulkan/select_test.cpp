// SPDX-License-Identifier: Apache-2.0
// Which device the user means, among devices that the test makes up; which features are asked for.
#include "vulkan/select.hpp"

#include <gtest/gtest.h>

#include <cstdlib>

namespace heddle::vulkan {
namespace {

Candidate candidate(std::uint32_t index, const char* name, const char* driver, const char* missing = "") {
  Candidate result;
  result.info.index = index;
  result.info.name = name;
  result.info.driver = driver;
  result.info.missing = missing;
  result.info.is_usable = result.info.missing.empty();
  result.info.is_lavapipe = result.info.driver == "llvmpipe";
  return result;
}

class Choose : public testing::Test {
 protected:
  Choose() {
    if (const char* const value = std::getenv("HEDDLE_DEVICE")) saved_ = value;
    unsetenv("HEDDLE_DEVICE");
  }
  ~Choose() override {
    unsetenv("HEDDLE_DEVICE");
    if (saved_) setenv("HEDDLE_DEVICE", saved_->c_str(), 1);
  }
  [[nodiscard]] std::string chosen(std::string_view wanted) const { return choose(machine_, wanted).info.name; }
  [[nodiscard]] std::string error_of(std::string_view wanted) const {
    try {
      return "no error but " + chosen(wanted);
    } catch (const Error& error) {
      status_ = error.status();
      return to_text(error.diagnostics());
    }
  }

  std::vector<Candidate> machine_ = {
      candidate(0, "Old Card 100", "nvidia", "Vulkan 1.3 (it offers 1.2.0)"),
      candidate(1, "New Card 4090", "nvidia"),
      candidate(2, "llvmpipe (LLVM 15.0.6, 256 bits)", "llvmpipe"),
  };
  mutable heddle_status status_ = HEDDLE_OK;

 private:
  std::optional<std::string> saved_;
};

TEST_F(Choose, TakesLavapipeFirst) {
  EXPECT_EQ(chosen(""), machine_[2].info.name);
}

TEST_F(Choose, TakesTheFirstUsableWithoutLavapipe) {
  machine_.pop_back();
  EXPECT_EQ(chosen(""), "New Card 4090");
}

TEST_F(Choose, SkipsLavapipeThatLacksSomething) {
  machine_[2].info.is_usable = false;
  EXPECT_EQ(chosen(""), "New Card 4090");
}

TEST_F(Choose, ReadsTheVariableOnlyWhenNothingIsAskedFor) {
  setenv("HEDDLE_DEVICE", "4090", 1);
  EXPECT_EQ(chosen(""), "New Card 4090");
  EXPECT_EQ(chosen("lavapipe"), machine_[2].info.name);
}

TEST_F(Choose, MatchesPartsInAnyCaseAndIndices) {
  EXPECT_EQ(chosen("new card"), "New Card 4090");
  EXPECT_EQ(chosen("NVIDIA"), "New Card 4090");  // the old one matches as well, but cannot run
  EXPECT_EQ(chosen("1"), "New Card 4090");
  EXPECT_EQ(chosen("2"), machine_[2].info.name);
  EXPECT_EQ(chosen("4090"), "New Card 4090");  // no such index, but part of a name
  EXPECT_EQ(chosen("LLVM"), machine_[2].info.name);
}

TEST_F(Choose, SaysWhatExistsWhenNothingMatches) {
  EXPECT_EQ(error_of("radeon"),
            "error: the device that was asked for does not exist\n"
            "  found:    \"radeon\"\n"
            "  expected: an index or part of a name of: 0 Old Card 100, 1 New Card 4090, "
            "2 llvmpipe (LLVM 15.0.6, 256 bits)\n"
            "  help:     leave it out to take lavapipe, or else the first usable device");
  EXPECT_EQ(status_, HEDDLE_BAD_INPUT);
  setenv("HEDDLE_DEVICE", "9", 1);
  EXPECT_TRUE(error_of("").starts_with("error: HEDDLE_DEVICE does not exist\n  found:    \"9\"\n")) << error_of("");
}

TEST_F(Choose, SaysWhatADeviceLacks) {
  const std::string text =
      "error: the device \"Old Card 100\" cannot run Heddle\n"
      "  found:    it lacks Vulkan 1.3 (it offers 1.2.0)\n"
      "  help:     update its driver, or choose another device: HEDDLE_DEVICE=lavapipe is software and always works";
  EXPECT_EQ(error_of("old"), text);
  EXPECT_EQ(status_, HEDDLE_UNSUPPORTED);
  EXPECT_EQ(error_of("0"), text);
  machine_.resize(1);
  EXPECT_EQ(error_of(""), text);
}

TEST(AskFor, TakesWelcomeFeaturesOnlyWhereOffered) {
  Features offered;
  offered.core.features.samplerAnisotropy = VK_TRUE;
  offered.core.features.robustBufferAccess = VK_TRUE;
  offered.v13.synchronization2 = VK_TRUE;
  Features plain;
  ask_for(offered, false, plain);
  EXPECT_TRUE(plain.core.features.samplerAnisotropy);
  EXPECT_TRUE(plain.v13.synchronization2);
  EXPECT_FALSE(plain.core.features.shaderFloat64);
  EXPECT_FALSE(plain.core.features.robustBufferAccess);
  Features checked;
  ask_for(offered, true, checked);
  EXPECT_TRUE(checked.core.features.robustBufferAccess);
}

}  // namespace
}  // namespace heddle::vulkan
