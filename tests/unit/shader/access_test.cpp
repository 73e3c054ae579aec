// SPDX-License-Identifier: Apache-2.0
// What code does to a binding is found for every kind of use, and what its descriptor does not declare is refused with
// the whole message that an author meets.
#include "vulkan/shader_access.hpp"

#include "unit/shader/fixture.hpp"

#include <shaderc/shaderc.hpp>

namespace heddle::vulkan {
namespace {

using shader::BoundVariable;

/// Words of a compute shader: declarations, then statements of main().
std::vector<std::uint32_t> words_of(const std::string& declarations, const std::string& statements) {
  const std::string text =
      "#version 460\n#extension GL_EXT_shader_atomic_float : enable\n"
      "#extension GL_EXT_shader_image_load_formatted : enable\nlayout(local_size_x = 8) in;\n" +
      declarations + "\nvoid main() {\n" + statements + "\n}\n";
  const shaderc::Compiler compiler;
  shaderc::CompileOptions options;
  options.SetTargetEnvironment(shaderc_target_env_vulkan, shaderc_env_version_vulkan_1_3);
  options.SetTargetSpirv(shaderc_spirv_version_1_6);
  options.SetOptimizationLevel(shaderc_optimization_level_zero);
  const auto result = compiler.CompileGlslToSpv(text, shaderc_compute_shader, "test", options);
  EXPECT_EQ(result.GetErrorMessage(), "") << text;
  return {result.cbegin(), result.cend()};
}

/// "B:rw C:-": each variable of the module with what is done to it.
std::string accesses(const std::string& declarations, const std::string& statements) {
  std::string text;
  for (const BoundVariable& variable : shader::find_accesses(words_of(declarations, statements))) {
    text += (text.empty() ? "" : " ") + variable.name + ":";
    if (variable.reads) text += "r";
    if (variable.writes) text += "w";
    if (!variable.reads && !variable.writes) text += "-";
    if (variable.reads_without_format) text += "?";
  }
  return text;
}

const std::string kTwoBuffers =
    "struct Item { vec4 a; float b[4]; };\n"
    "layout(set = 0, binding = 0, std430) buffer A { Item one; uint count; float values[]; };\n"
    "layout(set = 0, binding = 1, std430) buffer B { Item one; uint count; float values[]; } other;\n";

TEST(Access, BufferIsReadByLoadsAndWrittenByStores) {
  EXPECT_EQ(accesses(kTwoBuffers, "float x = values[3]; other.values[2] = x;"), "A:r other:w");
}
TEST(Access, WholeStructuresAreCopied) {
  EXPECT_EQ(accesses(kTwoBuffers, "other.one = one;"), "A:r other:w");
}
TEST(Access, MemberOfAMemberIsReachedThroughChains) {
  EXPECT_EQ(accesses(kTwoBuffers, "one.b[gl_LocalInvocationIndex] += 1.0; float y = other.one.a.z;"), "A:rw other:r");
}
TEST(Access, ComponentOfAVectorIsAStore) {
  EXPECT_EQ(accesses(kTwoBuffers, "one.a.y = 2.0;"), "A:w other:-");
}
TEST(Access, AtomicsReadAndWrite) {
  EXPECT_EQ(accesses(kTwoBuffers, "atomicAdd(count, 1u); uint u = atomicExchange(other.count, 2u);"), "A:rw other:rw");
}
TEST(Access, FloatAtomicsReadAndWrite) {
  EXPECT_EQ(accesses(kTwoBuffers, "atomicAdd(values[1], 1.0);"), "A:rw other:-");
}
TEST(Access, CompareAndSwapReadsAndWrites) {
  EXPECT_EQ(accesses(kTwoBuffers, "atomicCompSwap(count, 1u, 2u);"), "A:rw other:-");
}
TEST(Access, AtomicsAloneAreTold) {
  const auto is_atomic = [](const std::string& statements) {
    return shader::find_accesses(words_of(kTwoBuffers, statements))[0].is_atomic;
  };
  EXPECT_TRUE(is_atomic("atomicAdd(count, 1u);"));
  EXPECT_FALSE(is_atomic("atomicAdd(count, 1u); values[0] = 1.0;"));
  EXPECT_FALSE(is_atomic("count += 1u;"));
  EXPECT_FALSE(is_atomic(""));
}
TEST(Access, LengthIsNeitherReadNorWrite) {
  EXPECT_EQ(accesses(kTwoBuffers, "uint n = values.length(); other.count = n;"), "A:- other:w");
}
TEST(Access, DeclaredAloneIsNoAccess) {
  EXPECT_EQ(accesses(kTwoBuffers, ""), "A:- other:-");
}
TEST(Access, CodeBehindAFalseConditionCounts) {
  EXPECT_EQ(accesses(kTwoBuffers, "if (false) count = 1u;"), "A:w other:-") << "it errs towards used: glslang keeps it";
}
TEST(Access, CodeBehindASpecializationConstantCounts) {
  EXPECT_EQ(accesses(kTwoBuffers + "layout(constant_id = 0) const bool on = false;\n", "if (on) count = 1u;"),
            "A:w other:-");
}
TEST(Access, FunctionThatNobodyCallsIsNoAccess) {
  EXPECT_EQ(accesses(kTwoBuffers + "void unused() { count = 1u; }\n", "other.count = 1u;"), "A:- other:w");
}
TEST(Access, FunctionsAreFollowedFromTheEntryPoint) {
  EXPECT_EQ(accesses(kTwoBuffers + "float deep(uint i) { return values[i]; }\nfloat f(uint i) { return deep(i); }\n",
                     "other.values[0] = f(1u);"),
            "A:r other:w");
}
TEST(Access, ArgumentsAreCopiedInAndOut) {
  EXPECT_EQ(accesses(kTwoBuffers + "void change(inout float x) { x *= 2.0; }\nvoid set(out float x) { x = 1.0; }\n",
                     "change(values[0]); set(other.values[0]);"),
            "A:rw other:w");
}
TEST(Access, BlocksInAnArrayAreOneBinding) {
  EXPECT_EQ(accesses("layout(set = 0, binding = 0, std430) buffer A { float values[]; } blocks[4];\n",
                     "blocks[2].values[0] = 1.0;"),
            "blocks:w");
  EXPECT_EQ(accesses("layout(set = 0, binding = 0, std430) readonly buffer A { float values[]; } blocks[4];\n"
                     "layout(set = 0, binding = 1, std430) buffer B { float made[]; };\n",
                     "for (uint i = 0u; i < 4u; ++i) made[i] = blocks[i].values[0];"),
            "blocks:r B:w");
}
TEST(Access, UniformBlocksAreRead) {
  EXPECT_EQ(accesses("layout(set = 0, binding = 0) uniform U { mat4 m; } u;\n"
                     "layout(set = 0, binding = 1) buffer B { vec4 v; };\n",
                     "v = u.m * vec4(1.0);"),
            "u:r B:w");
}

const std::string kImages =
    "layout(set = 0, binding = 0, r32f) uniform image2D a;\n"
    "layout(set = 0, binding = 1, r32ui) uniform uimage2DArray b;\n"
    "layout(set = 0, binding = 2) uniform sampler2D c;\n"
    "layout(set = 0, binding = 3) uniform sampler2DArrayShadow d;\n";

TEST(Access, StorageImagesAreLoadedAndStored) {
  EXPECT_EQ(accesses(kImages, "imageStore(a, ivec2(0), vec4(1.0));"), "a:w b:- c:- d:-");
  EXPECT_EQ(accesses(kImages, "vec4 x = imageLoad(a, ivec2(0));"), "a:r b:- c:- d:-");
  EXPECT_EQ(accesses(kImages, "imageStore(a, ivec2(0), 2.0 * imageLoad(a, ivec2(1)));"), "a:rw b:- c:- d:-");
}
TEST(Access, ImageAtomicsReadAndWrite) {
  EXPECT_EQ(accesses(kImages, "imageAtomicMax(b, ivec3(0), 1u);"), "a:- b:rw c:- d:-");
}
TEST(Access, SizesOfImagesAreNoAccess) {
  EXPECT_EQ(accesses(kImages, "ivec2 s = imageSize(a) + textureSize(c, 0); int n = textureQueryLevels(c);"),
            "a:- b:- c:- d:-");
}
TEST(Access, SampledImagesAreRead) {
  EXPECT_EQ(accesses(kImages, "vec4 x = textureLod(c, vec2(0.5), 0.0);"), "a:- b:- c:r d:-");
  EXPECT_EQ(accesses(kImages, "vec4 x = texelFetch(c, ivec2(1), 0);"), "a:- b:- c:r d:-");
  EXPECT_EQ(accesses(kImages, "vec4 x = textureGather(c, vec2(0.5), 1);"), "a:- b:- c:r d:-");
  EXPECT_EQ(accesses(kImages, "float x = textureGrad(d, vec4(0.5), vec2(0.0), vec2(0.0));"), "a:- b:- c:- d:r");
}
TEST(Access, SamplersAreFollowedThroughArguments) {
  EXPECT_EQ(accesses(kImages + "vec4 f(sampler2D s) { return textureLod(s, vec2(0.0), 0.0); }\n"
                               "vec4 g(sampler2D s, sampler2D unused) { return f(s); }\n"
                               "layout(set = 0, binding = 4) uniform sampler2D e;\n",
                     "vec4 x = g(c, e);"),
            "a:- b:- c:r d:- e:-");
}
TEST(Access, SeparateImagesAndSamplersAreReadTogether) {
  EXPECT_EQ(accesses("layout(set = 0, binding = 0) uniform texture2D t;\n"
                     "layout(set = 0, binding = 1) uniform sampler s;\n",
                     "vec4 x = textureLod(sampler2D(t, s), vec2(0.0), 0.0);"),
            "t:r s:r");
}
TEST(Access, ImagesInAnArrayAreOneBinding) {
  EXPECT_EQ(accesses("layout(set = 0, binding = 0, r32f) uniform image2D many[3];\n",
                     "imageStore(many[1], ivec2(0), vec4(0.0));"),
            "many:w");
}
TEST(Access, LoadsFromAnImageWithoutFormatAreTold) {
  const std::string declarations =
      "layout(set = 0, binding = 0) uniform image2D a;\nlayout(set = 0, binding = 1) writeonly uniform image2D b;\n";
  EXPECT_EQ(accesses(declarations, "imageStore(b, ivec2(0), imageLoad(a, ivec2(0)));"), "a:r? b:w");
}

/// Words typed in by hand, for what glslang does not write: OpCopyMemory between two buffers.
TEST(Access, CopiedMemoryIsReadAndWritten) {
  std::vector<std::uint32_t> words = words_of(
      "layout(set = 0, binding = 0, std430) buffer A { float a; };\n"
      "layout(set = 0, binding = 1, std430) buffer B { float b; };\n",
      "b = a;");
  // %v = OpLoad %float %pa; OpStore %pb %v  ->  OpCopyMemory %pb %pa
  const auto find = [&](std::uint32_t operation) {
    std::size_t at = 5;
    while (at < words.size() && (words[at] & 0xffffU) != operation) at += words[at] >> 16U;
    return at;
  };
  constexpr std::uint32_t kLoad = 61, kStore = 62, kCopyMemory = 63;
  const std::size_t load = find(kLoad);
  const std::size_t store = find(kStore);
  ASSERT_LT(store, words.size());
  const std::uint32_t from = words[load + 3];
  const std::uint32_t to = words[store + 1];
  words.erase(words.begin() + static_cast<std::ptrdiff_t>(store),
              words.begin() + static_cast<std::ptrdiff_t>(store) + 3);
  words.erase(words.begin() + static_cast<std::ptrdiff_t>(load), words.begin() + static_cast<std::ptrdiff_t>(load) + 4);
  const std::uint32_t copy[] = {3U << 16U | kCopyMemory, to, from};
  words.insert(words.begin() + static_cast<std::ptrdiff_t>(store) - 4, copy, copy + 3);
  const auto found = shader::find_accesses(words);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0], (BoundVariable{0, 0, "A", true, false}));
  EXPECT_EQ(found[1], (BoundVariable{0, 1, "B", false, true}));
}

