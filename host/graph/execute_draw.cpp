// SPDX-License-Identifier: Apache-2.0
// One drawing of surfaces -> draw commands: merged by state, or sorted by depth for blending.

#include "graph/execute_state.hpp"
#include "graph/uses.hpp"
#include "scene/draw_order.hpp"

#include <cstring>

namespace heddle::graph {

namespace {

/// What a drawing draws from: the scene's buffers, or a technique's with the instances of either.
struct Source {
  scene::DrawSource draws;
  VkBuffer vertices = VK_NULL_HANDLE, indices = VK_NULL_HANDLE, instances = VK_NULL_HANDLE;
  VkBuffer commands = VK_NULL_HANDLE;     // of the list, on the device
  ResourceIndex own_commands = kNoIndex;  // the technique's: it places
};

/// Binds what draws of a group need; what is bound already stays.
class GroupBinder {
 public:
  GroupBinder(Executor::State& executor, const PassState& pass, const ShaderState& shader, const heddle_draw& wanted,
              std::uint32_t view_offset)
      : executor_(executor), pass_(pass), shader_(shader), wanted_(wanted), view_offset_(view_offset) {}

  void bind(const Source& source, const scene::DrawGroup& group) {
    if (&group == group_) return;
    group_ = &group;
    const heddle_vulkan& vk = executor_.device->table();
    VkCommandBuffer commands = executor_.commands;
    const bool is_depth_only = shader_.shader->file.empty();
    const bool is_masked = (group.flags & HEDDLE_SURFACE_MASKED) != 0;
    const vulkan::Pipeline& pipeline = is_depth_only && is_masked ? shader_.masked : shader_.pipeline;
    const VkDescriptorSet program_set = executor_.make_program_set(source.vertices, source.instances);
    if (pipeline_ != &pipeline) executor_.bind(pass_, shader_, pipeline, wanted_.push, wanted_.push_bytes);
    if (pipeline_ != &pipeline || program_set_ != program_set) {
      vk.CmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout(), 3, 1, &program_set, 1,
                               &view_offset_);
    }
    pipeline_ = &pipeline;
    program_set_ = program_set;
    const VkDescriptorSet material_set = executor_.scene_buffers->material_set(group.texture_group);
    vk.CmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout(), 2, 1, &material_set, 0,
                             nullptr);
    // Depth alone is drawn from both sides unless the technique asks otherwise: what is thin or open still casts.
    const bool is_two_sided =
        (is_depth_only && wanted_.cull == HEDDLE_CULL_DEFAULT) || (group.flags & HEDDLE_SURFACE_DOUBLE_SIDED) != 0;
    vk.CmdSetCullMode(commands, is_two_sided ? VK_CULL_MODE_NONE : VK_CULL_MODE_BACK_BIT);
    vk.CmdSetFrontFace(commands, group.is_flipped ? VK_FRONT_FACE_CLOCKWISE : VK_FRONT_FACE_COUNTER_CLOCKWISE);
  }

  void bind_indices(VkBuffer indices) {
    if (indices_ == indices) return;
    indices_ = indices;
    executor_.device->table().CmdBindIndexBuffer(executor_.commands, indices, 0, VK_INDEX_TYPE_UINT32);
  }

 private:
  Executor::State& executor_;
  const PassState& pass_;
  const ShaderState& shader_;
  const heddle_draw& wanted_;
  std::uint32_t view_offset_;
  const vulkan::Pipeline* pipeline_ = nullptr;
  VkDescriptorSet program_set_ = VK_NULL_HANDLE;
  VkBuffer indices_ = VK_NULL_HANDLE;
  const scene::DrawGroup* group_ = nullptr;
};

void choose_groups(std::span<const scene::DrawGroup> groups, const heddle_draw& drawing,
                   std::vector<const scene::DrawGroup*>& chosen) {
  for (const scene::DrawGroup& group : groups) {
    const bool is_included = drawing.include == 0 || (group.flags & drawing.include) != 0;
    if (is_included && (group.flags & drawing.require) == drawing.require && group.command_count > 0)
      chosen.push_back(&group);
  }
}

