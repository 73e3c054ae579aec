// SPDX-License-Identifier: Apache-2.0
// A graph in all its stages -> the answers about one pass, first as JSON, then as text: both say the same.
#include "graph/why.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "graph/explain.hpp"
#include "graph/uses.hpp"
#include "graph/written.hpp"

namespace heddle::graph {
namespace {

constexpr std::string_view kLastAbove = "not bound: the last producer above";

class Answer {
 public:
  Answer(const WrittenGraph& written, const ResolvedGraph& resolved, const ResolvedGraph& graph, const Order& order,
         const Roles& roles, std::string_view name)
      : written_(written), resolved_(resolved), graph_(graph), order_(order), roles_(roles), name_(name) {}

  Json run() {
    const auto has_name = [&](const auto& pass) { return pass.name == name_; };
    const auto planned = std::ranges::find_if(graph_.passes, has_name);
    if (planned != graph_.passes.end()) {
      index_ = static_cast<PassIndex>(planned - graph_.passes.begin());
      of_a_present_pass();
      return std::move(json_);
    }
    const auto wrote = [&](const WrittenPass& pass) { return text_of(pass.name) == name_; };
    if (const auto found = std::ranges::find_if(written_.passes, wrote); found != written_.passes.end()) {
      of_a_pass_without_technique(*found);
      return std::move(json_);
    }
    for (const RemovedPass& removed : written_.removed) {
      if (!wrote(removed.pass)) continue;
      of_a_removed_pass(removed);
      return std::move(json_);
    }
    throw_unknown();
  }

 private:
  [[noreturn]] void throw_unknown() const {
    std::vector<std::string> names;
    for (const WrittenPass& pass : written_.passes) names.push_back(text_of(pass.name));
    for (const RemovedPass& removed : written_.removed) names.push_back(text_of(removed.pass.name));
    throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                             {written_.file, 0, 0},
                                             fmt::format("the graph has no pass '{}'", name_),
                                             {},
                                             "one of " + join_names(names),
                                             did_you_mean(name_, names)});
  }

  [[nodiscard]] const Pass& pass() const { return graph_.passes[index_]; }
  [[nodiscard]] const WrittenPass& written_pass() const {
    return *std::ranges::find_if(written_.passes, [&](const WrittenPass& p) { return text_of(p.name) == name_; });
  }

  void head(std::string_view role, std::string_view technique, const Location& where, bool runs, std::string_view rule,
            std::string reason) {
    json_ = {{"pass", name_}, {"role", role}, {"technique", technique},     {"written_at", place_text(where)},
             {"runs", runs},  {"rule", rule}, {"reason", std::move(reason)}};
  }

  void of_a_present_pass() {
    const Pass& p = pass();
    const bool lacks_feature = p.is_pruned && p.reason.starts_with("the scene has no");
    head(p.role->name, p.entry.technique->id, p.where, !p.is_pruned,
         !p.is_pruned    ? p.reader == kNoIndex ? "wanted" : "read"
         : lacks_feature ? "feature_missing"
                         : "not_read",
         p.reason);
    if (!p.is_pruned) add_chain();
    if (p.is_pruned && !lacks_feature && written_.output)
      json_["asked_for"] = {{"output", text_of(*written_.output)}, {"from", place_text(written_.output->where)}};
    add_outputs();
    if (!p.is_pruned) add_stages();
    add_settings();
    add_notes();
  }

  void of_a_pass_without_technique(const WrittenPass& p) {
    const bool is_enabled = !p.enabled || std::get<bool>(p.enabled->value);
    head(text_of(p.role), text_of(p.technique), p.where, false, is_enabled ? "technique_none" : "not_enabled",
         is_enabled ? "its technique is \"none\"" : "it says enabled = false");
    json_["rule_at"] = place_text(is_enabled ? p.technique.where : p.enabled->where);
    add_neutral(text_of(p.role));
  }

  void of_a_removed_pass(const RemovedPass& removed) {
    head(text_of(removed.pass.role), text_of(removed.pass.technique), removed.pass.where, false, "removed",
         "an overlay removes it");
    json_["rule_at"] = place_text(removed.where);
    add_neutral(text_of(removed.pass.role));
  }

