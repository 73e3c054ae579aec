// SPDX-License-Identifier: Apache-2.0
// Roles and techniques -> JSON Schema. Conditions stand in `allOf` beside a first part that lists every key without
// conditions: Taplo, which most editors use for TOML, validates with all of it, but completes and explains from what is
// not under `if` and `then`.
#include "graph/schema.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <set>

#include "graph/explain.hpp"
#include "graph/uses.hpp"
#include "graph/written.hpp"

namespace heddle::graph {
namespace {

constexpr std::string_view kPortReference =
    "\"pass.port\", \"scene.camera\", \"scene.lights\", \"scene.surfaces\", \"job.toml#artifact\" or \"none\"";

Json reference(const std::string& name) {
  return {{"$ref", "#/definitions/" + name}};
}

Json number_schema(const Parameter& parameter, std::string_view type) {
  Json json{{"type", type}};
  if (parameter.minimum == parameter.maximum) return json;
  if (parameter.minimum > -std::numeric_limits<double>::max()) json["minimum"] = parameter.minimum;
  if (parameter.maximum < std::numeric_limits<double>::max()) json["maximum"] = parameter.maximum;
  return json;
}

Json value_schema(const Parameter& parameter) {
  switch (parameter.type) {
    case ParameterType::kFloat:
      return number_schema(parameter, "number");
    case ParameterType::kInt:
      return number_schema(parameter, "integer");
    case ParameterType::kBool:
      return {{"type", "boolean"}};
    case ParameterType::kChoice:
      return {{"type", "string"}, {"enum", parameter.choices}};
    case ParameterType::kColor:
    case ParameterType::kFloat3:
      return {{"type", "array"}, {"items", number_schema(parameter, "number")}, {"minItems", 3}, {"maxItems", 3}};
    case ParameterType::kNames:
      return {{"type", "array"}, {"items", {{"type", "string"}}}};
    case ParameterType::kText:
      return {{"type", "string"}};
  }
  return {};
}

Json default_of(const Parameter& parameter) {
  ParameterValue value;
  value.number = parameter.default_value;
  return to_json(parameter, value);
}

/// Type, range, unit, default and ladder; or "$NAME" of a preset.
Json parameter_schema(const Technique& technique, const Parameter& parameter) {
  std::string text = parameter.help;
  if (!parameter.unit.empty() && parameter.unit != "1") text += fmt::format(" [{}]", parameter.unit);
  if (parameter.is_knob()) {
    std::string steps;
    for (const double step : parameter.ladder) steps += fmt::format("{}{}", steps.empty() ? "" : ", ", step);
    text += fmt::format("; a knob, from cheap to accurate: {}", steps);
  }
  Json json{{"title", technique.id + ": " + parameter.name}, {"description", text}, {"default", default_of(parameter)}};
  if (parameter.is_knob()) json["examples"] = parameter.ladder;
  json["anyOf"] = {value_schema(parameter), reference("preset")};
  return json;
}

/// Several schemas that share a key: one that takes what any of them takes.
Json any_of(const std::vector<Json>& schemas) {
  if (schemas.size() == 1) return schemas.front();
  return {{"anyOf", schemas}};
}

class Maker {
 public:
  explicit Maker(const Registry& registry) : registry_(registry) {}

  Json run() {
    definitions_["preset"] = {{"type", "string"},
                              {"pattern", R"(^\$.)"},
                              {"description", "$NAME of a preset in [params], at the top of the graph"}};
    definitions_["port"] = {{"type", "string"}, {"pattern", R"(^(none|[^.#]+\.[^.#]+|[^#]+#.+)$)"}};
    definitions_["value"] = {{"type", {"boolean", "number", "string", "array"}}};
    for (const Technique* technique : registry_.techniques()) define(*technique);
    definitions_["pass"] = pass_schema();
    Json json{{"$schema", "http://json-schema.org/draft-07/schema#"},
              {"title", "Heddle graph"},
              {"description", "the passes of a frame or a job: techniques in their roles, bound to each other"},
              {"type", "object"}};
    // As in `pass`: what editors read first, conditions after it.
    json["allOf"] = Json::array();
    json["allOf"].push_back({{"type", "object"}, {"properties", graph_properties()}, {"additionalProperties", false}});
    json["allOf"].push_back(
        {{"if", {{"required", {"extends"}}}},
         {"then", Json::object()},
         {"else",
          {{"required", {"pass"}},
           {"if", {{"properties", {{"kind", {{"const", "job"}}}}}, {"required", {"kind"}}}},
           {"else", {{"required", {"output"}}}},
           {"properties",
            {{"remove", false},
             {"pass",
              {{"items",
                {{"required", {"role", "technique"}}, {"properties", {{"after", false}, {"before", false}}}}}}}}}}}});
    json["definitions"] = std::move(definitions_);
    return json;
  }

