// SPDX-License-Identifier: Apache-2.0
// The words of a line -> candidates for the last: from the options of the command, from manifests, and from the graph
// that the line names. Opens no device.
#include "cli/completion.hpp"
#include "cli/session.hpp"
#include "json.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <map>
#include <optional>
#include <set>

namespace heddle::cli {

namespace {

namespace fs = std::filesystem;

bool is_scene_name(std::string_view word) {
  return word.ends_with(".gltf") || word.ends_with(".glb") || word.ends_with(".py") || word.ends_with(".scene.toml");
}

class Completer {
 public:
  Completer(const CLI::App& app, const std::vector<std::string>& words) : app_(app), words_(words) {
    current_ = words.empty() ? "" : words.back();
  }

  void run() {
    if (words_.size() < 2) {
      for (const CLI::App* command : app_.get_subcommands({})) add(command->get_name(), command->get_description());
      add_options(app_);
    } else {
      const auto commands = app_.get_subcommands({});
      const auto found = std::ranges::find(commands, words_.front(), [](const CLI::App* c) { return c->get_name(); });
      if (found != commands.end()) in_command(**found);
    }
    fmt::print("{}{}\n", files_ ? "files " : "", nospace_ ? "nospace" : "");
    for (const auto& [candidate, help] : candidates_) fmt::print("{}\t{}\n", candidate, help);
  }

 private:
  void add(const std::string& candidate, std::string_view help = {}) {
    if (!candidate.starts_with(current_)) return;
    candidates_.emplace(candidate, help.substr(0, help.find('\n')));
  }
  /// A word that goes on: an = or a dot ends it.
  void add_start(const std::string& candidate, std::string_view help = {}) {
    if (!candidate.starts_with(current_)) return;
    nospace_ = true;
    add(candidate, help);
  }

  void add_options(const CLI::App& app) {
    for (const CLI::Option* option : app.get_options())
      for (const std::string& name : option->get_lnames()) add("--" + name, option->get_description());
  }

  static const CLI::Option* option_of(const CLI::App& command, const std::string& word) {
    if (word.size() < 2 || word.front() != '-') return nullptr;
    for (const CLI::Option* option : command.get_options())
      if (!option->get_positional() && option->check_name(word)) return option;
    return nullptr;
  }

  void in_command(const CLI::App& command) {
    read_line(command);
    const std::string& before = words_[words_.size() - 2];
    if (const CLI::Option* option = words_.size() > 2 ? option_of(command, before) : nullptr;
        option != nullptr && option->get_items_expected_max() > 0) {
      value_of(option->get_lnames().front());
      return;
    }
    if (const std::size_t equals = current_.find('='); current_.starts_with("--") && equals != std::string::npos) {
      // --set=KEY=VALUE: candidates carry the option.
      const CLI::Option* option = option_of(command, current_.substr(0, equals));
      if (option == nullptr) return;
      const std::string prefix = current_.substr(0, equals + 1);
      current_.erase(0, equals + 1);
      value_of(option->get_lnames().front());
      std::map<std::string, std::string> prefixed;
      for (auto& [candidate, help] : candidates_) prefixed.emplace(prefix + candidate, std::move(help));
      candidates_ = std::move(prefixed);
      return;
    }
    if (current_.starts_with("-")) {
      add_options(command);
      return;
    }
    positional(command);
  }

  /// Which graph the line means, and its settings.
  void read_line(const CLI::App& command) {
    for (std::size_t i = 1; i + 1 < words_.size(); ++i) {
      const std::string& word = words_[i];
      if (const CLI::Option* option = option_of(command, word); option != nullptr) {
        if (option->get_items_expected_max() == 0) continue;
        if (option->check_name("--set") && i + 2 < words_.size()) settings_.push_back(words_[i + 1]);
        ++i;
      } else if (word.starts_with("--set=")) {
        settings_.push_back(word.substr(6));
      } else if (!word.starts_with("-")) {
        positionals_.push_back(word);
        const bool is_pixel = word.find_first_not_of("0123456789,") == std::string::npos;
        if (!is_scene_name(word) && !is_pixel) graph_name_ = word;
      }
    }
  }

  void positional(const CLI::App& command) {
    const std::string& name = command.get_name();
    if (name == "run" || name == "view" || name == "check" || name == "explain" || name == "inspect" ||
        name == "compare" || name == "tune") {
      for (const std::string& graph : shipped_graphs()) add(graph, "graph");
      files_ = true;
    } else if (name == "list" || (name == "new-technique" && positionals_.empty())) {
      add_roles("");
    } else if (name == "study") {
      files_ = true;
    } else if (name == "baseline") {
      for (const char* word : {"record", "check"})
        if (positionals_.empty()) add(word);
      if (!positionals_.empty()) add_roles("");
    } else if (name == "completion" || name == "schema") {
      for (const char* word : {"bash", "zsh", "fish"})
        if (name == "completion") add(word);
      for (const char* word : {"graph", "scene"})
        if (name == "schema") add(word);
    }
  }

