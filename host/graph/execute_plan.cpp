// SPDX-License-Identifier: Apache-2.0
// Resolved graph and scene features -> everything a frame needs: open plugins, placed memory, pipelines.

#include "graph/execute_state.hpp"
#include "graph/uses.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstring>

namespace heddle::graph {

namespace {

constexpr std::uint32_t kSetsInPool = 512;

/// Passes in an order in which producers come before consumers.
std::vector<PassIndex> dependency_order(const ResolvedGraph& graph) {
  std::vector<PassIndex> order;
  std::vector<std::uint8_t> seen(graph.passes.size(), 0);
  std::function<void(PassIndex)> visit = [&](PassIndex index) {
    if (seen[index] != 0) return;
    seen[index] = 1;
    for (const PassIndex before : graph.passes[index].dependencies) visit(before);
    order.push_back(index);
  };
  for (PassIndex i = 0; i < graph.passes.size(); ++i) visit(i);
  return order;
}

bool owns_memory(const ResolvedGraph& graph, const Resource& resource) {
  return maker_of(graph, resource) != kNoIndex && resource.previous_version == kNoIndex && has_memory(resource.type);
}

std::array<std::uint32_t, 2> environment_extent(const scene::Scene& scene) {
  if (!scene.environment) return {0, 0};
  return {scene.environment->record.width, scene.environment->record.height};
}

constexpr VkBufferUsageFlags kPortBufferUsage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
                                                VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | VK_BUFFER_USAGE_INDEX_BUFFER_BIT |
                                                VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;

}  // namespace

void copy_shape(Resource& to, const Resource& from) {
  to.format = from.format;
  to.width = from.width;
  to.height = from.height;
  to.layers = from.layers;
  to.mips = from.mips;
  to.byte_size = from.byte_size;
  to.capacity = from.capacity;
  to.element_bytes = from.element_bytes;
}

bool is_environment(const Resource& resource) {
  return resource.producer == kNoIndex && resource.port == "environment";
}

/// Whether contents outlast the frame; those of a history do because those of its newest version do.
bool Executor::State::is_any_version_kept(ResourceIndex first) const {
  if (graph.resources[first].history_of != kNoIndex) return true;
  for (ResourceIndex i = 0; i < graph.resources.size(); ++i)
    if (graph.resources[i].is_kept && first_version(graph, i) == first) return true;
  return false;
}

void Executor::State::open_device() {
  if (device != nullptr) return;
  vulkan::Device& opened = services.device();
  maker = std::make_unique<vulkan::PipelineMaker>(opened, services.cache_folder);
  materials_layout = scene::make_materials_layout(opened);

  // Set 3 as shader.hpp describes it: vertices, instances, materials, and the view of one drawing.
  std::array<VkDescriptorSetLayoutBinding, 4> bindings{};
  for (std::uint32_t i = 0; i < bindings.size(); ++i) {
    bindings[i] = {i, i == 3 ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1,
                   VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT, nullptr};
  }
  program_layout = opened.pipelines().set_layout(bindings);

  device = &opened;
  static_cast<FrameMemory&>(*this) = make_frame_memory();
}

/// Takes everything down: the next plan starts from nothing.
void Executor::State::unplan() {
  retire();
  bury();
  has_frame = false;
}

bool Executor::State::is_planned_for(const scene::Scene& rendered) const {
  return rendered.features() == planned_features && environment_extent(rendered) == planned_environment;
}

const scene::Scene* Executor::State::asked_scene(PassState& pass) const {
  if (!pass.is_declaring && !pass.is_preparing) return scene;
  pass.declares_by_scene = pass.declares_by_scene || pass.is_declaring;
  return planned_scene;
}

namespace {

std::array<std::uint64_t, 2> content_of(const scene::Scene* scene) {
  if (scene == nullptr) return {0, 0};
  return {scene->content_revision, scene->components.revision()};
}

}  // namespace

/// Passes whose declare looked at the scene are due if it is another one by now.
void Executor::State::note_content(const scene::Scene& rendered) {
  for (const auto& pass : passes) {
    if (!pass || !pass->declares_by_scene || pass->declared_content == content_of(&rendered)) continue;
    pass->wants_redeclare = true;
  }
}

void Executor::State::plan(const scene::Scene& rendered) {
  planned_environment = environment_extent(rendered);
  plan(rendered.features());
  if (graph.is_job) return;  // need not look at anything
  const auto reads_environment = [&](const Pass& pass) {
    return !pass.is_pruned && std::ranges::any_of(pass.ports, [&](const auto& bound) {
      return is_environment(graph.resources[bound.second]);
    });
  };
  if (rendered.environment && std::ranges::none_of(graph.passes, reads_environment)) {
    services.log(Severity::kWarning,
                 fmt::format("{}: the scene has an environment, and no pass of this graph reads it; "
                             "graph 'environment' does, with technique sky/environment_map",
                             graph.file));
  }
}

/// Throws with everything taken down to what the next plan may adopt. `is_restoring`: the plan of before is made again,
/// from what it left.
void Executor::State::plan(const std::vector<std::string>& features, bool is_restoring) {
  const std::vector<std::string> planned = features;  // may be planned_features
  const auto start = std::chrono::steady_clock::now();
  stats.plan = {};
  try {
    plan_memory(planned);
    is_fresh = !legacy.has_past;
    has_frame = false;
    place_resources();
    name_resources();
    initialize_kept();
    PassMistakes mistakes(graph);
    for (const PassIndex index : dependency_order(graph)) {
      PassState* pass = passes[index].get();
      if (pass == nullptr || pass->is_prepared) continue;
      mistakes.attempt(index, [&] {
        if (pass->descriptor->prepare != nullptr) {
          pass->is_preparing = true;
          const heddle_status status = pass->descriptor->prepare(pass->object, &pass->api);
          pass->is_preparing = false;
          throw_if_failed(*pass, status, "prepare");
        }
        pass->is_prepared = true;
      });
    }
    mistakes.throw_if_any();
    compile_passes(is_restoring);
  } catch (...) {
    retire();
    throw;
  }
  find_outdated();
  bury();
  for (const auto& pass : passes) {
    if (!pass) continue;
    ++(pass->is_adopted ? stats.plan.passes_kept : stats.plan.passes_made);
    if (pass->is_redeclared) ++stats.plan.passes_redeclared;
    pass->is_redeclared = false;
  }
  stats.plan.wall_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  is_changed = true;
  is_planned = true;
}

/// As the passes that asked for it have it now. Throws as plan does.
void Executor::State::redeclare() {
  is_redeclaring = true;
  const struct Done {
    bool& flag;
    ~Done() { flag = false; }
  } done{is_redeclaring};
  plan(planned_features);
}

/// What the plan is for.
void Executor::State::find_wanted() {
  std::vector<std::string> names = wave;
  if (graph.is_job && names.empty()) names = job_wants();
  if (!graph.is_job) names = frame_wants();
  wanted.clear();
  for (const std::string& name : names) {
    const ResourceIndex resource = find_resource(graph, name);
    if (std::find(wanted.begin(), wanted.end(), resource) == wanted.end()) wanted.push_back(resource);
  }
}

/// Everything that is decided before the first byte is allocated.
void Executor::State::plan_memory(const std::vector<std::string>& features) {
  open_device();
  retire();
  errors.clear();
  graph = original;
  planned_features = features;
  for (Resource& resource : graph.resources) {
    if (!is_environment(resource)) continue;
    resource.width = planned_environment[0];
    resource.height = planned_environment[1];
  }
  find_wanted();
  resources.resize(graph.resources.size());
  place_lasting();
  prune(graph, wanted, planned_features);
  weave_loops(graph);
  if (variant.order == 0) {
    order = graph::order(graph);
    if (graph.is_job && services.checks) wave_orders.push_back(find_orders(graph, kMostOrders));
  } else {
    std::vector<Order> orders = find_orders(graph, variant.order + 1).orders;
    order = std::move(orders[std::min(variant.order, orders.size() - 1)]);  // of a job's waves, not all have as many
  }
  for (ResourceIndex i = 0; i < graph.resources.size(); ++i) {
    ResourceIndex first = i;
    const bool shares_memory =
        graph.resources[i].type == PortType::kImage || graph.resources[i].type == PortType::kBuffer;
    while (shares_memory && graph.resources[first].previous_version != kNoIndex) {
      first = graph.resources[first].previous_version;
    }
    resources[i].root = first;
  }
  PassMistakes mistakes(graph);
  open_passes(mistakes);
  declare_passes(mistakes);
  mistakes.throw_if_any();
  find_needs();
  std::vector<ResourceIndex> pinned = wanted;
  for (ResourceIndex i = 0; i < graph.resources.size(); ++i) {
    if (graph.resources[i].is_kept) pinned.push_back(i);
    // No memory type serves all images and buffers together on this device: buffers then live apart.
    if (memory_types == 0 && graph.resources[i].type == PortType::kBuffer) pinned.push_back(i);
  }
  placement = alias(graph, order, needs, pinned);
  barriers = plan_barriers(graph, order, placement, wanted);
  lists = plan_lists(graph, order);
}

void Executor::State::open_passes(PassMistakes& mistakes) {
  passes.resize(graph.passes.size());
  stats.libraries.clear();
  for (PassIndex index = 0; index < graph.passes.size(); ++index) {
    const Pass& pass = graph.passes[index];
    if (pass.is_pruned) continue;
    stats.libraries.push_back(pass.entry.manifest->library.string());
    passes[index] = adopt_object(index);
    if (passes[index]) continue;
    mistakes.attempt(index, [&] {
      auto state = std::make_unique<PassState>();
      state->executor_state = this;
      state->index = index;
      state->library = services.registry.open(pass.entry);
      state->descriptor = &state->library->descriptor(pass.entry.technique->id);
      state->layout = vulkan::parameter_layout(*pass.entry.technique);
      fill_pass_host(*state, device->table());
      passes[index] = std::move(state);
      create(*passes[index]);
    });
  }
  std::sort(stats.libraries.begin(), stats.libraries.end());
  stats.libraries.erase(std::unique(stats.libraries.begin(), stats.libraries.end()), stats.libraries.end());
}

void Executor::State::create(PassState& pass) {
  pass.is_adopted = pass.is_redeclared = pass.wants_redeclare = false;
  pass.texts = {};
  if (pass.descriptor->create == nullptr) return;
  throw_if_failed(pass, pass.descriptor->create(&pass.api, &pass.object), "create");
}

void Executor::State::declare(PassIndex index) {
  PassState& pass = *passes[index];
  for (const auto& [port, source] : graph.passes[index].inout_sources) {
    Resource& made = graph.resources[graph.passes[index].ports.at(port)];
    if (made.type == PortType::kValue) continue;
    copy_shape(made, graph.resources[source]);
  }
  pass.is_adopted = keep_adopted(index);
  if (pass.is_adopted) return;
  if (pass.is_prepared && is_redeclaring) {
    // The object goes on: it asked for this, or reads what has another shape now because another one did.
    pass.is_adopted = pass.is_redeclared = true;
    pass.is_prepared = pass.wants_redeclare = false;
  } else if (pass.is_prepared) {
    destroy(pass);
    create(pass);
  }
  if (pass.descriptor->declare != nullptr) {
    pass.is_declaring = true;
    pass.declares_by_scene = false;
    pass.declared_content = content_of(planned_scene);
    const heddle_status status = pass.descriptor->declare(pass.object, &pass.api);
    pass.is_declaring = false;
    throw_if_failed(pass, status, "declare");
  }
}

void Executor::State::declare_passes(PassMistakes& mistakes) {
  for (const PassIndex index : dependency_order(graph))
    if (passes[index]) mistakes.attempt(index, [&] { declare(index); });
  if (!mistakes.empty()) return;  // nothing has a shape to go by
  for (PassIndex i = 0; i < passes.size(); ++i)
    if (passes[i] && passes[i]->is_redeclared) adopt_rings(i);
  for (Resource& history : graph.resources) {
    const bool has_shape = history.type == PortType::kImage || history.type == PortType::kBuffer;
    if (history.history_of != kNoIndex && has_shape) copy_shape(history, graph.resources[history.history_of]);
  }
}

vulkan::ImageShape Executor::State::image_shape(const Resource& resource) const {
  vulkan::ImageShape shape;
  shape.format = static_cast<VkFormat>(resource.format);
  shape.width = std::max(resource.width, 1U);
  shape.height = std::max(resource.height, 1U);
  shape.layers = std::max(resource.layers, 1U);
  shape.mips = std::max(resource.mips, 1U);
  shape.is_cube = (resource.flags & HEDDLE_PORT_CUBE) != 0;
  return shape;
}

void Executor::State::find_needs() {
  needs.assign(graph.resources.size(), {0, 1});
  memory_types = ~0U;
  const std::vector<HistoryPair> pairs = history_pairs(graph, order);
  for (ResourceIndex i = 0; i < graph.resources.size(); ++i) {
    const Resource& resource = graph.resources[i];
    if (!owns_memory(graph, resource) || !passes[maker_of(graph, resource)]) continue;
    // A history that only passes of no use would read costs nothing.
    if (resource.history_of != kNoIndex &&
        std::ranges::none_of(pairs, [&](const HistoryPair& pair) { return pair.history == i; })) {
      continue;
    }
    VkMemoryRequirements need{};
    if (resource.type == PortType::kImage) {
      if (resource.format == VK_FORMAT_UNDEFINED) {
        throw Error(HEDDLE_BUG, fmt::format("resource '{}' has no format: neither its descriptor nor declare gave one",
                                            resource.name));
      }
      if (resource.width == 0 || resource.height == 0) {
        throw Error(HEDDLE_BAD_INPUT,
                    Diagnostic{Severity::kError,
                               graph.passes[maker_of(graph, resource)].where,
                               fmt::format("'{}' is as large as the frame, and this job says no extent", resource.name),
                               {},
                               "extent = [width, height], in pixels, above the first [[pass]]",
                               {}});
      }
      need = device->image_requirements(image_shape(resource));
    } else {
      const std::uint64_t most = device->limits().maxStorageBufferRange;
      if (resource.is_list() && resource.byte_size > most) {
        throw Error(HEDDLE_UNSUPPORTED,
                    Diagnostic{Severity::kError,
                               graph.passes[maker_of(graph, resource)].where,
                               fmt::format("the list '{}' is too large for this device", resource.name),
                               fmt::format("{} elements of {} bytes", resource.capacity, resource.element_bytes),
                               fmt::format("at most {} elements: {} bytes in all",
                                           (most - kListHead) / resource.element_bytes, most),
                               {}});
      }
      need = device->buffer_requirements(std::max<std::uint64_t>(resource.byte_size, 16), kPortBufferUsage);
    }
    needs[i] = {need.size, need.alignment};
    memory_types &= need.memoryTypeBits;
  }
}

void Executor::State::place_resources() {
  if (memory_types == 0) {
    memory_types = ~0U;
    for (ResourceIndex i = 0; i < graph.resources.size(); ++i) {
      if (needs[i].size != 0 && graph.resources[i].type == PortType::kImage) {
        memory_types &= device->image_requirements(image_shape(graph.resources[i])).memoryTypeBits;
      }
    }
  }
  if (placement.heap_size > 0) heap = device->make_heap(placement.heap_size, memory_types);
  kept_bytes = 0;
  for (ResourceIndex i = 0; i < graph.resources.size(); ++i) {
    const Resource& resource = graph.resources[i];
    if (resource.type == PortType::kValue || resource.type == PortType::kSurfaces) adopt_memory(i);
    if (needs[i].size == 0) continue;
    ResourceState& state = resources[i];
    const std::uint64_t offset = placement.offset[i];
    const bool is_own = offset == Placement::kOwnMemory;
    if (is_own) kept_bytes += needs[i].size;
    // Kept contents are somebody's; all other memory is filled by Executor::check, through a buffer over it.
    const bool is_poisoned =
        variant.poison && barriers.first_layout[i] == VK_IMAGE_LAYOUT_UNDEFINED && !is_any_version_kept(i);
    if (is_own && is_poisoned) state.own_heap = device->make_heap(needs[i].size, memory_types);
    const bool is_alone = is_own && !is_poisoned;
    if (is_alone) adopt_memory(i);
    if (state.is_adopted) continue;
    const vulkan::Heap& place = is_own ? state.own_heap : heap;
    const std::uint64_t at = is_own ? 0 : offset;
    if (resource.type == PortType::kImage) {
      const vulkan::ImageShape shape = image_shape(resource);
      state.image = is_alone ? device->make_image(shape) : device->place_image(shape, place, at);
    } else {
      const std::uint64_t size = std::max<std::uint64_t>(resource.byte_size, 16);
      state.buffer = is_alone ? device->make_buffer(size, kPortBufferUsage, false)
                              : device->place_buffer(size, kPortBufferUsage, place, at);
    }
    if (is_poisoned) place_poison(i, needs[i].size);
  }
  stats.heap_bytes = placement.heap_size;
  stats.unaliased_bytes = placement.unaliased_size;
  stats.kept_bytes = kept_bytes;
}

void Executor::State::initialize_kept() {
  // Where a past is taken over, the next frame begins by letting histories and what is newest change places.
  std::vector<VkImageLayout> layouts = barriers.first_layout;
  layouts.resize(graph.resources.size(), VK_IMAGE_LAYOUT_UNDEFINED);
  if (!is_fresh) {
    for (ResourceIndex i = 0; i < graph.resources.size(); ++i) {
      const ResourceIndex newest = graph.resources[i].history_of;
      if (newest == kNoIndex || !resources[i].image) continue;
      std::swap(layouts[i], layouts[resources[newest].root]);
    }
  }
  // How many elements a list holds that is carried over: not in a frame, and the device is idle.
  std::map<ResourceIndex, std::uint32_t> list_counts;
  for (ResourceIndex i = 0; i < graph.resources.size(); ++i) {
    const Legacy::Memory* old = graph.resources[i].is_list() && resources[i].buffer ? outgrown(i) : nullptr;
    if (old == nullptr) continue;
    std::uint32_t appended = 0;
    std::memcpy(&appended, device->read_back(old->state.buffer, 0, sizeof appended).data(), sizeof appended);
    list_counts[i] = std::min({appended, old->shape.capacity, graph.resources[i].capacity});
  }
  device->run([&](VkCommandBuffer buffer) {
    commands = buffer;
    for (ResourceIndex i = 0; i < graph.resources.size(); ++i) {
      const Resource& resource = graph.resources[i];
      ResourceState& state = resources[i];
      const bool lasts = layouts[i] != VK_IMAGE_LAYOUT_UNDEFINED;
      if (state.is_adopted && state.image && lasts) {
        record_barriers(std::array{full_barrier(i, state.layout, layouts[i])});
      } else if (state.is_adopted) {
        continue;
      } else if (state.image && lasts) {
        const Pass& producer = graph.passes[maker_of(graph, resource)];
        const RolePort* port = producer.role->find_port(resource.port);
        clear_image(state, resource, port != nullptr ? port->neutral : std::array<double, 4>{0, 0, 0, 0});
        migrate(i, 0);
        record_barriers(std::array{full_barrier(i, state.layout, layouts[i])});
      } else if (state.buffer && resource.is_kept) {
        device->table().CmdFillBuffer(buffer, state.buffer.handle(), 0, VK_WHOLE_SIZE, 0);
        // That the host waits makes it available, and visible to nobody.
        VkMemoryBarrier2 memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2};
        memory.srcStageMask = VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT;
        memory.srcAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT;
        memory.dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
        memory.dstAccessMask = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
        VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
        dependency.memoryBarrierCount = 1;
        dependency.pMemoryBarriers = &memory;
        device->table().CmdPipelineBarrier2(buffer, &dependency);
        if (outgrown(i) == nullptr) continue;
        memory.srcStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
        memory.srcAccessMask = VK_ACCESS_2_MEMORY_WRITE_BIT;
        migrate(i, list_counts[i]);
        device->table().CmdPipelineBarrier2(buffer, &dependency);
      }
    }
    commands = VK_NULL_HANDLE;
  });
}

