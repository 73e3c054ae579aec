// SPDX-License-Identifier: Apache-2.0
// TOML text -> WrittenGraph: every value and key with its place, unknown keys and wrong types reported together.
// The only file of the graph that includes toml++: copying a node of it loses the place, so values are walked once.
#include <toml++/toml.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "graph/stages.hpp"
#include "graph/written.hpp"

namespace heddle::graph {
namespace {

Location to_location(const toml::source_region& region, std::string_view file) {
  return {std::string(file), region.begin.line, region.begin.column};
}

/// The line of a text, counted from 1, without spaces at its ends.
std::string_view line_of(std::string_view text, std::uint32_t line) {
  for (std::uint32_t i = 1; i < line; ++i) {
    const auto end = text.find('\n');
    if (end == std::string_view::npos) return {};
    text.remove_prefix(end + 1);
  }
  text = text.substr(0, text.find('\n'));
  if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
  return text;
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.front())) != 0) text.remove_prefix(1);
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back())) != 0) text.remove_suffix(1);
  return text;
}

std::uint32_t count_characters(std::string_view text) {  // UTF-8
  return static_cast<std::uint32_t>(std::ranges::count_if(text, [](char c) { return (c & 0xC0) != 0x80; }));
}

/// The word of `key = word` if it was meant as a string: starts with a letter and is neither quoted nor true or false.
std::string_view bare_word(std::string_view line) {
  const auto equals = line.find('=');
  if (equals == std::string_view::npos) return {};
  std::string_view word = trimmed(line.substr(equals + 1));
  word = trimmed(word.substr(0, word.find_first_of("#,")));
  if (word.empty() || std::isalpha(static_cast<unsigned char>(word.front())) == 0) return {};
  if (word == "true" || word == "false" || word == "nan" || word == "inf") return {};
  if (word.find_first_of("\"'[]{}= \t") != std::string_view::npos) return {};
  return word;
}

/// "Error while parsing array: expected ..." -> "this is no TOML: expected ... (in the array)".
std::string plain_description(const toml::parse_error& error) {
  constexpr std::string_view kPrefix = "Error while parsing ";
  const std::string_view text = error.description();
  const auto colon = text.find(": ");
  if (!text.starts_with(kPrefix) || colon == std::string_view::npos) return std::string(text);
  return "this is no TOML: " + std::string(text.substr(colon + 2)) + " (in the " +
         std::string(text.substr(kPrefix.size(), colon - kPrefix.size())) + ")";
}

Diagnostic syntax_error(const toml::parse_error& error, std::string_view text, std::string_view file) {
  Diagnostic diagnostic;
  diagnostic.where = to_location(error.source(), file);
  const std::string_view line = line_of(text, diagnostic.where.line);
  diagnostic.message = plain_description(error);
  diagnostic.found = std::string(trimmed(line));
  // "could not determine value type" and the like, which the parser says of words without quotes.
  if (const std::string_view word = bare_word(line); !word.empty()) {
    diagnostic.message = "this is no TOML value";
    diagnostic.where.column = count_characters(line.substr(0, static_cast<std::size_t>(word.data() - line.data()))) + 1;
    diagnostic.expected = '"' + std::string(word) + '"';
    diagnostic.help = "strings need quotes";
    if (word == "True" || word == "False") {
      diagnostic.expected = word == "True" ? "true" : "false";
      diagnostic.help = "TOML writes true and false in small letters";
    }
  } else if (diagnostic.message.find("cannot redefine existing table 'pass' as array") != std::string::npos) {
    diagnostic.help = "every pass starts with [[pass]], in two brackets; an earlier one has a single pair";
  } else if (diagnostic.message.find("cannot redefine existing table") != std::string::npos) {
    diagnostic.help = "write either params.NAME = ... for each, or one table with all of them, not both";
  } else if (diagnostic.message.find("unescaped control characters") != std::string::npos) {
    diagnostic.help = "a string ends with its quote in the same line";
  } else if (diagnostic.message.find("cannot redefine existing") != std::string::npos) {
    diagnostic.help = "each key is written once";
  }
  return diagnostic;
}

