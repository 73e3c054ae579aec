// SPDX-License-Identifier: Apache-2.0
// heddle doctor and heddle devices: what this machine can run, and what happens where it cannot.

#include "cli/session.hpp"
#include "json.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

namespace heddle::cli {

namespace {

std::string indented(std::string text) {
  for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos; at += 5) text.insert(at + 1, "    ");
  return text;
}

void print_device(const Json& device) {
  fmt::print("  {} {} ({}, {} {}, Vulkan {}){}\n", device["index"].get<int>(), device["name"].get<std::string>(),
             device["type"].get<std::string>(), device["driver"].get<std::string>(),
             device["driver_version"].get<std::string>(), device["api"].get<std::string>(),
             device["is_usable"].get<bool>() ? "" : ": not usable, lacks " + device.value("missing", ""));
}

int devices(const HostArguments& arguments, bool as_json) {
  const Owned<heddle_host> host = make_host(arguments);
  const char* text = nullptr;
  check(host.get(), heddle_devices(host.get(), &text));
  if (as_json) {
    fmt::print("{}\n", text);
  } else {
    const Json listed = parse_json(text);
    for (const Json& device : listed["devices"]) print_device(device);
  }
  return HEDDLE_OK;
}

int doctor(const HostArguments& arguments, bool as_json) {
  const Owned<heddle_host> host = make_host(arguments);
  const char* text = nullptr;
  check(host.get(), heddle_doctor(host.get(), &text));
  const Json report = parse_json(text);
  bool is_well = true;
  for (const Json& found : report["checks"]) is_well = is_well && found["found"].get<bool>();
  for (const Json& technique : report["techniques"]) is_well = is_well && technique["runs"].get<bool>();
  if (as_json) {
    fmt::print("{}\n", text);
    return is_well ? HEDDLE_OK : HEDDLE_UNSUPPORTED;
  }
  fmt::print("heddle {}, ABI {}\n", report["version"].get<std::string>(), report["abi"].get<std::string>());
  for (const Json& found : report["checks"]) {
    fmt::print("{} {} (for {})\n", found["found"].get<bool>() ? "ok     " : "MISSING", found["name"].get<std::string>(),
               found["for"].get<std::string>());
    if (found.contains("problem")) fmt::print("    {}\n", indented(found["problem"].get<std::string>()));
  }
  if (report.contains("device")) {
    fmt::print("device in use:\n");
    print_device(report["device"]);
  }
  fmt::print("techniques:\n");
  for (const Json& technique : report["techniques"]) {
    fmt::print("  {} {}\n", technique["runs"].get<bool>() ? "ok " : "NO ", technique["id"].get<std::string>());
    if (technique.contains("problem")) {
      fmt::print("    {}\n    instead: {}\n", indented(technique["problem"].get<std::string>()),
                 technique["instead"].get<std::string>());
    }
  }
  return is_well ? HEDDLE_OK : HEDDLE_UNSUPPORTED;
}

}  // namespace

void add_doctor(CLI::App& app, int* exit_status) {
  struct Arguments {
    HostArguments host;
    bool as_json = false;
  };
  const auto add = [&](const char* name, const char* help, int (*body)(const HostArguments&, bool)) {
    CLI::App* command = app.add_subcommand(name, help);
    auto arguments = std::make_shared<Arguments>();
    arguments->host.add_to(*command);
    command->add_flag("--json", arguments->as_json, "as JSON");
    command->callback([arguments, exit_status, body] { *exit_status = body(arguments->host, arguments->as_json); });
  };
  add("doctor", "check driver, layers and libraries, and what each technique does here", doctor);
  add("devices", "list Vulkan devices", devices);
}

}  // namespace heddle::cli
