// SPDX-License-Identifier: Apache-2.0
// Compiled shaders and raster state -> pipelines with their layouts.
#include "vulkan/shader_source.hpp"

#include <algorithm>
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
void make_set_layouts(Device& device, const std::vector<Binding>& bindings, std::uint32_t count,
                      VkShaderStageFlags stage, std::array<VkDescriptorSetLayout, 4>& sets, std::uint32_t& owned) {
  const heddle_vulkan& vk = device.table();
  for (std::uint32_t set = 0; set < count; ++set) {
    if (sets.at(set) != VK_NULL_HANDLE) continue;
    std::vector<VkDescriptorSetLayoutBinding> slots;
    for (const Binding& binding : bindings) {
      if (binding.set == set) slots.push_back({binding.binding, descriptor_type(binding), 1, stage, nullptr});
    }
    VkDescriptorSetLayoutCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO};
    info.bindingCount = static_cast<std::uint32_t>(slots.size());
    info.pBindings = slots.data();
    check(vk.CreateDescriptorSetLayout(vk.device, &info, nullptr, &sets.at(set)), "vkCreateDescriptorSetLayout");
    owned |= 1U << set;
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
  constexpr std::array<std::array<VkBlendFactor, 2>, 5> kFactors{{
      // In the order of HEDDLE_BLEND_*.
      {VK_BLEND_FACTOR_ONE, VK_BLEND_FACTOR_ZERO},
      {VK_BLEND_FACTOR_ONE, VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA},
      {VK_BLEND_FACTOR_ONE, VK_BLEND_FACTOR_ONE},
      {VK_BLEND_FACTOR_ZERO, VK_BLEND_FACTOR_SRC_COLOR},
      {VK_BLEND_FACTOR_ONE, VK_BLEND_FACTOR_SRC1_COLOR},
  }};
  VkPipelineColorBlendAttachmentState state{};
  state.blendEnable = blend != HEDDLE_BLEND_NONE ? VK_TRUE : VK_FALSE;
  state.srcColorBlendFactor = kFactors.at(blend)[0];
  state.dstColorBlendFactor = kFactors.at(blend)[1];
  state.srcAlphaBlendFactor = blend == HEDDLE_BLEND_MULTIPLY ? VK_BLEND_FACTOR_ZERO : VK_BLEND_FACTOR_ONE;
  state.dstAlphaBlendFactor = blend == HEDDLE_BLEND_MULTIPLY ? VK_BLEND_FACTOR_SRC_ALPHA
                              : blend == HEDDLE_BLEND_TINT   ? VK_BLEND_FACTOR_SRC1_ALPHA
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
  std::swap(device_, other.device_);
  std::swap(pipeline_, other.pipeline_);
  std::swap(layout_, other.layout_);
  std::swap(sets_, other.sets_);
  std::swap(owned_sets_, other.owned_sets_);
  std::swap(bind_point_, other.bind_point_);
  return *this;
}

Pipeline::~Pipeline() {
  if (device_ == nullptr) return;
  const heddle_vulkan& vk = device_->table();
  vk.DestroyPipeline(vk.device, pipeline_, nullptr);
  vk.DestroyPipelineLayout(vk.device, layout_, nullptr);
  for (std::uint32_t set = 0; set < sets_.size(); ++set) {
    if ((owned_sets_ & (1U << set)) != 0) vk.DestroyDescriptorSetLayout(vk.device, sets_.at(set), nullptr);
  }
}

PipelineMaker::PipelineMaker(Device& device, std::filesystem::path cache_folder)
    : device_(&device), cache_folder_(std::move(cache_folder)) {}

Pipeline PipelineMaker::compute(const CompiledShader& shader, const Constants& constants) {
  const heddle_vulkan& vk = device_->table();
  Pipeline made;
  made.device_ = device_;
  const std::uint32_t count = sets_used(shader.bindings);
  make_set_layouts(*device_, shader.bindings, count, VK_SHADER_STAGE_COMPUTE_BIT, made.sets_, made.owned_sets_);
  made.layout_ =
      make_layout(*device_, std::span(made.sets_).first(count), VK_SHADER_STAGE_COMPUTE_BIT, shader.push_bytes);
  const Module module(*device_, shader.spirv);
  const Specialization specialization(constants);
  VkComputePipelineCreateInfo info{VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO};
  info.stage = stage_info(VK_SHADER_STAGE_COMPUTE_BIT, module, &specialization);
  info.layout = made.layout_;
  check(vk.CreateComputePipelines(vk.device, VK_NULL_HANDLE, 1, &info, nullptr, &made.pipeline_),
        "vkCreateComputePipelines");
  return made;
}

