// SPDX-License-Identifier: Apache-2.0
// The table of parameters that a technique's README must have, made from its descriptor as `heddle list` gives it.
#pragma once

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

namespace rendering {

inline std::string number_text(const nlohmann::json& value) {
  std::ostringstream text;
  text << value.get<double>();
  return text.str();
}

inline std::string list_text(const nlohmann::json& values) {
  std::string text;
  for (const nlohmann::json& value : values) {
    text += (text.empty() ? "" : ", ") + (value.is_string() ? value.get<std::string>() : number_text(value));
  }
  return text;
}

/// Rows of the technique `id` out of the JSON of heddle_list; "" if it is not there.
inline std::string parameter_table(const nlohmann::json& all, const std::string& id) {
  std::string table;
  for (const nlohmann::json& technique : all["techniques"]) {
    if (technique["id"] != id) continue;
    for (const nlohmann::json& p : technique["parameters"]) {
      const nlohmann::json& choices = p["choices"];
      const bool is_choice = !choices.empty();
      const std::string ladder = list_text(p["ladder"]);
      table +=
          "| " + p["name"].get<std::string>() + " | " + p["unit"].get<std::string>() + " | " +
          (is_choice ? list_text(choices) : number_text(p["minimum"]) + " .. " + number_text(p["maximum"])) + " | " +
          (is_choice ? choices[p["default"][0].get<std::size_t>()].get<std::string>() : number_text(p["default"][0])) +
          " | " + p["help"].get<std::string>() + " |" + (ladder.empty() ? "" : " " + ladder) + " |\n";
    }
  }
  return table;
}

inline std::string readme_of(const std::string& id) {
  std::ifstream file(std::string(HEDDLE_SOURCE_DIR "/plugins/") + id + "/README.md");
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace rendering
