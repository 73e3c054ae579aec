// SPDX-License-Identifier: Apache-2.0
// The executor's outside: kept ports, parameters, explanations, and taking everything down again.

#include "graph/execute.hpp"

#include "graph/execute_state.hpp"
#include "graph/why.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace heddle::graph {

Executor::Executor(HostServices& services, ResolvedGraph graph)
    : state_(std::make_unique<State>(services, std::move(graph))) {
  state_->graph = state_->original;
}

Executor::~Executor() {
  State& s = *state_;
  s.unplan();
  if (s.device == nullptr) return;
  s.scene_buffers.reset();
  s.destroy_frame_memory(s);
  for (FrameMemory& memory : s.spare) s.destroy_frame_memory(memory);
}

void Executor::keep(std::string_view resource) {
  State& s = *state_;
  const ResourceIndex index = find_resource(s.original, resource);
  if (s.original.resources[index].type != PortType::kImage || s.original.resources[index].producer == kNoIndex) {
    throw Error(HEDDLE_BAD_INPUT, fmt::format("port '{}' is not an image that a pass makes", resource),
                "only images can be read back");
  }
  if (std::find(s.kept_names.begin(), s.kept_names.end(), resource) != s.kept_names.end()) return;
  std::vector<std::string> kept = s.kept_names;
  kept.emplace_back(resource);
  replace(s.original, std::move(kept));
}

void Executor::replace(ResolvedGraph graph, std::vector<std::string> kept) {
  State& s = *state_;
  for (const std::string& name : kept) (void)find_resource(graph, name);
  std::swap(s.original, graph);
  std::swap(s.kept_names, kept);
  const auto is_there = [&](ResourceIndex resource) { return s.lasting.contains(s.original.resources[resource].name); };
  const bool waits = s.is_planned && !s.original.jobs.empty() &&
                     !std::ranges::all_of(s.needed_artifacts(s.planned_features), is_there);
  if (s.original.is_job || waits) {
    // A job plans when it runs; and before this frame graph can be planned, its jobs have to.
    s.retire();
    s.has_frame = false;
  }
  if (!s.is_planned) {
    s.graph = s.original;
    s.adopt_jobs(graph.jobs);
    return;
  }
  const bool had_frame = s.has_frame;
  try {
    s.plan(s.planned_features);
  } catch (...) {
    std::swap(s.original, graph);
    std::swap(s.kept_names, kept);
    try {
      s.plan(s.planned_features, true);
      s.has_frame = had_frame && std::ranges::all_of(s.wanted, [&](ResourceIndex wanted) {
                      return s.resources[s.resources[wanted].root].is_adopted;
                    });
    } catch (...) {
      s.unplan();  // the next frame plans from nothing, or says why it cannot
      s.graph = s.original;
    }
    throw;
  }
  s.adopt_jobs(graph.jobs);  // only now: a graph that is put back finds its jobs as it left them
}

void Executor::set_parameter(PassIndex pass, std::size_t parameter, const ParameterValue& value) {
  State& s = *state_;
  s.original.passes[pass].parameters[parameter] = value;
  s.is_changed = true;
  if (!s.is_planned) return;
  s.graph.passes[pass].parameters[parameter] = value;
  if (s.passes[pass]) s.write_parameters(*s.passes[pass]);
}

void Executor::State::stop_if_cancelled() {
  if (stop_reason) std::rethrow_exception(std::exchange(stop_reason, nullptr));
  if (services.is_cancelled != nullptr && services.is_cancelled->exchange(false)) {
    throw Error(HEDDLE_CANCELLED, "stopped, as heddle_cancel asked for");
  }
}

const FrameStats& Executor::stats() const {
  return state_->stats;
}

const ResolvedGraph& Executor::graph() const {
  return state_->original;
}

/// Calls `body` with a plan in the state: the one of the last frame, else one for a scene with every feature.
std::string Executor::with_plan(const std::function<std::string()>& body) {
  State& s = *state_;
  const bool was_planned = s.is_planned;
  if (!was_planned) {
    // Without a scene nothing is pruned for its sake. How much memory images need only a device can say.
    std::vector<std::string> every_feature;
    for (const Pass& pass : s.original.passes) {
      const auto& needed = pass.entry.technique->features;
      every_feature.insert(every_feature.end(), needed.begin(), needed.end());
    }
    try {
      s.plan_memory(every_feature);
    } catch (const Error& error) {
      // No device, or no plugin: the rest is known all the same.
      s.services.log(Severity::kWarning, fmt::format("sizes and memory are not known: {}", error.what()));
      s.unplan();
      s.graph = s.original;
      s.find_wanted();
      prune(s.graph, s.wanted, every_feature);
      weave_loops(s.graph);
      s.order = graph::order(s.graph);
      s.placement = alias(s.graph, s.order, std::vector<MemoryNeed>(s.graph.resources.size()), s.wanted);
      s.barriers = plan_barriers(s.graph, s.order, s.placement, s.wanted);
    }
  }
  struct Unplan {  // what was made for the explanation alone
    State& state;
    bool is_due;
    ~Unplan() {
      if (!is_due) return;
      state.unplan();
      state.graph = state.original;
    }
  } const unplan{s, !was_planned};
  return body();
}

std::string Executor::explain(std::string_view format) {
  State& s = *state_;
  return with_plan([&]() -> std::string {
    if (format == "text") return explain_text(s.graph, s.order, s.placement, s.barriers, s.services.is_live);
    if (format == "json") return explain_json(s.graph, s.order, s.placement, s.barriers, s.services.is_live);
    if (format == "dot") return explain_dot(s.graph, s.order);
    throw Error(HEDDLE_BAD_INPUT, fmt::format("unknown format '{}' of an explanation", format),
                "one of text, json, dot");
  });
}

std::string Executor::explain_pass(const WrittenGraph& written, std::string_view pass, std::string_view format) {
  State& s = *state_;
  if (format != "text" && format != "json") {
    throw Error(HEDDLE_BAD_INPUT, fmt::format("unknown format '{}' of an explanation of one pass", format),
                "one of text, json");
  }
  // Values may have been set since the graph was resolved: where they come from is in what was written.
  const ResolvedGraph resolved = resolve(written, s.services.registry);
  return with_plan([&] {
    const Json answer = why(written, resolved, s.graph, s.order, s.services.registry.roles(), pass);
    return format == "json" ? write_json(answer, 2) : to_text(answer);
  });
}

}  // namespace heddle::graph
