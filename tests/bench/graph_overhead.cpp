// SPDX-License-Identifier: Apache-2.0
// What a graph costs beside the work of its passes: frames of the host against the same commands recorded by hand, and
// the host's time for passes that do nothing.
#include "hand_recorded.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace heddle::bench {
namespace {

class HostChain {
 public:
  HostChain(Session& session, const Chain& chain) : executor_(session.services(), resolved(session, chain)) {}

  FrameTime frame() {
    const double start = now_ms(), cpu_start = thread_cpu_ms();
    executor_.render(scene_, {});
    const double cpu = thread_cpu_ms() - cpu_start;
    return {now_ms() - start, executor_.stats().submit_ms, cpu};
  }
  [[nodiscard]] const graph::FrameStats& stats() const { return executor_.stats(); }
  [[nodiscard]] std::vector<float> read() { return executor_.read({}, 0, 0).pixels; }

 private:
  static graph::ResolvedGraph resolved(Session& session, const Chain& chain) {
    std::string text =
        fmt::format("extent = [{}, {}]\noutput = \"p{}.result\"\n", chain.width, chain.height, chain.passes - 1);
    for (std::uint32_t i = 0; i < chain.passes; ++i) {
      text += fmt::format(
          "[[pass]]\nname = \"p{}\"\nrole = \"chain\"\ntechnique = \"work\"\nparams.iterations = {}\nparams.is_empty = "
          "{}\n",
          i, chain.iterations, chain.is_empty);
      text += i > 0 ? fmt::format("inputs.previous = \"p{}.result\"\n", i - 1) : "inputs.previous = \"none\"\n";
    }
    return graph::resolve(graph::parse(text, "chain.toml"), session.registry());
  }

  scene::Scene scene_;
  graph::Executor executor_;
};

struct Samples {
  std::vector<double> wall, host, cpu;  // milliseconds; host: all but submission to fence
  void add(const FrameTime& time) {
    wall.push_back(time.wall_ms);
    host.push_back(time.wall_ms - time.submit_ms);
    cpu.push_back(time.cpu_ms);
  }
};

struct Both {
  Samples graph, hand;
};

/// Host and hand take turns, A B B A.
Both take_turns(HostChain& graph, HandRecorded& hand, int runs) {
  Both both;
  for (int warm = 0; warm < 3; ++warm) {
    graph.frame();
    hand.frame();
  }
  for (int run = 0; run < runs; ++run) {
    if (run % 2 == 0) both.graph.add(graph.frame());
    both.hand.add(hand.frame());
    if (run % 2 != 0) both.graph.add(graph.frame());
  }
  return both;
}

/// Iterations for which a pass takes about `wanted` milliseconds on this device.
int calibrate(Session& session, Chain chain, double wanted) {
  for (chain.iterations = 1; chain.iterations < 30000; chain.iterations *= 2) {
    HandRecorded hand(session, chain);
    std::vector<double> samples;
    for (int i = 0; i < 5; ++i) samples.push_back(hand.frame().submit_ms / chain.passes);
    const double found = median_of(samples).value;
    if (found >= wanted) return std::max(1, static_cast<int>(std::lround(chain.iterations * wanted / found)));
  }
  return chain.iterations;
}

void add_counts(Report& report, const std::string& name, const vulkan::Counters& before,
                const vulkan::Counters& after) {
  const auto add = [&](const char* what, std::uint64_t count) {
    report.add_number(fmt::format("graph_overhead.{}_{}", name, what), "1", static_cast<double>(count));
  };
  add("commands", after.commands - before.commands);
  add("dispatches", after.dispatches - before.dispatches);
  add("barriers", after.barriers - before.barriers);
  add("barrier_parts", after.barrier_parts - before.barrier_parts);
}

std::vector<double> per_pass_us(const std::vector<double>& ms, std::uint32_t passes) {
  std::vector<double> us;
  for (const double value : ms) us.push_back(1e3 * value / passes);
  return us;
}

}  // namespace

void measure_graph_overhead(Session& session) {
  const bool is_small = session.options().is_small;
  Report& report = session.report;
  Chain chain;
  chain.passes = is_small ? 4 : 20;
  chain.width = chain.height = is_small ? 16 : 64;
  chain.iterations = is_small ? 2 : calibrate(session, chain, 0.1);
  {
    HostChain graph(session, chain);
    HandRecorded hand(session, chain);
    const Both times = take_turns(graph, hand, session.runs(60));
    if (graph.read() != hand.read()) throw Error(HEDDLE_BUG, "the graph and the hand-recorded chain differ in a pixel");
    report.add_measured("graph_overhead.frame_ratio", "1", ratios(times.graph.wall, times.hand.wall), 1.05);
    report.add_measured("graph_overhead.graph_frame", "ms", times.graph.wall);
    report.add_measured("graph_overhead.hand_frame", "ms", times.hand.wall);
    report.add_measured("graph_overhead.hand_pass", "us", per_pass_us(times.hand.wall, chain.passes));
    report.add_number("graph_overhead.passes", "1", chain.passes);
    add_counts(report, "graph", graph.stats().before, graph.stats().after);
    const vulkan::Counters before = session.device().counters();
    hand.frame();
    add_counts(report, "hand", before, session.device().counters());
  }
  chain.is_empty = true;
  chain.iterations = 0;
  chain.passes = is_small ? 8 : 200;
  HostChain graph(session, chain);
  HandRecorded hand(session, chain);
  const Both times = take_turns(graph, hand, session.runs(100));
  report.add_measured("graph_overhead.host_us_per_pass", "us", per_pass_us(times.graph.host, chain.passes), 5.0);
  report.add_measured("graph_overhead.hand_us_per_pass", "us", per_pass_us(times.hand.host, chain.passes));
  report.add_measured("graph_overhead.host_cpu_us_per_pass", "us", per_pass_us(times.graph.cpu, chain.passes));
  report.add_measured("graph_overhead.hand_cpu_us_per_pass", "us", per_pass_us(times.hand.cpu, chain.passes));
  report.add_number("graph_overhead.empty_passes", "1", chain.passes);
}

}  // namespace heddle::bench
