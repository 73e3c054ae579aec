// SPDX-License-Identifier: Apache-2.0
// Roles and techniques as the host knows them: owned copies of role.toml files and of descriptors. Made from a manifest
// without opening the library, and from the library's own descriptor to check that both agree.
#pragma once

#include "plugin/component.hpp"

#include <heddle/plugin.h>

#include <array>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace heddle {

enum class PortType : std::uint32_t { kImage, kBuffer, kValue, kSurfaces, kArtifact, kReport };  // = HEDDLE_PORT_*
enum class Direction : std::uint32_t { kIn, kOut, kInout };                                      // = HEDDLE_IN ...
enum class StageKind : std::uint32_t { kGpu, kCpu };                                             // = HEDDLE_STAGE_*
enum class ShaderKind : std::uint32_t { kCompute, kFullscreen, kSurfaces };                      // = HEDDLE_SHADER_*
enum class ParameterType : std::uint32_t { kFloat, kInt, kBool, kChoice, kColor, kFloat3, kNames, kText };
enum class Join : std::uint8_t { kSwitch, kSum, kProduct };

// ---- from role.toml ----

struct RolePort {
  std::string name;
  Direction direction = Direction::kIn;
  PortType type = PortType::kImage;
  bool optional = false;
  bool infinite = false;  // Inf is legal
  std::string unit;
  std::optional<std::array<double, 2>> range;
  std::array<double, 4> neutral{0, 0, 0, 0};
  std::string glsl;      // buffer, value: members of the block
  bool is_list = false;  // buffer: HEDDLE_PORT_LIST
  std::string help;
  bool operator==(const RolePort&) const = default;
};

struct RoleFunction {
  std::string name;
  std::string signature;  // "float shadow(uint light, vec3 position_rel, vec3 normal)"
  std::string neutral;    // body: "return 1.0;"
  std::string unit;
  std::string help;
  std::optional<std::array<double, 2>> range;
  bool operator==(const RoleFunction&) const = default;
};

struct HardCase {
  std::string id;
  std::string text;
  bool operator==(const HardCase&) const = default;
};

struct Role {
  std::string name;
  std::uint32_t revision = 1;
  std::string title;
  Join join = Join::kSwitch;
  std::string selector;  // kSwitch: name of the uint argument that chooses ("light"); "" = the only provider
  std::string include;   // file of plugins/shared that signatures need; may be empty
  std::vector<RolePort> ports;
  std::vector<RoleFunction> functions;
  std::vector<HardCase> hard_cases;
  std::string same_model_reference;  // technique id, may be empty
  std::string physical_reference;
  std::string measure_metric;  // "rmse", ...; may be empty
  std::string measure_port;
  std::filesystem::path file;  // the role.toml
  std::string measure_kind;    // "image", "function_image", "decoded"
  std::string measure_function;
  std::string measure_note;
  std::map<std::string, std::string> same_model_params;  // parameters of the reference, as --set takes them
  std::map<std::string, std::string> physical_params;
  std::string physical_port;                           // of the reference, what measure_port is of a technique
  std::map<std::string, std::string> physical_shared;  // its parameter -> the measured pass's that it must equal
  std::vector<ComponentType> components;

  [[nodiscard]] const RolePort* find_port(std::string_view port) const;
  bool operator==(const Role&) const = default;
};

// ---- from a descriptor ----

struct Port {
  std::string name;
  PortType type = PortType::kImage;
  Direction direction = Direction::kIn;
  std::uint32_t flags = 0;   // HEDDLE_PORT_OPTIONAL ...
  std::uint32_t format = 0;  // VkFormat
  std::uint32_t extent_rule = 0;
  float extent_scale = 1.0F;
  std::uint32_t width = 0, height = 0;
  std::uint32_t layers = 1, mips = 1;
  std::uint64_t byte_size = 0;
  std::string glsl;  // filled from the role or the component when the descriptor has none
  std::string help;
  std::string previous_of;  // an output of the same technique
  std::string types;        // GLSL that `glsl` needs before it; of components, never in a descriptor
  std::uint32_t capacity = 0, element_bytes = 0;       // lists
  std::string vertices, indices, instances, commands;  // made surfaces: buffers of the same technique
  [[nodiscard]] bool is_optional() const { return (flags & HEDDLE_PORT_OPTIONAL) != 0; }
  [[nodiscard]] bool is_kept() const { return (flags & HEDDLE_PORT_KEPT) != 0; }
  [[nodiscard]] bool is_list() const { return (flags & HEDDLE_PORT_LIST) != 0; }
  bool operator==(const Port&) const = default;
};

struct Parameter {
  std::string name;
  ParameterType type = ParameterType::kFloat;
  std::uint32_t flags = 0;  // HEDDLE_PARAMETER_*
  std::string unit;
  double minimum = 0, maximum = 0;
  std::array<double, 3> default_value{0, 0, 0};
  std::vector<std::string> choices;
  std::vector<double> ladder;
  std::string help;
  [[nodiscard]] bool is_knob() const { return (flags & HEDDLE_PARAMETER_KNOB) != 0; }
  [[nodiscard]] std::uint32_t components() const {
    return type == ParameterType::kColor || type == ParameterType::kFloat3 ? 3U
           : type == ParameterType::kNames || type == ParameterType::kText ? 0U
                                                                           : 1U;
  }
  bool operator==(const Parameter&) const = default;
};

