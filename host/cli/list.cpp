// SPDX-License-Identifier: Apache-2.0
// heddle list: roles and techniques, from manifests alone.

#include "cli/session.hpp"
#include "json.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

namespace heddle::cli {

namespace {

void print_parameters(const Json& technique) {
  for (const Json& parameter : technique["parameters"]) {
    std::string ladder;
    if (parameter.contains("ladder") && !parameter["ladder"].empty())
      ladder = "  ladder " + write_json(parameter["ladder"]);
    fmt::print("      {:<22} {:<8} {}{}\n", parameter["name"].get<std::string>(), parameter.value("unit", ""),
               parameter.value("help", ""), ladder);
  }
}

void print_components(const Json& role) {
  for (const Json& component : role["components"]) {
    std::string on;
    for (const Json& owner : component["on"]) on += (on.empty() ? "" : ", ") + owner.get<std::string>();
    fmt::print("  component {}, on {}: {}\n", component["name"].get<std::string>(), on, component.value("title", ""));
    for (const Json& property : component["properties"]) {
      fmt::print("      {:<22} {:<8} {}\n", property["name"].get<std::string>(), property.value("unit", ""),
                 property.value("help", ""));
    }
  }
}

int list(const HostArguments& arguments, const std::string& only_role, bool as_json) {
  const Owned<heddle_host> host = make_host(arguments);
  const char* text = nullptr;
  check(host.get(), heddle_list(host.get(), &text));
  if (as_json) {
    fmt::print("{}\n", text);
    return HEDDLE_OK;
  }
  const Json list = parse_json(text);
  bool is_known = only_role.empty();
  for (const Json& role : list["roles"]) {
    const auto name = role["name"].get<std::string>();
    if (!only_role.empty() && name != only_role) continue;
    is_known = true;
    fmt::print("{}: {}\n", name, role.value("title", ""));
    for (const Json& technique : list["techniques"]) {
      if (technique["role"] != name) continue;
      const auto id = technique["id"].get<std::string>();
      fmt::print("  {:<24} {}{}\n", id.substr(id.find('/') + 1), technique.value("title", ""),
                 technique.value("is_reference", false) ? " [reference]" : "");
      if (!only_role.empty()) print_parameters(technique);
    }
    if (!only_role.empty()) print_components(role);
  }
  if (!is_known) {
    std::vector<std::string> names;
    for (const Json& role : list["roles"]) names.push_back(role["name"].get<std::string>());
    throw Failure{HEDDLE_BAD_INPUT, fmt::format("error: there is no role '{}'\n  expected: one of {}", only_role,
                                                fmt::join(names, ", "))};
  }
  return HEDDLE_OK;
}

}  // namespace

void add_list(CLI::App& app, int* exit_status) {
  CLI::App* command =
      app.add_subcommand("list", "roles and their techniques; with a role: its parameters and components too");
  struct Arguments {
    HostArguments host;
    std::string role;
    bool as_json = false;
  };
  auto arguments = std::make_shared<Arguments>();
  arguments->host.add_to(*command);
  command->add_option("role", arguments->role, "only this role");
  command->add_flag("--json", arguments->as_json, "everything, as JSON");
  command->callback(
      [arguments, exit_status] { *exit_status = list(arguments->host, arguments->role, arguments->as_json); });
}

}  // namespace heddle::cli