vulkan::BoundPort Executor::State::bound_port(const Pass& pass, const Access& access) const {
  vulkan::BoundPort bound;
  const Port& port = *pass.entry.technique->find_port(access.port);
  const RolePort* contract = pass.role->find_port(access.port);
  bound.port = access.port;
  bound.access = access.access;
  bound.blend = access.blend;
  bound.type = port.type;
  bound.glsl = port.glsl;
  bound.is_list = port.is_list();
  bound.types = port.types;
  if (contract != nullptr) bound.neutral = contract->neutral;
  const auto found = pass.ports.find(access.port);
  bound.is_bound = found != pass.ports.end();
  if (bound.is_bound) {
    const Resource& resource = graph.resources[resources[found->second].root];
    bound.format = static_cast<VkFormat>(resource.format);
    bound.layers = std::max(resource.layers, 1U);
    bound.is_cube = (resource.flags & HEDDLE_PORT_CUBE) != 0;
    bound.element_bytes = resource.element_bytes;
  }
  return bound;
}

vulkan::ProviderRequest Executor::State::provider_request(const Pass& provider, const Function& function) const {
  vulkan::ProviderRequest request;
  request.pass = provider.name;
  request.technique = provider.entry.technique;
  request.folder = provider.entry.manifest->folder;
  request.texts = passes[static_cast<std::size_t>(&provider - graph.passes.data())]->texts;
  for (const Access& access : function.accesses) request.ports.push_back(bound_port(provider, access));
  return request;
}

