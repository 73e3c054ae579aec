// SPDX-License-Identifier: Apache-2.0
// Callers and the providers of roles' functions -> generated texts: "pass.glsl", one text a role, and each provider's
// files with their file-scope names made unique. What a provider's text may not say is refused here, before a compiler
// could report it in somebody else's file.
#include "vulkan/shader_source.hpp"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <sstream>

#include <fmt/format.h>

namespace heddle::vulkan {
namespace shader {
namespace {

namespace fs = std::filesystem;

bool is_role_include(std::string_view name) {
  return name.starts_with("role/") && name.ends_with(".glsl");
}
std::string role_of_include(std::string_view name) {
  return std::string(name.substr(5, name.size() - 10));
}

// A provider's own files as written, before names are known.
struct OwnFile {
  fs::path path;
  std::string text;
  Scan scan;
};

class Joiner {
 public:
  Joiner(const ShaderRequest& request, const std::optional<std::string>& main) : main_(main) {
    join_.request = &request;
    if (request.is_vertex_stage) next_binding_ = kFirstOfProgram;
  }

  JoinedText run() {
    for (const RoleRequest& role : join_.request->roles) {
      for (const ProviderRequest& provider : role.providers) {
        read_provider(role, provider);
      }
      check_provider_count(role);
    }
    check_caller();
    if (!problems_.empty()) throw Error(HEDDLE_BAD_INPUT, std::move(problems_));
    rename_providers();
    std::size_t next = 0;
    for (const RoleRequest& role : join_.request->roles) {
      join_.role_glsl[role.role->name] = role_text(role, next);
      next += role.providers.size();
    }
    write_pass();
    write_main();
    return std::move(join_);
  }

 private:
  [[nodiscard]] std::uint32_t set_of_providers() const {
    return join_.request->is_vertex_stage ? kSetOfProgram : kSetOfProviders;
  }

  // ---- reading and checking ----

  void complain(const fs::path& file, Problem problem) {
    Diagnostic diagnostic;
    diagnostic.where.file = file.string();
    diagnostic.where.line = problem.line;
    diagnostic.message = std::move(problem.message);
    diagnostic.found = std::move(problem.found);
    diagnostic.expected = std::move(problem.expected);
    diagnostic.help = std::move(problem.help);
    problems_.push_back(std::move(diagnostic));
  }

  void read_provider(const RoleRequest& role, const ProviderRequest& request) {
    Provider provider;
    provider.index = join_.providers.size();
    provider.role = role.role;
    provider.request = &request;
    provider.function = request.technique->find_function(role.role->name);
    own_files_.emplace_back();
    if (provider.function == nullptr) {
      complain({}, {0,
                    fmt::format("technique {} of pass '{}' provides no function of role '{}'", request.technique->id,
                                request.pass, role.role->name),
                    "", "", ""});
      join_.providers.push_back(std::move(provider));
      return;
    }
    provider.file = request.folder / provider.function->file;
    read_own_file(provider, provider.function->file, nullptr, 0);
    const bool is_readable = std::all_of(own_files_.back().begin(), own_files_.back().end(),
                                         [](const auto& entry) { return entry.second.scan.problems.empty(); });
    if (!own_files_.back().empty() && is_readable) check_signatures(provider);
    join_.providers.push_back(std::move(provider));
  }

