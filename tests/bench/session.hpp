// SPDX-License-Identifier: Apache-2.0
// What benchmarks share: options, folders, the host as an application sees it and as the host's own parts do, time.
#pragma once

#include "graph/execute.hpp"
#include "report.hpp"

#include <heddle/heddle.h>

#include <chrono>
#include <filesystem>
#include <memory>

namespace heddle::bench {

struct Options {
  std::string device;
  int runs = 0;           // 0: each benchmark's own choice
  bool is_small = false;  // sizes that say nothing about time: for tests of what is counted
};

/// Milliseconds since some moment.
double now_ms();
/// Milliseconds that the calling thread has run: what others do to the machine counts little.
double thread_cpu_ms();

struct Destroy {
  void operator()(heddle_host* host) const { heddle_destroy(host); }
  void operator()(heddle_scene* scene) const { heddle_scene_destroy(scene); }
  void operator()(heddle_graph* graph) const { heddle_graph_destroy(graph); }
};
template <class Object>
using Owned = std::unique_ptr<Object, Destroy>;

class Session {
 public:
  explicit Session(Options options);
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  Report report;
  [[nodiscard]] const Options& options() const { return options_; }
  /// `usual` runs, unless the user chose; few for tests.
  [[nodiscard]] int runs(int usual) const;

  // The host's own parts, with the plugins of benchmarks. The device is opened at the first need.
  [[nodiscard]] vulkan::Device& device();
  [[nodiscard]] graph::HostServices& services() { return services_; }
  [[nodiscard]] Registry& registry() { return registry_; }

  // An application's host, on the same device, with the plugins that ship.
  [[nodiscard]] heddle_host* host();
  /// Throws what the host says.
  void check(heddle_status status);
  [[nodiscard]] Owned<heddle_graph> parse_graph(const std::string& text, const std::vector<std::string>& settings = {});
  [[nodiscard]] Owned<heddle_scene> make_scene();
  void render(heddle_graph* graph, heddle_scene* scene);
  [[nodiscard]] Json stats(heddle_graph* graph);
  /// lib/heddle: plugins, graphs.
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

 private:
  Options options_;
  std::filesystem::path folder_;
  Registry registry_;
  std::unique_ptr<vulkan::Device> device_;
  graph::HostServices services_;
  Owned<heddle_host> host_;
};

/// A scene of one rough grey material, boxes at `places`, and a sun that casts shadows.
void fill_with_boxes(Session& session, heddle_scene* scene, const std::vector<std::array<double, 3>>& places,
                     double size);

// One function a benchmark: measures, and adds entries to the session's report.
void measure_graph_overhead(Session& session);
void measure_swap(Session& session);
void measure_gltf_import(Session& session);
void measure_instances(Session& session);
void measure_memory(Session& session);
void measure_compare(Session& session);

}  // namespace heddle::bench
