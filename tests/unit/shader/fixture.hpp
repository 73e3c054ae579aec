// SPDX-License-Identifier: Apache-2.0
// Techniques, roles and requests typed in by hand, their texts in a folder that goes with the test.
#pragma once

#include "vulkan/shader.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <deque>
#include <fstream>
#include <spirv-tools/libspirv.hpp>

namespace heddle::vulkan {

class ShaderTest : public testing::Test {
 protected:
  ShaderTest() {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() /
              ("heddle_shader_" + std::to_string(::getpid()) + "_" + info->test_suite_name() + "_" + info->name());
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_ / "shared");
    shared_ = {folder_ / "shared", std::filesystem::path(HEDDLE_SOURCE_DIR) / "plugins/shared",
               std::filesystem::path(HEDDLE_SOURCE_DIR) / "api"};
  }
  ~ShaderTest() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path write(const std::string& name, const std::string& text) {
    const std::filesystem::path file = folder_ / name;
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file) << text;
    return file;
  }

  /// The role `light`: float light(uint key, vec3 position), neutral 0.5.
  Role light_role(Join join = Join::kSwitch) {
    Role role;
    role.name = "light";
    role.revision = 1;
    role.join = join;
    role.selector = "key";
    role.functions = {{"light", "float light(uint key, vec3 position)", "return 0.5;", "1", ""}};
    role.file = "light/role.toml";
    return role;
  }

  static Parameter parameter(const std::string& name, ParameterType type, std::uint32_t flags = 0, double value = 0) {
    Parameter made;
    made.name = name;
    made.type = type;
    made.flags = flags;
    made.default_value = {value, value, value};
    if (type == ParameterType::kChoice) made.choices = {"a", "b", "c", "d"};
    return made;
  }

  static BoundPort image(const std::string& name, std::uint32_t access, VkFormat format, std::uint32_t layers = 1) {
    BoundPort port;
    port.port = name;
    port.access = access;
    port.format = format;
    port.layers = layers;
    return port;
  }
  static BoundPort buffer(const std::string& name, std::uint32_t access, const std::string& glsl) {
    BoundPort port;
    port.port = name;
    port.access = access;
    port.type = PortType::kBuffer;
    port.glsl = glsl;
    return port;
  }
  static BoundPort list(const std::string& name, std::uint32_t access, const std::string& glsl,
                        std::uint32_t element_bytes) {
    BoundPort port = buffer(name, access, glsl);
    port.is_list = true;
    port.element_bytes = element_bytes;
    return port;
  }
  static BoundPort value(const std::string& name, const std::string& glsl) {
    BoundPort port = buffer(name, HEDDLE_ACCESS_VALUE, glsl);
    port.type = PortType::kValue;
    return port;
  }

  /// A technique that provides the role's function from a file below its folder.
  const Technique& provider_technique(const std::string& id, const std::string& file, const std::string& text,
                                      const std::string& role = "light", std::vector<std::string> calls = {}) {
    Technique& technique = techniques_.emplace_back();
    technique.id = id;
    Function function;
    function.role = role;
    function.file = file;
    function.calls = std::move(calls);
    technique.functions.push_back(function);
    write(id + "/" + file, text);
    return technique;
  }
  ProviderRequest provider(const std::string& pass, const Technique& technique, std::vector<BoundPort> ports = {}) {
    ProviderRequest request;
    request.pass = pass;
    request.technique = &technique;
    request.folder = folder_ / technique.id;
    request.ports = std::move(ports);
    return request;
  }

  /// Shader `shade` of pass `caller`, technique lighting/test.
  ShaderRequest request(const std::string& text, std::vector<BoundPort> ports = {},
                        ShaderKind kind = ShaderKind::kCompute) {
    Technique& technique = techniques_.emplace_back();
    technique.id = "lighting/test";
    Shader& shader = shaders_.emplace_back();
    shader.name = "shade";
    shader.kind = kind;
    shader.stage = "light";
    shader.file = "shade.glsl";
    write("caller/shade.glsl", text);
    ShaderRequest made;
    made.pass = "caller";
    made.technique = &technique;
    made.shader = &shader;
    made.folder = folder_ / "caller";
    made.ports = std::move(ports);
    made.shared_folders = shared_;
    return made;
  }
  Technique& technique_of(const ShaderRequest& made) {
    for (Technique& technique : techniques_) {
      if (&technique == made.technique) return technique;
    }
    throw std::logic_error("a request of another test");
  }

  /// A compute shader that writes light(key, 0) for keys 0..3 to `result`.
  ShaderRequest calling_request() {
    return request(
        "#include \"pass.glsl\"\n"
        "#include \"role/light.glsl\"\n"
        "layout(local_size_x = 8) in;\n"
        "void main() {\n"
        "  if (gl_LocalInvocationID.x < 4u) result[gl_LocalInvocationID.x] = light(gl_LocalInvocationID.x, "
        "vec3(2.0));\n"
        "}\n",
        {buffer("answers", HEDDLE_ACCESS_STORAGE_WRITE, "float result[];")});
  }

  std::string place(const std::string& name) const { return (folder_ / name).string(); }

  /// Text of the error that compiling throws; "" if it throws none.
  static std::string error_of(const ShaderRequest& made) {
    try {
      compile(made, {});
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), HEDDLE_BAD_INPUT);
      return to_text(error.diagnostics());
    }
    return "";
  }

  static void expect_valid(const std::vector<std::uint32_t>& words) {
    spvtools::SpirvTools tools(SPV_ENV_VULKAN_1_3);
    std::string messages;
    tools.SetMessageConsumer([&](spv_message_level_t, const char*, const spv_position_t&, const char* message) {
      messages += message;
      messages += '\n';
    });
    EXPECT_TRUE(tools.Validate(words)) << messages;
  }

  std::filesystem::path folder_;
  std::vector<std::filesystem::path> shared_;
  std::deque<Technique> techniques_;
  std::deque<Shader> shaders_;
};

}  // namespace heddle::vulkan