  /// The first reader met from the output back, its first reader, and so on.
  void add_chain() {
    json_["chain"] = Json::array();
    for (PassIndex p = index_; p != kNoIndex; p = graph_.passes[p].reader)
      json_["chain"].push_back(fmt::format("'{}' {}", graph_.passes[p].name, graph_.passes[p].reason));
  }

  /// Who reads a resource: by its own accesses, by changing it, or through functions.
  [[nodiscard]] Json readers_of(ResourceIndex resource) const {
    Json readers = Json::array();
    for (PassIndex p = 0; p < graph_.passes.size(); ++p) {
      if (p == index_) continue;
      const Pass& reader = graph_.passes[p];
      const auto add = [&](std::string how) {
        Json entry{{"pass", reader.name}, {"runs", !reader.is_pruned}, {"how", std::move(how)}};
        if (reader.is_pruned) entry["reason"] = reader.reason;
        readers.push_back(std::move(entry));
      };
      bool is_told = false;
      for (const auto& [port, bound] : reader.ports)
        if (bound == resource && reader.entry.technique->find_port(port)->direction == Direction::kIn) {
          add(fmt::format("reads it as '{}'", port));
          is_told = true;
        }
      for (const auto& [port, bound] : reader.inout_sources)
        if (bound == resource) {
          add(fmt::format("changes it as '{}'", port));
          is_told = true;
        }
      if (is_told) continue;
      const auto uses = function_uses(graph_, p, all_calls(*reader.entry.technique));
      if (std::ranges::find(uses, resource, &ScheduledStage::Use::resource) != uses.end())
        add("calls a function that reads it");
    }
    return readers;
  }

  /// Passes with an input of an output's name that take something else.
  [[nodiscard]] Json others_of(const Resource& resource, ResourceIndex index) const {
    Json others = Json::array();
    for (PassIndex p = 0; p < graph_.passes.size(); ++p) {
      const Pass& other = graph_.passes[p];
      const Port* port = other.entry.technique->find_port(resource.port);
      if (p == index_ || port == nullptr || port->direction == Direction::kOut || port->type != resource.type) continue;
      const auto& bound_ports = port->direction == Direction::kIn ? other.ports : other.inout_sources;
      const auto bound = bound_ports.find(resource.port);
      if (bound != bound_ports.end() && bound->second == index) continue;
      Json entry{{"pass", other.name}, {"port", resource.port}};
      entry["takes"] = bound == bound_ports.end() ? "nothing" : graph_.resources[bound->second].name;
      entry["from"] = input_origin(other.name, resource.port);
      others.push_back(std::move(entry));
    }
    return others;
  }

  [[nodiscard]] std::string input_origin(std::string_view pass_name, std::string_view port) const {
    for (const WrittenPass& p : written_.passes) {
      if (text_of(p.name) != pass_name) continue;
      for (const auto& [key, value] : p.inputs)
        if (key.name == port) return place_text(value.where);
    }
    return std::string(kLastAbove);
  }

  void add_outputs() {
    json_["outputs"] = Json::array();
    for (ResourceIndex r = 0; r < graph_.resources.size(); ++r) {
      const Resource& resource = graph_.resources[r];
      if (resource.producer != index_) continue;
      Json entry{{"resource", resource.name}, {"is_output", r == graph_.output}, {"readers", readers_of(r)}};
      if (entry["readers"].empty()) entry["instead"] = others_of(resource, r);
      json_["outputs"].push_back(std::move(entry));
    }
    Json callers = Json::array();
    for (PassIndex p = 0; p < graph_.passes.size(); ++p)
      for (const FunctionBinding& binding : graph_.passes[p].functions)
        if (std::ranges::find(binding.providers, index_) != binding.providers.end())
          callers.push_back(
              {{"pass", graph_.passes[p].name}, {"runs", !graph_.passes[p].is_pruned}, {"role", binding.role}});
    if (!pass().entry.technique->functions.empty()) json_["callers"] = std::move(callers);
  }

