// SPDX-License-Identifier: Apache-2.0
// Compiled shaders and raster state -> pipelines with their layouts.
#include "vulkan/shader_source.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <utility>

namespace heddle::vulkan {
namespace {

constexpr std::string_view kFullscreenVertex = R"(#version 460
layout(location = 0) out vec2 uv;
void main() {
  // One triangle over the whole target; z = 0 is infinitely far in reversed depth.
  uv = vec2((gl_VertexIndex << 1) & 2, gl_VertexIndex & 2);
  gl_Position = vec4(uv * 2.0 - 1.0, 0.0, 1.0);
}
)";

}  // namespace

VkDescriptorType descriptor_type(const Binding& binding) {
  switch (binding.kind) {
    case Binding::Kind::kSampledImage:
      return VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
    case Binding::Kind::kStorageImage:
      return VK_DESCRIPTOR_TYPE_STORAGE_IMAGE;
    case Binding::Kind::kStorageBuffer:
    case Binding::Kind::kSwitchTable:
      return VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    case Binding::Kind::kUniformBuffer:
    case Binding::Kind::kParameters:
      break;
  }
  return binding.set != shader::kSetOfCaller ? VK_DESCRIPTOR_TYPE_STORAGE_BUFFER : VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER;
}

namespace {

// Set layouts of one shader's bindings: those of sets 0 .. `count`-1 that are not given, empty ones where nothing is.
void find_set_layouts(Device& device, const std::vector<Binding>& bindings, std::uint32_t count,
                      VkShaderStageFlags stage, std::array<VkDescriptorSetLayout, 4>& sets) {
  for (std::uint32_t set = 0; set < count; ++set) {
    if (sets.at(set) != VK_NULL_HANDLE) continue;
    std::vector<VkDescriptorSetLayoutBinding> slots;
    for (const Binding& binding : bindings) {
      if (binding.set == set) slots.push_back({binding.binding, descriptor_type(binding), 1, stage, nullptr});
    }
    sets.at(set) = device.pipelines().set_layout(slots);
  }
}

VkPipelineLayout make_layout(Device& device, std::span<const VkDescriptorSetLayout> sets, VkShaderStageFlags stage,
                             std::uint32_t push_bytes) {
  const heddle_vulkan& vk = device.table();
  const VkPushConstantRange range{stage, 0, (push_bytes + 3) / 4 * 4};
  VkPipelineLayoutCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO};
  info.setLayoutCount = static_cast<std::uint32_t>(sets.size());
  info.pSetLayouts = sets.data();
  info.pushConstantRangeCount = push_bytes > 0 ? 1 : 0;
  info.pPushConstantRanges = &range;
  VkPipelineLayout layout = VK_NULL_HANDLE;
  check(vk.CreatePipelineLayout(vk.device, &info, nullptr, &layout), "vkCreatePipelineLayout");
  return layout;
}

std::uint32_t sets_used(const std::vector<Binding>& bindings) {
  std::uint32_t count = 0;
  for (const Binding& binding : bindings) count = std::max(count, binding.set + 1);
  return count;
}

class Module {
 public:
  Module(Device& device, std::span<const std::uint32_t> words) : device_(device) {
    VkShaderModuleCreateInfo info{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
    info.codeSize = words.size_bytes();
    info.pCode = words.data();
    check(device.table().CreateShaderModule(device.table().device, &info, nullptr, &module_), "vkCreateShaderModule");
  }
  ~Module() { device_.table().DestroyShaderModule(device_.table().device, module_, nullptr); }
  Module(const Module&) = delete;
  Module& operator=(const Module&) = delete;
  [[nodiscard]] VkShaderModule handle() const { return module_; }

 private:
  Device& device_;
  VkShaderModule module_ = VK_NULL_HANDLE;
};

// Specialization data; alive while the pipeline is made. Ids that a shader does not have are ignored by Vulkan.
struct Specialization {
  explicit Specialization(const Constants& constants) {
    for (const auto& [id, bits] : constants) {
      entries.push_back({id, static_cast<std::uint32_t>(4 * values.size()), 4});
      values.push_back(bits);
    }
    info.mapEntryCount = static_cast<std::uint32_t>(entries.size());
    info.pMapEntries = entries.data();
    info.dataSize = 4 * values.size();
    info.pData = values.data();
  }
  std::vector<VkSpecializationMapEntry> entries;
  std::vector<std::uint32_t> values;
  VkSpecializationInfo info{};
};

VkPipelineShaderStageCreateInfo stage_info(VkShaderStageFlagBits stage, const Module& module,
                                           const Specialization* constants) {
  VkPipelineShaderStageCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO};
  info.stage = stage;
  info.module = module.handle();
  info.pName = "main";
  info.pSpecializationInfo = constants != nullptr ? &constants->info : nullptr;
  return info;
}

}  // namespace