  void read_own_file(Provider& provider, const std::string& name, const fs::path* includer, std::uint32_t line) {
    std::map<std::string, OwnFile>& files = own_files_.back();
    if (files.contains(name)) return;
    const auto made = provider.request->texts.find(name);
    const bool is_made = made != provider.request->texts.end();
    // Messages name a text that the pass made as includes do: nobody finds their lines in the file.
    const fs::path path = is_made ? fs::path(name) : provider.request->folder / name;
    std::optional<std::string> text = is_made ? made->second : read_file(path);
    if (!text) {
      complain(includer != nullptr ? *includer : path,
               {line, fmt::format("the file '{}' of {} cannot be read", name, describe(provider)), "", "", ""});
      return;
    }
    OwnFile& file = files[name];
    file.path = path;
    file.text = std::move(*text);
    file.scan = scan(file.text);
    for (const Problem& problem : file.scan.problems) {
      Problem named = problem;
      named.message = fmt::format("{}: {}", describe(provider), problem.message);
      complain(path, std::move(named));
    }
    check_provider_text(provider, file);
    for (const Include& include : file.scan.includes) {
      if (include.is_angle || is_role_include(include.name) || include.name == "pass.glsl") continue;
      const std::optional<std::string> own = own_name(provider, file.path, include.name);
      if (own) read_own_file(provider, *own, &path, include.line);
    }
  }

  // The name below the technique's folder, if the include means a file there.
  static std::optional<std::string> own_name(const Provider& provider, const fs::path& includer,
                                             const std::string& name) {
    const fs::path folder = provider.request->folder.lexically_normal();
    for (const fs::path& base : {includer.parent_path(), folder}) {
      const fs::path path = (base / name).lexically_normal();
      const std::string relative = path.lexically_relative(folder).generic_string();
      std::error_code ignored;
      if (!relative.empty() && !relative.starts_with("..") && fs::is_regular_file(path, ignored)) return relative;
    }
    return std::nullopt;
  }

  void check_provider_text(const Provider& provider, const OwnFile& file) {
    const std::string who = describe(provider);
    for (const Directive& directive : file.scan.directives) {
      if (directive.name == "version" || directive.name == "extension") {
        complain(file.path, {directive.line, fmt::format("{} has #{}", who, directive.name), "", "",
                             "remove it: the host writes #version 460 and its extensions once for the joined text"});
      }
    }
    for (const Include& include : file.scan.includes) {
      if (include.name == "pass.glsl") {
        complain(file.path, {include.line, fmt::format("{} includes pass.glsl", who), "", "",
                             "remove it: the ports and parameters of a function are declared for it without"});
      } else if (is_role_include(include.name)) {
        const std::string role = role_of_include(include.name);
        const std::vector<std::string>& calls = provider.function->calls;
        if (std::find(calls.begin(), calls.end(), role) == calls.end()) {
          complain(file.path,
                   {include.line, fmt::format("{} includes role '{}', which it does not say that it calls", who, role),
                    calls.empty() ? "calls nothing" : "calls " + join_names(calls), "",
                    fmt::format("add \"{}\" to `calls` of the function's descriptor", role)});
        }
      }
    }
    int depth = 0;
    bool has_layout = false;  // in this statement: one message for one cause
    for (const Token& token : file.scan.tokens) {
      if (token.directive >= 0) continue;
      const std::string_view text = token.text;
      depth += text == "{" || text == "(" ? 1 : text == "}" || text == ")" ? -1 : 0;
      if (text == ";" || text == "}") has_layout = has_layout && depth > 0;
      if (text == "layout" && !has_layout) {
        has_layout = true;
        complain(file.path, {token.line, fmt::format("{} has layout()", who), "", "",
                             "remove it: the host binds the ports that the function's descriptor lists"});
      } else if (depth == 0 && !has_layout && (text == "uniform" || text == "buffer")) {
        complain(file.path, {token.line, fmt::format("{} declares a {} of its own", who, text), "", "",
                             "list a port in the function's descriptor: it is declared for the text"});
      }
    }
    check_image_parameters(file.path, file.scan, who);
  }

  // glslang accepts an image of another format as argument and writes SPIR-V that is not valid.
  void check_image_parameters(const fs::path& path, const Scan& facts, std::string_view who) {
    for (const FunctionText& function : facts.functions) {
      for (const std::string& type : function.parameter_types) {
        if (type.starts_with("image") || type.starts_with("uimage") || type.starts_with("iimage")) {
          complain(path, {function.line, fmt::format("{}: '{}' takes an image as parameter", who, function.name),
                          function.signature, "", "use the port by its name: images cannot be passed on"});
        }
      }
    }
  }

