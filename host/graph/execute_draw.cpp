// SPDX-License-Identifier: Apache-2.0
// One drawing of surfaces -> draw commands: merged by state, or sorted by depth for blending.

#include "graph/execute_state.hpp"
#include "scene/draw_order.hpp"

#include <cstring>

namespace heddle::graph {

namespace {

/// Binds what draws of a group need; what is bound already stays.
class GroupBinder {
 public:
  GroupBinder(Executor::State& executor, const PassState& pass, const ShaderState& shader, const heddle_draw& wanted,
              std::uint32_t view_offset)
      : executor_(executor), pass_(pass), shader_(shader), wanted_(wanted), view_offset_(view_offset) {}

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
      vk.CmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout(), 3, 1,
                               &executor_.program_set, 1, &view_offset_);
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
  const vulkan::Pipeline* pipeline_ = nullptr;
  const scene::DrawGroup* group_ = nullptr;
};

}  // namespace

void Executor::State::draw_surfaces(const PassState& pass, const ShaderState& shader, const heddle_draw& drawing,
                                    const HeddleView& view) {
  const heddle_vulkan& vk = device->table();
  const scene::SceneBuffers& buffers = *scene_buffers;
  std::vector<const scene::DrawGroup*> groups;
  for (const scene::DrawGroup& group : buffers.groups()) {
    const bool is_included = drawing.include == 0 || (group.flags & drawing.include) != 0;
    if (is_included && (group.flags & drawing.require) == drawing.require && group.command_count > 0)
      groups.push_back(&group);
  }
  if (groups.empty()) return;
  GroupBinder binder(*this, pass, shader, drawing, add_view(view));
  const scene::Frustum frustum(view);
  if (drawing.order == HEDDLE_ORDER_STATE) {
    vk.CmdBindIndexBuffer(commands, buffers.indices().handle(), 0, VK_INDEX_TYPE_UINT32);
    for (const scene::DrawGroup* group : groups) {
      const DrawRange range = draw_range(*group, frustum);
      if (range.count == 0) continue;
      binder.bind(*group);
      vk.CmdDrawIndexedIndirect(commands, range.buffer, range.offset, range.count,
                                sizeof(VkDrawIndexedIndirectCommand));
    }
    return;
  }
  const bool sorts_triangles = drawing.order == HEDDLE_ORDER_TRIANGLES_BACK_TO_FRONT;
  const scene::OrderedDraws ordered = scene::order_back_to_front(*scene, buffers, groups, view, origin, sorts_triangles,
                                                                 variant.culls ? &frustum : nullptr);
  stats.instances_drawn += ordered.drawn;
  stats.instances_culled += ordered.culled;
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
