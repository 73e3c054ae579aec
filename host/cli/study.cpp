// SPDX-License-Identifier: Apache-2.0
// heddle study: experiments over scenes, variants and knobs. All of it is Python over the same C API; what is said here
// is for --help and for completion.

#include "cli/session.hpp"

#include <CLI/CLI.hpp>

namespace heddle::cli {

void add_study(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "study", "measure error and time of techniques over their knobs: heddle study FILE, or --role ROLE SCENE");
  command->allow_extras();
  // Never reached: main hands the command over before it parses.
  command->add_option("file", "a study (.toml), or the name of a shipped one; with --role: scenes")->expected(0, -1);
  command->add_option("--role", "study all techniques of this role over all their knobs, without a file");
  command->add_option("--graph", "with --role: in this graph (default: the first shipped one with a pass of the role)");
  command->add_option("--set", "with --role: change the graph: extent=[320,180]")->take_all()->allow_extra_args(false);
  command->add_option("--climb", "with --role: a technique's ladders together, or each on its own (default: together)");
  command->add_option("--scene", "instead of the file's scenes: a model of your own, for instance; repeatable")
      ->take_all()
      ->allow_extra_args(false);
  command->add_option("--folder", "where results go (default: out/NAME of the study)");
  command->add_option("--device", "part of a device's name, or its index");
  command->add_option("--rounds", "instead of the file's: more rounds see smaller differences");
  command->add_option("--budget", "minutes; a study that would take longer says so and ends before it times anything");
  command->add_option("--cluster",
                      "address of a Dask scheduler, whose workers do the work; local: workers of this machine");
  command->add_option("--timeout", "seconds after which a variant that does not answer counts as hung (default: 300)");
  command->add_flag("--dry-run")->description("check the file, say what would be measured, render nothing");
  command->add_flag("--gate")->description(
      "exit status 1 if anything is worse than the first variant, 2 if undecided, else 0");
  command->add_flag("--quiet,-q")->description("no progress on standard error");
}

}  // namespace heddle::cli
