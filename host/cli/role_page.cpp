// SPDX-License-Identifier: Apache-2.0
// The list of roles and techniques -> a page of Markdown for one role. Nothing is said here that its contract and
// manifests do not say.
#include "cli/role_page.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace heddle::cli {
namespace {

std::string number(const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number_float()) return fmt::format("{:.6g}", value.get<double>());
  return value.dump();
}

std::string numbers(const Json& values) {
  std::vector<std::string> words;
  for (const Json& value : values) words.push_back(number(value));
  return fmt::format("{}", fmt::join(words, ", "));
}

std::string words(const Json& values) {
  std::vector<std::string> list;
  for (const Json& value : values) list.push_back(value.get<std::string>());
  return fmt::format("{}", fmt::join(list, ", "));
}

/// Text in a cell: a bar would end it.
std::string cell(std::string text) {
  for (std::size_t at = 0; (at = text.find('|', at)) != std::string::npos; at += 2) text.replace(at, 1, "\\|");
  std::ranges::replace(text, '\n', ' ');
  return text;
}

std::string code(const std::string& text) {
  return text.empty() ? "" : "`" + text + "`";
}

/// A table; without rows nothing at all.
class Table {
 public:
  explicit Table(std::vector<std::string> titles) : titles_(std::move(titles)) {}
  void row(std::vector<std::string> cells) {
    for (std::string& text : cells) text = cell(std::move(text));
    rows_.push_back(std::move(cells));
  }
  [[nodiscard]] std::string text(std::string_view heading) const {
    if (rows_.empty()) return {};
    std::string out = fmt::format("{}\n\n| {} |\n|", heading, fmt::join(titles_, " | "));
    for (std::size_t i = 0; i < titles_.size(); ++i) out += "---|";
    for (const auto& cells : rows_) out += fmt::format("\n| {} |", fmt::join(cells, " | "));
    return out + "\n\n";
  }

 private:
  std::vector<std::string> titles_;
  std::vector<std::vector<std::string>> rows_;
};

std::string range_of(const Json& parameter) {
  if (!parameter["choices"].empty()) return words(parameter["choices"]);
  const auto type = text_of(parameter, "type");
  if (type == "bool") return "false, true";
  if (type == "text" || type == "path") return {};
  return fmt::format("{} to {}", number(parameter["minimum"]), number(parameter["maximum"]));
}

std::string default_of(const Json& parameter) {
  const Json& value = parameter["default"];
  const auto type = text_of(parameter, "type");
  if (value.is_string()) return code(value.get<std::string>());
  if (!value.is_array() || value.empty()) return value.is_null() ? "" : value.dump();
  if (!parameter["choices"].empty()) {
    const auto index = static_cast<std::size_t>(value[0].get<double>());
    return index < parameter["choices"].size() ? parameter["choices"][index].get<std::string>() : "";
  }
  if (type == "bool") return value[0].get<double>() != 0 ? "true" : "false";
  if (type == "int" || type == "float") return number(value[0]);
  return type == "text" || type == "path" ? "" : numbers(value);
}

std::string ladder_of(const Json& parameter) {
  if (parameter["choices"].empty()) return numbers(parameter["ladder"]);
  std::vector<std::string> names;
  for (const Json& rung : parameter["ladder"]) {
    names.push_back(parameter["choices"].at(static_cast<std::size_t>(rung.get<double>())).get<std::string>());
  }
  return fmt::format("{}", fmt::join(names, ", "));
}

std::string reference_text(const Json& list, const Json& role) {
  std::string out;
  for (const auto& [key, meaning] : {std::pair("same_model", "the same equations, converged"),
                                     std::pair("physical", "independent of the techniques' model")}) {
    const Json& reference = role["references"][key];
    if (reference.is_null()) continue;
    std::string params;
    for (const auto& [name, value] : reference["params"].items()) {
      params += fmt::format("{}{} = {}", params.empty() ? " with " : ", ", name, value.get<std::string>());
    }
    if (const auto port = reference.value("port", std::string()); !port.empty()) {
      params += fmt::format("{}its port `{}`", params.empty() ? ": " : "; ", port);
    }
    const bool is_there = std::ranges::any_of(
        list["techniques"], [&](const Json& technique) { return technique["id"] == reference["technique"]; });
    out += fmt::format("- truth ({}): `{}`{}{}\n", meaning, text_of(reference, "technique"), params,
                       is_there ? "" : ", which is not installed");
  }
  const Json& measure = role["measure"];
  const auto note = text_of(measure, "note");
  if (const auto subject = text_of(measure, "port") + text_of(measure, "function"); !subject.empty()) {
    out +=
        fmt::format("- measured: {} of `{}`{}\n", text_of(measure, "metric"), subject, note.empty() ? "" : ", " + note);
  } else if (!note.empty()) {
    out += fmt::format("- measured: {}\n", note);
  }
  return out.empty() ? out : out + "\n";
}