/// Tables iterate alphabetically; messages and later stages want the order of the file.
std::vector<std::pair<WrittenKey, const toml::node*>> in_file_order(const toml::table& table, std::string_view file) {
  std::vector<std::pair<WrittenKey, const toml::node*>> keys;
  for (const auto& [key, node] : table)
    keys.push_back({{std::string(key.str()), to_location(key.source(), file), {}}, &node});
  std::ranges::stable_sort(keys, {},
                           [](const auto& key) { return std::pair(key.first.where.line, key.first.where.column); });
  return keys;
}

std::string_view type_name(toml::node_type type) {
  switch (type) {
    case toml::node_type::table:
      return "a table";
    case toml::node_type::array:
      return "an array";
    case toml::node_type::string:
      return "a string";
    case toml::node_type::integer:
      return "an integer";
    case toml::node_type::floating_point:
      return "a number";
    case toml::node_type::boolean:
      return "a bool";
    default:
      return "a date or time";
  }
}

std::optional<Written> to_written(const toml::node& node, std::string_view file, Problems& problems) {
  const Location where = to_location(node.source(), file);
  if (const auto* value = node.as_boolean()) return Written{value->get(), where};
  if (const auto* value = node.as_integer()) return Written{value->get(), where};
  if (const auto* value = node.as_string()) return Written{value->get(), where};
  if (const auto* value = node.as_floating_point()) {
    if (std::isfinite(value->get())) return Written{value->get(), where};
    problems.add(where, "nan and inf are no values here", std::isnan(value->get()) ? "nan" : "inf", "a finite number");
    return std::nullopt;
  }
  if (const auto* array = node.as_array()) {
    std::vector<Written> elements;
    bool is_good = true;
    for (const toml::node& element : *array) {
      auto written = to_written(element, file, problems);
      is_good = is_good && written.has_value();
      if (written) elements.push_back(std::move(*written));
    }
    if (is_good) return Written{std::move(elements), where};
    return std::nullopt;
  }
  problems.add(where, std::string(type_name(node.type())) + " cannot stand here", {},
               "a bool, a number, a string or an array of these");
  return std::nullopt;
}

constexpr std::array<std::string_view, 2> kGraphTables{"params", "joins"};
constexpr std::array<std::string_view, 3> kPassTables{"params", "inputs", "functions"};

/// Hands every key of a table to `assign` with its path; goes one level deep into the named tables.
template <typename Assign>
void walk(const toml::table& table, std::string_view file, std::span<const std::string_view> tables, Problems& problems,
          const Assign& assign) {
  for (const auto& [key, node] : in_file_order(table, file)) {
    const bool is_known_table = std::ranges::find(tables, key.name) != tables.end();
    if (const auto* inner = node->as_table(); inner != nullptr && is_known_table) {
      for (const auto& [inner_key, inner_node] : in_file_order(*inner, file)) {
        if (auto value = to_written(*inner_node, file, problems)) assign(std::array{key, inner_key}, std::move(*value));
      }
    } else if (node->is_table() || node->is_array_of_tables()) {
      // No key takes a table here: the path with one of its keys makes the grammar say so, or that the key is unknown.
      const toml::table& shown = node->is_table() ? *node->as_table() : *node->as_array()->front().as_table();
      const auto below = in_file_order(shown, file);
      assign(std::array{key, below.empty() ? key : below.front().first}, Written{std::string{}, key.where});
    } else if (auto value = to_written(*node, file, problems)) {
      assign(std::array{key}, std::move(*value));
    }
  }
}