TEST(Access, WordsCutOffAnywhereAreNoCrash) {
  const std::vector<std::uint32_t> words = words_of(kTwoBuffers + kImages, "");
  for (std::size_t size = 0; size < words.size(); ++size) (void)shader::find_accesses(std::span(words).first(size));
}

class AccessCheck : public ShaderTest {
 protected:
  ShaderRequest caller(const std::string& statements, std::vector<BoundPort> ports, const std::string& before = "") {
    return request(
        "#include \"pass.glsl\"\n" + before + "layout(local_size_x = 8) in;\nvoid main() {\n" + statements + "\n}\n",
        std::move(ports));
  }
};

TEST_F(AccessCheck, BufferDeclaredForWritingIsRead) {
  EXPECT_EQ(error_of(caller("values[0] += 1.0;", {buffer("sums", HEDDLE_ACCESS_STORAGE_WRITE, "float values[];")})),
            place("caller/shade.glsl") +
                ": error: shader 'shade' of pass 'caller' reads port 'sums', which stage 'light' declares for writing "
                "alone\n"
                "  found:    HEDDLE_ACCESS_STORAGE_WRITE, and code that reads and writes it\n"
                "  expected: HEDDLE_ACCESS_STORAGE_READ_WRITE\n"
                "  help:     declare storage_read_write(\"sums\") for stage 'light'; an atomic operation reads too");
}

