// SPDX-License-Identifier: Apache-2.0
// role.toml -> Role. Every key is known or an error with its place and the nearest right name; all errors of a file are
// reported at once. The one file of this folder that knows TOML.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <toml++/toml.h>

#include "diagnostics.hpp"
#include "plugin/rules.hpp"
#include "plugin/technique.hpp"
#include "plugin/toml_json.hpp"

namespace heddle {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::string kind_of(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::table:
      return "a table";
    case toml::node_type::array:
      return "an array";
    case toml::node_type::string:
      return fmt::format("the string \"{}\"", node.as_string()->get());
    case toml::node_type::integer:
      return fmt::format("the integer {}", node.as_integer()->get());
    case toml::node_type::floating_point:
      return fmt::format("the number {}", node.as_floating_point()->get());
    case toml::node_type::boolean:
      return node.as_boolean()->get() ? "true" : "false";
    default:
      return "a date or time";
  }
}

std::string quoted(std::initializer_list<std::string_view> names) {
  std::string text;
  for (const std::string_view name : names) text += fmt::format("{}\"{}\"", text.empty() ? "" : ", ", name);
  return text;
}

class RoleReader {
 public:
  explicit RoleReader(const std::filesystem::path& file) { role_.file = file; }

  Role read() {
    toml::table document;
    try {
      document = toml::parse(text_of_file(), role_.file.string());
    } catch (const toml::parse_error& error) {
      complain(error.source(), std::string(error.description()));
      finish();
    }
    read_document(document);
    check_document(document);
    finish();
    return std::move(role_);
  }

 private:
  using Keys = std::initializer_list<std::string_view>;

  std::string text_of_file() const {
    std::ifstream stream(role_.file, std::ios::binary);
    std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    if (!stream.is_open() || stream.bad()) {
      Diagnostic diagnostic;
      diagnostic.where.file = role_.file.string();
      diagnostic.message = "cannot read this file";
      throw Error(HEDDLE_BAD_INPUT, std::move(diagnostic));
    }
    return text;
  }

  void finish() {
    if (!problems_.empty()) throw Error(HEDDLE_BAD_INPUT, std::move(problems_));
  }

  void complain(const toml::source_region& where, std::string message, std::string found = {},
                std::string expected = {}, std::string help = {}) {
    Diagnostic diagnostic;
    diagnostic.where = {role_.file.string(), static_cast<std::uint32_t>(where.begin.line),
                        static_cast<std::uint32_t>(where.begin.column)};
    diagnostic.message = std::move(message);
    diagnostic.found = std::move(found);
    diagnostic.expected = std::move(expected);
    diagnostic.help = std::move(help);
    problems_.push_back(std::move(diagnostic));
  }

  // `what` names the table in messages: "role", "port 'depth'".
  void check_keys(const toml::table& table, std::string_view what, Keys keys) {
    const std::vector<std::string> names(keys.begin(), keys.end());
    for (const auto& [key, value] : table) {
      if (std::find(names.begin(), names.end(), key.str()) != names.end()) continue;
      const std::string nearest = nearest_name(key.str(), names);
      complain(key.source(), fmt::format("{} has no key '{}'", what, key.str()), {}, "one of " + join_names(names),
               nearest.empty() ? std::string() : fmt::format("did you mean '{}'?", nearest));
    }
  }

  void check_type(const toml::node& node, std::string_view what, std::string_view key, bool is_right,
                  std::string_view expected) {
    if (!is_right) {
      complain(node.source(), fmt::format("{}: '{}' has the wrong type", what, key), kind_of(node),
               std::string(expected));
    }
  }

  std::string read_string(const toml::table& table, std::string_view what, std::string_view key, bool is_needed) {
    const toml::node* node = table.get(key);
    if (node == nullptr) {
      if (is_needed) complain(table.source(), fmt::format("{} has no '{}'", what, key), {}, "a string");
      return {};
    }
    check_type(*node, what, key, node->is_string(), "a string");
    return node->is_string() ? node->as_string()->get() : std::string();
  }

  bool read_bool(const toml::table& table, std::string_view what, std::string_view key) {
    const toml::node* node = table.get(key);
    if (node == nullptr) return false;
    check_type(*node, what, key, node->is_boolean(), "true or false");
    return node->is_boolean() && node->as_boolean()->get();
  }

