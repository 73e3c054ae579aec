// SPDX-License-Identifier: Apache-2.0
// host/vulkan/shader_generate.cpp and shader_reflect.cpp: ports and parameters as shaders see them.
#include "unit/shader/fixture.hpp"

#include <spirv_cross/spirv_cross.hpp>

namespace heddle::vulkan {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class ShaderGenerate : public ShaderTest {};

constexpr const char* kCompute = "#include \"pass.glsl\"\nlayout(local_size_x = 8, local_size_y = 4) in;\n";

std::string ports_of(const CompiledShader& shader) {
  std::string text;
  for (const Binding& binding : shader.bindings) text += (text.empty() ? "" : " ") + binding.port;
  return text;
}

TEST_F(ShaderGenerate, EveryAccessOfAComputeShaderCompiles) {
  BoundPort cube = image("cube", HEDDLE_ACCESS_SAMPLED_LINEAR, VK_FORMAT_R16G16B16A16_SFLOAT, 6);
  cube.is_cube = true;
  BoundPort cubes = image("cubes", HEDDLE_ACCESS_SAMPLED, VK_FORMAT_R8G8B8A8_UNORM, 12);
  cubes.is_cube = true;
  const ShaderRequest made = request(std::string(kCompute) + R"(
void main() {
  ivec2 p = ivec2(gl_GlobalInvocationID.xy);
  vec4 sum = fetch_plain(p) + sample_plain(vec2(0.5)) + fetch_stack(p, 1) + sample_stack(vec3(0.5));
  sum += fetch_plain(p, 3) + sample_plain(vec3(0.5)) + sample_cube(vec3(1.0)) + sample_cubes(vec4(1.0));
  sum += vec4(fetch_ids(p)) + vec4(fetch_signed_ids(p));
  sum += compare_map(vec2(0.5), 0.5) + compare_map(vec2(0.5), 0, 0.5) + compare_maps(vec2(0.5), 1, 0.5);
  sum += imageLoad(readable, p) + vec4(imageLoad(counts, p)) + imageLoad(both, p);
  sum += float(size_plain().x + size_stack().x + size_cube().x + size_map().x + size_maps().x + size_readable().x);
  sum += float(only_read[p.x]) + total + float(camera.extent.x) + float(lights.length()) + lights[0].range;
  sum += has_plain && has_lights && has_camera && has_counted ? vec4(1.0) : vec4(0.0);
  imageStore(written, p, sum);
  imageStore(layers, ivec3(p, 1), sum);
  imageStore(both, p, sum);
  imageAtomicAdd(counts, p, 1u);
  totals[p.x] = sum;
  mixed += sum.x;
  written_only[p.x] = sum.y;
}
)",
                                     {image("plain", HEDDLE_ACCESS_SAMPLED, VK_FORMAT_R32_SFLOAT),
                                      image("stack", HEDDLE_ACCESS_SAMPLED_LINEAR, VK_FORMAT_R8G8B8A8_UNORM, 3),
                                      cube,
                                      cubes,
                                      image("ids", HEDDLE_ACCESS_SAMPLED, VK_FORMAT_R32_UINT),
                                      image("signed_ids", HEDDLE_ACCESS_SAMPLED, VK_FORMAT_R32_SINT),
                                      image("map", HEDDLE_ACCESS_SAMPLED_COMPARE, VK_FORMAT_D32_SFLOAT),
                                      image("maps", HEDDLE_ACCESS_SAMPLED_COMPARE, VK_FORMAT_D32_SFLOAT, 4),
                                      image("readable", HEDDLE_ACCESS_STORAGE_READ, VK_FORMAT_R16G16B16A16_SFLOAT),
                                      image("written", HEDDLE_ACCESS_STORAGE_WRITE, VK_FORMAT_R16G16_SFLOAT),
                                      image("layers", HEDDLE_ACCESS_STORAGE_WRITE, VK_FORMAT_R8_UNORM, 4),
                                      image("counts", HEDDLE_ACCESS_STORAGE_READ_WRITE, VK_FORMAT_R32_UINT),
                                      image("both", HEDDLE_ACCESS_STORAGE_READ, VK_FORMAT_R32_SFLOAT),
                                      image("both", HEDDLE_ACCESS_STORAGE_WRITE, VK_FORMAT_R32_SFLOAT),
                                      buffer("counted", HEDDLE_ACCESS_STORAGE_READ, "float total; uint only_read[];"),
                                      buffer("summed", HEDDLE_ACCESS_STORAGE_READ_WRITE, "float mixed; vec4 totals[];"),
                                      buffer("out_", HEDDLE_ACCESS_STORAGE_WRITE, "float written_only[];"),
                                      value("camera", "HeddleView camera;"),
                                      value("lights", "HeddleLight lights[];"),
                                      image("depth", HEDDLE_ACCESS_TRANSFER_READ, VK_FORMAT_D32_SFLOAT)});
  const CompiledShader shader = compile(made, {});
  expect_valid(shader.spirv);
  EXPECT_EQ(ports_of(shader),
            "plain stack cube cubes ids signed_ids map maps readable written layers counts both counted summed out_ "
            "camera lights");
  EXPECT_THAT(shader.local_size, ElementsAre(8, 4, 1));
  using Kind = Binding::Kind;
  EXPECT_EQ(shader.bindings[16].kind, Kind::kUniformBuffer);
  EXPECT_EQ(shader.bindings[17].kind, Kind::kStorageBuffer);
  EXPECT_EQ(shader.bindings[12].access, HEDDLE_ACCESS_STORAGE_READ_WRITE);
  for (std::uint32_t i = 0; i < shader.bindings.size(); ++i) {
    EXPECT_EQ(shader.bindings[i].set, 0U);
    EXPECT_EQ(shader.bindings[i].binding, i);
    EXPECT_EQ(shader.bindings[i].pass, "caller");
  }
}

