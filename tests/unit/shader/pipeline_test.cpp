// SPDX-License-Identifier: Apache-2.0
// Joined shaders and surface programs, run on a device: what the generated code computes. The validation layer watches
// where it is installed.
#include "unit/shader/fixture.hpp"

#include <algorithm>
#include <cstring>

namespace heddle::vulkan {
namespace {

using testing::ElementsAre;
using testing::FloatNear;
using testing::Pointwise;

class ShaderPipeline : public ShaderTest {
 protected:
  ShaderPipeline() {
    DeviceOptions options;
    const std::vector<std::string> layers = list_layers();
    options.validation = std::find(layers.begin(), layers.end(), "VK_LAYER_KHRONOS_validation") != layers.end();
    device_ = std::make_unique<Device>(options);
    maker_ = std::make_unique<PipelineMaker>(*device_, folder_ / "cache");
    const std::array<VkDescriptorPoolSize, 4> sizes{{{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 32},
                                                     {VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, 8},
                                                     {VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC, 8},
                                                     {VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 16}}};
    VkDescriptorPoolCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO};
    info.maxSets = 16;
    info.poolSizeCount = sizes.size();
    info.pPoolSizes = sizes.data();
    check(vk().CreateDescriptorPool(vk().device, &info, nullptr, &pool_), "vkCreateDescriptorPool");
  }
  ~ShaderPipeline() override {
    EXPECT_THAT(device_->take_validation_errors(), testing::IsEmpty());
    vk().DestroyDescriptorPool(vk().device, pool_, nullptr);
  }
  const heddle_vulkan& vk() { return device_->table(); }

  template <typename T>
  Buffer filled(const std::vector<T>& values, VkBufferUsageFlags usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT) {
    Buffer buffer = device_->make_buffer(values.size() * sizeof(T), usage, true);
    std::memcpy(buffer.data(), values.data(), values.size() * sizeof(T));
    return buffer;
  }

  VkDescriptorSet allocate(VkDescriptorSetLayout layout) {
    VkDescriptorSetAllocateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO};
    info.descriptorPool = pool_;
    info.descriptorSetCount = 1;
    info.pSetLayouts = &layout;
    VkDescriptorSet set = VK_NULL_HANDLE;
    check(vk().AllocateDescriptorSets(vk().device, &info, &set), "vkAllocateDescriptorSets");
    return set;
  }
  void point(VkDescriptorSet set, std::uint32_t binding, VkDescriptorType type, const Buffer& buffer,
             VkDeviceSize range = VK_WHOLE_SIZE) {
    const VkDescriptorBufferInfo info{buffer.handle(), 0, range};
    VkWriteDescriptorSet write{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET};
    write.dstSet = set;
    write.dstBinding = binding;
    write.descriptorCount = 1;
    write.descriptorType = type;
    write.pBufferInfo = &info;
    vk().UpdateDescriptorSets(vk().device, 1, &write, 0, nullptr);
  }

  // Runs calling_request's shader: light(key, (2,2,2)) for keys 0..3.
  std::vector<float> answers(const ShaderRequest& made, const Constants& constants = {},
                             const std::vector<std::uint32_t>& table = {0, 1, 9, 0}) {
    const CompiledShader shader = compile(made, {});
    expect_valid(shader.spirv);
    const Pipeline pipeline = maker_->compute(shader, constants);
    const Buffer result = filled(std::vector<float>(4, -1.0F));
    const Buffer keys = filled(table);
    std::vector<std::pair<std::uint32_t, VkDescriptorSet>> sets;
    for (std::uint32_t set = 0; set < 2; ++set) {
      const bool is_used =
          std::any_of(shader.bindings.begin(), shader.bindings.end(), [&](const Binding& b) { return b.set == set; });
      if (is_used) sets.emplace_back(set, allocate(pipeline.set_layout(set)));
    }
    for (const Binding& binding : shader.bindings) {
      const auto set = std::find_if(sets.begin(), sets.end(), [&](const auto& s) { return s.first == binding.set; });
      point(set->second, binding.binding, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
            binding.kind == Binding::Kind::kSwitchTable ? keys : result);
    }
    device_->run([&](VkCommandBuffer commands) {
      vk().CmdBindPipeline(commands, pipeline.bind_point(), pipeline.handle());
      for (const auto& [index, set] : sets) {
        vk().CmdBindDescriptorSets(commands, pipeline.bind_point(), pipeline.layout(), index, 1, &set, 0, nullptr);
      }
      vk().CmdDispatch(commands, 1, 1, 1);
    });
    std::vector<float> out(4);
    std::memcpy(out.data(), result.data(), 16);
    return out;
  }

