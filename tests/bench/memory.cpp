// SPDX-License-Identifier: Apache-2.0
// What the default graph's images take, with transient ones sharing memory and without.
#include "session.hpp"

namespace heddle::bench {

void measure_memory(Session& session) {
  const bool is_small = session.options().is_small;
  const Owned<heddle_scene> scene = session.make_scene();
  fill_with_boxes(session, scene.get(), {{0, 0, 0}, {2, 0, 0}}, 1.0);
  const Owned<heddle_graph> graph =
      session.parse_graph("extends = \"deferred.toml\"\n", {is_small ? "extent=[64,36]" : "extent=[1280,720]"});
  session.render(graph.get(), scene.get());
  const Json stats = session.stats(graph.get());
  Report& report = session.report;
  report.add_number("memory.transient", "bytes", stats["memory"]["transient_bytes"].get<double>());
  report.add_number("memory.transient_without_aliasing", "bytes",
                    stats["memory"]["transient_bytes_without_aliasing"].get<double>());
  report.add_number("memory.kept", "bytes", stats["memory"]["kept_bytes"].get<double>());
  report.add_number("memory.device", "bytes", stats["counters"]["device_memory_bytes"].get<double>());
}

}  // namespace heddle::bench
