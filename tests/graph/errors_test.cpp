// SPDX-License-Identifier: Apache-2.0
// Every message that a graph's author can meet, as a whole: errors/<cause>.toml must fail with errors/<cause>.expected.
// A line "# --set ao.technique=gtoa" in the file is applied as a setting.
#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>
#include <iterator>

#include "graph/plugin_folder.hpp"

namespace heddle::graph {
namespace {

namespace fs = std::filesystem;

std::string read(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

std::vector<std::string> causes() {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(fs::path(HEDDLE_SOURCE_DIR) / "tests" / "graph" / "errors"))
    if (entry.path().extension() == ".expected") names.push_back(entry.path().stem().string());
  std::ranges::sort(names);
  return names;
}

class Errors : public ::testing::TestWithParam<std::string> {};

TEST_P(Errors, SayExactlyThis) {
  // Messages name files as the user did: relative ones stay so.
  const fs::path before = fs::current_path();
  fs::current_path(fs::path(HEDDLE_SOURCE_DIR) / "tests" / "graph" / "errors");
  const std::string text = read(GetParam() + ".toml");
  const std::string message = test_support::message_of([&] {
    WrittenGraph written = read_graph(GetParam() + ".toml");
    constexpr std::string_view kSetting = "# --set ";
    for (std::size_t at = text.find(kSetting); at != std::string::npos; at = text.find(kSetting, at + 1))
      apply_setting(written,
                    std::string_view(text).substr(at + kSetting.size(), text.find('\n', at) - at - kSetting.size()));
    ResolvedGraph graph = resolve(written, test_support::shared_registry());
    weave_loops(graph);
    order(graph);
  });
  std::string expected = read(GetParam() + ".expected");
  fs::current_path(before);
  if (!expected.empty() && expected.back() == '\n') expected.pop_back();
  EXPECT_EQ(message, expected);
}

TEST(ErrorFiles, HaveAnExpectationForEveryFile) {
  std::vector<std::string> files;
  for (const auto& entry : fs::directory_iterator(fs::path(HEDDLE_SOURCE_DIR) / "tests" / "graph" / "errors"))
    if (entry.path().extension() == ".toml" && entry.path().stem() != "good")
      files.push_back(entry.path().stem().string());
  std::ranges::sort(files);
  EXPECT_EQ(files, causes());
}

INSTANTIATE_TEST_SUITE_P(Graph, Errors, ::testing::ValuesIn(causes()), [](const auto& test) { return test.param; });

}  // namespace
}  // namespace heddle::graph
