// SPDX-License-Identifier: Apache-2.0
// planted/...: what a technique may get wrong without anything that declarations or reflection could tell. For tests.
#include <heddle/pass.hpp>

#include <algorithm>

namespace {

using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    image_in("a", "first", HEDDLE_PORT_OPTIONAL),
    image_in("b", "second", HEDDLE_PORT_OPTIONAL),
    image_out("color", VK_FORMAT_R32G32B32A32_SFLOAT, "what was made"),
};
constexpr const char* kWhere[] = {"everywhere", "left_half", nullptr};
constexpr const char* kSpots[] = {"none", "nan", "infinity", "negative", nullptr};
constexpr heddle_parameter kParameters[] = {
    parameter("value", "1", 0, 1000, 1, "of every pixel"),
    choice("where", kWhere, 0, "which pixels are written"),
    choice("spot", kSpots, 0, "what stands at pixel 5, 3"),
};
constexpr heddle_access kStorage[] = {storage_write("color")};
constexpr heddle_access kCombining[] = {sampled("a"), sampled("b"), storage_write("color")};
constexpr heddle_access kHostWrites[] = {host_write("color")};
constexpr heddle_access kTransfers[] = {transfer_write("color")};
constexpr heddle_stage kFillStages[] = {gpu_stage("fill", kStorage)};
constexpr heddle_stage kCombineStages[] = {gpu_stage("combine", kCombining)};
constexpr heddle_stage kHostStages[] = {cpu_stage("say", kHostWrites)};
constexpr heddle_stage kTransferStages[] = {gpu_stage("transfer", kTransfers)};
constexpr heddle_shader kFillShaders[] = {compute_shader("fill", "fill", "fill.comp.glsl")};
constexpr heddle_shader kCombineShaders[] = {compute_shader("combine", "combine", "combine.comp.glsl")};

// What passes share behind the graph's back.
float published = 0;
VkImage leaked = VK_NULL_HANDLE;
std::uint64_t counted_frame = ~0ULL;
float counted = 0;

heddle_status fill_mapped(const Frame& frame, float value) {
  heddle_mapped mapped{};
  if (const heddle_status status = frame.map("color", mapped); status != HEDDLE_OK) return status;
  std::fill_n(static_cast<float*>(mapped.data), std::size_t{4} * mapped.shape.width * mapped.shape.height, value);
  return HEDDLE_OK;
}

void clear(const Frame& frame, float value) {
  const VkClearColorValue color{{value, value, value, value}};
  const VkImageSubresourceRange all{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
  frame.vulkan().CmdClearColorImage(frame.command_buffer(), frame.image("color"), VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                                    &color, 1, &all);
}

struct Constant {
  heddle_status record(const Frame& frame) { return frame.dispatch_over("fill", "color"); }
};
struct Combine {
  heddle_status record(const Frame& frame) { return frame.dispatch_over("combine", "color"); }
};
/// Two dispatches into one image, and nothing in between.
struct Forgets {
  heddle_status record(const Frame& frame) {
    if (const heddle_status status = frame.dispatch_over("fill", "color"); status != HEDDLE_OK) return status;
    return frame.dispatch_over("fill", "color");
  }
};
/// A cpu stage that another one listens to, on no port.
struct Publishes {
  heddle_status execute(const Frame& frame) {
    published = static_cast<float>(frame.info().index + 1);
    return fill_mapped(frame, published);
  }
};
struct Listens {
  heddle_status execute(const Frame& frame) { return fill_mapped(frame, published); }
};
/// An image whose handle another pass gets hold of.
struct Leaks {
  Leaks() { leaked = VK_NULL_HANDLE; }
  heddle_status record(const Frame& frame) {
    leaked = frame.image("color");
    return frame.dispatch_over("fill", "color");
  }
};
struct Copies {
  heddle_status record(const Frame& frame) {
    if (leaked == VK_NULL_HANDLE) {
      clear(frame, 0);
      return HEDDLE_OK;
    }
    VkMemoryBarrier2 memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2};
    memory.srcStageMask = memory.dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
    memory.srcAccessMask = memory.dstAccessMask = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
    VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
    dependency.memoryBarrierCount = 1;
    dependency.pMemoryBarriers = &memory;
    const heddle_shape shape = frame.host().shape("color");
    VkImageCopy region{};
    region.srcSubresource = region.dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    region.extent = {shape.width, shape.height, 1};
    const heddle_vulkan& vk = frame.vulkan();
    vk.CmdPipelineBarrier2(frame.command_buffer(), &dependency);
    vk.CmdCopyImage(frame.command_buffer(), leaked, VK_IMAGE_LAYOUT_GENERAL, frame.image("color"),
                    VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &region);
    vk.CmdPipelineBarrier2(frame.command_buffer(), &dependency);
    return HEDDLE_OK;
  }
};
/// Several passes that count together: who comes first gets 1.
struct Counts {
  heddle_status record(const Frame& frame) {
    if (counted_frame != frame.info().index) counted = 0;
    counted_frame = frame.info().index;
    counted += 1;
    clear(frame, counted);
    return HEDDLE_OK;
  }
};

template <typename Pass, std::size_t kStageCount>
constexpr heddle_technique planted(const char* id, const char* title, const heddle_stage (&stages)[kStageCount]) {
  return technique<Pass>(id, title, "a mistake", kPorts, kParameters, stages);
}
template <typename Pass>
constexpr heddle_technique filling(const char* id, const char* title) {
  heddle_technique t = planted<Pass>(id, title, kFillStages);
  t.shaders = list(kFillShaders, t.shader_count);
  return t;
}
constexpr heddle_technique kConstant = filling<Constant>("planted/constant", "A value, or what breaks a role's rule");
constexpr heddle_technique kForgets = filling<Forgets>("planted/forgets", "No barrier between two of its dispatches");
constexpr heddle_technique kLeaks = filling<Leaks>("planted/leaks", "Gives away the handle of its image");
constexpr heddle_technique kCombine = [] {
  heddle_technique t = planted<Combine>("planted/combine", "a + 2 b", kCombineStages);
  t.shaders = list(kCombineShaders, t.shader_count);
  return t;
}();
constexpr heddle_technique kPublishes = planted<Publishes>("planted/publishes", "Says the frame's number", kHostStages);
constexpr heddle_technique kListens = planted<Listens>("planted/listens", "Repeats what was said", kHostStages);
constexpr heddle_technique kCopies = planted<Copies>("planted/copies", "Copies a leaked image", kTransferStages);
constexpr heddle_technique kCounts = planted<Counts>("planted/counts", "Counts with its like", kTransferStages);

}  // namespace

HEDDLE_PLUGIN(kConstant, kCombine, kForgets, kPublishes, kListens, kLeaks, kCopies, kCounts)