std::string contract(const Json& role) {
  Table ports({"port", "", "type", "unit", "range", "if absent", "meaning"});
  for (const Json& port : role["ports"]) {
    const bool is_image = port["type"] == "image";
    const bool is_in = port["direction"] == "in";
    std::string range =
        port["range"].is_null() ? "" : fmt::format("{} to {}", number(port["range"][0]), number(port["range"][1]));
    if (port["infinite"].get<bool>()) range += range.empty() ? "may be infinite" : ", may be infinite";
    ports.row({code(text_of(port, "name")),
               text_of(port, "direction") + (is_in && port["optional"].get<bool>() ? ", optional" : ""),
               text_of(port, "type"), text_of(port, "unit"), range, is_image ? numbers(port["neutral"]) : "",
               text_of(port, "help")});
  }
  std::string out = ports.text("## Contract");
  for (const Json& function : role["functions"]) {
    out += fmt::format("Function, asked by shaders that include `role/{}.glsl`: {}\n\n```glsl\n{}\n```\n\n",
                       text_of(role, "name"), text_of(function, "help"), text_of(function, "signature"));
    if (!text_of(function, "unit").empty()) out += fmt::format("Unit {}. ", text_of(function, "unit"));
    out += fmt::format("Without a technique: {}\n\n", code(text_of(function, "neutral")));
  }
  if (!role["functions"].empty() && !text_of(role, "selector").empty()) {
    out += fmt::format("Several techniques at once: {} by `{}`.\n\n", text_of(role, "join"), text_of(role, "selector"));
  }
  for (const Json& component : role["components"]) {
    Table properties({"property", "type", "unit", "range", "default", "meaning"});
    for (const Json& property : component["properties"]) {
      const Json& range = property["range"];
      properties.row({code(text_of(property, "name")), text_of(property, "type"), text_of(property, "unit"),
                      !property["choices"].empty() ? words(property["choices"])
                      : range.is_null()            ? ""
                                                   : fmt::format("{} to {}", number(range[0]), number(range[1])),
                      property["default"].is_null() ? "" : numbers(property["default"]), text_of(property, "help")});
    }
    out += properties.text(fmt::format("## Component `{}`\n\nOn {}: {}", text_of(component, "name"),
                                       words(component["on"]), text_of(component, "title")));
  }
  Table cases({"", "every technique is tested with"});
  for (const Json& hard_case : role["hard_cases"]) cases.row({text_of(hard_case, "id"), text_of(hard_case, "text")});
  return out + cases.text("## Hard cases");
}

bool has_port(const Json& role, const std::string& name) {
  return std::ranges::any_of(role["ports"], [&](const Json& port) { return port["name"] == name; });
}

std::string technique_text(const Json& role, const Json& technique) {
  std::string out = fmt::format("## `{}`\n\n{}. Source: {}.\n\n", text_of(technique, "id"), text_of(technique, "title"),
                                text_of(technique, "source"));
  Table parameters({"parameter", "unit", "range", "default", "ladder, cheap to accurate", "meaning"});
  for (const Json& parameter : technique["parameters"]) {
    parameters.row({code(text_of(parameter, "name")), text_of(parameter, "unit"), range_of(parameter),
                    default_of(parameter), ladder_of(parameter), text_of(parameter, "help")});
  }
  out += parameters.text("### Parameters");
  Table ports({"port", "", "type", "meaning"});
  for (const Json& port : technique["ports"]) {
    if (has_port(role, text_of(port, "name"))) continue;
    ports.row({code(text_of(port, "name")), text_of(port, "direction"), text_of(port, "type"), text_of(port, "help")});
  }
  out += ports.text("### Ports of its own");
  std::vector<std::string> stages;
  for (const Json& stage : technique["stages"]) {
    const auto latency = stage["latency"].get<std::uint32_t>();
    stages.push_back(fmt::format("{} ({}{})", text_of(stage, "name"), text_of(stage, "kind"),
                                 latency == 0 ? "" : fmt::format(", {} frames late", latency)));
  }
  std::vector<std::string> calls;
  const auto add_calls = [&calls](const Json& list) {
    for (const Json& call : list) {
      const auto name = "`" + call.get<std::string>() + "`";
      if (std::ranges::find(calls, name) == calls.end()) calls.push_back(name);
    }
  };
  for (const Json& shader : technique["shaders"]) add_calls(shader["calls"]);
  for (const Json& function : technique["functions"]) add_calls(function["calls"]);
  if (!stages.empty()) out += fmt::format("- stages: {}\n", fmt::join(stages, ", "));
  if (!calls.empty()) out += fmt::format("- asks functions of: {}\n", fmt::join(calls, ", "));
  if (!technique["features"].empty()) {
    out += fmt::format("- runs only where the scene has: {}\n", words(technique["features"]));
  }
  if (!technique["device_features"].empty()) {
    out += fmt::format("- needs of the device: {}{}\n", words(technique["device_features"]),
                       text_of(technique, "fallback").empty() ? "" : "; without: " + text_of(technique, "fallback"));
  }
  return out.ends_with("\n\n") ? out : out + "\n";
}

}  // namespace

std::string role_page(const Json& list, const Json& role) {
  const auto name = text_of(role, "name");
  std::string out = fmt::format("# {}\n\n{}. Revision {} of the contract.\n\n", name, text_of(role, "title"),
                                role["revision"].get<std::uint32_t>());
  Table techniques({"technique", "", "source"});
  std::string first, sections;
  for (const Json& technique : list["techniques"]) {
    if (technique["role"] != name) continue;
    const auto short_name = text_of(technique, "name");
    if (first.empty()) first = short_name;
    techniques.row({code(short_name),
                    text_of(technique, "title") + (technique["is_reference"].get<bool>() ? " (reference)" : ""),
                    text_of(technique, "source")});
    sections += technique_text(role, technique);
  }
  if (first.empty()) {
    out += "No technique is installed.\n\n";
  } else {
    out += fmt::format(
        "```toml\n[[pass]]\nrole = \"{}\"\ntechnique = \"{}\"   # swap: another word; \"none\" is the neutral "
        "value\n```\n\n",
        name, first);
  }
  out += techniques.text("## Techniques");
  out += reference_text(list, role) + contract(role) + sections;
  out.erase(out.find_last_not_of('\n') + 1);
  return out + "\n";
}

}  // namespace heddle::cli
