// SPDX-License-Identifier: Apache-2.0
// heddle check: proves that a graph does what it declares, whatever the order of its stages and the state of memory.

#include "cli/session.hpp"
#include "json.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>

namespace heddle::cli {

namespace {

struct CheckArguments : RenderArguments {
  std::vector<std::string> ports;
  bool json = false;
};

int check_graph(CheckArguments& arguments) {
  arguments.host.check = true;
  const Opened opened = open(arguments, arguments.ports);
  heddle_render_options options{};
  options.struct_size = sizeof options;
  options.time = arguments.time;
  options.seed = arguments.seed;
  // What a frame leaves to the next one comes round in the third.
  const auto frames = static_cast<std::uint32_t>(std::max(arguments.frames, 3));
  const char* text = nullptr;
  check(opened.host.get(), heddle_graph_check(opened.graph.get(), opened.scene.get(), &options, frames, &text));
  if (arguments.json) {
    fmt::print("{}\n", text);
    return HEDDLE_OK;
  }
  const Json report = parse_json(text);
  const auto join = [](const Json& list) {
    return fmt::format("{}", fmt::join(list.get<std::vector<std::string>>(), ", "));
  };
  fmt::print("{} runs of {} frames, nothing found\n", report["runs"].get<int>(), report["frames"].get<int>());
  fmt::print("  hazards  every read-after-write, write-after-read, write-after-write and layout is covered\n");
  fmt::print("  numbers  no pass makes NaN, nor Inf or values out of range where its role forbids them\n");
  fmt::print("  orders   {}; of {} pairs of stages that nothing puts in order, {} were seen both ways\n",
             report["orders"].get<int>(), report["unordered_pairs"].get<int>(), report["seen_both_ways"].get<int>());
  fmt::print("  memory   {}\n", report["poisons"].empty()
                                    ? "left as it is: on this device nobody can fill the bytes of an image"
                                    : "filled before its first and after its last use with " + join(report["poisons"]));
  if (!report["lists"].empty()) {
    const int overflowed = report["overflowed"].get<int>();
    fmt::print("  lists    {}: what a stage appends was seen in two orders{}\n", join(report["lists"]),
               overflowed == 0 ? ""
                               : fmt::format("; {} of {} frames are not compared, a list had no room in them",
                                             overflowed, report["frames"].get<int>()));
  }
  fmt::print("  bytes    {} agree in all runs\n", join(report["compared"]));
  return HEDDLE_OK;
}

}  // namespace

void add_check(CLI::App& app, int* exit_status) {
  CLI::App* command = app.add_subcommand(
      "check",
      "prove that a graph does what it declares: hazards, numbers, orders of stages, memory that nobody wrote");
  auto arguments = std::make_shared<CheckArguments>();
  arguments->add_to(*command);
  add_port_option(*command, arguments->ports, "compare this port too, PASS.PORT; may be given again");
  command->add_flag("--json", arguments->json, "print what was done as JSON");
  command->callback([arguments, exit_status] { *exit_status = check_graph(*arguments); });
}

}  // namespace heddle::cli
