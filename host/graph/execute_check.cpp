// SPDX-License-Identifier: Apache-2.0
// Check mode: tells the device's recorder who records and what things are called, and searches the outputs of every
// pass for values that its role does not allow.

#include "graph/execute_state.hpp"
#include "vulkan/hazard_recorder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace heddle::graph {

namespace {

/// What a port may hold. Without a contract only NaN is wrong.
struct Rule {
  bool allows_infinity = true;
  std::optional<std::array<double, 2>> range;

  explicit Rule(const RolePort* port) {
    if (port == nullptr) return;
    allows_infinity = port->infinite;
    range = port->range;
  }
  /// What is wrong with a value, or nullptr.
  [[nodiscard]] const char* problem(float value) const {
    if (std::isnan(value)) return "a NaN";
    if (std::isinf(value)) return allows_infinity ? nullptr : "an infinity";
    if (range && (value < (*range)[0] || value > (*range)[1])) return "a value out of range";
    return nullptr;
  }
  [[nodiscard]] std::string expected() const {
    std::string text = range ? fmt::format("{} to {}", (*range)[0], (*range)[1]) : "numbers";
    return text + (allows_infinity ? ", or an infinity" : ", finite");
  }
};

}  // namespace

void barrier_between_all(const heddle_vulkan& vk, VkCommandBuffer commands, const vulkan::Image& image,
                         VkImageLayout from, VkImageLayout to) {
  VkImageMemoryBarrier2 barrier{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2};
  barrier.srcStageMask = barrier.dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
  barrier.srcAccessMask = barrier.dstAccessMask = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
  barrier.oldLayout = from;
  barrier.newLayout = to;
  barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  barrier.image = image.handle();
  barrier.subresourceRange = {
      vulkan::format_info(image.shape().format).is_depth ? VK_IMAGE_ASPECT_DEPTH_BIT : VK_IMAGE_ASPECT_COLOR_BIT, 0,
      VK_REMAINING_MIP_LEVELS, 0, VK_REMAINING_ARRAY_LAYERS};
  VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
  dependency.imageMemoryBarrierCount = 1;
  dependency.pImageMemoryBarriers = &barrier;
  vk.CmdPipelineBarrier2(commands, &dependency);
}

void Executor::State::name_resources() {
  vulkan::hazard::Recorder* recorder = device->recorder();
  if (recorder == nullptr) return;
  for (ResourceIndex i = 0; i < graph.resources.size(); ++i) {
    if (resources[i].image) recorder->name(resources[i].image.handle(), graph.resources[i].name);
    if (resources[i].buffer) recorder->name(resources[i].buffer.handle(), graph.resources[i].name);
  }
}

void Executor::State::begin_checked_frame() {
  vulkan::hazard::Recorder* recorder = device->recorder();
  if (recorder == nullptr) return;
  scans.clear();
  wrong_value.reset();
  recorder->begin_frame(info.index);
  recorder->label({{graph.file}, "the start of the frame"});
  // Images come from UNDEFINED; that a buffer's contents end with the frame has to be said.
  for (ResourceIndex i = 0; i < graph.resources.size(); ++i) {
    if (resources[i].buffer && !is_any_version_kept(i)) recorder->discard(resources[i].buffer.handle());
  }
}

void Executor::State::label_commands(const ScheduledStage* stage) {
  vulkan::hazard::Recorder* recorder = device->recorder();
  if (recorder == nullptr) return;
  if (stage == nullptr) {
    recorder->label({{graph.file}, "the end of the frame"});
    return;
  }
  const Pass& pass = graph.passes[stage->pass];
  recorder->label(
      {pass.where, fmt::format("pass '{}', stage '{}'", pass.name, pass.entry.technique->stages[stage->stage].name)});
}