namespace {

VkPipelineColorBlendAttachmentState blend_state(std::uint32_t blend) {
  // New and old colour are weighed and added; alpha is treated as a fourth colour.
  constexpr std::array<std::array<VkBlendFactor, 2>, 6> kFactors{{
      // In the order of HEDDLE_BLEND_*.
      {VK_BLEND_FACTOR_ONE, VK_BLEND_FACTOR_ZERO},
      {VK_BLEND_FACTOR_ONE, VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA},
      {VK_BLEND_FACTOR_ONE, VK_BLEND_FACTOR_ONE},
      {VK_BLEND_FACTOR_ZERO, VK_BLEND_FACTOR_SRC_COLOR},
      {VK_BLEND_FACTOR_ONE, VK_BLEND_FACTOR_SRC1_COLOR},
      {VK_BLEND_FACTOR_CONSTANT_COLOR, VK_BLEND_FACTOR_ONE_MINUS_CONSTANT_COLOR},
  }};
  VkPipelineColorBlendAttachmentState state{};
  state.blendEnable = blend != HEDDLE_BLEND_NONE ? VK_TRUE : VK_FALSE;
  state.srcColorBlendFactor = kFactors.at(blend)[0];
  state.dstColorBlendFactor = kFactors.at(blend)[1];
  state.srcAlphaBlendFactor = blend == HEDDLE_BLEND_MULTIPLY   ? VK_BLEND_FACTOR_ZERO
                              : blend == HEDDLE_BLEND_CONSTANT ? VK_BLEND_FACTOR_CONSTANT_ALPHA
                                                               : VK_BLEND_FACTOR_ONE;
  state.dstAlphaBlendFactor = blend == HEDDLE_BLEND_MULTIPLY   ? VK_BLEND_FACTOR_SRC_ALPHA
                              : blend == HEDDLE_BLEND_TINT     ? VK_BLEND_FACTOR_SRC1_ALPHA
                              : blend == HEDDLE_BLEND_CONSTANT ? VK_BLEND_FACTOR_ONE_MINUS_CONSTANT_ALPHA
                                                               : state.dstColorBlendFactor;
  state.colorWriteMask =
      VK_COLOR_COMPONENT_R_BIT | VK_COLOR_COMPONENT_G_BIT | VK_COLOR_COMPONENT_B_BIT | VK_COLOR_COMPONENT_A_BIT;
  return state;
}

}  // namespace

Pipeline::Pipeline(Pipeline&& other) noexcept {
  *this = std::move(other);
}

Pipeline& Pipeline::operator=(Pipeline&& other) noexcept {
  std::swap(store_, other.store_);
  std::swap(shared_, other.shared_);
  std::swap(was_there_, other.was_there_);
  return *this;
}

Pipeline::~Pipeline() {
  if (shared_ != nullptr) store_->give_back(*shared_);
}

/// Everything that a pipeline is made of.
struct PipelineMaker::Wanted {
  VkShaderStageFlags stage = VK_SHADER_STAGE_COMPUTE_BIT;  // of code, bindings and pushed bytes
  std::span<const std::uint32_t> code, vertex;             // no vertex stage: a compute shader
  const Constants* constants = nullptr;
  const Constants* vertex_constants = nullptr;
  const RasterState* raster = nullptr;
  bool is_surfaces = false;
  std::array<VkDescriptorSetLayout, 4> sets{};
  std::uint32_t set_count = 0, push_bytes = 0;