  void value_of(const std::string& option) {
    if (option == "set" || option == "set-b" || option == "reference-set") {
      setting();
    } else if (option == "climb") {
      for (const char* word : {"together", "each"}) add(word);
    } else if (option == "why" || option == "pass") {
      for (const Json& pass : graph()["passes"]) add(pass["name"].get<std::string>(), pass_help(pass));
    } else if (option == "port") {
      add_ports("image");
    } else if (option == "output") {
      files_ = true;
      if (current_.find('=') == std::string::npos && current_.find('/') == std::string::npos)
        for (const Json& port : graph()["ports"])
          if (is_output(port)) add_start(port["name"].get<std::string>() + "=", "write this port");
    } else if (option == "swap") {
      swap();
    } else if (option == "b" || option == "graph") {
      for (const std::string& graph : shipped_graphs()) add(graph, "graph");
      files_ = true;
    } else if (option == "format") {
      for (const char* word : {"text", "json", "dot"}) add(word);
    } else if (option == "language") {
      for (const char* word : {"c", "c++"}) add(word);
    } else if (option == "bound") {
      for (const char* word : {"rmse=", "mse=", "relmse=", "psnr=", "mean_difference=", "maximum=", "percentile_99="})
        add_start(word);
    } else if (option == "scene" || option == "overlay" || option == "stats" || option == "difference" ||
               option == "folder" || option == "plugins" || option == "script") {
      files_ = true;
    }
  }

  /// What a frame or a job makes itself, and a file can hold.
  static bool is_output(const Json& port) {
    const auto type = port["type"].get<std::string>();
    const bool is_of_another_job = port["name"].get<std::string>().find('#') != std::string::npos;
    return type == "image" || ((type == "artifact" || type == "report") && !is_of_another_job);
  }

  /// PASS=A,B
  void swap() {
    const std::size_t equals = current_.find('=');
    for (const Json& pass : graph()["passes"]) {
      const auto name = pass["name"].get<std::string>();
      if (equals == std::string::npos) {
        add_start(name + "=", pass_help(pass));
        continue;
      }
      if (current_.substr(0, equals) != name) continue;
      const std::size_t comma = current_.find(',');
      const std::string begin = current_.substr(0, (comma == std::string::npos ? equals : comma) + 1);
      for (const auto& [technique, help] : techniques_of(pass["role"])) {
        if (comma == std::string::npos) {
          add_start(begin + technique + ",", help);
        } else {
          add(begin + technique, help);
        }
      }
    }
  }

  /// KEY=VALUE: the key by its parts, the value by the key.
  void setting() {
    const std::size_t equals = current_.find('=');
    if (equals == std::string::npos) {
      setting_keys();
    } else {
      setting_values(current_.substr(0, equals), current_.substr(0, equals + 1));
    }
  }

  /// Adds a key up to the dot that follows what is written.
  void add_key(const std::string& key, std::string_view help) {
    if (!key.starts_with(current_)) return;
    const std::size_t dot = key.find('.', current_.size());
    if (dot == std::string::npos) {
      add_start(key + "=", help);
    } else {
      add_start(key.substr(0, dot + 1));
    }
  }

  void setting_keys() {
    add_key("extent", "[width, height] in pixels");
    add_key("output", "what images on disk show, pass.port");
    for (const auto& [preset, value] : graph()["presets"].items())
      add_key("params." + preset, "preset, now " + write_json(value));
    for (const Json& role : list()["roles"])
      if (!role["functions"].empty()) add_key("joins." + role["name"].get<std::string>(), "switch, sum or product");
    for (const Json& pass : graph()["passes"]) {
      const auto name = pass["name"].get<std::string>();
      add_key(name + ".technique", pass_help(pass));
      add_key(name + ".enabled", "true or false");
      const Json* technique = technique_of(pass);
      if (technique == nullptr) continue;
      for (const Json& parameter : (*technique)["parameters"])
        add_key(name + ".params." + parameter["name"].get<std::string>(), parameter.value("help", ""));
      for (const auto& [port, bound] : pass["inputs"].items())
        add_key(name + ".inputs." + port, "now " + bound.get<std::string>());
    }
  }