void Executor::State::add_role(const Pass& caller, const std::string& role,
                               std::vector<vulkan::RoleRequest>& roles) const {
  for (const vulkan::RoleRequest& present : roles) {
    if (present.role->name == role) return;
  }
  const auto binding = std::find_if(caller.functions.begin(), caller.functions.end(),
                                    [&](const FunctionBinding& candidate) { return candidate.role == role; });
  vulkan::RoleRequest request;
  request.role = services.registry.find_role(role);
  if (request.role == nullptr) {
    throw Error(HEDDLE_BUG, fmt::format("pass '{}' calls functions of an unknown role '{}'", caller.name, role));
  }
  request.join = request.role->join;
  if (binding != caller.functions.end()) {
    request.join = binding->join;
    for (const PassIndex index : binding->providers) {
      const Pass& provider = graph.passes[index];
      if (provider.is_pruned) continue;
      const Function* function = provider.entry.technique->find_function(role);
      vulkan::ProviderRequest provided = provider_request(provider, *function);
      // Callees come first in the joined text.
      for (const std::string& callee : function->calls) add_role(provider, callee, roles);
      request.providers.push_back(std::move(provided));
    }
  }
  roles.push_back(std::move(request));
}

vulkan::ShaderRequest Executor::State::shader_request(const PassState& state, const Shader& shader) const {
  const Pass& pass = pass_of(state);
  vulkan::ShaderRequest request;
  request.pass = pass.name;
  request.technique = pass.entry.technique;
  request.shader = &shader;
  request.folder = pass.entry.manifest->folder;
  request.texts = state.texts;
  const Stage* stage = pass.entry.technique->find_stage(shader.stage);
  for (const Access& access : stage->accesses) request.ports.push_back(bound_port(pass, access));
  for (const std::string& role : shader.calls) add_role(pass, role, request.roles);
  const auto folders = services.registry.shared_folders();
  request.shared_folders.assign(folders.begin(), folders.end());
  return request;
}

