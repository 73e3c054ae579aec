// SPDX-License-Identifier: Apache-2.0
// host/vulkan/shader_join.cpp: functions of roles joined with their callers. What the joined code computes is tested in
// pipeline_test.cpp; here: that it compiles, what it binds, whose names it keeps apart.
#include "unit/shader/fixture.hpp"

namespace heddle::vulkan {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

class ShaderJoin : public ShaderTest {};

constexpr const char* kPlain = "float light(uint key, vec3 position) { return position.x; }\n";

std::string bindings_of(const CompiledShader& shader) {
  std::string text;
  for (const Binding& b : shader.bindings) {
    text += std::to_string(b.set) + "." + std::to_string(b.binding) + "=" + b.pass + "." + b.port + b.role + " ";
  }
  return text;
}

TEST_F(ShaderJoin, WithoutProviderTheNeutralBodyIsCompiledIn) {
  Role role = light_role();
  ShaderRequest made = calling_request();
  made.roles = {{&role, role.join, {}}};
  const CompiledShader shader = compile(made, {});
  expect_valid(shader.spirv);
  EXPECT_THAT(generate_role_glsl(made, "light"), HasSubstr("float light(uint key, vec3 position) { return 0.5; }\n"));
  EXPECT_EQ(bindings_of(shader), "0.0=caller.answers ");
}

TEST_F(ShaderJoin, ProvidersShareOneSetAndKeepTheirPortsAndParameters) {
  Role role = light_role(Join::kSum);
  Technique& map = const_cast<Technique&>(
      provider_technique("light/map", "map.glsl",
                         "#include \"octahedral.glsl\"\n"
                         "float lookup(vec2 uv) { return sample_depth(uv).x * params.scale + constant_gain; }\n"
                         "float light(uint key, vec3 position) { return lookup(position.xy) + lights[key].range + "
                         "camera.half_size.x; }\n"));
  map.parameters = {parameter("scale", ParameterType::kFloat),
                    parameter("gain", ParameterType::kFloat, HEDDLE_PARAMETER_CONSTANT, 2.0)};
  const std::vector<BoundPort> ports{image("depth", HEDDLE_ACCESS_SAMPLED_LINEAR, VK_FORMAT_R32_SFLOAT),
                                     value("lights", "HeddleLight lights[];"), value("camera", "HeddleView camera;")};
  ShaderRequest made = calling_request();
  made.ports.push_back(value("camera", "HeddleView camera;"));
  made.roles = {{&role, Join::kSum, {provider("sun", map, ports), provider("lamp", map, ports)}}};
  const CompiledShader shader = compile(made, {});
  expect_valid(shader.spirv);
  EXPECT_EQ(bindings_of(shader),
            "0.0=caller.answers 1.0=sun.depth 1.1=sun.lights 1.2=sun.camera 1.3=sun. 1.4=lamp.depth 1.5=lamp.lights "
            "1.6=lamp.camera 1.7=lamp. ");
  ASSERT_EQ(shader.constants.size(), 2U);
  EXPECT_EQ(shader.constants[0].pass, "sun");
  EXPECT_EQ(shader.constants[0].parameter, 1U);
  EXPECT_EQ(shader.constants[1].pass, "lamp");
  EXPECT_NE(shader.constants[0].id, shader.constants[1].id);
}

TEST_F(ShaderJoin, EqualNamesInProvidersAndCallerDoNotClash) {
  Role role = light_role(Join::kProduct);
  // Each has a struct, a constant, a macro, a helper, a global and an own include of the same names; a member of a
  // record that is named like a port.
  const std::string text =
      "#include \"helper.glsl\"\n"
      "#define SCALE 2.0\n"
      "struct Ray { float range; vec3 origin; };\n"
      "const float kStep = 1.0;\n"
      "float state;\n"
      "float range(Ray ray) { return ray.range * SCALE * kStep + help(ray.origin) + fetch_normal(ivec2(0)).x; }\n"
      "float light(uint key, vec3 position) {\n"
      "  state = kStep; Ray ray = Ray(state, position); HeddleLight record; record.radius = 1.0; radius = ray.range;\n"
      "  return range(ray) + record.radius + radius;\n"
      "}\n";
  const std::string helper =
      "#ifndef HELPER_GLSL\n#define HELPER_GLSL\nfloat radius;\nfloat help(vec3 v) { return v.x; }\n#endif\n";
  const Technique& a = provider_technique("light/a", "a.glsl", text);
  write("light/a/helper.glsl", helper);
  const Technique& b = provider_technique("light/b", "b.glsl", text);
  write("light/b/helper.glsl", helper);
  const std::vector<BoundPort> ports{image("normal", HEDDLE_ACCESS_SAMPLED, VK_FORMAT_R16G16_SNORM)};
  ShaderRequest made = request(
      "#include \"pass.glsl\"\n"
      "#define SCALE 7\n"
      "#define position ERROR\n"
      "#include \"role/light.glsl\"\n"
      "layout(local_size_x = 8) in;\n"
      "struct Ray { int x; };\n"
      "const float kStep = 3.0;\n"
      "float help(int i) { return 1.0; }\n"
      "float light_p0(int i) { return 1.0; }\n"
      "void main() { result[0] = light(0u, vec3(0.0)) + kStep + help(SCALE) + light_p0(1); }\n",
      {buffer("answers", HEDDLE_ACCESS_STORAGE_WRITE, "float result[];"),
       image("normal", HEDDLE_ACCESS_SAMPLED, VK_FORMAT_R16G16_SNORM)});
  made.roles = {{&role, Join::kProduct, {provider("x", a, ports), provider("y", b, ports), provider("z", a, ports)}}};
  const CompiledShader shader = compile(made, {});
  expect_valid(shader.spirv);
}

TEST_F(ShaderJoin, SwitchReadsAProvidersTableAndHasTheNeutralBodyAsDefault) {
  Role role = light_role(Join::kSwitch);
  role.functions.push_back({"light_bound", "float light_bound(vec3 position)", "return 1.0;", "", ""});
  const Technique& both = provider_technique(
      "light/both", "both.glsl", std::string(kPlain) + "float light_bound(vec3 position) { return 2.0; }\n");
  ShaderRequest made = calling_request();
  made.roles = {{&role, Join::kSwitch, {provider("sun", both), provider("lamp", both)}}};
  const CompiledShader shader = compile(made, {});
  expect_valid(shader.spirv);
  const std::string text = generate_role_glsl(made, "light");
  EXPECT_THAT(text, HasSubstr("  switch (provider_of_light[key]) {\n"
                              "    case 0u: return light_p0(key, position);\n"
                              "    case 1u: return light_p1(key, position);\n"
                              "    default: { return 0.5; }\n"
                              "  }\n"));
  EXPECT_THAT(text, HasSubstr("float light_bound(vec3 position) {\n  return light_bound_p0(position);\n}\n"));
  EXPECT_EQ(bindings_of(shader), "0.0=caller.answers 1.0=caller.light ");
  EXPECT_EQ(shader.bindings[1].kind, Binding::Kind::kSwitchTable);
}

TEST_F(ShaderJoin, OneProviderNeedsNoTable) {
  Role role = light_role(Join::kSwitch);
  const Technique& plain = provider_technique("light/plain", "plain.glsl", kPlain);
  ShaderRequest made = calling_request();
  made.roles = {{&role, Join::kSwitch, {provider("sun", plain)}}};
  EXPECT_THAT(generate_role_glsl(made, "light"), Not(HasSubstr("provider_of")));
  EXPECT_EQ(bindings_of(compile(made, {})), "0.0=caller.answers ");
}

TEST_F(ShaderJoin, ProviderMayCallFunctionsOfAnotherRole) {
  Role role = light_role();
  Role medium;
  medium.name = "medium";
  medium.join = Join::kProduct;
  medium.functions = {{"density", "void density(vec3 position, inout float sum)", "", "", ""}};
  const Technique& fog = provider_technique(
      "medium/fog", "fog.glsl", "void density(vec3 position, inout float sum) { sum += position.x; }\n", "medium");
  const Technique& march = provider_technique(
      "light/march", "march.glsl",
      "#include \"role/medium.glsl\"\n"
      "float light(uint key, vec3 position) { float sum = 0.0; density(position, sum); return sum; }\n",
      "light", {"medium"});
  ShaderRequest made = calling_request();
  made.roles = {{&medium, medium.join, {provider("fog", fog), provider("mist", fog)}},
                {&role, role.join, {provider("sun", march)}}};
  expect_valid(compile(made, {}).spirv);
}

TEST_F(ShaderJoin, ProviderOfAnOlderRevisionGetsNeutralBodiesForLaterFunctions) {
  Role role = light_role();
  role.revision = 2;
  role.functions.push_back({"light_bound", "float light_bound(vec3 position)", "return 1.0;", "", ""});
  const Technique& plain = provider_technique("light/plain", "plain.glsl", kPlain);
  ShaderRequest made = calling_request();
  made.roles = {{&role, Join::kSwitch, {provider("sun", plain)}}};
  expect_valid(compile(made, {}).spirv);
  EXPECT_THAT(generate_role_glsl(made, "light"), HasSubstr("float light_bound_p0(vec3 position) { return 1.0; }\n"));
}

std::string with_loops(int count, const std::string& signature) {
  std::string text = signature + " {\n  float sum = 0.0;\n";
  for (int i = 0; i < count; ++i) text += "  for (uint i = 0u; i < key; ++i) sum += position.x;\n";
  return text + "  return sum;\n}\n";
}

TEST_F(ShaderJoin, MoreThanEightLoopsAreAWarningThatNamesTheProviders) {
  Role role = light_role(Join::kSum);
  const std::string signature = "float light(uint key, vec3 position)";
  write("shared/loops.glsl",
        "#ifndef LOOPS\n#define LOOPS\n" + with_loops(1, "float shared_loop(uint key, vec3 position)") + "#endif\n");
  const Technique& three = provider_technique("light/three", "a.glsl", with_loops(3, signature));
  const Technique& five = provider_technique(
      "light/five", "b.glsl",
      "#include \"loops.glsl\"\n" + with_loops(4, "float own(uint key, vec3 position)") +
          "float never_called(uint key) { for (uint i = 0u; i < key; ++i) if (i > 3u) return 1.0; return 0.0; }\n"
          "float light(uint key, vec3 position) { return own(key, position) + shared_loop(key, position); }\n");
  ShaderRequest made = request(
      "#include \"pass.glsl\"\n#include \"role/light.glsl\"\nlayout(local_size_x = 8) in;\n"
      "void main() { for (uint i = 0u; i < 4u; ++i) result[i] = light(i, vec3(1.0)); }\n",
      {buffer("answers", HEDDLE_ACCESS_STORAGE_WRITE, "float result[];")});
  made.roles = {{&role, Join::kSum, {provider("sun", three), provider("lamp", five)}}};
  const CompiledShader shader = compile(made, {});
  EXPECT_EQ(shader.loops, 9U);
  EXPECT_THAT(shader.warnings,
              ElementsAre("shader 'shade' of pass 'caller' has 9 loops (1 of its own, 3 in function 'light' of pass "
                          "'sun' (light/three), 5 in function 'light' of pass 'lamp' (light/five)); with more than 8 "
                          "the first frame waits for seconds on lavapipe"));
  made.roles[0].providers.pop_back();
  const CompiledShader fewer = compile(made, {});
  EXPECT_EQ(fewer.loops, 4U);
  EXPECT_THAT(fewer.warnings, testing::IsEmpty());
}

TEST_F(ShaderJoin, TestCallerCallsEveryFunctionOfARole) {
  Role role = light_role();
  role.functions.push_back({"fill", "void fill(inout vec3 color, out float weights[4])", "", "", ""});
  const Technique& plain = provider_technique(
      "light/plain", "plain.glsl",
      std::string(kPlain) + "void fill(inout vec3 color, out float weights[4]) { color.x += seen[0]; }\n");
  const CompiledShader shader = compile_with_test_caller(
      role, provider("sun", plain, {buffer("seen", HEDDLE_ACCESS_STORAGE_READ, "float seen[];")}), {}, shared_);
  expect_valid(shader.spirv);
  EXPECT_EQ(bindings_of(shader), "1.0=sun.seen ") << "used only if both functions were called";
}

TEST_F(ShaderJoin, EveryRoleOfTheProjectHasACallableTestCaller) {
  const std::filesystem::path plugins = std::filesystem::path(HEDDLE_SOURCE_DIR) / "plugins";
  int roles = 0;
  for (const auto& entry : std::filesystem::directory_iterator(plugins)) {
    if (!std::filesystem::exists(entry.path() / "role.toml")) continue;
    const Role role = read_role(entry.path() / "role.toml");
    if (role.functions.empty()) continue;
    ++roles;
    std::string bodies;
    for (const RoleFunction& function : role.functions) {
      bodies += function.signature + " { " + function.neutral + " }\n";
    }
    const Technique& technique = provider_technique(role.name + "/neutral", "neutral.glsl", bodies, role.name);
    expect_valid(compile_with_test_caller(role, provider("p", technique), {}, shared_).spirv);
  }
  EXPECT_GE(roles, 3);
}

}  // namespace
}  // namespace heddle::vulkan