TEST_F(ShaderGenerate, OnlyBindingsThatTheCodeUsesAreReported) {
  const ShaderRequest made = request(std::string(kCompute) +
                                         "float unused() { return fetch_depth(ivec2(0)).x; }\n"
                                         "void main() { totals[0] = fetch_normal(ivec2(0)).x; }\n",
                                     {image("depth", HEDDLE_ACCESS_SAMPLED, VK_FORMAT_R32_SFLOAT),
                                      image("normal", HEDDLE_ACCESS_SAMPLED, VK_FORMAT_R32_SFLOAT),
                                      buffer("sums", HEDDLE_ACCESS_STORAGE_WRITE, "float totals[];")});
  EXPECT_EQ(ports_of(compile(made, {})), "normal sums");
}

TEST_F(ShaderGenerate, AbsentOptionalPortAnswersItsNeutralValueWithoutABinding) {
  BoundPort depth = image("depth", HEDDLE_ACCESS_SAMPLED, VK_FORMAT_UNDEFINED);
  depth.is_bound = false;
  depth.neutral = {std::numeric_limits<double>::infinity(), 0, 0.25, 1};
  BoundPort map = image("map", HEDDLE_ACCESS_SAMPLED_COMPARE, VK_FORMAT_UNDEFINED);
  map.is_bound = false;
  map.neutral = {1, 1, 1, 1};
  const ShaderRequest made =
      request(std::string(kCompute) +
                  "void main() { totals[0] = fetch_depth(ivec2(0)) + sample_depth(vec2(0)) + fetch_depth(ivec2(0), 1)\n"
                  "  + sample_depth(vec3(0)) + float(size_depth().x) + compare_map(vec2(0), 1.0) + "
                  "compare_map(vec2(0), 1, 1.0)\n"
                  "  + (has_depth ? 1.0 : 0.0); }\n",
              {depth, map, buffer("sums", HEDDLE_ACCESS_STORAGE_WRITE, "vec4 totals[];")});
  const CompiledShader shader = compile(made, {});
  expect_valid(shader.spirv);
  EXPECT_EQ(ports_of(shader), "sums");
  EXPECT_THAT(
      generate_pass_glsl(made),
      HasSubstr("vec4 fetch_depth(ivec2 pixel) { return vec4(uintBitsToFloat(0x7f800000u), 0.0, 0.25, 1.0); }\n"));
  EXPECT_THAT(generate_pass_glsl(made), HasSubstr("const bool has_depth = false;\n"));
}

