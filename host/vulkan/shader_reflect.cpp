// SPDX-License-Identifier: Apache-2.0
// SPIR-V of a joined shader -> what the host must know of it: the bindings that its code really uses, sizes, and how
// many loops a driver has to compile, told apart by provider. Runs once a shader: the cache holds checked ones only.
#include "vulkan/shader_source.hpp"

#include <algorithm>
#include <functional>

#include <fmt/format.h>
#include <spirv_cross/spirv_cross.hpp>

namespace heddle::vulkan::shader {
namespace {

// The least that lavapipe 22.3 allows a stage (measured); desktop GPUs allow more.
constexpr std::uint32_t kUniformBuffersOfStage = 15;
constexpr std::uint32_t kSamplersOfStage = 32;
constexpr std::uint32_t kStorageBuffersOfStage = 32;
// Bound as a whole with surface shaders: the textures of a material; vertices, instances, materials; the view.
constexpr std::uint32_t kSamplersOfMaterials = 5, kStorageBuffersOfProgram = 3, kUniformBuffersOfProgram = 1;
// The driver's compile time grows with the cube of the number of loops: 8 take 45 ms, 16 take 650 ms on lavapipe.
constexpr std::uint32_t kLoopsWithoutWarning = 8;

// ---- a walk over the words: which functions exist, whom they call, how many loops each has ----

struct FunctionCalls {
  std::string name;
  std::uint32_t loops = 0;
  std::vector<std::uint32_t> calls;
};
struct CallGraph {
  std::uint32_t entry = 0;
  std::map<std::uint32_t, FunctionCalls> functions;
};

CallGraph read_calls(std::span<const std::uint32_t> words) {
  constexpr std::size_t kHeaderWords = 5;
  CallGraph graph;
  std::map<std::uint32_t, std::string> names;
  FunctionCalls* current = nullptr;
  for (std::size_t at = kHeaderWords; at < words.size();) {
    const std::uint32_t count = words[at] >> 16U;
    const auto operation = static_cast<spv::Op>(words[at] & 0xffffU);
    if (count == 0 || at + count > words.size()) break;
    const std::span<const std::uint32_t> operands = words.subspan(at + 1, count - 1);
    if (operation == spv::OpEntryPoint && operands.size() >= 2) {
      graph.entry = operands[1];
    } else if (operation == spv::OpName && !operands.empty()) {
      // Characters are packed four a word, the first lowest, until a zero.
      std::string& name = names[operands[0]];
      for (std::size_t i = 4; i / 4 < operands.size(); ++i) {
        const auto c = static_cast<char>((operands[i / 4] >> (8 * (i % 4))) & 0xffU);
        if (c == '\0') break;
        name += c;
      }
    } else if (operation == spv::OpFunction && operands.size() >= 2) {
      current = &graph.functions[operands[1]];
      current->name = names[operands[1]].substr(0, names[operands[1]].find('('));
    } else if (operation == spv::OpFunctionCall && operands.size() >= 3 && current != nullptr) {
      current->calls.push_back(operands[2]);
    } else if (operation == spv::OpLoopMerge && current != nullptr) {
      ++current->loops;
    }
    at += count;
  }
  return graph;
}

// Visits everything reachable from a function once, itself included, unless `enters` forbids it.
void walk(const CallGraph& graph, std::uint32_t function, std::set<std::uint32_t>& seen,
          const std::function<bool(const FunctionCalls&)>& enters) {
  const auto found = graph.functions.find(function);
  if (found == graph.functions.end() || !enters(found->second) || !seen.insert(function).second) return;
  for (const std::uint32_t callee : found->second.calls) walk(graph, callee, seen, enters);
}

std::uint32_t loops_of(const CallGraph& graph, const std::set<std::uint32_t>& functions) {
  std::uint32_t loops = 0;
  for (const std::uint32_t function : functions) loops += graph.functions.at(function).loops;
  return loops;
}

void count_loops(const JoinedText& join, CompiledShader& shader) {
  const CallGraph graph = read_calls(shader.spirv);
  std::set<std::uint32_t> reachable;
  walk(graph, graph.entry, reachable, [](const FunctionCalls&) { return true; });
  shader.loops = loops_of(graph, reachable);
  if (shader.loops <= kLoopsWithoutWarning) return;

  // A provider's loops: those of its own functions and of the shared ones that they call, not of other providers.
  const auto is_of = [](const Provider& provider, const FunctionCalls& function) {
    return function.name.ends_with(provider.suffix) &&
           provider.names.contains(
               std::string_view(function.name).substr(0, function.name.size() - provider.suffix.size()));
  };
  std::string parts;
  std::set<std::uint32_t> of_providers;
  for (const Provider& provider : join.providers) {
    std::set<std::uint32_t> own;
    for (const std::uint32_t function : reachable) {
      if (!is_of(provider, graph.functions.at(function))) continue;
      walk(graph, function, own, [&](const FunctionCalls& other) {
        const bool is_role_function =
            std::any_of(join.request->roles.begin(), join.request->roles.end(), [&](const RoleRequest& role) {
              return std::any_of(role.role->functions.begin(), role.role->functions.end(),
                                 [&](const RoleFunction& f) { return f.name == other.name; });
            });
        return !is_role_function;
      });
    }
    const std::uint32_t loops = loops_of(graph, own);
    if (loops > 0) parts += fmt::format(", {} in {}", loops, describe(provider));
    of_providers.insert(own.begin(), own.end());
  }
  shader.warnings.push_back(
      fmt::format("{} has {} loops ({} of its own{}); with more than {} the first frame waits for seconds on lavapipe",
                  describe(*join.request), shader.loops, shader.loops - loops_of(graph, of_providers), parts,
                  kLoopsWithoutWarning));
}

// ---- limits of a stage ----

class StageCount {
 public:
  StageCount(const JoinedText& join, const CompiledShader& shader) : join_(join), shader_(shader) {}

