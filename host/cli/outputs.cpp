// SPDX-License-Identifier: Apache-2.0
#include "cli/outputs.hpp"

#include "json.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace heddle::cli {

namespace {

/// No port has a slash in its name, so "/tmp/a=b.png" is a file.
Output parse_output(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || text.find('/') < equals) return {{}, text};
  if (equals == 0 || equals + 1 == text.size()) {
    throw Failure{HEDDLE_BAD_INPUT, fmt::format("error: --output has no {} beside its '='\n"
                                                "  found:    {}\n"
                                                "  expected: FILE, or PASS.PORT=FILE",
                                                equals == 0 ? "port" : "file", text)};
  }
  return {text.substr(0, equals), text.substr(equals + 1)};
}

}  // namespace

std::vector<Output> parse_outputs(heddle_host* host, heddle_graph* graph, const std::vector<std::string>& texts) {
  std::vector<Output> outputs;
  for (const std::string& text : texts) outputs.push_back(parse_output(text));
  const char* described = nullptr;
  check(host, heddle_graph_describe(graph, &described));
  const Json description = parse_json(described);
  std::set<std::filesystem::path> taken;
  for (const auto& [port, file] : outputs) {
    const std::string name = file.string();
    if (port.empty() && std::ranges::any_of(description["ports"], [&](const Json& one) { return one["name"] == name; }))
      throw Failure{HEDDLE_BAD_INPUT, fmt::format("error: --output '{0}' is a port, and no file\n"
                                                  "  expected: {0}=FILE\n"
                                                  "  help:     for a file of that name write --output './{0}'",
                                                  name)};
    if (!taken.insert(std::filesystem::absolute(file).lexically_normal()).second)
      throw Failure{HEDDLE_BAD_INPUT, fmt::format("error: two outputs were given the file '{}'\n"
                                                  "  expected: a file for each",
                                                  name)};
  }
  return outputs;
}

void refuse_format(const Output& output) {
  if (output.file.extension().string().size() > 1) return;
  throw Failure{HEDDLE_BAD_INPUT,
                fmt::format("error: --output '{}' has no extension, which says how an image is written\n"
                            "  expected: .png, .exr or another at its end",
                            output.file.string())};
}

void Writing::write(const std::function<void()>& body) {
  try {
    body();
  } catch (const Failure& failure) {
    if (failure.status == HEDDLE_CANCELLED) throw;
    failures_.push_back(failure);
  }
}

void Writing::finish() const {
  if (failures_.empty()) return;
  std::string all;
  for (const Failure& failure : failures_) all += (all.empty() ? "" : "\n") + failure.message;
  throw Failure{failures_.front().status, all};
}

}  // namespace heddle::cli
