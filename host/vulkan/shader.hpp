// SPDX-License-Identifier: Apache-2.0
// Shader text -> SPIR-V with known bindings: writes "pass.glsl" for each shader, joins functions of roles from the
// providers of a graph, compiles (shaderc, cached by content on disk), reflects.
//
// Set 0: the caller's own ports and parameters.  Set 1: everything that providers of functions read (host-assigned
// bindings, one set for all).  Set 2: textures of materials (surface shaders).  Set 3: what surface programs read.
#pragma once

#include "plugin/registry.hpp"
#include "vulkan/device.hpp"
#include "vulkan/pipeline_store.hpp"

namespace heddle::vulkan {

/// What is bound to a port, as far as shaders care.
struct BoundPort {
  std::string port;
  std::uint32_t access = 0;  // HEDDLE_ACCESS_*
  PortType type = PortType::kImage;
  bool is_bound = true;  // false: only fetch_NAME / sample_NAME, answering `neutral`
  VkFormat format = VK_FORMAT_UNDEFINED;
  std::uint32_t layers = 1;
  bool is_cube = false;
  std::array<double, 4> neutral{0, 0, 0, 0};
  std::string glsl;         // members of a buffer's or value's block
  std::string types;        // what `glsl` needs before it: then the block is a component, an element an owner
  std::uint32_t blend = 0;  // HEDDLE_BLEND_*
  bool is_list = false;
  std::uint32_t element_bytes = 0;  // of a list; 0: not known
};

/// Texts that a pass made while it ran, by what includes call them: "generated/NAME.glsl". Each takes the place of the
/// file of that name in the technique's folder.
using GeneratedTexts = std::map<std::string, std::string, std::less<>>;

/// One provider of a role's functions for one caller.
struct ProviderRequest {
  std::string pass;  // name of the pass, for messages and as suffix of names
  const Technique* technique = nullptr;
  std::filesystem::path folder;  // of the technique's shaders
  std::vector<BoundPort> ports;  // of the function's accesses
  GeneratedTexts texts;
};

struct RoleRequest {
  const Role* role = nullptr;
  Join join = Join::kSwitch;
  std::vector<ProviderRequest> providers;  // empty: the neutral body
};

/// What a shader needs to be compiled in one graph.
struct ShaderRequest {
  std::string pass;  // for messages
  const Technique* technique = nullptr;
  const Shader* shader = nullptr;  // of technique
  std::filesystem::path folder;
  std::vector<BoundPort> ports;  // of the shader's stage, in the stage's order
  // Every role that the shader or a provider of it calls, callees first (a provider's own calls are flattened in).
  std::vector<RoleRequest> roles;
  std::vector<std::filesystem::path> shared_folders;  // <heddle/records.h> and plugins/shared are found from here
  GeneratedTexts texts;
  bool is_vertex_stage =
      false;  // of a surface program: what providers read lies in set 3, behind what all programs have
};

/// Where a binding's content comes from.
struct Binding {
  enum class Kind : std::uint8_t {
    kSampledImage,  // combined image sampler
    kStorageImage,
    kStorageBuffer,  // buffer ports; value ports whose block ends in an unsized array
    kUniformBuffer,  // other value ports
    kParameters,     // block with the pass's parameters, in declaration order (ParameterLayout)
    kSwitchTable,    // storage buffer, uint for each key: which provider of `role` serves it
  };
  std::uint32_t set = 0, binding = 0;
  Kind kind = Kind::kSampledImage;
  std::string pass;  // whose port or parameters: the caller's or a provider's name
  std::string port;
  std::string role;  // kSwitchTable
  std::uint32_t access = 0;
  bool operator==(const Binding&) const = default;
};

/// How a binding is bound. Values and parameters of providers (set 1) are storage blocks: lavapipe (Mesa 22.3)
/// keeps the offsets of uniforms that branches depend on in a table that is too small, and writes past it from a
/// stage's fourth uniform block on; joined shaders have many.
VkDescriptorType descriptor_type(const Binding& binding);

/// Byte offsets of parameters in the block `params`, std140; HEDDLE_PARAMETER_CONSTANT ones are specialization
/// constants (id = index of the parameter) and not in the block, names never are.
struct ParameterLayout {
  std::vector<std::uint32_t> offset;  // parallel to technique.parameters; 0xffffffff: not in the block
  std::uint32_t size = 0;             // multiple of 16; 0: no block
};
ParameterLayout parameter_layout(const Technique& technique);

/// A specialization constant and the parameter it stands for. The caller's have the parameter's index as id, those of
/// providers an id of their own.
struct ConstantSlot {
  std::uint32_t id = 0;
  std::string pass;             // whose parameter: the caller's or a provider's name
  std::uint32_t parameter = 0;  // index in technique.parameters
  bool operator==(const ConstantSlot&) const = default;
};

struct CompiledShader {
  ShaderKind kind = ShaderKind::kCompute;
  std::vector<std::uint32_t> spirv;  // compute or fragment; empty: depth only without alpha masks
  std::vector<Binding> bindings;     // those the code really uses
  std::array<std::uint32_t, 3> local_size{1, 1, 1};
  std::uint32_t push_bytes = 0;
  std::uint32_t loops = 0;              // loops in the joined text's functions that are reachable
  bool uses_materials = false;          // set 2 is used
  std::vector<std::string> warnings;    // e.g. more than eight loops, with the names of the providers
  std::vector<ConstantSlot> constants;  // those the joined text declares
  bool is_from_cache = false;
};

/// Compiles, or takes from the cache folder. Errors of the text name the author's file, line and the pass; a join that
/// fails is narrowed down to the provider that fails alone. Throws Error(HEDDLE_BAD_INPUT).
/// An empty cache folder: no cache.
CompiledShader compile(const ShaderRequest& request, const std::filesystem::path& cache_folder);

/// Compiles one provider's functions with a generated compute shader that calls each of them; functions of other roles
/// (`callees`) have neutral bodies. No cache. Throws as compile does.
CompiledShader compile_with_test_caller(const Role& role, const ProviderRequest& provider,
                                        const std::vector<const Role*>& callees,
                                        const std::vector<std::filesystem::path>& shared_folders);

/// How often this process has called the compiler of GLSL: a cache hit does not.
std::uint64_t compiler_calls();

/// The text that compile would hand to the compiler for `#include "pass.glsl"` and for a role: for tests and explain.
std::string generate_pass_glsl(const ShaderRequest& request);
std::string generate_role_glsl(const ShaderRequest& request, std::string_view role);

/// Values of the specialization constants, by ConstantSlot::id (the caller's: index of the parameter).
using Constants = std::map<std::uint32_t, std::uint32_t>;  // raw 32 bits

/// Vertex stages of surface programs and the host's own depth-only fragment shader with alpha test.
struct SurfaceProgram {
  std::vector<std::uint32_t> vertex;           // position and all fields of the surface block
  std::vector<std::uint32_t> masked_fragment;  // depth only: discards below the cutoff (set 2)
  Constants constants;                         // of the vertex stage
  bool operator==(const SurfaceProgram&) const = default;
};
/// The program of meshes: pulls HeddleVertex and HeddleInstance from storage buffers (set 3: 0 vertices, 1 instances,
/// 2 materials), the view from push constants' uniform (set 3: 3, dynamic offset), instance by gl_InstanceIndex.
SurfaceProgram mesh_program(const std::filesystem::path& cache_folder,
                            const std::vector<std::filesystem::path>& shared_folders);

/// A technique's own vertex stage: as mesh_program's, but set 3 has no vertices, and from kFirstOfProgram on what the
/// provider reads (CompiledShader::bindings). Throws as compile does.
inline constexpr std::uint32_t kProgramSet = 3, kFirstOfProgram = 4;
CompiledShader compile_program(const Role& role, const ProviderRequest& provider,
                               const std::filesystem::path& cache_folder,
                               const std::vector<std::filesystem::path>& shared_folders);
/// The same functions for the first `count` (pushed: uint) vertices into HeddleVertex[] (set 0, binding 0), for
/// snapshots; `local_size` invocations in x.
CompiledShader compile_program_evaluation(const Role& role, const ProviderRequest& provider,
                                          const std::filesystem::path& cache_folder,
                                          const std::vector<std::filesystem::path>& shared_folders);

/// The host's own: an element count on the GPU -> the work groups of a dispatch over so many. Set 0: the list, and
/// the VkDispatchIndirectCommand; pushed: ListGroups.
CompiledShader list_groups_shader(const std::filesystem::path& cache_folder);
struct ListGroups {
  std::uint32_t capacity = 0, local_size = 1;
};

// ---- pipelines ----

/// A use of a pipeline that the device's store has; move-only. Before it ends the device is done with it.
class Pipeline {
 public:
  Pipeline() = default;
  Pipeline(Pipeline&& other) noexcept;
  Pipeline& operator=(Pipeline&& other) noexcept;
  ~Pipeline();
  [[nodiscard]] VkPipeline handle() const { return objects().pipeline; }
  [[nodiscard]] VkPipelineLayout layout() const { return objects().layout; }
  [[nodiscard]] VkDescriptorSetLayout set_layout(std::uint32_t set) const { return objects().sets.at(set); }
  [[nodiscard]] VkPipelineBindPoint bind_point() const { return objects().bind_point; }
  /// Somebody else had it made.
  [[nodiscard]] bool was_there() const { return was_there_; }
  explicit operator bool() const { return shared_ != nullptr; }

