// SPDX-License-Identifier: Apache-2.0
// Looks at the files' times until some of them change.
#include "cli/watch.hpp"

#include "cli/stop.hpp"
#include "file_stamps.hpp"
#include "json.hpp"

#include <fmt/format.h>

#include <chrono>
#include <set>
#include <thread>

namespace heddle::cli {

namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kPause{200};

std::set<fs::path> paths(const char* json) {
  std::set<fs::path> files;
  for (const Json& file : parse_json(json)) files.emplace(file.get<std::string>());
  return files;
}

std::set<fs::path> graph_files(heddle_host* host, heddle_graph* graph) {
  const char* text = nullptr;
  check(host, heddle_graph_files(graph, &text));
  return paths(text);
}

std::set<fs::path> scene_files(heddle_host* host, heddle_scene* scene, const RenderArguments& arguments) {
  const char* text = nullptr;
  check(host, heddle_scene_files(scene, &text));
  std::set<fs::path> files = paths(text);
  if (!arguments.environment.empty()) files.emplace(arguments.environment);
  return files;
}

/// Returns when something differs from `before` and nothing moves any more: a compiler writes a library in many steps.
FileStamps wait_for_change(const std::set<fs::path>& files, const FileStamps& before) {
  FileStamps last = before;
  for (;;) {
    std::this_thread::sleep_for(kPause);
    stop_if_asked();
    FileStamps now = stamps_of(files);
    if (now != before && now == last) return now;
    last = std::move(now);
  }
}

}  // namespace

void watch(heddle_host* host, heddle_graph* graph, Owned<heddle_scene>& scene, const RenderArguments& arguments,
           const std::function<void()>& render) {
  std::set<fs::path> of_graph = graph_files(host, graph);
  std::set<fs::path> of_scene = scene_files(host, scene.get(), arguments);
  const auto all = [&] {
    std::set<fs::path> files = of_graph;
    files.insert(of_scene.begin(), of_scene.end());
    return files;
  };
  FileStamps before = stamps_of(all());
  // What failed to be read is read again at the next change, whichever file that is.
  bool is_graph_due = false, is_scene_due = false;
  fs::file_time_type began;
  const auto read_and_render = [&] {
    began = fs::file_time_type::clock::now();
    try {
      if (is_scene_due) scene = load_scene(host, arguments);
      is_scene_due = false;
      if (is_graph_due) check(host, heddle_graph_reload(graph));
      is_graph_due = false;
      render();
      of_graph = graph_files(host, graph);
      of_scene = scene_files(host, scene.get(), arguments);
    } catch (const Failure& failure) {
      if (failure.status == HEDDLE_CANCELLED) throw;
      fmt::print(stderr, "{}\n", failure.message);
      say(arguments.host, "waiting for the next change; what was written before stays");
    }
  };
  read_and_render();
  say(arguments.host, fmt::format("watching {} files; Ctrl-C ends", before.size()));
  for (;;) {
    const FileStamps now = wait_for_change(all(), before);
    for (const auto& [file, stamp] : now) {
      const auto known = before.find(file);
      if (known != before.end() && known->second == stamp) continue;
      is_graph_due = is_graph_due || of_graph.contains(file);
      is_scene_due = is_scene_due || of_scene.contains(file);
      say(arguments.host, fmt::format("changed: {}", file.string()));
    }
    read_and_render();
    before = stamps_after(all(), now, began);
  }
}

}  // namespace heddle::cli
