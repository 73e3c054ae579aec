// SPDX-License-Identifier: Apache-2.0
// Ctrl-C and SIGTERM: the first asks the work to stop where nothing is half done, the second ends the process at once.
#pragma once

#include <heddle/heddle.h>

namespace heddle::cli {

inline constexpr int kStoppedStatus = 130;  // of the process: 128 + SIGINT, as shells have it; also for SIGTERM

/// From now on signals cancel what this host renders; nullptr: none. Signals that were ignored stay ignored.
void stop_on_signals(heddle_host* host);
/// Throws Failure(HEDDLE_CANCELLED) if a signal came. Called where nothing is half done.
void stop_if_asked();
/// Whether a signal came. [any thread]
bool is_stop_asked();

}  // namespace heddle::cli
