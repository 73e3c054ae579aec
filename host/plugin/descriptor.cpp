// SPDX-License-Identifier: Apache-2.0
// A descriptor in a library's memory -> an owned Technique. Structures of older and newer minor versions are read as
// far as both sides know them: never past struct_size, arrays by the stride of who filled them.
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <set>
#include <type_traits>
#include <utility>

#include <fmt/format.h>

#include "plugin/rules.hpp"

namespace heddle {
namespace {

/// The bytes of a structure up to the end of a field: the least that a reader needs of it.
#define HEDDLE_BYTES_TO(type, field) (offsetof(type, field) + sizeof(type::field))

bool is_utf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    const std::size_t length = lead < 0x80                   ? 1
                               : lead >= 0xc2 && lead < 0xe0 ? 2
                               : lead >= 0xe0 && lead < 0xf0 ? 3
                               : lead >= 0xf0 && lead < 0xf5 ? 4
                                                             : 0;
    if (length == 0 || i + length > text.size()) return false;
    for (std::size_t k = 1; k < length; ++k) {
      if ((static_cast<unsigned char>(text[i + k]) & 0xc0U) != 0x80U) return false;
    }
    const auto second = length > 2 ? static_cast<unsigned char>(text[i + 1]) : 0U;
    const bool is_overlong = (lead == 0xe0 && second < 0xa0) || (lead == 0xf0 && second < 0x90);
    const bool is_outside = (lead == 0xed && second > 0x9f) || (lead == 0xf4 && second > 0x8f);
    if (is_overlong || is_outside) return false;
    i += length;
  }
  return true;
}

class DescriptorReader {
 public:
  explicit DescriptorReader(std::string_view library) { where_.file = library; }

  Technique read(const heddle_technique& borrowed) {
    const auto source = copy(&borrowed, "heddle_technique", HEDDLE_BYTES_TO(heddle_technique, functions));
    finish();  // nothing can be said of a structure that is too small
    Technique technique;
    what_ = "technique";
    technique.id = text(source.id, "id");
    what_ = fmt::format("technique '{}'", technique.id);
    technique.title = text(source.title, "title");
    technique.source = optional_text(source.source, "source");
    if ((source.flags & ~HEDDLE_TECHNIQUE_REFERENCE) != 0) {
      complain("unknown flags", fmt::format("{:#x}", source.flags));
    }
    technique.is_reference = (source.flags & HEDDLE_TECHNIQUE_REFERENCE) != 0;
    technique.role_revision = source.role_revision;
    const bool may_declare = source.declare != nullptr;
    each(source.ports, source.port_count, "ports", HEDDLE_BYTES_TO(heddle_port, direction),
         [&](const heddle_port& port) { technique.ports.push_back(read_port(port, may_declare)); });
    each(source.parameters, source.parameter_count, "parameters", HEDDLE_BYTES_TO(heddle_parameter, default_value),
         [&](const heddle_parameter& parameter) { technique.parameters.push_back(read_parameter(parameter)); });
    each(source.stages, source.stage_count, "stages", HEDDLE_BYTES_TO(heddle_stage, accesses),
         [&](const heddle_stage& stage) { technique.stages.push_back(read_stage(stage)); });
    each(source.shaders, source.shader_count, "shaders", HEDDLE_BYTES_TO(heddle_shader, file),
         [&](const heddle_shader& shader) { technique.shaders.push_back(read_shader(shader)); });
    each(source.functions, source.function_count, "functions", HEDDLE_BYTES_TO(heddle_function, file),
         [&](const heddle_function& function) { technique.functions.push_back(read_function(function)); });
    technique.features = split_words(optional_text(source.features, "features"));
    technique.device_features = split_words(optional_text(source.device_features, "device_features"));
    technique.fallback = optional_text(source.fallback, "fallback");
    if (source.loop != nullptr) technique.loop = read_loop(*source.loop, source.iterations != nullptr);
    technique.components = split_words(optional_text(source.components, "components"));
    if ((source.save_state == nullptr) != (source.load_state == nullptr)) {
      complain("save_state and load_state go together", source.save_state != nullptr ? "save_state" : "load_state",
               "both, or neither");
    }
    finish();
    problems_ = broken_rules(technique, where_);
    finish();
    return technique;
  }

  void complain(std::string_view message, std::string found = {}, std::string expected = {}) {
    Diagnostic diagnostic;
    diagnostic.where = where_;
    diagnostic.message = what_.empty() ? std::string(message) : fmt::format("{}: {}", what_, message);
    diagnostic.found = std::move(found);
    diagnostic.expected = std::move(expected);
    problems_.push_back(std::move(diagnostic));
  }

  void finish() {
    if (!problems_.empty()) throw Error(HEDDLE_BUG, std::move(problems_));
  }

