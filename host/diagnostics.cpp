// SPDX-License-Identifier: Apache-2.0
// Diagnostics -> the text that people read; names that were misspelled -> the name that was meant.
#include "diagnostics.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

namespace heddle {
namespace {

constexpr std::array<std::string_view, 3> kSeverityNames{"error", "warning", "info"};
// "  expected: " is the longest head of a detail line; the others are padded to it.
constexpr std::string_view kContinuation = "            ";

void append_detail(std::string& text, std::string_view head, std::string_view detail) {
  if (detail.empty()) return;
  text += fmt::format("\n  {:<10}", head);
  for (const char c : detail) {
    text += c;
    if (c == '\n') text += kContinuation;  // a detail of several lines stays in its column
  }
}

std::vector<Diagnostic> without_place(std::string_view message, std::string_view help) {
  Diagnostic diagnostic;
  diagnostic.message = message;
  diagnostic.help = help;
  return {std::move(diagnostic)};
}

// Optimal string alignment distance: insertions, deletions, substitutions and swaps of neighbours cost 1 each.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  const std::size_t width = b.size() + 1;
  std::vector<std::size_t> before_last(width);
  std::vector<std::size_t> last(width);
  std::vector<std::size_t> row(width);
  for (std::size_t j = 0; j < width; ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    before_last.swap(last);
    last.swap(row);
    row[0] = i;
    for (std::size_t j = 1; j < width; ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] == b[j - 1] ? 0U : 1U)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        row[j] = std::min(row[j], before_last[j - 2] + 1);
      }
    }
  }
  return row.back();
}

}  // namespace

std::string to_text(const Diagnostic& diagnostic) {
  std::string text;
  const Location& where = diagnostic.where;
  if (!where.file.empty()) {
    text = where.file;
    if (where.line != 0) text += fmt::format(":{}", where.line);
    if (where.line != 0 && where.column != 0) text += fmt::format(":{}", where.column);
    text += ": ";
  }
  text += kSeverityNames[static_cast<std::size_t>(diagnostic.severity)];
  text += ": ";
  text += diagnostic.message;
  append_detail(text, "found:", diagnostic.found);
  append_detail(text, "expected:", diagnostic.expected);
  append_detail(text, "help:", diagnostic.help);
  return text;
}

std::string to_text(std::span<const Diagnostic> diagnostics) {
  std::string text;
  for (const Diagnostic& diagnostic : diagnostics) {
    if (!text.empty()) text += '\n';
    text += to_text(diagnostic);
  }
  return text;
}

std::vector<Diagnostic> first_of(std::vector<Diagnostic> diagnostics) {
  if (diagnostics.size() <= kMostDiagnostics) return diagnostics;
  Diagnostic rest;
  rest.where.file = diagnostics[kMostDiagnostics].where.file;
  rest.message = fmt::format("and {} more mistakes like these", diagnostics.size() - kMostDiagnostics);
  diagnostics.resize(kMostDiagnostics);
  diagnostics.push_back(std::move(rest));
  return diagnostics;
}

Error::Error(heddle_status status, std::vector<Diagnostic> diagnostics)
    : std::runtime_error(to_text(diagnostics)), status_(status), diagnostics_(std::move(diagnostics)) {}

Error::Error(heddle_status status, Diagnostic diagnostic)
    : Error(status, std::vector<Diagnostic>{std::move(diagnostic)}) {}

Error::Error(heddle_status status, std::string_view message, std::string_view help)
    : Error(status, without_place(message, help)) {}

std::string nearest_name(std::string_view name, std::span<const std::string> candidates) {
  const std::size_t forgiven = std::max<std::size_t>(1, name.size() / 3);
  std::size_t smallest = forgiven + 1;
  const std::string* nearest = nullptr;
  for (const std::string& candidate : candidates) {
    // A difference in length is a lower bound of the distance: most candidates cost nothing.
    const std::size_t longer = std::max(candidate.size(), name.size());
    if (longer - std::min(candidate.size(), name.size()) >= smallest) continue;
    const std::size_t distance = edit_distance(name, candidate);
    if (distance < smallest) {
      smallest = distance;
      nearest = &candidate;
    }
  }
  return nearest == nullptr ? std::string() : *nearest;
}

std::string join_names(std::span<const std::string> names) {
  std::string text;
  for (const std::string& name : names) {
    if (!text.empty()) text += ", ";
    text += name;
  }
  return text;
}

}  // namespace heddle
