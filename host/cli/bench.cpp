// SPDX-License-Identifier: Apache-2.0
// heddle bench: starts the program that measures, lib/heddle/bench/heddle-bench, which is built with the tests.

#include "cli/session.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <memory>

namespace heddle::cli {

namespace {

struct BenchArguments {
  std::vector<std::string> names;
  std::string device;
  int runs = 0;
  bool is_small = false, as_json = false;
};

[[noreturn]] void run_program(const BenchArguments& arguments) {
  const std::filesystem::path program = program_folder().parent_path() / "lib" / "heddle" / "bench" / "heddle-bench";
  std::vector<std::string> words{program.string()};
  if (arguments.as_json) words.emplace_back("--json");
  if (arguments.is_small) words.emplace_back("--small");
  if (arguments.runs > 0) words.insert(words.end(), {"--runs", std::to_string(arguments.runs)});
  if (!arguments.device.empty()) words.insert(words.end(), {"--device", arguments.device});
  words.insert(words.end(), arguments.names.begin(), arguments.names.end());
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  execv(program.c_str(), pointers.data());
  throw Failure{HEDDLE_UNSUPPORTED,
                fmt::format("error: the benchmarks are not there\n  expected: {}\n  help:     build "
                            "with HEDDLE_TESTS=ON, as scripts/setup does",
                            program.string())};
}

}  // namespace

void add_bench(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "bench", "measure what the host itself costs on this machine: medians, intervals, counts of work, targets");
  auto arguments = std::make_shared<BenchArguments>();
  command->add_option("benchmark", arguments->names,
                      "graph_overhead, swap, gltf_import, instances, memory, compare; none: all of them");
  command->add_option("--device", arguments->device, "part of a device's name, or its number (see heddle devices)");
  command->add_option("--runs", arguments->runs, "samples of each figure; default: each benchmark's own")
      ->check(CLI::Range(1, 100000));
  command->add_flag("--small", arguments->is_small, "sizes that say nothing about time, to see that all runs");
  command->add_flag("--json", arguments->as_json,
                    "{\"machine\": {...}, \"entries\": [{\"name\", \"value\", \"unit\", ...}]}");
  command->callback([arguments] { run_program(*arguments); });
}

}  // namespace heddle::cli