  void setting_values(const std::string& key, const std::string& begin) {
    if (key == "output")
      for (const char* type : {"image", "artifact", "report"}) add_ports(type, begin);
    if (key.starts_with("joins."))
      for (const char* word : {"switch", "sum", "product"}) add(begin + word);
    for (const Json& pass : graph()["passes"]) {
      const auto name = pass["name"].get<std::string>();
      if (key == name + ".technique")
        for (const auto& [technique, help] : techniques_of(pass["role"])) add(begin + technique, help);
      if (key == name + ".enabled")
        for (const char* word : {"true", "false"}) add(begin + word);
      const Json* technique = technique_of(pass);
      if (technique == nullptr) continue;
      for (const Json& parameter : (*technique)["parameters"])
        if (key == name + ".params." + parameter["name"].get<std::string>()) parameter_values(parameter, begin);
      for (const Json& port : (*technique)["ports"])
        if (key == name + ".inputs." + port["name"].get<std::string>()) {
          add_ports(port["type"].get<std::string>(), begin);
          add(begin + "none", "the neutral value");
        }
    }
  }

  void parameter_values(const Json& parameter, const std::string& begin) {
    for (const Json& choice : parameter.value("choices", Json::array())) add(begin + choice.get<std::string>());
    if (parameter["type"] == "bool")
      for (const char* word : {"true", "false"}) add(begin + word);
    for (const Json& step : parameter.value("ladder", Json::array()))
      add(begin + write_json(step), "a step of its ladder");
    for (const auto& [preset, value] : graph()["presets"].items())
      add(begin + "$" + preset, "preset, now " + write_json(value));
  }

  void add_ports(const std::string& type, const std::string& begin = {}) {
    for (const Json& port : graph()["ports"])
      if (port["type"] == type && (type != "image" || !port["name"].get<std::string>().starts_with("scene.")))
        add(begin + port["name"].get<std::string>(), type);
  }

  void add_roles(const std::string& begin) {
    for (const Json& role : list()["roles"]) add(begin + role["name"].get<std::string>(), role.value("title", ""));
  }

  static std::string pass_help(const Json& pass) {
    return fmt::format("{}, now {}", pass["role"].get<std::string>(), pass["technique"].get<std::string>());
  }

  std::vector<std::pair<std::string, std::string>> techniques_of(const Json& role) {
    std::vector<std::pair<std::string, std::string>> names{{"none", "the neutral value"}};
    for (const Json& technique : list()["techniques"]) {
      if (technique["role"] != role) continue;
      const auto id = technique["id"].get<std::string>();
      names.emplace_back(id.substr(id.find('/') + 1), technique.value("title", ""));
    }
    return names;
  }

  const Json* technique_of(const Json& pass) {
    const std::string id = pass["role"].get<std::string>() + "/" + pass["technique"].get<std::string>();
    for (const Json& technique : list()["techniques"])
      if (technique["id"] == id) return &technique;
    return nullptr;
  }

  static std::vector<std::string> shipped_graphs() {
    std::vector<std::string> names;
    std::error_code error;
    const fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path().parent_path() / "lib/heddle/graphs";
    for (auto entry = fs::directory_iterator(folder, error); !error && entry != fs::directory_iterator();
         entry.increment(error))
      if (entry->path().extension() == ".toml") names.push_back(entry->path().stem().string());
    return names;
  }

  heddle_host* host() {
    if (!host_) {
      HostArguments arguments;
      arguments.quiet = true;
      host_ = make_host(arguments);
    }
    return host_.get();
  }

  const Json& list() {
    if (list_.is_null()) {
      const char* text = nullptr;
      check(host(), heddle_list(host(), &text));
      list_ = parse_json(text);
    }
    return list_;
  }

  /// The description of the graph of the line, with its settings if they are right.
  Json& graph() {
    if (!graph_.is_null()) return graph_;
    graph_ = {{"presets", Json::object()}, {"passes", Json::array()}, {"ports", Json::array()}};
    for (const bool with_settings : {true, false}) {
      std::vector<const char*> texts;
      if (with_settings)
        for (const std::string& setting : settings_) texts.push_back(setting.c_str());
      heddle_graph* made = nullptr;
      if (heddle_graph_load(host(), graph_name_.c_str(), texts.data(), static_cast<std::uint32_t>(texts.size()),
                            &made) != HEDDLE_OK)
        continue;
      const Owned<heddle_graph> graph(made);
      const char* text = nullptr;
      check(host(), heddle_graph_describe(graph.get(), &text));
      graph_ = parse_json(text);
      break;
    }
    for (Json& pass : graph_["passes"])
      if (!pass.contains("inputs")) pass["inputs"] = Json::object();
    return graph_;
  }

  const CLI::App& app_;
  const std::vector<std::string>& words_;
  std::string current_, graph_name_ = "deferred";
  std::vector<std::string> settings_, positionals_;
  std::map<std::string, std::string> candidates_;
  bool files_ = false, nospace_ = false;
  Owned<heddle_host> host_;
  Json list_, graph_;
};

}  // namespace

void complete(const CLI::App& app, const std::vector<std::string>& words) {
  Completer(app, words).run();
}

}  // namespace heddle::cli
