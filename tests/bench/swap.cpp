// SPDX-License-Identifier: Apache-2.0
// What it takes to exchange one pass's technique in a graph that runs: from the setting to the end of the first frame,
// through the C API as an application does it.
//
// Compiling is not the host's: time in vkCreate*Pipelines is counted and taken out (there is none: the host keeps the
// pipelines of both techniques), and so is the time from submission to fence, in which drivers that compile at first
// use do so. What is left, beyond that of a steady frame, is the host's own: resolving, planning, opening plugins,
// placing memory, filling it again.
#include "session.hpp"

#include <algorithm>

namespace heddle::bench {
namespace {

struct Reading {
  double submit_ms = 0, pipeline_ms = 0;
  std::uint64_t pipelines = 0;  // that the last plan needed and the one before it did not have
  std::uint64_t uploaded = 0;
};

Reading read(Session& session, heddle_graph* graph) {
  const Json stats = session.stats(graph);
  const Json& counters = stats["counters"];
  const Json& plan = stats["plan"];
  return {stats["submit_ms"].get<double>(), counters["pipeline_total_ms"].get<double>(),
          plan["pipelines_made"].get<std::uint64_t>() + plan["pipelines_shared"].get<std::uint64_t>(),
          counters["uploaded_bytes"].get<std::uint64_t>()};
}

}  // namespace

void measure_swap(Session& session) {
  const bool is_small = session.options().is_small;
  const Owned<heddle_scene> scene = session.make_scene();
  std::vector<std::array<double, 3>> places;
  for (int i = 0; i < (is_small ? 4 : 1000); ++i)
    places.push_back({1.5 * (i % 32), 1.5 * ((i / 32) % 8), 1.5 * (i / 256)});
  fill_with_boxes(session, scene.get(), places, 1.0);
  std::vector<std::string> settings_of_all{is_small ? "extent=[32,16]" : "extent=[320,180]"};
  if (is_small) settings_of_all.emplace_back("sky.technique=uniform");  // fewer pipelines
  const Owned<heddle_graph> graph = session.parse_graph("extends = \"deferred.toml\"\n", settings_of_all);
  // Each technique once, so that shaders are compiled and the driver's cache has them.
  const std::array<const char*, 2> settings{"ao.technique=none", "ao.technique=gtao"};
  for (const char* setting : settings) {
    session.check(heddle_graph_set(graph.get(), setting));
    session.render(graph.get(), scene.get());
  }
  std::vector<double> host, total, pipelines_ms, first_submit;
  std::vector<double> pipelines;
  const int swaps = 2 * (is_small ? 1 : session.runs(10));
  for (int run = 0; run < swaps; ++run) {
    session.render(graph.get(), scene.get());
    const double steady_start = now_ms();
    session.render(graph.get(), scene.get());
    const double steady_wall = now_ms() - steady_start;
    const Reading before = read(session, graph.get());
    const double start = now_ms();
    session.check(heddle_graph_set(graph.get(), settings[static_cast<std::size_t>(run % 2)]));
    session.render(graph.get(), scene.get());
    const double wall = now_ms() - start;
    const Reading after = read(session, graph.get());
    const double pipeline = after.pipeline_ms - before.pipeline_ms;
    total.push_back(wall);
    pipelines_ms.push_back(pipeline);
    first_submit.push_back(after.submit_ms);
    host.push_back(wall - pipeline - after.submit_ms - (steady_wall - before.submit_ms));
    pipelines.push_back(static_cast<double>(after.pipelines));
  }
  Report& report = session.report;
  report.add_measured("swap.host", "ms", host, 100.0);
  report.add_measured("swap.total", "ms", total);
  report.add_measured("swap.creating_pipelines", "ms", pipelines_ms);
  report.add_measured("swap.first_submission", "ms", first_submit);
  report.add_number("swap.pipelines_to_none", "1", pipelines[0]);
  report.add_number("swap.pipelines_to_gtao", "1", pipelines[1]);
}

}  // namespace heddle::bench
