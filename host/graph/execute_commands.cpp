// SPDX-License-Identifier: Apache-2.0
// The C functions behind heddle_pass_host: parameters, values, mapped memory, and the commands of a gpu stage.

#include "graph/execute_calls.hpp"
#include "graph/report.hpp"
#include "graph/uses.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>

namespace heddle::graph {

namespace {

/// Of long stages. Most are done before they are told of at all.
constexpr std::chrono::seconds kTellEvery{2};

bool is_cached_by(const PassState& pass, std::string_view parameter) {
  return pass.cached_stage != nullptr &&
         std::ranges::find(*pass.cached_stage->cached_by, parameter) != pass.cached_stage->cached_by->end();
}

bool is_of_cached_stage(const PassState& pass, std::string_view port) {
  return pass.cached_stage != nullptr &&
         std::ranges::find(pass.cached_stage->accesses, port, &Access::port) != pass.cached_stage->accesses.end();
}

void report(const heddle_pass_host* self, std::uint32_t severity, const char* text) {
  say(state_of(self), static_cast<Severity>(std::min(severity, HEDDLE_SEVERITY_INFO)), text);
}

std::uint32_t parameter(const heddle_pass_host* self, const char* name, double out[3]) {
  const PassState& pass = state_of(self);
  const Executor::State& executor = executor_of(pass);
  const Technique& technique = executor.technique_of(pass);
  if (!is_in_key(pass, is_cached_by(pass, name), fmt::format("parameter '{}'", name))) return 0;
  for (std::size_t i = 0; i < technique.parameters.size(); ++i) {
    if (technique.parameters[i].name != name) continue;
    const std::uint32_t components = technique.parameters[i].components();
    std::copy_n(executor.pass_of(pass).parameters[i].number.begin(), components, out);
    return components;
  }
  return 0;
}

void fill_shape(const Executor::State& executor, const Pass& pass, const std::string& port, heddle_shape& out) {
  out.struct_size = sizeof out;
  const auto found = pass.ports.find(port);
  if (found == pass.ports.end()) return;
  const Resource& resource = executor.graph.resources[found->second];
  const bool is_inout = pass.entry.technique->find_port(port)->direction == Direction::kInout;
  out = shape_of(resource);
  out.is_bound = !is_inout || resource.previous_version != kNoIndex ? 1U : 0U;
}

heddle_status shape(const heddle_pass_host* self, const char* port, heddle_shape* out) {
  PassState& pass = state_of(self);
  Executor::State& executor = executor_of(pass);
  if (executor.technique_of(pass).find_port(port) == nullptr) {
    return wrong(pass, fmt::format("asks for the shape of an unknown port '{}'", port));
  }
  if (!is_in_key(pass, is_of_cached_stage(pass, port), fmt::format("the shape of port '{}'", port))) return HEDDLE_BUG;
  heddle_shape filled{};
  fill_shape(executor, executor.pass_of(pass), port, filled);
  const std::uint32_t size = std::min(out->struct_size, filled.struct_size);
  filled.struct_size = size;
  std::memcpy(out, &filled, size);
  return HEDDLE_OK;
}

heddle_status set_shape(const heddle_pass_host* self, const char* port, const heddle_shape* wanted) {
  PassState& pass = state_of(self);
  Executor::State& executor = executor_of(pass);
  if (!pass.is_declaring) return wrong(pass, "calls set_shape outside of declare");
  const Port* declared = executor.technique_of(pass).find_port(port);
  if (declared == nullptr || declared->direction != Direction::kOut) {
    return wrong(pass, fmt::format("calls set_shape for '{}', which is none of its out ports", port));
  }
  Resource& resource = executor.graph.resources[executor.pass_of(pass).ports.at(port)];
  if (wanted->format != 0) resource.format = wanted->format;
  if (wanted->width != 0) resource.width = wanted->width;
  if (wanted->height != 0) resource.height = wanted->height;
  if (wanted->layers != 0) resource.layers = wanted->layers;
  if (wanted->mips != 0) resource.mips = wanted->mips;
  if (wanted->byte_size != 0 && !declared->is_list()) resource.byte_size = wanted->byte_size;
  return HEDDLE_OK;
}

heddle_status set_capacity(const heddle_pass_host* self, const char* port, std::uint32_t capacity) {
  PassState& pass = state_of(self);
  Executor::State& executor = executor_of(pass);
  if (!pass.is_declaring) return wrong(pass, "calls set_capacity outside of declare");
  const Port* declared = executor.technique_of(pass).find_port(port);
  const Pass& declaring = executor.pass_of(pass);
  const bool is_made = declared != nullptr && declared->is_list() && declared->direction != Direction::kIn &&
                       !declaring.inout_sources.contains(port);
  if (!is_made) return wrong(pass, fmt::format("calls set_capacity for '{}', which is no list that it makes", port));
  Resource& list = executor.graph.resources[declaring.ports.at(port)];
  list.capacity = capacity;
  list.byte_size = list_bytes(capacity, list.element_bytes);
  return HEDDLE_OK;
}

void request_redeclare(const heddle_pass_host* self) {
  PassState& pass = state_of(self);
  // A stage that is not called where its artifact is there already leaves nothing else behind.
  if (is_in_key(pass, false, "another shape of its outputs")) pass.wants_redeclare = true;
}

const void* function_service(const heddle_pass_host* self, const char* role) {
  const PassState& pass = state_of(self);
  if (!is_in_key(pass, false, fmt::format("the service of role '{}'", role))) return nullptr;
  const Executor::State& executor = executor_of(pass);
  for (const FunctionBinding& binding : executor.pass_of(pass).functions) {
    if (binding.role != role || binding.providers.empty()) continue;
    const PassState* provider = executor.passes[binding.providers.front()].get();
    if (provider == nullptr) return nullptr;
    for (std::uint32_t i = 0; i < provider->descriptor->function_count; ++i) {
      const heddle_function& function = provider->descriptor->functions[i];
      if (std::strcmp(function.role, role) == 0) return function.service;
    }
  }
  return nullptr;
}

const void* value(const heddle_pass_host* self, heddle_frame*, const char* port, std::uint64_t* out_bytes) {
  const PassState& pass = state_of(self);
  Executor::State& executor = executor_of(pass);
  const Pass& declared = executor.pass_of(pass);
  *out_bytes = 0;
  if (!is_in_key(pass, is_of_cached_stage(pass, port), fmt::format("value '{}'", port))) return nullptr;
  // An inout value is read as it was before this pass, until the pass has set its own.
  ResourceIndex resource = kNoIndex;
  if (const auto made = declared.ports.find(port); made != declared.ports.end()) resource = made->second;
  if (const auto source = declared.inout_sources.find(port); source != declared.inout_sources.end()) {
    resource = source->second;
  }
  if (resource == kNoIndex) return nullptr;
  const Value& stored = executor.resources[resource].value;
  *out_bytes = stored.bytes.size();
  return stored.bytes.data();
}

heddle_status set_value(const heddle_pass_host* self, heddle_frame*, const char* port, const void* data,
                        std::uint64_t bytes) {
  PassState& pass = state_of(self);
  return guarded(pass, [&] {
    Executor::State& executor = executor_of(pass);
    const Pass& declared = executor.pass_of(pass);
    const Port* own = executor.technique_of(pass).find_port(port);
    if (own == nullptr || own->direction == Direction::kIn ||
        (own->type != PortType::kValue && own->type != PortType::kArtifact)) {
      return wrong(pass, fmt::format("sets '{}', which is none of its out values and artifacts", port));
    }
    if (!is_in_key(pass, is_of_cached_stage(pass, port), fmt::format("value '{}'", port))) return HEDDLE_BUG;
    executor.set_value(declared.ports.at(port), {static_cast<const std::byte*>(data), bytes});
    return HEDDLE_OK;
  });
}

heddle_status map(const heddle_pass_host* self, heddle_frame* frame, const char* port, heddle_mapped* out) {
  PassState& pass = state_of(self);
  Executor::State& executor = executor_of(pass);
  for (const heddle_frame::Mapping& mapping : frame->mappings) {
    if (mapping.port != port) continue;
    heddle_mapped filled{};
    filled.struct_size = std::min<std::uint32_t>(out->struct_size, sizeof filled);
    std::byte* data = mapping.late != nullptr ? mapping.late : mapping.staging.data();
    const Pass& declared = executor.pass_of(pass);
    if (const Resource& resource = executor.graph.resources[declared.ports.find(port)->second]; resource.is_list()) {
      std::uint32_t appended = 0;
      std::memcpy(&appended, data, sizeof appended);
      filled.count = std::min(appended, resource.capacity);
      filled.overflow = appended - filled.count;
      data += kListHead;
    }
    filled.data = data;
    filled.frame = mapping.frame;
    fill_shape(executor, executor.pass_of(pass), port, filled.shape);
    // Of a compressed image: of a row of blocks.
    filled.row_bytes = vulkan::image_bytes(static_cast<VkFormat>(filled.shape.format), filled.shape.width, 1);
    std::memcpy(out, &filled, filled.struct_size);
    return HEDDLE_OK;
  }
  return wrong(pass, fmt::format("maps '{}', which its stage does not declare as HOST_READ or HOST_WRITE, or which is "
                                 "not bound",
                                 port));
}

heddle_status snapshot(const heddle_pass_host* self, heddle_frame* frame, const char* port, const heddle_snapshot** out,
                       heddle_alpha_test* out_alpha_test) {
  PassState& pass = state_of(self);
  return guarded(pass, [&] {
    Executor::State& executor = executor_of(pass);
    const Stage& stage = executor.technique_of(pass).stages[frame->stage->stage];
    const bool declared = std::any_of(stage.accesses.begin(), stage.accesses.end(), [&](const Access& access) {
      return access.port == port && access.access == HEDDLE_ACCESS_HOST_READ;
    });
    if (!declared || executor.pass_of(pass).ports.count(port) == 0) {
      return wrong(pass,
                   fmt::format("asks for a snapshot of '{}', which its stage does not declare as HOST_READ, or which "
                               "is not bound",
                               port));
    }
    const scene::Snapshot& snapshot = executor.take_snapshot(executor.pass_of(pass).ports.find(port)->second, *frame);
    *out = &snapshot.record();
    if (out_alpha_test != nullptr) *out_alpha_test = snapshot.alpha_test();
    return HEDDLE_OK;
  });
}

heddle_status dispatch(const heddle_pass_host* self, heddle_frame* frame, const char* name, std::uint32_t x,
                       std::uint32_t y, std::uint32_t z, const void* push, std::uint32_t push_bytes) {
  PassState& pass = state_of(self);
  return guarded(pass, [&]() -> heddle_status {
    ShaderState* shader = find_shader(pass, frame, name, ShaderKind::kCompute);
    if (shader == nullptr) return HEDDLE_BUG;
    Executor::State& executor = executor_of(pass);
    executor.bind(pass, *shader, shader->pipeline, push, push_bytes);
    executor.device->table().CmdDispatch(frame->commands, x, y, z);
    return HEDDLE_OK;
  });
}

heddle_status dispatch_over(const heddle_pass_host* self, heddle_frame* frame, const char* name, const char* port,
                            const void* push, std::uint32_t push_bytes) {
  PassState& pass = state_of(self);
  ShaderState* shader = find_shader(pass, frame, name, ShaderKind::kCompute);
  if (shader == nullptr) return HEDDLE_BUG;
  heddle_shape covered{};
  covered.struct_size = sizeof covered;
  if (const heddle_status status = shape(self, port, &covered); status != HEDDLE_OK) return status;
  const auto groups = [](std::uint32_t size, std::uint32_t local) { return (size + local - 1) / local; };
  const auto& local = shader->compiled.local_size;
  return dispatch(self, frame, name, groups(covered.width, local[0]), groups(covered.height, local[1]),
                  groups(covered.layers, local[2]), push, push_bytes);
}

heddle_status dispatch_over_list(const heddle_pass_host* self, heddle_frame* frame, const char* name, const char* port,
                                 const void* push, std::uint32_t push_bytes) {
  PassState& pass = state_of(self);
  return guarded(pass, [&]() -> heddle_status {
    const ShaderState* shader = find_shader(pass, frame, name, ShaderKind::kCompute);
    if (shader == nullptr) return HEDDLE_BUG;
    Executor::State& executor = executor_of(pass);
    const Technique& technique = executor.technique_of(pass);
    const Port* list = technique.find_port(port);
    const Stage& stage = technique.stages[frame->stage->stage];
    const bool is_read = std::any_of(stage.accesses.begin(), stage.accesses.end(), [&](const Access& access) {
      return access.port == port &&
             (access.access == HEDDLE_ACCESS_STORAGE_READ || access.access == HEDDLE_ACCESS_STORAGE_READ_WRITE);
    });
    if (list == nullptr || !list->is_list() || !is_read) {
      return wrong(pass, fmt::format("dispatches over '{}', which is no list that stage '{}' declares as STORAGE_READ "
                                     "or STORAGE_READ_WRITE",
                                     port, stage.name));
    }
    const Pass& declared = executor.pass_of(pass);
    const auto bound = declared.ports.find(std::string_view(port));
    if (bound != declared.ports.end()) executor.dispatch_over_list(pass, *shader, bound->second, push, push_bytes);
    return HEDDLE_OK;
  });
}

heddle_status fullscreen(const heddle_pass_host* self, heddle_frame* frame, const char* name, std::uint32_t layer,
                         const void* push, std::uint32_t push_bytes) {
  PassState& pass = state_of(self);
  return guarded(pass, [&]() -> heddle_status {
    ShaderState* shader = find_shader(pass, frame, name, ShaderKind::kFullscreen);
    if (shader == nullptr) return HEDDLE_BUG;
    Executor::State& executor = executor_of(pass);
    const heddle_vulkan& vk = executor.device->table();
    const VkExtent2D extent =
        executor.attachment_extent(executor.pass_of(pass), executor.technique_of(pass).stages[frame->stage->stage]);
    executor.begin_rendering(pass, *frame, layer);
    set_viewport(vk, frame->commands, 0, 0, extent.width, extent.height);
    executor.bind(pass, *shader, shader->pipeline, push, push_bytes);
    vk.CmdDraw(frame->commands, 3, 1, 0, 0);
    vk.CmdEndRendering(frame->commands);
    return HEDDLE_OK;
  });
}

bool blends_by_constant(const Stage& stage) {
  return std::ranges::find(stage.accesses, HEDDLE_BLEND_CONSTANT, &Access::blend) != stage.accesses.end();
}

heddle_status set_blend_constant(const heddle_pass_host* self, heddle_frame* frame, const float constant[4]) {
  const PassState& pass = state_of(self);
  const Stage& stage = executor_of(pass).technique_of(pass).stages[frame->stage->stage];
  if (!blends_by_constant(stage))
    return wrong(pass, fmt::format("sets a blend constant in stage '{}', which has no attachment of "
                                   "HEDDLE_BLEND_CONSTANT",
                                   stage.name));
  for (std::size_t i = 0; i < frame->blend_constant.size(); ++i) {
    if (!(constant[i] >= 0 && constant[i] <= 1))
      return wrong(pass, fmt::format("sets the blend constant {}: expected 0 to 1", constant[i]));
    frame->blend_constant[i] = constant[i];
  }
  return HEDDLE_OK;
}

/// The batch as the host keeps it. Throws if it does not lie in the port's buffers or the scene.
scene::MadeBatch check_batch(const Executor::State& executor, ResourceIndex surfaces, const heddle_batch& given,
                             std::uint32_t number) {
  scene::MadeBatch batch;
  std::memcpy(&batch.record, &given, std::min<std::size_t>(given.struct_size, sizeof batch.record));
  heddle_batch& record = batch.record;
  record.struct_size = sizeof record;
  if (record.placed > 0) batch.placed.assign(record.instances, record.instances + record.placed);
  record.instances = nullptr;
  const auto complain = [&](const std::string& what) {
    throw Error(HEDDLE_BUG, fmt::format("batch {} of '{}' {}", number, executor.graph.resources[surfaces].name, what));
  };
  const BatchBuffers buffers = batch_buffers_of(executor.graph, surfaces);
  const auto room = [&](ResourceIndex buffer, std::uint64_t element) -> std::uint64_t {
    if (buffer == kNoIndex) return 0;
    const Resource& resource = executor.graph.resources[buffer];
    return resource.is_list() ? resource.capacity : resource.byte_size / element;
  };
  if (record.material >= executor.scene->materials.size()) {
    complain(fmt::format("has material {} of a scene with {}", record.material, executor.scene->materials.size()));
  }
  if (batch.placed.empty()) {
    const std::uint64_t most = room(buffers.commands, sizeof(VkDrawIndexedIndirectCommand));
    const bool is_list = buffers.commands != kNoIndex && executor.graph.resources[buffers.commands].is_list();
    if (std::uint64_t{record.first_command} + record.command_count > most || (is_list && record.first_command != 0)) {
      complain(fmt::format("has commands {} to {} of {}{}", record.first_command,
                           std::uint64_t{record.first_command} + record.command_count, most,
                           is_list ? ", of a list: expected the first one to be 0" : ""));
    }
    return batch;
  }
  const std::uint64_t most = room(buffers.indices, sizeof(std::uint32_t));
  if (std::uint64_t{record.first_index} + record.index_count > most || record.index_count % 3 != 0) {
    complain(fmt::format("has indices {} to {} of {}: expected triangles within them", record.first_index,
                         std::uint64_t{record.first_index} + record.index_count, most));
  }
  for (const float bound : record.bounds)
    if (!std::isfinite(bound)) complain(fmt::format("has the bound {}", bound));
  std::sort(batch.placed.begin(), batch.placed.end());
  if (batch.placed.back() >= executor.scene->instances.size() ||
      std::adjacent_find(batch.placed.begin(), batch.placed.end()) != batch.placed.end()) {
    complain(fmt::format("places an instance twice, or one beyond the scene's {}", executor.scene->instances.size()));
  }
  return batch;
}

heddle_status set_batches(const heddle_pass_host* self, heddle_frame* frame, const char* port,
                          const heddle_batch* given, std::uint32_t count, std::uint64_t revision) {
  PassState& pass = state_of(self);
  return guarded(pass, [&]() -> heddle_status {
    Executor::State& executor = executor_of(pass);
    const Stage& stage = executor.technique_of(pass).stages[frame->stage->stage];
    const bool is_declared = std::any_of(stage.accesses.begin(), stage.accesses.end(), [&](const Access& access) {
      return access.port == port && access.access == HEDDLE_ACCESS_BATCHES;
    });
    if (!is_declared) {
      return wrong(pass, fmt::format("sets batches of '{}', which its stage does not declare as BATCHES", port));
    }
    const ResourceIndex surfaces = executor.pass_of(pass).ports.find(std::string_view(port))->second;
    std::vector<scene::MadeBatch> batches;
    std::vector<std::uint8_t> is_placed(executor.scene->instances.size(), 0);
    const auto* bytes = reinterpret_cast<const std::byte*>(given);
    for (std::uint32_t i = 0; i < count; ++i) {
      const auto& batch = *reinterpret_cast<const heddle_batch*>(bytes + std::size_t{i} * given->struct_size);
      batches.push_back(check_batch(executor, surfaces, batch, i));
      for (const std::uint32_t instance : batches.back().placed) {
        if (is_placed[instance]++ == 0) continue;
        return wrong(pass, fmt::format("places instance {} in two batches of '{}'", instance, port));
      }
    }
    executor.set_batches(surfaces, std::move(batches), revision);
    return HEDDLE_OK;
  });
}

void barrier(const heddle_pass_host* self, heddle_frame* frame) {
  const Executor::State& executor = executor_of(state_of(self));
  VkMemoryBarrier2 memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2};
  memory.srcStageMask = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT |
                        VK_PIPELINE_STAGE_2_ALL_GRAPHICS_BIT;
  memory.srcAccessMask = VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT | VK_ACCESS_2_TRANSFER_WRITE_BIT;
  memory.dstStageMask = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT |
                        VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT | VK_PIPELINE_STAGE_2_ALL_GRAPHICS_BIT;
  memory.dstAccessMask =
      VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT | VK_ACCESS_2_TRANSFER_WRITE_BIT;
  VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
  dependency.memoryBarrierCount = 1;
  dependency.pMemoryBarriers = &memory;
  executor.device->table().CmdPipelineBarrier2(frame->commands, &dependency);
}

heddle_status update_buffer(const heddle_pass_host* self, heddle_frame* frame, const char* port, std::uint64_t offset,
                            const void* data, std::uint64_t bytes) {
  PassState& pass = state_of(self);
  return guarded(pass, [&]() -> heddle_status {
    Executor::State& executor = executor_of(pass);
    const Pass& declared = executor.pass_of(pass);
    const auto found = declared.ports.find(std::string_view(port));
    const vulkan::Buffer* buffer = found == declared.ports.end() ? nullptr : &executor.root(found->second).buffer;
    if (buffer == nullptr || !*buffer || offset % 4 != 0 || bytes % 4 != 0 || bytes > 65536 ||
        offset + bytes > buffer->size()) {
      return wrong(pass,
                   fmt::format("updates bytes {} to {} of '{}': the port must be a bound buffer that holds them, in "
                               "multiples of 4 bytes, at most 65536",
                               offset, offset + bytes, port));
    }
    // The graph's barriers cover what the stage declares, not this transfer in between.
    barrier(self, frame);
    executor.device->table().CmdUpdateBuffer(frame->commands, buffer->handle(), offset, bytes, data);
    barrier(self, frame);
    executor.device->count_upload(bytes);
    return HEDDLE_OK;
  });
}

VkCommandBuffer command_buffer(const heddle_pass_host* self, heddle_frame* frame) {
  ++executor_of(state_of(self)).writes_recorded;
  return frame->commands;
}

ResourceState* bound_state(const heddle_pass_host* self, const char* port) {
  const PassState& pass = state_of(self);
  Executor::State& executor = executor_of(pass);
  const Pass& declared = executor.pass_of(pass);
  const auto found = declared.ports.find(std::string_view(port));
  return found == declared.ports.end() ? nullptr : &executor.root(found->second);
}
VkImage image(const heddle_pass_host* self, heddle_frame*, const char* port) {
  const ResourceState* state = bound_state(self, port);
  return state == nullptr ? VK_NULL_HANDLE : state->image.handle();
}
VkImageView image_view(const heddle_pass_host* self, heddle_frame*, const char* port) {
  const ResourceState* state = bound_state(self, port);
  return state == nullptr ? VK_NULL_HANDLE : state->image.view();
}
VkBuffer buffer_handle(const heddle_pass_host* self, heddle_frame*, const char* port) {
  const ResourceState* state = bound_state(self, port);
  return state == nullptr ? VK_NULL_HANDLE : state->buffer.handle();
}

std::uint32_t text(const heddle_pass_host* self, const char* name, std::uint32_t index, const char** out) {
  const PassState& pass = state_of(self);
  const Executor::State& executor = executor_of(pass);
  const Technique& technique = executor.technique_of(pass);
  for (std::size_t i = 0; i < technique.parameters.size(); ++i) {
    const Parameter& parameter = technique.parameters[i];
    if (parameter.name != name) continue;
    const std::vector<std::string>& strings = executor.pass_of(pass).parameters[i].names;
    const bool is_empty_text = parameter.type == ParameterType::kText && strings.empty();
    if (index < strings.size()) *out = strings[index].c_str();
    if (index == 0 && is_empty_text) *out = "";
    return is_empty_text ? 1U : static_cast<std::uint32_t>(strings.size());
  }
  return 0;
}

const char* resolve_path(const heddle_pass_host* self, const char* path) {
  PassState& pass = state_of(self);
  if (!is_in_key(pass, false, fmt::format("the file '{}'", path))) return "";
  const Executor::State& executor = executor_of(pass);
  if (executor.graph.is_job && !executor.is_key_file(executor.pass_of(pass), path)) {
    wrong(pass,
          fmt::format("asks for the file '{}', which no parameter names: what a job reads is part of its key", path));
    return "";
  }
  pass.resolved_path = (executor_of(pass).graph.folder / path).lexically_normal().string();
  return pass.resolved_path.c_str();
}

heddle_status set_text(const heddle_pass_host* self, const char* name, const char* glsl) {
  PassState& pass = state_of(self);
  return guarded(pass, [&]() -> heddle_status {
    if (!pass.is_declaring && !pass.is_preparing) return wrong(pass, "calls set_text outside of declare and prepare");
    const std::string include = fmt::format("generated/{}.glsl", name);
    const std::filesystem::path stand_in = executor_of(pass).pass_of(pass).entry.manifest->folder / include;
    if (std::error_code ignored; !std::filesystem::is_regular_file(stand_in, ignored)) {
      return wrong(pass,
                   fmt::format("sets the text '{}' and has no file {} to stand in for it", include, stand_in.string()));
    }
    if (glsl == nullptr) {
      pass.texts.erase(include);
    } else {
      pass.texts[include] = glsl;
    }
    return HEDDLE_OK;
  });
}

heddle_status progress(const heddle_pass_host* self, heddle_frame* frame, double done) {
  PassState& pass = state_of(self);
  return guarded(pass, [&]() -> heddle_status {
    Executor::State& executor = executor_of(pass);
    const bool is_cancelled = executor.services.is_cancelled != nullptr && executor.services.is_cancelled->load();
    if (is_cancelled && !frame->stops_at_slices) return HEDDLE_CANCELLED;
    const Pass& declared = executor.pass_of(pass);
    const std::string& stage = executor.technique_of(pass).stages[frame->stage->stage].name;
    done = std::clamp(done, 0.0, 1.0);
    if (executor.services.progress && !executor.stop_reason) {
      try {
        executor.services.progress(fmt::format("stage '{}' of pass '{}'", stage, declared.name), done);
      } catch (...) {
        if (!frame->stops_at_slices) throw;
        executor.stop_reason = std::current_exception();
      }
    }
    const auto now = std::chrono::steady_clock::now();
    // That all is done, its end says.
    if (now - frame->told < kTellEvery || done >= 1.0) return HEDDLE_OK;
    frame->told = now;
    say(pass, Severity::kInfo,
        fmt::format("stage '{}': {:.0f} % after {:.0f} s", stage, 100.0 * done,
                    std::chrono::duration<double>(now - frame->began).count()));
    return HEDDLE_OK;
  });
}

heddle_status add_row(const heddle_pass_host* self, heddle_frame*, const char* port, const heddle_report_row* row) {
  PassState& pass = state_of(self);
  return guarded(pass, [&]() -> heddle_status {
    Executor::State& executor = executor_of(pass);
    const Port* own = executor.technique_of(pass).find_port(port);
    if (own == nullptr || own->type != PortType::kReport)
      return wrong(pass, fmt::format("adds a row to '{}', which is none of its reports", port));
    heddle_report_row given{};
    std::memcpy(&given, row, std::min<std::size_t>(row->struct_size, sizeof given));
    if (given.message == nullptr || given.level > HEDDLE_SEVERITY_INFO)
      return wrong(pass, fmt::format("adds a row to '{}' without a message, or of the level {}", port, given.level));
    Value& value = executor.resources[executor.pass_of(pass).ports.at(port)].value;
    const std::string line = report_line(given) + "\n";
    const auto bytes = std::as_bytes(std::span(line));
    value.bytes.insert(value.bytes.end(), bytes.begin(), bytes.end());
    value.is_set = true;
    return HEDDLE_OK;
  });
}

heddle_status keep_state(const heddle_pass_host* self, heddle_frame* frame, const void* data, std::uint64_t bytes) {
  PassState& pass = state_of(self);
  return guarded(pass, [&]() -> heddle_status {
    if (!frame->is_saving) return wrong(pass, "calls keep_state outside of save_state");
    const auto* first = static_cast<const std::byte*>(data);
    frame->state.insert(frame->state.end(), first, first + bytes);
    return HEDDLE_OK;
  });
}

const char* light_type_name(std::uint32_t type) {
  constexpr std::array<const char*, 10> kNames{"directional", "point", "spot", "sphere",    "capsule",
                                               "cone",        "wedge", "box",  "rectangle", "environment"};
  return type < kNames.size() ? kNames[type] : "";
}

}  // namespace