struct Access {
  std::string port;
  std::uint32_t access = 0;  // HEDDLE_ACCESS_*
  std::uint32_t load = 0;    // HEDDLE_LOAD_*
  std::array<float, 4> clear{0, 0, 0, 0};
  std::uint32_t blend = 0;  // HEDDLE_BLEND_*
  bool operator==(const Access&) const = default;
};

/// "parameter=choice".
struct Condition {
  std::string parameter, choice;
  bool operator==(const Condition&) const = default;
};

struct Stage {
  std::string name;
  StageKind kind = StageKind::kGpu;
  std::vector<Access> accesses;
  std::uint32_t latency = 0;                          // frames; cpu stages
  std::uint32_t loop_part = 0;                        // HEDDLE_LOOP_*
  std::optional<std::vector<std::string>> cached_by;  // parameters; cpu stages whose outputs are kept on disk
  std::optional<Condition> only_if;                   // else it is not scheduled
  /// True for an access that reads what the GPU made some frames ago.
  [[nodiscard]] bool is_late(const Access& access, PortType type) const {
    return latency > 0 && access.access == HEDDLE_ACCESS_HOST_READ &&
           (type == PortType::kImage || type == PortType::kBuffer);
  }
  bool operator==(const Stage&) const = default;
};

struct Shader {
  std::string name;
  ShaderKind kind = ShaderKind::kCompute;
  std::string stage;
  std::string file;                // "" : depth only
  std::vector<std::string> calls;  // roles
  std::uint32_t depth_compare = 0;
  float depth_bias_constant = 0, depth_bias_slope = 0;
  bool operator==(const Shader&) const = default;
};

struct Function {
  std::string role;
  std::string file;
  std::vector<Access> accesses;
  std::vector<std::string> calls;
  bool has_service = false;
  bool operator==(const Function&) const = default;
};

/// What a technique that repeats other passes gives them and takes from them, by ports.
struct Loop {
  struct Override {
    std::string input, output;
    bool operator==(const Override&) const = default;
  };
  std::vector<Override> overrides;
  std::vector<std::string> gathers;
  bool operator==(const Loop&) const = default;
};

/// The role whose functions are a technique's own surface program: vertex stages ask them where vertices are.
inline constexpr std::string_view kProgramRole = "surface_program";

struct Technique {
  std::string id;  // "ambient_occlusion/gtao"
  std::string title;
  std::string source;
  bool is_reference = false;
  std::uint32_t role_revision = 1;
  std::vector<Port> ports;
  std::vector<Parameter> parameters;
  std::vector<Stage> stages;
  std::vector<Shader> shaders;
  std::vector<Function> functions;
  std::vector<std::string> features;
  std::vector<std::string> device_features;
  std::string fallback;
  std::optional<Loop> loop;
  std::vector<std::string> components;  // that it reads

  [[nodiscard]] std::string_view role_name() const { return std::string_view(id).substr(0, id.find('/')); }
  [[nodiscard]] std::string_view name() const { return std::string_view(id).substr(id.find('/') + 1); }
  [[nodiscard]] const Port* find_port(std::string_view port) const;
  [[nodiscard]] const Parameter* find_parameter(std::string_view parameter) const;
  [[nodiscard]] const Stage* find_stage(std::string_view stage) const;
  [[nodiscard]] const Shader* find_shader(std::string_view shader) const;
  [[nodiscard]] const Function* find_function(std::string_view role) const;
  bool operator==(const Technique&) const = default;
};

/// "accumulation=blend" in its two parts; without '=' the choice is empty.
inline Condition condition_of(std::string_view text) {
  const std::size_t equals = std::min(text.find('='), text.size());
  return {std::string(text.substr(0, equals)), std::string(text.substr(std::min(equals + 1, text.size())))};
}

/// What a job leaves behind: bytes that outlast the process.
inline bool lasts(PortType type) {
  return type == PortType::kArtifact || type == PortType::kReport;
}
/// True for a technique that runs in jobs alone.
inline bool makes_what_lasts(const Technique& technique) {
  for (const Port& port : technique.ports)
    if (lasts(port.type) && port.direction == Direction::kOut) return true;
  return false;
}

/// Copies a descriptor; throws Error(HEDDLE_BUG) naming the library if it breaks a rule of plugin.h (a NULL name, an
/// unknown type, a stage's access to a port that does not exist, a shader of an unknown stage, ...).
Technique from_descriptor(const heddle_technique& descriptor, std::string_view library);

/// The same for all techniques of a library, and checks that it speaks this host's ABI (HEDDLE_UNSUPPORTED if not).
std::vector<Technique> from_plugin(const heddle_plugin* plugin, std::string_view library);

/// What a component's declaration adds to the value port that shaders see it through.
void complete_component_port(Port& port, const ComponentType& type);

/// A library that was found, by its manifest.
struct Manifest {
  std::filesystem::path library;  // the .so
  std::filesystem::path folder;   // where its shaders are: <plugins>/<role>/<technique>/
  std::uint32_t abi_major = 0, abi_minor = 0;
  std::vector<Technique> techniques;
};
std::string to_json(const Manifest& manifest);
/// Throws Error(HEDDLE_BAD_INPUT) with the file's place.
Manifest manifest_from_json(std::string_view json, const std::filesystem::path& file);
/// Reads a role.toml; throws Error with places.
Role read_role(const std::filesystem::path& file);

}  // namespace heddle
