// SPDX-License-Identifier: Apache-2.0
// Ports and parameters of a pass -> the GLSL that declares them: bindings, blocks, accessors, constants. The table of
// api/SHADERS.md is what is written here.
#include "vulkan/shader_source.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace heddle::vulkan {
namespace {

using shader::glsl_name;

bool is_constant(const Parameter& parameter) {
  return (parameter.flags & HEDDLE_PARAMETER_CONSTANT) != 0 && parameter.components() == 1;
}

const char* glsl_type(ParameterType type) {
  switch (type) {
    case ParameterType::kFloat:
      return "float";
    case ParameterType::kInt:
      return "int";
    case ParameterType::kBool:
    case ParameterType::kChoice:
      return "uint";
    case ParameterType::kColor:
    case ParameterType::kFloat3:
      return "vec3";
    case ParameterType::kNames:
    case ParameterType::kText:
      break;
  }
  return "";
}

}  // namespace

ParameterLayout parameter_layout(const Technique& technique) {
  // std140: scalars on 4 bytes; a vec3 on 16, but a scalar may follow in its fourth component.
  ParameterLayout layout;
  std::uint32_t at = 0;
  for (const Parameter& parameter : technique.parameters) {
    if (parameter.components() == 0 || is_constant(parameter)) {
      layout.offset.push_back(0xffffffffU);
      continue;
    }
    const std::uint32_t alignment = parameter.components() == 3 ? 16 : 4;
    at = (at + alignment - 1) / alignment * alignment;
    layout.offset.push_back(at);
    at += 4 * parameter.components();
  }
  layout.size = (at + 15) / 16 * 16;
  return layout;
}

namespace shader {
namespace {

// Scalar kind of a format as GLSL's prefix of vec4, sampler2D and image2D.
std::string_view prefix_of(VkFormat format) {
  const std::string_view name = format_info(format).name;
  return name.ends_with("_uint") ? "u" : name.ends_with("_sint") ? "i" : "";
}

bool is_sampled(std::uint32_t access) {
  return access == HEDDLE_ACCESS_SAMPLED || access == HEDDLE_ACCESS_SAMPLED_LINEAR ||
         access == HEDDLE_ACCESS_SAMPLED_COMPARE;
}
bool is_storage(std::uint32_t access) {
  return access == HEDDLE_ACCESS_STORAGE_READ || access == HEDDLE_ACCESS_STORAGE_WRITE ||
         access == HEDDLE_ACCESS_STORAGE_READ_WRITE || access == HEDDLE_ACCESS_APPEND;
}

class Declarer {
 public:
  explicit Declarer(const Scope& scope) : scope_(scope), next_binding_(scope.first_binding) {}

  Declarations run() {
    std::uint32_t next_location = 0;
    for (const BoundPort& port : merged_ports()) {
      if (port.access == HEDDLE_ACCESS_COLOR) {
        const std::string name = declared(port.port);
        if (port.blend == HEDDLE_BLEND_TINT) {
          line("layout(location = {0}, index = 0) out vec4 {1};", next_location, name);
          line("layout(location = {0}, index = 1) out vec4 {1};", next_location++, declared(port.port + "_tint"));
        } else {
          line("layout(location = {}) out {}vec4 {};", next_location++, prefix_of(port.format), name);
        }
      } else if (port.is_list && is_storage(port.access)) {
        list(port);
      } else if (port.access == HEDDLE_ACCESS_VALUE || (port.type != PortType::kImage && is_storage(port.access))) {
        block(port);
      } else if (is_sampled(port.access)) {
        sampled_image(port);
      } else if (is_storage(port.access)) {
        storage_image(port);
      }
    }
    parameters();
    return std::move(out_);
  }

 private:
  template <typename... Arguments>
  void line(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
    out_.text += fmt::format(format, std::forward<Arguments>(arguments)...);
    out_.text += '\n';
  }

  [[noreturn]] void fail(const BoundPort& port, std::string_view what, std::string_view help) const {
    Diagnostic diagnostic;
    diagnostic.message = fmt::format("port '{}' of {} {}", port.port, scope_.who, what);
    diagnostic.help = help;
    throw Error(HEDDLE_BAD_INPUT, std::move(diagnostic));
  }