void fill_pass_host(PassState& pass, const heddle_vulkan& table) {
  heddle_pass_host& api = pass.api;
  api.struct_size = sizeof api;
  api.host = &pass;
  api.report = report;
  api.parameter = parameter;
  api.service = service;
  api.set_shape = set_shape;
  api.shape = shape;
  api.function_service = function_service;
  api.value = value;
  api.set_value = set_value;
  api.map = map;
  api.snapshot = snapshot;
  api.dispatch = dispatch;
  api.dispatch_over = dispatch_over;
  api.fullscreen = fullscreen;
  api.draw = draw_unplaced;
  api.barrier = barrier;
  api.update_buffer = update_buffer;
  api.vulkan = &table;
  api.command_buffer = command_buffer;
  api.image = image;
  api.image_view = image_view;
  api.buffer = buffer_handle;
  api.text = text;
  api.resolve_path = resolve_path;
  api.set_text = set_text;
  api.set_capacity = set_capacity;
  api.dispatch_over_list = dispatch_over_list;
  api.request_redeclare = request_redeclare;
  api.progress = progress;
  api.add_row = add_row;
  api.keep_state = keep_state;
  api.set_batches = set_batches;
  api.set_blend_constant = set_blend_constant;
}

heddle_shape shape_of(const Resource& resource) {
  heddle_shape shape{};
  shape.struct_size = sizeof shape;
  shape.type = static_cast<std::uint32_t>(resource.type);
  shape.format = resource.format;
  shape.width = resource.is_list() ? resource.capacity : resource.width;
  shape.height = resource.is_list() ? 1 : resource.height;
  shape.layers = std::max(resource.layers, 1U);
  shape.mips = std::max(resource.mips, 1U);
  shape.byte_size = resource.byte_size;
  shape.is_bound = 1;
  return shape;
}

