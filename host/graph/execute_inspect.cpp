// SPDX-License-Identifier: Apache-2.0
// Looks at pixels through the graph: copies texels of each image right after the stage that finishes it, so that what
// is changed in place or shares memory later is seen as it was made.

#include "graph/execute_state.hpp"
#include "graph/explain.hpp"
#include "vulkan/hazard_recorder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace heddle::graph {

namespace {

/// Bytes from texel to texel: a multiple of every texel's size, 12 and 16 bytes among them, as copies to buffers need.
constexpr std::uint64_t kLookStride = 48;

/// Images of the frame's shape, whatever their resolution; not maps with an extent of their own.
bool is_of_the_frame(const ResolvedGraph& graph, ResourceIndex resource) {
  const Resource& first = graph.resources[first_version(graph, resource)];
  const Port* port = graph.passes[first.producer].entry.technique->find_port(first.port);
  return port != nullptr && port->extent_rule == HEDDLE_EXTENT_FRAME;
}

/// The texel under the centre of a pixel of the frame.
std::uint32_t texel_of(std::uint32_t pixel, std::uint32_t frame_size, std::uint32_t size) {
  return static_cast<std::uint32_t>((2 * std::uint64_t{pixel} + 1) * size / (2 * std::uint64_t{frame_size}));
}

/// Values are shown as stored; shaders see them decoded.
bool is_encoded(VkFormat format) {
  return format_text(static_cast<std::uint32_t>(format)).ends_with("_srgb");
}

Json number(float value) {
  if (std::isfinite(value)) return value;
  return std::isnan(value) ? "nan" : value > 0 ? "inf" : "-inf";
}

/// What a person should notice about a value; "" for nothing.
std::string problem_of(float value, const RolePort* contract) {
  if (std::isnan(value)) return "NaN";
  if (std::isinf(value)) return contract != nullptr && !contract->infinite ? "Inf, which the role forbids" : "";
  if (contract == nullptr || !contract->range) return {};
  const auto [low, high] = *contract->range;
  return value < low || value > high ? fmt::format("out of the role's range, {} to {}", low, high) : "";
}

}  // namespace