  const Technique& times(const std::string& id, const std::string& factor) {
    return provider_technique(
        "light/" + id, id + ".glsl",
        "const float kFactor = " + factor +
            ";\nfloat light(uint key, vec3 position) { return kFactor * (position.x + float(key)); }\n");
  }

  // Runs `draw` inside a rendering of a 4x4 float image (and depth, if `depth` is given) and reads the colours back.
  std::vector<float> drawn(const std::function<void(VkCommandBuffer)>& draw, const Image* depth = nullptr,
                           bool has_color = true) {
    const Image color = device_->make_image({VK_FORMAT_R32G32B32A32_SFLOAT, 4, 4, 1, 1, 0, false});
    const Image& read = has_color ? color : *depth;
    device_->run([&](VkCommandBuffer commands) {
      const auto change = [&](const Image& image, VkImageLayout from, VkImageLayout to, bool is_depth) {
        VkImageMemoryBarrier2 barrier{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2};
        barrier.srcStageMask = barrier.dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
        barrier.srcAccessMask = barrier.dstAccessMask = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
        barrier.oldLayout = from;
        barrier.newLayout = to;
        barrier.image = image.handle();
        barrier.subresourceRange = {
            static_cast<VkImageAspectFlags>(is_depth ? VK_IMAGE_ASPECT_DEPTH_BIT : VK_IMAGE_ASPECT_COLOR_BIT), 0, 1, 0,
            1};
        VkDependencyInfo info{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
        info.imageMemoryBarrierCount = 1;
        info.pImageMemoryBarriers = &barrier;
        vk().CmdPipelineBarrier2(commands, &info);
      };
      VkRenderingAttachmentInfo target{VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO};
      target.imageView = color.layer_view(0);
      target.imageLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
      target.loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
      target.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
      target.clearValue.color = {{-1.0F, -1.0F, -1.0F, -1.0F}};
      VkRenderingAttachmentInfo depth_target = target;
      VkRenderingInfo info{VK_STRUCTURE_TYPE_RENDERING_INFO};
      info.renderArea = {{0, 0}, {4, 4}};
      info.layerCount = 1;
      if (has_color) {
        change(color, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL, false);
        info.colorAttachmentCount = 1;
        info.pColorAttachments = &target;
      }
      if (depth != nullptr) {
        change(*depth, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_DEPTH_ATTACHMENT_OPTIMAL, true);
        depth_target.imageView = depth->layer_view(0);
        depth_target.imageLayout = VK_IMAGE_LAYOUT_DEPTH_ATTACHMENT_OPTIMAL;
        depth_target.clearValue.depthStencil = {0.25F, 0};
        info.pDepthAttachment = &depth_target;
      }
      vk().CmdBeginRendering(commands, &info);
      const VkViewport viewport{0, 0, 4, 4, 0, 1};
      const VkRect2D scissor{{0, 0}, {4, 4}};
      vk().CmdSetViewport(commands, 0, 1, &viewport);
      vk().CmdSetScissor(commands, 0, 1, &scissor);
      draw(commands);
      vk().CmdEndRendering(commands);
      change(read, has_color ? VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL : VK_IMAGE_LAYOUT_DEPTH_ATTACHMENT_OPTIMAL,
             VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, !has_color);
    });
    return to_float(device_->read_back(read, 0, 0, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL), read.shape().format);
  }

  std::unique_ptr<Device> device_;
  std::unique_ptr<PipelineMaker> maker_;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
};

TEST_F(ShaderPipeline, NeutralBodyAnswersWithoutProviders) {
  Role role = light_role();
  ShaderRequest made = calling_request();
  made.roles = {{&role, role.join, {}}};
  EXPECT_THAT(answers(made), ElementsAre(0.5F, 0.5F, 0.5F, 0.5F));
}

TEST_F(ShaderPipeline, IsMadeOnceForTheSameCodeConstantsAndState) {
  Role role = light_role();
  ShaderRequest wanted = calling_request();
  wanted.roles = {{&role, role.join, {}}};
  const CompiledShader shader = compile(wanted, {});
  const auto made = [&] { return device_->counters().pipelines; };
  VkPipeline first = VK_NULL_HANDLE;
  {
    const Pipeline one = maker_->compute(shader, {});
    PipelineMaker other(*device_, {});
    const Pipeline two = other.compute(shader, {});
    first = one.handle();
    EXPECT_EQ(two.handle(), first);
    EXPECT_FALSE(one.was_there());
    EXPECT_TRUE(two.was_there());
    EXPECT_EQ(made(), 1U);
    EXPECT_NE(maker_->compute(shader, {{0, 1U}}).handle(), first);
    CompiledShader pushing = shader;
    pushing.push_bytes = 16;  // another layout
    EXPECT_NE(maker_->compute(pushing, {}).handle(), first);
    EXPECT_EQ(made(), 3U);
  }
  // Nobody uses it, and it is still there.
  EXPECT_EQ(maker_->compute(shader, {}).handle(), first);
  EXPECT_EQ(made(), 3U);

  const CompiledShader filling =
      compile(request("#include \"pass.glsl\"\nvoid main() { color = vec4(1.0); }\n",
                      {image("color", HEDDLE_ACCESS_COLOR, VK_FORMAT_R8G8B8A8_UNORM)}, ShaderKind::kFullscreen),
              {});
  RasterState state;
  state.color_formats = {VK_FORMAT_R8G8B8A8_UNORM};
  const Pipeline opaque = maker_->fullscreen(filling, {}, state);
  state.blends = {HEDDLE_BLEND_ADD};
  const Pipeline adding = maker_->fullscreen(filling, {}, state);
  EXPECT_NE(adding.handle(), opaque.handle());
  EXPECT_EQ(maker_->fullscreen(filling, {}, state).handle(), adding.handle());
  EXPECT_EQ(made(), 5U);
}

TEST_F(ShaderPipeline, StaysForAWhileWhenNobodyUsesIt) {
  Role role = light_role();
  ShaderRequest wanted = calling_request();
  wanted.roles = {{&role, role.join, {}}};
  const CompiledShader shader = compile(wanted, {});
  const Pipeline used = maker_->compute(shader, {});
  for (std::uint32_t i = 0; i < 200; ++i) (void)maker_->compute(shader, {{0, i}});
  // The used one, and the last of the others.
  const std::uint64_t live = device_->counters().live_pipelines;
  EXPECT_GT(live, 16U);
  EXPECT_LT(live, 100U);
  EXPECT_TRUE(maker_->compute(shader, {{0, 199U}}).was_there());
  EXPECT_TRUE(maker_->compute(shader, {}).was_there());
  EXPECT_FALSE(maker_->compute(shader, {{0, 0U}}).was_there());
  EXPECT_EQ(device_->counters().live_pipelines, live);
}

TEST_F(ShaderPipeline, SumAndProductAnswerWithAllProviders) {
  Role role = light_role();
  ShaderRequest made = calling_request();
  const Technique& three = times("three", "3.0");
  const Technique& five = times("five", "5.0");
  made.roles = {{&role, Join::kSum, {provider("a", three), provider("b", five), provider("c", three)}}};
  EXPECT_THAT(answers(made), ElementsAre(22.0F, 33.0F, 44.0F, 55.0F));
  made.roles[0].join = Join::kProduct;
  EXPECT_THAT(answers(made), ElementsAre(360.0F, 1215.0F, 2880.0F, 5625.0F));
}

TEST_F(ShaderPipeline, SwitchAnswersWithTheProviderOfTheTable) {
  Role role = light_role();
  ShaderRequest made = calling_request();
  made.roles = {{&role, Join::kSwitch, {provider("a", times("three", "3.0")), provider("b", times("five", "5.0"))}}};
  // The table says 0, 1, 9 (nobody: neutral), 0.
  EXPECT_THAT(answers(made), ElementsAre(6.0F, 15.0F, 0.5F, 15.0F));
}

TEST_F(ShaderPipeline, ConstantsOfCallerAndProvidersAreSpecializedApart) {
  Role role = light_role();
  Technique& technique = const_cast<Technique&>(provider_technique(
      "light/gain", "gain.glsl", "float light(uint key, vec3 position) { return float(constant_steps); }\n"));
  technique.parameters = {parameter("steps", ParameterType::kInt, HEDDLE_PARAMETER_CONSTANT, 7)};
  ShaderRequest made = request(
      "#include \"pass.glsl\"\n#include \"role/light.glsl\"\nlayout(local_size_x = 8) in;\n"
      "void main() { if (gl_LocalInvocationID.x < 4u) result[gl_LocalInvocationID.x] = light(0u, vec3(0.0)) + "
      "constant_bias; }\n",
      {buffer("answers", HEDDLE_ACCESS_STORAGE_WRITE, "float result[];")});
  technique_of(made).parameters = {parameter("bias", ParameterType::kFloat, HEDDLE_PARAMETER_CONSTANT, 0.5)};
  made.roles = {{&role, Join::kSum, {provider("a", technique), provider("b", technique)}}};
  EXPECT_EQ(answers(made)[0], 14.5F) << "defaults";
  const float bias = 0.25F;
  std::uint32_t bits = 0;
  std::memcpy(&bits, &bias, 4);
  Constants constants{{0, bits}};
  for (const ConstantSlot& slot : compile(made, {}).constants) {
    if (slot.pass == "b") constants[slot.id] = 100;
  }
  EXPECT_EQ(answers(made, constants)[0], 107.25F);
}

TEST_F(ShaderPipeline, FullscreenShaderCoversTheTargetWithUvDown) {
  const ShaderRequest made =
      request("#include \"pass.glsl\"\nvoid main() { color = vec4(uv, gl_FragCoord.xy); }\n",
              {image("color", HEDDLE_ACCESS_COLOR, VK_FORMAT_R32G32B32A32_SFLOAT)}, ShaderKind::kFullscreen);
  RasterState state;
  state.color_formats = {VK_FORMAT_R32G32B32A32_SFLOAT};
  const Pipeline pipeline = maker_->fullscreen(compile(made, {}), {}, state);
  const std::vector<float> pixels = drawn([&](VkCommandBuffer commands) {
    vk().CmdBindPipeline(commands, pipeline.bind_point(), pipeline.handle());
    vk().CmdDraw(commands, 3, 1, 0, 0);
  });
  for (std::size_t y = 0; y < 4; ++y) {
    for (std::size_t x = 0; x < 4; ++x) {
      const float fx = static_cast<float>(x) + 0.5F;
      const float fy = static_cast<float>(y) + 0.5F;
      const std::vector<float> pixel(pixels.begin() + static_cast<std::ptrdiff_t>(4 * (4 * y + x)),
                                     pixels.begin() + static_cast<std::ptrdiff_t>(4 * (4 * y + x) + 4));
      // Interpolation over one triangle: a few steps of float32.
      EXPECT_THAT(pixel, Pointwise(FloatNear(1e-6F), {fx / 4, fy / 4, fx, fy}));
    }
  }
}

TEST_F(ShaderPipeline, BlendsWeighNewAndOldColoursAsTheirNamesSay) {
  // Drawn twice over what the target is cleared to.
  const std::array<float, 4> before{0.5F, 0.25F, 0.125F, 0.0F};
  const std::array<float, 4> drawn_color{1.0F, 0.5F, 0.0F, 0.5F}, tint{0.5F, 1.0F, 0.25F, 0.5F};
  constexpr std::array<float, 4> kConstant{0.5F, 0.25F, 0.75F, 0.125F};
  for (const std::uint32_t blend : {HEDDLE_BLEND_NONE, HEDDLE_BLEND_OVER, HEDDLE_BLEND_ADD, HEDDLE_BLEND_MULTIPLY,
                                    HEDDLE_BLEND_TINT, HEDDLE_BLEND_CONSTANT}) {
    BoundPort port = image("color", HEDDLE_ACCESS_COLOR, VK_FORMAT_R32G32B32A32_SFLOAT);
    port.blend = blend;
    const std::string text =
        "layout(push_constant) uniform Push { vec4 color; } push;\nvoid main() {\n  color = push.color;\n" +
        std::string(blend == HEDDLE_BLEND_TINT ? "  color_tint = vec4(0.5, 1.0, 0.25, 0.5);\n" : "") + "}\n";
    const ShaderRequest made = request("#include \"pass.glsl\"\n" + text, {port}, ShaderKind::kFullscreen);
    const CompiledShader compiled = compile(made, {});
    expect_valid(compiled.spirv);
    RasterState opaque;
    opaque.color_formats = {VK_FORMAT_R32G32B32A32_SFLOAT};
    RasterState state = opaque;
    state.blends = {blend};
    const Pipeline first = maker_->fullscreen(compiled, {}, opaque);
    const Pipeline second = maker_->fullscreen(compiled, {}, state);
    const std::vector<float> pixels = drawn([&](VkCommandBuffer commands) {
      const auto draw = [&](const Pipeline& pipeline, const std::array<float, 4>& color) {
        vk().CmdBindPipeline(commands, pipeline.bind_point(), pipeline.handle());
        vk().CmdPushConstants(commands, pipeline.layout(), VK_SHADER_STAGE_FRAGMENT_BIT, 0, sizeof color, color.data());
        vk().CmdDraw(commands, 3, 1, 0, 0);
      };
      draw(first, before);
      if (blend == HEDDLE_BLEND_CONSTANT) vk().CmdSetBlendConstants(commands, kConstant.data());
      draw(second, drawn_color);
    });
    for (std::size_t c = 0; c < 4; ++c) {
      const float fresh = drawn_color[c], old = before[c];
      const float expected = blend == HEDDLE_BLEND_OVER       ? fresh + (1.0F - drawn_color[3]) * old
                             : blend == HEDDLE_BLEND_ADD      ? fresh + old
                             : blend == HEDDLE_BLEND_MULTIPLY ? fresh * old
                             : blend == HEDDLE_BLEND_TINT     ? fresh + tint[c] * old
                             : blend == HEDDLE_BLEND_CONSTANT ? kConstant[c] * fresh + (1.0F - kConstant[c]) * old
                                                              : fresh;
      EXPECT_EQ(pixels[c], expected) << "blend " << blend << ", channel " << c;  // exact: few bits each
    }
  }
}

TEST_F(ShaderPipeline, BlendingIntoAFormatThatTheDeviceCannotBlendIsRefused) {
  const BoundPort port = image("color", HEDDLE_ACCESS_COLOR, VK_FORMAT_R32G32B32A32_SFLOAT);
  const ShaderRequest made =
      request("#include \"pass.glsl\"\nvoid main() { color = vec4(1.0); }\n", {port}, ShaderKind::kFullscreen);
  RasterState state;
  state.color_formats = {VK_FORMAT_R32G32B32A32_UINT};  // integers are never blended
  state.blends = {HEDDLE_BLEND_CONSTANT};
  try {
    (void)maker_->fullscreen(compile(made, {}), {}, state);
    FAIL() << "made";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), HEDDLE_UNSUPPORTED);
    EXPECT_STREQ(error.what(),
                 "error: a stage blends colours into an image of format r32g32b32a32_uint, which this device cannot\n"
                 "  help:     choose another technique or format for the pass, or another device");
  }
}

