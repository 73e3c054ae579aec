// SPDX-License-Identifier: Apache-2.0
// heddle reproduce: a point of a study's report, made again. All of it is Python; what is said here is for --help and
// for completion.

#include "cli/session.hpp"

#include <CLI/CLI.hpp>

namespace heddle::cli {

void add_reproduce(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "reproduce", "make a point of a study's report again, and say whether it is the same: heddle reproduce FILE ROW");
  command->allow_extras();
  // Never reached: main hands the command over before it parses.
  command->add_option("file", "report.html of a study");
  command->add_option("row", "a row's number in the page, or a point's name")->expected(0, -1);
  command->add_option("--output,-o", "write the image, too");
  command->add_flag("--no-times")->description("compare the image alone");
  command->add_option("--rounds", "instead of the study's: more rounds see smaller differences");
  command->add_option("--device", "part of a device's name, or its index; else the study's");
  command->add_option("--timeout", "seconds after which a renderer that does not answer counts as hung (default: 300)");
  command->add_flag("--quiet,-q")->description("say nothing but mistakes; the exit status tells");
}

}  // namespace heddle::cli
