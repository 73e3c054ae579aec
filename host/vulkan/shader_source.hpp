// SPDX-License-Identifier: Apache-2.0
// The plain structures between a ShaderRequest and the compiler: what is declared for a pass, the joined plan with
// every generated text, and the files that includes find. Internal to the shader sources of this folder.
#pragma once

#include "content_hash.hpp"
#include "vulkan/shader.hpp"
#include "vulkan/shader_text.hpp"

#include <map>
#include <optional>
#include <set>

namespace heddle::vulkan::shader {

inline constexpr std::uint32_t kSetOfCaller = 0, kSetOfProviders = 1, kSetOfMaterials = 2, kSetOfProgram = kProgramSet;
inline constexpr std::uint32_t kBindingOfMaterials = 2, kBindingOfView = 3;  // in kSetOfProgram
/// Bytes of push constants that a shader may declare (plugin.h).
inline constexpr std::uint32_t kPushBytes = 64;
/// Specialization constants of providers are numbered from here on; the compiler allows ids below 2048.
inline constexpr std::uint32_t kConstantsOfProviders = 1024;

// ---- shader_generate.cpp ----

/// For whom ports and parameters are declared.
struct Scope {
  std::string_view pass;
  std::string_view who;  // for messages: "stage 'light' of pass 'deferred'"
  const Technique* technique = nullptr;
  std::span<const BoundPort> ports;
  std::string_view suffix;  // behind every name; "" for callers
  std::uint32_t set = 0;
  std::uint32_t first_binding = 0;
  // Id of the first constant; the others follow. Without: the caller's, whose ids are the parameters' indices.
  std::optional<std::uint32_t> first_constant;
};
struct Declarations {
  std::string text;
  std::vector<Binding> bindings;
  std::vector<ConstantSlot> constants;
  std::set<std::string, std::less<>> names;  // without suffix
};
/// Ports (bindings, accessors), parameters and constants. Throws Error(HEDDLE_BAD_INPUT) where an access cannot be.
Declarations declare(const Scope& scope);
/// What the kind of shader adds: `uv`, `surface` and the textures of materials.
std::string declare_kind(ShaderKind kind);
/// A float as GLSL writes it: "1.0", "uintBitsToFloat(0x7f800000u)" for Inf.
std::string glsl_float(double value);

// ---- shader_join.cpp ----

/// One provider of one role, its files renamed.
struct Provider {
  std::size_t index = 0;  // over all roles of the join
  const Role* role = nullptr;
  const ProviderRequest* request = nullptr;
  const Function* function = nullptr;
  std::string suffix;                                    // "_p0"
  std::filesystem::path file;                            // the function's file, as messages name it
  std::map<std::string, std::string> texts;              // name below the technique's folder -> renamed text
  std::set<std::string, std::less<>> names;              // what was renamed
  std::set<std::string, std::less<>> missing_functions;  // of the role, in a newer revision than the provider knows
};

/// A request with everything that the host writes for it.
struct JoinedText {
  const ShaderRequest* request = nullptr;
  std::string main;  // what the compiler is started on; includes the author's file
  std::string pass_glsl;
  std::map<std::string, std::string> role_glsl;  // by role
  std::vector<Provider> providers;
  std::vector<Binding> bindings;  // all that are declared in sets 0 and 1
  std::vector<ConstantSlot> constants;
};
/// Reads and checks the providers' files, then writes all texts. Throws Error(HEDDLE_BAD_INPUT) with every mistake that
/// the texts alone show. `main`: in place of the author's file, for test callers.
JoinedText join(const ShaderRequest& request, const std::optional<std::string>& main = {});
/// A compute shader that calls every function of a role once.
std::string test_caller(const Role& role);
/// "shader 'light' of pass 'deferred'", "function 'shadow' of pass 'sun' (shadow/shadow_map)".
std::string describe(const ShaderRequest& request);
std::string describe(const Provider& provider);
/// How messages name a text below the provider's folder: the file, or "generated/NAME.glsl" of a text that it made.
std::string name_of(const Provider& provider, const std::string& file);
/// Whole file; nothing if it cannot be read.
std::optional<std::string> read_file(const std::filesystem::path& file);

// ---- shader_include.cpp ----

struct SourceFile {
  std::string name;  // as messages name it
  std::string text;
};
/// Finds what includes mean in one join: the generated texts, the providers' renamed files, files of the technique's
/// folder and of the shared folders. Reads each file once.
class SourceSet {
 public:
  explicit SourceSet(const JoinedText& join) : join_(join) {}
  /// `requester`: name of the including file. Returns nullptr and fills `problem` if there is none.
  const SourceFile* find(std::string_view requested, std::string_view requester, std::string& problem);
  /// Every text that the compiler may read, from the main text on, in a fixed order: what a cache key is made of.
  std::vector<const SourceFile*> closure();

 private:
  const SourceFile* file(const std::filesystem::path& path);
  const SourceFile* generated(const std::string& name, const std::string& text);
  const JoinedText& join_;
  std::map<std::string, SourceFile, std::less<>> files_;
};
/// Name under which the main text is known to the compiler.
inline constexpr std::string_view kMainName = "main";

// ---- shader_cache.cpp ----

/// Nothing if there is no entry, or if it is damaged.
std::optional<CompiledShader> read_cache(const std::filesystem::path& folder, const std::string& key);
/// Written under a temporary name and renamed. Says in words what went wrong, or nothing.
std::string write_cache(const std::filesystem::path& folder, const std::string& key, const CompiledShader& shader);

// ---- shader_reflect.cpp ----

/// Fills bindings, local_size, push_bytes, loops, uses_materials and the warning about loops from spirv. Throws
/// Error(HEDDLE_BAD_INPUT) for a binding that the host did not assign and for what exceeds a stage's limits.
void reflect(const JoinedText& join, CompiledShader& shader);

// ---- shader_access_check.cpp ----

/// Refuses code that touches what its descriptor does not declare, and bindings that the host did not write: throws
/// Error(HEDDLE_BAD_INPUT) with every such binding. What is declared and never touched is no mistake.
void check_accesses(const JoinedText& join, std::span<const std::uint32_t> words);

// ---- surface_program.cpp ----

/// What calls a technique's own program: a vertex stage, and a compute shader.
std::string program_main();
std::string program_evaluation_main();

// ---- shader_compile.cpp ----

/// Text of the host itself (no author to blame): words of SPIR-V, through the cache.
std::vector<std::uint32_t> compile_own(std::string_view name, std::string_view text,
                                       const std::filesystem::path& cache_folder,
                                       const std::vector<std::filesystem::path>& shared_folders);

}  // namespace heddle::vulkan::shader