// One quad over the target at z = 0.5, mirrored and stretched; its texture has a hole in the left half.
class SurfacePipeline : public ShaderPipeline {
 protected:
  SurfacePipeline() : program_(mesh_program(folder_ / "cache", shared_)) {
    const VkShaderStageFlags both = VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT;
    std::vector<VkDescriptorSetLayoutBinding> textures;
    for (std::uint32_t i = 0; i < HEDDLE_TEXTURE_COUNT; ++i) {
      textures.push_back({i, VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 1, VK_SHADER_STAGE_FRAGMENT_BIT, nullptr});
    }
    materials_layout_ = device_->pipelines().set_layout(textures);
    const std::vector<VkDescriptorSetLayoutBinding> program{
        {0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, both, nullptr},
        {1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, both, nullptr},
        {2, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, both, nullptr},
        {3, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC, 1, both, nullptr}};
    program_layout_ = device_->pipelines().set_layout(program);

    // The second four of eight vertices and the second of two instances: offsets must reach the shader.
    std::vector<HeddleVertex> vertices(8);
    for (std::size_t i = 4; i < 8; ++i) {
      HeddleVertex& v = vertices[i];
      const float x = (i & 1U) != 0 ? 1.0F : 0.0F;
      const float y = (i & 2U) != 0 ? 1.0F : 0.0F;
      v = {};
      v.position[0] = x * 2 - 1;
      v.position[1] = y * 2 - 1;
      v.position[2] = 0;
      v.u0 = x;
      v.v0 = y;
      v.u1 = 1 - x;
      v.v1 = y;
      v.normal[0] = 0.6F;
      v.normal[2] = 0.8F;
      v.tangent[1] = 1;
      v.tangent[3] = 1;
      v.color = 0xff804020U;
    }
    std::vector<HeddleInstance> instances(2);
    HeddleInstance& instance = instances[1];
    instance = {};
    // Mirrored in z, twice as thick in x before the view halves it: normals turn by the inverse transpose.
    const std::array<float, 4> scale{2, 1, -1, 1};
    for (std::size_t i = 0; i < 4; ++i) instance.rel_from_object[5 * i] = scale.at(i);
    std::copy(std::begin(instance.rel_from_object), std::end(instance.rel_from_object),
              std::begin(instance.previous_rel_from_object));
    instance.previous_rel_from_object[12] = 5;
    instance.material = 1;
    instance.object = 42;
    instance.flags = HEDDLE_SURFACE_MASKED;
    instance.flip = 1;
    std::vector<HeddleMaterial> materials(2);
    HeddleMaterial& material = materials[1];
    material = {};
    for (float& c : material.base_color) c = 1;
    material.alpha_cutoff = 0.5F;
    material.alpha_mode = HEDDLE_ALPHA_MASK;
    for (std::uint32_t& layer : material.texture_layer) layer = HEDDLE_NO_TEXTURE;
    material.texture_layer[0] = 1;
    material.texture_layer_4 = HEDDLE_NO_TEXTURE;
    // uv' = (v, u) + (0.25, 0): a turn by exchange, so that a wrong order of the matrix shows.
    material.uv_rotation_scale[1] = 1;
    material.uv_rotation_scale[2] = 1;
    material.uv_offset[0] = 0.25F;
    HeddleView view{};
    const std::array<float, 4> clip{0.5F, 1, 1, 1};
    for (std::size_t i = 0; i < 4; ++i) view.clip_from_rel[5 * i] = clip.at(i);
    view.clip_from_rel[14] = 0.5F;
    view.near_distance = 3;

    buffers_.push_back(filled(vertices));
    buffers_.push_back(filled(instances));
    buffers_.push_back(filled(materials));
    buffers_.push_back(filled(std::vector<HeddleView>{view}, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT));
    buffers_.push_back(filled(std::vector<std::uint32_t>{0, 1, 2, 2, 1, 3}, VK_BUFFER_USAGE_INDEX_BUFFER_BIT));
    program_set_ = allocate(program_layout_);
    for (std::uint32_t i = 0; i < 4; ++i) {
      point(program_set_, i, i == 3 ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
            buffers_[i], i == 3 ? sizeof(HeddleView) : VK_WHOLE_SIZE);
    }
    // Layer 1: 4x4, transparent where v' < 0.5 in the texture's own rows. Layer 0 is opaque everywhere.
    texture_ = device_->make_image({VK_FORMAT_R32G32B32A32_SFLOAT, 4, 4, 2, 1, 0, false});
    for (std::uint32_t layer = 0; layer < 2; ++layer) {
      std::vector<float> texels(64, 1.0F);
      for (std::size_t i = 0; i < 16; ++i) texels[4 * i + 3] = layer == 0 || i >= 8 ? 1.0F : 0.0F;
      device_->upload(texture_, layer, 0, std::as_bytes(std::span(texels)));
    }
    materials_set_ = allocate(materials_layout_);
    const VkDescriptorImageInfo info{device_->sampler(Device::Sampler::kNearestClamp), texture_.view(),
                                     VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL};
    for (std::uint32_t i = 0; i < HEDDLE_TEXTURE_COUNT; ++i) {
      VkWriteDescriptorSet write{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET};
      write.dstSet = materials_set_;
      write.dstBinding = i;
      write.descriptorCount = 1;
      write.descriptorType = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
      write.pImageInfo = &info;
      vk().UpdateDescriptorSets(vk().device, 1, &write, 0, nullptr);
    }
  }
  void draw(VkCommandBuffer commands, const Pipeline& pipeline) {
    vk().CmdBindPipeline(commands, pipeline.bind_point(), pipeline.handle());
    vk().CmdSetCullMode(commands, VK_CULL_MODE_NONE);
    vk().CmdSetFrontFace(commands, VK_FRONT_FACE_COUNTER_CLOCKWISE);
    const std::array<VkDescriptorSet, 2> sets{materials_set_, program_set_};
    const std::uint32_t offset = 0;
    vk().CmdBindDescriptorSets(commands, pipeline.bind_point(), pipeline.layout(), 2, 2, sets.data(), 1, &offset);
    vk().CmdBindIndexBuffer(commands, buffers_[4].handle(), 0, VK_INDEX_TYPE_UINT32);
    vk().CmdDrawIndexed(commands, 6, 1, 0, 4, 1);
  }
  std::vector<float> colors(const std::string& expression) {
    const ShaderRequest made =
        request("#include \"pass.glsl\"\nvoid main() { color = " + expression + "; }\n",
                {image("color", HEDDLE_ACCESS_COLOR, VK_FORMAT_R32G32B32A32_SFLOAT)}, ShaderKind::kSurfaces);
    RasterState state;
    state.color_formats = {VK_FORMAT_R32G32B32A32_SFLOAT};
    const Pipeline pipeline =
        maker_->surfaces(program_, compile(made, {}), {}, state, materials_layout_, program_layout_);
    const std::vector<float> pixels = drawn([&](VkCommandBuffer commands) { draw(commands, pipeline); });
    // Pixel (1, 2): clip (-0.25, 0.25).
    return {pixels.begin() + 4 * (4 * 2 + 1), pixels.begin() + 4 * (4 * 2 + 1) + 4};
  }