  void check_signatures(Provider& provider) {
    const std::map<std::string, OwnFile>& files = own_files_.back();
    for (const RoleFunction& wanted : provider.role->functions) {
      const FunctionText contract = parse_signature(wanted.signature);
      const FunctionText* nearest = nullptr;
      const fs::path* place = nullptr;
      bool is_found = false;
      std::vector<std::string> defined;
      for (const auto& [name, file] : files) {
        for (const FunctionText& function : file.scan.functions) {
          if (function.is_definition) defined.push_back(function.name);
          if (function.name != wanted.name) continue;
          const bool is_same =
              function.return_type == contract.return_type && function.parameter_types == contract.parameter_types;
          if (is_same && function.is_definition) is_found = true;
          if (nearest == nullptr || function.is_definition) {
            nearest = &function;
            place = &file.path;
          }
        }
      }
      if (is_found) continue;
      if (nearest != nullptr) {
        complain(*place,
                 {nearest->line,
                  fmt::format("{}: '{}' {}", describe(provider), wanted.name,
                              nearest->is_definition ? "has another signature" : "is declared and has no body"),
                  nearest->signature, wanted.signature,
                  fmt::format("role '{}' defines it in {}", provider.role->name, provider.role->file.string())});
      } else if (provider.request->technique->role_revision < provider.role->revision) {
        provider.missing_functions.insert(wanted.name);
      } else {
        complain(provider.file,
                 {0, fmt::format("{} does not define '{}'", describe(provider), wanted.name),
                  defined.empty() ? "no function" : "functions " + join_names(defined), wanted.signature, ""});
      }
    }
  }

  void check_provider_count(const RoleRequest& role) {
    if (role.join != Join::kSwitch || role.providers.size() < 2) return;
    if (std::any_of(role.role->functions.begin(), role.role->functions.end(),
                    [&](const RoleFunction& function) { return takes_selector(*role.role, function); })) {
      return;
    }
    std::vector<std::string> passes;
    for (const ProviderRequest& provider : role.providers) passes.push_back(provider.pass);
    complain({}, {0, fmt::format("role '{}' takes one provider for {}", role.role->name, describe(*join_.request)),
                  "passes " + join_names(passes), "one pass",
                  fmt::format("choose it with functions.{} = [\"{}\"] in pass '{}'", role.role->name, passes.front(),
                              join_.request->pass)});
  }

  void check_caller() {
    const ShaderRequest& request = *join_.request;
    if (main_) return;
    const fs::path path = request.folder / request.shader->file;
    const std::optional<std::string> text = read_file(path);
    if (!text) {
      complain(path, {0, fmt::format("the file of {} cannot be read", describe(request)), "", "", ""});
      return;
    }
    caller_text_ = *text;
    check_caller_text(path, caller_text_);
    for (const auto& [name, made] : request.texts) check_caller_text(name, made);
  }

  void check_caller_text(const fs::path& path, const std::string& text) {
    const Scan facts = scan(text);
    const std::string who = describe(*join_.request);
    for (const Problem& problem : facts.problems) {
      Problem named = problem;
      named.message = fmt::format("{}: {}", who, problem.message);
      complain(path, std::move(named));
    }
    for (const Directive& directive : facts.directives) {
      if (directive.name == "version" || directive.name == "extension") {
        complain(path, {directive.line, fmt::format("{} has #{}", who, directive.name), "", "",
                        "remove it: the host writes #version 460 and its extensions"});
      }
    }
    const std::vector<Token>& tokens = facts.tokens;
    for (std::size_t i = 0; i + 1 < tokens.size(); ++i) {
      if (tokens[i].text != "layout" || tokens[i].directive >= 0) continue;
      for (std::size_t j = i + 1; j < tokens.size() && tokens[j].text != ")"; ++j) {
        if (tokens[j].text == "set" || tokens[j].text == "binding" || tokens[j].text == "constant_id") {
          complain(path, {tokens[j].line, fmt::format("{} has layout({})", who, tokens[j].text), "", "",
                          "remove it: the host binds the ports that the stage's descriptor lists"});
          break;
        }
      }
    }
    check_image_parameters(path, facts, who);
  }