  // Which of `words` a key holds; `missing` without the key.
  std::size_t read_word(const toml::table& table, std::string_view what, std::string_view key, Keys words,
                        std::optional<std::size_t> missing) {
    const toml::node* node = table.get(key);
    if (node == nullptr && missing) return *missing;
    const std::string text = read_string(table, what, key, true);
    if (node == nullptr || !node->is_string()) return 0;
    const auto* const found = std::find(words.begin(), words.end(), text);
    if (found != words.end()) return static_cast<std::size_t>(found - words.begin());
    const std::string nearest = nearest_name(text, std::vector<std::string>(words.begin(), words.end()));
    complain(node->source(), fmt::format("{}: unknown {}", what, key), fmt::format("\"{}\"", text),
             "one of " + quoted(words), nearest.empty() ? std::string() : fmt::format("did you mean \"{}\"?", nearest));
    return 0;
  }

  // Numbers, with "inf" and "-inf" for what JSON and people write as words.
  template <std::size_t kCount>
  std::optional<std::array<double, kCount>> read_numbers(const toml::table& table, std::string_view what,
                                                         std::string_view key) {
    const toml::node* node = table.get(key);
    if (node == nullptr) return std::nullopt;
    const std::string expected = fmt::format("{} numbers; infinity is written \"inf\" or \"-inf\"", kCount);
    const toml::array* array = node->as_array();
    if (array == nullptr || array->size() != kCount) {
      complain(node->source(), fmt::format("{}: '{}' has the wrong type", what, key),
               array == nullptr ? kind_of(*node) : fmt::format("{} elements", array->size()), expected);
      return std::nullopt;
    }
    std::array<double, kCount> numbers{};
    for (std::size_t i = 0; i < kCount; ++i) {
      const toml::node& element = *array->get(i);
      if (element.is_number()) numbers[i] = *element.value<double>();
      const bool is_inf = element.is_string() && element.as_string()->get() == "inf";
      const bool is_minus_inf = element.is_string() && element.as_string()->get() == "-inf";
      if (is_inf || is_minus_inf) numbers[i] = is_inf ? kInfinity : -kInfinity;
      if ((!element.is_number() && !is_inf && !is_minus_inf) || std::isnan(numbers[i])) {
        complain(element.source(), fmt::format("{}: '{}' has a wrong element", what, key), kind_of(element), expected);
        return std::nullopt;
      }
    }
    return numbers;
  }

  std::optional<std::array<double, 2>> read_range(const toml::table& table, std::string_view what) {
    const auto range = read_numbers<2>(table, what, "range");
    if (range && (*range)[0] >= (*range)[1]) {
      complain(table.get("range")->source(), fmt::format("{}: 'range' is empty", what),
               fmt::format("[{}, {}]", (*range)[0], (*range)[1]), "the smaller number first");
    }
    return range;
  }

  // The tables of an array of tables [[key]].
  std::vector<const toml::table*> read_tables(const toml::table& document, std::string_view key) {
    const toml::node* node = document.get(key);
    if (node == nullptr) return {};
    if (!node->is_array_of_tables()) {
      complain(node->source(), fmt::format("role: '{}' has the wrong type", key), kind_of(*node),
               fmt::format("one [[{}]] for each", key));
      return {};
    }
    std::vector<const toml::table*> tables;
    for (const toml::node& element : *node->as_array()) tables.push_back(element.as_table());
    return tables;
  }

  // A name or id in a [[...]], unique in its kind; fails the whole file if missing.
  std::string read_name(const toml::table& table, std::string_view kind, std::string_view key,
                        std::set<std::string>& taken) {
    std::string name = read_string(table, kind, key, true);
    const toml::node* node = table.get(key);
    if (name.empty() || node == nullptr) return name;
    if (!is_identifier(name)) {
      complain(node->source(), fmt::format("{}: '{}' is no name", kind, key), fmt::format("\"{}\"", name),
               "letters, digits and single underscores, no digit first");
    }
    if (!taken.insert(name).second) {
      complain(node->source(), fmt::format("a second {} with the {} '{}'", kind, key, name));
    }
    return name;
  }

