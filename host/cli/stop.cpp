// SPDX-License-Identifier: Apache-2.0
// Signals -> heddle_cancel and a flag. What runs in the handler is safe there: lock-free atomics and _exit.
#include "cli/stop.hpp"

#include "cli/session.hpp"

#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>

namespace heddle::cli {

namespace {

constexpr std::array<int, 2> kSignals{SIGINT, SIGTERM};

std::atomic<heddle_host*> cancelled_host{nullptr};
std::atomic<bool> is_asked{false};
static_assert(std::atomic<heddle_host*>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);

void handle(int signal) {
  if (is_asked.exchange(true)) _exit(128 + signal);
  if (heddle_host* host = cancelled_host.load(); host != nullptr) heddle_cancel(host);
}

}  // namespace

void stop_on_signals(heddle_host* host) {
  cancelled_host.store(host);
  if (host == nullptr) return;
  for (const int signal : kSignals) {
    struct sigaction present {};
    if (sigaction(signal, nullptr, &present) != 0 || present.sa_handler != SIG_DFL) continue;
    struct sigaction ours {};
    ours.sa_handler = handle;
    ours.sa_flags = SA_RESTART;
    (void)sigaction(signal, &ours, nullptr);
  }
}

bool is_stop_asked() {
  return is_asked.load();
}

void stop_if_asked() {
  if (is_asked.load()) throw Failure{HEDDLE_CANCELLED, "error: stopped, as heddle_cancel asked for"};
}

}  // namespace heddle::cli