vulkan::RasterState Executor::State::raster_state(const Pass& pass, const Shader& shader) const {
  vulkan::RasterState raster;
  const Stage* stage = pass.entry.technique->find_stage(shader.stage);
  for (const Access& access : stage->accesses) {
    const auto found = pass.ports.find(access.port);
    if (found == pass.ports.end()) continue;
    const auto format = static_cast<VkFormat>(graph.resources[resources[found->second].root].format);
    if (access.access == HEDDLE_ACCESS_COLOR) {
      raster.color_formats.push_back(format);
      raster.blends.push_back(access.blend);
    }
    if (access.access == HEDDLE_ACCESS_DEPTH || access.access == HEDDLE_ACCESS_DEPTH_READ) {
      raster.depth_format = format;
      raster.depth_write = access.access == HEDDLE_ACCESS_DEPTH;
    }
  }
  if (shader.depth_compare != 0) raster.depth_compare = static_cast<VkCompareOp>(shader.depth_compare);
  raster.depth_bias_constant = shader.depth_bias_constant;
  raster.depth_bias_slope = shader.depth_bias_slope;
  return raster;
}

vulkan::Constants Executor::State::constants(const vulkan::CompiledShader& shader) const {
  vulkan::Constants values;
  for (const vulkan::ConstantSlot& slot : shader.constants) {
    const auto pass = std::find_if(graph.passes.begin(), graph.passes.end(),
                                   [&](const Pass& candidate) { return candidate.name == slot.pass; });
    const Parameter& parameter = pass->entry.technique->parameters[slot.parameter];
    const double number = pass->parameters[slot.parameter].number[0];
    std::uint32_t bits = 0;
    if (parameter.type == ParameterType::kFloat) {
      const auto value = static_cast<float>(number);
      std::memcpy(&bits, &value, sizeof bits);
    } else {
      const auto value = static_cast<std::int32_t>(number);
      std::memcpy(&bits, &value, sizeof bits);
    }
    values[slot.id] = bits;
  }
  return values;
}