  void read_port(const toml::table& table) {
    RolePort port;
    port.name = read_name(table, "port", "name", port_names_);
    const std::string what = fmt::format("port '{}'", port.name);
    check_keys(
        table, what,
        {"name", "direction", "type", "optional", "infinite", "unit", "range", "neutral", "glsl", "list", "help"});
    port.direction = static_cast<Direction>(read_word(table, what, "direction", {"in", "out", "inout"}, std::nullopt));
    port.type = static_cast<PortType>(
        read_word(table, what, "type", {"image", "buffer", "value", "surfaces", "artifact", "report"}, std::nullopt));
    port.optional = read_bool(table, what, "optional");
    port.infinite = read_bool(table, what, "infinite");
    port.unit = read_string(table, what, "unit", false);
    port.range = read_range(table, what);
    port.neutral = read_numbers<4>(table, what, "neutral").value_or(port.neutral);
    port.glsl = read_string(table, what, "glsl", false);
    port.is_list = read_bool(table, what, "list");
    port.help = read_string(table, what, "help", true);
    const bool has_members = port.type == PortType::kBuffer || port.type == PortType::kValue;
    if (has_members && port.glsl.empty()) {
      complain(table.source(), what + " has no 'glsl'", {}, "the members of the block as shaders see them");
    } else if (!has_members && !port.glsl.empty()) {
      complain(table.get("glsl")->source(), what + ": 'glsl' belongs to buffers and values");
    }
    if (port.is_list && port.type != PortType::kBuffer) {
      complain(table.get("list")->source(), what + ": 'list' belongs to buffers");
    }
    role_.ports.push_back(std::move(port));
  }

  void read_function(const toml::table& table) {
    RoleFunction function;
    function.name = read_name(table, "function", "name", function_names_);
    const std::string what = fmt::format("function '{}'", function.name);
    check_keys(table, what, {"name", "signature", "neutral", "unit", "range", "help"});
    function.signature = read_string(table, what, "signature", true);
    function.neutral = read_string(table, what, "neutral", true);
    function.unit = read_string(table, what, "unit", false);
    function.range = read_range(table, what);
    function.help = read_string(table, what, "help", true);
    const bool names_itself = function.signature.find(" " + function.name + "(") != std::string::npos;
    if (!function.signature.empty() && (!names_itself || function.signature.back() != ')')) {
      complain(table.get("signature")->source(), what + ": 'signature' declares something else",
               fmt::format("\"{}\"", function.signature), fmt::format("\"TYPE {}(TYPE NAME, ...)\"", function.name));
    }
    role_.functions.push_back(std::move(function));
  }

  void read_hard_case(const toml::table& table) {
    HardCase hard_case;
    hard_case.id = read_name(table, "hard_case", "id", hard_case_ids_);
    const std::string what = fmt::format("hard_case '{}'", hard_case.id);
    check_keys(table, what, {"id", "text"});
    hard_case.text = read_string(table, what, "text", true);
    role_.hard_cases.push_back(std::move(hard_case));
  }

  void read_component(const toml::table& table) {
    ComponentType component;
    component.name = read_string(table, "component", "name", true);
    const std::string what = fmt::format("component '{}'", component.name);
    check_keys(table, what, {"name", "on", "title", "property"});
    if (!component.name.empty() && !is_component_name(component.name)) {
      complain(table.get("name")->source(), "component: 'name' is no name of a component",
               fmt::format("\"{}\"", component.name), "two names with a dot between, \"cloud.layer\"");
    }
    if (!component.name.empty() && !component_names_.insert(component.name).second) {
      complain(table.get("name")->source(), fmt::format("a second component with the name '{}'", component.name));
    }
    component.title = read_string(table, what, "title", true);
    read_owners(table, what, component);
    std::set<std::string> taken;
    for (const toml::table* property : read_tables(table, "property")) {
      component.properties.push_back(read_property(*property, what, taken));
    }
    if (component.properties.size() > kMostProperties) {
      complain(table.source(), what + " has too many properties", fmt::format("{}", component.properties.size()),
               fmt::format("at most {}", kMostProperties), "make two components of it");
    }
    role_.components.push_back(std::move(component));
  }

  void read_owners(const toml::table& table, std::string_view what, ComponentType& component) {
    const toml::node* node = table.get("on");
    const toml::array* list = node == nullptr ? nullptr : node->as_array();
    const std::string expected =
        fmt::format("a list of some of {}", quoted({"scene", "instance", "material", "light"}));
    if (list == nullptr || list->empty()) {
      complain(node == nullptr ? table.source() : node->source(), fmt::format("{}: 'on' says nothing to sit on", what),
               node == nullptr ? "nothing" : kind_of(*node), expected);
      return;
    }
    for (const toml::node& element : *list) {
      const std::string word = element.is_string() ? element.as_string()->get() : std::string();
      const auto* const found = std::find(kOwnerWords.begin(), kOwnerWords.end(), word);
      if (found == kOwnerWords.end()) {
        complain(element.source(), fmt::format("{}: 'on' has a wrong element", what), kind_of(element), expected);
        continue;
      }
      const auto owner = static_cast<Owner>(found - kOwnerWords.begin());
      if (!component.sits_on(owner)) component.on.push_back(owner);
    }
  }

