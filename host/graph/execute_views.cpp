// SPDX-License-Identifier: Apache-2.0
// The C functions behind drawings: those of the frame's origin, those that are placed in the scene and kept, and what a
// technique counts of them.
#include "graph/execute_calls.hpp"

#include <heddle/counters.h>
#include <heddle/views.h>

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

namespace heddle::graph {

namespace {

/// Copies what the caller asks for and finds its mistakes; HEDDLE_OK, or HEDDLE_BUG after a report.
heddle_status read_drawing(const heddle_pass_host* self, heddle_frame* frame, const heddle_draw& given,
                           Executor::State::Drawing& out) {
  const PassState& pass = state_of(self);
  const Executor::State& executor = executor_of(pass);
  heddle_draw& wanted = out.wanted;
  std::memcpy(&wanted, &given, std::min<std::size_t>(given.struct_size, sizeof wanted));
  const Stage& stage = executor.technique_of(pass).stages[frame->stage->stage];
  const bool is_declared = std::any_of(stage.accesses.begin(), stage.accesses.end(), [&](const Access& access) {
    return access.port == wanted.surfaces && access.access == HEDDLE_ACCESS_DRAW;
  });
  if (!is_declared) {
    return wrong(pass, fmt::format("draws '{}', which its stage does not declare as DRAW", wanted.surfaces));
  }
  if (wanted.view != nullptr) {
    out.view = *wanted.view;
  } else {
    std::uint64_t bytes = 0;
    const void* camera = self->value(self, frame, "camera", &bytes);
    if (camera == nullptr || bytes != sizeof out.view)
      return wrong(pass, "draws without a view and has no port 'camera'");
    std::memcpy(&out.view, camera, sizeof out.view);
  }
  if (wanted.order > HEDDLE_ORDER_TRIANGLES_BACK_TO_FRONT || wanted.cull > HEDDLE_CULL_MATERIAL) {
    return wrong(pass, fmt::format("draws '{}' with the unknown order {} or cull {}", wanted.surfaces, wanted.order,
                                   wanted.cull));
  }
  return HEDDLE_OK;
}

/// The same of a drawing that has its own place. `origin` is what out.origin then points to.
heddle_status read_placed(const heddle_pass_host* self, heddle_frame* frame, const heddle_placed_draw& given,
                          Executor::State::Drawing& out, glm::dvec3& origin) {
  const PassState& pass = state_of(self);
  if (given.draw->view == nullptr) return wrong(pass, "places a drawing without a view");
  if (const heddle_status status = read_drawing(self, frame, *given.draw, out); status != HEDDLE_OK) return status;
  if (out.wanted.order != HEDDLE_ORDER_STATE) {
    return wrong(
        pass, fmt::format("places a drawing of '{}' in an order other than HEDDLE_ORDER_STATE", out.wanted.surfaces));
  }
  origin = {given.origin[0], given.origin[1], given.origin[2]};
  out.origin = &origin;
  out.clears = given.clears != 0;
  return HEDDLE_OK;
}

void record_drawing(PassState& pass, heddle_frame& frame, ShaderState& shader,
                    const Executor::State::Drawing& drawing) {
  Executor::State& executor = executor_of(pass);
  const heddle_vulkan& vk = executor.device->table();
  const heddle_draw& wanted = drawing.wanted;
  const Pass& declared = executor.pass_of(pass);
  executor.begin_rendering(pass, frame, wanted.layer, drawing.origin == nullptr ? nullptr : &drawing);
  if (declared.ports.count(std::string_view(wanted.surfaces)) != 0) {
    const VkExtent2D extent =
        executor.attachment_extent(declared, executor.technique_of(pass).stages[frame.stage->stage]);
    if (wanted.width == 0) {
      set_viewport(vk, frame.commands, 0, 0, extent.width, extent.height);
    } else {
      set_viewport(vk, frame.commands, wanted.x, wanted.y, wanted.width, wanted.height);
    }
    executor.draw_surfaces(pass, shader, drawing);
  }
  vk.CmdEndRendering(frame.commands);
}

heddle_status draw_placed(const heddle_pass_host* self, heddle_frame* frame, const heddle_placed_draw* given) {
  PassState& pass = state_of(self);
  return guarded(pass, [&]() -> heddle_status {
    ShaderState* shader = find_shader(pass, frame, given->draw->shader, ShaderKind::kSurfaces);
    if (shader == nullptr) return HEDDLE_BUG;
    Executor::State::Drawing drawing;
    glm::dvec3 origin;
    if (const heddle_status status = read_placed(self, frame, *given, drawing, origin); status != HEDDLE_OK)
      return status;
    record_drawing(pass, *frame, *shader, drawing);
    return HEDDLE_OK;
  });
}

heddle_status find_look(const heddle_pass_host* self, heddle_frame* frame, const heddle_placed_draw* given,
                        std::uint64_t out[2]) {
  PassState& pass = state_of(self);
  return guarded(pass, [&]() -> heddle_status {
    Executor::State::Drawing drawing;
    glm::dvec3 origin;
    if (const heddle_status status = read_placed(self, frame, *given, drawing, origin); status != HEDDLE_OK)
      return status;
    std::ranges::copy(executor_of(pass).look_of(pass, drawing).words(), out);
    return HEDDLE_OK;
  });
}

heddle_status light_position(const heddle_pass_host* self, heddle_frame*, std::uint32_t id, double out[3]) {
  const PassState& pass = state_of(self);
  if (!is_in_key(pass, false, fmt::format("the position of light {}", id))) return HEDDLE_BUG;
  const auto& lights = executor_of(pass).scene->lights;
  if (id >= lights.size()) return HEDDLE_BAD_INPUT;
  for (int i = 0; i < 3; ++i) out[i] = lights[id].position[i];
  return HEDDLE_OK;
}

void add_to_counter(const heddle_pass_host* self, const char* name, std::uint64_t count) {
  const PassState& pass = state_of(self);
  if (is_in_key(pass, false, fmt::format("the counter '{}'", name))) executor_of(pass).add_count(pass, name, count);
}

constexpr heddle_views_service kViewsService{sizeof(heddle_views_service), 0, draw_placed, find_look, light_position};
constexpr heddle_counters_service kCountersService{sizeof(heddle_counters_service), 0, add_to_counter};

}  // namespace

heddle_status draw_unplaced(const heddle_pass_host* self, heddle_frame* frame, const heddle_draw* given) {
  PassState& pass = state_of(self);
  return guarded(pass, [&]() -> heddle_status {
    ShaderState* shader = find_shader(pass, frame, given->shader, ShaderKind::kSurfaces);
    if (shader == nullptr) return HEDDLE_BUG;
    Executor::State::Drawing drawing;
    if (const heddle_status status = read_drawing(self, frame, *given, drawing); status != HEDDLE_OK) return status;
    record_drawing(pass, *frame, *shader, drawing);
    return HEDDLE_OK;
  });
}

const void* views_service(std::string_view id) {
  if (id == HEDDLE_VIEWS_SERVICE) return &kViewsService;
  return id == HEDDLE_COUNTERS_SERVICE ? &kCountersService : nullptr;
}

void Executor::State::add_count(const PassState& state, std::string_view name, std::uint64_t count) {
  const std::string& pass = pass_of(state).name;
  const auto known =
      std::ranges::find_if(stats.counts, [&](const CountStats& one) { return one.pass == pass && one.name == name; });
  if (known == stats.counts.end()) {
    stats.counts.push_back({pass, std::string(name), count});
  } else {
    known->count += count;
  }
}

}  // namespace heddle::graph
