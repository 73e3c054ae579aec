// SPDX-License-Identifier: Apache-2.0
#include "view/catalog.hpp"

#include <algorithm>

namespace heddle::view {

const Json* technique_of(const Json& list, const Json& pass) {
  for (const Json& technique : list.at("techniques"))
    if (technique.at("role") == pass.at("role") && technique.at("name") == pass.at("technique")) return &technique;
  return nullptr;
}

const Json* pass_of(const Json& description, const std::string& name) {
  for (const Json& pass : description.at("passes"))
    if (pass.at("name") == name) return &pass;
  return nullptr;
}

const Json* parameter_of(const Json& list, const Json& pass, const std::string& name) {
  const Json* technique = technique_of(list, pass);
  if (technique == nullptr) return nullptr;
  for (const Json& parameter : technique->at("parameters"))
    if (parameter.at("name") == name) return &parameter;
  return nullptr;
}

bool remembers(const Json& description, const Json& list) {
  for (const Json& pass : description.at("passes")) {
    const Json* technique = technique_of(list, pass);
    if (technique == nullptr || pass.at("is_left_out") == true) continue;
    for (const Json& port : technique->value("ports", Json::array())) {
      const Json flags = port.value("flags", Json::array());
      const bool is_kept = flags.is_array() && std::ranges::find(flags, Json("kept")) != flags.end();
      const bool is_list = flags.is_array() && std::ranges::find(flags, Json("list")) != flags.end();
      if (is_kept || is_list || !port.value("previous_of", std::string{}).empty()) return true;
    }
    for (const Json& stage : technique->value("stages", Json::array()))
      if (stage.value("latency", 0) > 0) return true;
    const Json inputs = pass.value("inputs", Json::object());
    for (const auto& [port, bound] : inputs.items())
      if (bound.is_string() && bound.get<std::string>().ends_with("@previous")) return true;
  }
  return false;
}

}  // namespace heddle::view