  [[nodiscard]] std::string key() const {
    std::vector<std::uint32_t> plain{stage, is_surfaces ? 1U : 0U, push_bytes, set_count};
    const auto add_constants = [&](const Constants* values) {
      plain.push_back(values != nullptr ? static_cast<std::uint32_t>(values->size()) : 0);
      if (values == nullptr) return;
      for (const auto& [id, bits] : *values) plain.insert(plain.end(), {id, bits});
    };
    add_constants(constants);
    add_constants(vertex_constants);
    for (std::uint32_t set = 0; set < set_count; ++set) {  // the same handle is the same layout
      const auto handle = std::bit_cast<std::uint64_t>(sets.at(set));
      plain.insert(plain.end(), {static_cast<std::uint32_t>(handle), static_cast<std::uint32_t>(handle >> 32U)});
    }
    if (raster != nullptr) {
      plain.push_back(static_cast<std::uint32_t>(raster->color_formats.size()));
      for (const VkFormat format : raster->color_formats) plain.push_back(static_cast<std::uint32_t>(format));
      plain.push_back(static_cast<std::uint32_t>(raster->blends.size()));
      plain.insert(plain.end(), raster->blends.begin(), raster->blends.end());
      plain.insert(plain.end(), {static_cast<std::uint32_t>(raster->depth_format), raster->depth_write ? 1U : 0U,
                                 static_cast<std::uint32_t>(raster->depth_compare),
                                 std::bit_cast<std::uint32_t>(raster->depth_bias_constant),
                                 std::bit_cast<std::uint32_t>(raster->depth_bias_slope)});
    }
    ContentHash hash;
    for (const std::span<const std::uint32_t> words : {std::span<const std::uint32_t>(plain), code, vertex})
      hash.add_long(std::as_bytes(words));
    return hash.hexadecimal();
  }
};

PipelineMaker::PipelineMaker(Device& device, std::filesystem::path cache_folder)
    : device_(&device), cache_folder_(std::move(cache_folder)) {}

Pipeline PipelineMaker::shared(const Wanted& wanted) {
  PipelineStore& store = device_->pipelines();
  const std::string key = wanted.key();
  Pipeline pipeline;
  pipeline.store_ = &store;
  pipeline.shared_ = store.take(key);
  pipeline.was_there_ = pipeline.shared_ != nullptr;
  if (pipeline.was_there_) return pipeline;
  PipelineObjects made;
  made.sets = wanted.sets;
  made.layout = make_layout(*device_, std::span(wanted.sets).first(wanted.set_count), wanted.stage, wanted.push_bytes);
  try {
    if (wanted.vertex.empty()) {
      made.pipeline = make_compute(wanted, made.layout);
    } else {
      made.bind_point = VK_PIPELINE_BIND_POINT_GRAPHICS;
      made.pipeline = make_graphics(wanted, made.layout);
    }
  } catch (...) {
    device_->table().DestroyPipelineLayout(device_->table().device, made.layout, nullptr);
    throw;
  }
  pipeline.shared_ = store.add(key, made);
  return pipeline;
}

Pipeline PipelineMaker::compute(const CompiledShader& shader, const Constants& constants) {
  Wanted wanted;
  wanted.code = shader.spirv;
  wanted.constants = &constants;
  wanted.set_count = sets_used(shader.bindings);
  wanted.push_bytes = shader.push_bytes;
  find_set_layouts(*device_, shader.bindings, wanted.set_count, wanted.stage, wanted.sets);
  return shared(wanted);
}

Pipeline PipelineMaker::fullscreen(const CompiledShader& shader, const Constants& constants, const RasterState& state) {
  if (fullscreen_vertex_.empty()) {
    fullscreen_vertex_ = shader::compile_own("fullscreen.vert", kFullscreenVertex, cache_folder_, {});
  }
  Wanted wanted;
  wanted.stage = VK_SHADER_STAGE_FRAGMENT_BIT;
  wanted.code = shader.spirv;
  wanted.vertex = fullscreen_vertex_;
  wanted.constants = &constants;
  wanted.raster = &state;
  wanted.set_count = sets_used(shader.bindings);
  wanted.push_bytes = shader.push_bytes;
  find_set_layouts(*device_, shader.bindings, wanted.set_count, wanted.stage, wanted.sets);
  return shared(wanted);
}