  SurfaceProgram program_;
  VkDescriptorSetLayout materials_layout_ = VK_NULL_HANDLE, program_layout_ = VK_NULL_HANDLE;
  VkDescriptorSet materials_set_ = VK_NULL_HANDLE, program_set_ = VK_NULL_HANDLE;
  std::vector<Buffer> buffers_;
  Image texture_;
};

TEST_F(SurfacePipeline, MeshProgramFillsEveryFieldOfTheSurface) {
  // Interpolated over two triangles: a few steps of float32.
  const auto near = [](std::vector<float> v) { return Pointwise(FloatNear(2e-6F), v); };
  EXPECT_THAT(colors("vec4(surface.position_rel, view.near_distance)"), near({-0.5F, 0.25F, 0, 3}));
  EXPECT_THAT(colors("vec4(surface.previous_position_rel, 0.0)"), near({4.5F, 0.25F, 0, 0}));
  EXPECT_THAT(colors("vec4(surface.uv0, surface.uv1)"), near({0.375F, 0.625F, 0.625F, 0.625F}));
  EXPECT_THAT(colors("surface.color"), near({32 / 255.0F, 64 / 255.0F, 128 / 255.0F, 1}));
  EXPECT_THAT(colors("vec4(surface.material, surface.object, surface.flags, materials[1].alpha_cutoff)"),
              near({1, 42, HEDDLE_SURFACE_MASKED, 0.5F}));
  // Inverse transpose of diag(2, 1, -1) on (0.6, 0, 0.8): (0.3, 0, -0.8), made unit.
  const float length = std::sqrt(0.3F * 0.3F + 0.8F * 0.8F);
  EXPECT_THAT(colors("vec4(surface.normal, 0.0)"), near({0.3F / length, 0, -0.8F / length, 0}));
  EXPECT_THAT(colors("surface.tangent"), near({0, 1, 0, -1})) << "mirrored: the handedness turns";
}

