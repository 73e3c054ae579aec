// SPDX-License-Identifier: Apache-2.0
// heddle schema: a JSON Schema of graph files or scene overlays, for editors.

#include "cli/session.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

namespace heddle::cli {

void add_schema(CLI::App& app, int* exit_status) {
  CLI::App* command =
      app.add_subcommand("schema", "print a JSON Schema of graph files or scene overlays, for completion in editors");
  struct Arguments {
    HostArguments host;
    std::string kind = "graph";
  };
  auto arguments = std::make_shared<Arguments>();
  arguments->host.add_to(*command);
  command->add_option("kind", arguments->kind, "graph (the default) or scene")
      ->check(CLI::IsMember({"graph", "scene"}));
  command->callback([arguments, exit_status] {
    const Owned<heddle_host> host = make_host(arguments->host);
    const char* text = nullptr;
    check(host.get(), heddle_schema(host.get(), arguments->kind.c_str(), &text));
    fmt::print("{}\n", text);
    *exit_status = HEDDLE_OK;
  });
}

}  // namespace heddle::cli
