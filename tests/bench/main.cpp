// SPDX-License-Identifier: Apache-2.0
// The program behind `heddle bench`, which gives it checked arguments: [--json] [--small] [--runs N] [--device NAME]
// [BENCHMARK ...]. Runs the benchmarks, each after the other, and prints one report.
#include "session.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <string_view>

namespace {

struct Benchmark {
  std::string_view name;
  void (*measure)(heddle::bench::Session&);
};
constexpr std::array<Benchmark, 6> kBenchmarks{{{"graph_overhead", heddle::bench::measure_graph_overhead},
                                                {"swap", heddle::bench::measure_swap},
                                                {"gltf_import", heddle::bench::measure_gltf_import},
                                                {"instances", heddle::bench::measure_instances},
                                                {"memory", heddle::bench::measure_memory},
                                                {"compare", heddle::bench::measure_compare}}};

int run(int argc, char** argv) {
  heddle::bench::Options options;
  bool as_json = false;
  std::vector<std::string_view> wanted;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    const bool has_value = i + 1 < argc;
    if (word == "--json") {
      as_json = true;
    } else if (word == "--small") {
      options.is_small = true;
    } else if (word == "--runs" && has_value) {
      options.runs = std::atoi(argv[++i]);
    } else if (word == "--device" && has_value) {
      options.device = argv[++i];
    } else {
      wanted.push_back(word);
    }
  }
  for (const std::string_view name : wanted) {
    const bool is_known = std::any_of(kBenchmarks.begin(), kBenchmarks.end(),
                                      [&](const Benchmark& benchmark) { return benchmark.name == name; });
    if (is_known) continue;
    std::vector<std::string_view> names;
    for (const Benchmark& benchmark : kBenchmarks) names.push_back(benchmark.name);
    throw heddle::Error(HEDDLE_BAD_INPUT, heddle::Diagnostic{heddle::Severity::kError,
                                                             {},
                                                             fmt::format("there is no benchmark '{}'", name),
                                                             "",
                                                             fmt::format("one of {}", fmt::join(names, ", ")),
                                                             ""});
  }
  heddle::bench::Session session(options);
  session.report.is_smoke_run = options.is_small;
  session.report.machine = heddle::bench::describe_machine();
  const heddle::vulkan::DeviceInfo& device = session.device().info();
  session.report.machine["device"] = device.name;
  session.report.machine["driver"] = device.driver;
  session.report.machine["driver_version"] = device.driver_version;
  for (const Benchmark& benchmark : kBenchmarks) {
    if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), benchmark.name) == wanted.end()) continue;
    if (!as_json) fmt::print(stderr, "measuring {}\n", benchmark.name);
    benchmark.measure(session);
  }
  fmt::print("{}\n", as_json ? heddle::write_json(session.report.to_json(), 2) : session.report.to_text());
  return HEDDLE_OK;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const heddle::Error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return error.status();
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return HEDDLE_FAILED;
  }
}