  // Name with the suffix of the scope, noted for renaming.
  std::string declared(std::string_view name) {
    const std::string legal = glsl_name(name);
    out_.names.insert(legal);
    return legal + std::string(scope_.suffix);
  }
  std::string accessor(std::string_view verb, const BoundPort& port) {
    return declared(fmt::format("{}_{}", verb, port.port));
  }

  std::uint32_t bind(Binding::Kind kind, const BoundPort& port) {
    out_.bindings.push_back({scope_.set, next_binding_, kind, std::string(scope_.pass), port.port, "", port.access});
    return next_binding_++;
  }

  // A stage may name a storage port twice, for reading and for writing: one declaration for both.
  std::vector<BoundPort> merged_ports() const {
    std::vector<BoundPort> out;
    for (const BoundPort& port : scope_.ports) {
      const bool is_visible = is_sampled(port.access) || is_storage(port.access) ||
                              port.access == HEDDLE_ACCESS_VALUE || port.access == HEDDLE_ACCESS_COLOR;
      if (!is_visible) continue;
      const auto same = std::find_if(out.begin(), out.end(), [&](const BoundPort& o) { return o.port == port.port; });
      if (same == out.end()) {
        out.push_back(port);
      } else if (is_storage(same->access) && is_storage(port.access) && same->access != HEDDLE_ACCESS_APPEND &&
                 port.access != HEDDLE_ACCESS_APPEND) {
        if (same->access != port.access) same->access = HEDDLE_ACCESS_STORAGE_READ_WRITE;
      } else if (same->access != port.access) {
        fail(port, "is accessed in two ways that exclude each other",
             port.is_list ? "one stage appends to a list, another reads it: split the stage"
                          : "one stage samples a port, stores into it or draws into it; split the stage, or use "
                            "STORAGE_READ_WRITE");
      }
    }
    return out;
  }

  void has(const BoundPort& port) { line("const bool {} = {};", accessor("has", port), port.is_bound); }

  void sampled_image(const BoundPort& port) {
    if (port.type != PortType::kImage) fail(port, "is no image and cannot be sampled", "declare another access");
    const std::string_view prefix = prefix_of(port.format);
    const bool is_compare = port.access == HEDDLE_ACCESS_SAMPLED_COMPARE;
    if (!port.is_bound) {
      absent_image(port, prefix, is_compare);
      return;
    }
    const bool is_array = port.layers > (port.is_cube ? 6U : 1U);
    const std::string name = declared(port.port);
    line("layout(set = {}, binding = {}) uniform {}sampler{}{}{} {};", scope_.set,
         bind(Binding::Kind::kSampledImage, port), prefix, port.is_cube ? "Cube" : "2D", is_array ? "Array" : "",
         is_compare ? "Shadow" : "", name);
    has(port);
    line("ivec2 {}() {{ return textureSize({}, 0).xy; }}", accessor("size", port), name);
    if (is_compare) {
      compare_accessors(port, name, is_array);
    } else if (port.is_cube) {
      const std::string sample = accessor("sample", port);
      const char* const coordinate = is_array ? "vec4" : "vec3";
      line("{}vec4 {}({} direction) {{ return textureLod({}, direction, 0.0); }}", prefix, sample, coordinate, name);
    } else {
      image_accessors(port, name, prefix, is_array);
    }
  }

  // An image that happens to have one layer also answers for "layer 0", so that layer counts may be parameters.
  void image_accessors(const BoundPort& port, const std::string& name, std::string_view prefix, bool is_array) {
    const std::string fetch = accessor("fetch", port);
    const std::string sample = accessor("sample", port);
    if (is_array) {
      line("{}vec4 {}(ivec2 pixel, int layer) {{ return texelFetch({}, ivec3(pixel, layer), 0); }}", prefix, fetch,
           name);
      line("{}vec4 {}(vec3 uv_layer) {{ return textureLod({}, uv_layer, 0.0); }}", prefix, sample, name);
      return;
    }
    line("{}vec4 {}(ivec2 pixel) {{ return texelFetch({}, pixel, 0); }}", prefix, fetch, name);
    line("{}vec4 {}(ivec2 pixel, int layer) {{ return texelFetch({}, pixel, 0); }}", prefix, fetch, name);
    line("{}vec4 {}(vec2 uv) {{ return textureLod({}, uv, 0.0); }}", prefix, sample, name);
    line("{}vec4 {}(vec3 uv_layer) {{ return textureLod({}, uv_layer.xy, 0.0); }}", prefix, sample, name);
  }

