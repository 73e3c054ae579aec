// SPDX-License-Identifier: Apache-2.0
// What the stages of a frame have recorded -> which images hold one value everywhere, and the service that tells it.
#include "graph/execute_calls.hpp"

#include <heddle/contents.h>

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace heddle::graph {

namespace {

std::array<double, 4> neutral_of(const Pass& pass, const std::string& port) {
  const RolePort* declared = pass.role->find_port(port);
  return declared != nullptr ? declared->neutral : std::array<double, 4>{};
}

std::uint32_t is_neutral(const heddle_pass_host* self, heddle_frame* frame, const char* port) {
  const PassState& pass = state_of(self);
  Executor::State& executor = executor_of(pass);
  if (!is_in_key(pass, false, fmt::format("what image '{}' holds", port))) return 0;
  const Stage& stage = executor.technique_of(pass).stages[frame->stage->stage];
  const Port* declared = executor.technique_of(pass).find_port(port);
  const bool is_of_stage = std::ranges::find(stage.accesses, port, &Access::port) != stage.accesses.end();
  // The order of other stages says nothing about what they have recorded by now.
  if (!is_of_stage || declared == nullptr || declared->type != PortType::kImage) {
    wrong(pass, fmt::format("asks what '{}' holds, which is no image that stage '{}' declares", port, stage.name));
    return 0;
  }
  const Pass& asking = executor.pass_of(pass);
  const auto bound = asking.ports.find(port);
  return bound == asking.ports.end() || executor.holds(bound->second, neutral_of(asking, port)) ? 1 : 0;
}

constexpr heddle_contents_service kContentsService{sizeof(heddle_contents_service), 0, is_neutral};

}  // namespace

const void* contents_service(std::string_view id) {
  return id == HEDDLE_CONTENTS_SERVICE ? &kContentsService : nullptr;
}

bool Executor::State::holds(ResourceIndex image, const std::array<double, 4>& value) {
  const ResourceState& state = root(image);
  if (!state.uniform_value) return false;
  const std::uint32_t channels =
      vulkan::format_info(static_cast<VkFormat>(graph.resources[state.root].format)).channels;
  return std::equal(value.begin(), value.begin() + channels, state.uniform_value->begin());
}

/// After the stage's commands, of which `writes_before` is what writes_recorded was ahead of them.
void Executor::State::note_contents(const ScheduledStage& scheduled, const heddle_frame& frame,
                                    std::uint64_t writes_before) {
  const Pass& pass = graph.passes[scheduled.pass];
  const Stage& stage = pass.entry.technique->stages[scheduled.stage];
  const bool has_drawn = scheduled.kind == StageKind::kCpu || writes_recorded != writes_before;
  for (const ScheduledStage::Use& use : scheduled.uses) {
    if (!use.writes) continue;
    ResourceState& state = root(use.resource);
    if (!state.image) continue;
    const auto access = std::ranges::find_if(stage.accesses, [&](const Access& candidate) {
      const auto bound = pass.ports.find(candidate.port);
      const bool is_attachment = candidate.access == HEDDLE_ACCESS_COLOR || candidate.access == HEDDLE_ACCESS_DEPTH;
      return is_attachment && bound != pass.ports.end() && root(bound->second).root == state.root;
    });
    if (has_drawn || access == stage.accesses.end()) {
      state.uniform_value.reset();
      continue;
    }
    const bool is_there = access->load == HEDDLE_LOAD_CLEAR_NEW && pass.inout_sources.contains(access->port);
    if (is_there || access->load == HEDDLE_LOAD_KEEP) continue;  // holds what it held
    const vulkan::ImageShape& shape = state.image.shape();
    std::set<std::uint32_t> cleared;
    for (const std::uint32_t layer : frame.drawn_layers) cleared.insert(std::min(layer, shape.layers - 1));
    const bool is_cleared = access->load != HEDDLE_LOAD_DONT_CARE && shape.mips == 1 && cleared.size() == shape.layers;
    state.uniform_value.reset();
    if (is_cleared)
      state.uniform_value.emplace(
          std::array<double, 4>{access->clear[0], access->clear[1], access->clear[2], access->clear[3]});
  }
}

}  // namespace heddle::graph
