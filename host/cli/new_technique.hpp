// SPDX-License-Identifier: Apache-2.0
// heddle new-technique ROLE NAME: a folder with a technique that builds and loads at once.
#pragma once

#include <CLI/App.hpp>

namespace heddle::cli {

/// Registers the subcommand. Its callback throws Failure.
void add_new_technique(CLI::App& app);

}  // namespace heddle::cli