Pipeline PipelineMaker::surfaces(const SurfaceProgram& program, const CompiledShader& fragment,
                                 const Constants& constants, const RasterState& state, VkDescriptorSetLayout materials,
                                 VkDescriptorSetLayout program_set) {
  Wanted wanted;
  wanted.stage = VK_SHADER_STAGE_FRAGMENT_BIT;
  wanted.code = fragment.spirv;
  wanted.vertex = program.vertex;
  wanted.constants = &constants;
  wanted.vertex_constants = &program.constants;
  wanted.raster = &state;
  wanted.is_surfaces = true;
  wanted.sets = {VK_NULL_HANDLE, VK_NULL_HANDLE, materials, program_set};
  wanted.set_count = 4;
  wanted.push_bytes = fragment.push_bytes;
  find_set_layouts(*device_, fragment.bindings, wanted.set_count, wanted.stage, wanted.sets);
  return shared(wanted);
}

Pipeline PipelineMaker::surfaces_masked_depth(const SurfaceProgram& program, const RasterState& state,
                                              VkDescriptorSetLayout materials, VkDescriptorSetLayout program_set) {
  CompiledShader masked;
  masked.kind = ShaderKind::kSurfaces;
  masked.spirv = program.masked_fragment;
  return surfaces(program, masked, {}, state, materials, program_set);
}

VkPipeline PipelineMaker::make_compute(const Wanted& wanted, VkPipelineLayout layout) const {
  const heddle_vulkan& vk = device_->table();
  const Module module(*device_, wanted.code);
  const Specialization specialization(*wanted.constants);
  VkComputePipelineCreateInfo info{VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO};
  info.stage = stage_info(VK_SHADER_STAGE_COMPUTE_BIT, module, &specialization);
  info.layout = layout;
  VkPipeline pipeline = VK_NULL_HANDLE;
  check(vk.CreateComputePipelines(vk.device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline), "vkCreateComputePipelines");
  return pipeline;
}