  ComponentProperty read_property(const toml::table& table, std::string_view component, std::set<std::string>& taken) {
    ComponentProperty property;
    property.name = read_name(table, fmt::format("property of {}", component), "name", taken);
    const std::string what = fmt::format("{}: property '{}'", component, property.name);
    check_keys(table, what, {"name", "type", "unit", "range", "default", "choices", "help"});
    if (property.name == "is_present" || property.name == "written" || property.name == "absent") {
      complain(table.get("name")->source(), what + " has a name that shaders know something else by");
    }
    property.type = static_cast<PropertyType>(
        read_word(table, what, "type", {"float", "int", "bool", "choice", "color", "float3"}, std::nullopt));
    property.unit = read_string(table, what, "unit", false);
    property.range = read_range(table, what);
    property.help = read_string(table, what, "help", true);
    const bool is_choice = property.type == PropertyType::kChoice;
    if (const toml::node* choices = table.get("choices"); choices != nullptr || is_choice) {
      const toml::array* list = choices == nullptr ? nullptr : choices->as_array();
      if (is_choice && list != nullptr && !list->empty() && list->is_homogeneous(toml::node_type::string)) {
        for (const toml::node& word : *list) property.choices.push_back(word.as_string()->get());
      } else {
        complain(choices == nullptr ? table.source() : choices->source(), what + ": 'choices' is wrong",
                 choices == nullptr ? "nothing" : kind_of(*choices),
                 is_choice ? "a list of words" : "no choices: its type is another");
      }
    }
    read_default(table, what, property);
    return property;
  }

  // The default obeys what it is the default of: it is read as a scene's own would be.
  void read_default(const toml::table& table, std::string_view what, ComponentProperty& property) {
    const toml::node* node = table.get("default");
    if (node == nullptr) return;
    ComponentType alone;
    alone.name = "role.default";
    alone.on = {Owner::kScene};
    alone.properties = {property};
    ComponentCatalog catalog;
    catalog.add(alone);
    const Location where{role_.file.string(), static_cast<std::uint32_t>(node->source().begin.line),
                         static_cast<std::uint32_t>(node->source().begin.column)};
    GivenComponent given{alone.name, where, std::string(what), {}};
    given.properties.push_back({property.name, json_of(*node), where, fmt::format("{}: its default", what)});
    const auto values = heddle::read_component(&catalog, given, alone.on, problems_);
    if (!values) return;
    std::copy(values->values.begin(), values->values.end(), property.default_value.begin());
    property.has_default = true;
  }

  const toml::table* read_table(const toml::table& table, std::string_view what, std::string_view key) {
    const toml::node* node = table.get(key);
    if (node != nullptr) check_type(*node, what, key, node->is_table(), "a table");
    return node == nullptr ? nullptr : node->as_table();
  }

  std::string read_reference(const toml::table& table, std::string_view key) {
    std::string id = read_string(table, "references", key, false);
    if (!id.empty() && !is_technique_id(id)) {
      complain(table.get(key)->source(), fmt::format("references: '{}' names no technique", key),
               fmt::format("\"{}\"", id), "\"ROLE/TECHNIQUE\"");
    }
    return id;
  }

  std::map<std::string, std::string> read_parameters(const toml::table& table, std::string_view key) {
    std::map<std::string, std::string> parameters;
    const toml::table* values = read_table(table, "references", key);
    if (values == nullptr) return parameters;
    for (const auto& [name, value] : *values) {
      std::string text;
      if (value.is_string()) text = value.as_string()->get();
      if (value.is_integer()) text = fmt::format("{}", value.as_integer()->get());
      if (value.is_floating_point()) text = fmt::format("{}", value.as_floating_point()->get());
      if (value.is_boolean()) text = value.as_boolean()->get() ? "true" : "false";
      if (text.empty()) {
        complain(value.source(), fmt::format("references: '{}.{}' has the wrong type", key, name.str()), kind_of(value),
                 "a string, a number, true or false");
      }
      parameters.emplace(name.str(), std::move(text));
    }
    return parameters;
  }