VkExtent2D Executor::State::attachment_extent(const Pass& pass, const Stage& stage) const {
  for (const Access& access : stage.accesses) {
    const auto found = pass.ports.find(access.port);
    const bool is_attachment = access.access == HEDDLE_ACCESS_COLOR || access.access == HEDDLE_ACCESS_DEPTH ||
                               access.access == HEDDLE_ACCESS_DEPTH_READ;
    if (!is_attachment || found == pass.ports.end()) continue;
    const Resource& resource = graph.resources[resources[found->second].root];
    return {resource.width, resource.height};
  }
  return {0, 0};
}

void Executor::State::begin_rendering(const PassState& state, heddle_frame& frame, std::uint32_t layer,
                                      const Drawing* drawing) {
  const Pass& pass = pass_of(state);
  const Stage& stage = technique_of(state).stages[frame.stage->stage];
  const bool is_first = frame.drawn_layers.insert(layer).second;
  std::vector<VkRenderingAttachmentInfo> colors;
  VkRenderingAttachmentInfo depth{VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO};
  bool has_depth = false;
  for (const Access& access : stage.accesses) {
    const bool is_color = access.access == HEDDLE_ACCESS_COLOR;
    const bool is_depth = access.access == HEDDLE_ACCESS_DEPTH || access.access == HEDDLE_ACCESS_DEPTH_READ;
    const auto found = pass.ports.find(access.port);
    if ((!is_color && !is_depth) || found == pass.ports.end()) continue;
    const ResourceState& target = root(found->second);
    if (drawing != nullptr) ++writes_recorded;  // what it clears is its part alone
    if (is_first) drawn_layers[target.root].insert(std::min(layer, target.image.shape().layers - 1));
    VkRenderingAttachmentInfo attachment{VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO};
    attachment.imageView = target.image.layer_view(std::min(layer, target.image.shape().layers - 1), 0);
    attachment.imageLayout = target.layout;
    // Storing is writing: what is only tested must not count as written.
    attachment.storeOp =
        access.access == HEDDLE_ACCESS_DEPTH_READ ? VK_ATTACHMENT_STORE_OP_NONE : VK_ATTACHMENT_STORE_OP_STORE;
    const bool is_there = access.load == HEDDLE_LOAD_CLEAR_NEW && pass.inout_sources.count(access.port) != 0;
    attachment.loadOp = drawing != nullptr
                            ? (drawing->clears ? VK_ATTACHMENT_LOAD_OP_CLEAR : VK_ATTACHMENT_LOAD_OP_LOAD)
                        : !is_first || is_there || access.load == HEDDLE_LOAD_KEEP ? VK_ATTACHMENT_LOAD_OP_LOAD
                        : access.load == HEDDLE_LOAD_DONT_CARE                     ? VK_ATTACHMENT_LOAD_OP_DONT_CARE
                                                                                   : VK_ATTACHMENT_LOAD_OP_CLEAR;
    if (is_depth) {
      attachment.clearValue.depthStencil = {access.clear[0], 0};
      depth = attachment;
      has_depth = true;
    } else {
      std::copy(access.clear.begin(), access.clear.end(), attachment.clearValue.color.float32);
      colors.push_back(attachment);
    }
  }
  VkRenderingInfo info_rendering{VK_STRUCTURE_TYPE_RENDERING_INFO};
  info_rendering.renderArea.extent = attachment_extent(pass, stage);
  // What is cleared is the area.
  if (drawing != nullptr && drawing->wanted.width != 0) {
    info_rendering.renderArea = {
        {static_cast<std::int32_t>(drawing->wanted.x), static_cast<std::int32_t>(drawing->wanted.y)},
        {drawing->wanted.width, drawing->wanted.height}};
  }
  info_rendering.layerCount = 1;
  info_rendering.colorAttachmentCount = static_cast<std::uint32_t>(colors.size());
  info_rendering.pColorAttachments = colors.data();
  info_rendering.pDepthAttachment = has_depth ? &depth : nullptr;
  const heddle_vulkan& vk = device->table();
  if (!is_first) {
    // Later drawings of the stage into the same layer follow the earlier ones. Depth is cleared and read early, and
    // written in both.
    VkMemoryBarrier2 memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2};
    memory.srcStageMask = VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT |
                          VK_PIPELINE_STAGE_2_EARLY_FRAGMENT_TESTS_BIT | VK_PIPELINE_STAGE_2_LATE_FRAGMENT_TESTS_BIT;
    memory.srcAccessMask = VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT | VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT;
    memory.dstStageMask = memory.srcStageMask;
    memory.dstAccessMask = VK_ACCESS_2_COLOR_ATTACHMENT_READ_BIT | VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT |
                           VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT |
                           VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT;
    VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
    dependency.memoryBarrierCount = 1;
    dependency.pMemoryBarriers = &memory;
    vk.CmdPipelineBarrier2(frame.commands, &dependency);
  }
  vk.CmdBeginRendering(frame.commands, &info_rendering);
  if (blends_by_constant(stage)) vk.CmdSetBlendConstants(frame.commands, frame.blend_constant.data());
}

