// SPDX-License-Identifier: Apache-2.0
// --output of `heddle run`: "FILE" for what the graph is about, or "PASS.PORT=FILE".
#pragma once

#include "cli/session.hpp"

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace heddle::cli {

/// Where something that a graph makes goes.
struct Output {
  std::string port;  // empty: the graph's output
  std::filesystem::path file;
};

/// Throws Failure, before anything is rendered, for what could not be written afterwards.
std::vector<Output> parse_outputs(heddle_host* host, heddle_graph* graph, const std::vector<std::string>& texts);
/// Throws Failure if the file of an image says not which format it has.
void refuse_format(const Output& output);

/// Writes each of several outputs though others fail.
class Writing {
 public:
  /// Keeps what `body` throws, but for a stop, which ends all.
  void write(const std::function<void()>& body);
  /// Throws Failure with what every failure said, and the first one's status.
  void finish() const;

 private:
  std::vector<Failure> failures_;
};

}  // namespace heddle::cli
