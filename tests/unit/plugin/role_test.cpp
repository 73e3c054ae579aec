// SPDX-License-Identifier: Apache-2.0
// role.toml files: what is read, and every error with its place.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "diagnostics.hpp"
#include "plugin/technique.hpp"

namespace heddle {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class RoleFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name() / "blur";
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_.parent_path()); }

  fs::path write(std::string_view text) {
    std::ofstream(folder_ / "role.toml") << text;
    return folder_ / "role.toml";
  }
  // The message for a file, with the folder's path left out.
  std::string message(std::string_view text) {
    try {
      read_role(write(text));
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), HEDDLE_BAD_INPUT);
      std::string what = error.what();
      const std::string prefix = folder_.string() + "/";
      for (std::size_t at = what.find(prefix); at != std::string::npos; at = what.find(prefix)) {
        what.erase(at, prefix.size());
      }
      return what;
    }
    return "no error";
  }

  fs::path folder_;
};

constexpr std::string_view kHead = "role = \"blur\"\nrevision = 1\ntitle = \"A blur\"\n";
constexpr std::string_view kPort = "[[port]]\nname = \"a\"\ndirection = \"out\"\ntype = \"image\"\nhelp = \"h\"\n";

std::string with(std::string_view more) {
  return std::string(kHead) + std::string(more);
}

TEST_F(RoleFile, IsReadAsWritten) {
  const Role role = read_role(write(R"toml(
role = "blur"
revision = 3
title = "A blur"
join = "product"
selector = "light"
include = "x.glsl"
references = { same_model = "blur/exact", same_model_params = { radius = 2.5, kernel = "box", twice = true, n = 3 } }
measure = { kind = "image", port = "a", metric = "rmse", note = "as it is" }
[[port]]
name = "a"
direction = "inout"
type = "image"
unit = "m"
infinite = true
optional = true
range = ["-inf", 2]
neutral = ["inf", 1, 2.5, 0]
help = "first"
[[port]]
name = "b"
direction = "in"
type = "value"
glsl = "float b;"
help = "second"
[[function]]
name = "f"
signature = "float f(vec3 x)"
neutral = "return 1.0;"
unit = "1"
range = [0, "inf"]
help = "third"
[[hard_case]]
id = "H1"
text = "It holds"
)toml"));
  EXPECT_EQ(role.name, "blur");
  EXPECT_EQ(role.revision, 3U);
  EXPECT_EQ(role.join, Join::kProduct);
  EXPECT_EQ(role.selector, "light");
  EXPECT_EQ(role.include, "x.glsl");
  EXPECT_EQ(role.same_model_reference, "blur/exact");
  EXPECT_EQ(role.same_model_params,
            (std::map<std::string, std::string>{{"radius", "2.5"}, {"kernel", "box"}, {"twice", "true"}, {"n", "3"}}));
  EXPECT_EQ(role.measure_kind, "image");
  EXPECT_EQ(role.measure_metric, "rmse");
  ASSERT_EQ(role.ports.size(), 2U);
  const RolePort& a = role.ports[0];
  EXPECT_EQ(a.direction, Direction::kInout);
  EXPECT_EQ(a.type, PortType::kImage);
  EXPECT_TRUE(a.optional);
  EXPECT_TRUE(a.infinite);
  EXPECT_EQ((*a.range)[0], -INFINITY);
  EXPECT_EQ((*a.range)[1], 2);
  EXPECT_EQ(a.neutral, (std::array<double, 4>{INFINITY, 1, 2.5, 0}));
  EXPECT_EQ(role.find_port("b")->glsl, "float b;");
  EXPECT_EQ(role.find_port("c"), nullptr);
  ASSERT_EQ(role.functions.size(), 1U);
  EXPECT_EQ(role.functions[0].signature, "float f(vec3 x)");
  EXPECT_EQ((*role.functions[0].range)[1], INFINITY);
  ASSERT_EQ(role.hard_cases.size(), 1U);
  EXPECT_EQ(role.hard_cases[0].text, "It holds");
}

TEST_F(RoleFile, OfThisRepositoryIsRight) {
  std::size_t count = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(HEDDLE_SOURCE_DIR) / "plugins")) {
    if (!fs::exists(entry.path() / "role.toml")) continue;
    ++count;
    EXPECT_NO_THROW({
      const Role role = read_role(entry.path() / "role.toml");
      EXPECT_EQ(role.name, entry.path().filename());
      EXPECT_FALSE(role.hard_cases.empty()) << role.name;
    }) << entry.path();
  }
  EXPECT_GE(count, 7U);
}

TEST_F(RoleFile, WithASyntaxErrorNamesThePlace) {
  EXPECT_THAT(message("role = \"blur\"\nrevision = [1\n"), HasSubstr("role.toml:"));
  EXPECT_THAT(message("role = \"blur\"\nrevision = [1\n"), HasSubstr("error: "));
}

TEST_F(RoleFile, WithAnUnknownKeySaysWhichWasMeant) {
  EXPECT_EQ(message(with("jion = \"sum\"\n") + std::string(kPort)),
            "role.toml:4:1: error: role has no key 'jion'\n"
            "  expected: one of role, revision, title, join, selector, include, references, measure, port, function, "
            "hard_case, component\n"
            "  help:     did you mean 'join'?");
  EXPECT_EQ(message(with(kPort) + "uint = \"m\"\n"),
            "role.toml:9:1: error: port 'a' has no key 'uint'\n"
            "  expected: one of name, direction, type, optional, infinite, unit, range, neutral, glsl, list, help\n"
            "  help:     did you mean 'unit'?");
}