void Executor::State::scan_outputs(std::uint32_t index) {
  vulkan::hazard::Recorder* recorder = device->recorder();
  if (recorder == nullptr) return;
  if (order.stages[index].is_read_back) return;
  const PassIndex pass = order.stages[index].pass;
  // Of the pass's stages the last one that uses an image shows what is made; after it the image's memory may be
  // another's.
  const auto uses = [&](const ScheduledStage& stage, ResourceIndex image) {
    return stage.pass == pass && !stage.is_read_back &&
           std::ranges::any_of(stage.uses,
                               [&](const ScheduledStage::Use& use) { return resources[use.resource].root == image; });
  };
  const heddle_vulkan& vk = device->table();
  const vulkan::hazard::Recorder::Pause pause(recorder);
  for (const Port& port : graph.passes[pass].entry.technique->ports) {
    const auto bound = graph.passes[pass].ports.find(port.name);
    if (port.direction == Direction::kIn || bound == graph.passes[pass].ports.end()) continue;
    ResourceState& state = root(bound->second);
    if (!state.image || state.layout == VK_IMAGE_LAYOUT_UNDEFINED || !uses(order.stages[index], state.root)) continue;
    if (std::any_of(order.stages.begin() + index + 1, order.stages.end(),
                    [&](const ScheduledStage& later) { return uses(later, state.root); }))
      continue;
    const vulkan::ImageShape& shape = state.image.shape();
    // Compressed texels are numbers within their range whatever their bits are.
    if (vulkan::format_info(shape.format).block_bytes != 0) continue;
    barrier_between_all(vk, commands, state.image, state.layout, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
    // Layers of an attachment that nobody drew this frame (a shadow atlas with room left) hold nothing that was meant.
    const auto drawn = drawn_layers.find(state.root);
    for (std::uint32_t layer = 0; layer < shape.layers; ++layer) {
      if (drawn != drawn_layers.end() && drawn->second.count(layer) == 0) continue;
      for (std::uint32_t mip = 0; mip < shape.mips; ++mip) {
        Scan scan{pass,
                  bound->second,
                  layer,
                  mip,
                  std::max(shape.width >> mip, 1U),
                  std::max(shape.height >> mip, 1U),
                  info.iteration,
                  info.iteration_count,
                  {}};
        scan.texels =
            device->make_buffer(std::uint64_t{scan.width} * scan.height * vulkan::format_info(shape.format).texel_bytes,
                                VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
        VkBufferImageCopy region{};
        region.imageSubresource = {
            vulkan::format_info(shape.format).is_depth ? VK_IMAGE_ASPECT_DEPTH_BIT : VK_IMAGE_ASPECT_COLOR_BIT, mip,
            layer, 1};
        region.imageExtent = {scan.width, scan.height, 1};
        vk.CmdCopyImageToBuffer(commands, state.image.handle(), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                                scan.texels.handle(), 1, &region);
        scans.push_back(std::move(scan));
      }
    }
    barrier_between_all(vk, commands, state.image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, state.layout);
  }
  show_copies_to_host(vk, commands);
}

/// Keeps the first value that breaks a rule. The device is done with the copies.
void Executor::State::search_scans(std::size_t begin) {
  // Where nobody looks, poisoned memory may stay what it was; zeros are no poison. What follows from the first is not
  // told.
  if (variant.poison.value_or(0) != 0 || wrong_value) return;
  for (const Scan& scan : std::span(scans).subspan(begin)) {
    const Resource& resource = graph.resources[scan.resource];
    const Pass& pass = graph.passes[scan.pass];
    const vulkan::ImageShape& shape = root(scan.resource).image.shape();
    const Rule rule(pass.role->find_port(resource.port));
    const std::uint32_t channels = vulkan::format_info(shape.format).channels;
    const std::vector<float> values =
        vulkan::to_float({scan.texels.data(), scan.texels.data() + scan.texels.size()}, shape.format);
    const auto wrong = [&](float value) { return rule.problem(value) != nullptr; };
    const auto first = std::find_if(values.begin(), values.end(), wrong);
    if (first == values.end()) continue;
    const auto pixel = static_cast<std::uint32_t>(first - values.begin()) / channels;
    const auto count = std::count_if(values.begin(), values.end(), wrong);
    Diagnostic diagnostic;
    diagnostic.where = pass.where;
    diagnostic.message = fmt::format("frame {}, pass '{}' ({}): '{}' holds {} at pixel {}, {}", info.index, pass.name,
                                     pass.entry.technique->id, resource.name, rule.problem(*first), pixel % scan.width,
                                     pixel / scan.width);
    if (shape.layers > 1) diagnostic.message += fmt::format(", layer {}", scan.layer);
    if (shape.mips > 1) diagnostic.message += fmt::format(", mip {}", scan.mip);
    if (scan.iteration_count > 0)
      diagnostic.message += fmt::format(", in iteration {} of {}", scan.iteration, scan.iteration_count);
    diagnostic.found = fmt::format("{} in channel {}; {} of {} numbers are wrong", *first,
                                   (first - values.begin()) % channels, count, values.size());
    diagnostic.expected = rule.expected();
    diagnostic.help = "this is the first output in the order of the frame that breaks a rule";
    wrong_value = std::move(diagnostic);
    return;
  }
}

void Executor::State::throw_what_the_check_found() {
  if (device->recorder() == nullptr) return;
  std::vector<Diagnostic> found = device->take_hazards();
  search_scans(0);
  if (wrong_value) found.push_back(std::move(*wrong_value));
  if (!found.empty()) throw Error(HEDDLE_BUG, std::move(found));
}

}  // namespace heddle::graph
