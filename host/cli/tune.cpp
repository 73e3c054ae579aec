// SPDX-License-Identifier: Apache-2.0
// heddle tune: the knobs of a graph within a budget of time or error. As studies, it is Python over the C API; what is
// said here is for --help and for completion.

#include "cli/session.hpp"

#include <CLI/CLI.hpp>

namespace heddle::cli {

void add_tune(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "tune", "choose knobs within a budget of time or error, and write them as a graph that extends this one");
  command->allow_extras();
  const auto repeatable = [command](const std::string& name, const std::string& help) {
    command->add_option(name, help)->take_all()->allow_extra_args(false);
  };
  command->add_option("file", "a graph and a scene (.py, .glb, .gltf, .scene.toml), in any order")->expected(0, -1);
  command->add_option("--budget", "frame time with its unit, 4ms: the least error within it");
  command->add_option("--error", "METRIC=NUMBER, flip=0.02: the least time within it");
  command->add_option("--metric", "with --budget: which error is least (default: flip)");
  command->add_option("--port", "the image that is compared (default: the graph's output)");
  repeatable("--pass", "tune this pass alone; repeatable (default: all that have knobs)");
  command->add_flag("--techniques")->description("other techniques of the passes' roles too");
  repeatable("--set", "change the graph, and what is written: extent=[320,180]");
  repeatable("--reference-set", "change what is taken for true: ao.technique=ray_traced");
  command->add_option("--parts", "renderings of what is true, with seeds of their own (default: 1)");
  repeatable("--overlay", "a .scene.toml with changes to the scene");
  repeatable("--camera", "choose in this camera; repeatable (default: the scene's)");
  repeatable("--time", "choose at this time, seconds; repeatable");
  repeatable("--check-camera", "check in this camera; repeatable (default: all others)");
  repeatable("--check-time", "check at this time, seconds; repeatable");
  command->add_option("--output,-o", "the graph that is written (default: FOLDER/tuned.toml)");
  command->add_option("--folder", "where measurements are kept (default: out/tune)");
  command->add_option("--rounds", "of turns; more see smaller differences (default: 9)");
  command->add_option("--frames", "timed in a turn (default: 2)");
  command->add_option("--settle", "frames before an image is read (default: 1)");
  command->add_option("--minutes", "what would take longer says so and ends (default: 30)");
  command->add_option("--timeout", "seconds after which a process that does not answer is hung (default: 300)");
  command->add_option("--device", "part of a device's name, or its index");
  command->add_flag("--dry-run")->description("say which settings would be measured");
  command->add_flag("--quiet,-q")->description("no progress on standard error");
}

}  // namespace heddle::cli
