// SPDX-License-Identifier: Apache-2.0
// The driver's functions of one device -> the table that host and plugins call, which counts.
#pragma once

#include "vulkan/device.hpp"

namespace heddle::vulkan {

struct Calls;  // the driver's functions and what was counted
namespace hazard {
class Recorder;
}

/// Owns the counted table of one device; the device outlives it.
///
/// A wrapper gets a VkDevice, VkQueue or VkCommandBuffer and nothing else to tell devices apart. The first word of all
/// three is the loader's dispatch pointer, one for each VkDevice, so a small process-wide list of live devices keyed by
/// that word finds the counters without a lock and without a tax on what callers must pass.
class CountedTable {
 public:
  CountedTable(VkDevice device, VkPhysicalDevice physical_device, PFN_vkGetDeviceProcAddr get_proc_addr);
  ~CountedTable();
  CountedTable(const CountedTable&) = delete;
  CountedTable& operator=(const CountedTable&) = delete;

  /// Takes a function out: the device lacks the feature that it needs.
  template <typename Pfn>
  void remove(Pfn heddle_vulkan::*function) {
    table_.*function = nullptr;
  }

  [[nodiscard]] const heddle_vulkan& table() const { return table_; }
  [[nodiscard]] Counters counters() const;
  void count_upload(std::uint64_t bytes);
  void count_read_back(std::uint64_t bytes);
  /// From now on the recorder is told of every call. It outlives the table.
  void set_recorder(hazard::Recorder* recorder);
  /// From now on dynamic rendering reaches the driver as render passes (ClassicPasses). Before the first object is
  /// made.
  void use_classic_passes(PFN_vkGetDeviceProcAddr get_proc_addr);

 private:
  heddle_vulkan table_{};
  std::unique_ptr<Calls> calls_;
};

}  // namespace heddle::vulkan