vulkan::Buffer Executor::State::switch_table(const Pass& caller, const std::string& role) {
  const auto binding = std::find_if(caller.functions.begin(), caller.functions.end(),
                                    [&](const FunctionBinding& candidate) { return candidate.role == role; });
  std::vector<PassIndex> providers;
  if (binding != caller.functions.end()) {
    std::copy_if(binding->providers.begin(), binding->providers.end(), std::back_inserter(providers),
                 [&](PassIndex index) { return !graph.passes[index].is_pruned; });
  }
  // Every name or type that a key answers to, for each key.
  std::vector<std::vector<std::string>> keys;
  const std::string& selector = services.registry.find_role(role)->selector;
  if (selector == "light") {
    if (const auto lights = caller.ports.find("lights"); lights != caller.ports.end()) {
      const std::vector<std::byte>& bytes = resources[lights->second].value.bytes;
      for (std::size_t offset = 0; offset + sizeof(HeddleLight) <= bytes.size(); offset += sizeof(HeddleLight)) {
        HeddleLight light;
        std::memcpy(&light, bytes.data() + offset, sizeof light);
        keys.push_back({light_type_name(light.type)});
        if (light.id < scene->lights.size()) keys.back().push_back(scene->lights[light.id].name);
      }
    }
  } else if (selector == "material") {
    for (const scene::Material& material : scene->materials) keys.push_back({material.name});
  }
  // The last provider that names a key serves it; else the first that names nothing; else the first.
  std::uint32_t fallback = 0;
  for (std::uint32_t i = static_cast<std::uint32_t>(providers.size()); i-- > 0;) {
    if (graph.passes[providers[i]].serves.empty()) fallback = i;
  }
  std::vector<std::uint32_t> table(std::max<std::size_t>(keys.size(), 4), fallback);
  for (std::size_t key = 0; key < keys.size(); ++key) {
    for (std::uint32_t i = 0; i < providers.size(); ++i) {
      for (const std::string& name : graph.passes[providers[i]].serves) {
        if (std::find(keys[key].begin(), keys[key].end(), name) != keys[key].end()) table[key] = i;
      }
    }
  }
  vulkan::Buffer buffer = device->make_buffer(table.size() * 4, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, true);
  std::memcpy(buffer.data(), table.data(), table.size() * 4);
  device->note_host_write(buffer);
  return buffer;
}