TEST_F(ShaderGenerate, ParameterLayoutIsWhatTheCompilerReflects) {
  const ShaderRequest made =
      request(std::string(kCompute) +
                  "void main() { totals[0] = vec4(params.sun, 1.0) * params.radius * float(params.steps)\n"
                  "  * float(params.on) * float(params.precision_) * vec4(params.axis, params.last); }\n",
              {buffer("sums", HEDDLE_ACCESS_STORAGE_WRITE, "vec4 totals[];")});
  Technique& technique = technique_of(made);
  technique.parameters = {
      parameter("radius", ParameterType::kFloat), parameter("fixed", ParameterType::kInt, HEDDLE_PARAMETER_CONSTANT),
      parameter("sun", ParameterType::kColor),    parameter("steps", ParameterType::kInt),
      parameter("which", ParameterType::kNames),  parameter("on", ParameterType::kBool),
      parameter("axis", ParameterType::kFloat3),  parameter("precision", ParameterType::kChoice),
      parameter("last", ParameterType::kFloat)};
  const CompiledShader shader = compile(made, {});
  expect_valid(shader.spirv);
  const ParameterLayout layout = parameter_layout(technique);

  const spirv_cross::Compiler compiler(shader.spirv);
  const spirv_cross::ShaderResources resources = compiler.get_shader_resources();
  ASSERT_EQ(resources.uniform_buffers.size(), 1U);
  const spirv_cross::SPIRType& type = compiler.get_type(resources.uniform_buffers[0].base_type_id);
  std::uint32_t member = 0;
  for (std::size_t i = 0; i < technique.parameters.size(); ++i) {
    if (layout.offset[i] == 0xffffffffU) continue;
    EXPECT_EQ(layout.offset[i], compiler.type_struct_member_offset(type, member)) << technique.parameters[i].name;
    ++member;
  }
  EXPECT_EQ(member, type.member_types.size());
  EXPECT_EQ(layout.offset[1], 0xffffffffU);
  EXPECT_EQ(layout.offset[4], 0xffffffffU);
  // std140 rounds a block to 16 bytes.
  EXPECT_EQ(layout.size, (compiler.get_declared_struct_size(type) + 15) / 16 * 16);
  ASSERT_EQ(shader.bindings.size(), 2U);
  EXPECT_EQ(shader.bindings[1].kind, Binding::Kind::kParameters);
}

TEST_F(ShaderGenerate, ConstantParametersAreSpecializationConstantsWithTheirIndex) {
  const ShaderRequest made =
      request(std::string(kCompute) +
                  "void main() { totals[0] = constant_scale * float(constant_steps) * float(constant_mode)\n"
                  "  * (constant_on ? 1.0 : 2.0); }\n",
              {buffer("sums", HEDDLE_ACCESS_STORAGE_WRITE, "float totals[];")});
  technique_of(made).parameters = {parameter("scale", ParameterType::kFloat, HEDDLE_PARAMETER_CONSTANT, 0.5),
                                   parameter("radius", ParameterType::kFloat),
                                   parameter("steps", ParameterType::kInt, HEDDLE_PARAMETER_CONSTANT, -3),
                                   parameter("mode", ParameterType::kChoice, HEDDLE_PARAMETER_CONSTANT, 2),
                                   parameter("on", ParameterType::kBool, HEDDLE_PARAMETER_CONSTANT, 1)};
  const CompiledShader shader = compile(made, {});
  expect_valid(shader.spirv);
  EXPECT_THAT(shader.constants, ElementsAre(ConstantSlot{0, "caller", 0}, ConstantSlot{2, "caller", 2},
                                            ConstantSlot{3, "caller", 3}, ConstantSlot{4, "caller", 4}));
  const spirv_cross::Compiler compiler(shader.spirv);
  std::map<std::uint32_t, std::string> names;
  for (const auto& constant : compiler.get_specialization_constants()) {
    names[constant.constant_id] = compiler.get_name(constant.id);
  }
  EXPECT_EQ(names, (std::map<std::uint32_t, std::string>{
                       {0, "constant_scale"}, {2, "constant_steps"}, {3, "constant_mode"}, {4, "constant_on"}}));
}

TEST_F(ShaderGenerate, FullscreenShaderWritesItsColorsInTheStagesOrder) {
  const ShaderRequest made = request(
      "#include \"pass.glsl\"\n#include \"view.glsl\"\n"
      "layout(push_constant) uniform Push { vec4 tint; float gain; } push;\n"
      "void main() { radiance = vec4(uv, gl_FragCoord.x, 1.0) * push.tint * push.gain; ids = uvec4(7u); }\n",
      {image("radiance", HEDDLE_ACCESS_COLOR, VK_FORMAT_R16G16B16A16_SFLOAT),
       image("depth", HEDDLE_ACCESS_DEPTH, VK_FORMAT_D32_SFLOAT),
       image("ids", HEDDLE_ACCESS_COLOR, VK_FORMAT_R32_UINT)},
      ShaderKind::kFullscreen);
  const CompiledShader shader = compile(made, {});
  expect_valid(shader.spirv);
  EXPECT_EQ(shader.push_bytes, 20U);
  EXPECT_THAT(generate_pass_glsl(made), HasSubstr("layout(location = 0) out vec4 radiance;\n"
                                                  "layout(location = 1) out uvec4 ids;\n"));
}

