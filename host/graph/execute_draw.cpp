// SPDX-License-Identifier: Apache-2.0
// One drawing of surfaces -> draw commands: merged by state, or sorted by depth for blending; and the number that says
// what it would show.

#include "graph/execute_state.hpp"
#include "scene/draw_order.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace heddle::graph {

namespace {

/// Binds what draws of a group need; what is bound already stays.
class GroupBinder {
 public:
  GroupBinder(Executor::State& executor, const PassState& pass, const ShaderState& shader, const heddle_draw& wanted,
              std::uint32_t view_offset, VkDescriptorSet program_set)
      : executor_(executor),
        pass_(pass),
        shader_(shader),
        wanted_(wanted),
        view_offset_(view_offset),
        program_set_(program_set) {}

  void bind(const scene::DrawGroup& group) {
    if (&group == group_) return;
    group_ = &group;
    const heddle_vulkan& vk = executor_.device->table();
    VkCommandBuffer commands = executor_.commands;
    const bool is_depth_only = shader_.shader->file.empty();
    const bool is_masked = (group.flags & HEDDLE_SURFACE_MASKED) != 0;
    const vulkan::Pipeline& pipeline = is_depth_only && is_masked ? shader_.masked : shader_.pipeline;
    if (pipeline_ != &pipeline) {
      executor_.bind(pass_, shader_, pipeline, wanted_.push, wanted_.push_bytes);
      vk.CmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout(), 3, 1, &program_set_, 1,
                               &view_offset_);
      pipeline_ = &pipeline;
    }
    const VkDescriptorSet material_set = executor_.scene_buffers->material_set(group.texture_group);
    vk.CmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout(), 2, 1, &material_set, 0,
                             nullptr);
    // Depth alone is drawn from both sides unless the technique asks otherwise: what is thin or open still casts.
    const bool is_two_sided =
        (is_depth_only && wanted_.cull == HEDDLE_CULL_DEFAULT) || (group.flags & HEDDLE_SURFACE_DOUBLE_SIDED) != 0;
    vk.CmdSetCullMode(commands, is_two_sided ? VK_CULL_MODE_NONE : VK_CULL_MODE_BACK_BIT);
    vk.CmdSetFrontFace(commands, group.is_flipped ? VK_FRONT_FACE_CLOCKWISE : VK_FRONT_FACE_COUNTER_CLOCKWISE);
  }

 private:
  Executor::State& executor_;
  const PassState& pass_;
  const ShaderState& shader_;
  const heddle_draw& wanted_;
  std::uint32_t view_offset_;
  VkDescriptorSet program_set_;
  const vulkan::Pipeline* pipeline_ = nullptr;
  const scene::DrawGroup* group_ = nullptr;
};

/// What of the scene a drawing asks for.
std::vector<const scene::DrawGroup*> wanted_groups(const scene::SceneBuffers& buffers, const heddle_draw& wanted) {
  std::vector<const scene::DrawGroup*> groups;
  for (const scene::DrawGroup& group : buffers.groups()) {
    const bool is_included = wanted.include == 0 || (group.flags & wanted.include) != 0;
    if (is_included && (group.flags & wanted.require) == wanted.require && group.command_count > 0)
      groups.push_back(&group);
  }
  return groups;
}

/// The boxes of instances are relative to the frame's origin.
scene::Frustum frustum_of(const Executor::State::Drawing& drawing, const glm::dvec3& frame_origin) {
  return scene::Frustum(drawing.view, drawing.origin == nullptr ? glm::dvec3(0.0) : frame_origin - *drawing.origin);
}

}  // namespace

Executor::State::Placing& Executor::State::placing_at(const glm::dvec3& at) {
  auto found = std::ranges::find(placings, at, &Placing::origin);
  if (found == placings.end()) {
    const std::uint64_t bytes = scene_buffers->order().size() * sizeof(HeddleInstance);
    if (placings.size() == placed_instances.size()) placed_instances.emplace_back();
    vulkan::Buffer& buffer = placed_instances[placings.size()];
    if (!buffer || buffer.size() < bytes)
      buffer = device->make_buffer(std::max<std::uint64_t>(bytes, 16), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, true);
    Placing made;
    made.origin = at;
    made.instances = &buffer;
    made.is_there.resize(scene_buffers->order().size());
    placings.push_back(std::move(made));
    found = std::prev(placings.end());
  }
  if (found->views != views.handle()) {
    found->set = make_program_set(*found->instances);
    found->views = views.handle();
  }
  return *found;
}