 private:
  static std::string name_of(const Technique& technique, std::string_view part) {
    return fmt::format("{}.{}.{}", technique.role_name(), technique.name(), part);
  }

  void define(const Technique& technique) {
    Json params = Json::object();
    for (const Parameter& parameter : technique.parameters) {
      params[parameter.name] = parameter_schema(technique, parameter);
      every_param_[parameter.name].push_back(params[parameter.name]);
    }
    Json inputs = Json::object();
    const Role* role = registry_.find_role(technique.role_name());
    for (const Port& port : technique.ports) {
      if (port.direction == Direction::kOut) continue;
      const RolePort* contract = role != nullptr ? role->find_port(port.name) : nullptr;
      const std::string& help = port.help.empty() && contract != nullptr ? contract->help : port.help;
      inputs[port.name] = {{"title", technique.id + ": " + port.name},
                           {"description", fmt::format("{}; {}", help, kPortReference)},
                           {"type", "string"},
                           {"pattern", definitions_["port"]["pattern"]}};
      every_input_[port.name].push_back(inputs[port.name]);
    }
    Json functions = Json::object();
    for (const std::string& called : all_calls(technique)) {
      functions[called] = {{"title", fmt::format("{}: who answers {}", technique.id, called)},
                           {"description", "names of passes; [] for the neutral answer; unbound: every provider above"},
                           {"type", "array"},
                           {"items", {{"type", "string"}}}};
      every_function_[called].push_back(functions[called]);
    }
    const auto add = [&](std::string_view part, Json properties) {
      definitions_[name_of(technique, part)] = {
          {"type", "object"}, {"properties", std::move(properties)}, {"additionalProperties", false}};
    };
    add("params", std::move(params));
    add("inputs", std::move(inputs));
    add("functions", std::move(functions));
  }

  static Json all(const std::map<std::string, std::vector<Json>>& every, std::string_view help) {
    Json properties = Json::object();
    for (const auto& [name, schemas] : every) properties[name] = any_of(schemas);
    return {{"type", "object"}, {"description", help}, {"properties", std::move(properties)}};
  }

  Json pass_properties() {
    Json roles = Json::array();
    Json role_texts = Json::array();
    std::set<std::string> techniques;
    std::map<std::string, std::string> technique_texts;
    for (const auto& [name, role] : registry_.roles()) {
      roles.push_back(name);
      role_texts.push_back(role.title);
      for (const std::string& technique : registry_.technique_names(name)) {
        techniques.insert(technique);
        std::string& text = technique_texts[technique];
        text += fmt::format("{}{}/{}: {}", text.empty() ? "" : "; ", name, technique,
                            registry_.find(name + "/" + technique).technique->title);
      }
    }
    Json names = {"none"};
    Json texts = {"the role's neutral value: nobody does the job"};
    for (const std::string& technique : techniques) {
      names.push_back(technique);
      texts.push_back(technique_texts[technique]);
    }
    const auto words = [](Json values, Json docs, std::string_view help) -> Json {
      return {{"type", "string"},
              {"description", help},
              {"enum", std::move(values)},
              {"x-taplo", {{"docs", {{"enumValues", std::move(docs)}}}}}};
    };
    Json properties;
    properties["name"] = {{"type", "string"},
                          {"description", "what other passes and settings call it; unwritten: the role"},
                          {"pattern", "^_?[A-Za-z](_?[A-Za-z0-9])*_?$"},
                          {"not", {{"enum", reserved_names()}}}};
    properties["role"] = words(std::move(roles), std::move(role_texts), "the job of this pass");
    properties["technique"] = words(std::move(names), std::move(texts), "who does the job; swap: change this word");
    properties["params"] = all(every_param_, "parameters of the technique; `heddle list ROLE` shows them");
    properties["inputs"] = all(every_input_, "inputs that are not the last producer above");
    properties["functions"] = all(every_function_, "which passes answer the functions that this one calls");
    properties["serves"] = {{"type", "array"},
                            {"description", "names or types of lights, names of materials that it answers for; [] all"},
                            {"items", {{"type", "string"}}}};
    properties["enabled"] = {{"type", "boolean"}, {"description", "false: as technique none"}, {"default", true}};
    properties["after"] = {{"type", "string"}, {"description", "overlays: the pass that this one stands after"}};
    properties["before"] = {{"type", "string"}, {"description", "overlays: the pass that this one stands before"}};
    return properties;
  }

