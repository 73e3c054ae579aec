// SPDX-License-Identifier: Apache-2.0
// Manifest <-> JSON: <technique>.manifest.json beside each library. Reading gives back exactly what was written; every
// key is needed and none is unknown, because a manifest is made by the build, never by hand.
#include <algorithm>
#include <array>
#include <limits>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "plugin/rules.hpp"
#include "plugin/technique_json.hpp"

namespace heddle {
namespace {

// Of the JSON; raised when a key is added, renamed or dropped.
constexpr std::uint32_t kFormat = 4;

// Words of the enumerations, in the order of their values in plugin.h.
constexpr std::array<std::string_view, 6> kPortTypes{"image", "buffer", "value", "surfaces", "artifact", "report"};
constexpr std::array<std::string_view, 3> kDirections{"in", "out", "inout"};
constexpr std::array<std::string_view, 5> kPortFlags{"optional", "kept", "cube", "rewritten", "list"};
constexpr std::array<std::string_view, 2> kExtentRules{"frame", "absolute"};
constexpr std::array<std::string_view, 8> kParameterTypes{"float", "int",    "bool",  "choice",
                                                          "color", "float3", "names", "text"};
constexpr std::array<std::string_view, 3> kParameterFlags{"knob", "redeclare", "constant"};
constexpr std::array<std::string_view, 2> kStageKinds{"gpu", "cpu"};
constexpr std::array<std::string_view, 17> kAccesses{
    "sampled",   "sampled_linear", "storage_read",  "storage_write",  "storage_read_write",
    "color",     "depth",          "depth_read",    "value",          "draw",
    "host_read", "host_write",     "transfer_read", "transfer_write", "sampled_compare",
    "append",    "batches"};
constexpr std::array<std::string_view, 3> kLoopParts{"outside", "before", "after"};
constexpr std::array<std::string_view, 4> kLoads{"keep", "clear", "dont_care", "clear_new"};
constexpr std::array<std::string_view, 6> kBlends{"none", "over", "add", "multiply", "tint", "constant"};
constexpr std::array<std::string_view, 3> kShaderKinds{"compute", "fullscreen", "surfaces"};

template <typename Value, std::size_t kCount>
Json word_to_json(Value value, const std::array<std::string_view, kCount>& words) {
  return words.at(static_cast<std::size_t>(value));
}

template <std::size_t kCount>
Json flags_to_json(std::uint32_t flags, const std::array<std::string_view, kCount>& words) {
  Json list = Json::array();
  for (std::size_t i = 0; i < kCount; ++i) {
    if ((flags & (1U << i)) != 0) list.push_back(words[i]);
  }
  return list;
}

template <typename Range>
Json numbers_to_json(const Range& numbers) {
  Json list = Json::array();
  for (const auto number : numbers) list.push_back(number_to_json(number));
  return list;
}

Json port_to_json(const Port& port) {
  return {{"name", port.name},
          {"type", word_to_json(port.type, kPortTypes)},
          {"direction", word_to_json(port.direction, kDirections)},
          {"flags", flags_to_json(port.flags, kPortFlags)},
          {"format", port.format},
          {"extent_rule", word_to_json(port.extent_rule, kExtentRules)},
          {"extent_scale", number_to_json(port.extent_scale)},
          {"width", port.width},
          {"height", port.height},
          {"layers", port.layers},
          {"mips", port.mips},
          {"byte_size", port.byte_size},
          {"glsl", port.glsl},
          {"help", port.help},
          {"previous_of", port.previous_of},
          {"capacity", port.capacity},
          {"element_bytes", port.element_bytes},
          {"vertices", port.vertices},
          {"indices", port.indices},
          {"instances", port.instances},
          {"commands", port.commands}};
}

Json parameter_to_json(const Parameter& parameter) {
  return {{"name", parameter.name},
          {"type", word_to_json(parameter.type, kParameterTypes)},
          {"flags", flags_to_json(parameter.flags, kParameterFlags)},
          {"unit", parameter.unit},
          {"minimum", number_to_json(parameter.minimum)},
          {"maximum", number_to_json(parameter.maximum)},
          {"default", numbers_to_json(parameter.default_value)},
          {"choices", parameter.choices},
          {"ladder", numbers_to_json(parameter.ladder)},
          {"help", parameter.help}};
}

Json accesses_to_json(const std::vector<Access>& accesses) {
  Json list = Json::array();
  for (const Access& access : accesses) {
    list.push_back({{"port", access.port},
                    {"access", word_to_json(access.access, kAccesses)},
                    {"load", word_to_json(access.load, kLoads)},
                    {"clear", numbers_to_json(access.clear)},
                    {"blend", word_to_json(access.blend, kBlends)}});
  }
  return list;
}

Json stage_to_json(const Stage& stage) {
  return {{"name", stage.name},
          {"kind", word_to_json(stage.kind, kStageKinds)},
          {"accesses", accesses_to_json(stage.accesses)},
          {"latency", stage.latency},
          {"loop_part", word_to_json(stage.loop_part, kLoopParts)},
          {"cached_by", stage.cached_by ? Json(*stage.cached_by) : Json()},
          {"only_if", stage.only_if ? Json(stage.only_if->parameter + "=" + stage.only_if->choice) : Json()}};
}

Json shader_to_json(const Shader& shader) {
  return {{"name", shader.name},
          {"kind", word_to_json(shader.kind, kShaderKinds)},
          {"stage", shader.stage},
          {"file", shader.file},
          {"calls", shader.calls},
          {"depth_compare", shader.depth_compare},
          {"depth_bias_constant", number_to_json(shader.depth_bias_constant)},
          {"depth_bias_slope", number_to_json(shader.depth_bias_slope)}};
}

Json function_to_json(const Function& function) {
  return {{"role", function.role},
          {"file", function.file},
          {"accesses", accesses_to_json(function.accesses)},
          {"calls", function.calls},
          {"has_service", function.has_service}};
}

Json loop_to_json(const std::optional<Loop>& loop) {
  if (!loop) return {};
  Json overrides = Json::array();
  for (const Loop::Override& one : loop->overrides) overrides.push_back({{"input", one.input}, {"output", one.output}});
  return {{"overrides", overrides}, {"gathers", loop->gathers}};
}

template <typename T, typename ToJson>
Json list_to_json(const std::vector<T>& things, ToJson to_json_of_one) {
  Json list = Json::array();
  for (const T& thing : things) list.push_back(to_json_of_one(thing));
  return list;
}

/// A JSON value with its path, for messages. Every reading function throws Error naming file and path.
class Node {
 public:
  Node(const Json& value, std::string path, const std::string& file)
      : value_(&value), path_(std::move(path)), file_(&file) {}