TEST_F(AccessCheck, AtomicOnABufferDeclaredForWriting) {
  EXPECT_EQ(error_of(caller("atomicAdd(count, 1u);", {buffer("list", HEDDLE_ACCESS_STORAGE_WRITE, "uint count;")})),
            place("caller/shade.glsl") +
                ": error: shader 'shade' of pass 'caller' reads port 'list', which stage 'light' declares for writing "
                "alone\n"
                "  found:    HEDDLE_ACCESS_STORAGE_WRITE, and code that reads and writes it\n"
                "  expected: HEDDLE_ACCESS_STORAGE_READ_WRITE\n"
                "  help:     declare storage_read_write(\"list\") for stage 'light'; an atomic operation reads too");
}

TEST_F(AccessCheck, AccessorsOfListsDoWhatIsDeclared) {
  const std::string statements =
      "if (append_found(uvec2(1u, 2u))) return;\n"
      "if (capacity_found() > 3u && has_found) totals[0] = float(count_tiles()) + tiles[0].x;\n"
      "ids[0] = count_numbers() + capacity_numbers();";
  const CompiledShader compiled =
      compile(caller(statements, {list("found", HEDDLE_ACCESS_APPEND, "uvec2 pixels[];", 8),
                                  list("tiles", HEDDLE_ACCESS_STORAGE_READ, "vec3 tiles[];", 16),
                                  list("numbers", HEDDLE_ACCESS_STORAGE_READ_WRITE, "uint ids[];", 4),
                                  buffer("sums", HEDDLE_ACCESS_STORAGE_WRITE, "float totals[];")}),
              {});
  EXPECT_EQ(compiled.bindings.size(), 4U);
}

