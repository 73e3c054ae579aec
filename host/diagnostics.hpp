// SPDX-License-Identifier: Apache-2.0
// Messages to people: what was found, where, what was expected, what to do. One form for the whole host:
//   file:line:column: error: message
//     found:    ...
//     expected: ...
//     help:     ...
#pragma once

#include <heddle/abi.h>

#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace heddle {

struct Location {
  std::string file;          // as the user named it; empty: no place
  std::uint32_t line = 0;    // from 1; 0: the whole file
  std::uint32_t column = 0;  // from 1, in characters
};

enum class Severity : std::uint8_t { kError, kWarning, kInfo };

struct Diagnostic {
  Severity severity = Severity::kError;
  Location where;
  std::string message;  // one sentence without full stop
  std::string found;    // the rest may be empty, and is then not printed
  std::string expected;
  std::string help;
};

/// The diagnostic in the form above, without a final newline.
std::string to_text(const Diagnostic& diagnostic);
/// All of them, one after the other, separated by newlines.
std::string to_text(std::span<const Diagnostic> diagnostics);

/// What every failing call of the host throws; becomes status and message at the C border.
/// The first ones of many, and how many more there are: nobody reads a hundred at once.
std::vector<Diagnostic> first_of(std::vector<Diagnostic> diagnostics);
inline constexpr std::size_t kMostDiagnostics = 32;

class Error : public std::runtime_error {
 public:
  Error(heddle_status status, Diagnostic diagnostic);
  Error(heddle_status status, std::vector<Diagnostic> diagnostics);
  /// A message without a place.
  Error(heddle_status status, std::string_view message, std::string_view help = {});

  [[nodiscard]] heddle_status status() const { return status_; }
  [[nodiscard]] const std::vector<Diagnostic>& diagnostics() const { return diagnostics_; }

 private:
  heddle_status status_;
  std::vector<Diagnostic> diagnostics_;
};

/// The candidate with the smallest edit distance (transpositions count once), or "" if none is near: at most a third of
/// the name's length, and at least one edit is forgiven.
std::string nearest_name(std::string_view name, std::span<const std::string> candidates);
/// "a, b, c".
std::string join_names(std::span<const std::string> names);

}  // namespace heddle
