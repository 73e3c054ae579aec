// SPDX-License-Identifier: Apache-2.0
// One frame: scene values in, stages in order with their barriers, kept resources readable at the end.

#include "graph/execute_state.hpp"
#include "graph/scene_ports.hpp"
#include "scene/light_texture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <ctime>

namespace heddle::graph {

namespace {

using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

}  // namespace

VkImageAspectFlags aspect_of(std::uint32_t format) {
  return vulkan::format_info(static_cast<VkFormat>(format)).is_depth ? VK_IMAGE_ASPECT_DEPTH_BIT
                                                                     : VK_IMAGE_ASPECT_COLOR_BIT;
}

void Executor::State::throw_if_failed(const PassState& state, heddle_status status, std::string_view what) {
  if (status == HEDDLE_OK && errors.empty()) return;
  std::vector<Diagnostic> all = std::move(errors);
  errors.clear();
  if (all.empty()) {
    const Pass& pass = pass_of(state);
    Diagnostic diagnostic;
    diagnostic.where = pass.where;
    diagnostic.message = fmt::format("pass '{}': technique '{}' failed in {} with status {} and gave no reason",
                                     pass.name, pass.entry.technique->id, what, status);
    all.push_back(std::move(diagnostic));
  }
  throw Error(status == HEDDLE_OK ? HEDDLE_FAILED : status, std::move(all));
}

void Executor::State::begin_commands() {
  const heddle_vulkan& vk = device->table();
  if (command_buffer_count == command_buffers.size()) {
    VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
    allocate.commandPool = command_pool;
    allocate.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
    allocate.commandBufferCount = 1;
    VkCommandBuffer made = VK_NULL_HANDLE;
    vulkan::check(vk.AllocateCommandBuffers(vk.device, &allocate, &made), "vkAllocateCommandBuffers");
    command_buffers.push_back(made);
  }
  commands = command_buffers[command_buffer_count++];
  VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  vulkan::check(vk.BeginCommandBuffer(commands, &begin), "vkBeginCommandBuffer");
}

void Executor::State::submit() {
  const heddle_vulkan& vk = device->table();
  vulkan::check(vk.EndCommandBuffer(commands), "vkEndCommandBuffer");
  VkCommandBufferSubmitInfo buffer{VK_STRUCTURE_TYPE_COMMAND_BUFFER_SUBMIT_INFO};
  buffer.commandBuffer = commands;
  VkSubmitInfo2 submit{VK_STRUCTURE_TYPE_SUBMIT_INFO_2};
  submit.commandBufferInfoCount = 1;
  submit.pCommandBufferInfos = &buffer;
  if (stats.submit_ms == 0) first_submission = Clock::now();
  vulkan::check(vk.QueueSubmit2(device->queue(), 1, &submit, fence), "vkQueueSubmit2");
  commands = VK_NULL_HANDLE;
}

void Executor::State::wait_for(VkFence awaited) {
  const heddle_vulkan& vk = device->table();
  vulkan::check(vk.WaitForFences(vk.device, 1, &awaited, VK_TRUE, ~0ULL), "vkWaitForFences");
  ++stats.waits.waits;
}

void Executor::State::submit_and_wait() {
  submit();
  wait_for(fence);
  stats.submit_ms = milliseconds_since(first_submission);  // cpu stages between two submissions count
  const heddle_vulkan& vk = device->table();
  vulkan::check(vk.ResetFences(vk.device, 1, &fence), "vkResetFences");
}

void Executor::State::record_barriers(std::span<const Barrier> list) {
  std::vector<VkImageMemoryBarrier2> images;
  std::vector<VkBufferMemoryBarrier2> buffers;
  for (const Barrier& barrier : list) {
    const ResourceIndex first = resources[barrier.resource].root;
    ResourceState& state = resources[first];
    if (state.image) {
      VkImageMemoryBarrier2 image{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2};
      image.srcStageMask = barrier.source_stages;
      image.srcAccessMask = barrier.source_access;
      image.dstStageMask = barrier.target_stages;
      image.dstAccessMask = barrier.target_access;
      image.oldLayout = barrier.old_layout;
      image.newLayout = barrier.new_layout;
      image.srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
      image.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
      image.image = state.image.handle();
      image.subresourceRange = {aspect_of(graph.resources[first].format), 0, VK_REMAINING_MIP_LEVELS, 0,
                                VK_REMAINING_ARRAY_LAYERS};
      images.push_back(image);
      state.layout = barrier.new_layout;
    } else if (state.buffer) {
      VkBufferMemoryBarrier2 buffer{VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER_2};
      buffer.srcStageMask = barrier.source_stages;
      buffer.srcAccessMask = barrier.source_access;
      buffer.dstStageMask = barrier.target_stages;
      buffer.dstAccessMask = barrier.target_access;
      buffer.srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
      buffer.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
      buffer.buffer = state.buffer.handle();
      buffer.size = VK_WHOLE_SIZE;
      buffers.push_back(buffer);
    }
  }
  if (images.empty() && buffers.empty()) return;
  VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
  dependency.imageMemoryBarrierCount = static_cast<std::uint32_t>(images.size());
  dependency.pImageMemoryBarriers = images.data();
  dependency.bufferMemoryBarrierCount = static_cast<std::uint32_t>(buffers.size());
  dependency.pBufferMemoryBarriers = buffers.data();
  device->table().CmdPipelineBarrier2(commands, &dependency);
}

void Executor::State::clear_image(ResourceState& state, const Resource& resource, const std::array<double, 4>& value) {
  const heddle_vulkan& vk = device->table();
  VkImageMemoryBarrier2 barrier{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2};
  barrier.srcStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
  barrier.srcAccessMask = VK_ACCESS_2_MEMORY_WRITE_BIT;
  barrier.dstStageMask = VK_PIPELINE_STAGE_2_CLEAR_BIT | VK_PIPELINE_STAGE_2_COPY_BIT;
  barrier.dstAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT;
  barrier.newLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
  barrier.srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  barrier.image = state.image.handle();
  barrier.subresourceRange = {aspect_of(resource.format), 0, VK_REMAINING_MIP_LEVELS, 0, VK_REMAINING_ARRAY_LAYERS};
  VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
  dependency.imageMemoryBarrierCount = 1;
  dependency.pImageMemoryBarriers = &barrier;
  vk.CmdPipelineBarrier2(commands, &dependency);
  if (aspect_of(resource.format) == VK_IMAGE_ASPECT_DEPTH_BIT) {
    // A depth attachment knows no infinity; 0 is the far plane of reversed depth.
    const VkClearDepthStencilValue depth{0.0F, 0};
    vk.CmdClearDepthStencilImage(commands, state.image.handle(), VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, &depth, 1,
                                 &barrier.subresourceRange);
  } else if (vulkan::format_info(static_cast<VkFormat>(resource.format)).block_bytes != 0) {
    // Compressed images cannot be cleared; blocks of zeros are black.
    const std::vector<VkBufferImageCopy> regions = all_mips(resource);
    vulkan::Buffer zeros = device->make_buffer(bytes_of(regions, resource), VK_BUFFER_USAGE_TRANSFER_SRC_BIT, true);
    std::memset(zeros.data(), 0, zeros.size());
    device->note_host_write(zeros);
    vk.CmdCopyBufferToImage(commands, zeros.handle(), state.image.handle(), VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                            static_cast<std::uint32_t>(regions.size()), regions.data());
    frame_buffers.push_back(std::move(zeros));
  } else {
    VkClearColorValue color{};
    for (std::size_t i = 0; i < 4; ++i) color.float32[i] = static_cast<float>(value[i]);
    vk.CmdClearColorImage(commands, state.image.handle(), VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, &color, 1,
                          &barrier.subresourceRange);
  }
  state.layout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
}

void Executor::State::set_value(ResourceIndex resource, std::span<const std::byte> bytes) {
  // A value may be written once more within a frame only before anything recorded reads it; the device sees the last.
  Value& value = resources[resource].value;
  value.bytes.assign(bytes.begin(), bytes.end());
  value.is_set = value.is_uniform_new = value.is_storage_new = true;
}

namespace {

void grow(Executor::State& state, vulkan::Buffer& buffer, std::uint64_t size, VkBufferUsageFlags usage) {
  if (buffer && buffer.size() >= size && state.in_flight.empty()) return;
  if (buffer)
    state.frame_buffers.push_back(std::move(buffer));  // commands of this frame or of one in flight may read it
  // Room to grow for what is small; images, such as those of lights, come as they are.
  constexpr std::uint64_t kSmall = std::uint64_t{1} << 20U;
  buffer = state.device->make_buffer(std::max<std::uint64_t>(size < kSmall ? size * 2 : size, 1024), usage, true);
}

}  // namespace

VkDescriptorBufferInfo Executor::State::uniform_of(Value& value) {
  if (value.is_uniform_new) {
    const std::uint64_t size = std::max<std::uint64_t>(value.bytes.size(), value.block_bytes);
    grow(*this, value.uniform, size, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    std::memset(value.uniform.data(), 0, size);
    if (!value.bytes.empty()) std::memcpy(value.uniform.data(), value.bytes.data(), value.bytes.size());
    device->note_host_write(value.uniform);
    value.is_uniform_new = false;
  }
  return {value.uniform.handle(), 0, VK_WHOLE_SIZE};
}

VkDescriptorBufferInfo Executor::State::storage_of(Value& value) {
  if (value.is_storage_new) {
    grow(*this, value.storage, value.bytes.size() + 16, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    std::memset(value.storage.data(), 0, 16);
    if (!value.bytes.empty()) std::memcpy(value.storage.data() + 16, value.bytes.data(), value.bytes.size());
    device->note_host_write(value.storage);
    value.is_storage_new = false;
  }
  return {value.storage.handle(), 0, value.bytes.size() + 16};
}

/// Components as shaders see them; made anew when a component changed, or for another scene.
void Executor::State::set_component_values(const scene::Scene& rendered) {
  const std::uint64_t component_revision = scene::component_revision(rendered);
  for (ResourceIndex i = 0; i < graph.resources.size(); ++i) {
    const Resource& resource = graph.resources[i];
    const bool is_scene = resource.producer == kNoIndex && resource.history_of == kNoIndex;
    if (!is_scene || resource.type != PortType::kValue) continue;
    const auto component = services.registry.components().find_port(resource.port);
    if (!component) continue;
    Value& value = resources[i].value;
    if (value.is_set && value.revision == component_revision) continue;
    set_value(i, scene::component_elements(rendered.components, *component->type, component->owner));
    value.revision = component_revision;
  }
}

void Executor::State::set_scene_values(const scene::Scene& rendered) {
  HeddleView view{};
  if (!graph.is_job) {  // a job has no camera, and its origin is the middle of the scene
    const heddle_camera camera = rendered.active_camera(graph.width, graph.height);
    previous_origin = origin;
    origin = {camera.position[0], camera.position[1], camera.position[2]};
    tell_of_near_plane(rendered, camera);
    view = scene::make_view(camera, graph.width, graph.height, origin,
                            info.cut != 0 || !previous_camera ? nullptr : &*previous_camera);
    previous_camera = camera;
  }
  const std::vector<HeddleLight> lights = scene::SceneBuffers::lights(rendered, origin);
  for (ResourceIndex i = 0; i < graph.resources.size(); ++i) {
    const Resource& resource = graph.resources[i];
    const bool is_scene = resource.producer == kNoIndex && resource.history_of == kNoIndex;
    if (!is_scene || resource.type != PortType::kValue) continue;
    const auto part = find_scene_part(resource.port);
    if (!part) continue;  // a component
    switch (*part) {
      case ScenePart::kCamera:
        set_value(i, std::as_bytes(std::span(&view, 1)));
        break;
      case ScenePart::kEnvironment:
        set_environment(i, rendered);
        break;
      case ScenePart::kLightTextures:
        set_light_textures(i, rendered);
        break;
      case ScenePart::kLights:
        set_value(i, std::as_bytes(std::span(lights)));
        break;
      case ScenePart::kSurfaces:
        break;  // no value
    }
  }
  set_component_values(rendered);
  if (!scene_buffers || scene != &rendered) {
    wait_for_frames();
    scene_buffers = std::make_unique<scene::SceneBuffers>(*device, materials_layout);
    scene = &rendered;
  }
  if (scene_buffers->update_remakes(rendered)) wait_for_frames();
  scene_buffers->update(rendered, origin,
                        [this](const vulkan::Buffer& target, std::uint64_t offset, std::span<const std::byte> bytes) {
                          upload_in_frame(target, offset, bytes);
                        });
  if (info.cut != 0) previous_origin = origin;
  for (std::size_t i = 0; i < 3; ++i) {
    info.origin[i] = origin[static_cast<glm::length_t>(i)];
    info.previous_origin[i] = previous_origin[static_cast<glm::length_t>(i)];
  }
}

/// A camera in other units than the scene sees nothing, and no pass would know why.
void Executor::State::tell_of_near_plane(const scene::Scene& rendered, const heddle_camera& camera) {
  const std::array<glm::dvec3, 2>& box = rendered.reach();
  const double farthest = glm::length(glm::max(glm::abs(box[0] - origin), glm::abs(box[1] - origin)));
  const bool is_beyond = box[0] != box[1] && camera.near_distance > farthest;
  if (is_beyond && told_near != camera.near_distance) {
    Diagnostic diagnostic;
    diagnostic.severity = Severity::kWarning;
    diagnostic.message = fmt::format(
        "nothing of the scene can be seen: the camera's near plane, at {:.3g} m, is farther than all of it ({:.3g} m)",
        camera.near_distance, farthest);
    diagnostic.help = "leave near_distance 0: it then follows from the scene's size";
    services.log(Severity::kWarning, to_text(diagnostic));
  }
  told_near = is_beyond ? camera.near_distance : 0;
}

void Executor::State::set_environment(ResourceIndex resource, const scene::Scene& rendered) {
  const HeddleEnvironment none{};
  const HeddleEnvironment& record = rendered.environment ? rendered.environment->record : none;
  Value& value = resources[resource].value;
  // The texels are megabytes: copied only when they are others.
  if (value.is_set && record.revision != 0 &&
      reinterpret_cast<const HeddleEnvironment*>(value.bytes.data())->revision == record.revision) {
    if (std::memcmp(value.bytes.data(), &record, sizeof record) == 0) return;
    std::memcpy(value.bytes.data(), &record, sizeof record);
    value.is_uniform_new = value.is_storage_new = true;
    return;
  }
  set_value(resource, std::as_bytes(std::span(&record, 1)));
  if (!rendered.environment) return;
  const auto texels = std::as_bytes(std::span(rendered.environment->texels));
  value.bytes.insert(value.bytes.end(), texels.begin(), texels.end());
}

/// Megabytes too: made anew only when a light has another texture.
void Executor::State::set_light_textures(ResourceIndex resource, const scene::Scene& rendered) {
  const std::vector<const scene::LightTexture*> textures = scene::light_textures(rendered);
  std::vector<std::uint64_t> revisions;
  for (const scene::LightTexture* texture : textures) revisions.push_back(texture->revision);
  Value& value = resources[resource].value;
  if (value.is_set && revisions == light_texture_revisions) return;
  const std::vector<std::byte> elements = scene::light_texture_elements(textures);
  if (elements.size() + 16 > device->limits().maxStorageBufferRange) {
    throw Error(HEDDLE_UNSUPPORTED,
                fmt::format("the textures of {} lights have {} bytes with their levels, and shaders of this device "
                            "reach {} at once",
                            textures.size(), elements.size(), device->limits().maxStorageBufferRange - 16),
                "smaller or fewer textures");
  }
  set_value(resource, elements);
  light_texture_revisions = revisions;
}

std::uint32_t Executor::State::add_view(const HeddleView& view) {
  // 512 bytes apart: a multiple of every device's minUniformBufferOffsetAlignment (at most 256) that holds a view.
  constexpr std::uint32_t kStride = 512;
  static_assert(sizeof(HeddleView) <= kStride);
  if (!views || (view_count + 1) * std::uint64_t{kStride} > views.size()) {
    const std::uint64_t size = std::max<std::uint64_t>(views ? views.size() * 2 : 0, 256 * std::uint64_t{kStride});
    if (views) frame_buffers.push_back(std::move(views));
    views = device->make_buffer(size, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT, true);
    view_count = 0;
    program_sets.clear();
  }
  const std::uint32_t offset = view_count * kStride;
  std::memcpy(views.data() + offset, &view, sizeof view);
  device->note_host_write(views, offset, sizeof view);
  ++view_count;
  return offset;
}

/// Set 3 of a drawing from these buffers; made once for a submission's views. `own`: the technique's program, which has
/// no vertices; nullptr: that of meshes.
VkDescriptorSet Executor::State::make_program_set(const ProgramState* own, VkBuffer vertices, VkBuffer instances) {
  VkDescriptorSet& set = program_sets[{own, vertices, instances}];
  if (set != VK_NULL_HANDLE) return set;
  const heddle_vulkan& vk = device->table();
  set = allocate_set(own == nullptr ? program_layout : own->layout);
  const std::array<VkDescriptorBufferInfo, 4> buffers{{{vertices, 0, VK_WHOLE_SIZE},
                                                       {instances, 0, VK_WHOLE_SIZE},
                                                       {scene_buffers->materials().handle(), 0, VK_WHOLE_SIZE},
                                                       {views.handle(), 0, sizeof(HeddleView)}}};
  std::vector<VkWriteDescriptorSet> writes;
  for (std::uint32_t i = own == nullptr ? 0 : 1; i < buffers.size(); ++i) {
    VkWriteDescriptorSet write{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET};
    write.dstSet = set;
    write.dstBinding = i;
    write.descriptorCount = 1;
    write.descriptorType = i == 3 ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    write.pBufferInfo = &buffers[i];
    writes.push_back(write);
  }
  vk.UpdateDescriptorSets(vk.device, static_cast<std::uint32_t>(writes.size()), writes.data(), 0, nullptr);
  if (own != nullptr) fill_set(set, graph.passes[own->pass], own->compiled.bindings, own->owners, vulkan::kProgramSet);
  return set;
}

Executor::State::DrawRange Executor::State::draw_range(const scene::DrawGroup& group,
                                                       const scene::VisibleDraws& visible, VkBuffer own) {
  constexpr std::uint64_t kStride = sizeof(VkDrawIndexedIndirectCommand);
  stats.instances_drawn += visible.drawn;
  stats.instances_culled += visible.culled;
  if (visible.drawn == 0) return {};
  if (own != VK_NULL_HANDLE && visible.drawn == group.instance_count) {
    return {own, group.first_command * kStride, group.command_count};
  }
  const std::uint64_t bytes = visible.commands.size() * kStride;
  if (!draw_commands || draw_command_bytes + bytes > draw_commands.size()) {
    const std::uint64_t size = std::max<std::uint64_t>({draw_commands ? draw_commands.size() * 2 : 0, bytes, 4096});
    if (draw_commands) frame_buffers.push_back(std::move(draw_commands));  // what was recorded reads it
    draw_commands = device->make_buffer(size, VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT, true);
    draw_command_bytes = 0;
  }
  const std::uint64_t offset = draw_command_bytes;
  std::memcpy(draw_commands.data() + offset, visible.commands.data(), bytes);
  device->note_host_write(draw_commands, offset, bytes);
  device->count_upload(bytes);
  draw_command_bytes += bytes;
  return {draw_commands.handle(), offset, static_cast<std::uint32_t>(visible.commands.size())};
}

void Executor::State::write_neutral(PassState& state, const ScheduledStage& stage) {
  const Pass& pass = pass_of(state);
  const Stage& declared = technique_of(state).stages[stage.stage];
  for (const Access& access : declared.accesses) {
    const auto found = pass.ports.find(access.port);
    if (found == pass.ports.end()) continue;
    ResourceState& target = root(found->second);
    if (access.access == HEDDLE_ACCESS_BATCHES) {
      set_batches(found->second, {}, 0);
      continue;
    }
    if (!target.image) {
      const bool is_written = target.buffer && access_info(access.access, PortType::kBuffer, 0).writes;
      if (is_written && device->recorder() != nullptr) device->recorder()->accept(target.buffer.handle());
      continue;
    }
    const AccessInfo use = access_info(access.access, PortType::kImage, graph.resources[found->second].format);
    if (!use.writes) continue;
    const RolePort* port = pass.role->find_port(access.port);
    const VkImageLayout layout = target.layout;
    const std::array<double, 4> neutral = port != nullptr ? port->neutral : std::array<double, 4>{};
    clear_image(target, graph.resources[target.root], neutral);
    const bool is_depth = aspect_of(graph.resources[target.root].format) == VK_IMAGE_ASPECT_DEPTH_BIT;
    target.uniform_value = is_depth ? std::array<double, 4>{} : neutral;  // as clear_image has it
    Barrier back;
    back.resource = found->second;
    back.source_stages = VK_PIPELINE_STAGE_2_CLEAR_BIT;
    back.source_access = VK_ACCESS_2_TRANSFER_WRITE_BIT;
    back.target_stages = use.stages;
    back.target_access = use.access;
    back.old_layout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
    back.new_layout = layout;
    record_barriers({&back, 1});
  }
}

namespace {

std::uint64_t level_bytes(const Resource& resource, const VkExtent3D& extent) {
  return vulkan::image_bytes(static_cast<VkFormat>(resource.format), extent.width, extent.height);
}

}  // namespace

std::vector<VkBufferImageCopy> all_mips(const Resource& resource) {
  std::vector<VkBufferImageCopy> regions;
  std::uint64_t offset = 0;
  const std::uint32_t layers = std::max(resource.layers, 1U);
  for (std::uint32_t mip = 0; mip < std::max(resource.mips, 1U); ++mip) {
    VkBufferImageCopy region{};
    region.bufferOffset = offset;
    region.imageSubresource = {aspect_of(resource.format), mip, 0, layers};
    region.imageExtent = {std::max(resource.width >> mip, 1U), std::max(resource.height >> mip, 1U), 1};
    offset += level_bytes(resource, region.imageExtent) * layers;
    regions.push_back(region);
  }
  return regions;
}

std::uint64_t bytes_of(const std::vector<VkBufferImageCopy>& regions, const Resource& resource) {
  const VkBufferImageCopy& last = regions.back();
  return last.bufferOffset + level_bytes(resource, last.imageExtent) * last.imageSubresource.layerCount;
}

void Executor::State::run_cpu_stage(PassState& state, const ScheduledStage& scheduled, heddle_frame& frame) {
  const Pass& pass = pass_of(state);
  const Stage& declared = technique_of(state).stages[scheduled.stage];
  const heddle_vulkan& vk = device->table();
  bool reads_device = false;
  // Host memory for every image and buffer that the stage touches; what it reads is copied before it runs.
  for (const Access& access : declared.accesses) {
    if (access.access != HEDDLE_ACCESS_HOST_READ && access.access != HEDDLE_ACCESS_HOST_WRITE) continue;
    const auto found = pass.ports.find(access.port);
    if (found == pass.ports.end()) continue;
    ResourceState& target = root(found->second);
    if (access.access == HEDDLE_ACCESS_HOST_READ && graph.resources[found->second].type == PortType::kSurfaces) {
      reads_device = copy_contents(found->second, frame) || reads_device;
      continue;
    }
    if (!target.image && !target.buffer) continue;
    const Resource& resource = graph.resources[target.root];
    if (declared.is_late(access, resource.type)) {
      frame.mappings.push_back(late_mapping(scheduled, access.port));
      continue;
    }
    heddle_frame::Mapping mapping;
    mapping.port = access.port;
    mapping.is_written = access.access == HEDDLE_ACCESS_HOST_WRITE;
    mapping.frame = info.index;
    mapping.staging = device->make_buffer(host_bytes(found->second),
                                          VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
    if (!mapping.is_written) {
      reads_device = true;
      copy_to_host(found->second, mapping.staging);
    }
    frame.mappings.push_back(std::move(mapping));
  }
  if (reads_device) {
    show_copies_to_host(vk, commands);
    submit_and_wait();
    begin_commands();
    ++stats.stalls;
  }
  for (const heddle_frame::Mapping& mapping : frame.mappings) {
    if (mapping.late != nullptr) continue;  // late_mapping told of it
    if (mapping.is_written && variant.poison)
      std::fill_n(reinterpret_cast<std::uint32_t*>(mapping.staging.data()), mapping.staging.size() / 4,
                  *variant.poison);
    if (mapping.is_written)
      device->note_host_write(mapping.staging);
    else
      device->note_host_read(mapping.staging);
  }
  for (const heddle_frame::Contents& contents : frame.contents)
    for (const vulkan::Buffer& copy : contents.copies)
      if (copy) device->note_host_read(copy);
  execute_stage(state, scheduled, frame);
  for (heddle_frame::Mapping& mapping : frame.mappings) {
    if (mapping.is_written) {
      const ResourceIndex written = pass.ports.find(mapping.port)->second;
      ResourceState& target = root(written);
      const Resource& resource = graph.resources[target.root];
      if (target.image) {
        const std::vector<VkBufferImageCopy> regions = all_mips(resource);
        vk.CmdCopyBufferToImage(commands, mapping.staging.handle(), target.image.handle(), target.layout,
                                static_cast<std::uint32_t>(regions.size()), regions.data());
      } else {
        const VkBufferCopy region{0, 0, mapping.staging.size()};
        vk.CmdCopyBuffer(commands, mapping.staging.handle(), target.buffer.handle(), 1, &region);
      }
      device->count_upload(mapping.staging.size());
    }
    frame_buffers.push_back(std::move(mapping.staging));
  }
}

void Executor::State::run_stage(std::uint32_t index, std::span<const Barrier> before) {
  const ScheduledStage& scheduled = order.stages[index];
  label_commands(&scheduled);
  if (scheduled.is_read_back) {
    record_barriers(before);
    run_read_back(scheduled);
    return;
  }
  PassState& state = *passes[scheduled.pass];
  heddle_frame frame;
  frame.stage = &scheduled;
  const std::uint32_t activity =
      state.descriptor->activity != nullptr
          ? state.descriptor->activity(state.object, &state.api, scheduled.stage, &frame, &info)
          : HEDDLE_RUN;
  throw_if_failed(state, HEDDLE_OK, "activity");
  record_barriers(before);
  const bool is_up_to_date = is_outdated.empty() || is_outdated[scheduled.pass] == 0;
  const bool keeps = activity == HEDDLE_KEEP && is_up_to_date;
  begin_lists(index, keeps ? HEDDLE_KEEP : activity);
  if (keeps) {
    keep_outputs(scheduled);
    return;
  }
  if (activity == HEDDLE_NOTHING) {
    write_neutral(state, scheduled);
    return;
  }
  const std::uint64_t writes_before = writes_recorded;
  if (scheduled.kind == StageKind::kCpu) {
    run_cpu_stage(state, scheduled, frame);
    note_contents(scheduled, frame, writes_before);
    return;
  }
  frame.commands = commands;
  const bool is_lasting = graph.is_job && keeps_artifacts() && makes_what_lasts(technique_of(state));
  run_slices(state, scheduled, frame, info_for(pass_of(state)), is_lasting ? pass_keys[scheduled.pass] : std::string{});
  note_contents(scheduled, frame, writes_before);
}

void Executor::State::run_frame(const scene::Scene& rendered, const FrameOptions& options) {
  const auto start = Clock::now();
  begin_frame_memory();
  stats.instances_drawn = stats.instances_culled = 0;
  drawn_layers.clear();
  for (ResourceState& state : resources) state.uniform_value.reset();
  looks.clear();
  errors.clear();
  stats.stages.clear();
  stats.submit_ms = 0;
  stats.stalls = 0;
  stats.before = device->counters();
  info.struct_size = sizeof info;
  info.cut = options.cut || is_fresh ? 1U : 0U;
  info.is_still = !graph.is_job && is_still(rendered, options) ? 1U : 0U;
  info.index = frame_index;
  info.time = options.time;
  info.time_step = options.time_step;
  info.seed = options.seed;
  begin_checked_frame();
  if (find_iterations()) {
    if (is_continuing) info.time_step = 0;
    begin_commands();
    order_after_frames_in_flight();
    turn_histories();
    name_resources();
    set_scene_values(rendered);
    count_slots.clear();
    stats.counts.clear();
    run_stages(options.profile);
    stop_if_cancelled();
    label_commands(nullptr);
    record_barriers(barriers.at_end);
    publish_counts();
    submitted_frame = info.index;
    if (services.is_live && !graph.is_job) {
      submit();
      in_flight.push_back(std::move(static_cast<FrameMemory&>(*this)));
      static_cast<FrameMemory&>(*this) = {};
    } else {
      submit_and_wait();
      tell_counts(*this);
      frame_buffers.clear();
    }
    ++frame_index;
  }
  stats.total_waits.waits += stats.waits.waits;
  stats.total_waits.late_reads += stats.waits.late_reads;
  stats.total_waits.stale_reads += stats.waits.stale_reads;
  stats.after = device->counters();
  stats.wall_ms = milliseconds_since(start);
  ++stats.frame;
  is_fresh = false;
  has_frame = true;
  is_outdated.clear();
  throw_what_the_check_found();
  const std::vector<std::string> complaints = device->take_validation_errors();
  if (!complaints.empty()) {
    std::vector<Diagnostic> all;
    for (const std::string& complaint : complaints) {
      Diagnostic diagnostic;
      diagnostic.where.file = graph.file;
      diagnostic.message = "the validation layer found: " + complaint;
      all.push_back(std::move(diagnostic));
    }
    throw Error(HEDDLE_BUG, std::move(all));
  }
}

void Executor::render(const scene::Scene& rendered, const FrameOptions& options) {
  State& s = *state_;
  // Nothing of a failed frame may reach the next: its plan, values and recorded commands go.
  try {
    s.planned_scene = &rendered;
    const bool has_new_artifacts = s.run_jobs(rendered);
    if (has_new_artifacts || !s.is_planned || !s.is_planned_for(rendered)) s.plan(rendered);
    s.note_content(rendered);
    s.stats.waits = {};
    s.take_frame_memory();
    if (s.is_redeclare_due()) s.redeclare();
    s.planned_scene = nullptr;
    s.run_frame(rendered, options);
  } catch (...) {
    s.planned_scene = nullptr;
    s.commands = VK_NULL_HANDLE;
    s.previous_camera.reset();
    if (s.scene_buffers) s.scene_buffers->forget();  // what this frame was to upload was not
    s.unplan();
    throw;
  }
}

Executor::ReadBack Executor::read(std::string_view name, std::uint32_t layer, std::uint32_t mip) {
  ReadBack result = read_into(name, layer, mip, std::nullopt);
  std::vector<float> pixels(std::size_t{result.width} * result.height * result.channels);
  (void)read_into(name, layer, mip, pixels);
  result.pixels = std::move(pixels);
  return result;
}

/// An image of the last frame, once it is there.
const ResourceState& Executor::State::readable(std::string_view name, std::uint32_t layer, std::uint32_t mip) {
  const ResourceIndex resource = name.empty() ? graph.output : find_resource(graph, name);
  wait_for_frames();
  if (!is_planned || !has_frame) {
    throw Error(HEDDLE_BAD_INPUT,
                stats.frame == 0 ? "nothing was rendered yet" : "nothing was rendered since the graph changed",
                "render a frame before reading a port");
  }
  if (std::find(wanted.begin(), wanted.end(), resource) == wanted.end()) {
    throw Error(HEDDLE_BAD_INPUT,
                fmt::format("port '{}' was not kept: its memory may hold something else by now", name),
                "keep it (heddle_graph_keep, Graph.keep in Python) before the frame");
  }
  const ResourceState& state = resources[resources[resource].root];
  if (!state.image) throw Error(HEDDLE_BAD_INPUT, fmt::format("port '{}' is not an image that a pass made", name));
  const vulkan::ImageShape& shape = state.image.shape();
  if (layer >= shape.layers || mip >= shape.mips) {
    throw Error(HEDDLE_BAD_INPUT, fmt::format("port '{}' has {} layers and {} mips; layer {}, mip {} were asked for",
                                              name, shape.layers, shape.mips, layer, mip));
  }
  return state;
}

Executor::ReadBack Executor::read_into(std::string_view name, std::uint32_t layer, std::uint32_t mip,
                                       std::optional<std::span<float>> pixels) {
  State& s = *state_;
  const ResourceState& state = s.readable(name, layer, mip);
  const vulkan::ImageShape& shape = state.image.shape();
  ReadBack result;
  result.width = std::max(shape.width >> mip, 1U);
  result.height = std::max(shape.height >> mip, 1U);
  result.channels = vulkan::format_info(shape.format).channels;
  if (!pixels) return result;
  const std::size_t count = std::size_t{result.width} * result.height * result.channels;
  if (pixels->size() < count) {
    const ResourceIndex resource = name.empty() ? s.graph.output : find_resource(s.graph, name);
    throw Error(HEDDLE_BAD_INPUT, fmt::format("port '{}' has {} x {} x {} = {} numbers; there is room for {}",
                                              s.graph.resources[resource].name, result.width, result.height,
                                              result.channels, count, pixels->size()));
  }
  s.device->read_back(state.image, layer, mip, state.layout, [&](std::span<const std::byte> texels) {
    vulkan::to_float(texels, shape.format, pixels->first(count));
  });
  return result;
}

Executor::Texels Executor::read_texels(std::string_view name, std::uint32_t layer, std::uint32_t mip,
                                       std::optional<std::span<std::byte>> bytes) {
  State& s = *state_;
  const ResourceState& state = s.readable(name, layer, mip);
  const vulkan::ImageShape& shape = state.image.shape();
  Texels result;
  result.width = std::max(shape.width >> mip, 1U);
  result.height = std::max(shape.height >> mip, 1U);
  result.texel_bytes = vulkan::format_info(shape.format).texel_bytes;
  result.size = vulkan::image_bytes(shape.format, result.width, result.height);
  result.format = shape.format;
  if (!bytes) return result;
  if (bytes->size() < result.size) {
    const ResourceIndex resource = name.empty() ? s.graph.output : find_resource(s.graph, name);
    throw Error(HEDDLE_BAD_INPUT,
                fmt::format("port '{}' has {} x {} texels in {} bytes; there is room for {}",
                            s.graph.resources[resource].name, result.width, result.height, result.size, bytes->size()));
  }
  s.device->read_back(state.image, layer, mip, state.layout,
                      [&](std::span<const std::byte> texels) { std::ranges::copy(texels, bytes->begin()); });
  return result;
}

}  // namespace heddle::graph