TEST_F(ShaderGenerate, SurfaceShaderSeesTheSurfaceItsMaterialAndTheView) {
  Role role;
  role.name = "texture_source";
  role.revision = 1;
  role.functions = {{"texture_source",
                     "vec3 texture_source(uint material, vec2 uv, vec2 uv_dx, vec2 uv_dy, vec2 raster_px, "
                     "vec3 otherwise)",
                     "return otherwise;", "1", ""}};
  role.file = "texture_source/role.toml";
  ShaderRequest made = request(
      "#include \"pass.glsl\"\n#include \"surface_sample.glsl\"\n"
      "void main() {\n"
      "  SurfaceSample s = sample_surface(materials[surface.material]);\n"
      "  color = vec4(s.base_color + s.normal, view.near_distance + surface.previous_position_rel.x + surface.uv1.y)\n"
      "      + float(surface.object + surface.flags);\n"
      "}\n",
      {image("color", HEDDLE_ACCESS_COLOR, VK_FORMAT_R16G16B16A16_SFLOAT), value("camera", "HeddleView camera;")},
      ShaderKind::kSurfaces);
  made.roles = {{&role, Join::kSwitch, {}}};
  const CompiledShader shader = compile(made, {});
  expect_valid(shader.spirv);
  EXPECT_TRUE(shader.uses_materials);
  EXPECT_EQ(ports_of(shader), "") << "sets 2 and 3 are not the ports' business";
}

TEST_F(ShaderGenerate, MeshProgramValidatesAndFeedsTheSurfaceBlock) {
  const SurfaceProgram program = mesh_program({}, shared_);
  expect_valid(program.vertex);
  expect_valid(program.masked_fragment);
  const spirv_cross::Compiler vertex(program.vertex);
  const spirv_cross::Compiler fragment(program.masked_fragment);
  const auto out = vertex.get_shader_resources().stage_outputs;
  const auto in = fragment.get_shader_resources().stage_inputs;
  ASSERT_EQ(out.size(), 1U);
  ASSERT_EQ(in.size(), 1U);
  const auto& out_type = vertex.get_type(out[0].base_type_id);
  const auto& in_type = fragment.get_type(in[0].base_type_id);
  ASSERT_EQ(out_type.member_types.size(), 10U);
  ASSERT_EQ(in_type.member_types.size(), 10U);
  for (std::uint32_t i = 0; i < 10; ++i) {
    EXPECT_EQ(vertex.get_member_name(out[0].base_type_id, i), fragment.get_member_name(in[0].base_type_id, i));
    EXPECT_EQ(vertex.get_type(out_type.member_types[i]).vecsize, fragment.get_type(in_type.member_types[i]).vecsize);
  }
}

TEST_F(ShaderGenerate, PortSampledAndStoredInOneStageIsAnError) {
  EXPECT_EQ(error_of(request(std::string(kCompute) + "void main() {}\n",
                             {image("depth", HEDDLE_ACCESS_SAMPLED, VK_FORMAT_R32_SFLOAT),
                              image("depth", HEDDLE_ACCESS_STORAGE_WRITE, VK_FORMAT_R32_SFLOAT)})),
            "error: port 'depth' of stage 'light' of pass 'caller' is accessed in two ways that exclude each other\n"
            "  help:     one stage samples a port, stores into it or draws into it; split the stage, or use "
            "STORAGE_READ_WRITE");
}

TEST_F(ShaderGenerate, StorageReadOfAFormatWithoutQualifierIsAnError) {
  EXPECT_EQ(error_of(request(std::string(kCompute) + "void main() {}\n",
                             {image("base", HEDDLE_ACCESS_STORAGE_READ, VK_FORMAT_R8G8B8A8_SRGB)})),
            "error: port 'base' of stage 'light' of pass 'caller' has format r8g8b8a8_srgb, which no storage image can "
            "be read in\n"
            "  help:     read it as SAMPLED, or give the output another format");
}

TEST_F(ShaderGenerate, PushConstantsBeyond64BytesAreAnError) {
  EXPECT_EQ(error_of(request(std::string(kCompute) + "layout(push_constant) uniform Push { vec4 a[5]; } push;\n"
                                                     "void main() { totals[0] = push.a[4].x; }\n",
                             {buffer("sums", HEDDLE_ACCESS_STORAGE_WRITE, "float totals[];")})),
            place("caller/shade.glsl") +
                ": error: shader 'shade' of pass 'caller' has too many push constants\n"
                "  found:    80 bytes\n"
                "  expected: at most 64 bytes\n"
                "  help:     use a parameter or a value port");
}

}  // namespace
}  // namespace heddle::vulkan