  void compare_accessors(const BoundPort& port, const std::string& name, bool is_array) {
    const std::string compare = accessor("compare", port);
    if (port.is_cube && is_array) {
      line("float {}(vec4 direction, float reference) {{ return texture({}, direction, reference); }}", compare, name);
    } else if (port.is_cube) {
      line("float {}(vec3 direction, float reference) {{ return texture({}, vec4(direction, reference)); }}", compare,
           name);
    } else if (is_array) {
      // Sampling an array with comparison has no explicit level; zero gradients choose mip 0 in every kind of shader.
      line(
          "float {}(vec2 uv, int layer, float reference) {{ return textureGrad({}, vec4(uv, layer, reference), "
          "vec2(0.0), vec2(0.0)); }}",
          compare, name);
    } else {
      line("float {}(vec2 uv, float reference) {{ return textureLod({}, vec3(uv, reference), 0.0); }}", compare, name);
      line("float {}(vec2 uv, int layer, float reference) {{ return textureLod({}, vec3(uv, reference), 0.0); }}",
           compare, name);
    }
  }

  void absent_image(const BoundPort& port, std::string_view prefix, bool is_compare) {
    has(port);
    line("ivec2 {}() {{ return ivec2(1); }}", accessor("size", port));
    if (is_compare) {
      const std::string compare = accessor("compare", port);
      const std::string value = glsl_float(port.neutral[0]);
      line("float {}(vec2 uv, float reference) {{ return {}; }}", compare, value);
      line("float {}(vec2 uv, int layer, float reference) {{ return {}; }}", compare, value);
      line("float {}(vec3 direction, float reference) {{ return {}; }}", compare, value);
      return;
    }
    std::string value = fmt::format("{}vec4(", prefix);
    for (std::size_t i = 0; i < port.neutral.size(); ++i) {
      value += i == 0 ? "" : ", ";
      value += prefix.empty()
                   ? glsl_float(port.neutral[i])
                   : fmt::format("{}{}", static_cast<std::int64_t>(port.neutral[i]), prefix == "u" ? "u" : "");
    }
    value += ")";
    const std::string fetch = accessor("fetch", port);
    const std::string sample = accessor("sample", port);
    line("{}vec4 {}(ivec2 pixel) {{ return {}; }}", prefix, fetch, value);
    line("{}vec4 {}(ivec2 pixel, int layer) {{ return {}; }}", prefix, fetch, value);
    line("{}vec4 {}(vec2 uv) {{ return {}; }}", prefix, sample, value);
    line("{}vec4 {}(vec3 uv_layer) {{ return {}; }}", prefix, sample, value);
    if (port.is_cube) line("{}vec4 {}(vec4 direction) {{ return {}; }}", prefix, sample, value);
  }

  void storage_image(const BoundPort& port) {
    if (!port.is_bound) {
      fail(port, "is absent, and a storage image has no neutral value", "declare an optional port as SAMPLED");
    }
    const FormatInfo info = format_info(port.format);
    const std::string_view qualifier = info.glsl;
    const bool is_write_only = port.access == HEDDLE_ACCESS_STORAGE_WRITE;
    if (qualifier.empty() && !is_write_only) {
      fail(port, fmt::format("has format {}, which no storage image can be read in", info.name),
           "read it as SAMPLED, or give the output another format");
    }
    const std::string name = declared(port.port);
    line("layout(set = {}, binding = {}{}{}) {}uniform {}image2D{} {};", scope_.set,
         bind(Binding::Kind::kStorageImage, port), qualifier.empty() ? "" : ", ", qualifier,
         is_write_only                               ? "writeonly "
         : port.access == HEDDLE_ACCESS_STORAGE_READ ? "readonly "
                                                     : "",
         prefix_of(port.format), port.layers > 1 ? "Array" : "", name);
    has(port);
    line("ivec2 {}() {{ return imageSize({}).xy; }}", accessor("size", port), name);
  }

