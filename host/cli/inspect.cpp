// SPDX-License-Identifier: Apache-2.0
// heddle inspect: what every image port held at some pixels, through the graph.

#include "cli/session.hpp"
#include "cli/stop.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <memory>
#include <optional>

namespace heddle::cli {

namespace {

struct InspectArguments : RenderArguments {
  std::vector<std::string> ports;
  double time_step = 1.0 / 60.0;
  bool json = false;
};

/// "320,180" -> its two numbers; nothing for another word.
std::optional<std::array<std::uint32_t, 2>> pixel_of(const std::string& word) {
  std::array<std::uint32_t, 2> pixel{};
  const char* const end = word.data() + word.size();
  const auto x = std::from_chars(word.data(), end, pixel[0]);
  if (x.ec != std::errc() || x.ptr == end || *x.ptr != ',') return std::nullopt;
  const auto y = std::from_chars(x.ptr + 1, end, pixel[1]);
  if (y.ec != std::errc() || y.ptr != end) return std::nullopt;
  return pixel;
}

int inspect(InspectArguments& arguments) {
  std::vector<std::uint32_t> pixels;
  std::erase_if(arguments.files, [&](const std::string& word) {
    const auto pixel = pixel_of(word);
    if (pixel) pixels.insert(pixels.end(), pixel->begin(), pixel->end());
    return pixel.has_value();
  });
  if (pixels.empty()) {
    throw Failure{HEDDLE_BAD_INPUT,
                  "error: no pixel was named\n  expected: X,Y in pixels of the frame from its top left, for instance "
                  "320,180"};
  }
  const Opened opened = open(arguments, arguments.ports);
  heddle_render_options options{};
  options.struct_size = sizeof options;
  options.seed = arguments.seed;
  options.time_step = arguments.time_step;
  options.time = arguments.time;
  for (int frame = 0; frame + 1 < arguments.frames; ++frame) {
    stop_if_asked();
    options.time = arguments.time + frame * arguments.time_step;
    check(opened.host.get(), heddle_render(opened.graph.get(), opened.scene.get(), &options));
  }
  options.time = arguments.time + (arguments.frames - 1) * arguments.time_step;
  const char* text = nullptr;
  check(opened.host.get(),
        heddle_inspect(opened.graph.get(), opened.scene.get(), &options, pixels.data(),
                       static_cast<std::uint32_t>(pixels.size() / 2), arguments.json ? "json" : "text", &text));
  fmt::print("{}{}", text, arguments.json ? "\n" : "");
  return HEDDLE_OK;
}

}  // namespace

void add_inspect(CLI::App& app, int* exit_status) {
  CLI::App* command = app.add_subcommand(
      "inspect",
      "say what every image port holds at a pixel, in the order of execution: inspect [GRAPH] [SCENE] X,Y ...");
  auto arguments = std::make_shared<InspectArguments>();
  arguments->add_to(*command);
  command->get_option("files")->description(
      "pixels X,Y from the frame's top left, a graph (default: deferred) and a scene, in any order");
  add_port_option(*command, arguments->ports,
                  "PASS.PORT: run this pass too, though nobody reads it; may be given again");
  command->add_option("--time-step", arguments->time_step, "seconds of scene time from frame to frame (default: 1/60)");
  command->add_flag("--json", arguments->json, "as JSON");
  command->callback([arguments, exit_status] { *exit_status = inspect(*arguments); });
}

}  // namespace heddle::cli
