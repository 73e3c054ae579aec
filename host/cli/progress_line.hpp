// SPDX-License-Identifier: Apache-2.0
// How far long work has come, in one line that is written over, where a person looks: on a terminal only.
#pragma once

namespace heddle::cli {

/// For heddle_host_options.progress; never ends the call. Nothing is shown of what takes less than half a second.
unsigned show_progress(void* user, const char* activity, double fraction);
/// Before anything else is written to the terminal.
void clear_progress();
/// Whether there is a terminal.
bool can_show_progress();

}  // namespace heddle::cli
