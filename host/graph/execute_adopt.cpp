// SPDX-License-Identifier: Apache-2.0
// What one plan hands to the next, so that a graph that changes loses nothing but what the change touches: objects of
// passes, their pipelines, and what they keep between frames.

#include "graph/execute_state.hpp"
#include "graph/uses.hpp"

#include <algorithm>
#include <cstddef>

namespace heddle::graph {

namespace {

bool is_same_shape(const Resource& a, const Resource& b) {
  return a.type == b.type && a.format == b.format && a.width == b.width && a.height == b.height &&
         a.layers == b.layers && a.mips == b.mips && a.flags == b.flags && a.byte_size == b.byte_size &&
         a.capacity == b.capacity && a.element_bytes == b.element_bytes && a.content == b.content;
}

std::map<std::string, Resource, std::less<>> shapes_of(const ResolvedGraph& graph, const Pass& pass) {
  std::map<std::string, Resource, std::less<>> shapes;
  for (const auto& [port, resource] : pass.ports) shapes.emplace(port, graph.resources[resource]);
  return shapes;
}

/// What is joined into a pass's shaders, by name: indices differ from plan to plan.
std::vector<std::string> providers_of(const ResolvedGraph& graph, const Pass& pass) {
  std::vector<std::string> names;
  for (const FunctionBinding& binding : pass.functions) {
    names.push_back(binding.role);
    for (const PassIndex index : binding.providers) {
      const Pass& provider = graph.passes[index];
      if (!provider.is_pruned) names.push_back(provider.name + " " + provider.entry.technique->id);
    }
  }
  return names;
}

bool needs_declare(const Technique& technique, const Pass& a, const Pass& b) {
  for (std::size_t i = 0; i < technique.parameters.size(); ++i) {
    if ((technique.parameters[i].flags & HEDDLE_PARAMETER_REDECLARE) == 0) continue;
    if (!(a.parameters[i] == b.parameters[i])) return true;
  }
  return false;
}

}  // namespace

void Executor::State::destroy(PassState& pass) {
  if (pass.object != nullptr && pass.descriptor->destroy != nullptr) pass.descriptor->destroy(pass.object);
  pass.object = nullptr;
  pass.is_prepared = false;
}

/// Takes the plan down and puts aside what the next may adopt. What a plan that failed half way had adopted goes back.
void Executor::State::retire() {
  if (device != nullptr) (void)device->table().DeviceWaitIdle(device->table().device);
  // What lists counted in frames that were still running is not told any more: their passes go.
  while (!in_flight.empty()) {
    note_counts(in_flight.front());
    end_frame(in_flight.front());
    spare.push_back(std::move(in_flight.front()));
    in_flight.pop_front();
  }
  outgrown_buffers.clear();
  legacy.has_past = legacy.has_past || (is_planned && !is_fresh);
  for (PassIndex i = 0; i < passes.size(); ++i) {
    if (!passes[i]) continue;
    PassState& pass = *passes[i];
    const auto known = legacy.passes.find(graph.passes[i].name);
    const bool is_place_free = known == legacy.passes.end() || !known->second.state;
    if (!pass.is_prepared || pass.is_redeclared || !is_place_free) {
      destroy(pass);
      continue;
    }
    // What comes back from a plan that failed is what it was before.
    Legacy::Object made;
    Legacy::Object& object = pass.is_adopted && known != legacy.passes.end() ? known->second : made;
    if (&object == &made) {
      object.pass = graph.passes[i];
      object.shapes = shapes_of(graph, graph.passes[i]);
      object.providers = providers_of(graph, graph.passes[i]);
      object.width = graph.width;
      object.height = graph.height;
    }
    for (ReadBackRing& ring : rings)
      if (ring.pass == i) object.rings.push_back(std::move(ring));
    object.state = std::move(passes[i]);
    if (&object == &made) legacy.passes.insert_or_assign(graph.passes[i].name, std::move(made));
  }
  for (ResourceIndex i = 0; i < resources.size(); ++i) {
    ResourceState& state = resources[i];
    const bool is_memory = state.image || state.buffer;
    const bool is_wanted =
        std::ranges::any_of(wanted, [&](ResourceIndex w) { return resources[w].root == i && state.image; });
    const bool is_value = (graph.resources[i].type == PortType::kValue && state.value.is_set) || state.made;
    if (!is_value && !(is_memory && (is_wanted || is_any_version_kept(i)))) continue;
    const std::string& name = graph.resources[i].name;
    if (!legacy.memory.contains(name))
      legacy.memory.emplace(name, Legacy::Memory{graph.resources[i], std::move(state)});
  }
  passes.clear();
  resources.clear();
  rings.clear();
  frame_buffers.clear();
  heap = {};
  is_planned = false;
}

void Executor::State::bury() {
  for (auto& [name, object] : legacy.passes)
    if (object.state) destroy(*object.state);
  legacy = {};
}

/// The object that a pass of this name had, if nothing but the shapes of its inputs could ask for another. These are
/// not known yet.
std::unique_ptr<PassState> Executor::State::adopt_object(PassIndex index) {
  const Pass& pass = graph.passes[index];
  const auto found = legacy.passes.find(pass.name);
  if (found == legacy.passes.end()) return nullptr;
  Legacy::Object& object = found->second;
  if (!object.state || object.pass.entry.technique != pass.entry.technique ||
      object.pass.entry.manifest != pass.entry.manifest || object.width != graph.width ||
      object.height != graph.height || object.pass.serves != pass.serves ||
      needs_declare(*pass.entry.technique, object.pass, pass)) {
    return nullptr;
  }
  const auto has_same_name = [](const auto& a, const auto& b) { return a.first == b.first; };
  if (!std::ranges::equal(object.shapes, pass.ports, has_same_name)) return nullptr;
  std::unique_ptr<PassState> state = std::move(object.state);
  state->index = index;
  state->is_adopted = true;
  return state;
}

/// In the order of dependencies. True if the pass was adopted and may stay: its outputs then have the shapes that they
/// had. Otherwise it has to be made anew.
bool Executor::State::keep_adopted(PassIndex index) {
  const Pass& pass = graph.passes[index];
  PassState& state = *passes[index];
  if (!state.is_prepared || (is_redeclaring && state.wants_redeclare)) return false;
  Legacy::Object& object = legacy.passes.at(pass.name);
  bool is_same = true;
  for (const auto& [port, resource] : pass.ports) {
    const Resource& old = object.shapes.at(port);
    const Resource& now = graph.resources[resource];
    const bool is_made = now.producer == index && !pass.inout_sources.contains(port);
    is_same = is_same && (is_made ? old.type == now.type && old.flags == now.flags && old.is_kept == now.is_kept
                                  : is_same_shape(old, now));
  }
  if (!is_same) return false;
  for (const auto& [port, resource] : pass.ports) {
    Resource& now = graph.resources[resource];
    if (now.producer != index || now.type == PortType::kValue) continue;
    copy_shape(now, object.shapes.at(port));
  }
  for (ReadBackRing& ring : object.rings) {
    ring.pass = index;
    rings.push_back(std::move(ring));
  }
  object.rings.clear();
  return true;
}

/// After declare: copies for stages with latency that have the shape of now.
void Executor::State::adopt_rings(PassIndex index) {
  const Pass& pass = graph.passes[index];
  Legacy::Object& object = legacy.passes.at(pass.name);
  for (ReadBackRing& ring : object.rings) {
    const auto bound = pass.ports.find(ring.port);
    if (bound == pass.ports.end() || !is_same_shape(object.shapes.at(ring.port), graph.resources[bound->second]))
      continue;
    ring.pass = index;
    rings.push_back(std::move(ring));
  }
  object.rings.clear();
}

/// What a port held that has another shape since its pass was declared again.
Legacy::Memory* Executor::State::outgrown(ResourceIndex index) {
  const Resource& resource = graph.resources[index];
  const PassIndex producer = maker_of(graph, resource);
  const bool is_redeclared = producer != kNoIndex && passes[producer] && passes[producer]->is_redeclared;
  if (!is_redeclared || !is_any_version_kept(index)) return nullptr;
  const auto found = legacy.memory.find(resource.name);
  if (found == legacy.memory.end() || found->second.shape.type != resource.type) return nullptr;
  const ResourceState& old = found->second.state;
  return old.image || old.buffer ? &found->second : nullptr;
}

/// The new memory is neutral: a buffer zeros, an image in TRANSFER_DST_OPTIMAL.
void Executor::State::migrate(ResourceIndex index, std::uint32_t list_count) {
  Legacy::Memory* old = outgrown(index);
  if (old == nullptr) return;
  const Resource& resource = graph.resources[index];
  const heddle_vulkan& vk = device->table();
  VkMemoryBarrier2 memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2};
  memory.srcStageMask = memory.dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
  memory.srcAccessMask = VK_ACCESS_2_MEMORY_WRITE_BIT;
  memory.dstAccessMask = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
  VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
  dependency.memoryBarrierCount = 1;
  dependency.pMemoryBarriers = &memory;
  vk.CmdPipelineBarrier2(commands, &dependency);
  if (resource.is_list() && resource.element_bytes == old->shape.element_bytes) {
    resources[index].appended = list_count;
    const std::array<std::uint32_t, kListHead / 4> head{list_count};
    vk.CmdUpdateBuffer(commands, resources[index].buffer.handle(), 0, sizeof head, head.data());
    const VkBufferCopy elements{kListHead, kListHead, std::uint64_t{list_count} * resource.element_bytes};
    if (elements.size > 0)
      vk.CmdCopyBuffer(commands, old->state.buffer.handle(), resources[index].buffer.handle(), 1, &elements);
    vk.CmdPipelineBarrier2(commands, &dependency);
  }
  const PassIndex producer = maker_of(graph, resource);
  PassState& pass = *passes[producer];
  const bool has_migrate =
      pass.descriptor->struct_size >= offsetof(heddle_technique, migrate) + sizeof pass.descriptor->migrate;
  if (!has_migrate || pass.descriptor->migrate == nullptr) return;
  if (old->state.image) {
    barrier_between_all(vk, commands, old->state.image, old->state.layout, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
    old->state.layout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
  }
  const heddle_shape before = shape_of(old->shape);
  const heddle_shape now = shape_of(resource);
  heddle_migration migration{};
  migration.struct_size = sizeof migration;
  migration.is_history = resource.history_of == kNoIndex ? 0 : 1;
  migration.port = resource.port.c_str();
  migration.old_shape = &before;
  migration.new_shape = &now;
  migration.commands = commands;
  migration.old_image = old->state.image.handle();
  migration.new_image = resources[index].image.handle();
  migration.old_buffer = old->state.buffer.handle();
  migration.new_buffer = resources[index].buffer.handle();
  throw_if_failed(pass, pass.descriptor->migrate(pass.object, &pass.api, &migration), "migrate");
}

/// Contents that outlast frames, where their maker is still the same object.
void Executor::State::adopt_memory(ResourceIndex index) {
  const Resource& resource = graph.resources[index];
  const PassIndex producer = maker_of(graph, resource);
  if (producer == kNoIndex || !passes[producer] || !passes[producer]->is_adopted) return;
  const auto found = legacy.memory.find(resource.name);
  if (found == legacy.memory.end() || !is_same_shape(found->second.shape, resource)) return;
  ResourceState& old = found->second.state;
  ResourceState& now = resources[index];
  if (resource.type == PortType::kValue) {
    now.value = std::move(old.value);
  } else if (resource.type == PortType::kSurfaces) {
    now.made = std::move(old.made);
    if (now.made) now.made->is_placed = false;
  } else {
    now.image = std::move(old.image);
    now.buffer = std::move(old.buffer);
    now.layout = old.layout;
    now.appended = old.appended;
  }
  now.is_adopted = true;
  legacy.memory.erase(found);
}

/// Passes that read, directly or not, of what another pass or object makes now. What they kept may be out of date, and
/// they cannot know it.
void Executor::State::find_outdated() {
  is_outdated.assign(graph.passes.size(), 0);
  std::vector<PassIndex> due;
  const auto mark = [&](PassIndex index) {
    if (is_outdated[index] != 0) return;
    is_outdated[index] = 1;
    due.push_back(index);
  };
  for (PassIndex i = 0; i < graph.passes.size(); ++i) {
    if (!passes[i]) continue;
    const auto old = legacy.passes.find(graph.passes[i].name);
    if (!passes[i]->is_adopted || passes[i]->is_redeclared || old == legacy.passes.end()) {
      mark(i);
      continue;
    }
    const Legacy::Object& object = old->second;
    const auto is_moved = [&](const auto& bound) {
      return object.shapes.at(bound.first).name != graph.resources[bound.second].name;
    };
    if (std::ranges::any_of(graph.passes[i].ports, is_moved) || object.pass.parameters != graph.passes[i].parameters ||
        object.providers != providers_of(graph, graph.passes[i])) {
      mark(i);
    }
  }
  while (!due.empty()) {
    const PassIndex changed = due.back();
    due.pop_back();
    for (PassIndex i = 0; i < graph.passes.size(); ++i) {
      const Pass& pass = graph.passes[i];
      const auto reads = [&](const std::vector<PassIndex>& of) { return std::ranges::find(of, changed) != of.end(); };
      if (passes[i] && (reads(pass.dependencies) || reads(pass.past_dependencies))) mark(i);
    }
  }
}

/// The shader of before, if its code, formats and constants are what they were, and so its pipelines.
ShaderState* Executor::State::former_pipelines(PassState& pass, const ShaderState& made) {
  const auto found = pass.shaders.find(made.shader->name);
  if (found == pass.shaders.end()) return nullptr;
  ShaderState& old = found->second;
  const bool is_same =
      old.pipeline && old.compiled.spirv == made.compiled.spirv && old.compiled.bindings == made.compiled.bindings &&
      old.compiled.push_bytes == made.compiled.push_bytes && old.values == made.values && old.raster == made.raster;
  return is_same ? &old : nullptr;
}

}  // namespace heddle::graph
