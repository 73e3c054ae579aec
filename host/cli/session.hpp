// SPDX-License-Identifier: Apache-2.0
// What the subcommands share: owners of heddle.h's objects, errors as exceptions, arguments for graph and scene.
#pragma once

#include <heddle/heddle.h>

#include <CLI/App.hpp>

#include <filesystem>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace heddle::cli {

/// A failed call of heddle.h: its whole message and status.
struct Failure {
  heddle_status status;
  std::string message;
};

struct Destroy {
  void operator()(heddle_host* host) const;  // signals no longer reach it
  void operator()(heddle_scene* scene) const { heddle_scene_destroy(scene); }
  void operator()(heddle_graph* graph) const { heddle_graph_destroy(graph); }
};
template <class Object>
using Owned = std::unique_ptr<Object, Destroy>;

/// Throws Failure with the host's message unless HEDDLE_OK.
void check(const heddle_host* host, heddle_status status);

struct HostArguments {
  std::string device;
  std::string plugin_path;
  bool validation = false;
  bool check = false;
  bool remake = false;
  bool live = false;
  bool quiet = false;
  void add_to(CLI::App& app);
};
/// Who is told what the host says and how far it has come, in place of standard error.
struct HostListener {
  void (*log)(void* user, std::uint32_t severity, const char* text) = nullptr;
  std::uint32_t (*progress)(void* user, const char* activity, double fraction) = nullptr;
  void* user = nullptr;
};
/// `listener` may be NULL, and else outlives the host.
Owned<heddle_host> make_host(const HostArguments& arguments, const HostListener* listener = nullptr);

struct RenderArguments {
  HostArguments host;
  std::vector<std::string> files;  // a graph and a scene, in any order
  std::string scene;
  std::vector<std::string> overlays;
  std::string camera;
  std::string environment;  // image file
  double environment_scale = 1, environment_rotation = 0;
  std::vector<std::string> settings;  // --set
  int frames = 1;
  std::uint64_t seed = 0;
  double time = 0;
  std::string animation;
  bool loop = false;
  bool trust_files = false;
  /// renders_frames: how many is an argument too.
  void add_to(CLI::App& app, bool renders_frames = true);
  /// Sorts `files` into graph and scene. Throws Failure.
  void sort_files();
  std::filesystem::path graph_file;  // after sort_files
};

Owned<heddle_graph> load_graph(heddle_host* host, const RenderArguments& arguments,
                               const std::vector<std::string>& more_settings = {});
/// The scene of the arguments; empty without one.
Owned<heddle_scene> load_scene(heddle_host* host, const RenderArguments& arguments);

/// What is looked at: a host, the arguments' graph, of which ports stay readable, and their scene.
struct Opened {
  Owned<heddle_host> host;
  Owned<heddle_graph> graph;
  Owned<heddle_scene> scene;
};
/// Sorts the files first. Throws Failure.
Opened open(RenderArguments& arguments, const std::vector<std::string>& ports);
/// --port PASS.PORT, as often as wanted.
void add_port_option(CLI::App& command, std::vector<std::string>& ports, const std::string& help);

/// Writes a port (empty: the graph's output) as an image; makes the file's folder where it is not there.
void write_port(heddle_host* host, heddle_graph* graph, const std::string& port, const std::filesystem::path& file);

/// Writes a text under a temporary name in the same folder, then renames it: the file is whole or not there. Makes the
/// folder where it is not there.
void write_file(const std::filesystem::path& file, std::string_view text);

/// A line for people on stderr unless quiet.
void say(const HostArguments& arguments, std::string_view text);

/// Where this command lies: PREFIX/bin.
std::filesystem::path program_folder();

/// Scenes written in Python run in Python over the same C API: replaces this process by
/// `python3 -m heddle ARGUMENTS`. Returns only by throwing Failure.
[[noreturn]] void run_in_python(int argc, char** argv);

// One function a subcommand; each registers itself and sets *exit_status when it ran.
void add_run(CLI::App& app, int* exit_status);
void add_view(CLI::App& app, int* exit_status);
void add_check(CLI::App& app, int* exit_status);
void add_compare(CLI::App& app, int* exit_status);
void add_list(CLI::App& app, int* exit_status);
void add_doctor(CLI::App& app, int* exit_status);
void add_explain(CLI::App& app, int* exit_status);
void add_inspect(CLI::App& app, int* exit_status);
void add_schema(CLI::App& app, int* exit_status);
void add_completion(CLI::App& app, int* exit_status);
// For --help and completion: main hands these to Python.
void add_study(CLI::App& app);
void add_tune(CLI::App& app);
void add_baseline(CLI::App& app);
void add_reproduce(CLI::App& app);
void add_bench(CLI::App& app);  // never returns when it ran

}  // namespace heddle::cli
