// SPDX-License-Identifier: Apache-2.0
// What parse, overlay and resolve share: the grammar of a graph file (which keys take which TOML types), printing of
// written values, and a list of problems that is thrown once, complete.
#pragma once

#include "graph/stages.hpp"
#include "json.hpp"

namespace heddle::graph {

/// Collects mistakes, so that a person sees all of them at once.
class Problems {
 public:
  void add(const Location& where, std::string message, std::string found = {}, std::string expected = {},
           std::string help = {});
  void add(const std::vector<Diagnostic>& more) { list_.insert(list_.end(), more.begin(), more.end()); }
  [[nodiscard]] bool empty() const { return list_.empty(); }
  /// Throws Error(HEDDLE_BAD_INPUT) with everything, by file in order of appearance, then by line and column.
  void throw_if_any();

 private:
  std::vector<Diagnostic> list_;
};

inline constexpr std::uint32_t kDefaultWidth = 1280, kDefaultHeight = 720;
inline constexpr std::int64_t kLargestExtent = 16384;  // maxImageDimension2D of every desktop device

/// "did you mean 'x'?", or "".
std::string did_you_mean(std::string_view name, std::span<const std::string> candidates);
/// The value as TOML: what "found" shows.
std::string to_toml(const Written& written);
Json to_json(const Written& written);
/// "a string", "an integer", ...
std::string_view type_name(const Written& written);
/// The text of a string value, "" of everything else (also of what was not written).
const std::string& text_of(const Written& written);

/// The keys of a graph file and of a [[pass]], and the words that cannot name a pass.
const std::vector<std::string>& graph_keys();
const std::vector<std::string>& pass_keys();
const std::vector<std::string>& reserved_names();

/// Parses one TOML value that starts at `where`; a bare word that is no TOML value is a string. Adds problems.
std::optional<Written> parse_value(std::string_view text, const Location& where, Problems& problems);

/// Checks the type that a key of the graph needs, and stores the value. `path`: {"extent"}, {"params", "quality"}.
void assign_graph_key(WrittenGraph& graph, std::span<const WrittenKey> path, Written value, Problems& problems);
/// The same for a key of a pass: {"technique"}, {"params", "radius"}.
void assign_pass_key(WrittenPass& pass, std::span<const WrittenKey> path, Written value, Problems& problems);
/// Gives the pass a technique; what was written for another one is marked so.
void change_technique(WrittenPass& pass, Written technique);

}  // namespace heddle::graph