  static Json equals(std::string_view key, const std::string& value) {
    return {{"properties", {{key, {{"const", value}}}}}, {"required", {key}}};
  }

  Json pass_schema() {
    Json rules = Json::array();
    rules.push_back({{"type", "object"},
                     {"properties", pass_properties()},
                     {"additionalProperties", false},
                     {"anyOf", {{{"required", {"name"}}}, {{"required", {"role"}}}}},
                     {"not", {{"required", {"after", "before"}}}}});
    std::map<std::string, std::vector<const Technique*>, std::less<>> by_name;
    for (const auto& [name, role] : registry_.roles()) {
      Json names = {"none"};
      for (const std::string& technique : registry_.technique_names(name)) names.push_back(technique);
      rules.push_back(
          {{"if", equals("role", name)}, {"then", {{"properties", {{"technique", {{"enum", std::move(names)}}}}}}}});
    }
    const auto parts_of = [](const Technique& technique) {
      Json properties;
      for (const char* part : {"params", "inputs", "functions"}) properties[part] = reference(name_of(technique, part));
      return Json{{"properties", std::move(properties)}};
    };
    for (const Technique* technique : registry_.techniques()) {
      by_name[std::string(technique->name())].push_back(technique);
      Json condition = equals("role", std::string(technique->role_name()));
      condition["properties"]["technique"] = {{"const", technique->name()}};
      condition["required"].push_back("technique");
      rules.push_back({{"if", std::move(condition)}, {"then", parts_of(*technique)}});
    }
    // An overlay may give a pass a technique without saying its role again.
    for (const auto& [name, techniques] : by_name) {
      Json condition = equals("technique", name);
      condition["not"] = {{"required", {"role"}}};
      std::vector<Json> parts;
      for (const Technique* technique : techniques) parts.push_back(parts_of(*technique));
      rules.push_back({{"if", std::move(condition)}, {"then", any_of(parts)}});
    }
    return {{"title", "pass"}, {"description", "a technique in a role"}, {"allOf", std::move(rules)}};
  }

  Json graph_properties() {
    Json joins = Json::object();
    for (const auto& [name, role] : registry_.roles()) {
      if (role.functions.empty()) continue;
      joins[name] = {{"type", "string"}, {"enum", {"switch", "sum", "product"}}};
    }
    const Json size{{"type", "integer"}, {"minimum", 1}, {"maximum", kLargestExtent}};
    Json properties;
    properties["extends"] = {{"type", "string"},
                             {"description",
                              "the graph that this one changes: a file, from this file's folder, or the "
                              "name of a graph that comes with Heddle"}};
    properties["kind"] = {{"type", "string"},
                          {"description",
                           "frame: renders frames (the default); job: bakes, encodes or inspects, once, and keeps "
                           "artifacts and reports"},
                          {"enum", {"frame", "job"}}};
    properties["extent"] = {{"type", "array"}, {"description", "[width, height] of the frame in pixels"},
                            {"items", size},   {"minItems", 2},
                            {"maxItems", 2},   {"default", {kDefaultWidth, kDefaultHeight}}};
    properties["output"] = {
        {"type", "string"},
        {"description", "what images on disk show: \"pass.port\", an image; in a job also an artifact or a report"},
        {"pattern", R"(^[^.]+\.[^.]+$)"}};
    properties["params"] = {{"type", "object"},
                            {"description", "presets: NAME = value, meant by \"$NAME\" in parameters of passes"},
                            {"additionalProperties", reference("value")}};
    properties["joins"] = {{"type", "object"},
                           {"description", "how several answers of a role's functions become one"},
                           {"properties", std::move(joins)},
                           {"additionalProperties", false}};
    properties["remove"] = {{"type", "array"},
                            {"description", "overlays: names of passes that are taken out"},
                            {"items", {{"type", "string"}}}};
    properties["pass"] = {{"type", "array"},
                          {"description", "[[pass]] for each; an unbound input takes the last producer above"},
                          {"items", reference("pass")}};
    return properties;
  }

  const Registry& registry_;
  Json definitions_ = Json::object();
  std::map<std::string, std::vector<Json>> every_param_, every_input_, every_function_;
};

}  // namespace

Json schema(const Registry& registry) {
  return Maker(registry).run();
}

}  // namespace heddle::graph