TEST_F(AccessCheck, FunctionOfAProviderAppends) {
  Role role = light_role();
  const Technique& telling =
      provider_technique("light/telling", "telling.glsl",
                         "float light(uint key, vec3 position) { return append_seen(key) ? 1.0 : 0.0; }\n");
  ShaderRequest made = calling_request();
  made.roles = {
      {&role, Join::kSwitch, {provider("sun", telling, {list("seen", HEDDLE_ACCESS_APPEND, "uint seen[];", 4)})}}};
  EXPECT_EQ(error_of(made), "");
}

TEST_F(AccessCheck, ElementsOfAListHaveAnotherSize) {
  EXPECT_EQ(error_of(caller("append_found(vec3(1.0));", {list("found", HEDDLE_ACCESS_APPEND, "vec3 points[];", 12)})),
            place("caller/shade.glsl") +
                ": error: shader 'shade' of pass 'caller' sees elements of 16 bytes in the list 'found', and they have "
                "12\n"
                "  found:    vec3 points[];\n"
                "  expected: an array of elements that std430 lays 12 bytes apart, aligned to 16 bytes at most\n"
                "  help:     let element_bytes of who makes the list and glsl of who reads it agree");
}

TEST_F(AccessCheck, WhoAppendsSeesNoElements) {
  EXPECT_THAT(error_of(caller("append_found(pixels[0]);", {list("found", HEDDLE_ACCESS_APPEND, "uint pixels[];", 4)})),
              testing::HasSubstr("'pixels': undeclared identifier"));
}

TEST_F(AccessCheck, ListIsAppendedToAndReadInOneStage) {
  EXPECT_EQ(error_of(caller("append_found(1u);", {list("found", HEDDLE_ACCESS_APPEND, "uint pixels[];", 4),
                                                  list("found", HEDDLE_ACCESS_STORAGE_READ, "uint pixels[];", 4)})),
            "error: port 'found' of stage 'light' of pass 'caller' is accessed in two ways that exclude each other\n"
            "  help:     one stage appends to a list, another reads it: split the stage");
}

TEST_F(AccessCheck, ListOfSeveralMembersIsRefused) {
  EXPECT_EQ(error_of(caller("", {list("found", HEDDLE_ACCESS_APPEND, "uint total; uint pixels[];", 4)})),
            "error: port 'found' of stage 'light' of pass 'caller' is a list of \"uint total; uint pixels[];\"\n"
            "  help:     a list's glsl is one array without length");
}

