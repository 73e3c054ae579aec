// SPDX-License-Identifier: Apache-2.0
// Words of a joined shader + what its descriptors declare -> nothing, or one error for each binding whose code does
// more than was declared. Order, barriers and pruning follow the declarations: what they do not say must not happen.
#include "vulkan/shader_access.hpp"
#include "vulkan/shader_source.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>

namespace heddle::vulkan::shader {
namespace {

/// Bytes before a list's elements: uint heddle_list_NAME[4], of shader_generate.cpp.
constexpr std::uint32_t kListHead = 16;

struct Declared {
  bool reads = false, writes = false;
  std::string_view name;    // of the access, as descriptors spell it
  std::string_view effect;  // in words
};

Declared declared_access(const Binding& binding) {
  if (binding.kind == Binding::Kind::kParameters) return {true, false, "", "are constant during a frame"};
  if (binding.kind == Binding::Kind::kSwitchTable) return {true, false, "", "is the host's"};
  switch (binding.access) {
    case HEDDLE_ACCESS_SAMPLED:
      return {true, false, "HEDDLE_ACCESS_SAMPLED", "for reading alone"};
    case HEDDLE_ACCESS_SAMPLED_LINEAR:
      return {true, false, "HEDDLE_ACCESS_SAMPLED_LINEAR", "for reading alone"};
    case HEDDLE_ACCESS_SAMPLED_COMPARE:
      return {true, false, "HEDDLE_ACCESS_SAMPLED_COMPARE", "for reading alone"};
    case HEDDLE_ACCESS_STORAGE_READ:
      return {true, false, "HEDDLE_ACCESS_STORAGE_READ", "for reading alone"};
    case HEDDLE_ACCESS_STORAGE_WRITE:
      return {false, true, "HEDDLE_ACCESS_STORAGE_WRITE", "for writing alone"};
    case HEDDLE_ACCESS_STORAGE_READ_WRITE:
      return {true, true, "HEDDLE_ACCESS_STORAGE_READ_WRITE", "for both"};
    case HEDDLE_ACCESS_APPEND:
      return {true, true, "HEDDLE_ACCESS_APPEND", "for appending"};
    case HEDDLE_ACCESS_VALUE:
      return {true, false, "HEDDLE_ACCESS_VALUE", "as a value, which shaders only read"};
    default:
      return {};
  }
}

class Checker {
 public:
  Checker(const JoinedText& join, std::span<const std::uint32_t> words) : join_(join), found_(find_accesses(words)) {}

  void run() {
    for (const BoundVariable& variable : found_) check(variable);
    if (!problems_.empty()) throw Error(HEDDLE_BAD_INPUT, std::move(problems_));
  }

 private:
  void check(const BoundVariable& variable) {
    const auto binding = std::find_if(join_.bindings.begin(), join_.bindings.end(), [&](const Binding& b) {
      return b.set == variable.set && b.binding == variable.binding;
    });
    // Behind what all programs have is what a program of a technique's own reads.
    const bool is_of_surfaces =
        binding == join_.bindings.end() && (variable.set == kSetOfMaterials || variable.set == kSetOfProgram);
    if (is_of_surfaces ? !is_surface_variable(variable) : binding == join_.bindings.end()) {
      complain(variable, fmt::format("declares '{}', which the host did not bind", variable.name));
    } else if (is_of_surfaces) {
      if (variable.writes) complain(variable, fmt::format("writes '{}', which is the scene's", variable.name));
    } else if (!is_name_of(*binding, variable.name)) {
      complain(variable, fmt::format("declares '{}' in the place of {}", variable.name, describe_content(*binding)));
    } else {
      check_access(*binding, variable);
      check_elements(*binding, variable);
    }
  }

  /// The memory of a list is as large as its descriptor says that elements are.
  void check_elements(const Binding& binding, const BoundVariable& variable) {
    const BoundPort* list = find_list(binding);
    const bool is_known = list != nullptr && list->element_bytes != 0 && variable.element_bytes != 0;
    if (!is_known || (list->element_bytes == variable.element_bytes && variable.elements_at == kListHead)) return;
    const Author author = author_of(binding, variable);
    Diagnostic diagnostic;
    diagnostic.where.file = author.file;
    diagnostic.message = fmt::format("{} sees elements of {} bytes in the list '{}', and they have {}", author.who,
                                     variable.element_bytes, binding.port, list->element_bytes);
    diagnostic.found = list->glsl;
    diagnostic.expected = fmt::format(
        "an array of elements that std430 lays {} bytes apart, aligned to 16 bytes at most", list->element_bytes);
    diagnostic.help = "let element_bytes of who makes the list and glsl of who reads it agree";
    problems_.push_back(std::move(diagnostic));
  }

  [[nodiscard]] const BoundPort* find_list(const Binding& binding) const {
    const auto find = [&](const std::vector<BoundPort>& ports) -> const BoundPort* {
      const auto found = std::find_if(ports.begin(), ports.end(),
                                      [&](const BoundPort& port) { return port.port == binding.port && port.is_list; });
      return found == ports.end() ? nullptr : &*found;
    };
    if (binding.set == kSetOfCaller) return find(join_.request->ports);
    for (const Provider& provider : join_.providers) {
      if (provider.request->pass != binding.pass) continue;
      if (const BoundPort* list = find(provider.request->ports); list != nullptr) return list;
    }
    return nullptr;
  }