void Executor::State::write_parameters(PassState& state) {
  if (state.layout.size == 0) return;
  // Frames in flight read what is there; what replaces it ends with the next frame, which is after them.
  if (state.parameters && !in_flight.empty()) outgrown_buffers.push_back(std::move(state.parameters));
  if (!state.parameters) {
    state.parameters = device->make_buffer(
        state.layout.size, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, true);
  }
  std::memset(state.parameters.data(), 0, state.layout.size);
  const Technique& technique = technique_of(state);
  const Pass& pass = pass_of(state);
  for (std::size_t i = 0; i < technique.parameters.size(); ++i) {
    const std::uint32_t offset = state.layout.offset[i];
    if (offset == 0xffffffffU) continue;
    const Parameter& parameter = technique.parameters[i];
    for (std::uint32_t c = 0; c < parameter.components(); ++c) {
      const double number = pass.parameters[i].number[c];
      std::byte* target = state.parameters.data() + offset + 4 * c;
      const bool is_integer = parameter.type == ParameterType::kInt || parameter.type == ParameterType::kBool ||
                              parameter.type == ParameterType::kChoice;
      if (is_integer) {
        const auto value = static_cast<std::int32_t>(number);
        std::memcpy(target, &value, sizeof value);
      } else {
        const auto value = static_cast<float>(number);
        std::memcpy(target, &value, sizeof value);
      }
    }
  }
  device->note_host_write(state.parameters);
}

