// SPDX-License-Identifier: Apache-2.0
// WrittenGraph and what it resolves to -> a description of both, without a plan.
#include "graph/describe.hpp"

#include <algorithm>

#include "graph/explain.hpp"
#include "graph/written.hpp"

namespace heddle::graph {

Json describe(const WrittenGraph& written, const ResolvedGraph& resolved) {
  Json json{{"file", resolved.file},
            {"kind", resolved.is_job ? "job" : "frame"},
            {"extent", {resolved.width, resolved.height}}};
  json["output"] = resolved.output == kNoIndex ? Json() : Json(resolved.resources[resolved.output].name);
  json["presets"] = Json::object();
  for (const auto& [key, value] : written.params) json["presets"][key.name] = to_json(value);
  json["passes"] = Json::array();
  for (const WrittenPass& wrote : written.passes) {
    const std::string& name = text_of(wrote.name);
    const auto pass = std::ranges::find(resolved.passes, name, &Pass::name);
    Json entry{{"name", name},
               {"role", text_of(wrote.role)},
               {"technique", text_of(wrote.technique)},
               {"is_left_out", pass == resolved.passes.end()}};
    if (pass != resolved.passes.end()) {
      entry["parameters"] = Json::object();
      for (std::size_t i = 0; i < pass->parameters.size(); ++i) {
        const Parameter& parameter = pass->entry.technique->parameters[i];
        entry["parameters"][parameter.name] = graph::to_json(parameter, pass->parameters[i]);
      }
      entry["inputs"] = Json::object();
      for (const Port& port : pass->entry.technique->ports) {
        if (port.direction == Direction::kOut) continue;
        const auto& ports = port.direction == Direction::kIn ? pass->ports : pass->inout_sources;
        const auto bound = ports.find(port.name);
        entry["inputs"][port.name] = bound == ports.end() ? "none" : resolved.resources[bound->second].name;
      }
    }
    json["passes"].push_back(std::move(entry));
  }
  json["ports"] = Json::array();
  for (const Resource& resource : resolved.resources)
    json["ports"].push_back({{"name", resource.name}, {"type", type_text(resource.type)}});
  return json;
}

}  // namespace heddle::graph
