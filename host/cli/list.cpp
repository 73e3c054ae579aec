// SPDX-License-Identifier: Apache-2.0
// heddle list: roles and techniques, from manifests alone.

#include "cli/role_page.hpp"
#include "cli/session.hpp"
#include "diagnostics.hpp"
#include "json.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
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

struct ListArguments {
  HostArguments host;
  std::string role, folder;
  bool as_json = false, as_markdown = false;
};

/// A page a role, on standard output or as ROLE.md files of a folder.
void print_pages(const Json& list, const ListArguments& arguments) {
  std::error_code ignored;  // write_file says what is wrong, with the file's name
  if (!arguments.folder.empty()) std::filesystem::create_directories(arguments.folder, ignored);
  for (const Json& role : list["roles"]) {
    const auto name = role["name"].get<std::string>();
    if (!arguments.role.empty() && name != arguments.role) continue;
    const std::string page = role_page(list, role);
    if (arguments.folder.empty()) {
      fmt::print("{}", page);
    } else {
      write_file(std::filesystem::path(arguments.folder) / (name + ".md"), page);
    }
  }
}

int list(const ListArguments& arguments) {
  const std::string& only_role = arguments.role;
  const Owned<heddle_host> host = make_host(arguments.host);
  const char* text = nullptr;
  check(host.get(), heddle_list(host.get(), &text));
  if (arguments.as_json) {
    fmt::print("{}\n", text);
    return HEDDLE_OK;
  }
  const Json list = parse_json(text);
  bool is_known = only_role.empty();
  if (arguments.as_markdown) {
    print_pages(list, arguments);
    is_known =
        is_known || std::ranges::any_of(list["roles"], [&](const Json& role) { return role["name"] == only_role; });
  }
  for (const Json& role : list["roles"]) {
    const auto name = role["name"].get<std::string>();
    if (arguments.as_markdown || (!only_role.empty() && name != only_role)) continue;
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
    const std::string nearest = nearest_name(only_role, names);
    throw Failure{
        HEDDLE_BAD_INPUT,
        fmt::format("error: there is no role '{}'\n  expected: one of {}{}", only_role, fmt::join(names, ", "),
                    nearest.empty() ? "" : "\n  help:     did you mean '" + nearest + "'?")};
  }
  return HEDDLE_OK;
}

}  // namespace

void add_list(CLI::App& app, int* exit_status) {
  CLI::App* command =
      app.add_subcommand("list", "roles and their techniques; with a role: its parameters and components too");
  auto arguments = std::make_shared<ListArguments>();
  arguments->host.add_to(*command);
  command->add_option("role", arguments->role, "only this role");
  command->add_flag("--json", arguments->as_json, "everything, as JSON");
  CLI::Option* markdown = command->add_flag("--markdown", arguments->as_markdown,
                                            "a page a role: contract, techniques, parameters, hard cases");
  command->add_option("--output", arguments->folder, "write the pages as ROLE.md into this folder")->needs(markdown);
  command->callback([arguments, exit_status] { *exit_status = list(*arguments); });
}

}  // namespace heddle::cli