void Executor::State::count_pipeline(const vulkan::Pipeline& pipeline) {
  ++(pipeline.was_there() ? stats.plan.pipelines_shared : stats.plan.pipelines_made);
}

void Executor::State::make_pipelines(ShaderState& shader) {
  switch (shader.shader->kind) {
    case ShaderKind::kCompute:
      shader.pipeline = maker->compute(shader.compiled, shader.values);
      break;
    case ShaderKind::kFullscreen:
      shader.pipeline = maker->fullscreen(shader.compiled, shader.values, shader.raster);
      break;
    case ShaderKind::kSurfaces:
      shader.pipeline =
          maker->surfaces(program, shader.compiled, shader.values, shader.raster, materials_layout, program_layout);
      if (shader.shader->file.empty()) {
        shader.masked = maker->surfaces_masked_depth(program, shader.raster, materials_layout, program_layout);
      }
      break;
  }
}

std::vector<PassIndex> Executor::State::owners_of(const vulkan::CompiledShader& shader) const {
  std::vector<PassIndex> owners;
  for (const vulkan::Binding& binding : shader.bindings) {
    const auto owner = std::find_if(graph.passes.begin(), graph.passes.end(),
                                    [&](const Pass& candidate) { return candidate.name == binding.pass; });
    owners.push_back(static_cast<PassIndex>(owner - graph.passes.begin()));
  }
  return owners;
}