  /// What passes see in place of what a missing pass would have made.
  void add_neutral(const std::string& role) {
    json_["neutral"] = Json::array();
    for (const Pass& reader : graph_.passes) {
      if (reader.is_pruned) continue;
      for (const Port& port : reader.entry.technique->ports) {
        if (port.direction != Direction::kIn || port.type != PortType::kImage || reader.ports.contains(port.name))
          continue;
        const RolePort* contract = reader.role->find_port(port.name);
        if (contract == nullptr || !makes(role, port.name)) continue;
        Json entry{{"pass", reader.name}, {"port", port.name}, {"value", Json::array()}};
        for (const double number : contract->neutral) entry["value"].push_back(fmt::format("{}", number));
        json_["neutral"].push_back(std::move(entry));
      }
      for (const FunctionBinding& binding : reader.functions)
        if (binding.role == role && binding.providers.empty())
          json_["neutral"].push_back({{"pass", reader.name}, {"function", role}});
    }
  }

  /// Whether a pass of the role makes a port of this name.
  [[nodiscard]] bool makes(const std::string& role, const std::string& port) const {
    const auto found = roles_.find(role);
    const RolePort* contract = found == roles_.end() ? nullptr : found->second.find_port(port);
    return contract != nullptr && contract->direction != Direction::kIn;
  }

  [[nodiscard]] std::string stage_name(PassIndex p, std::uint32_t stage) const {
    return graph_.passes[p].name + "." + graph_.passes[p].entry.technique->stages[stage].name;
  }

  [[nodiscard]] std::uint32_t place_of(PassIndex p, std::uint32_t stage) const {
    const auto found =
        std::ranges::find_if(order_.stages, [&](const ScheduledStage& s) { return s.pass == p && s.stage == stage; });
    return static_cast<std::uint32_t>(found - order_.stages.begin()) + 1;
  }

  void add_stages() {
    json_["stage_count"] = order_.stages.size();
    json_["stages"] = Json::array();
    const std::vector<StageDependency> dependencies = stage_dependencies(graph_);
    for (std::uint32_t s = 0; s < pass().entry.technique->stages.size(); ++s) {
      if (!is_scheduled(pass(), pass().entry.technique->stages[s])) continue;
      // By place, and for each the reasons, once.
      std::map<std::uint32_t, std::vector<std::string>> before, after;
      const auto add = [](std::vector<std::string>& reasons, const std::string& why) {
        const std::string text = why.empty() ? "stages of a pass run in their order" : why;
        if (std::ranges::find(reasons, text) == reasons.end()) reasons.push_back(text);
      };
      for (const StageDependency& d : dependencies) {
        if (d.to_pass == index_ && d.to_stage == s) add(after[place_of(d.from_pass, d.from_stage)], d.why);
        if (d.from_pass == index_ && d.from_stage == s) add(before[place_of(d.to_pass, d.to_stage)], d.why);
      }
      const auto list = [&](const std::map<std::uint32_t, std::vector<std::string>>& places) {
        Json all = Json::array();
        for (const auto& [place, reasons] : places) {
          const ScheduledStage& other = order_.stages[place - 1];
          all.push_back({{"place", place}, {"stage", stage_name(other.pass, other.stage)}, {"because", reasons}});
        }
        return all;
      };
      const std::uint32_t place = place_of(index_, s);
      Json entry{{"stage", stage_name(index_, s)}, {"place", place}, {"after", list(after)}, {"before", list(before)}};
      entry["earliest"] = after.empty() ? 1 : after.rbegin()->first + 1;
      entry["latest"] = before.empty() ? order_.stages.size() : before.begin()->first - 1;
      json_["stages"].push_back(std::move(entry));
    }
  }

  void setting(std::string name, Json value, std::string from) {
    json_["settings"].push_back({{"name", std::move(name)}, {"value", std::move(value)}, {"from", std::move(from)}});
  }