  void check() const {
    const bool is_surfaces = shader_.kind == ShaderKind::kSurfaces || join_.request->is_vertex_stage;
    const auto is = [](VkDescriptorType type) {
      return [=](const Binding& binding) { return descriptor_type(binding) == type; };
    };
    check_one("uniform buffers", kUniformBuffersOfStage, is(VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER),
              is_surfaces ? kUniformBuffersOfProgram : 0);
    check_one("samplers", kSamplersOfStage, is(VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER),
              shader_.kind == ShaderKind::kSurfaces ? kSamplersOfMaterials : 0);
    check_one("storage buffers", kStorageBuffersOfStage, is(VK_DESCRIPTOR_TYPE_STORAGE_BUFFER),
              is_surfaces ? kStorageBuffersOfProgram : 0);
  }

 private:
  void check_one(std::string_view what, std::uint32_t limit, const std::function<bool(const Binding&)>& is_counted,
                 std::uint32_t of_surfaces) const {
    std::uint32_t all = of_surfaces;
    std::map<std::uint32_t, std::uint32_t> of_provider;
    std::uint32_t own = 0;
    for (const Binding& binding : shader_.bindings) {
      if (!is_counted(binding)) continue;
      ++all;
      const auto provider = std::find_if(join_.providers.begin(), join_.providers.end(), [&](const Provider& p) {
        return binding.set != kSetOfCaller && p.request->pass == binding.pass;
      });
      if (provider == join_.providers.end()) {
        ++own;
      } else {
        ++of_provider[static_cast<std::uint32_t>(provider->index)];
      }
    }
    if (all <= limit) return;
    Diagnostic diagnostic;
    diagnostic.message = fmt::format("{} uses too many {} for one stage", describe(*join_.request), what);
    diagnostic.found = fmt::format("{}: {} of its own", all, own);
    if (of_surfaces > 0) diagnostic.found += fmt::format(", {} for surfaces", of_surfaces);
    for (const auto& [index, count] : of_provider) {
      diagnostic.found += fmt::format(", {} of {}", count, describe(join_.providers[index]));
    }
    diagnostic.expected = fmt::format("at most {}", limit);
    diagnostic.help = "use fewer providers, or split the pass";
    throw Error(HEDDLE_BAD_INPUT, std::move(diagnostic));
  }

  const JoinedText& join_;
  const CompiledShader& shader_;
};

[[noreturn]] void fail(const JoinedText& join, std::string message, std::string found, std::string expected,
                       std::string help) {
  Diagnostic diagnostic;
  const ShaderRequest& request = *join.request;
  if (!request.shader->file.empty()) diagnostic.where.file = (request.folder / request.shader->file).string();
  diagnostic.message = std::move(message);
  diagnostic.found = std::move(found);
  diagnostic.expected = std::move(expected);
  diagnostic.help = std::move(help);
  throw Error(HEDDLE_BAD_INPUT, std::move(diagnostic));
}

}  // namespace

void reflect(const JoinedText& join, CompiledShader& shader) {
  check_accesses(join, shader.spirv);
  const spirv_cross::Compiler compiler(shader.spirv);
  const auto active = compiler.get_active_interface_variables();
  const spirv_cross::ShaderResources resources = compiler.get_shader_resources(active);

  for (const auto* kind : {&resources.sampled_images, &resources.storage_images, &resources.storage_buffers,
                           &resources.uniform_buffers, &resources.separate_images, &resources.separate_samplers}) {
    for (const spirv_cross::Resource& resource : *kind) {
      const std::uint32_t set = compiler.get_decoration(resource.id, spv::DecorationDescriptorSet);
      const std::uint32_t slot = compiler.get_decoration(resource.id, spv::DecorationBinding);
      if (set == kSetOfMaterials) shader.uses_materials = true;
      const auto declared = std::find_if(join.bindings.begin(), join.bindings.end(), [&](const Binding& binding) {
        return binding.set == set && binding.binding == slot;
      });
      if (declared != join.bindings.end()) shader.bindings.push_back(*declared);
    }
  }
  std::sort(shader.bindings.begin(), shader.bindings.end(), [](const Binding& a, const Binding& b) {
    return std::pair(a.set, a.binding) < std::pair(b.set, b.binding);
  });
  for (const spirv_cross::Resource& push : resources.push_constant_buffers) {
    shader.push_bytes =
        static_cast<std::uint32_t>(compiler.get_declared_struct_size(compiler.get_type(push.base_type_id)));
  }
  if (shader.push_bytes > kPushBytes) {
    fail(join, fmt::format("{} has too many push constants", describe(*join.request)),
         fmt::format("{} bytes", shader.push_bytes), fmt::format("at most {} bytes", kPushBytes),
         "use a parameter or a value port");
  }
  if (shader.kind == ShaderKind::kCompute && !join.request->is_vertex_stage) {
    for (std::uint32_t i = 0; i < 3; ++i) {
      shader.local_size.at(i) = compiler.get_execution_mode_argument(spv::ExecutionModeLocalSize, i);
    }
  }
  shader.constants = join.constants;
  count_loops(join, shader);
  StageCount(join, shader).check();
}

}  // namespace heddle::vulkan::shader
