// SPDX-License-Identifier: Apache-2.0
#include "roles/readme.hpp"

#include <fstream>
#include <iterator>
#include <sstream>

namespace rendering {

namespace {

std::string number_text(const nlohmann::json& value) {
  std::ostringstream text;
  text << value.get<double>();
  return text.str();
}

std::string list_text(const nlohmann::json& values) {
  std::string text;
  for (const nlohmann::json& value : values) {
    text += (text.empty() ? "" : ", ") + (value.is_string() ? value.get<std::string>() : number_text(value));
  }
  return text;
}

}  // namespace

std::string parameter_table(const nlohmann::json& all, const std::string& id) {
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

std::string readme_of(const std::string& id) {
  std::ifstream file(std::string(HEDDLE_SOURCE_DIR "/plugins/") + id + "/README.md");
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace rendering
