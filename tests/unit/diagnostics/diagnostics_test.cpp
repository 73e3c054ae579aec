// SPDX-License-Identifier: Apache-2.0
// The form of messages, and which misspelled names are recognized.
#include "diagnostics.hpp"

#include "content_hash.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

namespace heddle {
namespace {

Diagnostic example() {
  Diagnostic diagnostic;
  diagnostic.where = {"night.toml", 14, 13};
  diagnostic.message = "pass 'ao': role 'ambient_occlusion' has no technique 'gtoa'";
  diagnostic.found = "technique = \"gtoa\"";
  diagnostic.expected = "one of none, gtao, ray_traced";
  diagnostic.help = "did you mean 'gtao'?";
  return diagnostic;
}

TEST(Diagnostics, HaveTheFormOfTheHeader) {
  EXPECT_EQ(to_text(example()),
            "night.toml:14:13: error: pass 'ao': role 'ambient_occlusion' has no technique 'gtoa'\n"
            "  found:    technique = \"gtoa\"\n"
            "  expected: one of none, gtao, ray_traced\n"
            "  help:     did you mean 'gtao'?");
}

TEST(Diagnostics, LeaveOutWhatIsEmpty) {
  Diagnostic diagnostic = example();
  diagnostic.found.clear();
  diagnostic.help.clear();
  EXPECT_EQ(to_text(diagnostic),
            "night.toml:14:13: error: pass 'ao': role 'ambient_occlusion' has no technique 'gtoa'\n"
            "  expected: one of none, gtao, ray_traced");
}

TEST(Diagnostics, NameAsMuchOfThePlaceAsIsKnown) {
  Diagnostic diagnostic;
  diagnostic.message = "m";
  diagnostic.severity = Severity::kWarning;
  EXPECT_EQ(to_text(diagnostic), "warning: m");
  diagnostic.where.file = "f";
  EXPECT_EQ(to_text(diagnostic), "f: warning: m");
  diagnostic.where.column = 7;  // means nothing without a line
  EXPECT_EQ(to_text(diagnostic), "f: warning: m");
  diagnostic.where.line = 3;
  EXPECT_EQ(to_text(diagnostic), "f:3:7: warning: m");
  diagnostic.where.column = 0;
  diagnostic.severity = Severity::kInfo;
  EXPECT_EQ(to_text(diagnostic), "f:3: info: m");
}

TEST(Diagnostics, KeepLinesOfADetailInItsColumn) {
  Diagnostic diagnostic;
  diagnostic.message = "m";
  diagnostic.found = "a\nb";
  EXPECT_EQ(to_text(diagnostic), "error: m\n  found:    a\n            b");
}

TEST(Diagnostics, FollowEachOtherLineByLine) {
  Diagnostic diagnostic;
  diagnostic.message = "m";
  const std::vector<Diagnostic> two{diagnostic, diagnostic};
  EXPECT_EQ(to_text(two), "error: m\nerror: m");
  EXPECT_EQ(to_text(std::span<const Diagnostic>()), "");
}

TEST(Error, CarriesStatusTextAndDiagnostics) {
  const Error error(HEDDLE_BAD_INPUT, example());
  EXPECT_EQ(error.status(), HEDDLE_BAD_INPUT);
  ASSERT_EQ(error.diagnostics().size(), 1U);
  EXPECT_EQ(error.what(), to_text(example()));
  const Error short_one(HEDDLE_FAILED, "no space", "delete something");
  EXPECT_STREQ(short_one.what(), "error: no space\n  help:     delete something");
}

TEST(NearestName, FindsSlipsOfTheFingers) {
  const std::vector<std::string> names{"ssao", "gtao", "ray_traced", "radius"};
  EXPECT_EQ(nearest_name("gtoa", names), "gtao");             // two neighbours swapped: one edit
  EXPECT_EQ(nearest_name("gtaoo", names), "gtao");            // one too many
  EXPECT_EQ(nearest_name("raytraced", names), "ray_traced");  // one missing
  EXPECT_EQ(nearest_name("radiuz", names), "radius");         // one wrong
  EXPECT_EQ(nearest_name("rdaisu", names), "radius");         // two swaps in six letters
}

TEST(NearestName, ForgivesAThirdOfTheNameAndAtLeastOneEdit) {
  const std::vector<std::string> names{"abcdef"};
  EXPECT_EQ(nearest_name("abcdxy", names), "abcdef");
  EXPECT_EQ(nearest_name("abcxyz", names), "");
  const std::vector<std::string> shorts{"ao"};
  EXPECT_EQ(nearest_name("a", shorts), "ao");
  EXPECT_EQ(nearest_name("", shorts), "");
}

TEST(NearestName, PrefersTheNearerAndThenTheFirst) {
  const std::vector<std::string> names{"depth_x", "depths", "depthz"};
  EXPECT_EQ(nearest_name("depth", names), "depths");
  EXPECT_EQ(nearest_name("depths", names), "depths");
}

TEST(NearestName, AnswersNothingWhereNothingIsNear) {
  EXPECT_EQ(nearest_name("shadow", {}), "");
  const std::vector<std::string> names{"ambient_occlusion"};
  EXPECT_EQ(nearest_name("shadow", names), "");
}

TEST(JoinNames, SeparatesByCommas) {
  EXPECT_EQ(join_names({}), "");
  const std::vector<std::string> names{"a", "b", "c"};
  EXPECT_EQ(join_names(names), "a, b, c");
}

TEST(ContentHash, OfAFileIsThatOfItsBytes) {
  const std::filesystem::path file =
      std::filesystem::path(testing::TempDir()) / ("heddle_hash_" + std::to_string(getpid()));
  // Less than a quarter's byte each, a piece and a little more, several pieces.
  for (const std::size_t size : {0U, 1U, 3U, 4U, 7U, 1000U, 1048576U, 1048579U, 3000001U}) {
    std::string text(size, 'x');
    for (std::size_t i = 0; i < size; ++i) text[i] = static_cast<char>(i * 2654435761U >> 24U);
    std::ofstream(file, std::ios::binary) << text;
    ContentHash hash;
    hash.add_long(std::as_bytes(std::span(text)));
    EXPECT_EQ(hash_of_file(file), hash.hexadecimal()) << size;
  }
  std::filesystem::remove(file);
  EXPECT_EQ(hash_of_file(file), std::nullopt);
}

}  // namespace
}  // namespace heddle
