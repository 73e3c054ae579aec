// SPDX-License-Identifier: Apache-2.0
// Declared accesses -> uses of resources, functions of providers included (see uses.hpp).
#include "graph/uses.hpp"

#include <algorithm>

namespace heddle::graph {
namespace {

using Use = ScheduledStage::Use;

constexpr std::uint32_t bit(std::uint32_t access) {
  return 1U << access;
}

constexpr std::uint32_t kSampled =
    bit(HEDDLE_ACCESS_SAMPLED) | bit(HEDDLE_ACCESS_SAMPLED_LINEAR) | bit(HEDDLE_ACCESS_SAMPLED_COMPARE);

/// The one access that stands for several: its layout suits all of them.
std::uint32_t dominant(std::uint32_t mask, bool writes) {
  for (std::uint32_t access = 0; access < 32; ++access)
    if (mask == bit(access)) return access;
  if ((mask & ~kSampled) == 0) return HEDDLE_ACCESS_SAMPLED;
  if ((mask & ~(kSampled | bit(HEDDLE_ACCESS_DEPTH_READ))) == 0) return HEDDLE_ACCESS_DEPTH_READ;
  if ((mask & ~(bit(HEDDLE_ACCESS_DEPTH) | bit(HEDDLE_ACCESS_DEPTH_READ))) == 0) return HEDDLE_ACCESS_DEPTH;
  if ((mask & ~(bit(HEDDLE_ACCESS_TRANSFER_READ) | bit(HEDDLE_ACCESS_HOST_READ))) == 0)
    return HEDDLE_ACCESS_TRANSFER_READ;
  if ((mask & ~(bit(HEDDLE_ACCESS_TRANSFER_WRITE) | bit(HEDDLE_ACCESS_HOST_WRITE))) == 0)
    return HEDDLE_ACCESS_TRANSFER_WRITE;
  return writes ? HEDDLE_ACCESS_STORAGE_READ_WRITE : HEDDLE_ACCESS_STORAGE_READ;  // GENERAL
}

/// Values are written by the technique's cpu stages that touch the port, or else by the first gpu stage that does.
bool writes_value(const Pass& pass, std::uint32_t stage, std::string_view port) {
  const Technique& technique = *pass.entry.technique;
  const auto touches = [&](const Stage& s) {
    return is_scheduled(pass, s) &&
           std::ranges::any_of(s.accesses, [&](const Access& access) { return access.port == port; });
  };
  const bool has_cpu =
      std::ranges::any_of(technique.stages, [&](const Stage& s) { return s.kind == StageKind::kCpu && touches(s); });
  if (has_cpu) return technique.stages[stage].kind == StageKind::kCpu;
  const auto first = std::ranges::find_if(technique.stages, touches);
  return first - technique.stages.begin() == static_cast<std::ptrdiff_t>(stage);
}

Use make_use(ResourceIndex resource, std::uint32_t access, bool reads, bool writes) {
  return {resource, access, reads, writes, bit(access)};
}

void visit_providers(const ResolvedGraph& graph, PassIndex caller, std::span<const std::string> calls,
                     std::vector<std::pair<PassIndex, const Function*>>& found) {
  for (const std::string& role : calls) {
    const auto& bindings = graph.passes[caller].functions;
    const auto binding = std::ranges::find(bindings, role, &FunctionBinding::role);
    if (binding == bindings.end()) continue;
    for (const PassIndex provider : binding->providers) {
      const Function* function = graph.passes[provider].entry.technique->find_function(role);
      if (function == nullptr) continue;
      const std::pair entry(provider, function);
      if (std::ranges::find(found, entry) != found.end()) continue;
      found.push_back(entry);
      visit_providers(graph, provider, function->calls, found);
    }
  }
}

/// What the programs of surfaces read: in the vertex stage of whoever draws them; for a snapshot in a compute shader.
void add_program_uses(const ResolvedGraph& graph, ResourceIndex surfaces, std::uint32_t access,
                      std::vector<Use>& uses) {
  for (const ResourceIndex made : made_surfaces(graph, surfaces)) {
    const Function* program = program_of(graph, made);
    if (program == nullptr) continue;
    const Pass& maker = graph.passes[graph.resources[made].producer];
    for (const Access& read : program->accesses) {
      const auto bound = maker.ports.find(read.port);
      if (bound == maker.ports.end()) continue;
      const bool is_buffer = has_memory(graph.resources[bound->second].type);
      const std::uint32_t as = !is_buffer || access != HEDDLE_ACCESS_DRAW ? read.access : access;
      merge_use(uses, make_use(bound->second, as, true, false));
    }
  }
}

void add_calls(std::vector<std::string>& calls, const std::vector<std::string>& more) {
  for (const std::string& role : more)
    if (std::ranges::find(calls, role) == calls.end()) calls.push_back(role);
}

/// True for a port through which the pass sees nothing of this frame: only its stages with latency read it.
bool is_late_port(const Pass& pass, std::string_view name) {
  const Technique& technique = *pass.entry.technique;
  const Port* port = technique.find_port(name);
  bool is_late = false;
  for (const Stage& stage : technique.stages) {
    if (!is_scheduled(pass, stage)) continue;
    for (const Access& access : stage.accesses) {
      if (access.port != name) continue;
      if (!stage.is_late(access, port->type)) return false;
      is_late = true;
    }
  }
  for (const Function& function : technique.functions)
    if (std::ranges::find(function.accesses, name, &Access::port) != function.accesses.end()) return false;
  return is_late;
}

}  // namespace

void merge_use(std::vector<Use>& uses, const Use& use) {
  const auto found = std::ranges::find(uses, use.resource, &Use::resource);
  if (found == uses.end()) {
    uses.push_back(use);
    return;
  }
  found->reads = found->reads || use.reads;
  found->writes = found->writes || use.writes;
  found->mask |= use.mask;
  found->access = dominant(found->mask, found->writes);
}

std::vector<ResourceIndex> made_surfaces(const ResolvedGraph& graph, ResourceIndex surfaces) {
  std::vector<ResourceIndex> made;
  for (; surfaces != kNoIndex; surfaces = graph.resources[surfaces].previous_version)
    if (graph.resources[surfaces].producer != kNoIndex) made.push_back(surfaces);
  return made;
}

bool holds_scene(const ResolvedGraph& graph, ResourceIndex surfaces) {
  while (graph.resources[surfaces].previous_version != kNoIndex) surfaces = graph.resources[surfaces].previous_version;
  return graph.resources[surfaces].producer == kNoIndex;
}

BatchBuffers batch_buffers_of(const ResolvedGraph& graph, ResourceIndex made) {
  const Pass& pass = graph.passes[graph.resources[made].producer];
  const Port* port = pass.entry.technique->find_port(graph.resources[made].port);
  const auto bound = [&](const std::string& name) {
    const auto found = pass.ports.find(name);
    return name.empty() || found == pass.ports.end() ? kNoIndex : found->second;
  };
  if (port == nullptr) return {};
  return {bound(port->vertices), bound(port->indices), bound(port->instances), bound(port->commands)};
}

const Function* program_of(const ResolvedGraph& graph, ResourceIndex made) {
  const Technique& technique = *graph.passes[graph.resources[made].producer].entry.technique;
  const Port* port = technique.find_port(graph.resources[made].port);
  return port != nullptr && port->vertices.empty() ? technique.find_function(kProgramRole) : nullptr;
}

std::vector<ResourceIndex> batch_buffers(const ResolvedGraph& graph, ResourceIndex surfaces) {
  std::vector<ResourceIndex> found;
  for (const ResourceIndex made : made_surfaces(graph, surfaces)) {
    const BatchBuffers buffers = batch_buffers_of(graph, made);
    for (const ResourceIndex buffer : {buffers.vertices, buffers.indices, buffers.instances, buffers.commands})
      if (buffer != kNoIndex) found.push_back(buffer);
  }
  return found;
}

std::vector<Use> own_uses(const ResolvedGraph& graph, PassIndex index, std::uint32_t stage) {
  const Pass& pass = graph.passes[index];
  const Technique& technique = *pass.entry.technique;
  std::vector<Use> uses;
  for (const Access& access : technique.stages[stage].accesses) {
    const Port* port = technique.find_port(access.port);
    const auto bound = pass.ports.find(access.port);
    if (port == nullptr || bound == pass.ports.end()) continue;
    const ResourceIndex resource = bound->second;
    if (technique.stages[stage].is_late(access, port->type)) continue;
    if (has_memory(port->type)) {
      const AccessInfo info = access_info(access.access, port->type, graph.resources[resource].format);
      const bool is_attachment = access.access == HEDDLE_ACCESS_COLOR || access.access == HEDDLE_ACCESS_DEPTH;
      const bool keeps = access.load == HEDDLE_LOAD_KEEP ||
                         (access.load == HEDDLE_LOAD_CLEAR_NEW && pass.inout_sources.count(access.port) != 0);
      const bool reads = is_attachment ? keeps : info.reads;
      merge_use(uses, make_use(resource, access.access, reads, info.writes));
      continue;
    }
    const bool is_surfaces = port->type == PortType::kSurfaces;
    if (is_surfaces && access.access != HEDDLE_ACCESS_BATCHES) {
      // What was made is read out of its makers' buffers.
      for (const ResourceIndex buffer : batch_buffers(graph, resource))
        merge_use(uses, make_use(buffer, access.access, true, false));
      add_program_uses(graph, resource, access.access, uses);
    }
    if (port->direction == Direction::kIn) {
      merge_use(uses, make_use(resource, access.access, true, false));
      continue;
    }
    const bool writes = is_surfaces ? access.access == HEDDLE_ACCESS_BATCHES : writes_value(pass, stage, access.port);
    merge_use(uses,
              make_use(resource, access.access, !writes || technique.stages[stage].kind == StageKind::kGpu, writes));
    const auto source = pass.inout_sources.find(access.port);
    if (writes && source != pass.inout_sources.end())
      merge_use(uses, make_use(source->second, access.access, true, false));
  }
  return uses;
}

std::vector<Use> late_uses(const ResolvedGraph& graph, PassIndex index, std::uint32_t stage_index) {
  const Pass& pass = graph.passes[index];
  const Stage& stage = pass.entry.technique->stages[stage_index];
  std::vector<Use> uses;
  for (const Access& access : stage.accesses) {
    const auto bound = pass.ports.find(access.port);
    if (bound == pass.ports.end() || !stage.is_late(access, graph.resources[bound->second].type)) continue;
    merge_use(uses, make_use(bound->second, access.access, true, false));
  }
  return uses;
}

std::vector<Use> function_uses(const ResolvedGraph& graph, PassIndex caller, std::span<const std::string> calls) {
  std::vector<std::pair<PassIndex, const Function*>> providers;
  visit_providers(graph, caller, calls, providers);
  std::vector<Use> uses;
  for (const auto& [provider, function] : providers) {
    const Pass& pass = graph.passes[provider];
    for (const Access& access : function->accesses) {
      const auto bound = pass.ports.find(access.port);
      if (bound == pass.ports.end()) continue;
      const Resource& resource = graph.resources[bound->second];
      const AccessInfo info = access_info(access.access, resource.type, resource.format);
      merge_use(uses, make_use(bound->second, access.access, info.reads || !has_memory(resource.type), info.writes));
    }
  }
  return uses;
}

bool is_scheduled(const Pass& pass, const Stage& stage) {
  if (!stage.only_if) return true;
  const Technique& technique = *pass.entry.technique;
  const auto index =
      static_cast<std::size_t>(technique.find_parameter(stage.only_if->parameter) - technique.parameters.data());
  const auto chosen = static_cast<std::size_t>(pass.parameters[index].number[0]);
  return technique.parameters[index].choices.at(chosen) == stage.only_if->choice;
}

std::vector<std::string> stage_calls(const Pass& pass, std::uint32_t stage) {
  const Technique& technique = *pass.entry.technique;
  if (technique.stages[stage].kind == StageKind::kCpu) return all_calls(technique);
  std::vector<std::string> calls;
  for (const Shader& shader : technique.shaders)
    if (shader.stage == technique.stages[stage].name) add_calls(calls, shader.calls);
  return calls;
}

std::vector<std::string> all_calls(const Technique& technique) {
  std::vector<std::string> calls;
  for (const Shader& shader : technique.shaders) add_calls(calls, shader.calls);
  for (const Function& function : technique.functions) add_calls(calls, function.calls);
  return calls;
}

std::vector<PassIndex> reached_providers(const ResolvedGraph& graph, PassIndex caller,
                                         std::span<const std::string> calls) {
  std::vector<std::pair<PassIndex, const Function*>> found;
  visit_providers(graph, caller, calls, found);
  std::vector<PassIndex> providers;
  for (const auto& entry : found)
    if (std::ranges::find(providers, entry.first) == providers.end()) providers.push_back(entry.first);
  return providers;
}

std::vector<PassIndex> find_dependencies(const ResolvedGraph& graph, PassIndex index) {
  const Pass& pass = graph.passes[index];
  std::vector<PassIndex> found;
  const auto add = [&](PassIndex dependency) {
    if (dependency != kNoIndex && dependency != index) found.push_back(dependency);
  };
  for (const auto& [name, resource] : pass.ports)
    if (!is_late_port(pass, name)) add(graph.resources[resource].producer);
  for (const auto& [name, resource] : pass.inout_sources) add(graph.resources[resource].producer);
  const std::vector<std::string> calls = all_calls(*pass.entry.technique);
  for (const PassIndex provider : reached_providers(graph, index, calls)) add(provider);
  for (const Use& use : function_uses(graph, index, calls)) add(graph.resources[use.resource].producer);
  std::ranges::sort(found);
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

std::vector<PassIndex> find_past_dependencies(const ResolvedGraph& graph, PassIndex index) {
  std::vector<PassIndex> found;
  const Pass& pass = graph.passes[index];
  for (const auto& [name, resource] : pass.ports) {
    ResourceIndex newest = graph.resources[resource].history_of;
    if (newest == kNoIndex && is_late_port(pass, name)) newest = resource;
    if (newest != kNoIndex && graph.resources[newest].producer != kNoIndex)
      found.push_back(graph.resources[newest].producer);
  }
  std::ranges::sort(found);
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

PassIndex maker_of(const ResolvedGraph& graph, const Resource& resource) {
  return resource.history_of == kNoIndex ? resource.producer : graph.resources[resource.history_of].producer;
}

bool is_kept(const ResolvedGraph& graph, ResourceIndex resource) {
  return graph.resources[resource].is_kept || graph.resources[first_version(graph, resource)].is_kept;
}

std::vector<HistoryPair> history_pairs(const ResolvedGraph& graph, const Order& order) {
  std::vector<bool> is_used(graph.resources.size(), false);
  for (const ScheduledStage& stage : order.stages)
    for (const Use& use : stage.uses) is_used[first_version(graph, use.resource)] = true;
  std::vector<HistoryPair> pairs;
  for (ResourceIndex r = 0; r < graph.resources.size(); ++r) {
    const Resource& resource = graph.resources[r];
    if (resource.history_of == kNoIndex || !has_memory(resource.type) || !is_used[r]) continue;
    const ResourceIndex newest = first_version(graph, resource.history_of);
    if (is_used[newest]) pairs.push_back({newest, r});
  }
  return pairs;
}

ResourceIndex first_version(const ResolvedGraph& graph, ResourceIndex resource) {
  if (!has_memory(graph.resources[resource].type)) return resource;
  while (graph.resources[resource].previous_version != kNoIndex) resource = graph.resources[resource].previous_version;
  return resource;
}

std::string_view access_name(std::uint32_t access) {
  constexpr std::array<std::string_view, 17> kNames{"sampled",
                                                    "sampled linear",
                                                    "storage read",
                                                    "storage write",
                                                    "storage read and write",
                                                    "colour attachment",
                                                    "depth attachment",
                                                    "depth test",
                                                    "value",
                                                    "draw",
                                                    "host read",
                                                    "host write",
                                                    "transfer read",
                                                    "transfer write",
                                                    "sampled compare",
                                                    "append",
                                                    "batches"};
  return access < kNames.size() ? kNames[access] : "unknown";
}

}  // namespace heddle::graph
