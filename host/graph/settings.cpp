// SPDX-License-Identifier: Apache-2.0
#include "graph/settings.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "graph/explain.hpp"
#include "graph/written.hpp"

namespace heddle::graph {
namespace {

Json json_of(const Pass& pass, const ResolvedGraph& graph) {
  const Technique& technique = *pass.entry.technique;
  Json params = Json::object(), inputs = Json::object(), functions = Json::object();
  for (std::size_t i = 0; i < technique.parameters.size(); ++i) {
    params[technique.parameters[i].name] = to_json(technique.parameters[i], pass.parameters[i]);
  }
  for (const Port& port : technique.ports) {
    if (port.direction == Direction::kOut) continue;
    const auto& bound = port.direction == Direction::kInout ? pass.inout_sources : pass.ports;
    const auto found = bound.find(port.name);
    inputs[port.name] = found == bound.end() ? "none" : graph.resources[found->second].name;
  }
  for (const FunctionBinding& binding : pass.functions) {
    Json& names = functions[binding.role] = Json::array();
    for (const PassIndex provider : binding.providers) names.push_back(graph.passes[provider].name);
  }
  return {{"params", params}, {"inputs", inputs}, {"functions", functions}};
}

}  // namespace

Json settings(const WrittenGraph& written, const ResolvedGraph& resolved) {
  Json json{{"kind", resolved.is_job ? "job" : "frame"},
            {"extent", {resolved.width, resolved.height}},
            {"output", resolved.output == kNoIndex ? "" : resolved.resources[resolved.output].name},
            {"params", Json::object()},
            {"joins", Json::object()}};
  for (const auto& [key, value] : written.params) json["params"][key.name] = to_json(value);
  for (const auto& [key, value] : written.joins) json["joins"][key.name] = to_json(value);
  for (const WrittenPass& pass : written.passes) {
    Json one{{"role", text_of(pass.role)},
             {"technique", text_of(pass.technique)},
             {"enabled", !pass.enabled || std::get<bool>(pass.enabled->value)}};
    const auto found = std::ranges::find(resolved.passes, text_of(pass.name), &Pass::name);
    if (found != resolved.passes.end()) {
      one.update(json_of(*found, resolved));
    } else {  // left out: it has none
      for (const char* key : {"params", "inputs", "functions"}) one[key] = Json::object();
    }
    json[text_of(pass.name)] = std::move(one);
  }
  return json;
}

Json find_setting(const Json& settings, std::string_view key) {
  const Json* at = &settings;
  std::string path;
  for (std::string_view rest = key; !rest.empty();) {
    const std::size_t dot = std::min(rest.find('.'), rest.size());
    const std::string name(rest.substr(0, dot));
    rest.remove_prefix(std::min(dot + 1, rest.size()));
    std::vector<std::string> names;
    if (at->is_object()) {
      for (const auto& [known, value] : at->items()) names.push_back(known);
    }
    if (std::ranges::find(names, name) == names.end()) {
      Diagnostic diagnostic;
      diagnostic.message = path.empty() ? fmt::format("the graph has no setting '{}'", name)
                                        : fmt::format("'{}' has no setting '{}'", path, name);
      diagnostic.expected = names.empty() ? "nothing behind it" : "one of " + join_names(names);
      diagnostic.help = did_you_mean(name, names);
      throw Error(HEDDLE_BAD_INPUT, std::move(diagnostic));
    }
    path += (path.empty() ? "" : ".") + name;
    at = &(*at)[name];
  }
  return *at;
}

}  // namespace heddle::graph
