// SPDX-License-Identifier: Apache-2.0
// Owners, arguments and files for the subcommands.

#include "cli/session.hpp"
#include "cli/progress_line.hpp"
#include "cli/stop.hpp"
#include "json.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>

namespace heddle::cli {

namespace {

void log_to_stderr(void* user, std::uint32_t severity, const char* text) {
  const bool is_quiet = *static_cast<const bool*>(user);
  if (is_quiet && severity > 0) return;
  clear_progress();
  std::fprintf(stderr, "%s\n", text);
}

/// Index of what was asked for by name or number.
std::uint32_t choose(const std::vector<std::string>& names, const std::string& wanted, std::string_view kind) {
  auto found = std::find(names.begin(), names.end(), wanted);
  if (found == names.end() && wanted.find_first_not_of("0123456789") == std::string::npos) {
    const unsigned long index = std::strtoul(wanted.c_str(), nullptr, 10);
    if (index < names.size()) found = names.begin() + static_cast<std::ptrdiff_t>(index);
  }
  if (found == names.end()) {
    throw Failure{HEDDLE_BAD_INPUT, fmt::format("error: the scene has no {} '{}'\n  expected: {}", kind, wanted,
                                                names.empty() ? fmt::format("no --{}: the scene has none", kind)
                                                              : fmt::format("one of {}", fmt::join(names, ", ")))};
  }
  return static_cast<std::uint32_t>(found - names.begin());
}

void set_environment(heddle_host* host, heddle_scene* scene, const RenderArguments& arguments) {
  heddle_image image{};
  image.struct_size = sizeof image;
  check(host, heddle_image_read(host, arguments.environment.c_str(), &image));
  heddle_environment environment{};
  environment.struct_size = sizeof environment;
  environment.width = image.width;
  environment.height = image.height;
  environment.channels = image.channels == 2 ? 1 : image.channels;  // grey and alpha
  std::vector<float> grey;
  environment.pixels = image.pixels;
  if (image.channels == 2) {
    for (std::size_t i = 0; i < std::size_t{image.width} * image.height; ++i) grey.push_back(image.pixels[2 * i]);
    environment.pixels = grey.data();
  }
  environment.scale = arguments.environment_scale;
  environment.rotation[1] = std::sin(0.5 * arguments.environment_rotation);
  environment.rotation[3] = std::cos(0.5 * arguments.environment_rotation);
  check(host, heddle_scene_set_environment(scene, &environment));
}

/// So that the file can be written; where it cannot be made, writing the file says so.
void make_folder_of(const std::filesystem::path& file) {
  std::error_code ignored;
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path(), ignored);
}

bool is_scene(const std::string& file) {
  return file.ends_with(".gltf") || file.ends_with(".glb") || file.ends_with(".py") || file.ends_with(".scene.toml");
}

}  // namespace

std::filesystem::path program_folder() {
  std::error_code ignored;
  return std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path();
}

void Destroy::operator()(heddle_host* host) const {
  stop_on_signals(nullptr);
  heddle_destroy(host);
}

void check(const heddle_host* host, heddle_status status) {
  clear_progress();
  if (status != HEDDLE_OK) throw Failure{status, heddle_error(host)};
}

void HostArguments::add_to(CLI::App& app) {
  app.add_option("--device", device, "part of a device's name, or its index (see: heddle devices)");
  app.add_option("--plugins", plugin_path, "folders with plugins, separated by ':'");
  app.add_flag("--validation", validation, "run with Vulkan's validation layer; what it finds is an error");
  app.add_flag("--quiet,-q", quiet, "errors only");
}

Owned<heddle_host> make_host(const HostArguments& arguments, const HostListener* listener) {
  heddle_host_options options{};
  options.struct_size = sizeof options;
  options.flags = (arguments.validation ? HEDDLE_HOST_VALIDATION : 0U) | (arguments.check ? HEDDLE_HOST_CHECK : 0U) |
                  (arguments.remake ? HEDDLE_HOST_REMAKE : 0U) | (arguments.live ? HEDDLE_HOST_LIVE : 0U);
  options.device = arguments.device.empty() ? nullptr : arguments.device.c_str();
  options.plugin_path = arguments.plugin_path.empty() ? nullptr : arguments.plugin_path.c_str();
  options.log = log_to_stderr;
  options.log_user = const_cast<bool*>(&arguments.quiet);
  if (!arguments.quiet && can_show_progress()) options.progress = show_progress;
  if (listener != nullptr) {
    options.log = listener->log;
    options.progress = listener->progress;
    options.log_user = options.progress_user = listener->user;
  }
  heddle_host* host = nullptr;
  check(nullptr, heddle_create(&options, &host));
  stop_on_signals(host);
  return Owned<heddle_host>(host);
}