VkDescriptorSet Executor::State::port_set(const PassState& state, const ShaderState& shader, std::uint32_t set) {
  const VkDescriptorSet allocated = allocate_set(shader.pipeline.set_layout(set));
  fill_set(allocated, pass_of(state), shader.compiled.bindings, shader.owners, set);
  return allocated;
}

/// What `bindings` have in one set. `caller`: whose tables of providers are meant.
void Executor::State::fill_set(VkDescriptorSet target, const Pass& caller, std::span<const vulkan::Binding> bindings,
                               std::span<const PassIndex> owners, std::uint32_t set) {
  const std::size_t count = bindings.size();
  std::vector<VkWriteDescriptorSet> writes;
  std::vector<VkDescriptorImageInfo> images(count);
  std::vector<VkDescriptorBufferInfo> buffers(count);
  for (std::size_t i = 0; i < count; ++i) {
    const vulkan::Binding& binding = bindings[i];
    if (binding.set != set) continue;
    VkWriteDescriptorSet write{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET};
    write.dstSet = target;
    write.dstBinding = binding.binding;
    write.descriptorCount = 1;
    write.descriptorType = vulkan::descriptor_type(binding);
    write.pImageInfo = &images[i];
    write.pBufferInfo = &buffers[i];
    const Pass& owner = graph.passes[owners[i]];
    const auto resource_of = [&]() -> ResourceIndex { return owner.ports.at(binding.port); };
    // What an absent optional value or buffer reads as: zeros, and no element of a list (16 bytes are the list's
    // header).
    const auto zeros = [&]() -> VkDescriptorBufferInfo {
      constexpr std::uint64_t kBlock = 4096;
      frame_buffers.push_back(
          device->make_buffer(kBlock, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT, true));
      std::memset(frame_buffers.back().data(), 0, kBlock);
      device->note_host_write(frame_buffers.back());
      const bool is_list = binding.kind == vulkan::Binding::Kind::kStorageBuffer;
      return {frame_buffers.back().handle(), 0, is_list ? 16 : kBlock};
    };
    switch (binding.kind) {
      case vulkan::Binding::Kind::kSampledImage: {
        const ResourceIndex resource = resource_of();
        const auto sampler = binding.access == HEDDLE_ACCESS_SAMPLED_COMPARE  ? vulkan::Device::Sampler::kCompareClamp
                             : binding.access == HEDDLE_ACCESS_SAMPLED_LINEAR ? vulkan::Device::Sampler::kLinearClamp
                                                                              : vulkan::Device::Sampler::kNearestClamp;
        // The stage's barriers have put the image into the layout that suits all of the stage's uses of it.
        images[i] = {device->sampler(sampler), root(resource).image.view(), root(resource).layout};
        break;
      }
      case vulkan::Binding::Kind::kStorageImage:
        images[i] = {VK_NULL_HANDLE, root(resource_of()).image.mip_view(0), VK_IMAGE_LAYOUT_GENERAL};
        break;
      case vulkan::Binding::Kind::kStorageBuffer: {
        if (owner.ports.count(binding.port) == 0) {
          buffers[i] = zeros();
          break;
        }
        const ResourceIndex resource = resource_of();
        if (graph.resources[resource].type == PortType::kValue) {
          if (!resources[resource].value.is_set) set_value(resource, {});
          buffers[i] = storage_of(resources[resource].value);
        } else {
          buffers[i] = {root(resource).buffer.handle(), 0, VK_WHOLE_SIZE};
        }
        break;
      }
      case vulkan::Binding::Kind::kUniformBuffer: {
        if (owner.ports.count(binding.port) == 0) {
          buffers[i] = zeros();
          break;
        }
        const ResourceIndex resource = resource_of();
        if (!resources[resource].value.is_set) {
          set_value(resource, std::vector<std::byte>(std::max<std::uint64_t>(graph.resources[resource].byte_size, 16)));
        }
        buffers[i] = uniform_of(resources[resource].value);
        break;
      }
      case vulkan::Binding::Kind::kParameters:
        buffers[i] = {passes[owners[i]]->parameters.handle(), 0, VK_WHOLE_SIZE};
        break;
      case vulkan::Binding::Kind::kSwitchTable:
        frame_buffers.push_back(switch_table(caller, binding.role));
        buffers[i] = {frame_buffers.back().handle(), 0, VK_WHOLE_SIZE};
        break;
    }
    writes.push_back(write);
  }
  device->table().UpdateDescriptorSets(device->table().device, static_cast<std::uint32_t>(writes.size()), writes.data(),
                                       0, nullptr);
}

