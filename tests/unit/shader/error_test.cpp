// SPDX-License-Identifier: Apache-2.0
// What people are told when a join fails: the whole text, and in whose file.
#include "unit/shader/fixture.hpp"

namespace heddle::vulkan {
namespace {

class ShaderError : public ShaderTest {
 protected:
  // Error of the calling shader joined by sum with a right provider, the given text, and the right one again.
  std::string error_with(const std::string& text) {
    Role role = light_role(Join::kSum);
    const Technique& right = provider_technique(
        "light/right", "right.glsl",
        "float helper(vec3 p) { return p.x; }\nfloat light(uint key, vec3 position) { return helper(position); }\n");
    const Technique& wrong = provider_technique("light/wrong", "wrong.glsl", text);
    ShaderRequest made = calling_request();
    made.roles = {{&role, Join::kSum, {provider("a", right), provider("sun", wrong), provider("b", right)}}};
    return error_of(made);
  }
  std::string wrong(const std::string& line) { return place("light/wrong/wrong.glsl") + line; }
};

const std::string kRight = "float light(uint key, vec3 position) { return 1.0; }\n";

// Trap 1: a provider that binds for itself aliases the caller's buffer in silence.
TEST_F(ShaderError, ProviderThatBindsForItself) {
  EXPECT_EQ(error_with("layout(set = 0, binding = 1) readonly buffer Mine { float mine[]; };\n" + kRight),
            wrong(":1: error: function 'light' of pass 'sun' (light/wrong) has layout()\n"
                  "  help:     remove it: the host binds the ports that the function's descriptor lists"));
}

TEST_F(ShaderError, ProviderThatDeclaresASamplerWithoutLayout) {
  EXPECT_EQ(error_with("\nuniform sampler2D mine;\n" + kRight),
            wrong(":2: error: function 'light' of pass 'sun' (light/wrong) declares a uniform of its own\n"
                  "  help:     list a port in the function's descriptor: it is declared for the text"));
}

// Trap 2: the compiler reports a lost brace in the next provider's file, a lost #endif in the caller.
TEST_F(ShaderError, ProviderWithALostBrace) {
  EXPECT_EQ(error_with("float light(uint key, vec3 position) {\n  if (key > 1u) {\n  return 1.0;\n}\n"),
            wrong(":1: error: function 'light' of pass 'sun' (light/wrong): '{' is never closed"));
}

TEST_F(ShaderError, ProviderWithALostEndif) {
  EXPECT_EQ(error_with(kRight + "\n#ifdef FAST\n"),
            wrong(":3: error: function 'light' of pass 'sun' (light/wrong): #ifdef has no #endif"));
}

// Trap 3: the compiler reports a wrong signature in the generated text.
TEST_F(ShaderError, ProviderWithAnotherSignature) {
  EXPECT_EQ(error_with("float other() { return 1.0; }\nfloat light(uint key, vec2 position) { return 1.0; }\n"),
            wrong(":2: error: function 'light' of pass 'sun' (light/wrong): 'light' has another signature\n"
                  "  found:    float light(uint key, vec2 position)\n"
                  "  expected: float light(uint key, vec3 position)\n"
                  "  help:     role 'light' defines it in light/role.toml"));
}

TEST_F(ShaderError, ProviderWithoutTheFunction) {
  EXPECT_EQ(error_with("float lihgt(uint key, vec3 position) { return 1.0; }\n"),
            wrong(": error: function 'light' of pass 'sun' (light/wrong) does not define 'light'\n"
                  "  found:    functions lihgt\n"
                  "  expected: float light(uint key, vec3 position)"));
}

// Trap 4: an include of another role, which the descriptor does not tell the graph of.
TEST_F(ShaderError, ProviderThatIncludesARoleItDoesNotCall) {
  EXPECT_EQ(error_with("#include \"role/medium.glsl\"\n" + kRight),
            wrong(":1: error: function 'light' of pass 'sun' (light/wrong) includes role 'medium', which it does not "
                  "say that it calls\n"
                  "  found:    calls nothing\n"
                  "  help:     add \"medium\" to `calls` of the function's descriptor"));
}

// Trap 5.
TEST_F(ShaderError, ProviderWithVersionOrExtension) {
  EXPECT_EQ(error_with("#version 450\n#extension GL_EXT_ray_query : require\n" + kRight),
            wrong(":1: error: function 'light' of pass 'sun' (light/wrong) has #version\n"
                  "  help:     remove it: the host writes #version 460 and its extensions once for the joined text\n") +
                wrong(":2: error: function 'light' of pass 'sun' (light/wrong) has #extension\n"
                      "  help:     remove it: the host writes #version 460 and its extensions once for the joined "
                      "text"));
}

// Trap 6: the compiler accepts it and writes words that are not valid.
TEST_F(ShaderError, ProviderThatPassesImagesOn) {
  EXPECT_EQ(error_with("void store(writeonly image2D target) { imageStore(target, ivec2(0), vec4(1.0)); }\n" + kRight),
            wrong(":1: error: function 'light' of pass 'sun' (light/wrong): 'store' takes an image as parameter\n"
                  "  found:    void store(writeonly image2D target)\n"
                  "  help:     use the port by its name: images cannot be passed on"));
}

TEST_F(ShaderError, ProviderThatIncludesPassGlsl) {
  EXPECT_EQ(error_with("#include \"pass.glsl\"\n" + kRight),
            wrong(":1: error: function 'light' of pass 'sun' (light/wrong) includes pass.glsl\n"
                  "  help:     remove it: the ports and parameters of a function are declared for it without"));
}

TEST_F(ShaderError, MistakeInAProviderNamesItsFileItsPassAndItsOwnSpelling) {
  EXPECT_EQ(error_with("float helper(float x) { return x; }\n\n"
                       "float light(uint key, vec3 position) { return helper(position); }\n"),
            wrong(":3: error: function 'light' of pass 'sun' (light/wrong): 'helper': no matching overloaded function "
                  "found\n"
                  "  help:     it fails alone as well, called by a test"));
}

TEST_F(ShaderError, ProviderCannotMeanAPortOfTheCaller) {
  EXPECT_EQ(error_with("float light(uint key, vec3 position) { return result[0]; }\n"),
            wrong(":1: error: function 'light' of pass 'sun' (light/wrong): 'result': undeclared identifier\n"
                  "  help:     it fails alone as well, called by a test"));
}

TEST_F(ShaderError, MistakeInTheCallerNamesItsFile) {
  Role role = light_role();
  const Technique& plain = provider_technique("light/plain", "plain.glsl", kRight);
  ShaderRequest made = request(
      "#include \"pass.glsl\"\n#include \"role/light.glsl\"\nlayout(local_size_x = 8) in;\n"
      "void main() {\n  result[0] = light(0u, missing);\n}\n",
      {buffer("answers", HEDDLE_ACCESS_STORAGE_WRITE, "float result[];")});
  made.roles = {{&role, Join::kSwitch, {provider("sun", plain)}}};
  EXPECT_EQ(error_of(made), place("caller/shade.glsl") +
                                ":5: error: shader 'shade' of pass 'caller': 'missing': undeclared identifier\n"
                                "  help:     it fails with neutral functions as well");
}

TEST_F(ShaderError, CallerThatIncludesARoleItDoesNotCall) {
  const std::string text = error_of(request("#include \"pass.glsl\"\n#include \"role/light.glsl\"\nvoid main() {}\n"));
  EXPECT_EQ(text,
            place("caller/shade.glsl") +
                ":2: error: shader 'shade' of pass 'caller': role 'light' is included and is not among its `calls`");
}

TEST_F(ShaderError, CallerThatIncludesAFileThatDoesNotExist) {
  const std::string text = error_of(request("#include \"pass.glsl\"\n#include \"veiw.glsl\"\nvoid main() {}\n"));
  EXPECT_EQ(text, place("caller/shade.glsl") +
                      ":2: error: shader 'shade' of pass 'caller': the included file 'veiw.glsl' is neither "
                      "in the technique's folder nor in plugins/shared");
}

TEST_F(ShaderError, CallerThatBindsForItself) {
  EXPECT_EQ(error_of(request("#include \"pass.glsl\"\nlayout(set = 0, binding = 0) buffer B { float b[]; };\n"
                             "void main() {}\n")),
            place("caller/shade.glsl") +
                ":2: error: shader 'shade' of pass 'caller' has layout(set)\n"
                "  help:     remove it: the host binds the ports that the stage's descriptor lists");
}

const std::string kMadeHelp =
    "\n  help:     the technique made this text while it ran: it is a mistake of the technique, not of the graph";

TEST_F(ShaderError, MistakeInATextThatThePassMadeShowsItsLine) {
  ShaderRequest made =
      request("#include \"pass.glsl\"\n#include \"generated/curve.glsl\"\nvoid main() { result[0] = curve(1.0); }\n",
              {buffer("answers", HEDDLE_ACCESS_STORAGE_WRITE, "float result[];")});
  made.texts["generated/curve.glsl"] = "float curve(float x) {\n  return x + offset;\n}\n";
  EXPECT_EQ(error_of(made),
            "generated/curve.glsl:2: error: shader 'shade' of pass 'caller': 'offset': undeclared identifier\n"
            "  found:    return x + offset;" +
                kMadeHelp);
}

TEST_F(ShaderError, MistakeInATextThatAProviderMadeShowsItsLineInItsOwnSpelling) {
  Role role = light_role();
  const Technique& curved = provider_technique("light/curved", "curved.glsl",
                                               "#include \"generated/curve.glsl\"\n"
                                               "float light(uint key, vec3 position) { return curve(position.x); }\n");
  write("light/curved/generated/curve.glsl", "float curve(float x) { return x; }\n");
  ShaderRequest made = calling_request();
  made.roles = {{&role, Join::kSwitch, {provider("sun", curved)}}};
  made.roles[0].providers[0].texts["generated/curve.glsl"] = "float curve(vec2 x) { return x.x; }\nfloat y = z;\n";
  EXPECT_EQ(error_of(made),
            "generated/curve.glsl:2: error: function 'light' of pass 'sun' (light/curved): 'z': undeclared identifier\n"
            "  found:    float y = z;" +
                kMadeHelp + "\n" + place("light/curved/curved.glsl") +
                ":2: error: function 'light' of pass 'sun' (light/curved): 'curve': no matching overloaded function "
                "found\n"
                "  help:     it fails alone as well, called by a test");
}

TEST_F(ShaderError, TextThatThePassMadeBindsForItself) {
  ShaderRequest made = request("#include \"pass.glsl\"\n#include \"generated/table.glsl\"\nvoid main() {}\n");
  made.texts["generated/table.glsl"] = "\nlayout(binding = 3) uniform sampler2D table;\n";
  EXPECT_EQ(error_of(made),
            "generated/table.glsl:2: error: shader 'shade' of pass 'caller' has layout(binding)\n"
            "  help:     remove it: the host binds the ports that the stage's descriptor lists");
}

TEST_F(ShaderError, CallerWithoutAFile) {
  const ShaderRequest made = request("");
  std::filesystem::remove(folder_ / "caller/shade.glsl");
  EXPECT_EQ(error_of(made),
            place("caller/shade.glsl") + ": error: the file of shader 'shade' of pass 'caller' cannot be read");
}

TEST_F(ShaderError, SeveralProvidersOfARoleThatCannotTellThemApart) {
  Role role = light_role();
  role.selector = "material";
  const Technique& plain = provider_technique("light/plain", "plain.glsl", kRight);
  ShaderRequest made = calling_request();
  made.roles = {{&role, Join::kSwitch, {provider("sun", plain), provider("lamp", plain)}}};
  EXPECT_EQ(error_of(made),
            "error: role 'light' takes one provider for shader 'shade' of pass 'caller'\n"
            "  found:    passes sun, lamp\n"
            "  expected: one pass\n"
            "  help:     choose it with functions.light = [\"sun\"] in pass 'caller'");
}

TEST_F(ShaderError, TooManyBuffersForAStageNamesTheProviders) {
  Role role = light_role(Join::kSum);
  std::string text = "float light(uint key, vec3 position) { return 0.0";
  std::vector<BoundPort> ports;
  for (int i = 0; i < 17; ++i) {
    const std::string name = "value" + std::to_string(i);
    ports.push_back(value(name, "vec4 " + name + ";"));
    text += " + " + name + ".x";
  }
  const Technique& many = provider_technique("light/many", "many.glsl", text + "; }\n");
  ShaderRequest made = calling_request();
  made.roles = {{&role, Join::kSum, {provider("sun", many, ports), provider("lamp", many, ports)}}};
  EXPECT_EQ(
      error_of(made),
      "error: shader 'shade' of pass 'caller' uses too many storage buffers for one stage\n"
      "  found:    35: 1 of its own, 17 of function 'light' of pass 'sun' (light/many), 17 of function 'light' of "
      "pass 'lamp' (light/many)\n"
      "  expected: at most 32\n"
      "  help:     use fewer providers, or split the pass");
}

}  // namespace
}  // namespace heddle::vulkan
