// SPDX-License-Identifier: Apache-2.0
// The only stage of the graph compiler that touches a device: plans memory and pipelines for a resolved graph, opens
// its plugins, and renders frames.
#pragma once

#include "graph/artifact_cache.hpp"
#include "graph/stages.hpp"
#include "graph/store_file.hpp"
#include "json.hpp"
#include "scene/upload.hpp"
#include "vulkan/shader.hpp"

#include <atomic>
#include <functional>
#include <memory>

namespace heddle::graph {

/// What all graphs of one host share. Made by the host, outlives them.
struct HostServices {
  Registry& registry;
  std::function<vulkan::Device&()> device;  // made at the first call
  std::filesystem::path cache_folder;
  std::function<void(Severity, std::string_view)> log;
  std::atomic<bool>* is_cancelled = nullptr;  // set by any thread; whoever stops for it clears it
  /// How far something long has come, 0 to 1; throws to end it. May be empty.
  std::function<void(std::string_view, double)> progress;
  ArtifactCache artifacts{{}, 0};
  bool remakes_artifacts = false;  // makes them even if the cache has them
  bool checks = false;             // HEDDLE_HOST_CHECK
  bool is_live = false;            // frames are submitted and not waited for; late copies may be older than they should
};

/// Of the frame, from its top left.
struct Pixel {
  std::uint32_t x = 0, y = 0;
};

struct FrameOptions {
  bool profile = false;  // submit and wait stage by stage
  bool anew = false;     // also what is complete and unchanged
  bool cut = false;
  double time = 0, time_step = 0;
  std::uint64_t seed = 0;
};

struct StageTime {
  std::string pass, stage;
  double wall_ms = 0, cpu_ms = 0;  // cpu: all threads of the process
};

struct LoopProgress {
  std::string pass;
  std::uint32_t done = 0, total = 0;  // iterations
};

/// Where what a cached stage made last came from; of a job that an input names: what a pass made.
struct ArtifactUse {
  std::string pass, stage, key, file;  // file: empty if it could not be kept
  std::uint64_t bytes = 0;
  bool is_reused = false;
  std::string job, port;  // empty: of a stage
};

/// What a job's pass leaves: an artifact's bytes, or a report's rows, each a line of JSON.
struct Lasting {
  std::string pass, port, key, file;  // file: empty if it could not be kept
  PortType type = PortType::kArtifact;
  std::shared_ptr<const std::vector<std::byte>> bytes;  // sharers: who reads them, also in other graphs
  bool is_reused = false;
  std::shared_ptr<StorePlace> store = nullptr;  // what lies beside the artifact; sharers: who reads it
};

/// What a run of a job left, by names of resources.
struct JobResult {
  std::map<std::string, Lasting, std::less<>> parts;
  double wall_ms = 0;
};

/// What the last planning of a graph made and what it took over from the plan before.
struct PlanStats {
  std::uint32_t passes_made = 0, passes_kept = 0, pipelines_made = 0, pipelines_kept = 0;
  std::uint32_t pipelines_shared = 0;   // neither made nor of the plan before: others of this host have or had the same
  std::uint32_t passes_redeclared = 0;  // of those that were kept
  double wall_ms = 0;
};

struct ListStats {
  std::string name;
  std::uint32_t capacity = 0, count = 0, overflow = 0;  // elements; in a loop: overflow of its worst iteration
};

/// Of a technique's own counters.
struct CountStats {
  std::string pass, name;
  std::uint64_t count = 0;
};

/// What there was to wait for.
struct WaitStats {
  std::uint64_t waits = 0;        // of the host, for the GPU
  std::uint64_t late_reads = 0;   // copies that stages with latency read
  std::uint64_t stale_reads = 0;  // of these: older than `latency` frames, because that copy was not there yet
};

struct FrameStats {
  std::uint64_t frame = 0;
  double wall_ms = 0;             // recording and running; live: recording
  double submit_ms = 0;           // from the first submission to the last fence
  std::uint64_t stalls = 0;       // cpu stages that waited for the GPU within the frame
  WaitStats waits, total_waits;   // of this frame, and since the graph was loaded
  std::vector<StageTime> stages;  // profiled frames only; iterations of a loop together
  std::vector<LoopProgress> loops;
  std::vector<ListStats> lists;    // of the last frame that was submitted
  std::vector<CountStats> counts;  // of the last frame that was submitted
  vulkan::Counters before, after;
  std::uint64_t instances_drawn = 0, instances_culled = 0;  // summed over the frame's drawings
  std::uint64_t heap_bytes = 0, unaliased_bytes = 0, kept_bytes = 0;
  std::vector<std::string> libraries;  // open for this graph
  PlanStats plan;
  std::vector<ArtifactUse> artifacts;  // one for each stage, since the graph was loaded
};

/// What Executor::check did, when it found nothing.
struct CheckReport {
  std::uint32_t frames = 0, runs = 0;
  std::size_t orders = 0;
  std::size_t unordered_pairs = 0, seen_both_ways = 0;  // of stages
  std::vector<std::uint32_t> poisons;                   // none where memory cannot be filled under an image
  std::vector<std::string> compared;                    // resources whose bytes agreed
  std::uint32_t overflowed = 0;    // frames in which a list had no room: what is in it is a matter of chance
  std::vector<std::string> lists;  // whose elements were put into two orders
};

class Executor {
 public:
  Executor(HostServices& services, ResolvedGraph graph);
  ~Executor();
  Executor(const Executor&) = delete;
  Executor& operator=(const Executor&) = delete;