  void add_settings() {
    json_["settings"] = Json::array();
    const WrittenPass& wrote = written_pass();
    const Pass& fresh = resolved_.passes[index_];
    const Technique& technique = *fresh.entry.technique;
    setting("technique", text_of(wrote.technique), place_text(wrote.technique.where));
    if (wrote.enabled) setting("enabled", true, place_text(wrote.enabled->where));
    for (std::size_t i = 0; i < technique.parameters.size(); ++i) {
      const Parameter& parameter = technique.parameters[i];
      const ParameterOrigin& origin = fresh.origins[i];
      std::string from = "default of " + technique.id;
      if (origin.where && !origin.preset.empty()) {
        from = fmt::format("params.{} at {}, by \"${}\" at {}", origin.preset, place_text(origin.preset_where),
                           origin.preset, place_text(*origin.where));
      } else if (origin.where) {
        from = place_text(*origin.where);
      }
      setting("params." + parameter.name, to_json(parameter, fresh.parameters[i]), std::move(from));
    }
    for (const Port& port : technique.ports) {
      if (port.direction == Direction::kOut) continue;
      const auto& bound_ports = port.direction == Direction::kIn ? fresh.ports : fresh.inout_sources;
      const auto bound = bound_ports.find(port.name);
      std::string from = input_origin(name_, port.name);
      if (bound == bound_ports.end()) {
        setting("inputs." + port.name, "none", from == kLastAbove ? "not bound, and nothing above makes it" : from);
        continue;
      }
      const Resource& resource = resolved_.resources[bound->second];
      if (resource.producer == kNoIndex && from == kLastAbove) from = "not bound: the scene's";
      setting("inputs." + port.name, resource.name, std::move(from));
    }
    for (const FunctionBinding& binding : fresh.functions) {
      Json providers = Json::array();
      for (const PassIndex provider : binding.providers) providers.push_back(resolved_.passes[provider].name);
      const auto said = std::ranges::find(wrote.functions, binding.role,
                                          [](const auto& f) -> const std::string& { return f.first.name; });
      setting("functions." + binding.role, std::move(providers),
              said != wrote.functions.end() ? place_text(said->second.where) : "not bound: every provider above");
      if (binding.providers.size() < 2) continue;
      constexpr std::array<std::string_view, 3> kWords{"switch", "sum", "product"};
      const auto join = std::ranges::find(written_.joins, binding.role,
                                          [](const auto& j) -> const std::string& { return j.first.name; });
      setting("joins." + binding.role, kWords.at(static_cast<std::size_t>(binding.join)),
              join != written_.joins.end() ? place_text(join->second.where) : "the role's");
    }
    if (!wrote.serves.empty()) setting("serves", fresh.serves, place_text(wrote.serves.front().where));
  }

  void add_notes() {
    json_["notes"] = Json::array();
    for (const std::string& note : resolved_.notes)
      if (note.starts_with(fmt::format("pass '{}':", name_))) json_["notes"].push_back(note);
  }

  const WrittenGraph& written_;
  const ResolvedGraph& resolved_;
  const ResolvedGraph& graph_;
  const Order& order_;
  const Roles& roles_;
  std::string name_;
  PassIndex index_ = kNoIndex;
  Json json_;
};

std::string text_of(const Json& value) {
  return value.get<std::string>();
}

/// As TOML writes it: what a person would put into the file.
std::string value_text(const Json& value) {
  if (!value.is_array()) return write_json(value);
  std::string text;
  for (const Json& element : value) text += (text.empty() ? "" : ", ") + write_json(element);
  return "[" + text + "]";
}

std::string reader_text(const Json& reader) {
  return fmt::format("'{}' {}{}", text_of(reader["pass"]), text_of(reader["how"]),
                     reader["runs"].get<bool>() ? "" : ", but does not run: " + text_of(reader["reason"]));
}

void write_outputs(std::string& text, const Json& why) {
  std::vector<std::vector<std::string>> rows;
  for (const Json& output : why["outputs"]) {
    std::string name = text_of(output["resource"]);
    const auto add = [&](std::string line) { rows.push_back({std::exchange(name, ""), std::move(line)}); };
    if (output["is_output"].get<bool>()) add("is the graph's output");
    for (const Json& reader : output["readers"]) add(reader_text(reader));
    for (const Json& other : output.value("instead", Json::array()))
      add(fmt::format("not read: '{}' takes {} as '{}' ({})", text_of(other["pass"]),
                      other["takes"] == "nothing" ? "nothing" : "'" + text_of(other["takes"]) + "'",
                      text_of(other["port"]), text_of(other["from"])));
    if (!name.empty()) add("no other pass reads it");
  }
  for (const Json& caller : why.value("callers", Json::array()))
    rows.push_back({fmt::format("{}()", text_of(caller["role"])),
                    fmt::format("'{}' calls it{}", text_of(caller["pass"]),
                                caller["runs"].get<bool>() ? "" : ", but does not run")});
  if (why.contains("callers") && why["callers"].empty())
    rows.push_back({fmt::format("{}()", text_of(why["role"])), "nobody calls it"});
  if (!rows.empty()) text += "\nwho uses it\n" + table_text(rows);
}

