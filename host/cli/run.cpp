// SPDX-License-Identifier: Apache-2.0
// heddle run: renders a scene through a graph and writes images of its ports.

#include "cli/run_job.hpp"
#include "cli/session.hpp"
#include "cli/stop.hpp"
#include "cli/watch.hpp"
#include "json.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <optional>

namespace heddle::cli {

namespace {

struct RunArguments : RenderArguments {
  std::vector<std::string> outputs;
  std::string stats;
  bool profile = false, watch = false;
  double time_step = 1.0 / 60.0;
};

/// Where "frame_%04d.png" has its number: from the % to behind the d, with at most two digits between; nothing for a
/// file of one frame.
std::optional<std::pair<std::size_t, std::size_t>> number_place(const std::string& file) {
  const std::size_t percent = file.find('%');
  if (percent == std::string::npos) return std::nullopt;
  const std::size_t end = file.find_first_not_of("0123456789", percent + 1);
  if (end == std::string::npos || file[end] != 'd' || end - percent > 3) return std::nullopt;
  return std::pair(percent, end + 1);
}

std::filesystem::path frame_file(const std::filesystem::path& file, int frame) {
  const std::string text = file.string();
  const auto place = number_place(text);
  if (!place) return file;
  const auto [first, last] = *place;
  const int width = last - first > 2 ? std::stoi(text.substr(first + 1, last - first - 2)) : 0;
  return text.substr(0, first) + fmt::format("{:0{}}", frame, width) + text.substr(last);
}

void print_stages(const Json& stats) {
  fmt::print("{:<16} {:<16} {:>10} {:>10}\n", "pass", "stage", "wall ms", "CPU ms");
  for (const auto& stage : stats["stages"]) {
    fmt::print("{:<16} {:<16} {:>10.3f} {:>10.3f}\n", stage["pass"].get<std::string>(),
               stage["stage"].get<std::string>(), stage["wall_ms"].get<double>(), stage["cpu_ms"].get<double>());
  }
  fmt::print("Each stage was submitted and waited for alone; their sum is not a frame's time.\n");
}

/// Wall times of frames: the first, which compiles, apart from those after it.
Json times_of(std::vector<double> frame_ms) {
  Json times{{"frames", frame_ms.size()}, {"first_ms", frame_ms.front()}};
  frame_ms.erase(frame_ms.begin());
  if (frame_ms.empty()) return times;
  std::sort(frame_ms.begin(), frame_ms.end());
  const std::size_t middle = frame_ms.size() / 2;
  times["median_ms"] = frame_ms.size() % 2 != 0 ? frame_ms[middle] : 0.5 * (frame_ms[middle - 1] + frame_ms[middle]);
  times["minimum_ms"] = frame_ms.front();
  times["maximum_ms"] = frame_ms.back();
  return times;
}

/// All frames of the arguments, with their outputs and what is said of them.
void render_frames(const RunArguments& arguments, heddle_host* host, heddle_graph* graph, heddle_scene* scene,
                   const std::vector<Output>& outputs) {
  heddle_render_options options{};
  options.struct_size = sizeof options;
  options.seed = arguments.seed;
  options.time_step = arguments.time_step;
  const char* text = nullptr;
  std::vector<double> frame_ms;
  Writing writing;
  for (int frame = 0; frame < arguments.frames; ++frame) {
    const bool is_last = frame + 1 == arguments.frames;
    stop_if_asked();
    options.time = arguments.time + frame * arguments.time_step;
    options.flags = arguments.profile && is_last ? HEDDLE_RENDER_PROFILE : 0U;
    check(host, heddle_render(graph, scene, &options));
    check(host, heddle_stats(graph, &text));
    frame_ms.push_back(parse_json(text)["wall_ms"].get<double>());
    for (const Output& output : outputs) {
      if (!is_last && !number_place(output.file.string())) continue;
      stop_if_asked();
      writing.write([&] {
        const std::filesystem::path file = frame_file(output.file, frame);
        write_port(host, graph, output.port, file);
        say(arguments.host, fmt::format("wrote {}", file.string()));
      });
    }
    if (!is_last) writing.finish();
  }
  if (arguments.host.check)
    say(arguments.host,
        fmt::format("checked {} frames: every hazard and layout is covered, and every pass keeps to its "
                    "role's numbers",
                    arguments.frames));
  Json parsed = parse_json(text);
  parsed["run"] = times_of(frame_ms);
  if (arguments.stats == "-") {
    fmt::print("{}\n", write_json(parsed, 2));
  } else if (!arguments.stats.empty()) {
    write_file(arguments.stats, write_json(parsed, 2) + "\n");
  }
  if (arguments.profile) print_stages(parsed);
  for (const Json& loop : parsed["loops"]) {
    const bool is_complete = loop["done"] == loop["total"];
    say(arguments.host,
        fmt::format("loop of pass '{}': {} of {} iterations{}", loop["pass"].get<std::string>(),
                    loop["done"].get<std::uint32_t>(), loop["total"].get<std::uint32_t>(),
                    is_complete ? "" : "; more --frames go on where nothing changes, as with --time-step 0"));
  }
  for (const Json& artifact : parsed["artifacts"]) {
    say(arguments.host,
        fmt::format("artifact {}: {}, {:.1f} MiB",
                    artifact.contains("job")
                        ? fmt::format("'{}#{}.{}'", artifact["job"].get<std::string>(),
                                      artifact["pass"].get<std::string>(), artifact["port"].get<std::string>())
                        : fmt::format("of pass '{}', {}", artifact["pass"].get<std::string>(),
                                      artifact["stage"].get<std::string>()),
                    artifact["origin"] == "cache" ? "from the cache" : "made",
                    artifact["bytes"].get<double>() / 1048576.0));
  }
  say(arguments.host,
      fmt::format("frame {} on {}: {:.1f} ms; transient memory {:.1f} MiB ({:.1f} MiB without aliasing)",
                  arguments.frames - 1, parsed["device"]["name"].get<std::string>(), parsed["wall_ms"].get<double>(),
                  parsed["memory"]["transient_bytes"].get<double>() / 1048576.0,
                  parsed["memory"]["transient_bytes_without_aliasing"].get<double>() / 1048576.0));
  if (arguments.host.live) {
    const Json& total = parsed["late"]["total"];
    say(arguments.host, fmt::format("live: {} of {} late reads were stale; the host waited for the GPU {} times",
                                    total["stale"].get<std::uint64_t>(), total["reads"].get<std::uint64_t>(),
                                    total["waits"].get<std::uint64_t>()));
  }
  if (parsed["run"].contains("median_ms"))
    say(arguments.host,
        fmt::format("{} frames: first {:.1f} ms; then median {:.1f} ms ({:.1f} to {:.1f})", arguments.frames,
                    parsed["run"]["first_ms"].get<double>(), parsed["run"]["median_ms"].get<double>(),
                    parsed["run"]["minimum_ms"].get<double>(), parsed["run"]["maximum_ms"].get<double>()));
  if (arguments.watch) {
    const Json& plan = parsed["plan"];
    say(arguments.host, fmt::format("planned in {:.0f} ms: {} passes and {} pipelines made, {} and {} kept",
                                    plan["wall_ms"].get<double>(), plan["passes_made"].get<int>(),
                                    plan["pipelines_made"].get<int>(), plan["passes_kept"].get<int>(),
                                    plan["pipelines_kept"].get<int>() + plan["pipelines_shared"].get<int>()));
  }
  writing.finish();
}

int run(RunArguments& arguments) {
  arguments.sort_files();
  const Owned<heddle_host> host = make_host(arguments.host);
  const Owned<heddle_graph> graph = load_graph(host.get(), arguments);
  std::vector<Output> outputs = parse_outputs(host.get(), graph.get(), arguments.outputs);
  const bool runs_job = is_job(host.get(), graph.get());
  // What a frame leaves to the next one comes round in the third.
  if (arguments.host.check && !runs_job) arguments.frames = std::max(arguments.frames, 3);
  if (outputs.empty() && !runs_job) outputs.push_back({{}, "heddle.png"});
  const JobArguments of_job{arguments, outputs, arguments.stats, arguments.profile};
  if (runs_job) prepare_job(host.get(), graph.get(), of_job);
  for (const Output& output : outputs) {
    if (!runs_job) keep_output(host.get(), graph.get(), output);
  }
  Owned<heddle_scene> scene = load_scene(host.get(), arguments);
  int status = HEDDLE_OK;
  const auto render = [&] {
    if (runs_job)
      status = run_job(host.get(), graph.get(), scene.get(), of_job);
    else
      render_frames(arguments, host.get(), graph.get(), scene.get(), outputs);
  };
  if (arguments.watch) watch(host.get(), graph.get(), scene, arguments, render);
  render();
  return status;
}

}  // namespace

void add_run(CLI::App& app, int* exit_status) {
  CLI::App* command = app.add_subcommand("run", "render a scene through a graph and write images; or run a job");
  auto arguments = std::make_shared<RunArguments>();
  arguments->add_to(*command);
  command
      ->add_option("--output,-o", arguments->outputs,
                   "FILE for the graph's output, or PASS.PORT=FILE for any image port; of a job also for an artifact "
                   "(its bytes) or "
                   "a report (JSON); .exr keeps floats; "
                   "of several frames the last, or each if FILE has a number's place: frame_%04d.png (default: "
                   "heddle.png; of a job: none, its artifacts stay in the cache)")
      ->take_all()
      ->allow_extra_args(false);
  command->add_option("--time-step", arguments->time_step, "seconds of scene time from frame to frame (default: 1/60)");
  command->add_option(
      "--stats", arguments->stats,
      "write counters, memory and times as JSON (of the last frame; \"run\": of all; of a job: its artifacts and "
      "reports); - for standard output");
  command->add_flag("--profile", arguments->profile, "time the last frame stage by stage");
  command->add_flag(
      "--watch", arguments->watch,
      "stay, and render again when a file changes that the picture was made of: graphs, shaders, plugins, "
      "roles, scenes, images; on an error the last good picture stays");
  command->add_flag("--live", arguments->host.live,
                    "wait for no frame before the next one: cpu stages take the newest copy of the GPU's work that is "
                    "there, and bytes may differ from run to run");
  command->add_flag("--remake", arguments->host.remake,
                    "make artifacts again that the cache holds, and replace them; --stats names their files");
  command->add_flag(
      "--check", arguments->host.check,
      "prove that barriers cover every hazard, and search every pass's outputs for NaN, Inf and values out "
      "of range; at least three frames");
  command->callback([arguments, exit_status] { *exit_status = run(*arguments); });
}

}  // namespace heddle::cli
