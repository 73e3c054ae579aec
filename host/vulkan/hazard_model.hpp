// SPDX-License-Identifier: Apache-2.0
// Proves from a stream of commands that every read-after-write, write-after-read, write-after-write and every layout is
// covered by barriers. It knows Vulkan's memory model and nothing of graphs: it shares no table with the planner, whose
// output it judges.
//
// Rules (Vulkan 1.3, "Synchronization"): every past access knows the stages that run after it (execution dependencies,
// and chains of them), and every past write whether it is available and in which (stage, access) pairs it is visible.
// Submissions follow each other in one queue; that the host waits for a fence orders nothing between two commands here,
// so that a frame may be in flight while the next is recorded. Bytes count, not handles: a barrier on one resource also
// covers what lies on the same bytes under another name, as drivers flush memory and not resources.
#pragma once

#include "vulkan/hazard_stream.hpp"

#include <map>
#include <set>

namespace heddle::vulkan::hazard {

class Model {
 public:
  /// Plays events from `first` on. The stream may have grown since the last call; objects keep their indices.
  void play(const Stream& stream, std::size_t first = 0);
  /// What was found since the last call; each hazard once, however many frames in between repeat it.
  std::vector<Diagnostic> take_findings();

 private:
  struct Visible {
    VkPipelineStageFlags2 stages = 0;
    VkAccessFlags2 access = 0;
  };
  struct Past {
    Range range;
    VkPipelineStageFlags2 stage = 0;  // one bit; 0: a layout transition
    VkAccessFlags2 access = 0;
    bool is_write = false, is_atomic = false, is_transition = false;
    bool is_available = false;
    VkPipelineStageFlags2 after = 0;  // whatever runs in these stages from now on comes later
    std::vector<Visible> visible;
    std::uint64_t submission = 0;
    std::uint64_t frame = 0;
    std::uint32_t label = 0;
    const char* command = "";
  };
  struct Subresource {
    VkImageLayout layout = VK_IMAGE_LAYOUT_UNDEFINED;
    bool is_defined = false;
  };
  struct State {
    std::vector<Past> past;
    std::vector<Subresource> subresources;  // images: layer by layer, mips within
    bool is_lost = false;                   // buffers: another resource took the bytes, or a frame began
    std::string taken_by;                   // who wrote over the bytes
  };

  void apply(const Event& event);
  [[nodiscard]] bool is_transition(const Dependency& dependency) const;
  void check_transition(const Event& event, const Dependency& dependency, ObjectIndex object, const Past& past,
                        bool is_ordered, bool is_available);
  void finish_transition(const Event& event, const Dependency& dependency);
  void touch(const Event& event, const Touch& touch);
  void check_layout(const Event& event, const Touch& touch);
  void check_past(const Event& event, const Touch& touch, ObjectIndex object, const Past& past);
  void record(const Event& event, const Touch& touch);
  void take_bytes(ObjectIndex writer, const Range& range);
  void host(const Event& event, const Touch& touch);
  void discard(ObjectIndex object);
  void accept(ObjectIndex object);
  void destroy(const Event& event, ObjectIndex object);

  [[nodiscard]] State& state(ObjectIndex object);
  [[nodiscard]] bool overlaps(ObjectIndex a, const Range& range_a, ObjectIndex b, const Range& range_b) const;
  /// Objects that share bytes with this one, itself included.
  [[nodiscard]] std::vector<ObjectIndex> sharers(ObjectIndex object) const;
  [[nodiscard]] Range clamp(ObjectIndex object, Range range) const;
  [[nodiscard]] std::string name(ObjectIndex object) const;
  [[nodiscard]] std::string describe(const Past& past) const;
  void complain(const Event& event, std::string what, std::string found, std::string expected, std::string help = {});

  const Stream* stream_ = nullptr;
  std::vector<State> states_;
  std::map<std::uint64_t, std::vector<ObjectIndex>> in_memory_;
  std::uint64_t submission_ = 1, done_ = 0, frame_ = 0;
  std::vector<Diagnostic> findings_;
  std::set<std::string> told_;
};

/// Whether any of the bits writes.
bool is_write(VkAccessFlags2 access);

}  // namespace heddle::vulkan::hazard