  // ---- renaming ----

  // A suffix that no name in any text could be mistaken for.
  std::string suffix_base() const {
    std::string base = "_p";
    const auto clashes = [&](const Scan& facts) {
      return std::any_of(facts.tokens.begin(), facts.tokens.end(), [&](const Token& token) {
        const std::size_t digits = token.text.find_last_not_of("0123456789");
        return token.kind == TokenKind::kIdentifier && digits != std::string_view::npos &&
               digits + 1 < token.text.size() && token.text.substr(0, digits + 1).ends_with(base);
      });
    };
    const Scan caller = scan(caller_text_);
    bool is_free = false;
    while (!is_free) {
      is_free = !clashes(caller);
      for (const auto& files : own_files_) {
        for (const auto& [name, file] : files) is_free = is_free && !clashes(file.scan);
      }
      if (!is_free) base += "p";
    }
    return base;
  }

  void rename_providers() {
    const std::string base = suffix_base();
    for (Provider& provider : join_.providers) {
      provider.suffix = fmt::format("{}{}", base, provider.index);
      const std::map<std::string, OwnFile>& files = own_files_[provider.index];
      for (const auto& [name, file] : files) provider.names.insert(file.scan.names.begin(), file.scan.names.end());
      const std::string who = describe(provider);
      Scope scope;
      scope.pass = provider.request->pass;
      scope.who = who;
      scope.technique = provider.request->technique;
      scope.ports = provider.request->ports;
      scope.suffix = provider.suffix;
      scope.set = set_of_providers();
      scope.first_binding = next_binding_;
      scope.first_constant = kConstantsOfProviders + static_cast<std::uint32_t>(join_.constants.size());
      Declarations declared = declare(scope);
      next_binding_ += static_cast<std::uint32_t>(declared.bindings.size());
      provider.names.insert(declared.names.begin(), declared.names.end());
      join_.bindings.insert(join_.bindings.end(), declared.bindings.begin(), declared.bindings.end());
      join_.constants.insert(join_.constants.end(), declared.constants.begin(), declared.constants.end());
      declared_.push_back(std::move(declared.text));
      for (const auto& [name, file] : files) provider.texts[name] = renamed(provider, file);
    }
  }

  // Includes of the technique's own files lead to their renamed texts; the rest stays.
  static std::string renamed(const Provider& provider, const OwnFile& file) {
    std::string text = file.text;
    for (auto include = file.scan.includes.rbegin(); include != file.scan.includes.rend(); ++include) {
      if (include->is_angle || is_role_include(include->name)) continue;
      if (const auto own = own_name(provider, file.path, include->name)) {
        text.replace(include->offset, include->length, fmt::format("\"provider/{}/{}\"", provider.index, *own));
      }
    }
    const Scan facts = scan(text);
    return rename(text, facts, provider.names, provider.suffix);
  }

  // ---- writing ----

  // Whether the function has the argument that chooses the provider.
  static bool takes_selector(const Role& role, const RoleFunction& function) {
    const FunctionText signature = parse_signature(function.signature);
    for (std::size_t i = 0; i < signature.parameter_names.size(); ++i) {
      if (!role.selector.empty() && signature.parameter_names[i] == role.selector) {
        return signature.parameter_types[i] == "uint";
      }
    }
    return false;
  }

  static std::string arguments_of(const FunctionText& signature) { return join_names(signature.parameter_names); }

