// SPDX-License-Identifier: Apache-2.0
// What passes get wrong while a plan is made is told at once, by the order in the file; what only follows from that is
// not.
#include "roles/rendering.hpp"

#include <gmock/gmock.h>

#include <fmt/format.h>

#include <algorithm>

namespace {

using namespace rendering;

/// A graph of passes, of which each gives the name, parameters and what it is bound to.
class GraphText {
 public:
  /// The line that the pass begins at.
  int add(const std::string& name, const std::string& in, const std::string& first = {},
          const std::string& second = {}) {
    const int line = 1 + static_cast<int>(std::ranges::count(text_, '\n'));
    text_ += fmt::format("[[pass]]\nname = \"{}\"\nrole = \"mistakes\"\ntechnique = \"one\"\n", name);
    if (!in.empty()) text_ += fmt::format("params.in = \"{}\"\n", in);
    if (!first.empty()) text_ += fmt::format("inputs.first = \"{}.image\"\n", first);
    if (!second.empty()) text_ += fmt::format("inputs.second = \"{}.image\"\n", second);
    last_ = name;
    return line;
  }
  void say(const std::string& line) { text_ += line + "\n"; }
  [[nodiscard]] std::string text() const {
    return fmt::format("output = \"{}.image\"\nextent = [8, 8]\n", last_) + text_;
  }

 private:
  std::string text_;
  std::string last_;
};

constexpr int kLinesAbove = 2;

std::string error_of(const GraphText& written) {
  Scene scene;
  Graph graph(written.text());
  EXPECT_EQ(heddle_render(graph.handle, scene.handle, nullptr), HEDDLE_BAD_INPUT);
  return heddle_error(Host::get().handle);
}

std::string error_at(int line, const std::string& pass, const std::string& what) {
  return fmt::format("test.toml:{}:1: error: pass '{}' (mistakes/one): wrong in {}", line + kLinesAbove, pass, what);
}

TEST(Mistakes, OfAllPassesAreToldAtOnceInTheOrderOfTheFile) {
  GraphText graph;
  // Execution goes from `z` to `a`: the file's order is another one.
  const int a = graph.add("a", "declare", "z");
  const int b = graph.add("b", "declare");
  graph.say("params.errors = 2");
  const int z = graph.add("z", "");
  graph.add("follows", "declare", "b");  // its input is wrong already
  graph.add("follows_too", "prepare", "follows", "z");
  graph.add("left", "", "a", "b");
  graph.add("last", "", "left", "follows_too");
  EXPECT_EQ(error_of(graph), error_at(a, "a", "declare, 1") + "\n" + error_at(b, "b", "declare, 1") + "\n" +
                                 error_at(b, "b", "declare, 2"));
  EXPECT_GT(z, b);
}

TEST(Mistakes, OfCreateAndDeclareComeTogether) {
  GraphText graph;
  const int made = graph.add("made", "declare");
  const int unmade = graph.add("unmade", "create");
  graph.add("last", "", "made", "unmade");
  EXPECT_EQ(error_of(graph), error_at(made, "made", "declare, 1") + "\n" + error_at(unmade, "unmade", "create, 1") +
                                 fmt::format("\ntest.toml:{}:1: error: pass 'unmade' (mistakes/one): no object is made",
                                             unmade + kLinesAbove));
}

TEST(Mistakes, OfPrepareAreToldAtOnceWhereAllWasDeclared) {
  GraphText graph;
  const int a = graph.add("a", "prepare");
  const int b = graph.add("b", "prepare");
  graph.add("last", "prepare", "a", "b");
  EXPECT_EQ(error_of(graph), error_at(a, "a", "prepare, 1") + "\n" + error_at(b, "b", "prepare, 1"));
}

TEST(Mistakes, AreNoMoreThanSomebodyReads) {
  GraphText graph;
  graph.add("sum_0", "");
  std::vector<int> lines;
  for (int i = 1; i <= 40; ++i) {
    lines.push_back(graph.add(fmt::format("wrong_{}", i), "declare"));
    graph.add(fmt::format("sum_{}", i), "", fmt::format("sum_{}", i - 1), fmt::format("wrong_{}", i));
  }
  std::string expected;
  for (int i = 1; i <= 32; ++i)
    expected += error_at(lines[static_cast<std::size_t>(i - 1)], fmt::format("wrong_{}", i), "declare, 1") + "\n";
  EXPECT_EQ(error_of(graph), expected + "test.toml: error: and 8 more mistakes like these");
}

TEST(Mistakes, ThatAreMendedLeaveAGraphThatRenders) {
  GraphText text;
  text.add("a", "declare");
  text.add("b", "create");
  text.add("last", "", "a", "b");
  Scene scene;
  Graph graph(text.text());
  EXPECT_EQ(heddle_render(graph.handle, scene.handle, nullptr), HEDDLE_BAD_INPUT);
  graph.set("a.params.in=nothing");
  graph.set("b.params.in=prepare");
  EXPECT_EQ(heddle_render(graph.handle, scene.handle, nullptr), HEDDLE_BAD_INPUT);
  EXPECT_THAT(heddle_error(Host::get().handle), testing::HasSubstr("pass 'b' (mistakes/one): wrong in prepare, 1"));
  graph.set("b.params.in=nothing");
  EXPECT_EQ(graph.image(scene).at(3, 4, 0), 3.0F);  // 1 + 1 + 1
}

}  // namespace