void Executor::State::bind(const PassState& state, const ShaderState& shader, const vulkan::Pipeline& pipeline,
                           const void* push, std::uint32_t push_bytes) {
  const heddle_vulkan& vk = device->table();
  ++writes_recorded;  // whoever binds a pipeline runs it
  vk.CmdBindPipeline(commands, pipeline.bind_point(), pipeline.handle());
  // Sets of a shader suit every pipeline that it is in.
  for (std::uint32_t set = 0; set < 2; ++set) {
    const bool is_used = std::any_of(shader.compiled.bindings.begin(), shader.compiled.bindings.end(),
                                     [&](const vulkan::Binding& binding) { return binding.set == set; });
    if (!is_used) continue;
    const VkDescriptorSet made = port_set(state, shader, set);
    vk.CmdBindDescriptorSets(commands, pipeline.bind_point(), pipeline.layout(), set, 1, &made, 0, nullptr);
  }
  const std::uint32_t size = std::min(shader.compiled.push_bytes, push_bytes);
  if (size > 0 && push != nullptr) {
    vk.CmdPushConstants(commands, pipeline.layout(),
                        pipeline.bind_point() == VK_PIPELINE_BIND_POINT_COMPUTE ? VK_SHADER_STAGE_COMPUTE_BIT
                                                                                : VK_SHADER_STAGE_FRAGMENT_BIT,
                        0, size, push);
  }
}

}  // namespace heddle::graph
