// SPDX-License-Identifier: Apache-2.0
#include "view/script.hpp"
#include "diagnostics.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace {

using heddle::view::read_script;
using heddle::view::ScriptLine;

std::filesystem::path script_file(const std::string& text) {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  const std::filesystem::path file = testing::TempDir() + "view_" + test->name() + ".script";
  std::ofstream(file) << text;
  return file;
}

std::string error_of(const std::string& text) {
  try {
    (void)read_script(script_file(text));
  } catch (const heddle::Error& error) {
    const std::string what = error.what();
    return what.substr(what.find(".script") + 7);
  }
  return "none";
}

}  // namespace

TEST(Script, ReadsEachCommand) {
  const auto lines =
      read_script(script_file("wait\n# all of it\nslide ao.params.radius 0.25  # a quarter\n"
                              "type ao.params.radius/field 1 and 2\nkey W 0.5\ndrag 1 2 3 4\nquit\n"));
  ASSERT_EQ(lines.size(), 6U);
  EXPECT_EQ(lines[1].kind, ScriptLine::Kind::kSlide);
  EXPECT_EQ(lines[1].name, "ao.params.radius");
  EXPECT_EQ(lines[1].numbers, std::vector<double>{0.25});
  EXPECT_EQ(lines[1].line, 3);
  EXPECT_EQ(lines[2].text, "1 and 2");
  EXPECT_EQ(lines[4].numbers.size(), 4U);
}

TEST(Script, NamesTheNearestCommand) {
  EXPECT_EQ(
      error_of("wait\nclik play\n"),
      ":2:1: error: this is no command of a script\n  found:    clik\n  expected: one of wait, pause, click, slide, "
      "type, key, drag, screenshot, state, quit\n  help:     did you mean 'click'?");
}

TEST(Script, SaysHowACommandIsWritten) {
  EXPECT_EQ(
      error_of("slide wipe\n"),
      ":1:1: error: 'slide' is written otherwise\n  found:    slide wipe\n  expected: slide WIDGET PART, from 0 to 1");
  for (const char* wrong :
       {"slide wipe 1.5", "slide wipe nan", "pause -1", "pause", "wait 3", "click", "drag 1 2 3", "key W x"})
    EXPECT_NE(error_of(wrong).find("is written otherwise"), std::string::npos) << wrong;
}

TEST(Script, SaysThatAFileIsNotThere) {
  try {
    (void)read_script("no/such.script");
    FAIL();
  } catch (const heddle::Error& error) {
    EXPECT_STREQ(error.what(), "no/such.script: error: the script cannot be read\n  expected: a file of commands");
  }
}