/// One shader as this plan joins it. `is_restoring`: as the object has it; no file is read.
ShaderState Executor::State::compile_shader(const PassState& state, const Shader& shader, bool is_restoring) {
  const Technique& technique = technique_of(state);
  ShaderState made;
  made.shader = &shader;
  const auto stage = std::find_if(technique.stages.begin(), technique.stages.end(),
                                  [&](const Stage& candidate) { return candidate.name == shader.stage; });
  made.stage = static_cast<std::uint32_t>(stage - technique.stages.begin());
  made.raster = raster_state(pass_of(state), shader);
  const auto old = state.shaders.find(shader.name);
  if (shader.file.empty()) {
    made.compiled.kind = ShaderKind::kSurfaces;
  } else if (is_restoring && old != state.shaders.end()) {
    made.compiled = old->second.compiled;
  } else {
    made.compiled = vulkan::compile(shader_request(state, shader), services.cache_folder);
    for (const std::string& warning : made.compiled.warnings) services.log(Severity::kWarning, warning);
  }
  made.owners = owners_of(made.compiled);
  made.values = constants(made.compiled);
  return made;
}

/// Those of the stages that are there.
std::vector<const Shader*> Executor::State::scheduled_shaders(const PassState& state) const {
  const Technique& technique = technique_of(state);
  std::vector<const Shader*> shaders;
  for (const Shader& shader : technique.shaders)
    if (is_scheduled(pass_of(state), *technique.find_stage(shader.stage))) shaders.push_back(&shader);
  return shaders;
}

