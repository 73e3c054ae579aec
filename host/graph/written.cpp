// SPDX-License-Identifier: Apache-2.0
// The grammar of a graph file: path of keys + value -> the field of WrittenGraph or WrittenPass, or a problem.
#include "graph/written.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "plugin/rules.hpp"

namespace heddle::graph {
namespace {

const std::vector<std::string> kGraphKeys{"kind", "extends", "extent", "output", "params", "joins", "remove", "pass"};
const std::vector<std::string> kPassKeys{"name",      "role",   "technique", "params", "inputs",
                                         "functions", "serves", "enabled",   "after",  "before"};
const std::vector<std::string> kReservedNames{"scene",  "none",   "kind",  "extends", "extent",
                                              "output", "params", "joins", "remove",  "pass"};

using Assignments = std::vector<std::pair<WrittenKey, Written>>;

void put(Assignments& assignments, const WrittenKey& key, Written value) {
  const auto found = std::ranges::find(assignments, key.name,
                                       [](const auto& entry) -> const std::string& { return entry.first.name; });
  if (found == assignments.end()) {
    assignments.emplace_back(key, std::move(value));
  } else {
    *found = {key, std::move(value)};
  }
}

bool is_string(const Written& written) {
  return std::holds_alternative<std::string>(written.value);
}

bool is_array_of_strings(const Written& written) {
  const auto* array = std::get_if<std::vector<Written>>(&written.value);
  return array != nullptr && std::ranges::all_of(*array, is_string);
}

std::string path_text(std::span<const WrittenKey> path) {
  std::string text;
  for (const WrittenKey& key : path) text += (text.empty() ? "" : ".") + key.name;
  return text;
}

/// Reports "label: 'key' must be ..." and answers false unless `is_good`.
bool expect(bool is_good, std::string_view label, std::span<const WrittenKey> path, const Written& value,
            std::string_view expected, Problems& problems, std::string help = {}) {
  if (is_good) return true;
  problems.add(value.where, fmt::format("{}'{}' is {}", label, path_text(path), type_name(value)),
               fmt::format("{} = {}", path_text(path), to_toml(value)), std::string(expected), std::move(help));
  return false;
}

/// True if the path has exactly the tables' depth of the key; else a problem.
bool expect_depth(std::span<const WrittenKey> path, std::size_t depth, std::string_view label,
                  std::string_view expected, Problems& problems) {
  if (path.size() == depth) return true;
  const WrittenKey& key = path.size() > depth ? path[depth] : path.back();
  problems.add(key.where,
               fmt::format("{}'{}' {}", label, path_text(path),
                           path.size() > depth ? "goes too deep" : "needs a name behind it"),
               {}, std::string(expected));
  return false;
}

}  // namespace

void Problems::add(const Location& where, std::string message, std::string found, std::string expected,
                   std::string help) {
  list_.push_back(
      {Severity::kError, where, std::move(message), std::move(found), std::move(expected), std::move(help)});
}

void Problems::throw_if_any() {
  if (list_.empty()) return;
  std::vector<std::string> files;
  const auto file_index = [&](const std::string& file) {
    const auto found = std::ranges::find(files, file);
    if (found != files.end()) return found - files.begin();
    files.push_back(file);
    return static_cast<std::ptrdiff_t>(files.size()) - 1;
  };
  for (const Diagnostic& diagnostic : list_) file_index(diagnostic.where.file);
  std::ranges::stable_sort(list_, {}, [&](const Diagnostic& diagnostic) {
    return std::tuple(file_index(diagnostic.where.file), diagnostic.where.line, diagnostic.where.column);
  });
  throw Error(HEDDLE_BAD_INPUT, first_of(std::move(list_)));
}

const std::vector<std::string>& graph_keys() {
  return kGraphKeys;
}
const std::vector<std::string>& pass_keys() {
  return kPassKeys;
}
const std::vector<std::string>& reserved_names() {
  return kReservedNames;
}

std::string did_you_mean(std::string_view name, std::span<const std::string> candidates) {
  const std::string nearest = nearest_name(name, candidates);
  return nearest.empty() ? std::string{} : "did you mean '" + nearest + "'?";
}

std::string to_toml(const Written& written) {
  struct Printer {
    std::string operator()(bool value) const { return value ? "true" : "false"; }
    std::string operator()(std::int64_t value) const { return fmt::format("{}", value); }
    std::string operator()(double value) const {
      std::string text = fmt::format("{}", value);
      if (text.find_first_of(".en") == std::string::npos) text += ".0";
      return text;
    }
    std::string operator()(const std::string& value) const {
      std::string text = "\"";
      for (const char c : value) {
        if (c == '"' || c == '\\') text += '\\';
        if (static_cast<unsigned char>(c) < 0x20) {
          text += fmt::format("\\u{:04x}", static_cast<unsigned char>(c));
        } else {
          text += c;
        }
      }
      return text + '"';
    }
    std::string operator()(const std::vector<Written>& value) const {
      std::string text;
      for (const Written& element : value) text += (text.empty() ? "" : ", ") + std::visit(*this, element.value);
      return "[" + text + "]";
    }
  };
  return std::visit(Printer{}, written.value);
}

std::string_view type_name(const Written& written) {
  constexpr std::array<std::string_view, 5> kNames{"a bool", "an integer", "a number", "a string", "an array"};
  return kNames.at(written.value.index());
}

const std::string& text_of(const Written& written) {
  static const std::string kEmpty;
  const auto* text = std::get_if<std::string>(&written.value);
  return text != nullptr ? *text : kEmpty;
}

void assign_graph_key(WrittenGraph& graph, std::span<const WrittenKey> path, Written value, Problems& problems) {
  const WrittenKey& key = path.front();
  if (key.name == "extends" || key.name == "output") {
    if (expect_depth(path, 1, {}, "one string", problems) &&
        expect(is_string(value), {}, path, value,
               key.name == "output" ? "a string \"pass.port\"" : "the name of a file, as a string", problems))
      (key.name == "output" ? graph.output : graph.extends) = std::move(value);
  } else if (key.name == "kind") {
    static const std::vector<std::string> kKinds{"frame", "job"};
    if (expect_depth(path, 1, {}, "\"frame\" or \"job\"", problems) &&
        expect(text_of(value) == "frame" || text_of(value) == "job", {}, path, value, "\"frame\" or \"job\"", problems,
               did_you_mean(text_of(value), kKinds)))
      graph.kind = std::move(value);
  } else if (key.name == "extent") {
    if (expect_depth(path, 1, {}, "[width, height]", problems)) graph.extent = std::move(value);
  } else if (key.name == "params") {
    if (expect_depth(path, 2, {}, "params.NAME = value", problems)) put(graph.params, path[1], std::move(value));
  } else if (key.name == "joins") {
    if (expect_depth(path, 2, {}, "joins.ROLE = \"switch\", \"sum\" or \"product\"", problems) &&
        expect(is_string(value), {}, path, value, "\"switch\", \"sum\" or \"product\"", problems))
      put(graph.joins, path[1], std::move(value));
  } else if (key.name == "remove") {
    if (expect_depth(path, 1, {}, "an array of names of passes", problems) &&
        expect(is_array_of_strings(value), {}, path, value, "an array of names of passes", problems))
      graph.remove = std::move(std::get<std::vector<Written>>(value.value));
  } else {
    const bool is_pass_key = std::ranges::find(kPassKeys, key.name) != kPassKeys.end();
    problems.add(key.where, fmt::format("a graph has no key '{}'", key.name), {}, "one of " + join_names(kGraphKeys),
                 is_pass_key ? "it is a key of a pass: it goes below a [[pass]]" : did_you_mean(key.name, kGraphKeys));
  }
}

void assign_pass_key(WrittenPass& pass, std::span<const WrittenKey> path, Written value, Problems& problems) {
  const WrittenKey& key = path.front();
  const std::string label = text_of(pass.name).empty() ? "" : "pass '" + text_of(pass.name) + "': ";
  const auto is_one_string = [&](std::string_view expected) {
    return expect_depth(path, 1, label, expected, problems) &&
           expect(is_string(value), label, path, value, expected, problems);
  };
  if (key.name == "name") {
    if (!is_one_string("a string")) return;
    // Names of passes become suffixes of names in joined shaders.
    if (!is_identifier(text_of(value))) {
      problems.add(value.where, fmt::format("'{}' cannot name a pass", text_of(value)), "name = " + to_toml(value),
                   "letters, digits and single underscores, no digit first");
    } else if (std::ranges::find(kReservedNames, text_of(value)) != kReservedNames.end()) {
      problems.add(value.where,
                   fmt::format("'{}' cannot name a pass: the word has a meaning in graphs", text_of(value)),
                   "name = " + to_toml(value), "a name other than " + join_names(kReservedNames));
    }
    pass.name = std::move(value);
  } else if (key.name == "role") {
    if (!is_one_string("the name of a role, as a string")) return;
    if (text_of(pass.name).empty()) pass.name = value;
    pass.role = std::move(value);
  } else if (key.name == "technique") {
    if (is_one_string("the name of a technique, or \"none\"")) change_technique(pass, std::move(value));
  } else if (key.name == "after" || key.name == "before") {
    if (is_one_string("the name of a pass, as a string"))
      (key.name == "after" ? pass.after : pass.before) = std::move(value);
  } else if (key.name == "enabled") {
    if (expect_depth(path, 1, label, "true or false", problems) &&
        expect(std::holds_alternative<bool>(value.value), label, path, value, "true or false", problems))
      pass.enabled = std::move(value);
  } else if (key.name == "serves") {
    if (expect_depth(path, 1, label, "an array of names", problems) &&
        expect(is_array_of_strings(value), label, path, value, "an array of names", problems)) {
      pass.serves = std::move(std::get<std::vector<Written>>(value.value));
      pass.says_serves = true;
    }
  } else if (key.name == "params") {
    if (expect_depth(path, 2, label, "params.NAME = value", problems)) put(pass.params, path[1], std::move(value));
  } else if (key.name == "inputs") {
    constexpr std::string_view kExpected =
        "\"pass.port\", \"scene.camera\", \"scene.environment\", \"scene.lights\", \"scene.surfaces\", "
        "\"job.toml#artifact\" "
        "or \"none\"";
    if (expect_depth(path, 2, label, "inputs.PORT = \"pass.port\"", problems) &&
        expect(is_string(value), label, path, value, kExpected, problems))
      put(pass.inputs, path[1], std::move(value));
  } else if (key.name == "functions") {
    if (expect_depth(path, 2, label, "functions.ROLE = [\"pass\", ...]", problems) &&
        expect(is_array_of_strings(value), label, path, value, "an array of names of passes; [] for the neutral answer",
               problems))
      put(pass.functions, path[1], std::move(value));
  } else {
    const bool is_graph_key = std::ranges::find(kGraphKeys, key.name) != kGraphKeys.end();
    problems.add(key.where, fmt::format("{}a pass has no key '{}'", label, key.name), {},
                 "one of " + join_names(kPassKeys),
                 is_graph_key ? "it is a key of the graph: it goes above the first [[pass]]"
                              : did_you_mean(key.name, kPassKeys));
  }
}

void change_technique(WrittenPass& pass, Written technique) {
  const std::string before = text_of(pass.technique);
  const std::string& after = text_of(technique);
  if (!before.empty() && before != after) {
    for (auto* assignments : {&pass.params, &pass.inputs, &pass.functions})
      for (auto& entry : *assignments) {
        if (entry.first.written_for.empty()) entry.first.written_for = before;
        if (entry.first.written_for == after) entry.first.written_for.clear();
      }
  }
  pass.technique = std::move(technique);
}

Json to_json(const Written& written) {
  struct Writer {
    Json operator()(bool value) const { return value; }
    Json operator()(std::int64_t value) const { return value; }
    Json operator()(double value) const { return value; }
    Json operator()(const std::string& value) const { return value; }
    Json operator()(const std::vector<Written>& value) const {
      Json list = Json::array();
      for (const Written& element : value) list.push_back(std::visit(*this, element.value));
      return list;
    }
  };
  return std::visit(Writer{}, written.value);
}

}  // namespace heddle::graph
