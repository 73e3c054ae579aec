// SPDX-License-Identifier: Apache-2.0
// The command `heddle`: an application of heddle.h like any other.

#include "cli/completion.hpp"
#include "cli/new_technique.hpp"
#include "cli/session.hpp"
#include "cli/stop.hpp"
#include "diagnostics.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <exception>
#include <string>
#include <string_view>
#include <vector>

namespace {

/// CLI11 says of a wrong command that some command is required, and not which one it was near to.
void check_command(const CLI::App& app, std::string_view word) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  if (word.starts_with('-') || std::ranges::find(names, word) != names.end()) return;
  const std::string nearest = heddle::nearest_name(word, names);
  throw heddle::cli::Failure{
      HEDDLE_BAD_INPUT,
      fmt::format("error: there is no command '{}'\n  expected: one of {}{}", word, heddle::join_names(names),
                  nearest.empty() ? "" : "\n  help:     did you mean '" + nearest + "'?")};
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Heddle: weave rendering techniques into frame graphs, swap them by a word, and see what accuracy costs"};
  app.set_version_flag("--version", std::string("heddle ") + heddle_version());
  app.require_subcommand(1);
  app.footer(
      "Exit status: 0 right; 1 a bound was exceeded, or a job reported an error; 2 bad input; 3 unsupported here; 4 "
      "failed; 5 a bug; 130 stopped "
      "by "
      "Ctrl-C or SIGTERM, with every file whole or not there; a second signal ends it at once.");
  int status = HEDDLE_OK;
  try {
    // A scene in Python is known by its name alone: before anything else is opened.
    for (int i = 1; i < argc; ++i) {
      const std::string_view word = argv[i];
      constexpr std::array<std::string_view, 6> kRenders{"run", "view", "compare", "check", "explain", "inspect"};
      if (i > 1 && word.ends_with(".py") && std::ranges::find(kRenders, argv[1]) != kRenders.end()) {
        heddle::cli::run_in_python(argc, argv);
      }
    }
    constexpr std::array<std::string_view, 4> kMeasures{"study", "tune", "baseline", "reproduce"};
    if (argc > 1 && std::ranges::find(kMeasures, argv[1]) != kMeasures.end()) heddle::cli::run_in_python(argc, argv);
    heddle::cli::add_run(app, &status);
    heddle::cli::add_view(app, &status);
    heddle::cli::add_compare(app, &status);
    heddle::cli::add_check(app, &status);
    heddle::cli::add_explain(app, &status);
    heddle::cli::add_inspect(app, &status);
    heddle::cli::add_list(app, &status);
    heddle::cli::add_doctor(app, &status);
    heddle::cli::add_new_technique(app);
    heddle::cli::add_study(app);
    heddle::cli::add_tune(app);
    heddle::cli::add_baseline(app);
    heddle::cli::add_reproduce(app);
    heddle::cli::add_bench(app);
    heddle::cli::add_schema(app, &status);
    heddle::cli::add_completion(app, &status);
    // Its words are a line that is being written, no arguments.
    if (argc > 1 && std::string_view(argv[1]) == "complete") {
      heddle::cli::complete(app, {argv + 2, argv + argc});
      return HEDDLE_OK;
    }
    if (argc > 1) check_command(app, argv[1]);
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return error.get_exit_code() == 0 ? app.exit(error) : (app.exit(error), HEDDLE_BAD_INPUT);
  } catch (const heddle::cli::Failure& failure) {
    if (failure.status == HEDDLE_CANCELLED) {
      fmt::print(stderr, "stopped\n");
      return heddle::cli::kStoppedStatus;
    }
    fmt::print(stderr, "{}\n", failure.message);
    return failure.status;
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return HEDDLE_FAILED;
  }
  return status;
}
