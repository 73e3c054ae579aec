// SPDX-License-Identifier: Apache-2.0
// What was handed to the driver, as plain structures: hazard_recorder.cpp writes them from the calls of the table,
// hazard_model.cpp proves from them that nothing races. Tests type them in by hand, or take barriers away.
#pragma once

#include "diagnostics.hpp"

#include <heddle/vulkan_table.h>

#include <cstdint>
#include <string>
#include <vector>

namespace heddle::vulkan::hazard {

using ObjectIndex = std::uint32_t;
inline constexpr ObjectIndex kEverything = 0xffffffffU;  // of a Dependency: a global memory barrier
inline constexpr std::uint64_t kWhole = ~0ULL;           // of a Range: to the end

/// An image or a buffer, and the bytes that it lies on.
struct Object {
  std::string name;  // "gbuffer.depth", once somebody has named it
  bool is_image = false;
  std::uint32_t layers = 1, mips = 1;
  std::uint64_t memory = 0;  // which VkDeviceMemory; 0: none yet
  std::uint64_t offset = 0, size = 0;
  std::uint32_t texel_bytes = 0;  // images of formats that the host knows
};

/// Buffers: bytes. Images: subresources.
struct Range {
  std::uint64_t offset = 0, size = kWhole;
  std::uint32_t mip = 0, mips = 0xffffffffU, layer = 0, layers = 0xffffffffU;
};

/// One way in which a command touches memory. Reads and writes follow from the access bits.
struct Touch {
  ObjectIndex object = 0;
  Range range;
  VkPipelineStageFlags2 stages = 0;  // one bit a real stage
  VkAccessFlags2 access = 0;
  VkImageLayout layout = VK_IMAGE_LAYOUT_UNDEFINED;  // that the command was told; buffers: UNDEFINED
  bool is_atomic = false;  // every access of it is an atomic operation: such ones do not race with each other
  bool discards = false;   // what was there does not matter, although it is touched (attachments)
};

struct Dependency {
  ObjectIndex object = kEverything;
  Range range;
  VkPipelineStageFlags2 source_stages = 0, target_stages = 0;
  VkAccessFlags2 source_access = 0, target_access = 0;
  VkImageLayout old_layout = VK_IMAGE_LAYOUT_UNDEFINED, new_layout = VK_IMAGE_LAYOUT_UNDEFINED;  // buffers: equal
};

struct Event {
  enum class Kind : std::uint8_t {
    kCommand,    // touches
    kBarrier,    // dependencies
    kHostRead,   // touches: objects and ranges alone count
    kHostWrite,  // the same
    kDiscard,    // the same: whoever reads them next without writing reads what nobody wrote
    kAccept,     // the same: their maker had nothing to write, and whoever reads them knows that
    kDestroy,    // the same
    kSubmit,     // everything before belongs to this submission
    kWait,       // submissions up to this one are done, and the host knows
    kFrame,      // a frame begins
  };
  Kind kind = Kind::kCommand;
  std::uint32_t label = 0;   // Stream::labels
  const char* command = "";  // "vkCmdDispatch"
  std::uint64_t number = 0;  // kSubmit, kWait: which submission; kFrame: which frame
  std::vector<Touch> touches;
  std::vector<Dependency> dependencies;
};

/// Who records: where the pass is written, and "pass 'ao', stage 'denoise'".
struct Label {
  Location where;
  std::string text;
};

struct Stream {
  std::vector<Object> objects;
  std::vector<Label> labels{1};  // the first: nobody said who
  std::vector<Event> events;     // in the order in which the device gets them
};

// ---- hazard_text.cpp: words for messages ----

/// "COMPUTE_SHADER|COPY", "nothing" for 0.
std::string stages_text(VkPipelineStageFlags2 stages);
std::string access_text(VkAccessFlags2 access);
std::string layout_text(VkImageLayout layout);

}  // namespace heddle::vulkan::hazard
