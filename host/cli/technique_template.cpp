// SPDX-License-Identifier: Apache-2.0
// A role's contract -> the text of pass.cpp or pass.c, shaders, CMakeLists.txt and README.md.
#include "cli/technique_template.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "cli/session.hpp"
#include "json.hpp"

namespace heddle::cli {
namespace {

// Every device stores to it, and it holds every range; the comment beside it says to choose a smaller one.
constexpr std::string_view kFormat = "VK_FORMAT_R32G32B32A32_SFLOAT";

std::string c_literal(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c == '\n' ? ' ' : c;
  }
  return result + "\"";
}

std::string glsl_number(const Json& number) {
  if (number.is_string()) return number == "inf" ? "uintBitsToFloat(0x7f800000u)" : "uintBitsToFloat(0xff800000u)";
  std::string text = fmt::format("{}", number.get<double>());
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

std::string glsl_vec4(const Json& numbers) {
  std::string text;
  for (const Json& number : numbers) text += (text.empty() ? "" : ", ") + glsl_number(number);
  return "vec4(" + text + ")";
}

/// A port of the role that the template uses, and how.
struct UsedPort {
  const Json* role = nullptr;
  std::string name, builder, c_type, access;
  bool is_optional = false;
  bool is_output = false;
  bool is_list = false;
};

/// What the template knows of its role.
class Template {
 public:
  Template(const Json& role, std::string_view name, TemplateLanguage language)
      : role_(role), name_(name), role_name_(text_of(role, "name")), language_(language) {
    for (const Json& port : role["ports"]) use(port);
    const bool has_output =
        std::any_of(ports_.begin(), ports_.end(), [](const UsedPort& port) { return port.is_output; });
    has_function_ = !role["functions"].empty();
    if (has_output) {
      stage_ports_ = ports_;
    } else if (has_function_) {
      // A function reads values; images it would only wait for.
      std::erase_if(ports_, [](const UsedPort& port) { return port.access != "value"; });
    }
    has_shader_ = has_output;
  }

  std::vector<TemplateFile> files() const {
    std::vector<TemplateFile> files;
    files.push_back(language_ == TemplateLanguage::kCpp ? TemplateFile{"pass.cpp", pass_cpp()}
                                                        : TemplateFile{"pass.c", pass_c()});
    if (has_shader_) files.push_back({shader_file(), shader()});
    if (has_function_) files.push_back({function_file(), function()});
    std::string shaders;
    for (std::size_t i = 1; i < files.size(); ++i) shaders += " " + files[i].name;
    files.push_back({"CMakeLists.txt", fmt::format("# SPDX-License-Identifier: Apache-2.0\n# {}.\n"
                                                   "heddle_plugin(SOURCES {} SHADERS{})\n",
                                                   id(), files[0].name, shaders)});
    files.push_back({"README.md", readme()});
    return files;
  }

 private:
  std::string id() const { return role_name_ + "/" + name_; }
  std::string shader_file() const { return name_ + ".comp.glsl"; }
  std::string function_file() const { return name_ + ".glsl"; }
  // "display/grey: A grey display."
  std::string first_line() const { return fmt::format("{}: {}", id(), text_of(role_, "title")); }

  void use(const Json& port) {
    const std::string type = text_of(port, "type");
    const std::string direction = text_of(port, "direction");
    UsedPort used;
    used.role = &port;
    used.name = text_of(port, "name");
    used.is_optional = port["optional"].get<bool>();
    used.is_list = port["list"].get<bool>();
    used.c_type = type == "image"      ? "HEDDLE_PORT_IMAGE"
                  : type == "buffer"   ? "HEDDLE_PORT_BUFFER"
                  : type == "artifact" ? "HEDDLE_PORT_ARTIFACT"
                                       : "HEDDLE_PORT_VALUE";
    used.is_output = direction == "out";
    if (used.is_output && type != "image" && !used.is_optional) {
      throw Failure{HEDDLE_UNSUPPORTED,
                    fmt::format("error: no template for role '{}': its output '{}' is no image but of the type {}\n"
                                "  help:     begin with a copy of another technique's folder",
                                role_name_, used.name, type)};
    }
    if (used.is_output && used.is_optional) return;
    if (type == "surfaces" && direction != "in") {
      throw Failure{HEDDLE_UNSUPPORTED,
                    fmt::format("error: no template for role '{}': its '{}' are surfaces that techniques make\n"
                                "  help:     begin with a copy of another technique's folder",
                                role_name_, used.name)};
    }
    // Surfaces are drawn and artifacts read by CPU stages, not computed with here; what a technique may change in
    // place, it may leave alone.
    if (type == "surfaces" || (type == "artifact" && used.is_optional) || direction == "inout") return;
    if (used.is_output) {
      used.builder = "image_out";
      used.access = "storage_write";
    } else {
      used.builder = used.is_list ? "list_in" : type + "_in";
      used.access = type == "image" ? "sampled" : type == "buffer" ? "storage_read" : "value";
    }
    ports_.push_back(std::move(used));
  }

  // The one image that the role turns into another, or nullptr.
  const UsedPort* source() const {
    const UsedPort* found = nullptr;
    for (const UsedPort& port : stage_ports_) {
      if (port.is_output || port.access != "sampled" || port.is_optional) continue;
      if (found != nullptr) return nullptr;
      found = &port;
    }
    return found;
  }

  std::vector<const UsedPort*> outputs() const {
    std::vector<const UsedPort*> found;
    for (const UsedPort& port : stage_ports_) {
      if (port.is_output) found.push_back(&port);
    }
    return found;
  }

  std::string pass_cpp() const {
    const std::string type = has_shader_ ? "Pass" : "Nothing";
    std::string text = fmt::format(
        "// SPDX-License-Identifier: Apache-2.0\n// {}.\n#include <heddle/pass.hpp>\n\nnamespace {{\n\n"
        "using namespace heddle::pass;\n\n",
        first_line());
    if (!ports_.empty()) {
      text += fmt::format("// What each port means, unit and range: plugins/{}/role.toml.", role_name_);
      text += has_shader_ ? " A smaller format may hold the range.\n" : "\n";
      text += "constexpr heddle_port kPorts[] = {\n";
      for (const UsedPort& port : ports_) {
        const std::string_view contents = port.is_list && port.is_optional ? ", nullptr" : "";  // as the role says
        text += fmt::format("    {}(\"{}\", {}nullptr{}{}),\n", port.builder, port.name,
                            port.is_output ? std::string(kFormat) + ", " : "", contents,
                            port.is_optional ? ", HEDDLE_PORT_OPTIONAL" : "");
      }
      text += "};\n";
    }
    if (has_shader_) {
      text += fmt::format("constexpr heddle_access kAccesses[] = {{\n{}}};\n", accesses_cpp(stage_ports_));
      text += "constexpr heddle_stage kStages[] = {gpu_stage(\"main\", kAccesses)};\n";
      text += fmt::format("constexpr heddle_shader kShaders[] = {{compute_shader(\"main\", \"main\", \"{}\")}};\n",
                          shader_file());
    }
    if (has_function_) {
      const std::vector<UsedPort> read = function_ports();
      if (!read.empty()) {
        text += fmt::format("constexpr heddle_access kFunctionAccesses[] = {{\n{}}};\n", accesses_cpp(read));
      }
      text += fmt::format("constexpr heddle_function kFunctions[] = {{function(\"{}\", \"{}\"{})}};\n", role_name_,
                          function_file(), read.empty() ? "" : ", kFunctionAccesses");
    }
    if (has_shader_) {
      text += fmt::format(
          "\nstruct {} {{\n  heddle_status record(const Frame& frame) {{ return frame.dispatch_over(\"main\", \"{}\"); "
          "}}\n}};\n",
          type, outputs().front()->name);
    }
    std::string tables;
    if (!ports_.empty()) tables += ", kPorts";
    if (has_shader_) tables += ", kStages, kShaders";
    if (has_function_) tables += ", kFunctions";
    text += fmt::format(
        "\nconstexpr heddle_technique kTechnique = [] {{\n  heddle_technique t =\n      technique<{}>(\"{}\",\n"
        "                {},\n                \"author, year, title\"{});\n  t.role_revision = {};\n",
        type, id(), c_literal(text_of(role_, "title")), tables, role_["revision"].get<int>());
    return text + "  return t;\n}();\n\n}  // namespace\n\nHEDDLE_PLUGIN(kTechnique)\n";
  }

  static std::string accesses_cpp(const std::vector<UsedPort>& ports) {
    std::string text;
    for (const UsedPort& port : ports) {
      text += fmt::format("    {}(\"{}\"),\n", port.access, port.name);
    }
    return text;
  }

  std::vector<UsedPort> function_ports() const {
    std::vector<UsedPort> read;
    std::copy_if(ports_.begin(), ports_.end(), std::back_inserter(read),
                 [](const UsedPort& port) { return port.access == "value"; });
    return read;
  }

  static std::string accesses_c(std::string_view array, const std::vector<UsedPort>& ports) {
    std::string text = fmt::format("static const heddle_access {}[] = {{\n", array);
    for (const UsedPort& port : ports) {
      std::string access = port.access;
      std::transform(access.begin(), access.end(), access.begin(),
                     [](char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c; });
      text += fmt::format("    {{.struct_size = sizeof(heddle_access), .port = \"{}\", .access = HEDDLE_ACCESS_{}}},\n",
                          port.name, access);
    }
    return text + "};\n";
  }

  std::string pass_c() const {
    std::string text = fmt::format(
        "/* SPDX-License-Identifier: Apache-2.0 */\n/* {}. */\n#include <heddle/plugin.h>\n\n"
        "#define COUNT(array) ((uint32_t)(sizeof(array) / sizeof *(array)))\n\n",
        first_line());
    if (!ports_.empty()) {
      text += fmt::format("/* What each port means, unit and range: plugins/{}/role.toml.{} */\n", role_name_,
                          has_shader_ ? " A smaller format may hold the range." : "");
      text += "static const heddle_port ports[] = {\n";
      for (const UsedPort& port : ports_) {
        text += fmt::format("    {{.struct_size = sizeof(heddle_port),\n     .name = \"{}\",\n     .type = {},\n",
                            port.name, port.c_type);
        text += fmt::format("     .direction = {}", port.is_output ? "HEDDLE_OUT" : "HEDDLE_IN");
        const std::string flags = std::string(port.is_optional ? "HEDDLE_PORT_OPTIONAL" : "") +
                                  (port.is_optional && port.is_list ? " | " : "") +
                                  (port.is_list ? "HEDDLE_PORT_LIST" : "");
        if (!flags.empty()) text += ",\n     .flags = " + flags;
        if (port.is_output) text += fmt::format(",\n     .format = {}", kFormat);
        text += "},\n";
      }
      text += "};\n";
    }
    std::string fields;
    if (!ports_.empty()) fields += "    .port_count = COUNT(ports),\n    .ports = ports,\n";
    if (has_shader_) {
      text += accesses_c("accesses", stage_ports_);
      text +=
          "static const heddle_stage stages[] = {\n    {.struct_size = sizeof(heddle_stage),\n     .name = \"main\",\n"
          "     .kind = HEDDLE_STAGE_GPU,\n     .access_count = COUNT(accesses),\n     .accesses = accesses},\n};\n";
      text += fmt::format(
          "static const heddle_shader shaders[] = {{\n    {{.struct_size = sizeof(heddle_shader),\n     .name = "
          "\"main\",\n     .kind = HEDDLE_SHADER_COMPUTE,\n     .stage = \"main\",\n     .file = \"{}\"}},\n}};\n",
          shader_file());
      fields +=
          "    .stage_count = COUNT(stages),\n    .stages = stages,\n    .shader_count = COUNT(shaders),\n"
          "    .shaders = shaders,\n    .record = record,\n";
    }
    if (has_function_) {
      const std::vector<UsedPort> read = function_ports();
      if (!read.empty()) text += accesses_c("function_accesses", read);
      text += fmt::format(
          "static const heddle_function functions[] = {{\n    {{.struct_size = sizeof(heddle_function),\n     .role = "
          "\"{}\",\n     .file = \"{}\"{}}},\n}};\n",
          role_name_, function_file(),
          read.empty() ? "" : ",\n     .access_count = COUNT(function_accesses),\n     .accesses = function_accesses");
      fields += "    .function_count = COUNT(functions),\n    .functions = functions,\n";
    }
    if (has_shader_) {
      text += fmt::format(
          "\nstatic heddle_status record(heddle_pass* pass, const heddle_pass_host* host, uint32_t stage, "
          "heddle_frame* "
          "frame,\n                            const heddle_frame_info* info) {{\n  (void)pass, (void)stage, "
          "(void)info;\n"
          "  return host->dispatch_over(host, frame, \"main\", \"{}\", 0, 0);\n}}\n",
          outputs().front()->name);
    }
    text += fmt::format(
        "\nstatic const heddle_technique technique = {{\n    .struct_size = sizeof(heddle_technique),\n    .id = "
        "\"{}\",\n    .title = {},\n    .source = \"author, year, title\",\n    .role_revision = {},\n{}}};\n",
        id(), c_literal(text_of(role_, "title")), role_["revision"].get<int>(), fields);
    text +=
        "static const heddle_technique* const techniques[] = {&technique};\n"
        "static const heddle_plugin plugin = {\n    .struct_size = sizeof(heddle_plugin),\n    .abi_major = "
        "HEDDLE_ABI_MAJOR,\n    .abi_minor = HEDDLE_ABI_MINOR,\n    .technique_count = COUNT(techniques),\n"
        "    .techniques = techniques,\n};\n\nconst heddle_plugin* heddle_entry(void) { return &plugin; }\n";
    return text;
  }

  // "// in      depth  m  distance along ...", one line a port.
  std::string port_comments() const {
    std::string text;
    for (const UsedPort& port : stage_ports_) {
      const std::string unit = text_of(*port.role, "unit");
      text += fmt::format("// {:<7} {}  {}{}\n", port.is_output ? "out" : "in", port.name,
                          unit.empty() ? "" : "[" + unit + "] ", text_of(*port.role, "help"));
    }
    return text;
  }

  std::string shader() const {
    std::string text = fmt::format(
        "// SPDX-License-Identifier: Apache-2.0\n// {}.\n{}// threads 8x8, one an output pixel\n"
        "#include \"pass.glsl\"\n\nlayout(local_size_x = 8, local_size_y = 8) in;\n\nvoid main() {{\n"
        "  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);\n",
        first_line(), port_comments());
    text += fmt::format("  if (any(greaterThanEqual(pixel, size_{}()))) return;\n", outputs().front()->name);
    const UsedPort* from = source();
    for (const UsedPort* port : outputs()) {
      const Json& range = (*port->role)["range"];
      std::string value = glsl_vec4((*port->role)["neutral"]);
      if (from != nullptr) value = fmt::format("fetch_{}(pixel)", from->name);
      if (from != nullptr && range.is_array()) {
        value = fmt::format("clamp({}, {}, {})", value, glsl_number(range[0]), glsl_number(range[1]));
      }
      text += fmt::format("  imageStore({}, pixel, {});\n", port->name, value);
    }
    return text + "}\n";
  }

  std::string function() const {
    std::string text = fmt::format("// SPDX-License-Identifier: Apache-2.0\n// {}. A function's text.\n", first_line());
    const std::string include = text_of(role_, "include");
    if (!include.empty()) text += fmt::format("#include \"{}\"\n", include);
    for (const Json& function : role_["functions"]) {
      const std::string unit = text_of(function, "unit");
      text += fmt::format("\n// {}{}\n{} {{\n  {}\n}}\n", unit.empty() ? "" : "[" + unit + "] ",
                          text_of(function, "help"), text_of(function, "signature"), text_of(function, "neutral"));
    }
    return text;
  }

  std::string readme() const {
    std::string text = fmt::format(
        "# {}\n{}.\n\n## Source\nAuthor, year, title, venue, pages, address; what was "
        "taken, what was changed and why.\n\n## Method\n",
        id(), text_of(role_, "title"));
    const UsedPort* from = source();
    if (from != nullptr) {
      text += fmt::format("The output is `{}`, clamped to the output's range.\n", from->name);
    } else {
      text += "The role's neutral value: what a graph shows when nobody does the job.\n";
    }
    text += "\n## Parameters\n| name | unit | range | default | meaning | ladder |\n|---|---|---|---|---|---|\n";
    text += "\n## Known limits\n";
    for (const Json& hard_case : role_["hard_cases"]) {
      text += fmt::format("- {}: {}: not answered yet.\n", text_of(hard_case, "id"), text_of(hard_case, "text"));
    }
    return text + "\n## Measured\nNothing yet.\n";
  }

  const Json& role_;
  std::string name_, role_name_;
  TemplateLanguage language_;
  std::vector<UsedPort> ports_;        // of the descriptor
  std::vector<UsedPort> stage_ports_;  // of the compute stage
  bool has_shader_ = false, has_function_ = false;
};

}  // namespace

std::vector<TemplateFile> technique_template(const Json& role, std::string_view name, TemplateLanguage language) {
  return Template(role, name, language).files();
}

}  // namespace heddle::cli