 private:
  friend class PipelineMaker;
  static constexpr PipelineObjects kNone{};
  [[nodiscard]] const PipelineObjects& objects() const { return shared_ != nullptr ? shared_->second.objects : kNone; }
  PipelineStore* store_ = nullptr;
  PipelineStore::Shared* shared_ = nullptr;
  bool was_there_ = false;
};

struct RasterState {
  std::vector<VkFormat> color_formats;
  std::vector<std::uint32_t> blends;  // HEDDLE_BLEND_* of each; shorter: NONE
  VkFormat depth_format = VK_FORMAT_UNDEFINED;
  bool depth_write = true;
  VkCompareOp depth_compare = VK_COMPARE_OP_GREATER_OR_EQUAL;
  float depth_bias_constant = 0, depth_bias_slope = 0;
  bool operator==(const RasterState&) const = default;
};

/// Makes pipelines of one device, where its store has none that is the same. Viewport, scissor, and for surfaces cull
/// mode and front face, are dynamic.
class PipelineMaker {
 public:
  /// `cache_folder`: for the host's own vertex shader; empty: compiled at first need.
  explicit PipelineMaker(Device& device, std::filesystem::path cache_folder = {});
  Pipeline compute(const CompiledShader& shader, const Constants& constants);
  Pipeline fullscreen(const CompiledShader& shader, const Constants& constants, const RasterState& state);
  /// `fragment.spirv` may be empty (depth only, opaque). Set layouts 2 and 3 are the store's.
  Pipeline surfaces(const SurfaceProgram& program, const CompiledShader& fragment, const Constants& constants,
                    const RasterState& state, VkDescriptorSetLayout materials, VkDescriptorSetLayout program_set);
  Pipeline surfaces_masked_depth(const SurfaceProgram& program, const RasterState& state,
                                 VkDescriptorSetLayout materials, VkDescriptorSetLayout program_set);

 private:
  struct Wanted;
  Pipeline shared(const Wanted& wanted);
  [[nodiscard]] VkPipeline make_compute(const Wanted& wanted, VkPipelineLayout layout) const;
  [[nodiscard]] VkPipeline make_graphics(const Wanted& wanted, VkPipelineLayout layout) const;
  Device* device_;
  std::filesystem::path cache_folder_;
  std::vector<std::uint32_t> fullscreen_vertex_;
};

}  // namespace heddle::vulkan