/// Objects have their former shaders until nothing can fail any more.
void Executor::State::compile_passes(bool is_restoring) {
  make_groups_pipeline();
  bool draws_surfaces = false;
  std::size_t shader_count = 0;
  for (const auto& state : passes) {
    if (!state) continue;
    const std::vector<const Shader*> shaders = scheduled_shaders(*state);
    shader_count += shaders.size();
    for (const Shader* shader : shaders) draws_surfaces |= shader->kind == ShaderKind::kSurfaces;
  }
  if (draws_surfaces && program.vertex.empty()) {
    const auto folders = services.registry.shared_folders();
    program = vulkan::mesh_program(services.cache_folder, {folders.begin(), folders.end()});
  }
  struct Made {
    PassState* pass = nullptr;
    ShaderState shader;
  };
  std::vector<Made> all;
  for (const auto& state : passes) {
    if (!state) continue;
    write_parameters(*state);
    for (const Shader* scheduled : scheduled_shaders(*state)) {
      const Shader& shader = *scheduled;
      if (!is_restoring) {
        stop_if_cancelled();  // the first frame's time is here
        if (services.progress) {
          services.progress(fmt::format("compiling shader '{}' of pass '{}'", shader.name, pass_of(*state).name),
                            static_cast<double>(all.size()) / static_cast<double>(shader_count));
        }
      }
      all.push_back({state.get(), compile_shader(*state, shader, is_restoring)});
    }
  }
  Programs own_programs = compile_programs(is_restoring);
  std::swap(programs, own_programs);
  for (Made& made : all) {
    ShaderState* former = former_pipelines(*made.pass, made.shader);
    make_pipelines_behind(pass_of(*made.pass), made.shader, former);
    if (former != nullptr) continue;
    make_pipelines(made.shader);
    count_pipeline(made.shader.pipeline);
  }
  for (Made& made : all) {
    ShaderState* former = made.shader.pipeline ? nullptr : former_pipelines(*made.pass, made.shader);
    if (former == nullptr) continue;
    keep_pipelines_behind(pass_of(*made.pass), made.shader, former);
    made.shader.pipeline = std::move(former->pipeline);
    made.shader.masked = std::move(former->masked);
    ++stats.plan.pipelines_kept;
  }
  for (const auto& state : passes)
    if (state) state->shaders.clear();
  for (Made& made : all) made.pass->shaders.emplace(made.shader.shader->name, std::move(made.shader));
}

VkDescriptorSet Executor::State::allocate_set(VkDescriptorSetLayout layout) {
  const heddle_vulkan& vk = device->table();
  for (;;) {
    if (descriptor_pool == descriptor_pools.size()) {
      constexpr std::array<VkDescriptorPoolSize, 5> kSizes{{{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 4096},
                                                            {VK_DESCRIPTOR_TYPE_STORAGE_IMAGE, 1024},
                                                            {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 4096},
                                                            {VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, 2048},
                                                            {VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC, 64}}};
      VkDescriptorPoolCreateInfo pool_info{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO};
      pool_info.maxSets = kSetsInPool;
      pool_info.poolSizeCount = kSizes.size();
      pool_info.pPoolSizes = kSizes.data();
      VkDescriptorPool pool = VK_NULL_HANDLE;
      vulkan::check(vk.CreateDescriptorPool(vk.device, &pool_info, nullptr, &pool), "vkCreateDescriptorPool");
      descriptor_pools.push_back(pool);
    }
    VkDescriptorSetAllocateInfo set_info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO};
    set_info.descriptorPool = descriptor_pools[descriptor_pool];
    set_info.descriptorSetCount = 1;
    set_info.pSetLayouts = &layout;
    VkDescriptorSet set = VK_NULL_HANDLE;
    const VkResult result = vk.AllocateDescriptorSets(vk.device, &set_info, &set);
    if (result == VK_SUCCESS) return set;
    if (result != VK_ERROR_OUT_OF_POOL_MEMORY && result != VK_ERROR_FRAGMENTED_POOL) {
      vulkan::check(result, "vkAllocateDescriptorSets");
    }
    ++descriptor_pool;
  }
}

}  // namespace heddle::graph