  std::string role_text(const RoleRequest& request, std::size_t first_provider) {
    const Role& role = *request.role;
    std::string text = fmt::format("#ifndef HEDDLE_ROLE_{0}_GLSL\n#define HEDDLE_ROLE_{0}_GLSL\n", role.name);
    if (!role.include.empty()) text += fmt::format("#include \"{}\"\n", role.include);
    const std::size_t count = request.providers.size();
    const std::span<const Provider> providers = std::span(join_.providers).subspan(first_provider, count);
    for (const Provider& provider : providers) {
      text += fmt::format("// {}\n{}", describe(provider), declared_[provider.index]);
      for (const RoleFunction& function : role.functions) {
        if (provider.missing_functions.contains(function.name)) {
          text += body(renamed_signature(function, provider.suffix), function.neutral);
        }
      }
      text += fmt::format("#include \"provider/{}/{}\"\n", provider.index, provider.function->file);
    }
    bool has_table = false;
    for (const RoleFunction& function : role.functions) {
      const bool is_chosen = request.join == Join::kSwitch && count > 1 && takes_selector(role, function);
      if (is_chosen && !has_table) {
        has_table = true;
        join_.bindings.push_back({set_of_providers(), next_binding_, Binding::Kind::kSwitchTable, join_.request->pass,
                                  "", role.name, HEDDLE_ACCESS_STORAGE_READ});
        text += fmt::format(
            "layout(std430, set = {}, binding = {}) readonly buffer HeddleProviderOf_{} {{ uint provider_of_{}[]; "
            "}};\n",
            set_of_providers(), next_binding_++, role.name, role.name);
      }
      text += joined_function(request, function, providers);
    }
    return text + "#endif\n";
  }

  static std::string body(std::string_view signature, std::string_view statements) {
    return fmt::format("{} {{ {} }}\n", signature, statements);
  }
  static std::string renamed_signature(const RoleFunction& function, std::string_view suffix) {
    const Scan facts = scan(function.signature);
    return rename(function.signature, facts, {function.name}, suffix);
  }

  std::string joined_function(const RoleRequest& request, const RoleFunction& function,
                              std::span<const Provider> providers) const {
    if (providers.empty()) return body(function.signature, function.neutral);
    const FunctionText signature = parse_signature(function.signature);
    const auto call = [&](const Provider& provider) {
      return fmt::format("{}{}({})", function.name, provider.suffix, arguments_of(signature));
    };
    const bool is_void = signature.return_type == "void";
    const std::string answer = is_void ? "" : "return ";
    std::string text = fmt::format("{} {{\n", function.signature);
    const bool is_switch = request.join == Join::kSwitch;
    if (is_switch && (providers.size() == 1 || !takes_selector(*request.role, function))) {
      text += fmt::format("  {}{};\n", answer, call(providers.front()));
    } else if (is_switch) {
      text += fmt::format("  switch (provider_of_{}[{}]) {{\n", request.role->name, request.role->selector);
      for (std::size_t i = 0; i < providers.size(); ++i) {
        text += fmt::format("    case {}u: {}{};{}\n", i, answer, call(providers[i]), is_void ? " break;" : "");
      }
      text += fmt::format("    default: {{ {} }}\n  }}\n", function.neutral);
    } else if (is_void) {
      for (const Provider& provider : providers) text += fmt::format("  {};\n", call(provider));
    } else {
      const char* const sign = request.join == Join::kSum ? "+" : "*";
      text += fmt::format("  {} heddle_joined = {};\n", signature.return_type, call(providers.front()));
      for (const Provider& provider : providers.subspan(1)) {
        text += fmt::format("  heddle_joined {}= {};\n", sign, call(provider));
      }
      text += "  return heddle_joined;\n";
    }
    return text + "}\n";
  }

  void write_pass() {
    const ShaderRequest& request = *join_.request;
    // Roles come first, so that no name of the caller can be meant by a provider's text.
    std::string text = "#ifndef HEDDLE_PASS_GLSL\n#define HEDDLE_PASS_GLSL\n#include <heddle/records.h>\n";
    for (const RoleRequest& role : request.roles) text += fmt::format("#include \"role/{}.glsl\"\n", role.role->name);
    const std::string who = fmt::format("stage '{}' of pass '{}'", request.shader->stage, request.pass);
    Scope scope;
    scope.pass = request.pass;
    scope.who = who;
    scope.technique = request.technique;
    scope.ports = request.ports;
    scope.set = kSetOfCaller;
    Declarations declared = declare(scope);
    join_.bindings.insert(join_.bindings.begin(), declared.bindings.begin(), declared.bindings.end());
    join_.constants.insert(join_.constants.begin(), declared.constants.begin(), declared.constants.end());
    text += declare_kind(request.shader->kind);
    text += declared.text;
    join_.pass_glsl = text + "#endif\n";
  }

