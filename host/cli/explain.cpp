// SPDX-License-Identifier: Apache-2.0
// heddle explain: what the graph compiler decided, and why.

#include "cli/run_job.hpp"
#include "cli/session.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

namespace heddle::cli {

namespace {

struct ExplainArguments : RenderArguments {
  std::string format = "text";
  std::string pass;
};

int explain(ExplainArguments& arguments) {
  arguments.sort_files();
  const Owned<heddle_host> host = make_host(arguments.host);
  const Owned<heddle_graph> graph = load_graph(host.get(), arguments);
  // With a scene the plan is the real one: pruned by its features, with the driver's sizes.
  // A job may take its time: it is explained as it would run if nothing were there.
  if (!arguments.scene.empty() && !is_job(host.get(), graph.get())) {
    const Owned<heddle_scene> scene = load_scene(host.get(), arguments);
    check(host.get(), heddle_render(graph.get(), scene.get(), nullptr));
  }
  const char* text = nullptr;
  check(host.get(), arguments.pass.empty() ? heddle_graph_explain(graph.get(), arguments.format.c_str(), &text)
                                           : heddle_graph_explain_pass(graph.get(), arguments.pass.c_str(),
                                                                       arguments.format.c_str(), &text));
  fmt::print("{}\n", text);
  return HEDDLE_OK;
}

}  // namespace

void add_explain(CLI::App& app, int* exit_status) {
  CLI::App* command =
      app.add_subcommand("explain", "say what the graph compiler decided and why; with a scene: for that scene");
  auto arguments = std::make_shared<ExplainArguments>();
  arguments->add_to(*command);
  command->add_option("--format", arguments->format, "text, json or dot")
      ->check(CLI::IsMember({"text", "json", "dot"}));
  command->add_flag("--live", arguments->host.live, "as heddle run --live does it");
  command->add_option("--why", arguments->pass,
                      "explain one PASS: why it runs or does not, why it stands where it stands, and where each of its "
                      "settings comes from; text or json");
  command->callback([arguments, exit_status] { *exit_status = explain(*arguments); });
}

}  // namespace heddle::cli