  [[noreturn]] void fail(std::string_view message, std::string expected) const {
    Diagnostic diagnostic;
    diagnostic.where.file = *file_;
    diagnostic.message = fmt::format("manifest: {} {}", path_.empty() ? "the document" : path_, message);
    diagnostic.found = value_->dump().substr(0, kLongestQuote);
    diagnostic.expected = std::move(expected);
    diagnostic.help = kHelp;
    throw Error(HEDDLE_BAD_INPUT, std::move(diagnostic));
  }

  [[nodiscard]] Node at(const char* key) const {
    if (!value_->is_object()) fail("has the wrong type", "an object");
    const auto found = value_->find(key);
    if (found == value_->end()) fail(fmt::format("has no '{}'", key), "every key that the build writes");
    return {*found, path_ + "/" + key, *file_};
  }
  [[nodiscard]] bool is_null() const { return value_->is_null(); }
  void only(std::initializer_list<std::string_view> keys) const {
    if (!value_->is_object()) fail("has the wrong type", "an object");
    for (const auto& [key, value] : value_->items()) {
      if (std::find(keys.begin(), keys.end(), key) == keys.end()) {
        fail(fmt::format("has an unknown key '{}'", key), "only keys that the build writes");
      }
    }
  }
  void read(std::string& out) const {
    if (!value_->is_string()) fail("has the wrong type", "a string");
    out = value_->get<std::string>();
  }
  void read(bool& out) const {
    if (!value_->is_boolean()) fail("has the wrong type", "true or false");
    out = value_->get<bool>();
  }
  void read(std::uint64_t& out) const {
    if (!value_->is_number_unsigned()) fail("has the wrong type", "an integer from 0");
    out = value_->get<std::uint64_t>();
  }
  void read(std::uint32_t& out) const {
    std::uint64_t wide = 0;
    read(wide);
    if (wide > std::numeric_limits<std::uint32_t>::max()) fail("is too large", "an integer of 32 bits");
    out = static_cast<std::uint32_t>(wide);
  }
  void read(double& out) const {
    const bool is_inf = *value_ == "inf";
    if (is_inf || *value_ == "-inf") {
      out = is_inf ? std::numeric_limits<double>::infinity() : -std::numeric_limits<double>::infinity();
    } else if (value_->is_number()) {
      out = value_->get<double>();
    } else {
      fail("has the wrong type", "a number, \"inf\" or \"-inf\"");
    }
  }
  void read(float& out) const {
    double wide = 0;
    read(wide);
    out = static_cast<float>(wide);
  }
  template <typename T>
  void read(std::vector<T>& out) const {
    for (const Node& element : elements()) element.read(out.emplace_back());
  }
  template <typename T, std::size_t kCount>
  void read(std::array<T, kCount>& out) const {
    const std::vector<Node> list = elements();
    if (list.size() != kCount) fail("has the wrong length", fmt::format("{} elements", kCount));
    for (std::size_t i = 0; i < kCount; ++i) list[i].read(out[i]);
  }
  template <typename Value, std::size_t kCount>
  void read_word(Value& out, const std::array<std::string_view, kCount>& words) const {
    std::string word;
    read(word);
    const auto found = std::find(words.begin(), words.end(), word);
    if (found == words.end()) fail("is an unknown word", fmt::format("one of {}", fmt::join(words, ", ")));
    out = static_cast<Value>(found - words.begin());
  }
  template <std::size_t kCount>
  void read_flags(std::uint32_t& out, const std::array<std::string_view, kCount>& words) const {
    for (const Node& element : elements()) {
      std::uint32_t bit = 0;
      element.read_word(bit, words);
      out |= 1U << bit;
    }
  }
  [[nodiscard]] std::vector<Node> elements() const {
    if (!value_->is_array()) fail("has the wrong type", "a list");
    std::vector<Node> list;
    for (std::size_t i = 0; i < value_->size(); ++i) {
      list.emplace_back((*value_)[i], fmt::format("{}/{}", path_, i), *file_);
    }
    return list;
  }