  void write_main() {
    // Extensions that cost nothing unless used; what needs a device feature is not among them.
    std::string text = "#version 460\n";
    for (const char* extension :
         {"GL_EXT_control_flow_attributes", "GL_KHR_shader_subgroup_basic", "GL_KHR_shader_subgroup_vote",
          "GL_KHR_shader_subgroup_arithmetic", "GL_KHR_shader_subgroup_ballot", "GL_KHR_shader_subgroup_shuffle"}) {
      text += fmt::format("#extension {} : require\n", extension);
    }
    text += "#include \"pass.glsl\"\n";
    text += main_ ? *main_ : fmt::format("#include \"caller/{}\"\n", join_.request->shader->file);
    join_.main = text;
  }

  const std::optional<std::string>& main_;
  JoinedText join_;
  std::vector<std::map<std::string, OwnFile>> own_files_;  // for each provider, by name below its folder
  std::vector<std::string> declared_;                      // for each provider: its ports and parameters
  std::string caller_text_;
  std::uint32_t next_binding_ = 0;  // in the providers' set
  std::vector<Diagnostic> problems_;
};

}  // namespace

std::string describe(const ShaderRequest& request) {
  return fmt::format("shader '{}' of pass '{}'", request.shader->name, request.pass);
}

std::string describe(const Provider& provider) {
  return fmt::format("function '{}' of pass '{}' ({})", provider.role->name, provider.request->pass,
                     provider.request->technique->id);
}

std::string name_of(const Provider& provider, const std::string& file) {
  if (provider.request->texts.contains(file)) return file;
  return (provider.request->folder / file).lexically_normal().string();
}

std::optional<std::string> read_file(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) return std::nullopt;
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  if (!stream) return std::nullopt;
  return std::move(text).str();
}

JoinedText join(const ShaderRequest& request, const std::optional<std::string>& main) {
  return Joiner(request, main).run();
}

std::string test_caller(const Role& role) {
  // Without the optimizer a call stays even if nobody reads its answer.
  std::string text = "layout(local_size_x = 8, local_size_y = 8) in;\n";
  std::string calls;
  for (std::size_t i = 0; i < role.functions.size(); ++i) {
    const FunctionText signature = parse_signature(role.functions[i].signature);
    std::string arguments;
    for (std::size_t j = 0; j < signature.parameter_types.size(); ++j) {
      std::string type = signature.parameter_types[j];
      for (const std::string_view direction : {"out ", "inout "}) {
        if (type.starts_with(direction)) type = type.substr(direction.size());
      }
      calls += fmt::format("  {} heddle_{}_{};\n", type, i, j);
      arguments += fmt::format("{}heddle_{}_{}", j == 0 ? "" : ", ", i, j);
    }
    const std::string result =
        signature.return_type == "void" ? "" : fmt::format("{} heddle_{} = ", signature.return_type, i);
    calls += fmt::format("  {}{}({});\n", result, role.functions[i].name, arguments);
  }
  return text + "void main() {\n" + calls + "}\n";
}

}  // namespace shader

std::string generate_pass_glsl(const ShaderRequest& request) {
  return shader::join(request).pass_glsl;
}

std::string generate_role_glsl(const ShaderRequest& request, std::string_view role) {
  const shader::JoinedText joined = shader::join(request);
  const auto found = joined.role_glsl.find(std::string(role));
  return found != joined.role_glsl.end() ? found->second : std::string();
}

}  // namespace heddle::vulkan
