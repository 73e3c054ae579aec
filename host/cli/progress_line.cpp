// SPDX-License-Identifier: Apache-2.0
#include "cli/progress_line.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <string>

namespace heddle::cli {

namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds kFirst{500}, kBetween{100};
constexpr std::string_view kStartOfLine = "\r\x1b[K";  // and nothing behind it

// One line, as there is one terminal; of the thread that runs the host.
bool is_shown = false;
std::string last_activity;
Clock::time_point began, shown;

}  // namespace

unsigned show_progress(void*, const char* activity, double fraction) {
  const Clock::time_point now = Clock::now();
  if (last_activity != activity) {
    last_activity = activity;
    began = now;
  }
  if (now - began < kFirst || now - shown < kBetween) return 0;
  shown = now;
  is_shown = true;
  fmt::print(stderr, "{}{}: {:.0f} %", kStartOfLine, activity, 100.0 * std::clamp(fraction, 0.0, 1.0));
  std::fflush(stderr);
  return 0;
}

void clear_progress() {
  if (!is_shown) return;
  is_shown = false;
  fmt::print(stderr, "{}", kStartOfLine);
  std::fflush(stderr);
}

bool can_show_progress() {
  return isatty(STDERR_FILENO) != 0;
}

}  // namespace heddle::cli
