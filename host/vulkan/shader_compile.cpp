// SPDX-License-Identifier: Apache-2.0
// A joined text -> SPIR-V: shaderc without its optimizer (on lavapipe it costs 10x the compile time and buys nothing),
// behind a cache on disk. Messages lead to the author's file and line; a join that fails is compiled in parts, so that
// the part which fails alone is named.
#include "vulkan/shader_source.hpp"

#include <algorithm>
#include <atomic>
#include <charconv>

#include <fmt/format.h>
#include <shaderc/shaderc.hpp>

namespace heddle::vulkan {
namespace shader {
namespace {

namespace fs = std::filesystem;

// To be raised whenever the same texts would give other words or other reflection.
constexpr std::string_view kGeneratorVersion = "heddle shader generator 3";
constexpr std::size_t kErrorsShown = 20;

std::atomic<std::uint64_t> compilations = 0;

class Includer final : public shaderc::CompileOptions::IncluderInterface {
 public:
  explicit Includer(SourceSet& sources) : sources_(sources) {}

  shaderc_include_result* GetInclude(const char* requested, shaderc_include_type, const char* requester,
                                     std::size_t) override {
    auto* answer = new Answer;
    const SourceFile* found = sources_.find(requested, requester, answer->problem);
    // An empty name says that there is no such file; the content is then the message.
    const std::string_view name = found != nullptr ? std::string_view(found->name) : std::string_view();
    const std::string_view text = found != nullptr ? std::string_view(found->text) : answer->problem;
    answer->result = {name.data(), name.size(), text.data(), text.size(), answer};
    return &answer->result;
  }
  void ReleaseInclude(shaderc_include_result* result) override { delete static_cast<Answer*>(result->user_data); }

