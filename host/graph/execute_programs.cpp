// SPDX-License-Identifier: Apache-2.0
// Surface programs of techniques: vertex stages that ask a technique's functions where its vertices are, with the
// fragment stages of everybody who draws its surfaces; and the same functions into memory, for snapshots.

#include "graph/execute_state.hpp"
#include "graph/uses.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace heddle::graph {

/// Those of the surfaces that a shader's stage draws.
std::vector<ProgramState*> Executor::State::programs_behind(const Pass& pass, const ShaderState& shader) {
  std::vector<ProgramState*> found;
  if (shader.shader->kind != ShaderKind::kSurfaces) return found;
  for (const Access& access : pass.entry.technique->stages[shader.stage].accesses) {
    const auto bound = pass.ports.find(access.port);
    if (access.access != HEDDLE_ACCESS_DRAW || bound == pass.ports.end()) continue;
    for (const ResourceIndex made : made_surfaces(graph, bound->second)) {
      const auto own = programs.find(graph.passes[graph.resources[made].producer].name);
      if (own == programs.end() || program_of(graph, made) == nullptr) continue;
      if (std::ranges::find(found, &own->second) == found.end()) found.push_back(&own->second);
    }
  }
  return found;
}

const ProgramState* Executor::State::program_behind(ResourceIndex made) const {
  if (program_of(graph, made) == nullptr) return nullptr;
  return &programs.at(graph.passes[graph.resources[made].producer].name);
}

/// Those that this plan needs. `is_restoring`: as they were; no file is read.
Executor::State::Programs Executor::State::compile_programs(bool is_restoring) const {
  Programs made;
  const Role* role = services.registry.find_role(kProgramRole);
  const auto folders = services.registry.shared_folders();
  for (ResourceIndex r = 0; r < graph.resources.size(); ++r) {
    const Resource& resource = graph.resources[r];
    if (resource.type != PortType::kSurfaces || resource.producer == kNoIndex) continue;
    const Pass& pass = graph.passes[resource.producer];
    const Function* function = pass.is_pruned ? nullptr : program_of(graph, r);
    if (function == nullptr || made.contains(pass.name)) continue;
    ProgramState own;
    own.pass = resource.producer;
    const auto old = programs.find(pass.name);
    if (is_restoring && old != programs.end()) {
      own.compiled = old->second.compiled;
    } else {
      own.compiled = vulkan::compile_program(*role, provider_request(pass, *function), services.cache_folder,
                                             {folders.begin(), folders.end()});
      for (const std::string& warning : own.compiled.warnings) services.log(Severity::kWarning, warning);
    }
    own.owners = owners_of(own.compiled);
    own.program = {own.compiled.spirv, program.masked_fragment, constants(own.compiled)};
    made.emplace(pass.name, std::move(own));
  }
  // Set 3 as that of meshes, without their vertices.
  for (auto& [name, own] : made) {
    std::vector<VkDescriptorSetLayoutBinding> slots;
    for (std::uint32_t i = 1; i < vulkan::kFirstOfProgram; ++i) {
      slots.push_back({i, i == 3 ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1,
                       VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT, nullptr});
    }
    for (const vulkan::Binding& binding : own.compiled.bindings)
      slots.push_back({binding.binding, vulkan::descriptor_type(binding), 1, VK_SHADER_STAGE_VERTEX_BIT, nullptr});
    own.layout = device->pipelines().set_layout(slots);
  }
  return made;
}

/// The same shader of the last plan with the same program, whose pipelines go on.
ShaderState::Behind* Executor::State::former_behind(ShaderState* former, const ProgramState& own,
                                                    const std::string& pass) {
  if (former == nullptr) return nullptr;
  const auto old = former->behind.find(pass);
  if (old == former->behind.end() || !old->second.pipeline) return nullptr;
  return old->second.program == own.program && old->second.bindings == own.compiled.bindings ? &old->second : nullptr;
}

void Executor::State::make_pipelines_behind(const Pass& pass, ShaderState& shader, ShaderState* former) {
  for (const ProgramState* own : programs_behind(pass, shader)) {
    const std::string& name = graph.passes[own->pass].name;
    if (former_behind(former, *own, name) != nullptr) continue;
    ShaderState::Behind made;
    made.program = own->program;
    made.bindings = own->compiled.bindings;
    made.pipeline =
        maker->surfaces(own->program, shader.compiled, shader.values, shader.raster, materials_layout, own->layout);
    if (shader.shader->file.empty())
      made.masked = maker->surfaces_masked_depth(own->program, shader.raster, materials_layout, own->layout);
    count_pipeline(made.pipeline);
    shader.behind.emplace(name, std::move(made));
  }
}