  void read_document(const toml::table& document) {
    check_keys(document, "role",
               {"role", "revision", "title", "join", "selector", "include", "references", "measure", "port", "function",
                "hard_case", "component"});
    role_.name = read_string(document, "role", "role", true);
    role_.title = read_string(document, "role", "title", true);
    role_.join = static_cast<Join>(read_word(document, "role", "join", {"switch", "sum", "product"}, 0));
    role_.selector = read_string(document, "role", "selector", false);
    role_.include = read_string(document, "role", "include", false);
    const toml::node* revision = document.get("revision");
    if (revision == nullptr || !revision->is_integer() || revision->as_integer()->get() < 1 ||
        revision->as_integer()->get() > 0xffff) {
      complain(revision == nullptr ? document.source() : revision->source(), "role: 'revision' is no revision",
               revision == nullptr ? "nothing" : kind_of(*revision), "an integer from 1");
    } else {
      role_.revision = static_cast<std::uint32_t>(revision->as_integer()->get());
    }
    for (const toml::table* table : read_tables(document, "port")) read_port(*table);
    for (const toml::table* table : read_tables(document, "function")) read_function(*table);
    for (const toml::table* table : read_tables(document, "hard_case")) read_hard_case(*table);
    for (const toml::table* table : read_tables(document, "component")) read_component(*table);
    if (const toml::table* references = read_table(document, "role", "references")) {
      check_keys(
          *references, "references",
          {"same_model", "same_model_params", "physical", "physical_params", "physical_port", "physical_shared"});
      role_.same_model_reference = read_reference(*references, "same_model");
      role_.physical_reference = read_reference(*references, "physical");
      role_.same_model_params = read_parameters(*references, "same_model_params");
      role_.physical_params = read_parameters(*references, "physical_params");
      role_.physical_port = read_string(*references, "references", "physical_port", false);
      role_.physical_shared = read_parameters(*references, "physical_shared");
      for (const char* key : {"physical_params", "physical_port", "physical_shared"}) {
        if (const toml::node* node = references->get(key); node != nullptr && role_.physical_reference.empty()) {
          complain(node->source(), fmt::format("references: '{}' without 'physical'", key), {},
                   "physical = \"ROLE/TECHNIQUE\"");
        }
      }
    }
    if (const toml::table* measure = read_table(document, "role", "measure")) {
      check_keys(*measure, "measure", {"kind", "port", "function", "metric", "note"});
      role_.measure_kind = read_string(*measure, "measure", "kind", true);
      role_.measure_port = read_string(*measure, "measure", "port", false);
      role_.measure_function = read_string(*measure, "measure", "function", false);
      role_.measure_metric = read_string(*measure, "measure", "metric", false);
      role_.measure_note = read_string(*measure, "measure", "note", false);
    }
  }

  // What two keys say together.
  void check_document(const toml::table& document) {
    const std::string folder = std::filesystem::absolute(role_.file).parent_path().filename().string();
    if (!role_.name.empty() && role_.name != folder) {
      complain(document.get("role")->source(), "role: the name differs from the folder's",
               fmt::format("\"{}\"", role_.name), fmt::format("\"{}\"", folder));
    }
    if (role_.ports.empty() && role_.functions.empty() && problems_.empty()) {
      complain(document.source(), "role has neither a port nor a function", {},
               "at least one [[port]] or [[function]]");
    }
    if (!role_.measure_port.empty() && port_names_.count(role_.measure_port) == 0) {
      complain(document["measure"]["port"].node()->source(), "measure: no such port",
               fmt::format("\"{}\"", role_.measure_port),
               "one of " + join_names(std::vector<std::string>(port_names_.begin(), port_names_.end())));
    }
    if (!role_.measure_function.empty() && function_names_.count(role_.measure_function) == 0) {
      complain(document["measure"]["function"].node()->source(), "measure: no such function",
               fmt::format("\"{}\"", role_.measure_function),
               "one of " + join_names(std::vector<std::string>(function_names_.begin(), function_names_.end())));
    }
  }

  Role role_;
  std::vector<Diagnostic> problems_;
  std::set<std::string> port_names_;
  std::set<std::string> function_names_;
  std::set<std::string> hard_case_ids_;
  std::set<std::string> component_names_;
};

}  // namespace

const RolePort* Role::find_port(std::string_view port) const {
  const auto found = std::find_if(ports.begin(), ports.end(), [&](const RolePort& p) { return p.name == port; });
  return found == ports.end() ? nullptr : &*found;
}

Role read_role(const std::filesystem::path& file) {
  return RoleReader(file).read();
}

}  // namespace heddle
