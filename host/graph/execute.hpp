// SPDX-License-Identifier: Apache-2.0
// The only stage of the graph compiler that touches a device: plans memory and pipelines for a resolved graph, opens
// its plugins, and renders frames.
#pragma once

#include "graph/stages.hpp"
#include "scene/upload.hpp"
#include "vulkan/shader.hpp"

#include <functional>

namespace heddle::graph {

/// What all graphs of one host share. Made by the host, outlives them.
struct HostServices {
  Registry& registry;
  std::function<vulkan::Device&()> device;  // made at the first call
  std::filesystem::path cache_folder;
  std::function<void(Severity, std::string_view)> log;
  /// How far something long has come, 0 to 1; throws to end it. May be empty.
  std::function<void(std::string_view, double)> progress;
};

struct FrameOptions {
  bool profile = false;  // submit and wait stage by stage
  bool cut = false;
  double time = 0, time_step = 0;
  std::uint64_t seed = 0;
};

struct StageTime {
  std::string pass, stage;
  double wall_ms = 0, cpu_ms = 0;  // cpu: all threads of the process
};

struct FrameStats {
  std::uint64_t frame = 0;
  double wall_ms = 0;             // recording and running
  double submit_ms = 0;           // from the first submission to the last fence
  std::vector<StageTime> stages;  // profiled frames only
  vulkan::Counters before, after;
  std::uint64_t heap_bytes = 0, unaliased_bytes = 0, kept_bytes = 0;
  std::vector<std::string> libraries;  // open for this graph
};

/// What Executor::check did, when it found nothing.
struct CheckReport {
  std::uint32_t frames = 0, runs = 0;
  std::size_t orders = 0;
  std::size_t unordered_pairs = 0, seen_both_ways = 0;  // of stages
  std::vector<std::uint32_t> poisons;                   // none where memory cannot be filled under an image
  std::vector<std::string> compared;                    // resources whose bytes agreed
};

class Executor {
 public:
  Executor(HostServices& services, ResolvedGraph graph);
  ~Executor();
  Executor(const Executor&) = delete;
  Executor& operator=(const Executor&) = delete;

  /// Asks that a resource stays readable after a frame; the next frame plans anew.
  void keep(std::string_view resource);
  /// Sets a parameter's numbers; plans anew if the parameter asks for it.
  void set_parameter(PassIndex pass, std::size_t parameter, const ParameterValue& value);
  void render(const scene::Scene& scene, const FrameOptions& options);
  /// Renders frames from the first on, again and again: in every order that declared accesses allow, over memory that
  /// is filled before its first and after its last use. On a device in check mode. Throws Error(HEDDLE_BUG) if a byte
  /// of a kept resource differs, or for what check mode finds in one of the runs. Afterwards the graph is as before its
  /// first frame.
  CheckReport check(const scene::Scene& scene, const FrameOptions& options, std::uint32_t frames);
  /// Texels of a kept resource as float32 and their shape. Empty name: the output.
  struct ReadBack {
    std::uint32_t width = 0, height = 0, channels = 0;
    std::vector<float> pixels;
  };
  ReadBack read(std::string_view resource, std::uint32_t layer, std::uint32_t mip);
  /// The same into `pixels`, or nothing but the shape if that is empty; the answer's own pixels are empty.
  ReadBack read_into(std::string_view resource, std::uint32_t layer, std::uint32_t mip,
                     std::optional<std::span<float>> pixels);
  [[nodiscard]] const FrameStats& stats() const;
  /// format: text, json or dot. Before the first frame: planned as far as it can be without a scene.
  std::string explain(std::string_view format);
  [[nodiscard]] const ResolvedGraph& graph() const;

  struct State;  // of execute*.cpp

 private:
  std::unique_ptr<State> state_;
};

}  // namespace heddle::graph