Pipeline PipelineMaker::fullscreen(const CompiledShader& shader, const Constants& constants, const RasterState& state) {
  if (fullscreen_vertex_.empty()) {
    fullscreen_vertex_ = shader::compile_own("fullscreen.vert", kFullscreenVertex, cache_folder_, {});
  }
  Pipeline made;
  made.device_ = device_;
  const std::uint32_t count = sets_used(shader.bindings);
  make_set_layouts(*device_, shader.bindings, count, VK_SHADER_STAGE_FRAGMENT_BIT, made.sets_, made.owned_sets_);
  made.layout_ =
      make_layout(*device_, std::span(made.sets_).first(count), VK_SHADER_STAGE_FRAGMENT_BIT, shader.push_bytes);
  return graphics(fullscreen_vertex_, shader.spirv, std::move(made), constants, state, false);
}

Pipeline PipelineMaker::surfaces(const SurfaceProgram& program, const CompiledShader& fragment,
                                 const Constants& constants, const RasterState& state, VkDescriptorSetLayout materials,
                                 VkDescriptorSetLayout program_set) {
  Pipeline made;
  made.device_ = device_;
  made.sets_ = {VK_NULL_HANDLE, VK_NULL_HANDLE, materials, program_set};
  make_set_layouts(*device_, fragment.bindings, 4, VK_SHADER_STAGE_FRAGMENT_BIT, made.sets_, made.owned_sets_);
  made.layout_ = make_layout(*device_, made.sets_, VK_SHADER_STAGE_FRAGMENT_BIT, fragment.push_bytes);
  return graphics(program.vertex, fragment.spirv, std::move(made), constants, state, true, program.constants);
}

Pipeline PipelineMaker::surfaces_masked_depth(const SurfaceProgram& program, const RasterState& state,
                                              VkDescriptorSetLayout materials, VkDescriptorSetLayout program_set) {
  CompiledShader masked;
  masked.kind = ShaderKind::kSurfaces;
  masked.spirv = program.masked_fragment;
  return surfaces(program, masked, {}, state, materials, program_set);
}

Pipeline PipelineMaker::graphics(std::span<const std::uint32_t> vertex, std::span<const std::uint32_t> fragment,
                                 Pipeline&& layouts, const Constants& constants, const RasterState& state,
                                 bool is_surfaces, const Constants& vertex_constants) {
  const heddle_vulkan& vk = device_->table();
  Pipeline made = std::move(layouts);
  made.bind_point_ = VK_PIPELINE_BIND_POINT_GRAPHICS;

  const Module vertex_module(*device_, vertex);
  std::optional<Module> fragment_module;
  const Specialization specialization(constants), vertex_specialization(vertex_constants);
  std::vector stages{stage_info(VK_SHADER_STAGE_VERTEX_BIT, vertex_module, &vertex_specialization)};
  if (!fragment.empty()) {
    fragment_module.emplace(*device_, fragment);
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
    attachments.push_back(blend_state(mode));
  }
  VkPipelineColorBlendStateCreateInfo blend{VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO};
  blend.attachmentCount = static_cast<std::uint32_t>(attachments.size());
  blend.pAttachments = attachments.data();
  constexpr std::array kDynamic{VK_DYNAMIC_STATE_VIEWPORT, VK_DYNAMIC_STATE_SCISSOR, VK_DYNAMIC_STATE_CULL_MODE,
                                VK_DYNAMIC_STATE_FRONT_FACE};
  VkPipelineDynamicStateCreateInfo dynamic{VK_STRUCTURE_TYPE_PIPELINE_DYNAMIC_STATE_CREATE_INFO};
  dynamic.dynamicStateCount = is_surfaces ? 4 : 2;
  dynamic.pDynamicStates = kDynamic.data();
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
  info.layout = made.layout_;
  check(vk.CreateGraphicsPipelines(vk.device, VK_NULL_HANDLE, 1, &info, nullptr, &made.pipeline_),
        "vkCreateGraphicsPipelines");
  return made;
}

}  // namespace heddle::vulkan