void read_pass(const toml::table& table, std::string_view file, WrittenGraph& graph, Problems& problems) {
  WrittenPass pass;
  pass.where = to_location(table.source(), file);
  pass.name = pass.role = pass.technique = Written{std::string{}, {}};
  // The names come first, because the messages about the other keys say them.
  for (const char* key : {"role", "name"})
    if (const auto* node = table.get_as<std::string>(key))
      pass.name = Written{node->get(), to_location(node->source(), file)};
  walk(table, file, kPassTables, problems, [&](std::span<const WrittenKey> path, Written value) {
    assign_pass_key(pass, path, std::move(value), problems);
  });

  const bool is_overlay = graph.extends.has_value();
  const std::string label = text_of(pass.name).empty() ? "this pass" : "pass '" + text_of(pass.name) + "'";
  if (text_of(pass.name).empty() && !table.contains("name") && !table.contains("role"))
    problems.add(pass.where, "this pass has neither name nor role", {},
                 "role = \"...\", and a name if two passes have the same role");
  if (!is_overlay) {
    if (!table.contains("role") && !text_of(pass.name).empty())
      problems.add(pass.where, label + " has no role", {}, "role = \"...\"");
    if (!table.contains("technique") && !text_of(pass.name).empty())
      problems.add(pass.where, label + " has no technique", {}, "technique = \"...\", or \"none\"");
    for (const auto* place : {&pass.after, &pass.before})
      if (*place)
        problems.add((*place)->where, label + ": 'after' and 'before' are for files that extend another", {}, {},
                     "here the pass stands where it is written");
  }
  if (pass.after && pass.before)
    problems.add(pass.before->where, label + " says both 'after' and 'before'", {}, "one of them");
  graph.passes.push_back(std::move(pass));
}

}  // namespace

WrittenGraph parse(std::string_view text, std::string_view file) {
  toml::table table;
  try {
    table = toml::parse(text, file);
  } catch (const toml::parse_error& error) {
    throw Error(HEDDLE_BAD_INPUT, syntax_error(error, text, file));
  }

  WrittenGraph graph;
  graph.file = std::string(file);
  Problems problems;
  if (const toml::node* extends = table.get("extends"); extends != nullptr && extends->is_string())
    graph.extends = to_written(*extends, file, problems);
  if (const toml::node* passes = table.get("pass"); passes != nullptr) {
    if (const toml::array* array = passes->as_array(); array != nullptr && array->is_array_of_tables()) {
      for (const toml::node& pass : *array) read_pass(*pass.as_table(), file, graph, problems);
    } else {
      problems.add(to_location(passes->source(), file),
                   "'pass' is written as " + std::string(type_name(passes->type())), {},
                   "[[pass]], in two brackets, before the keys of each pass");
    }
  }
  table.erase("pass");  // read already, in its own way
  walk(table, file, kGraphTables, problems, [&](std::span<const WrittenKey> path, Written value) {
    assign_graph_key(graph, path, std::move(value), problems);
  });
  if (!graph.extends && !graph.remove.empty())
    problems.add(graph.remove.front().where, "'remove' is for files that extend another",
                 to_toml(graph.remove.front()));
  problems.throw_if_any();
  return graph;
}

std::optional<Written> parse_value(std::string_view text, const Location& where, Problems& problems) {
  constexpr std::string_view kBefore = "v = ";
  const std::string_view value = trimmed(text);
  const std::uint32_t spaces = static_cast<std::uint32_t>(value.data() - text.data());
  const auto shift = [&](Location place) {
    if (place.line == 1)
      place.column = where.column + spaces + (place.column - static_cast<std::uint32_t>(kBefore.size()) - 1);
    return place;
  };
  const auto move_all = [&](const auto& self, Written& written) -> void {
    written.where = shift(written.where);
    if (auto* array = std::get_if<std::vector<Written>>(&written.value))
      for (Written& element : *array) self(self, element);
  };
  try {
    const toml::table table = toml::parse(std::string(kBefore) + std::string(value), std::string_view(where.file));
    if (table.size() == 1) {
      auto written = to_written(*table.get("v"), where.file, problems);
      if (written) move_all(move_all, *written);
      return written;
    }
    problems.add(where, "a setting is one value", std::string(value));
    return std::nullopt;
  } catch (const toml::parse_error& error) {
    const bool is_word = !value.empty() && std::ranges::all_of(value, [](char c) {
      return std::isalnum(static_cast<unsigned char>(c)) != 0 ||
             std::string_view("_-./$+").find(c) != std::string_view::npos;
    });
    if (is_word)
      return Written{std::string(value), shift({where.file, 1, static_cast<std::uint32_t>(kBefore.size()) + 1})};
    problems.add(value.empty() ? where : shift(to_location(error.source(), where.file)),
                 value.empty() ? "the value is missing" : plain_description(error), std::string(value),
                 "a value of TOML, or a word");
    return std::nullopt;
  }
}

}  // namespace heddle::graph