  // Values and buffers. An absent value is declared as well, so that texts compile: the host binds zeros.
  void block(const BoundPort& port) {
    if (port.type != PortType::kValue && port.type != PortType::kBuffer) {
      fail(port, "is neither a value nor a buffer", "declare another access");
    }
    const std::vector<Member> members = block_members(port.glsl);
    if (members.empty()) {
      fail(port, "has no members for shaders", "set `glsl` in the port, or in the role's contract");
    }
    std::set<std::string, std::less<>> names;
    for (const Member& member : members) {
      names.insert(member.name);
      out_.names.insert(member.name);
    }
    const std::string text = rename_members(port.glsl, names);
    out_.text += port.types;
    const std::string name = glsl_name(port.port) + std::string(scope_.suffix);
    const bool is_value = port.access == HEDDLE_ACCESS_VALUE;
    if (is_value && !members.back().is_unsized_array) {
      line("layout(std140, set = {}, binding = {}) {} HeddleValue_{} {{ {} }};", scope_.set,
           bind(Binding::Kind::kUniformBuffer, port), block_keyword(), name, text);
    } else if (is_value) {
      line("layout(std430, set = {}, binding = {}) readonly buffer HeddleValue_{} {{ uvec4 heddle_header_{}; {} }};",
           scope_.set, bind(Binding::Kind::kStorageBuffer, port), name, name, text);
    } else {
      line("layout(std430, set = {}, binding = {}) {}buffer HeddleBuffer_{} {{ {} }};", scope_.set,
           bind(Binding::Kind::kStorageBuffer, port), port.access == HEDDLE_ACCESS_STORAGE_READ ? "readonly " : "",
           name, text);
    }
    has(port);
    if (!port.types.empty()) component_accessor(port, members.back());
  }

  // Owners that came after the scene's (a sky's sun) have none.
  void component_accessor(const BoundPort& port, const Member& element) {
    const std::string type = port.glsl.substr(0, port.glsl.find(' '));
    const std::string array = element.name + std::string(scope_.suffix);
    line("{0} {1}(uint owner) {{ if (owner < uint({2}.length())) return {2}[owner]; return {0}_absent(); }}", type,
         accessor("fetch", port), array);
  }

  // A head of 16 bytes, then the elements. Whoever appends does not see them: what others append meanwhile has no
  // order.
  void list(const BoundPort& port) {
    const std::vector<Member> members = block_members(port.glsl);
    if (members.size() != 1 || !members.front().is_unsized_array) {
      fail(port, fmt::format("is a list of \"{}\"", port.glsl), "a list's glsl is one array without length");
    }
    const std::string& member = members.front().name;
    const bool is_appended = port.access == HEDDLE_ACCESS_APPEND;
    const std::string hidden = "heddle_elements_" + glsl_name(port.port);
    const std::set<std::string, std::less<>> names{member};
    std::string text = rename(port.glsl, scan(port.glsl), names, "_heddle");
    const std::string::size_type at = text.find(member + "_heddle");
    const std::string type = text.substr(0, at);
    const std::string elements = (is_appended ? hidden : member) + std::string(scope_.suffix);
    text.replace(at, member.size() + std::string_view("_heddle").size(), elements);
    if (!is_appended) out_.names.insert(member);
    const std::string name = glsl_name(port.port) + std::string(scope_.suffix);
    line("// elements of {} bytes", port.element_bytes);  // what the code is checked for is in the cache's key
    line("layout(std430, set = {}, binding = {}) {}buffer HeddleBuffer_{} {{ uint heddle_list_{}[4]; {} }};",
         scope_.set, bind(Binding::Kind::kStorageBuffer, port),
         port.access == HEDDLE_ACCESS_STORAGE_READ ? "readonly " : "", name, name, text);
    has(port);
    const std::string capacity = accessor("capacity", port);
    line("uint {}() {{ return uint({}.length()); }}", capacity, elements);
    if (!is_appended) {
      line("uint {}() {{ return min(heddle_list_{}[0], {}()); }}", accessor("count", port), name, capacity);
      return;
    }
    line("bool {}({} element) {{", accessor("append", port), type);
    line("  uint index = atomicAdd(heddle_list_{}[0], 1u);", name);
    line("  if (index < {}()) {}[index] = element;", capacity, elements);
    line("  return index < {}();", capacity);
    line("}}");
  }

  [[nodiscard]] std::string rename_members(const std::string& text,
                                           const std::set<std::string, std::less<>>& names) const {
    const Scan facts = scan(text);
    return scope_.suffix.empty() ? text : rename(text, facts, names, scope_.suffix);
  }