  [[nodiscard]] bool is_surface_variable(const BoundVariable& variable) const {
    constexpr std::array<std::string_view, 8> kNames{
        "texture_base_color", "texture_metallic_roughness", "texture_normal", "texture_occlusion", "texture_emissive",
        "HeddleMaterials",    "HeddleSurfaceView",          "HeddleInstances"};
    return (join_.request->shader->kind == ShaderKind::kSurfaces || join_.request->is_vertex_stage) &&
           (variable.name.empty() || std::find(kNames.begin(), kNames.end(), variable.name) != kNames.end());
  }

  /// Whether the host gave this name to the binding. Words without names pass.
  [[nodiscard]] bool is_name_of(const Binding& binding, std::string_view name) const {
    if (name.empty()) return true;
    std::vector<std::string> suffixes;
    if (binding.set == kSetOfCaller) suffixes.emplace_back();
    for (const Provider& provider : join_.providers) {
      if (binding.set != kSetOfCaller && provider.request->pass == binding.pass) suffixes.push_back(provider.suffix);
    }
    const std::string port = glsl_name(binding.port);
    const auto is = [&](std::string_view prefix, const std::string& base) {
      return std::any_of(suffixes.begin(), suffixes.end(),
                         [&](const std::string& suffix) { return name == std::string(prefix) + base + suffix; });
    };
    switch (binding.kind) {
      case Binding::Kind::kSampledImage:
      case Binding::Kind::kStorageImage:
        return is("", port);
      case Binding::Kind::kUniformBuffer:
      case Binding::Kind::kStorageBuffer:
        return is("HeddleValue_", port) || is("HeddleBuffer_", port);
      case Binding::Kind::kParameters:
        return is("", "params");
      case Binding::Kind::kSwitchTable:
        return name == "HeddleProviderOf_" + binding.role;
    }
    return false;
  }

  static std::string describe_content(const Binding& binding) {
    if (binding.kind == Binding::Kind::kParameters) return fmt::format("the parameters of pass '{}'", binding.pass);
    if (binding.kind == Binding::Kind::kSwitchTable) return fmt::format("the table of role '{}'", binding.role);
    return fmt::format("port '{}'", binding.port);
  }

  void check_access(const Binding& binding, const BoundVariable& variable) {
    const Declared declared = declared_access(binding);
    const bool reads_too_much = variable.reads && !declared.reads;
    const bool writes_too_much = variable.writes && !declared.writes;
    const Author author = author_of(binding, variable);
    if (reads_too_much || writes_too_much) {
      Diagnostic diagnostic;
      diagnostic.where.file = author.file;
      const std::string_view verb = reads_too_much ? "reads" : "writes";
      diagnostic.message = fmt::format("{} {} {}, which {} declares {}", author.who, verb, describe_content(binding),
                                       author.declarer, declared.effect);
      if (binding.port.empty()) {
        diagnostic.message =
            fmt::format("{} {} {}, which {}", author.who, verb, describe_content(binding), declared.effect);
        diagnostic.help = "keep what changes in a port";
      } else if (binding.access == HEDDLE_ACCESS_VALUE) {
        diagnostic.found = declared.name;
        diagnostic.expected = "a buffer port";
        diagnostic.help = "values are made on the CPU; let a stage write a buffer, and declare storage_write for it";
      } else {
        diagnostic.found = fmt::format("{}, and code that {} it", declared.name,
                                       variable.reads && variable.writes ? "reads and writes" : verb);
        diagnostic.expected = "HEDDLE_ACCESS_STORAGE_READ_WRITE";
        diagnostic.help = fmt::format("declare storage_read_write(\"{}\") for {}{}", binding.port, author.declarer,
                                      reads_too_much ? "; an atomic operation reads too" : "");
      }
      problems_.push_back(std::move(diagnostic));
    } else if (variable.reads_without_format) {
      Diagnostic diagnostic;
      diagnostic.where.file = author.file;
      diagnostic.message =
          fmt::format("{} reads {} as a storage image without a format", author.who, describe_content(binding));
      diagnostic.expected = "an image declared by the host with the port's format";
      diagnostic.help = "few devices can do this; declare the port as SAMPLED, or give the output another format";
      problems_.push_back(std::move(diagnostic));
    }
  }

  struct Author {
    std::string file, who, declarer;
  };
  /// Whose text touches the binding: a provider's, or the caller's.
  [[nodiscard]] Author author_of(const Binding& binding, const BoundVariable& variable) const {
    if (binding.set != kSetOfCaller && binding.kind != Binding::Kind::kSwitchTable) {
      for (const Provider& provider : join_.providers) {
        if (provider.request->pass == binding.pass && variable.name.ends_with(provider.suffix))
          return {provider.file.string(), describe(provider), "the function"};
      }
    }
    const ShaderRequest& request = *join_.request;
    return {caller_file(), describe(request), fmt::format("stage '{}'", request.shader->stage)};
  }

  [[nodiscard]] std::string caller_file() const {
    const ShaderRequest& request = *join_.request;
    return request.shader->file.empty() ? "" : (request.folder / request.shader->file).string();
  }

  void complain(const BoundVariable& variable, std::string what) {
    Diagnostic diagnostic;
    diagnostic.where.file = caller_file();
    diagnostic.message = fmt::format("{} {}", describe(*join_.request), std::move(what));
    diagnostic.found = fmt::format("set {}, binding {}", variable.set, variable.binding);
    diagnostic.help = "declare a port: the host binds what descriptors list";
    problems_.push_back(std::move(diagnostic));
  }

  const JoinedText& join_;
  std::vector<BoundVariable> found_;
  std::vector<Diagnostic> problems_;
};

}  // namespace

void check_accesses(const JoinedText& join, std::span<const std::uint32_t> words) {
  Checker(join, words).run();
}

}  // namespace heddle::vulkan::shader