  /// As much of a structure as its owner and this host both know; the rest is zero.
  template <typename T>
  T copy(const T* source, std::string_view kind, std::size_t least) {
    static_assert(std::is_trivially_copyable_v<T>);
    T result{};
    if (source->struct_size < least) {
      complain(fmt::format("{}: struct_size is too small", kind), fmt::format("{}", source->struct_size),
               fmt::format("{} bytes or more", least));
      return result;
    }
    std::memcpy(&result, source, std::min<std::size_t>(source->struct_size, sizeof(T)));
    return result;
  }

 private:
  /// Calls `read` with each structure of an array.
  template <typename T, typename Read>
  void each(const T* array, std::uint32_t count, std::string_view field, std::size_t least, Read read) {
    if (count == 0) return;
    if (array == nullptr) {
      complain(fmt::format("{} is NULL", field), fmt::format("{} of them", count));
      return;
    }
    const std::uint32_t stride = array->struct_size;
    const std::string outer = what_;
    for (std::uint32_t i = 0; i < count; ++i) {
      const auto* element =
          reinterpret_cast<const T*>(reinterpret_cast<const std::byte*>(array) + std::size_t{i} * stride);
      const std::string kind = fmt::format("{}[{}]", field, i);
      if (element->struct_size != stride) {
        complain(fmt::format("{}: struct_size differs from the first's", kind), fmt::format("{}", element->struct_size),
                 fmt::format("{}", stride));
        return;  // where the next one is, is unknown
      }
      const std::size_t before = problems_.size();
      const T source = copy(element, kind, least);
      if (problems_.size() != before) return;
      what_ = fmt::format("{}: {}", outer, kind);
      read(source);
      what_ = outer;
    }
  }

  std::string text(const char* source, std::string_view field) {
    if (source == nullptr) {
      complain(fmt::format("{} is NULL", field), {}, "a string");
      return {};
    }
    return optional_text(source, field);
  }

  std::string optional_text(const char* source, std::string_view field) {
    if (source == nullptr) return {};
    if (!is_utf8(source)) {
      complain(fmt::format("{} is not UTF-8", field));
      return {};
    }
    return source;
  }

  Port read_port(const heddle_port& source, bool may_declare) {
    Port port;
    port.name = text(source.name, "name");
    port.type = static_cast<PortType>(source.type);
    port.direction = static_cast<Direction>(source.direction);
    port.flags = source.flags;
    port.format = source.format;
    port.extent_rule = source.extent_rule;
    port.extent_scale = source.extent_scale == 0 ? 1.0F : source.extent_scale;
    port.width = source.width;
    port.height = source.height;
    port.layers = source.layers == 0 ? 1 : source.layers;
    port.mips = source.mips == 0 ? 1 : source.mips;
    port.byte_size = source.byte_size;
    port.glsl = optional_text(source.glsl, "glsl");
    port.help = optional_text(source.help, "help");
    port.previous_of = optional_text(source.previous_of, "previous_of");
    port.capacity = source.capacity;
    port.element_bytes = source.element_bytes;
    port.vertices = optional_text(source.vertices, "vertices");
    port.indices = optional_text(source.indices, "indices");
    port.instances = optional_text(source.instances, "instances");
    port.commands = optional_text(source.commands, "commands");
    // A size that follows from parameters or inputs is set in declare; otherwise it stands here.
    if (port.direction == Direction::kOut && !may_declare) {
      const bool is_block = port.type == PortType::kBuffer || port.type == PortType::kValue;
      if (port.type == PortType::kImage && port.format == 0) {
        complain("an image output without format", "0", "a VkFormat, or a declare that sets it");
      }
      if (is_block && !port.is_list() && port.byte_size == 0) {
        complain("an output without byte_size", "0", "the capacity in bytes, or a declare that sets it");
      }
    }
    return port;
  }

  Parameter read_parameter(const heddle_parameter& source) {
    Parameter parameter;
    parameter.name = text(source.name, "name");
    parameter.type = static_cast<ParameterType>(source.type);
    parameter.flags = source.flags;
    parameter.unit = optional_text(source.unit, "unit");
    parameter.minimum = source.minimum;
    parameter.maximum = source.maximum;
    for (std::uint32_t i = 0; i < parameter.components(); ++i) parameter.default_value[i] = source.default_value[i];
    for (const char* const* choice = source.choices; choice != nullptr && *choice != nullptr; ++choice) {
      parameter.choices.push_back(text(*choice, "choices"));
    }
    if (source.ladder_count != 0 && source.ladder == nullptr) {
      complain("ladder is NULL", fmt::format("{} of them", source.ladder_count));
    } else {
      parameter.ladder.assign(source.ladder, source.ladder + source.ladder_count);
    }
    parameter.help = optional_text(source.help, "help");
    return parameter;
  }