void Executor::State::look_at_outputs(std::uint32_t index) {
  if (pixels.empty()) return;
  const heddle_vulkan& vk = device->table();
  const vulkan::hazard::Recorder::Pause pause(device->recorder());
  const auto writes = [](const ScheduledStage& stage, ResourceIndex resource) {
    return std::ranges::any_of(stage.uses, [&](const auto& use) { return use.resource == resource && use.writes; });
  };
  bool has_copied = false;
  for (const ScheduledStage::Use& use : order.stages[index].uses) {
    if (!use.writes || graph.resources[use.resource].type != PortType::kImage) continue;
    if (std::any_of(order.stages.begin() + index + 1, order.stages.end(),
                    [&](const ScheduledStage& later) { return writes(later, use.resource); }))
      continue;
    const ResourceState& state = root(use.resource);
    if (!state.image || state.layout == VK_IMAGE_LAYOUT_UNDEFINED) continue;
    const vulkan::ImageShape& shape = state.image.shape();
    Look look{index, use.resource, shape.layers, {}};
    if (is_of_the_frame(graph, use.resource) && vulkan::format_info(shape.format).block_bytes == 0) {
      look.texels =
          device->make_buffer(kLookStride * pixels.size() * shape.layers, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
      std::vector<VkBufferImageCopy> regions;
      for (std::uint32_t layer = 0; layer < shape.layers; ++layer) {
        for (const Pixel& pixel : pixels) {
          VkBufferImageCopy region{};
          region.bufferOffset = kLookStride * regions.size();
          region.imageSubresource = {
              vulkan::format_info(shape.format).is_depth ? VK_IMAGE_ASPECT_DEPTH_BIT : VK_IMAGE_ASPECT_COLOR_BIT, 0,
              layer, 1};
          region.imageOffset = {static_cast<std::int32_t>(texel_of(pixel.x, graph.width, shape.width)),
                                static_cast<std::int32_t>(texel_of(pixel.y, graph.height, shape.height)), 0};
          region.imageExtent = {1, 1, 1};
          regions.push_back(region);
        }
      }
      barrier_between_all(vk, commands, state.image, state.layout, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
      vk.CmdCopyImageToBuffer(commands, state.image.handle(), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                              look.texels.handle(), static_cast<std::uint32_t>(regions.size()), regions.data());
      barrier_between_all(vk, commands, state.image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, state.layout);
      has_copied = true;
    }
    looks.push_back(std::move(look));
  }
  if (!has_copied) return;
  show_copies_to_host(vk, commands);
}

Json Executor::inspect(const scene::Scene& rendered, const FrameOptions& options, std::vector<Pixel> pixels) {
  State& s = *state_;
  for (const Pixel& pixel : pixels) {
    if (pixel.x < s.graph.width && pixel.y < s.graph.height) continue;
    throw Error(HEDDLE_BAD_INPUT,
                Diagnostic{Severity::kError,
                           {},
                           fmt::format("pixel {},{} lies outside of the frame", pixel.x, pixel.y),
                           {},
                           fmt::format("X from 0 to {}, Y from 0 to {}", s.graph.width - 1, s.graph.height - 1),
                           {}});
  }
  struct Forget {
    State& state;
    ~Forget() {
      state.pixels.clear();
      state.looks.clear();
    }
  } const forget{s};
  s.pixels = std::move(pixels);
  FrameOptions chosen = options;
  chosen.anew = true;  // also what is complete and unchanged
  render(rendered, chosen);
  Json json{{"extent", {s.graph.width, s.graph.height}}, {"frame", s.info.index}, {"pixels", Json::array()}};
  for (std::size_t p = 0; p < s.pixels.size(); ++p) {
    Json ports = Json::array();
    for (const State::Look& look : s.looks) {
      const Resource& resource = s.graph.resources[look.resource];
      const ScheduledStage& stage = s.order.stages[look.stage];
      const Pass& pass = s.graph.passes[resource.producer];
      const vulkan::ImageShape& shape = s.root(look.resource).image.shape();
      const RolePort* contract = pass.role->find_port(resource.port);
      Json entry{{"name", resource.name},
                 {"pass", pass.name},
                 {"port", resource.port},
                 {"technique", pass.entry.technique->id},
                 {"place", look.stage + 1},
                 {"stage", s.graph.passes[stage.pass].entry.technique->stages[stage.stage].name},
                 {"format", format_text(static_cast<std::uint32_t>(shape.format))},
                 {"extent", {shape.width, shape.height}}};
      if (contract != nullptr && !contract->unit.empty()) entry["unit"] = contract->unit;
      if (is_encoded(shape.format)) entry["encoding"] = "srgb";
      if (resource.previous_version != kNoIndex) entry["changes"] = s.graph.resources[resource.previous_version].name;
      if (!look.texels) {
        entry["texel"] = nullptr;
        ports.push_back(std::move(entry));
        continue;
      }
      const Pixel& pixel = s.pixels[p];
      entry["texel"] = {texel_of(pixel.x, s.graph.width, shape.width), texel_of(pixel.y, s.graph.height, shape.height)};
      const std::uint32_t bytes = vulkan::format_info(shape.format).texel_bytes;
      entry["layers"] = Json::array();
      for (std::uint32_t layer = 0; layer < look.layers; ++layer) {
        const std::byte* texel = look.texels.data() + kLookStride * (layer * s.pixels.size() + p);
        Json values = Json::array();
        Json problems = Json::array();
        const std::vector<float> decoded = vulkan::to_float({texel, texel + bytes}, shape.format);
        for (std::size_t channel = 0; channel < decoded.size(); ++channel) {
          values.push_back(number(decoded[channel]));
          if (std::string problem = problem_of(decoded[channel], contract); !problem.empty())
            problems.push_back({{"channel", channel}, {"problem", std::move(problem)}});
        }
        entry["layers"].push_back({{"values", std::move(values)}, {"problems", std::move(problems)}});
      }
      ports.push_back(std::move(entry));
    }
    json["pixels"].push_back({{"pixel", {s.pixels[p].x, s.pixels[p].y}}, {"ports", std::move(ports)}});
  }
  return json;
}

}  // namespace heddle::graph
