// SPDX-License-Identifier: Apache-2.0
// heddle view: a window on a host. What needs a screen is the module libheddle_view.so, opened here and nowhere else.

#include "cli/session.hpp"
#include "cli/stop.hpp"
#include "json.hpp"
#include "view/module.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cstdlib>

namespace heddle::cli {

namespace {

// Thirty pictures a second are smooth, and a key is answered within one of them.
constexpr double kFrameBudgetMs = 33;

struct ViewArguments : RenderArguments {
  std::string swap, b;
  std::vector<std::string> settings_b;
  std::string script, window;
  double time_step = 1.0 / 60.0;
  double frame_budget_ms = kFrameBudgetMs;
};

/// What the module calls back for: host and scenes, as the other commands make them.
struct Viewer {
  const ViewArguments& arguments;
  void (*tell)(void*, std::uint32_t, const char*);
  decltype(&heddle_view_progress) progress;
  Owned<heddle_host> host;
  std::array<Owned<heddle_scene>, 2> scenes;
  std::string error, files;
  heddle_view* view = nullptr;
};

template <class Body>
heddle_status guarded(Viewer& viewer, Body body) {
  try {
    body();
    return HEDDLE_OK;
  } catch (const Failure& failure) {
    viewer.error = failure.message;
    return failure.status;
  } catch (const std::exception& error) {
    viewer.error = fmt::format("error: {}", error.what());
    return HEDDLE_FAILED;
  }
}

heddle_status open_host(void* user, heddle_view* view, heddle_host** out) {
  Viewer& viewer = *static_cast<Viewer*>(user);
  return guarded(viewer, [&] {
    viewer.view = view;
    HostListener listener;
    listener.log = [](void* told, std::uint32_t severity, const char* text) {
      const Viewer& one = *static_cast<Viewer*>(told);
      one.tell(one.view, severity, text);
      if (severity == 0)
        fmt::print(stderr, "{}\n", text);
      else
        say(one.arguments.host, text);
    };
    listener.progress = [](void* told, const char* activity, double fraction) {
      const Viewer& one = *static_cast<Viewer*>(told);
      return one.progress(one.view, activity, fraction);
    };
    listener.user = &viewer;
    viewer.host = make_host(viewer.arguments.host, &listener);
    *out = viewer.host.get();
  });
}

heddle_status load_scene_of(void* user, std::uint32_t variant, heddle_scene** out) {
  Viewer& viewer = *static_cast<Viewer*>(user);
  return guarded(viewer, [&] {
    viewer.scenes.at(variant) = load_scene(viewer.host.get(), viewer.arguments);
    *out = viewer.scenes.at(variant).get();
  });
}

heddle_status list_scene_files(void* user, const char** out_json) {
  Viewer& viewer = *static_cast<Viewer*>(user);
  return guarded(viewer, [&] {
    const char* text = nullptr;
    check(viewer.host.get(), heddle_scene_files(viewer.scenes[0].get(), &text));
    Json files = parse_json(text);
    if (!viewer.arguments.environment.empty()) files.push_back(viewer.arguments.environment);
    viewer.files = write_json(files);
    *out_json = viewer.files.c_str();
  });
}

heddle_view_run_function open_module(Viewer& viewer) {
  const char* named = std::getenv("HEDDLE_VIEW_MODULE");
  const std::filesystem::path file = named != nullptr && *named != '\0'
                                         ? std::filesystem::path(named)
                                         : program_folder().parent_path() / "lib" / "libheddle_view.so";
  constexpr const char* kHelp =
      "install the Debian packages libglfw3, libgl1 and libstb0; where Heddle was built without its window, "
      "libglfw3-dev and libimgui-dev, and build again";
  // Never closed: OpenGL drivers keep threads.
  void* library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  if (library == nullptr) {
    throw Failure{HEDDLE_UNSUPPORTED,
                  fmt::format("error: the window's module cannot be opened\n  found:    {}\n  expected: {}\n  "
                              "help:     {}",
                              dlerror(), file.string(), kHelp)};
  }
  const auto run = reinterpret_cast<heddle_view_run_function>(dlsym(library, "heddle_view_run"));
  viewer.tell = reinterpret_cast<decltype(viewer.tell)>(dlsym(library, "heddle_view_tell"));
  viewer.progress = reinterpret_cast<decltype(viewer.progress)>(dlsym(library, "heddle_view_progress"));
  if (run == nullptr || viewer.tell == nullptr || viewer.progress == nullptr) {
    throw Failure{HEDDLE_UNSUPPORTED,
                  fmt::format("error: '{}' is not the window's module\n  help:     {}", file.string(), kHelp)};
  }
  return run;
}

std::array<std::uint32_t, 2> window_size(const std::string& text) {
  std::array<std::uint32_t, 2> size{0, 0};
  if (text.empty()) return size;
  char rest = '\0';
  if (std::sscanf(text.c_str(), "%ux%u%c", &size[0], &size[1], &rest) != 2 || size[0] < 320 || size[1] < 240 ||
      size[0] > 16384 || size[1] > 16384) {
    throw Failure{HEDDLE_BAD_INPUT,
                  fmt::format("error: --window '{}' is no size of a window\n  expected: WIDTHxHEIGHT in pixels, "
                              "from 320x240 to 16384x16384",
                              text)};
  }
  return size;
}

int view(ViewArguments& arguments) {
  arguments.sort_files();
  std::array<std::vector<std::string>, 2> settings{arguments.settings, arguments.settings};
  const bool has_b = !arguments.swap.empty() || !arguments.b.empty() || !arguments.settings_b.empty();
  if (!arguments.swap.empty()) {
    const std::size_t equals = arguments.swap.find('='), comma = arguments.swap.find(',');
    if (equals == std::string::npos || comma == std::string::npos || comma < equals) {
      throw Failure{
          HEDDLE_BAD_INPUT,
          fmt::format("error: --swap '{}' is not PASS=A,B\n  help:     --swap ao=gtao,ray_traced", arguments.swap)};
    }
    const std::string key = arguments.swap.substr(0, equals) + ".technique=";
    settings[0].push_back(key + arguments.swap.substr(equals + 1, comma - equals - 1));
    settings[1].push_back(key + arguments.swap.substr(comma + 1));
  }
  settings[1].insert(settings[1].end(), arguments.settings_b.begin(), arguments.settings_b.end());
  const std::array<std::uint32_t, 2> size = window_size(arguments.window);
  Viewer viewer{arguments, nullptr, nullptr, {}, {}, {}, {}};
  const heddle_view_run_function run = open_module(viewer);
  std::array<std::vector<const char*>, 2> texts;
  heddle_view_application application{};
  application.struct_size = sizeof application;
  application.revision = HEDDLE_VIEW_MODULE_REVISION;
  application.graphs[0] = arguments.graph_file.c_str();
  if (has_b) application.graphs[1] = arguments.b.empty() ? arguments.graph_file.c_str() : arguments.b.c_str();
  for (std::size_t v = 0; v < 2; ++v) {
    for (const std::string& setting : settings[v]) texts[v].push_back(setting.c_str());
    application.settings[v] = texts[v].data();
    application.setting_counts[v] = static_cast<std::uint32_t>(texts[v].size());
  }
  application.width = size[0];
  application.height = size[1];
  application.time = arguments.time;
  application.time_step = arguments.time_step;
  application.frame_budget_ms = arguments.frame_budget_ms;
  application.seed = arguments.seed;
  application.script = arguments.script.empty() ? nullptr : arguments.script.c_str();
  application.user = &viewer;
  application.open = open_host;
  application.load_scene = load_scene_of;
  application.scene_files = list_scene_files;
  application.error = [](void* user) { return static_cast<Viewer*>(user)->error.c_str(); };
  application.is_stopped = [](void*) { return is_stop_asked() ? 1U : 0U; };
  application.close = [](void* user) {
    Viewer& one = *static_cast<Viewer*>(user);
    for (Owned<heddle_scene>& scene : one.scenes) scene.reset();
    one.host.reset();
  };
  std::array<char, 16384> error{};
  if (const heddle_status status = run(&application, error.data(), error.size()); status != HEDDLE_OK)
    throw Failure{status, error.data()};
  return HEDDLE_OK;
}

}  // namespace

void add_view(CLI::App& app, int* exit_status) {
  CLI::App* command = app.add_subcommand(
      "view", "a window: fly, compare two variants by a wipe, move every parameter, see what knobs cost");
  auto arguments = std::make_shared<ViewArguments>();
  arguments->add_to(*command, /*renders_frames=*/false);
  command->add_option("--swap", arguments->swap, "PASS=A,B: show technique A against technique B");
  command->add_option("--b", arguments->b, "show this graph against the first");
  command->add_option("--set-b", arguments->settings_b, "show the graph against itself with this setting, as of --set")
      ->take_all()
      ->allow_extra_args(false);
  command->add_option("--time-step", arguments->time_step,
                      "seconds of scene time from frame to frame, while it plays (default: 1/60)");
  command
      ->add_option("--frame-budget", arguments->frame_budget_ms,
                   "while nothing changes, milliseconds in which loops render on before the picture is shown again "
                   "(default: 33; 0: after each frame)")
      ->check(CLI::Range(0.0, 10000.0));
  command->add_option("--window", arguments->window,
                      "WIDTHxHEIGHT in pixels (default: the picture in its own size, beside the panel)");
  command->add_option("--script", arguments->script,
                      "file with what mouse and keys do, a command a line: wait, pause, click, slide, type, key, drag, "
                      "screenshot, state, quit; its end leaves the window open");
  command->add_flag("--live", arguments->host.live,
                    "wait for no frame before the next one; bytes may differ from run to run");
  command->callback([arguments, exit_status] { *exit_status = view(*arguments); });
}

}  // namespace heddle::cli