void write_stages(std::string& text, const Json& why) {
  if (!why.contains("stages")) return;
  text += why["stages"].empty() ? "\nit has no stages: its functions are joined into their callers\n"
                                : "\nwhere it stands\n";
  for (const Json& stage : why["stages"]) {
    const auto earliest = stage["earliest"].get<std::uint64_t>();
    const auto latest = stage["latest"].get<std::uint64_t>();
    text += fmt::format(
        "  {:>3} of {}  {}{}\n", stage["place"].get<std::uint64_t>(), why["stage_count"].get<std::uint64_t>(),
        text_of(stage["stage"]),
        earliest < latest
            ? fmt::format("   free from {} to {}: cpu stages without images first, then the order of the file",
                          earliest, latest)
            : "");
    for (const char* side : {"after", "before"})
      for (const Json& other : stage[side]) {
        std::string reasons;
        for (const Json& reason : other["because"]) reasons += (reasons.empty() ? "" : "; ") + text_of(reason);
        text += fmt::format("        {:<6} {:>3} {}: {}\n", side, other["place"].get<std::uint64_t>(),
                            text_of(other["stage"]), reasons);
      }
  }
}

}  // namespace

Json why(const WrittenGraph& written, const ResolvedGraph& resolved, const ResolvedGraph& graph, const Order& order,
         const Roles& roles, std::string_view pass) {
  return Answer(written, resolved, graph, order, roles, pass).run();
}

std::string to_text(const Json& why) {
  const bool runs = why["runs"].get<bool>();
  std::string text =
      fmt::format("pass '{}' ({}/{}) {}: {}{}\n  written at {}\n", text_of(why["pass"]), text_of(why["role"]),
                  text_of(why["technique"]).substr(text_of(why["technique"]).find('/') + 1),
                  runs ? "runs" : "does not run", text_of(why["reason"]),
                  why.contains("rule_at") ? ", at " + text_of(why["rule_at"]) : "", text_of(why["written_at"]));
  if (why.contains("asked_for"))
    text += fmt::format("  the graph's output is '{}', written at {}\n", text_of(why["asked_for"]["output"]),
                        text_of(why["asked_for"]["from"]));
  if (why.contains("chain")) {
    text += "\nwhy it runs, down to what is asked for\n";
    for (const Json& step : why["chain"]) text += fmt::format("  {}\n", text_of(step));
  }
  if (why.contains("outputs")) write_outputs(text, why);
  if (why.contains("neutral")) {
    text += why["neutral"].empty() ? "\nnobody misses it\n" : "\nwhat passes see in its place\n";
    for (const Json& missing : why["neutral"]) {
      std::string value = "the neutral answer of its functions";
      if (missing.contains("port")) {
        std::string numbers;
        for (const Json& number : missing["value"]) numbers += (numbers.empty() ? "" : ", ") + text_of(number);
        value = fmt::format("'{}' is the neutral value ({})", text_of(missing["port"]), numbers);
      }
      text += fmt::format("  '{}': {}\n", text_of(missing["pass"]), value);
    }
  }
  write_stages(text, why);
  if (why.contains("settings")) {
    std::vector<std::vector<std::string>> rows;
    for (const Json& setting : why["settings"])
      rows.push_back({text_of(setting["name"]), value_text(setting["value"]), text_of(setting["from"])});
    text += "\nsettings, and where each comes from\n" + table_text(rows);
  }
  for (const Json& note : why.value("notes", Json::array())) text += fmt::format("  note: {}\n", text_of(note));
  return text;
}

}  // namespace heddle::graph