/// Every source of the surfaces with the groups that are asked for; those that techniques place come first.
std::vector<Source> find_sources(Executor::State& executor, ResourceIndex surfaces, const heddle_draw& drawing) {
  std::vector<Source> own, sources;
  const auto add = [&](Source source, std::span<const scene::DrawGroup> groups, std::vector<Source>& to) {
    choose_groups(groups, drawing, source.draws.groups);
    if (!source.draws.groups.empty()) to.push_back(std::move(source));
  };
  std::vector<std::uint8_t> is_gone(executor.scene->instances.size(), 0);
  for (const ResourceIndex version : executor.made_versions(surfaces)) {
    SurfacesState& made = *executor.resources[version].made;
    const scene::PlacedBatches& placed = executor.place(made);
    const BatchBuffers buffers = batch_buffers_of(executor.graph, version);
    Source source;
    source.vertices = executor.buffer_of(buffers.vertices);
    source.indices = executor.buffer_of(buffers.indices);
    Source technique = source;
    technique.instances = executor.buffer_of(buffers.instances);
    technique.own_commands = buffers.commands;
    add(std::move(technique), placed.own_groups(), own);
    source.instances = made.instances.handle();
    source.draws.list = placed.draws();
    source.draws.made = &placed;
    source.draws.is_gone = scene::by_slot(placed.draws().order, is_gone);
    add(std::move(source), placed.draws().groups, sources);
    scene::mark_placed(made.surfaces, is_gone);
  }
  if (holds_scene(executor.graph, surfaces)) {
    const scene::SceneBuffers& buffers = *executor.scene_buffers;
    Source source;
    source.vertices = buffers.vertices().handle();
    source.indices = buffers.indices().handle();
    source.instances = buffers.instances().handle();
    source.commands = buffers.commands().handle();
    source.draws.list = buffers.draws();
    source.draws.is_gone = scene::by_slot(buffers.order(), is_gone);
    add(std::move(source), buffers.groups(), sources);
  }
  own.insert(own.end(), std::make_move_iterator(sources.begin()), std::make_move_iterator(sources.end()));
  return own;
}

/// Draws that a technique has placed itself: as many as its buffer says.
void draw_own(Executor::State& executor, const Source& source, GroupBinder& binder) {
  const heddle_vulkan& vk = executor.device->table();
  constexpr std::uint32_t kStride = sizeof(VkDrawIndexedIndirectCommand);
  const bool is_list = executor.graph.resources[source.own_commands].is_list();
  VkBuffer buffer = executor.buffer_of(source.own_commands);
  binder.bind_indices(source.indices);
  for (const scene::DrawGroup* group : source.draws.groups) {
    binder.bind(source, *group);
    const std::uint64_t offset = (is_list ? kListHead : 0) + std::uint64_t{group->first_command} * kStride;
    if (is_list) {
      vk.CmdDrawIndexedIndirectCount(executor.commands, buffer, offset, buffer, 0, group->command_count, kStride);
    } else {
      vk.CmdDrawIndexedIndirect(executor.commands, buffer, offset, group->command_count, kStride);
    }
  }
}

}  // namespace

void Executor::State::draw_surfaces(const PassState& pass, const ShaderState& shader, const heddle_draw& drawing,
                                    const HeddleView& view) {
  const heddle_vulkan& vk = device->table();
  const std::vector<Source> sources =
      find_sources(*this, pass_of(pass).ports.find(std::string_view(drawing.surfaces))->second, drawing);
  if (sources.empty()) return;
  GroupBinder binder(*this, pass, shader, drawing, add_view(view));
  for (const Source& source : sources)
    if (source.own_commands != kNoIndex) draw_own(*this, source, binder);
  const scene::Frustum frustum(view);
  if (drawing.order == HEDDLE_ORDER_STATE) {
    for (const Source& source : sources) {
      if (source.own_commands != kNoIndex) continue;
      binder.bind_indices(source.indices);
      for (const scene::DrawGroup* group : source.draws.groups) {
        const DrawRange range = draw_range(source.draws.list, *group, frustum, source.draws.is_gone, source.commands);
        if (range.count == 0) continue;
        binder.bind(source, *group);
        vk.CmdDrawIndexedIndirect(commands, range.buffer, range.offset, range.count,
                                  sizeof(VkDrawIndexedIndirectCommand));
      }
    }
    return;
  }
  std::vector<scene::DrawSource> sorted;
  std::vector<const Source*> source_of;
  for (const Source& source : sources) {
    if (source.own_commands != kNoIndex) continue;
    sorted.push_back(source.draws);
    source_of.push_back(&source);
  }
  const bool sorts_triangles = drawing.order == HEDDLE_ORDER_TRIANGLES_BACK_TO_FRONT;
  const scene::OrderedDraws ordered = scene::order_back_to_front(*scene, sorted, view, origin, sorts_triangles,
                                                                 variant.culls ? &frustum : nullptr);
  stats.instances_drawn += ordered.drawn;
  stats.instances_culled += ordered.culled;
  VkBuffer sorted_indices = VK_NULL_HANDLE;
  if (!ordered.indices.empty()) {
    const std::size_t bytes = ordered.indices.size() * sizeof(std::uint32_t);
    frame_buffers.push_back(device->make_buffer(bytes, VK_BUFFER_USAGE_INDEX_BUFFER_BIT, true));
    std::memcpy(frame_buffers.back().data(), ordered.indices.data(), bytes);
    device->note_host_write(frame_buffers.back());
    device->count_upload(bytes);
    sorted_indices = frame_buffers.back().handle();
  }
  for (const scene::OrderedDraw& draw : ordered.draws) {
    const Source& source = *source_of[draw.source];
    const bool is_sorted = sorted_indices != VK_NULL_HANDLE && source.draws.made == nullptr;
    binder.bind_indices(is_sorted ? sorted_indices : source.indices);
    binder.bind(source, *draw.group);
    vk.CmdDrawIndexed(commands, draw.index_count, draw.instance_count, draw.first_index, draw.vertex_offset,
                      draw.first_instance);
  }
}

}  // namespace heddle::graph