VkPipeline PipelineMaker::make_graphics(const Wanted& wanted, VkPipelineLayout layout) const {
  const heddle_vulkan& vk = device_->table();
  const RasterState& state = *wanted.raster;
  const Constants none;
  const Module vertex_module(*device_, wanted.vertex);
  std::optional<Module> fragment_module;
  const Specialization specialization(*wanted.constants);
  const Specialization vertex_specialization(wanted.vertex_constants != nullptr ? *wanted.vertex_constants : none);
  std::vector stages{stage_info(VK_SHADER_STAGE_VERTEX_BIT, vertex_module, &vertex_specialization)};
  if (!wanted.code.empty()) {
    fragment_module.emplace(*device_, wanted.code);
    stages.push_back(stage_info(VK_SHADER_STAGE_FRAGMENT_BIT, *fragment_module, &specialization));
  }

  // Programs pull their vertices from storage buffers: no vertex input.
  const VkPipelineVertexInputStateCreateInfo input{VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO};
  VkPipelineInputAssemblyStateCreateInfo assembly{VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO};
  assembly.topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
  VkPipelineViewportStateCreateInfo viewport{VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO};
  viewport.viewportCount = 1;
  viewport.scissorCount = 1;
  VkPipelineRasterizationStateCreateInfo raster{VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO};
  raster.polygonMode = VK_POLYGON_MODE_FILL;
  raster.cullMode = VK_CULL_MODE_NONE;
  raster.frontFace = VK_FRONT_FACE_COUNTER_CLOCKWISE;
  raster.lineWidth = 1.0F;
  raster.depthBiasConstantFactor = state.depth_bias_constant;
  raster.depthBiasSlopeFactor = state.depth_bias_slope;
  raster.depthBiasEnable = state.depth_bias_constant != 0 || state.depth_bias_slope != 0 ? VK_TRUE : VK_FALSE;
  VkPipelineMultisampleStateCreateInfo multisample{VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO};
  multisample.rasterizationSamples = VK_SAMPLE_COUNT_1_BIT;
  const bool has_depth = state.depth_format != VK_FORMAT_UNDEFINED;
  VkPipelineDepthStencilStateCreateInfo depth{VK_STRUCTURE_TYPE_PIPELINE_DEPTH_STENCIL_STATE_CREATE_INFO};
  depth.depthTestEnable = has_depth ? VK_TRUE : VK_FALSE;
  depth.depthWriteEnable = has_depth && state.depth_write ? VK_TRUE : VK_FALSE;
  // A descriptor's 0, VK_COMPARE_OP_NEVER by number, means the default.
  depth.depthCompareOp =
      state.depth_compare == VK_COMPARE_OP_NEVER ? VK_COMPARE_OP_GREATER_OR_EQUAL : state.depth_compare;
  std::vector<VkPipelineColorBlendAttachmentState> attachments;
  for (std::size_t i = 0; i < state.color_formats.size(); ++i) {
    const std::uint32_t mode = i < state.blends.size() ? state.blends[i] : HEDDLE_BLEND_NONE;
    if (mode == HEDDLE_BLEND_TINT && device_->features().dualSrcBlend == VK_FALSE) {
      throw Error(HEDDLE_UNSUPPORTED,
                  "a stage blends with HEDDLE_BLEND_TINT, and this device has no blending with two colours "
                  "(dualSrcBlend)",
                  "choose another technique for the pass, or another device");
    }
    if (mode != HEDDLE_BLEND_NONE &&
        !device_->has_format(state.color_formats[i], VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BLEND_BIT)) {
      throw Error(HEDDLE_UNSUPPORTED,
                  fmt::format("a stage blends colours into an image of format {}, which this device cannot",
                              format_info(state.color_formats[i]).name),
                  "choose another technique or format for the pass, or another device");
    }
    attachments.push_back(blend_state(mode));
  }
  VkPipelineColorBlendStateCreateInfo blend{VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO};
  blend.attachmentCount = static_cast<std::uint32_t>(attachments.size());
  blend.pAttachments = attachments.data();
  std::vector dynamic_states{VK_DYNAMIC_STATE_VIEWPORT, VK_DYNAMIC_STATE_SCISSOR};
  if (wanted.is_surfaces)
    dynamic_states.insert(dynamic_states.end(), {VK_DYNAMIC_STATE_CULL_MODE, VK_DYNAMIC_STATE_FRONT_FACE});
  if (std::ranges::find(state.blends, HEDDLE_BLEND_CONSTANT) != state.blends.end())
    dynamic_states.push_back(VK_DYNAMIC_STATE_BLEND_CONSTANTS);
  VkPipelineDynamicStateCreateInfo dynamic{VK_STRUCTURE_TYPE_PIPELINE_DYNAMIC_STATE_CREATE_INFO};
  dynamic.dynamicStateCount = static_cast<std::uint32_t>(dynamic_states.size());
  dynamic.pDynamicStates = dynamic_states.data();
  VkPipelineRenderingCreateInfo rendering{VK_STRUCTURE_TYPE_PIPELINE_RENDERING_CREATE_INFO};
  rendering.colorAttachmentCount = static_cast<std::uint32_t>(state.color_formats.size());
  rendering.pColorAttachmentFormats = state.color_formats.data();
  rendering.depthAttachmentFormat = state.depth_format;

  VkGraphicsPipelineCreateInfo info{VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO};
  info.pNext = &rendering;
  info.stageCount = static_cast<std::uint32_t>(stages.size());
  info.pStages = stages.data();
  info.pVertexInputState = &input;
  info.pInputAssemblyState = &assembly;
  info.pViewportState = &viewport;
  info.pRasterizationState = &raster;
  info.pMultisampleState = &multisample;
  info.pDepthStencilState = &depth;
  info.pColorBlendState = &blend;
  info.pDynamicState = &dynamic;
  info.layout = layout;
  VkPipeline pipeline = VK_NULL_HANDLE;
  check(vk.CreateGraphicsPipelines(vk.device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline),
        "vkCreateGraphicsPipelines");
  return pipeline;
}

}  // namespace heddle::vulkan