void RenderArguments::add_to(CLI::App& app, bool renders_frames) {
  host.add_to(app);
  app.add_option(
      "files", files,
      "a graph (file, or the name of a shipped one; default: deferred) and a scene (.gltf, .glb, .py, .scene.toml), in "
      "any order");
  app.add_option("--scene", scene, "the scene: .gltf, .glb, .py or .scene.toml");
  app.add_option("--overlay", overlays, "a .scene.toml with changes to the scene; several in their order")
      ->take_all()
      ->allow_extra_args(false);
  app.add_option("--camera", camera, "name or number of one of the scene's cameras");
  CLI::Option* image = app.add_option(
      "--environment", environment,
      "equirectangular image that lights the scene: .hdr, .exr ...; without a graph: the graph 'environment'");
  app.add_option("--environment-scale", environment_scale, "cd/m^2 of the image's 1")
      ->check(CLI::PositiveNumber)
      ->needs(image);
  app.add_option("--environment-rotation", environment_rotation, "radians that it is turned about the vertical axis")
      ->needs(image);
  app.add_option("--set", settings, "change the graph: ao.technique=gtao, ao.params.radius=1, extent=[640,360]")
      ->take_all()
      ->allow_extra_args(false);
  if (renders_frames) app.add_option("--frames", frames, "how many frames")->check(CLI::Range(1, 1000000));
  app.add_option("--time", time, "scene time of the first frame, seconds");
  app.add_option("--animation", animation,
                 "name or number of the animation to play, or none (default: each file's first one)");
  app.add_flag("--loop", loop, "begin the animation again after its end; else its last pose holds");
  app.add_flag("--trust-files", trust_files,
               "load the scene without limits of memory, also files outside of its folder");
  app.add_option("--seed", seed, "seed of everything random");
}

void RenderArguments::sort_files() {
  std::string graph;
  for (const std::string& file : files) {
    std::string& kind = is_scene(file) ? scene : graph;
    if (!kind.empty()) {
      throw Failure{HEDDLE_BAD_INPUT, fmt::format("error: two {}s were given: '{}' and '{}'",
                                                  is_scene(file) ? "scene" : "graph", kind, file)};
    }
    kind = file;
  }
  if (graph.empty()) graph = environment.empty() ? "deferred" : "environment";
  graph_file = graph;
}

Owned<heddle_graph> load_graph(heddle_host* host, const RenderArguments& arguments,
                               const std::vector<std::string>& more_settings) {
  std::vector<const char*> settings;
  for (const std::string& setting : arguments.settings) settings.push_back(setting.c_str());
  for (const std::string& setting : more_settings) settings.push_back(setting.c_str());
  heddle_graph* graph = nullptr;
  check(host, heddle_graph_load(host, arguments.graph_file.c_str(), settings.data(),
                                static_cast<std::uint32_t>(settings.size()), &graph));
  return Owned<heddle_graph>(graph);
}