  /// Asks that a resource stays readable after a frame.
  void keep(std::string_view resource);
  /// Renders another graph from now on, with other ports kept. Passes of the same name, technique and shapes go on with
  /// their objects, pipelines and all that they kept between frames. A graph that cannot be planned throws, and leaves
  /// the present one as it is, its last frame included.
  void replace(ResolvedGraph graph, std::vector<std::string> kept);
  /// Sets the numbers of a parameter that is neither HEDDLE_PARAMETER_REDECLARE nor _CONSTANT: those need `replace`.
  void set_parameter(PassIndex pass, std::size_t parameter, const ParameterValue& value);
  void render(const scene::Scene& scene, const FrameOptions& options);
  /// Of a job: makes the artifacts and reports of these names that are not there yet; no names: all, and the images
  /// that it was asked for. What was complete stays if it throws.
  const JobResult& run_job(const scene::Scene& scene, const FrameOptions& options,
                           const std::vector<std::string>& names = {});
  [[nodiscard]] const JobResult& job_result() const;
  /// Renders a frame, and says what every version of every image port held at these pixels when it was finished, in the
  /// order of execution: {"extent", "frame", "pixels": [{"pixel", "ports": [...]}]}; see heddle_inspect.
  Json inspect(const scene::Scene& scene, const FrameOptions& options, std::vector<Pixel> pixels);
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
  struct Texels {
    std::uint32_t width = 0, height = 0, texel_bytes = 0;
    std::uint64_t size = 0;  // of all, in bytes
    VkFormat format = VK_FORMAT_UNDEFINED;
  };
  /// The same as the device has them.
  Texels read_texels(std::string_view resource, std::uint32_t layer, std::uint32_t mip,
                     std::optional<std::span<std::byte>> bytes);
  [[nodiscard]] const FrameStats& stats() const;
  /// format: text, json or dot. Before the first frame: planned as far as it can be without a scene.
  std::string explain(std::string_view format);
  /// Why a pass runs or does not, why it stands where it stands, where its settings come from; format: text or json.
  /// `written` is what the graph was resolved from.
  std::string explain_pass(const WrittenGraph& written, std::string_view pass, std::string_view format);
  /// As it was resolved, with the parameters of now.
  [[nodiscard]] const ResolvedGraph& graph() const;

  struct State;  // of execute*.cpp

 private:
  std::string with_plan(const std::function<std::string()>& body);

  std::unique_ptr<State> state_;
};

}  // namespace heddle::graph
