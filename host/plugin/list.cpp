// SPDX-License-Identifier: Apache-2.0
// Registry -> JSON, from role.toml files and manifests alone.
#include "plugin/list.hpp"

#include "plugin/technique_json.hpp"

namespace heddle {
namespace {

constexpr std::array<std::string_view, 3> kJoins{"switch", "sum", "product"};

Json range_to_json(const std::optional<std::array<double, 2>>& range) {
  return range ? Json{number_to_json((*range)[0]), number_to_json((*range)[1])} : Json(nullptr);
}

Json physical_to_json(const Role& role) {
  if (role.physical_reference.empty()) return nullptr;
  return {{"technique", role.physical_reference},
          {"params", role.physical_params},
          {"port", role.physical_port},
          {"shared", role.physical_shared}};
}

Json reference_to_json(const std::string& technique, const std::map<std::string, std::string>& params) {
  return technique.empty() ? Json(nullptr) : Json{{"technique", technique}, {"params", params}};
}

Json role_port_to_json(const RolePort& port) {
  Json neutral = Json::array();
  for (const double number : port.neutral) neutral.push_back(number_to_json(number));
  return {{"name", port.name},
          {"direction", to_word(port.direction)},
          {"type", to_word(port.type)},
          {"optional", port.optional},
          {"infinite", port.infinite},
          {"unit", port.unit},
          {"range", range_to_json(port.range)},
          {"neutral", neutral},
          {"glsl", port.glsl},
          {"list", port.is_list},
          {"help", port.help}};
}

Json role_function_to_json(const RoleFunction& function) {
  return {{"name", function.name}, {"signature", function.signature},        {"neutral", function.neutral},
          {"unit", function.unit}, {"range", range_to_json(function.range)}, {"help", function.help}};
}

Json component_to_json(const ComponentType& component) {
  Json properties = Json::array();
  for (const ComponentProperty& property : component.properties) {
    Json json{{"name", property.name}, {"type", kPropertyWords.at(static_cast<std::size_t>(property.type))},
              {"unit", property.unit}, {"range", range_to_json(property.range)},
              {"default", nullptr},    {"choices", property.choices},
              {"help", property.help}};
    if (property.has_default) {
      json["default"] = Json::array();
      for (std::uint32_t k = 0; k < property.count(); ++k) json["default"].push_back(property.default_value[k]);
    }
    properties.push_back(std::move(json));
  }
  Json on = Json::array();
  for (const Owner owner : component.on) on.push_back(to_word(owner));
  return {{"name", component.name}, {"on", on}, {"title", component.title}, {"properties", properties}};
}

Json role_to_json(const Role& role, const Registry& registry) {
  Json ports = Json::array();
  Json functions = Json::array();
  Json hard_cases = Json::array();
  Json components = Json::array();
  for (const RolePort& port : role.ports) ports.push_back(role_port_to_json(port));
  for (const RoleFunction& function : role.functions) functions.push_back(role_function_to_json(function));
  for (const ComponentType& component : role.components) components.push_back(component_to_json(component));
  for (const HardCase& hard_case : role.hard_cases) {
    hard_cases.push_back({{"id", hard_case.id}, {"text", hard_case.text}});
  }
  return {{"name", role.name},
          {"revision", role.revision},
          {"title", role.title},
          {"join", kJoins.at(static_cast<std::size_t>(role.join))},
          {"selector", role.selector},
          {"include", role.include},
          {"references",
           {{"same_model", reference_to_json(role.same_model_reference, role.same_model_params)},
            {"physical", physical_to_json(role)}}},
          {"measure",
           {{"kind", role.measure_kind},
            {"port", role.measure_port},
            {"function", role.measure_function},
            {"metric", role.measure_metric},
            {"note", role.measure_note}}},
          {"ports", ports},
          {"functions", functions},
          {"hard_cases", hard_cases},
          {"components", components},
          {"techniques", registry.technique_names(role.name)},
          {"file", role.file.string()}};
}

}  // namespace

std::string list_json(const Registry& registry) {
  Json roles = Json::array();
  for (const auto& [name, role] : registry.roles()) roles.push_back(role_to_json(role, registry));
  Json techniques = Json::array();
  for (const Technique* technique : registry.techniques()) {
    const Manifest& manifest = *registry.find(technique->id).manifest;
    Json json = technique_to_json(*technique);
    json["role"] = technique->role_name();
    json["name"] = technique->name();
    json["library"] = manifest.library.string();
    json["folder"] = manifest.folder.string();
    json["abi"] = {manifest.abi_major, manifest.abi_minor};
    json["is_loadable"] = manifest.abi_major == HEDDLE_ABI_MAJOR && manifest.abi_minor == HEDDLE_ABI_MINOR;
    techniques.push_back(std::move(json));
  }
  return write_json({{"abi", {HEDDLE_ABI_MAJOR, HEDDLE_ABI_MINOR}}, {"roles", roles}, {"techniques", techniques}}, 1);
}

}  // namespace heddle