Owned<heddle_scene> load_scene(heddle_host* host, const RenderArguments& arguments) {
  heddle_scene* made = nullptr;
  check(host, heddle_scene_create(host, &made));
  Owned<heddle_scene> loaded(made);
  heddle_load_options options{};
  options.struct_size = sizeof options;
  options.flags = arguments.trust_files ? HEDDLE_LOAD_TRUSTED : 0U;
  std::vector<std::string> files = arguments.overlays;
  if (!arguments.scene.empty()) files.insert(files.begin(), arguments.scene);
  for (const std::string& file : files) check(host, heddle_scene_load_with(loaded.get(), file.c_str(), &options));
  if (!arguments.environment.empty()) set_environment(host, loaded.get(), arguments);
  const char* text = nullptr;
  check(host, heddle_scene_describe(loaded.get(), &text));
  const Json description = parse_json(text);
  const auto cameras = description.value("cameras", std::vector<std::string>{});
  if (!arguments.camera.empty()) {
    check(host, heddle_scene_use_camera(loaded.get(), choose(cameras, arguments.camera, "camera")));
  }
  std::vector<std::string> animations;
  for (const auto& animation : description["animations"]) animations.push_back(animation["name"].get<std::string>());
  const std::uint32_t flags = arguments.loop ? HEDDLE_ANIMATION_LOOP : 0U;
  if (arguments.animation == "none") {
    check(host, heddle_scene_use_animation(loaded.get(), HEDDLE_NONE, 0));
  } else if (!arguments.animation.empty() || (arguments.loop && !animations.empty())) {
    const std::uint32_t chosen =
        arguments.animation.empty() ? 0U : choose(animations, arguments.animation, "animation");
    check(host, heddle_scene_use_animation(loaded.get(), chosen, flags));
  }
  return loaded;
}

Opened open(RenderArguments& arguments, const std::vector<std::string>& ports) {
  arguments.sort_files();
  Opened opened;
  opened.host = make_host(arguments.host);
  opened.graph = load_graph(opened.host.get(), arguments);
  for (const std::string& port : ports) {
    check(opened.host.get(), heddle_graph_keep(opened.graph.get(), port.c_str()));
  }
  opened.scene = load_scene(opened.host.get(), arguments);
  return opened;
}

void add_port_option(CLI::App& command, std::vector<std::string>& ports, const std::string& help) {
  command.add_option("--port", ports, help)->take_all()->allow_extra_args(false);
}

void write_port(heddle_host* host, heddle_graph* graph, const std::string& port, const std::filesystem::path& file) {
  heddle_image image{};
  image.struct_size = sizeof image;
  check(host, heddle_read(graph, port.empty() ? nullptr : port.c_str(), 0, 0, &image));
  make_folder_of(file);
  check(host, heddle_image_write(host, file.c_str(), &image));
}

void write_file(const std::filesystem::path& file, std::string_view text) {
  make_folder_of(file);
  std::filesystem::path partial = file.parent_path();
  partial /= fmt::format(".{}.{}.partial", file.filename().string(), getpid());
  std::ofstream stream(partial, std::ios::binary);
  stream << text;
  stream.close();
  std::error_code error;
  if (stream) std::filesystem::rename(partial, file, error);
  if (!stream || error) {
    std::error_code ignored;
    std::filesystem::remove(partial, ignored);
    throw Failure{HEDDLE_FAILED, fmt::format("error: cannot write '{}'", file.string())};
  }
}

void say(const HostArguments& arguments, std::string_view text) {
  if (arguments.quiet) return;
  clear_progress();
  fmt::print(stderr, "{}\n", text);
}

void run_in_python(int argc, char** argv) {
  // The package lies in scripts/ of the source tree or beside the libraries; both are tried before Python's own path.
  const std::filesystem::path prefix = program_folder().parent_path();
  std::string path = (prefix / "lib" / "heddle" / "python").string();
  if (const char* present = std::getenv("PYTHONPATH"); present != nullptr) path += std::string(":") + present;
  setenv("PYTHONPATH", path.c_str(), 1);
  setenv("HEDDLE_LIBRARY", (prefix / "lib" / "libheddle.so").c_str(), 0);  // this command's, unless another was chosen
  // A distribution's Python has the distribution's numpy; another python3 may come before it in PATH.
  const char* chosen = std::getenv("HEDDLE_PYTHON");
  const std::string python = chosen != nullptr                       ? chosen
                             : access("/usr/bin/python3", X_OK) == 0 ? "/usr/bin/python3"
                                                                     : "python3";
  std::vector<std::string> words{python, "-m", "heddle"};
  for (int i = 1; i < argc; ++i) words.emplace_back(argv[i]);
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  execvp(python.c_str(), arguments.data());
  throw Failure{HEDDLE_FAILED,
                "error: this needs Python, and python3 could not be started\n  help: install the "
                "packages python3 and python3-numpy"};
}

}  // namespace heddle::cli
