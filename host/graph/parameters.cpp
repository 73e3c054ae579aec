// SPDX-License-Identifier: Apache-2.0
// Written values + a technique's parameters -> values in range, or problems that say the range and the unit.
#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "graph/resolve.hpp"

namespace heddle::graph {
namespace {

/// Why a value does not suit: what fills a message. An empty `message`: it does.
struct Complaint {
  std::string message, expected, help;
};

std::optional<double> number_of(const Written& value) {
  if (const auto* integer = std::get_if<std::int64_t>(&value.value)) return static_cast<double>(*integer);
  if (const auto* number = std::get_if<double>(&value.value)) return *number;
  return std::nullopt;
}

bool is_bounded(const Parameter& parameter) {
  return parameter.minimum != parameter.maximum;
}

std::string unit_suffix(const Parameter& parameter) {
  return parameter.unit.empty() || parameter.unit == "1" ? "" : " " + parameter.unit;
}

/// "0.01 to 10 m", "at least 0 lx", or "".
std::string range_text(const Parameter& parameter) {
  if (!is_bounded(parameter)) return {};
  const bool has_minimum = parameter.minimum > -std::numeric_limits<double>::max();
  const bool has_maximum = parameter.maximum < std::numeric_limits<double>::max();
  const std::string unit = unit_suffix(parameter);
  if (has_minimum && has_maximum) return fmt::format("{} to {}{}", parameter.minimum, parameter.maximum, unit);
  if (has_minimum) return fmt::format("at least {}{}", parameter.minimum, unit);
  if (has_maximum) return fmt::format("at most {}{}", parameter.maximum, unit);
  return {};
}

std::string type_text(const Parameter& parameter) {
  const std::string range = range_text(parameter);
  const auto with_range = [&](std::string text) {
    return range.empty() ? text + (unit_suffix(parameter).empty() ? "" : " in" + unit_suffix(parameter))
                         : text + ", " + range;
  };
  switch (parameter.type) {
    case ParameterType::kFloat:
      return with_range("a number");
    case ParameterType::kInt:
      return with_range("an integer");
    case ParameterType::kBool:
      return "true or false";
    case ParameterType::kChoice:
      return "one of " + join_names(parameter.choices);
    case ParameterType::kColor:
      return with_range("[r, g, b], linear Rec.709");
    case ParameterType::kFloat3:
      return with_range("[x, y, z]");
    case ParameterType::kNames:
      return "an array of strings";
    case ParameterType::kText:
      return "a string";
  }
  return {};
}

Complaint wrong_type(const Parameter& parameter, const Written& value) {
  return {fmt::format("is {}", type_name(value)), type_text(parameter), {}};
}

bool is_in_range(const Parameter& parameter, double number) {
  return !is_bounded(parameter) || (number >= parameter.minimum && number <= parameter.maximum);
}

Complaint out_of_range(const Parameter& parameter) {
  return {"is out of range", range_text(parameter), {}};
}

Complaint read_value(const Parameter& parameter, const Written& value, ParameterValue& out) {
  out = {};
  switch (parameter.type) {
    case ParameterType::kFloat: {
      const auto number = number_of(value);
      if (!number) return wrong_type(parameter, value);
      if (!is_in_range(parameter, *number)) return out_of_range(parameter);
      out.number[0] = *number;
      return {};
    }
    case ParameterType::kInt: {
      const auto* integer = std::get_if<std::int64_t>(&value.value);
      if (integer == nullptr) return wrong_type(parameter, value);
      if (*integer < std::numeric_limits<std::int32_t>::min() || *integer > std::numeric_limits<std::int32_t>::max())
        return {"does not fit into 32 bits", type_text(parameter), {}};
      if (!is_in_range(parameter, static_cast<double>(*integer))) return out_of_range(parameter);
      out.number[0] = static_cast<double>(*integer);
      return {};
    }
    case ParameterType::kBool: {
      const auto* boolean = std::get_if<bool>(&value.value);
      if (boolean == nullptr) return wrong_type(parameter, value);
      out.number[0] = *boolean ? 1 : 0;
      return {};
    }
    case ParameterType::kChoice: {
      // Choices may be numerals, and a setting's `spacing=4` is a number: it is meant where it is a choice to the
      // letter.
      const auto* text = std::get_if<std::string>(&value.value);
      const std::string word = text != nullptr ? *text : number_of(value) ? to_toml(value) : std::string();
      const auto found = std::ranges::find(parameter.choices, word);
      if (text == nullptr && found == parameter.choices.end()) return wrong_type(parameter, value);
      if (found == parameter.choices.end())
        return {fmt::format("has no choice '{}'", word), type_text(parameter), did_you_mean(word, parameter.choices)};
      out.number[0] = static_cast<double>(found - parameter.choices.begin());
      return {};
    }
    case ParameterType::kColor:
    case ParameterType::kFloat3: {
      const auto* array = std::get_if<std::vector<Written>>(&value.value);
      if (array == nullptr) return wrong_type(parameter, value);
      if (array->size() != 3) return {fmt::format("has {} components", array->size()), type_text(parameter), {}};
      for (std::size_t i = 0; i < 3; ++i) {
        const auto number = number_of((*array)[i]);
        if (!number) return {fmt::format("has {} as a component", type_name((*array)[i])), type_text(parameter), {}};
        if (!is_in_range(parameter, *number)) return out_of_range(parameter);
        out.number[i] = *number;
      }
      return {};
    }
    case ParameterType::kNames: {
      const auto* array = std::get_if<std::vector<Written>>(&value.value);
      if (array == nullptr) return wrong_type(parameter, value);
      for (const Written& element : *array) {
        if (!std::holds_alternative<std::string>(element.value))
          return {fmt::format("has {} among its names", type_name(element)), type_text(parameter), {}};
        out.names.push_back(text_of(element));
      }
      return {};
    }
    case ParameterType::kText: {
      const auto* text = std::get_if<std::string>(&value.value);
      if (text == nullptr) return wrong_type(parameter, value);
      out.names = {*text};
      return {};
    }
  }
  return {};
}

}  // namespace

std::vector<ParameterValue> read_parameters(const WrittenPass& written, const Technique& technique, Presets& presets,
                                            Problems& problems, std::vector<std::string>& notes,
                                            std::vector<ParameterOrigin>& origins) {
  std::vector<ParameterValue> values(technique.parameters.size());
  origins.assign(values.size(), {});
  std::vector<std::string> names;
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i].number = technique.parameters[i].default_value;
    names.push_back(technique.parameters[i].name);
  }
  const std::string& pass = text_of(written.name);

  for (const auto& [key, said] : written.params) {
    const bool is_inherited = !key.written_for.empty();
    const auto note = [&](std::string_view why) {
      notes.push_back(fmt::format("pass '{}': params.{} was written for '{}' and is left out: '{}' {}", pass, key.name,
                                  key.written_for, technique.name(), why));
    };
    const auto found = std::ranges::find(names, key.name);
    if (found == names.end()) {
      if (is_inherited) {
        note("has no such parameter");
        continue;
      }
      problems.add(key.where,
                   fmt::format("pass '{}': technique '{}' has no parameter '{}'", pass, technique.id, key.name),
                   fmt::format("params.{} = {}", key.name, to_toml(said)),
                   names.empty() ? "no parameters" : "one of " + join_names(names), did_you_mean(key.name, names));
      continue;
    }
    const auto index = static_cast<std::size_t>(found - names.begin());
    const Parameter& parameter = technique.parameters[index];

    // "$NAME" stands for a preset at the top of the graph.
    const Written* value = &said;
    std::string through;
    if (const std::string& text = text_of(said); text.size() > 1 && text.front() == '$') {
      const auto preset = presets.values.find(std::string_view(text).substr(1));
      if (preset == presets.values.end()) {
        std::vector<std::string> known;
        for (const auto& entry : presets.values) known.push_back(entry.first);
        problems.add(said.where, fmt::format("pass '{}': [params] has no '{}'", pass, text.substr(1)),
                     fmt::format("params.{} = {}", key.name, to_toml(said)),
                     known.empty() ? "a preset in [params], at the top of the graph" : "one of " + join_names(known),
                     did_you_mean(text.substr(1), known));
        continue;
      }
      value = preset->second;
      presets.is_used[preset->first] = true;
      through = text.substr(1);
    }
    ParameterValue read;
    const Complaint complaint = read_value(parameter, *value, read);
    if (complaint.message.empty()) {
      values[index] = std::move(read);
      origins[index] = {said.where, through, through.empty() ? Location{} : value->where};
    } else if (is_inherited) {
      note(fmt::format("wants {}", complaint.expected));
    } else {
      problems.add(value->where, fmt::format("pass '{}': params.{} {}", pass, key.name, complaint.message),
                   through.empty() ? fmt::format("params.{} = {}", key.name, to_toml(*value))
                                   : fmt::format("params.{0} = {1}, for params.{2} = \"${0}\" of pass '{3}'", through,
                                                 to_toml(*value), key.name, pass),
                   complaint.expected, complaint.help);
    }
  }
  return values;
}

}  // namespace heddle::graph
