// SPDX-License-Identifier: Apache-2.0
// One drawing of surfaces -> draw commands: merged by state, or sorted by depth for blending; and the number that says
// what it would show.

#include "graph/execute_state.hpp"
#include "graph/uses.hpp"
#include "scene/draw_order.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace heddle::graph {

namespace {

/// What a drawing draws from: the scene's buffers, or a technique's with the instances of either.
struct Source {
  scene::DrawSource draws;
  VkBuffer vertices = VK_NULL_HANDLE, indices = VK_NULL_HANDLE, instances = VK_NULL_HANDLE;
  VkBuffer commands = VK_NULL_HANDLE;     // of the list, on the device
  ResourceIndex own_commands = kNoIndex;  // the technique's: it places
  std::uint64_t revision = 0;             // of what a technique made
  const ProgramState* program = nullptr;  // that says where vertices are; nullptr: they are in `vertices`
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
    const vulkan::Pipeline& pipeline = pipeline_for(source, is_depth_only && is_masked);
    const VkDescriptorSet program_set = executor_.make_program_set(source.program, source.vertices, source.instances);
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
  [[nodiscard]] const vulkan::Pipeline& pipeline_for(const Source& source, bool is_masked) const {
    if (source.program == nullptr) return is_masked ? shader_.masked : shader_.pipeline;
    const ShaderState::Behind& behind = shader_.behind.at(executor_.graph.passes[source.program->pass].name);
    return is_masked ? behind.masked : behind.pipeline;
  }

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
    source.program = executor.program_behind(version);
    source.vertices = executor.buffer_of(buffers.vertices);
    source.indices = executor.buffer_of(buffers.indices);
    source.revision = made.surfaces.revision;
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

/// The boxes of instances are relative to the frame's origin.
scene::Frustum frustum_of(const Executor::State::Drawing& drawing, const glm::dvec3& frame_origin) {
  return scene::Frustum(drawing.view, drawing.origin == nullptr ? glm::dvec3(0.0) : frame_origin - *drawing.origin);
}

/// The drawing's view for positions relative to the frame's origin: of what a technique has placed on the GPU.
HeddleView view_from_frame(const Executor::State::Drawing& drawing, const glm::dvec3& frame_origin) {
  if (drawing.origin == nullptr) return drawing.view;
  HeddleView view = drawing.view;
  const glm::dvec3 shift = frame_origin - *drawing.origin;
  const auto shift_input = [&](float(&matrix)[16]) {
    for (int row = 0; row < 4; ++row) {
      double sum = static_cast<double>(matrix[12 + row]);
      for (int axis = 0; axis < 3; ++axis) sum += static_cast<double>(matrix[4 * axis + row]) * shift[axis];
      matrix[12 + row] = static_cast<float>(sum);
    }
  };
  const auto shift_output = [&](float(&matrix)[16]) {
    for (int column = 0; column < 4; ++column)
      for (int axis = 0; axis < 3; ++axis) {
        const double moved =
            static_cast<double>(matrix[4 * column + axis]) - shift[axis] * static_cast<double>(matrix[4 * column + 3]);
        matrix[4 * column + axis] = static_cast<float>(moved);
      }
  };
  shift_input(view.clip_from_rel);
  shift_input(view.view_from_rel);
  shift_input(view.previous_clip_from_rel);
  shift_output(view.rel_from_clip);
  shift_output(view.rel_from_view);
  return view;
}

}  // namespace

Placing& Executor::State::placing_at(const glm::dvec3& at, VkBuffer source, std::size_t slots) {
  const auto found = std::ranges::find_if(
      placings, [&](const Placing& known) { return known.source == source && known.origin == at; });
  if (found != placings.end()) return *found;
  const std::uint64_t bytes = std::max<std::uint64_t>(slots * sizeof(HeddleInstance), 16);
  if (placings.size() == placed_instances.size()) placed_instances.emplace_back();
  vulkan::Buffer& buffer = placed_instances[placings.size()];
  if (!buffer || buffer.size() < bytes) buffer = device->make_buffer(bytes, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, true);
  placings.push_back({at, source, &buffer, std::vector<std::uint8_t>(slots, 0)});
  return placings.back();
}

void Executor::State::place(Placing& placing, const scene::DrawList& list, const scene::PlacedBatches* made,
                            std::span<const VkDrawIndexedIndirectCommand> drawn) {
  const auto record_at = [&](std::uint32_t slot) {
    if (made != nullptr) {
      const HeddleInstance& batch = made->instances()[slot];
      return scene::place(*scene, list.order[slot], placing.origin, batch.material, batch.previous_vertex);
    }
    const std::uint32_t mesh = scene->instances[list.order[slot]].mesh;
    return scene::place(*scene, list.order[slot], placing.origin, scene->meshes[mesh].material,
                        scene_buffers->mesh(mesh).steps_to_previous());
  };
  for (const VkDrawIndexedIndirectCommand& command : drawn) {
    for (std::uint32_t slot = command.firstInstance; slot < command.firstInstance + command.instanceCount; ++slot) {
      if (placing.is_there[slot] != 0) continue;
      placing.is_there[slot] = 1;
      const HeddleInstance record = record_at(slot);
      const std::uint64_t offset = slot * sizeof record;
      std::memcpy(placing.instances->data() + offset, &record, sizeof record);
      device->note_host_write(*placing.instances, offset, sizeof record);
      device->count_upload(sizeof record);
    }
  }
}

scene::Look Executor::State::look_of(const PassState& pass, const Drawing& drawing) {
  scene::Look look;
  look.add(scene->content_revision);
  std::array<std::uint32_t, sizeof(HeddleView) / 4> words{};
  std::memcpy(words.data(), &drawing.view, sizeof drawing.view);
  for (const std::uint32_t word : words) look.add(word);
  const heddle_draw& asked = drawing.wanted;
  for (const std::uint32_t word : {asked.include, asked.require, asked.layer, asked.x, asked.y, asked.width,
                                   asked.height, asked.order, asked.cull})
    look.add(word);
  const auto add_point = [&](const glm::dvec3& point) {
    for (int i = 0; i < 3; ++i) look.add(std::bit_cast<std::uint64_t>(point[i]));
  };
  add_point(drawing.origin == nullptr ? origin : *drawing.origin);
  const auto bound = pass_of(pass).ports.find(std::string_view(asked.surfaces));
  if (bound == pass_of(pass).ports.end()) return look;
  const scene::Frustum frustum = frustum_of(drawing, origin);
  const std::span<const scene::Look> instance_looks = scene_buffers->looks();
  for (const Source& source : find_sources(*this, bound->second, asked)) {
    look.add(source.revision);
    // What a technique places lies relative to the frame's origin, and only its revision is known here.
    if (source.own_commands != kNoIndex) add_point(origin);
    if (source.own_commands != kNoIndex) continue;
    for (const scene::DrawGroup* group : source.draws.groups)
      for (const VkDrawIndexedIndirectCommand& command :
           source.draws.list.visible(*group, &frustum, source.draws.is_gone).commands) {
        look.add(command.firstIndex);
        for (std::uint32_t i = 0; i < command.instanceCount; ++i) {
          const std::uint32_t instance = source.draws.list.order[command.firstInstance + i];
          look.add(instance);
          look.add(instance_looks[instance]);
        }
      }
  }
  return look;
}

void Executor::State::draw_surfaces(const PassState& pass, const ShaderState& shader, const Drawing& drawing) {
  const heddle_vulkan& vk = device->table();
  const heddle_draw& asked = drawing.wanted;
  std::vector<Source> sources =
      find_sources(*this, pass_of(pass).ports.find(std::string_view(asked.surfaces))->second, asked);
  if (sources.empty()) return;
  const auto is_own = [](const Source& source) { return source.own_commands != kNoIndex; };
  if (std::ranges::any_of(sources, is_own)) {
    GroupBinder binder(*this, pass, shader, asked, add_view(view_from_frame(drawing, origin)));
    for (const Source& source : sources)
      if (is_own(source)) draw_own(*this, source, binder);
    std::erase_if(sources, is_own);
  }
  if (sources.empty()) return;
  GroupBinder binder(*this, pass, shader, asked, add_view(drawing.view));
  const scene::Frustum frustum = frustum_of(drawing, origin);
  if (asked.order == HEDDLE_ORDER_STATE) {
    for (Source& source : sources) {
      const scene::DrawList& list = source.draws.list;
      Placing* placing =
          drawing.origin == nullptr ? nullptr : &placing_at(*drawing.origin, source.instances, list.order.size());
      if (placing != nullptr) source.instances = placing->instances->handle();
      binder.bind_indices(source.indices);
      for (const scene::DrawGroup* group : source.draws.groups) {
        const scene::VisibleDraws visible =
            list.visible(*group, variant.culls ? &frustum : nullptr, source.draws.is_gone);
        if (placing != nullptr) place(*placing, list, source.draws.made, visible.commands);
        const DrawRange range = draw_range(*group, visible, source.commands);
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
    sorted.push_back(source.draws);
    source_of.push_back(&source);
  }
  const bool sorts_triangles = asked.order == HEDDLE_ORDER_TRIANGLES_BACK_TO_FRONT;
  const scene::OrderedDraws ordered = scene::order_back_to_front(*scene, sorted, drawing.view, origin, sorts_triangles,
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