  std::vector<Access> read_accesses(const heddle_access* array, std::uint32_t count) {
    std::vector<Access> accesses;
    each(array, count, "accesses", HEDDLE_BYTES_TO(heddle_access, access), [&](const heddle_access& source) {
      Access access;
      access.port = text(source.port, "port");
      access.access = source.access;
      access.load = source.load;
      for (std::size_t i = 0; i < access.clear.size(); ++i) access.clear[i] = source.clear[i];
      access.blend = source.blend;
      accesses.push_back(std::move(access));
    });
    return accesses;
  }

  Stage read_stage(const heddle_stage& source) {
    Stage stage;
    stage.name = text(source.name, "name");
    stage.kind = static_cast<StageKind>(source.kind);
    stage.accesses = read_accesses(source.accesses, source.access_count);
    stage.latency = source.latency;
    stage.loop_part = source.loop_part;
    if (source.cached_by != nullptr) stage.cached_by = split_words(optional_text(source.cached_by, "cached_by"));
    if (source.only_if != nullptr) stage.only_if = condition_of(optional_text(source.only_if, "only_if"));
    return stage;
  }

  Shader read_shader(const heddle_shader& source) {
    Shader shader;
    shader.name = text(source.name, "name");
    shader.kind = static_cast<ShaderKind>(source.kind);
    shader.stage = text(source.stage, "stage");
    shader.file = optional_text(source.file, "file");
    shader.calls = split_words(optional_text(source.calls, "calls"));
    shader.depth_compare = source.depth_compare;
    shader.depth_bias_constant = source.depth_bias_constant;
    shader.depth_bias_slope = source.depth_bias_slope;
    return shader;
  }

  Function read_function(const heddle_function& source) {
    Function function;
    function.role = text(source.role, "role");
    function.file = text(source.file, "file");
    function.accesses = read_accesses(source.accesses, source.access_count);
    function.calls = split_words(optional_text(source.calls, "calls"));
    function.has_service = source.service != nullptr;
    return function;
  }

  Loop read_loop(const heddle_loop& given, bool has_iterations) {
    const heddle_loop source = copy(&given, "loop", HEDDLE_BYTES_TO(heddle_loop, gathers));
    Loop loop;
    each(source.overrides, source.override_count, "overrides", HEDDLE_BYTES_TO(heddle_override, output),
         [&](const heddle_override& one) {
           loop.overrides.push_back({text(one.input, "input"), text(one.output, "output")});
         });
    loop.gathers = split_words(optional_text(source.gathers, "gathers"));
    if (!has_iterations) complain("a loop without the function iterations");
    return loop;
  }

  Location where_;
  std::string what_;  // the structure that is read, for messages
  std::vector<Diagnostic> problems_;
};

}  // namespace

Technique from_descriptor(const heddle_technique& descriptor, std::string_view library) {
  return DescriptorReader(library).read(descriptor);
}

std::vector<Technique> from_plugin(const heddle_plugin* plugin, std::string_view library) {
  DescriptorReader reader(library);
  if (plugin == nullptr) {
    reader.complain("heddle_entry answered NULL", {}, "a heddle_plugin");
    reader.finish();
  }
  const auto source = reader.copy(plugin, "heddle_plugin", HEDDLE_BYTES_TO(heddle_plugin, abi_minor));
  reader.finish();
  // The rest means something only if both sides speak of the same structures.
  if (source.abi_major != HEDDLE_ABI_MAJOR || source.abi_minor != HEDDLE_ABI_MINOR) {
    Diagnostic diagnostic;
    diagnostic.where.file = library;
    diagnostic.message = "this plugin was built for another version of Heddle's interface";
    diagnostic.found = fmt::format("ABI {}.{}", source.abi_major, source.abi_minor);
    diagnostic.expected = fmt::format("ABI {}.{}", HEDDLE_ABI_MAJOR, HEDDLE_ABI_MINOR);
    diagnostic.help = "build the plugin again with this version's headers";
    throw Error(HEDDLE_UNSUPPORTED, std::move(diagnostic));
  }
  if (source.technique_count == 0 || source.techniques == nullptr) {
    reader.complain("heddle_plugin has no techniques");
    reader.finish();
  }
  std::vector<Technique> techniques;
  std::set<std::string> ids;
  for (std::uint32_t i = 0; i < source.technique_count; ++i) {
    if (source.techniques[i] == nullptr) {
      reader.complain(fmt::format("techniques[{}] is NULL", i));
      reader.finish();
    }
    techniques.push_back(from_descriptor(*source.techniques[i], library));
    if (!ids.insert(techniques.back().id).second) {
      reader.complain(fmt::format("two techniques have the id '{}'", techniques.back().id));
    }
  }
  reader.finish();
  return techniques;
}

}  // namespace heddle