  // As descriptor_type says.
  [[nodiscard]] std::string_view block_keyword() const {
    return scope_.set == kSetOfProviders ? "readonly buffer" : "uniform";
  }

  void parameters() {
    if (scope_.technique == nullptr) return;
    const std::vector<Parameter>& all = scope_.technique->parameters;
    if (parameter_layout(*scope_.technique).size > 0) {
      const std::string name = declared("params");
      out_.bindings.push_back(
          {scope_.set, next_binding_, Binding::Kind::kParameters, std::string(scope_.pass), "", "", 0});
      line("layout(std140, set = {}, binding = {}) {} HeddleParams{} {{", scope_.set, next_binding_, block_keyword(),
           scope_.suffix);
      ++next_binding_;
      for (const Parameter& parameter : all) {
        if (parameter.components() == 0 || is_constant(parameter)) continue;
        line("  {} {};", glsl_type(parameter.type), glsl_name(parameter.name));
      }
      line("}} {};", name);
    }
    for (std::uint32_t i = 0; i < all.size(); ++i) {
      if (!is_constant(all[i])) continue;
      const std::string name = declared("constant_" + all[i].name);
      const std::uint32_t id =
          scope_.first_constant ? *scope_.first_constant + static_cast<std::uint32_t>(out_.constants.size()) : i;
      const double value = all[i].default_value[0];
      out_.constants.push_back({id, std::string(scope_.pass), i});
      switch (all[i].type) {
        case ParameterType::kBool:
          line("layout(constant_id = {}) const bool {} = {};", id, name, value != 0.0);
          break;
        case ParameterType::kInt:
          line("layout(constant_id = {}) const int {} = {};", id, name, static_cast<std::int32_t>(value));
          break;
        case ParameterType::kChoice:
          line("layout(constant_id = {}) const uint {} = {}u;", id, name, static_cast<std::uint32_t>(value));
          break;
        default:
          line("layout(constant_id = {}) const float {} = {};", id, name, glsl_float(value));
          break;
      }
    }
  }

  const Scope& scope_;
  std::uint32_t next_binding_;
  Declarations out_;
};

}  // namespace

std::string glsl_float(double value) {
  if (std::isnan(value)) return "uintBitsToFloat(0x7fc00000u)";
  if (std::isinf(value)) return value > 0 ? "uintBitsToFloat(0x7f800000u)" : "uintBitsToFloat(0xff800000u)";
  std::string text = fmt::format("{}", static_cast<float>(value));
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

Declarations declare(const Scope& scope) {
  return Declarer(scope).run();
}

std::string declare_kind(ShaderKind kind) {
  switch (kind) {
    case ShaderKind::kCompute:
      return "";
    case ShaderKind::kFullscreen:
      return "layout(location = 0) in vec2 uv;\n";
    case ShaderKind::kSurfaces:
      break;
  }
  // The vertex side of this block is written in surface_program.cpp: same order, same locations.
  return fmt::format(
      "layout(location = 0) in HeddleSurface {{\n"
      "  vec3 position_rel, previous_position_rel;\n"
      "  vec3 normal;\n"
      "  vec4 tangent;\n"
      "  vec2 uv0, uv1;\n"
      "  vec4 color;\n"
      "  flat uint material, object, flags;\n"
      "}} surface;\n"
      "layout(set = {1}, binding = 0) uniform sampler2DArray texture_base_color;\n"
      "layout(set = {1}, binding = 1) uniform sampler2DArray texture_metallic_roughness;\n"
      "layout(set = {1}, binding = 2) uniform sampler2DArray texture_normal;\n"
      "layout(set = {1}, binding = 3) uniform sampler2DArray texture_occlusion;\n"
      "layout(set = {1}, binding = 4) uniform sampler2DArray texture_emissive;\n"
      "layout(std430, set = {0}, binding = {2}) readonly buffer HeddleMaterials {{ HeddleMaterial materials[]; }};\n"
      "layout(std140, set = {0}, binding = {3}) uniform HeddleSurfaceView {{ HeddleView view; }};\n",
      kSetOfProgram, kSetOfMaterials, kBindingOfMaterials, kBindingOfView);
}

}  // namespace shader
}  // namespace heddle::vulkan