TEST_F(AccessCheck, FunctionOfAProviderReadsWhatItDeclaresForWriting) {
  Role role = light_role();
  const Technique& counting = provider_technique(
      "light/counting", "counting.glsl", "float light(uint key, vec3 position) { return float(seen[key]++); }\n");
  ShaderRequest made = calling_request();
  made.roles = {{&role,
                 Join::kSwitch,
                 {provider("sun", counting, {buffer("feedback", HEDDLE_ACCESS_STORAGE_WRITE, "uint seen[];")})}}};
  EXPECT_EQ(error_of(made),
            place("light/counting/counting.glsl") +
                ": error: function 'light' of pass 'sun' (light/counting) reads port 'feedback', which the function "
                "declares for writing alone\n"
                "  found:    HEDDLE_ACCESS_STORAGE_WRITE, and code that reads and writes it\n"
                "  expected: HEDDLE_ACCESS_STORAGE_READ_WRITE\n"
                "  help:     declare storage_read_write(\"feedback\") for the function; an atomic operation reads too");
}

// Macros and included files hide layout() from the check of the text.
TEST_F(AccessCheck, ShaderThatBindsForItselfThroughAMacro) {
  EXPECT_EQ(
      error_of(caller("mine[0] = 1.0;", {},
                      "#define AT(s, b) layout(set = s, binding = b)\nAT(0, 9) buffer Mine { float mine[]; };\n")),
      place("caller/shade.glsl") +
          ": error: shader 'shade' of pass 'caller' declares 'Mine', which the host did not bind\n"
          "  found:    set 0, binding 9\n"
          "  help:     declare a port: the host binds what descriptors list");
}

TEST_F(AccessCheck, ShaderThatTakesThePlaceOfAPort) {
  write("caller/hidden.glsl", "layout(set = 0, binding = 0) buffer Mine { float mine[]; };\n");
  EXPECT_EQ(error_of(caller("mine[0] = 1.0;", {buffer("sums", HEDDLE_ACCESS_STORAGE_READ, "float values[];")},
                            "#include \"hidden.glsl\"\n")),
            place("caller/shade.glsl") +
                ": error: shader 'shade' of pass 'caller' declares 'Mine' in the place of port 'sums'\n"
                "  found:    set 0, binding 0\n"
                "  help:     declare a port: the host binds what descriptors list");
}

TEST_F(AccessCheck, ComputeShaderThatDeclaresTheTexturesOfMaterials) {
  write("caller/hidden.glsl", "layout(set = 2, binding = 0) uniform sampler2DArray texture_base_color;\n");
  EXPECT_EQ(
      error_of(caller("values[0] = textureLod(texture_base_color, vec3(0.0), 0.0).x;",
                      {buffer("sums", HEDDLE_ACCESS_STORAGE_WRITE, "float values[];")}, "#include \"hidden.glsl\"\n")),
      place("caller/shade.glsl") +
          ": error: shader 'shade' of pass 'caller' declares 'texture_base_color', which the host did not bind\n"
          "  found:    set 2, binding 0\n"
          "  help:     declare a port: the host binds what descriptors list");
}

TEST_F(AccessCheck, UndeclaredUsesOfSeveralPortsAreToldAtOnce) {
  const std::string text = error_of(
      caller("values[0] += 1.0; others[0] += 1.0;", {buffer("sums", HEDDLE_ACCESS_STORAGE_WRITE, "float values[];"),
                                                     buffer("more", HEDDLE_ACCESS_STORAGE_WRITE, "float others[];")}));
  EXPECT_THAT(text, testing::HasSubstr("reads port 'sums'"));
  EXPECT_THAT(text, testing::HasSubstr("reads port 'more'"));
}

TEST_F(AccessCheck, WhatIsDeclaredAndNotUsedIsNoMistake) {
  EXPECT_EQ(error_of(caller("values[0] = 1.0;", {buffer("sums", HEDDLE_ACCESS_STORAGE_READ_WRITE, "float values[];"),
                                                 buffer("more", HEDDLE_ACCESS_STORAGE_READ_WRITE, "float others[];"),
                                                 image("depth", HEDDLE_ACCESS_SAMPLED, VK_FORMAT_R32_SFLOAT)})),
            "");
}

}  // namespace
}  // namespace heddle::vulkan