 private:
  struct Answer {
    shaderc_include_result result{};
    std::string problem;
  };
  SourceSet& sources_;
};

struct Compilation {
  std::vector<std::uint32_t> words;
  std::string messages;  // empty: it went well
};

Compilation run_compiler(SourceSet& sources, const std::string& main, shaderc_shader_kind kind) {
  // Making a compiler builds glslang's tables, 0.1 s: one for the process, used by one thread at a time inside anyway.
  static const shaderc::Compiler compiler;
  shaderc::CompileOptions options;
  options.SetTargetEnvironment(shaderc_target_env_vulkan, shaderc_env_version_vulkan_1_3);
  options.SetTargetSpirv(shaderc_spirv_version_1_6);
  options.SetOptimizationLevel(shaderc_optimization_level_zero);
  options.SetSuppressWarnings();
  options.SetIncluder(std::make_unique<Includer>(sources));
  ++compilations;
  const auto result = compiler.CompileGlslToSpv(main, kind, std::string(kMainName).c_str(), options);
  Compilation out;
  if (result.GetCompilationStatus() == shaderc_compilation_status_success) {
    out.words.assign(result.cbegin(), result.cend());
  } else {
    out.messages = result.GetErrorMessage();
    if (out.messages.empty()) out.messages = "main: error: the compiler failed without a message";
  }
  return out;
}

// Names without the suffix that the host put behind them.
std::string without_suffixes(std::string_view message, const JoinedText& join) {
  std::string out;
  for (std::size_t at = 0; at < message.size();) {
    const auto is_part = [&](std::size_t i) {
      return i < message.size() && (std::isalnum(static_cast<unsigned char>(message[i])) != 0 || message[i] == '_');
    };
    std::size_t end = at;
    while (is_part(end)) ++end;
    if (end == at) {
      out += message[at++];
      continue;
    }
    std::string_view word = message.substr(at, end - at);
    for (const Provider& provider : join.providers) {
      if (!word.ends_with(provider.suffix)) continue;
      const std::string_view name = word.substr(0, word.size() - provider.suffix.size());
      if (provider.names.contains(name)) word = name;
    }
    out += word;
    at = end;
  }
  return out;
}

// "'foo' : undeclared identifier" -> "'foo': undeclared identifier"; "'' : x" -> "x"; of a missing file only what
// SourceSet said.
std::string tidy(std::string message) {
  if (message.starts_with("'' : ")) message = message.substr(5);
  if (message.starts_with("'#include' : ")) {
    message = message.substr(13, message.rfind(" for header name: ") - 13);
  }
  if (const std::size_t at = message.find("' : "); at != std::string::npos) message.replace(at, 4, "': ");
  const auto last = message.find_last_not_of(" \n");
  return message.substr(0, last == std::string::npos ? 0 : last + 1);
}

// The provider or the caller whose file this is; nothing for generated texts and shared files.
std::string owner_of(const std::string& file, const JoinedText& join) {
  for (const Provider& provider : join.providers) {
    for (const auto& [name, text] : provider.texts) {
      if (name_of(provider, name) == file) return describe(provider);
    }
  }
  return describe(*join.request);
}

// A line of a text that a pass made: there is no file to look it up in.
std::string line_of(const JoinedText& join, const Location& where) {
  const std::string* text = nullptr;
  const auto look = [&](const GeneratedTexts& texts) {
    const auto found = texts.find(where.file);
    if (text == nullptr && found != texts.end()) text = &found->second;
  };
  look(join.request->texts);
  for (const Provider& provider : join.providers) look(provider.request->texts);
  if (text == nullptr) return {};
  std::size_t start = 0;
  for (std::uint32_t line = 1; line < where.line && start < text->size(); ++line) start = text->find('\n', start) + 1;
  std::string found = text->substr(start, text->find('\n', start) - start);
  found.erase(0, found.find_first_not_of(" \t"));
  return found;
}

// "file:line: error: message" of shaderc, one a line.
std::vector<Diagnostic> diagnostics_of(const std::string& messages, const JoinedText& join) {
  std::vector<Diagnostic> out;
  for (std::size_t at = 0; at < messages.size();) {
    const std::size_t end = std::min(messages.find('\n', at), messages.size());
    const std::string line = messages.substr(at, end - at);
    at = end + 1;
    const std::size_t mark = line.find(": error: ");
    if (mark == std::string::npos) continue;
    Diagnostic diagnostic;
    diagnostic.where.file = line.substr(0, mark);
    if (const std::size_t colon = diagnostic.where.file.rfind(':'); colon != std::string::npos) {
      const char* const last = diagnostic.where.file.data() + diagnostic.where.file.size();
      if (std::from_chars(diagnostic.where.file.data() + colon + 1, last, diagnostic.where.line).ptr == last) {
        diagnostic.where.file.resize(colon);
      }
    }
    const std::string message = without_suffixes(tidy(line.substr(mark + 9)), join);
    if (message == "compilation terminated") continue;
    diagnostic.message = fmt::format("{}: {}", owner_of(diagnostic.where.file, join), message);
    if (diagnostic.where.file == kMainName || diagnostic.where.file == "pass.glsl" ||
        diagnostic.where.file.starts_with("role/")) {
      diagnostic.help =
          "this text is written by the host, from the descriptors of ports and parameters and from role.toml";
    }
    if (diagnostic.where.file.starts_with("generated/")) {
      diagnostic.found = line_of(join, diagnostic.where);
      diagnostic.help = "the technique made this text while it ran: it is a mistake of the technique, not of the graph";
    }
    // What the compiler says next about the same line follows from the first.
    const bool is_new = std::none_of(out.begin(), out.end(), [&](const Diagnostic& earlier) {
      return earlier.where.file == diagnostic.where.file && earlier.where.line == diagnostic.where.line;
    });
    if (is_new && out.size() < kErrorsShown) out.push_back(std::move(diagnostic));
  }
  if (out.empty()) {
    Diagnostic diagnostic;
    diagnostic.message = fmt::format("{}: {}", describe(*join.request), tidy(messages));
    out.push_back(std::move(diagnostic));
  }
  return out;
}

std::string key_of(const JoinedText& join, SourceSet& sources) {
  ContentHash hash;
  hash.add(kGeneratorVersion);
  hash.add(fmt::format("abi {}.{} kind {}{}", HEDDLE_ABI_MAJOR, HEDDLE_ABI_MINOR,
                       static_cast<int>(join.request->shader->kind), join.request->is_vertex_stage ? " vertex" : ""));
  unsigned version = 0;
  unsigned revision = 0;
  shaderc_get_spv_version(&version, &revision);
  hash.add(fmt::format("compiler {} {}", version, revision));
  hash.add(describe(*join.request));
  for (const Provider& provider : join.providers) hash.add(describe(provider));
  for (const Binding& b : join.bindings) {
    hash.add(fmt::format("{} {} {} {} {}/{}/{}", b.set, b.binding, static_cast<int>(b.kind), b.access, b.pass, b.port,
                         b.role));
  }
  for (const ConstantSlot& slot : join.constants) {
    hash.add(fmt::format("{} {} {}", slot.id, slot.parameter, slot.pass));
  }
  for (const SourceFile* file : sources.closure()) {
    hash.add(file->name);
    hash.add(file->text);
  }
  return hash.hexadecimal();
}

CompiledShader compile_join(const JoinedText& join, const fs::path& cache_folder) {
  SourceSet sources(join);
  const std::string key = cache_folder.empty() ? std::string() : key_of(join, sources);
  if (auto cached = read_cache(cache_folder, key)) return std::move(*cached);
  const bool is_fragment = join.request->shader->kind != ShaderKind::kCompute;
  const shaderc_shader_kind kind = join.request->is_vertex_stage ? shaderc_vertex_shader
                                   : is_fragment                 ? shaderc_fragment_shader
                                                                 : shaderc_compute_shader;
  Compilation compiled = run_compiler(sources, join.main, kind);
  if (!compiled.messages.empty()) throw Error(HEDDLE_BAD_INPUT, diagnostics_of(compiled.messages, join));
  CompiledShader shader;
  shader.kind = join.request->shader->kind;
  shader.spirv = std::move(compiled.words);
  reflect(join, shader);
  if (const std::string problem = write_cache(cache_folder, key, shader); !problem.empty()) {
    shader.warnings.push_back(problem);
  }
  return shader;
}

// What each part says when it is compiled without the others. Empty: every part compiles.
std::vector<Diagnostic> errors_of_parts(const ShaderRequest& request) {
  std::vector<Diagnostic> out;
  std::vector<const Role*> roles;
  for (const RoleRequest& role : request.roles) roles.push_back(role.role);
  const auto collect = [&](const auto& compile_part, std::string_view help) {
    try {
      compile_part();
    } catch (const Error& error) {
      for (Diagnostic diagnostic : error.diagnostics()) {
        if (diagnostic.help.empty()) diagnostic.help = help;
        out.push_back(std::move(diagnostic));
      }
    }
  };
  for (const RoleRequest& role : request.roles) {
    for (const ProviderRequest& provider : role.providers) {
      collect([&] { compile_with_test_caller(*role.role, provider, roles, request.shared_folders); },
              "it fails alone as well, called by a test");
    }
  }
  if (!out.empty()) return out;
  ShaderRequest neutral = request;
  for (RoleRequest& role : neutral.roles) role.providers.clear();
  collect([&] { compile_join(join(neutral), {}); }, "it fails with neutral functions as well");
  return out;
}

}  // namespace

std::vector<std::uint32_t> compile_own(std::string_view name, std::string_view text, const fs::path& cache_folder,
                                       const std::vector<fs::path>& shared_folders) {
  Technique technique;
  Shader shader_of_host;
  shader_of_host.name = name;
  // The ending says what it is, as authors' files do; the kind only says what a message may name.
  const shaderc_shader_kind kind = name.ends_with(".vert")   ? shaderc_vertex_shader
                                   : name.ends_with(".frag") ? shaderc_fragment_shader
                                                             : shaderc_compute_shader;
  shader_of_host.kind = kind == shaderc_fragment_shader ? ShaderKind::kSurfaces
                        : kind == shaderc_vertex_shader ? ShaderKind::kFullscreen
                                                        : ShaderKind::kCompute;
  ShaderRequest request;
  request.pass = "the host";
  request.technique = &technique;
  request.shader = &shader_of_host;
  request.shared_folders = shared_folders;
  JoinedText own;
  own.request = &request;
  own.main = text;
  SourceSet sources(own);
  const std::string key = cache_folder.empty() ? std::string() : key_of(own, sources);
  if (auto cached = read_cache(cache_folder, key)) return std::move(cached->spirv);
  Compilation compiled = run_compiler(sources, own.main, kind);
  if (!compiled.messages.empty()) throw Error(HEDDLE_BUG, diagnostics_of(compiled.messages, own));
  CompiledShader entry;
  entry.spirv = std::move(compiled.words);
  write_cache(cache_folder, key, entry);  // a cache that cannot be written was told with the first shader of a pass
  return std::move(entry.spirv);
}

}  // namespace shader

std::uint64_t compiler_calls() {
  return shader::compilations;
}

CompiledShader compile(const ShaderRequest& request, const std::filesystem::path& cache_folder) {
  const shader::JoinedText joined = shader::join(request);
  try {
    return shader::compile_join(joined, cache_folder);
  } catch (const Error&) {
    const bool has_providers = std::any_of(request.roles.begin(), request.roles.end(),
                                           [](const RoleRequest& role) { return !role.providers.empty(); });
    if (!has_providers) throw;
    std::vector<Diagnostic> parts = shader::errors_of_parts(request);
    if (parts.empty()) throw;  // only the whole fails: limits of a stage, most likely
    throw Error(HEDDLE_BAD_INPUT, std::move(parts));
  }
}

namespace {

/// A text of the host's that calls functions of one provider.
CompiledShader compile_caller(ShaderRequest request, std::string_view name, const Role& role,
                              const ProviderRequest& provider, const std::string& main,
                              const std::filesystem::path& cache_folder) {
  const Technique nobody;
  Shader caller;
  caller.name = name;
  caller.kind = ShaderKind::kCompute;
  request.pass = provider.pass;
  request.technique = &nobody;
  request.shader = &caller;
  request.folder = provider.folder;
  request.roles.push_back({&role, Join::kSwitch, {provider}});
  return shader::compile_join(shader::join(request, main), cache_folder);
}

}  // namespace

CompiledShader compile_program(const Role& role, const ProviderRequest& provider,
                               const std::filesystem::path& cache_folder,
                               const std::vector<std::filesystem::path>& shared_folders) {
  ShaderRequest request;
  request.shared_folders = shared_folders;
  request.is_vertex_stage = true;
  return compile_caller(std::move(request), "surface program", role, provider, shader::program_main(), cache_folder);
}

CompiledShader compile_program_evaluation(const Role& role, const ProviderRequest& provider,
                                          const std::filesystem::path& cache_folder,
                                          const std::vector<std::filesystem::path>& shared_folders) {
  ShaderRequest request;
  request.shared_folders = shared_folders;
  BoundPort evaluated;
  evaluated.port = "evaluated";
  evaluated.type = PortType::kBuffer;
  evaluated.access = HEDDLE_ACCESS_STORAGE_WRITE;
  evaluated.glsl = "HeddleVertex evaluated[];";
  request.ports.push_back(evaluated);
  return compile_caller(std::move(request), "evaluation of the surface program", role, provider,
                        shader::program_evaluation_main(), cache_folder);
}

CompiledShader compile_with_test_caller(const Role& role, const ProviderRequest& provider,
                                        const std::vector<const Role*>& callees,
                                        const std::vector<std::filesystem::path>& shared_folders) {
  ShaderRequest request;
  request.shared_folders = shared_folders;
  for (const Role* callee : callees) {
    if (callee->name != role.name) request.roles.push_back({callee, callee->join, {}});
  }
  return compile_caller(std::move(request), "test caller", role, provider, shader::test_caller(role), {});
}

}  // namespace heddle::vulkan