void Executor::State::keep_pipelines_behind(const Pass& pass, ShaderState& shader, ShaderState* former) {
  for (const ProgramState* own : programs_behind(pass, shader)) {
    const std::string& name = graph.passes[own->pass].name;
    ShaderState::Behind* old = former_behind(former, *own, name);
    if (old == nullptr) continue;
    shader.behind.emplace(name, std::move(*old));
    ++stats.plan.pipelines_kept;
  }
}

/// Records what writes the vertices of a version whose program says where they are. False: they lie in a buffer.
bool Executor::State::evaluate_vertices(ResourceIndex made, vulkan::Buffer& vertices) {
  const Function* function = program_of(graph, made);
  if (function == nullptr) return false;
  std::uint64_t count = 0;
  for (const scene::MadeBatch& batch : resources[made].made->surfaces.batches)
    count = std::max(count, static_cast<std::uint64_t>(std::max<std::int64_t>(batch.record.vertex_offset, 0)) +
                                batch.record.vertex_count);
  if (count == 0) return true;
  const Pass& pass = graph.passes[graph.resources[made].producer];
  ProgramState& own = programs.at(pass.name);
  if (!own.evaluation.pipeline) {
    const auto folders = services.registry.shared_folders();
    own.evaluation.compiled = vulkan::compile_program_evaluation(
        *services.registry.find_role(kProgramRole), provider_request(pass, *function), services.cache_folder,
        {folders.begin(), folders.end()});
    own.evaluation.owners = owners_of(own.evaluation.compiled);
    own.evaluation.pipeline = maker->compute(own.evaluation.compiled, constants(own.evaluation.compiled));
  }
  const std::uint64_t bytes = count * sizeof(HeddleVertex);
  if (bytes > device->limits().maxStorageBufferRange) {
    throw Error(HEDDLE_UNSUPPORTED,
                fmt::format("a snapshot of the surfaces of pass '{}' has {} vertices, {} bytes, and shaders of this "
                            "device reach {} at once",
                            pass.name, count, bytes, device->limits().maxStorageBufferRange));
  }
  vertices = device->make_buffer(bytes, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, true);
  const heddle_vulkan& vk = device->table();
  const vulkan::Pipeline& pipeline = own.evaluation.pipeline;
  vk.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline.handle());
  for (std::uint32_t set = 0; set < 2; ++set) {
    const bool is_used = std::ranges::any_of(own.evaluation.compiled.bindings,
                                             [&](const vulkan::Binding& binding) { return binding.set == set; });
    if (!is_used) continue;
    const VkDescriptorSet allocated = allocate_set(pipeline.set_layout(set));
    if (set == 0) {
      const VkDescriptorBufferInfo target{vertices.handle(), 0, VK_WHOLE_SIZE};
      VkWriteDescriptorSet write{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET};
      write.dstSet = allocated;
      write.descriptorCount = 1;
      write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
      write.pBufferInfo = &target;
      vk.UpdateDescriptorSets(vk.device, 1, &write, 0, nullptr);
    } else {
      fill_set(allocated, pass, own.evaluation.compiled.bindings, own.evaluation.owners, set);
    }
    vk.CmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline.layout(), set, 1, &allocated, 0,
                             nullptr);
  }
  const auto pushed = static_cast<std::uint32_t>(count);
  vk.CmdPushConstants(commands, pipeline.layout(), VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof pushed, &pushed);
  const std::uint32_t size = own.evaluation.compiled.local_size[0];
  vk.CmdDispatch(commands, (pushed + size - 1) / size, 1, 1);
  VkMemoryBarrier2 memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2};
  memory.srcStageMask = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT;
  memory.srcAccessMask = VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT;
  memory.dstStageMask = VK_PIPELINE_STAGE_2_HOST_BIT;
  memory.dstAccessMask = VK_ACCESS_2_HOST_READ_BIT;
  VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
  dependency.memoryBarrierCount = 1;
  dependency.pMemoryBarriers = &memory;
  vk.CmdPipelineBarrier2(commands, &dependency);
  return true;
}

}  // namespace heddle::graph
