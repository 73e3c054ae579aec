// SPDX-License-Identifier: Apache-2.0
// host/vulkan/shader_text.cpp: what a text says before it is compiled.
#include "vulkan/shader_text.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heddle::vulkan::shader {
namespace {

using testing::ElementsAre;
using testing::UnorderedElementsAre;

TEST(ShaderText, FindsEveryKindOfNameAtFileScope) {
  const Scan facts = scan(R"(
#define SCALE(x) ((x) * kTwo)
const float kTwo = 2.0, kThree = 3.0;
const vec2 kTaps[2] = vec2[2](vec2(0.0), vec2(1.0));
struct Ray { vec3 origin; float range[4]; };
shared float scratch[64];
float declared_only(int);
precise float twice(const in float x) { float local = x; if (x > 0.0) { local *= kTwo; } return local; }
#ifdef FAST
float chosen(int i) { return 1.0; }
#else
float other(int i) { return 2.0; }
#endif
)");
  EXPECT_THAT(facts.problems, testing::IsEmpty());
  EXPECT_THAT(facts.names, UnorderedElementsAre("SCALE", "kTwo", "kThree", "kTaps", "Ray", "scratch", "declared_only",
                                                "twice", "chosen", "other"));
}

TEST(ShaderText, ReadsSignatures) {
  const FunctionText f = parse_signature("vec3 f(const in vec3 a, inout float b[4], out Ray, uint)");
  EXPECT_EQ(f.name, "f");
  EXPECT_EQ(f.return_type, "vec3");
  EXPECT_THAT(f.parameter_types, ElementsAre("vec3", "inout float[4]", "out Ray", "uint"));
  EXPECT_THAT(f.parameter_names, ElementsAre("a", "b", "", ""));
  EXPECT_THAT(parse_signature("float g(void)").parameter_types, testing::IsEmpty());
  EXPECT_EQ(parse_signature("not a function").name, "");
}

TEST(ShaderText, RenamesNamesAndLeavesMembersOfStructs) {
  const std::string text =
      "struct Hit { float depth; vec3 range[depth]; Hit2 x; };\n"
      "float f(Hit hit) { return hit.depth + depth + fetch(hit . depth); } // depth\n"
      "#define LOOKUP(a) a.depth * depth\n"
      "struct Hit2 { int f; }; const float big = 1.0e+5;\n";
  const Scan facts = scan(text);
  EXPECT_EQ(rename(text, facts, {"depth", "f", "Hit2", "e"}, "_p7"),
            "struct Hit { float depth; vec3 range[depth_p7]; Hit2_p7 x; };\n"
            "float f_p7(Hit hit) { return hit.depth + depth_p7 + fetch(hit . depth); } // depth\n"
            "#define LOOKUP(a) a.depth * depth_p7\n"
            "struct Hit2_p7 { int f; }; const float big = 1.0e+5;\n");
}

TEST(ShaderText, TellsWhichBracketIsOpen) {
  const auto first = [](std::string_view text) {
    const Scan facts = scan(text);
    return facts.problems.empty() ? std::string()
                                  : std::to_string(facts.problems[0].line) + " " + facts.problems[0].message;
  };
  EXPECT_EQ(first("float f() {\n  if (true) {\n}\n"), "1 '{' is never closed");
  EXPECT_EQ(first("float f() {\n}\n}\n"), "3 '}' closes nothing");
  EXPECT_EQ(first("float f() {\n  g((1);\n}\n"), "3 '}' does not close the '(' of line 2");
  EXPECT_EQ(first("#if A\nfloat x;\n"), "1 #if has no #endif");
  EXPECT_EQ(first("#endif\n"), "1 #endif without #if");
  EXPECT_EQ(first("a\n/* never\n"), "2 a comment is never closed");
  EXPECT_EQ(first("#ifdef A\nfloat f(int a) {\n#else\nfloat f(uint a) {\n#endif\nreturn 1.0; }\n"), "");
}

TEST(ShaderText, FindsIncludesOutsideComments) {
  const Scan facts = scan("#include \"a.glsl\"\n// #include \"b.glsl\"\n  #  include <c.h>\n/*\n#include \"d\"\n*/\n");
  ASSERT_EQ(facts.includes.size(), 2U);
  EXPECT_EQ(facts.includes[0].name, "a.glsl");
  EXPECT_FALSE(facts.includes[0].is_angle);
  EXPECT_EQ(facts.includes[1].name, "c.h");
  EXPECT_TRUE(facts.includes[1].is_angle);
  EXPECT_EQ(facts.includes[1].line, 3U);
}

TEST(ShaderText, ListsMembersOfBlocks) {
  const std::vector<Member> members = block_members("HeddleView camera; float radius_of[64], bias; uint lights[];");
  ASSERT_EQ(members.size(), 4U);
  EXPECT_EQ(members[0].name, "camera");
  EXPECT_EQ(members[1].name, "radius_of");
  EXPECT_FALSE(members[1].is_unsized_array);
  EXPECT_EQ(members[2].name, "bias");
  EXPECT_EQ(members[3].name, "lights");
  EXPECT_TRUE(members[3].is_unsized_array);
}

TEST(ShaderText, PutsAnUnderscoreBehindReservedWords) {
  EXPECT_EQ(glsl_name("precision"), "precision_");
  EXPECT_EQ(glsl_name("radius"), "radius");
}

}  // namespace
}  // namespace heddle::vulkan::shader
