// SPDX-License-Identifier: Apache-2.0
// What stages touch: declared accesses of a stage, and of the functions that its shaders reach, as uses of resources.
#pragma once

#include "graph/stages.hpp"

namespace heddle::graph {

/// Adds a use; several of one resource become one whose `access` has a layout that suits them all.
void merge_use(std::vector<ScheduledStage::Use>& uses, const ScheduledStage::Use& use);

/// Uses of a stage's own declared accesses. Absent optional inputs are left out, and so is what late_uses answers.
std::vector<ScheduledStage::Use> own_uses(const ResolvedGraph& graph, PassIndex pass, std::uint32_t stage);

/// What a stage with latency reads of earlier frames: copied in each frame when it is made.
std::vector<ScheduledStage::Use> late_uses(const ResolvedGraph& graph, PassIndex pass, std::uint32_t stage);

/// What the functions of every provider reached by these calls touch, through the providers' own ports.
std::vector<ScheduledStage::Use> function_uses(const ResolvedGraph& graph, PassIndex caller,
                                               std::span<const std::string> calls);

/// False for a stage that a parameter of the pass rules out.
bool is_scheduled(const Pass& pass, const Stage& stage);

/// Roles called by the shaders of a stage; cpu stages: all that the pass calls (they may ask for services).
std::vector<std::string> stage_calls(const Pass& pass, std::uint32_t stage);
/// Roles called by any shader or function text of the technique, in order of first appearance.
std::vector<std::string> all_calls(const Technique& technique);

/// Producers of inputs, providers, and producers of what providers read; sorted, without the pass itself.
std::vector<PassIndex> find_dependencies(const ResolvedGraph& graph, PassIndex pass);
/// Producers of what the pass reads of earlier frames, itself included; sorted.
std::vector<PassIndex> find_past_dependencies(const ResolvedGraph& graph, PassIndex pass);

/// The pass that makes a resource, or made it in the frame before; kNoIndex: the scene.
PassIndex maker_of(const ResolvedGraph& graph, const Resource& resource);

/// True if the resource's contents last from frame to frame: kept by its technique, or a version of what is.
bool is_kept(const ResolvedGraph& graph, ResourceIndex resource);

/// True for images and buffers: what has memory, versions in place, and barriers.
inline bool has_memory(PortType type) {
  return type == PortType::kImage || type == PortType::kBuffer;
}

/// The versions of surfaces that passes made, the newest first: what a later one places anew is gone from the earlier.
std::vector<ResourceIndex> made_surfaces(const ResolvedGraph& graph, ResourceIndex surfaces);
/// True if the scene's own triangles are beneath them.
bool holds_scene(const ResolvedGraph& graph, ResourceIndex surfaces);
/// The buffers of one made version; kNoIndex: it has none.
struct BatchBuffers {
  ResourceIndex vertices = kNoIndex, indices = kNoIndex, instances = kNoIndex, commands = kNoIndex;
};
BatchBuffers batch_buffers_of(const ResolvedGraph& graph, ResourceIndex made);
/// The function by which the makers of one made version say where its vertices are; nullptr: they lie in a buffer.
const Function* program_of(const ResolvedGraph& graph, ResourceIndex made);
/// Every buffer that drawing the surfaces reads, but for what programs read.
std::vector<ResourceIndex> batch_buffers(const ResolvedGraph& graph, ResourceIndex surfaces);

/// "HEDDLE_ACCESS_" in words of people: "sampled", "colour", ...
std::string_view access_name(std::uint32_t access);

}  // namespace heddle::graph