void Executor::State::place(Placing& placing, std::span<const VkDrawIndexedIndirectCommand> drawn) {
  for (const VkDrawIndexedIndirectCommand& command : drawn) {
    for (std::uint32_t i = command.firstInstance; i < command.firstInstance + command.instanceCount; ++i) {
      if (placing.is_there[i] != 0) continue;
      placing.is_there[i] = 1;
      const HeddleInstance record = scene_buffers->placed(*scene, i, placing.origin);
      const std::uint64_t offset = i * sizeof record;
      std::memcpy(placing.instances->data() + offset, &record, sizeof record);
      device->note_host_write(*placing.instances, offset, sizeof record);
      device->count_upload(sizeof record);
    }
  }
}

scene::Look Executor::State::look_of(const Drawing& drawing) const {
  scene::Look look;
  look.add(scene->content_revision);
  std::array<std::uint32_t, sizeof(HeddleView) / 4> words{};
  std::memcpy(words.data(), &drawing.view, sizeof drawing.view);
  for (const std::uint32_t word : words) look.add(word);
  const heddle_draw& asked = drawing.wanted;
  for (const std::uint32_t word : {asked.include, asked.require, asked.layer, asked.x, asked.y, asked.width,
                                   asked.height, asked.order, asked.cull})
    look.add(word);
  const glm::dvec3 at = drawing.origin == nullptr ? origin : *drawing.origin;
  for (int i = 0; i < 3; ++i) look.add(std::bit_cast<std::uint64_t>(at[i]));
  const scene::Frustum frustum = frustum_of(drawing, origin);
  const std::span<const scene::Look> instance_looks = scene_buffers->looks();
  for (const scene::DrawGroup* group : wanted_groups(*scene_buffers, asked))
    for (const VkDrawIndexedIndirectCommand& command : scene_buffers->visible(*group, frustum).commands)
      for (std::uint32_t i = 0; i < command.instanceCount; ++i) look.add(instance_looks[command.firstInstance + i]);
  return look;
}

void Executor::State::draw_surfaces(const PassState& pass, const ShaderState& shader, const Drawing& drawing) {
  const heddle_vulkan& vk = device->table();
  const scene::SceneBuffers& buffers = *scene_buffers;
  const heddle_draw& asked = drawing.wanted;
  const std::vector<const scene::DrawGroup*> groups = wanted_groups(buffers, asked);
  if (groups.empty()) return;
  const std::uint32_t view_offset = add_view(drawing.view);
  Placing* placing = drawing.origin == nullptr ? nullptr : &placing_at(*drawing.origin);
  GroupBinder binder(*this, pass, shader, asked, view_offset, placing == nullptr ? program_set : placing->set);
  if (asked.order == HEDDLE_ORDER_STATE) {
    const scene::Frustum frustum = frustum_of(drawing, origin);
    vk.CmdBindIndexBuffer(commands, buffers.indices().handle(), 0, VK_INDEX_TYPE_UINT32);
    for (const scene::DrawGroup* group : groups) {
      const DrawRange range = draw_range(*group, frustum, placing);
      if (range.count == 0) continue;
      binder.bind(*group);
      vk.CmdDrawIndexedIndirect(commands, range.buffer, range.offset, range.count,
                                sizeof(VkDrawIndexedIndirectCommand));
    }
    return;
  }
  const scene::OrderedDraws ordered = scene::order_back_to_front(*scene, buffers, groups, drawing.view, origin,
                                                                 asked.order == HEDDLE_ORDER_TRIANGLES_BACK_TO_FRONT);
  VkBuffer indices = buffers.indices().handle();
  if (!ordered.indices.empty()) {
    const std::size_t bytes = ordered.indices.size() * sizeof(std::uint32_t);
    frame_buffers.push_back(device->make_buffer(bytes, VK_BUFFER_USAGE_INDEX_BUFFER_BIT, true));
    std::memcpy(frame_buffers.back().data(), ordered.indices.data(), bytes);
    device->note_host_write(frame_buffers.back());
    device->count_upload(bytes);
    indices = frame_buffers.back().handle();
  }
  vk.CmdBindIndexBuffer(commands, indices, 0, VK_INDEX_TYPE_UINT32);
  for (const scene::OrderedDraw& draw : ordered.draws) {
    binder.bind(*draw.group);
    vk.CmdDrawIndexed(commands, draw.index_count, draw.instance_count, draw.first_index, draw.vertex_offset,
                      draw.first_instance);
  }
}

}  // namespace heddle::graph