  static constexpr std::string_view kHelp = "manifests are written by heddle-manifest: build the plugin again";

 private:
  static constexpr std::size_t kLongestQuote = 60;
  const Json* value_;
  std::string path_;
  const std::string* file_;
};

Port read_port(const Node& node) {
  node.only({"name",        "type",     "direction",     "flags",    "format",    "extent_rule", "extent_scale",
             "width",       "height",   "layers",        "mips",     "byte_size", "glsl",        "help",
             "previous_of", "capacity", "element_bytes", "vertices", "indices",   "instances",   "commands"});
  Port port;
  node.at("name").read(port.name);
  node.at("type").read_word(port.type, kPortTypes);
  node.at("direction").read_word(port.direction, kDirections);
  node.at("flags").read_flags(port.flags, kPortFlags);
  node.at("format").read(port.format);
  node.at("extent_rule").read_word(port.extent_rule, kExtentRules);
  node.at("extent_scale").read(port.extent_scale);
  node.at("width").read(port.width);
  node.at("height").read(port.height);
  node.at("layers").read(port.layers);
  node.at("mips").read(port.mips);
  node.at("byte_size").read(port.byte_size);
  node.at("glsl").read(port.glsl);
  node.at("help").read(port.help);
  node.at("previous_of").read(port.previous_of);
  node.at("capacity").read(port.capacity);
  node.at("element_bytes").read(port.element_bytes);
  node.at("vertices").read(port.vertices);
  node.at("indices").read(port.indices);
  node.at("instances").read(port.instances);
  node.at("commands").read(port.commands);
  return port;
}

Parameter read_parameter(const Node& node) {
  node.only({"name", "type", "flags", "unit", "minimum", "maximum", "default", "choices", "ladder", "help"});
  Parameter parameter;
  node.at("name").read(parameter.name);
  node.at("type").read_word(parameter.type, kParameterTypes);
  node.at("flags").read_flags(parameter.flags, kParameterFlags);
  node.at("unit").read(parameter.unit);
  node.at("minimum").read(parameter.minimum);
  node.at("maximum").read(parameter.maximum);
  node.at("default").read(parameter.default_value);
  node.at("choices").read(parameter.choices);
  node.at("ladder").read(parameter.ladder);
  node.at("help").read(parameter.help);
  return parameter;
}

std::vector<Access> read_accesses(const Node& node) {
  std::vector<Access> accesses;
  for (const Node& element : node.elements()) {
    element.only({"port", "access", "load", "clear", "blend"});
    Access& access = accesses.emplace_back();
    element.at("port").read(access.port);
    element.at("access").read_word(access.access, kAccesses);
    element.at("load").read_word(access.load, kLoads);
    element.at("clear").read(access.clear);
    element.at("blend").read_word(access.blend, kBlends);
  }
  return accesses;
}

Stage read_stage(const Node& node) {
  node.only({"name", "kind", "accesses", "latency", "loop_part", "cached_by", "only_if"});
  Stage stage;
  node.at("name").read(stage.name);
  node.at("kind").read_word(stage.kind, kStageKinds);
  stage.accesses = read_accesses(node.at("accesses"));
  node.at("latency").read(stage.latency);
  node.at("loop_part").read_word(stage.loop_part, kLoopParts);
  if (const Node cached_by = node.at("cached_by"); !cached_by.is_null()) cached_by.read(stage.cached_by.emplace());
  if (const Node only_if = node.at("only_if"); !only_if.is_null()) {
    std::string text;
    only_if.read(text);
    stage.only_if = condition_of(text);
  }
  return stage;
}

Shader read_shader(const Node& node) {
  node.only({"name", "kind", "stage", "file", "calls", "depth_compare", "depth_bias_constant", "depth_bias_slope"});
  Shader shader;
  node.at("name").read(shader.name);
  node.at("kind").read_word(shader.kind, kShaderKinds);
  node.at("stage").read(shader.stage);
  node.at("file").read(shader.file);
  node.at("calls").read(shader.calls);
  node.at("depth_compare").read(shader.depth_compare);
  node.at("depth_bias_constant").read(shader.depth_bias_constant);
  node.at("depth_bias_slope").read(shader.depth_bias_slope);
  return shader;
}

Function read_function(const Node& node) {
  node.only({"role", "file", "accesses", "calls", "has_service"});
  Function function;
  node.at("role").read(function.role);
  node.at("file").read(function.file);
  function.accesses = read_accesses(node.at("accesses"));
  node.at("calls").read(function.calls);
  node.at("has_service").read(function.has_service);
  return function;
}

std::optional<Loop> read_loop(const Node& node) {
  if (node.is_null()) return std::nullopt;
  node.only({"overrides", "gathers"});
  Loop loop;
  for (const Node& element : node.at("overrides").elements()) {
    element.only({"input", "output"});
    Loop::Override& one = loop.overrides.emplace_back();
    element.at("input").read(one.input);
    element.at("output").read(one.output);
  }
  node.at("gathers").read(loop.gathers);
  return loop;
}

Technique read_technique(const Node& node) {
  node.only({"id", "title", "source", "is_reference", "role_revision", "ports", "parameters", "stages", "shaders",
             "functions", "features", "device_features", "fallback", "loop", "components"});
  Technique technique;
  node.at("id").read(technique.id);
  node.at("title").read(technique.title);
  node.at("source").read(technique.source);
  node.at("is_reference").read(technique.is_reference);
  node.at("role_revision").read(technique.role_revision);
  for (const Node& port : node.at("ports").elements()) technique.ports.push_back(read_port(port));
  for (const Node& parameter : node.at("parameters").elements()) {
    technique.parameters.push_back(read_parameter(parameter));
  }
  for (const Node& stage : node.at("stages").elements()) technique.stages.push_back(read_stage(stage));
  for (const Node& shader : node.at("shaders").elements()) technique.shaders.push_back(read_shader(shader));
  for (const Node& function : node.at("functions").elements()) technique.functions.push_back(read_function(function));
  node.at("features").read(technique.features);
  node.at("device_features").read(technique.device_features);
  node.at("fallback").read(technique.fallback);
  technique.loop = read_loop(node.at("loop"));
  node.at("components").read(technique.components);
  return technique;
}

Json parse_text(std::string_view text, const std::string& file) {
  try {
    return parse_json(text);
  } catch (const Json::parse_error& error) {
    // `byte` counts from 1 and is the last byte read.
    const std::string_view read = text.substr(0, std::min(error.byte == 0 ? 0 : error.byte - 1, text.size()));
    const std::size_t line_start = read.rfind('\n') == std::string_view::npos ? 0 : read.rfind('\n') + 1;
    Diagnostic diagnostic;
    diagnostic.where = {file, static_cast<std::uint32_t>(1 + std::count(read.begin(), read.end(), '\n')),
                        static_cast<std::uint32_t>(1 + read.size() - line_start)};
    diagnostic.message = "manifest: this is no JSON";
    diagnostic.help = Node::kHelp;
    throw Error(HEDDLE_BAD_INPUT, std::move(diagnostic));
  }
}

}  // namespace

Json number_to_json(double number) {
  if (number == std::numeric_limits<double>::infinity()) return "inf";
  if (number == -std::numeric_limits<double>::infinity()) return "-inf";
  return number;
}

std::string_view to_word(PortType type) {
  return kPortTypes.at(static_cast<std::size_t>(type));
}
std::string_view to_word(Direction direction) {
  return kDirections.at(static_cast<std::size_t>(direction));
}

Json technique_to_json(const Technique& technique) {
  return {{"id", technique.id},
          {"title", technique.title},
          {"source", technique.source},
          {"is_reference", technique.is_reference},
          {"role_revision", technique.role_revision},
          {"ports", list_to_json(technique.ports, port_to_json)},
          {"parameters", list_to_json(technique.parameters, parameter_to_json)},
          {"stages", list_to_json(technique.stages, stage_to_json)},
          {"shaders", list_to_json(technique.shaders, shader_to_json)},
          {"functions", list_to_json(technique.functions, function_to_json)},
          {"features", technique.features},
          {"device_features", technique.device_features},
          {"fallback", technique.fallback},
          {"loop", loop_to_json(technique.loop)},
          {"components", technique.components}};
}

std::string to_json(const Manifest& manifest) {
  const Json document = {{"format", kFormat},
                         {"abi", {manifest.abi_major, manifest.abi_minor}},
                         {"library", manifest.library.filename().string()},
                         {"techniques", list_to_json(manifest.techniques, technique_to_json)}};
  return write_json(document, 1) + "\n";
}

Manifest manifest_from_json(std::string_view json, const std::filesystem::path& file) {
  const std::string name = file.string();
  const Json document = parse_text(json, name);
  const Node root(document, "", name);
  std::uint32_t format = 0;
  root.at("format").read(format);
  if (format != kFormat) root.at("format").fail("is another format", fmt::format("{}", kFormat));
  root.only({"format", "abi", "library", "techniques"});

  Manifest manifest;
  manifest.folder = file.parent_path();
  std::array<std::uint32_t, 2> abi{};
  root.at("abi").read(abi);
  manifest.abi_major = abi[0];
  manifest.abi_minor = abi[1];
  std::string library;
  root.at("library").read(library);
  if (library.empty() || library.find('/') != std::string::npos) {
    root.at("library").fail("is no file name", "the name of the library beside this manifest");
  }
  manifest.library = manifest.folder / library;
  std::vector<Diagnostic> broken;
  for (const Node& node : root.at("techniques").elements()) {
    manifest.techniques.push_back(read_technique(node));
    const auto more = broken_rules(manifest.techniques.back(), {name, 0, 0});
    broken.insert(broken.end(), more.begin(), more.end());
  }
  if (!broken.empty()) throw Error(HEDDLE_BAD_INPUT, std::move(broken));
  return manifest;
}

}  // namespace heddle
