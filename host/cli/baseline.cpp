// SPDX-License-Identifier: Apache-2.0
// heddle baseline: what every technique makes, kept and compared. As studies, it is Python over the C API; what is said
// here is for --help and for completion.

#include "cli/session.hpp"

#include <CLI/CLI.hpp>

namespace heddle::cli {

void add_baseline(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "baseline", "keep error, counters and bytes of every technique (record), or say what has changed since (check)");
  command->allow_extras();
  command->add_option("action",
                      "record: keep what is now; check: exit status 1 if anything differs from what was kept");
  command->add_option("file", "ROLE or ROLE/TECHNIQUE (default: all)")->expected(0, -1);
  command->add_option("--folder", "where baselines are kept, a folder a machine and driver");
  command->add_option("--tolerance", "relative difference of errors that is none (default: 0)");
  command->add_option("--timeout", "seconds after which a process that does not answer is hung (default: 300)");
  command->add_option("--device", "part of a device's name, or its index");
  command->add_flag("--quiet,-q")->description("no progress on standard error");
}

}  // namespace heddle::cli