TEST_F(RoleFile, WithAWrongTypeSaysWhatWasFound) {
  EXPECT_EQ(message("role = \"blur\"\nrevision = 1\ntitle = 3\n" + std::string(kPort)),
            "role.toml:3:9: error: role: 'title' has the wrong type\n"
            "  found:    the integer 3\n"
            "  expected: a string");
  EXPECT_EQ(message(with(kPort) + "optional = \"yes\"\n"),
            "role.toml:9:12: error: port 'a': 'optional' has the wrong type\n"
            "  found:    the string \"yes\"\n"
            "  expected: true or false");
  EXPECT_EQ(message(with(kPort) + "range = [0]\n"),
            "role.toml:9:9: error: port 'a': 'range' has the wrong type\n"
            "  found:    1 elements\n"
            "  expected: 2 numbers; infinity is written \"inf\" or \"-inf\"");
  EXPECT_EQ(message(with(kPort) + "range = [0, \"much\"]\n"),
            "role.toml:9:13: error: port 'a': 'range' has a wrong element\n"
            "  found:    the string \"much\"\n"
            "  expected: 2 numbers; infinity is written \"inf\" or \"-inf\"");
  EXPECT_THAT(message(with(kPort) + "neutral = [0, 0, nan, 0]\n"), HasSubstr("'neutral' has a wrong element"));
  EXPECT_EQ(message(with("port = 1\n")),
            "role.toml:4:8: error: role: 'port' has the wrong type\n"
            "  found:    the integer 1\n"
            "  expected: one [[port]] for each");
}

TEST_F(RoleFile, WithAnUnknownWordSaysWhichAreKnown) {
  EXPECT_EQ(message(with("join = \"product_\"\n") + std::string(kPort)),
            "role.toml:4:8: error: role: unknown join\n"
            "  found:    \"product_\"\n"
            "  expected: one of \"switch\", \"sum\", \"product\"\n"
            "  help:     did you mean \"product\"?");
  EXPECT_THAT(message(with("[[port]]\nname = \"a\"\ndirection = \"up\"\ntype = \"image\"\nhelp = \"h\"\n")),
              HasSubstr("role.toml:6:13: error: port 'a': unknown direction"));
}

TEST_F(RoleFile, ReportsAllErrorsAtOnce) {
  const std::string text = message("role = \"blurr\"\nrevision = 0\n" + std::string(kPort) + std::string(kPort));
  EXPECT_THAT(text, HasSubstr("role.toml:2:12: error: role: 'revision' is no revision\n  found:    the integer 0\n"
                              "  expected: an integer from 1"));
  EXPECT_THAT(text, HasSubstr("error: role has no 'title'\n  expected: a string"));
  EXPECT_THAT(text, HasSubstr("role.toml:9:8: error: a second port with the name 'a'"));
  EXPECT_THAT(text, HasSubstr("role.toml:1:8: error: role: the name differs from the folder's\n"
                              "  found:    \"blurr\"\n  expected: \"blur\""));
}

TEST_F(RoleFile, RefusesWhatItsPartsContradict) {
  EXPECT_EQ(
      message(with(kPort) + "range = [1, 1]\n"),
      "role.toml:9:9: error: port 'a': 'range' is empty\n  found:    [1, 1]\n  expected: the smaller number first");
  EXPECT_EQ(message(with("measure = { kind = \"image\", port = \"b\" }\n") + std::string(kPort)),
            "role.toml:4:36: error: measure: no such port\n  found:    \"b\"\n  expected: one of a");
  EXPECT_EQ(message(with("measure = { kind = \"image\", function = \"g\" }\n") + std::string(kPort)),
            "role.toml:4:40: error: measure: no such function\n  found:    \"g\"\n  expected: one of ");
  EXPECT_EQ(message(with("[[port]]\nname = \"a\"\ndirection = \"in\"\ntype = \"value\"\nhelp = \"h\"\n")),
            "role.toml:4:1: error: port 'a' has no 'glsl'\n  expected: the members of the block as shaders see them");
  EXPECT_EQ(message(with(kPort) + "glsl = \"float a;\"\n"),
            "role.toml:9:8: error: port 'a': 'glsl' belongs to buffers and values");
  EXPECT_EQ(message(with(kPort) + "list = true\n"), "role.toml:9:8: error: port 'a': 'list' belongs to buffers");
  EXPECT_EQ(message(with("[[function]]\nname = \"f\"\nsignature = \"float g()\"\nneutral = \"\"\nhelp = \"h\"\n")),
            "role.toml:6:13: error: function 'f': 'signature' declares something else\n"
            "  found:    \"float g()\"\n  expected: \"TYPE f(TYPE NAME, ...)\"");
  EXPECT_EQ(message(with("references = { physical = \"exact\" }\n") + std::string(kPort)),
            "role.toml:4:27: error: references: 'physical' names no technique\n"
            "  found:    \"exact\"\n  expected: \"ROLE/TECHNIQUE\"");
  EXPECT_EQ(message(with("references = { physical_port = \"b\" }\n") + std::string(kPort)),
            "role.toml:4:32: error: references: 'physical_port' without 'physical'\n"
            "  expected: physical = \"ROLE/TECHNIQUE\"");
  EXPECT_THAT(message(with("")), HasSubstr("error: role has neither a port nor a function"));
}

TEST_F(RoleFile, ThatIsMissingIsNamed) {
  try {
    read_role("/nowhere/role.toml");
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "/nowhere/role.toml: error: cannot read this file");
  }
}

}  // namespace
}  // namespace heddle