TEST_F(SurfacePipeline, MaskedDepthLeavesHolesWhereAlphaIsBelowTheCutoff) {
  RasterState state;
  state.depth_format = VK_FORMAT_D32_SFLOAT;
  const Image depth = device_->make_image({VK_FORMAT_D32_SFLOAT, 4, 4, 1, 1, 0, false});
  const Pipeline masked = maker_->surfaces_masked_depth(program_, state, materials_layout_, program_layout_);
  const std::vector<float> holes = drawn([&](VkCommandBuffer commands) { draw(commands, masked); }, &depth, false);
  const Pipeline opaque = maker_->surfaces(program_, {}, {}, state, materials_layout_, program_layout_);
  const std::vector<float> whole = drawn([&](VkCommandBuffer commands) { draw(commands, opaque); }, &depth, false);
  for (std::size_t y = 0; y < 4; ++y) {
    for (std::size_t x = 0; x < 4; ++x) {
      // The texture's v is the surface's u: the left half is a hole, where the depth stays as cleared.
      EXPECT_EQ(holes[4 * y + x], x < 2 ? 0.25F : 0.5F) << x << ", " << y;
      EXPECT_EQ(whole[4 * y + x], 0.5F);
    }
  }
}

TEST_F(SurfacePipeline, DepthComparesGreaterOrEqualUnlessSaidOtherwise) {
  const Image depth = device_->make_image({VK_FORMAT_D32_SFLOAT, 4, 4, 1, 1, 0, false});
  const auto first_depth = [&](VkCompareOp compare) {
    RasterState state;
    state.depth_format = VK_FORMAT_D32_SFLOAT;
    state.depth_compare = compare;
    const Pipeline pipeline = maker_->surfaces(program_, {}, {}, state, materials_layout_, program_layout_);
    return drawn([&](VkCommandBuffer commands) { draw(commands, pipeline); }, &depth, false)[0];
  };
  EXPECT_EQ(first_depth(VK_COMPARE_OP_GREATER_OR_EQUAL), 0.5F);
  EXPECT_EQ(first_depth(VK_COMPARE_OP_NEVER), 0.5F) << "a descriptor's 0 is the default";
  EXPECT_EQ(first_depth(VK_COMPARE_OP_LESS), 0.25F);
}

}  // namespace
}  // namespace heddle::vulkan
