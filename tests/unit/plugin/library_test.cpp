// SPDX-License-Identifier: Apache-2.0
// Opening plugins: private copies, checks against the manifest, and that closing really unmaps.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "diagnostics.hpp"
#include "plugin/registry.hpp"

namespace heddle {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

const fs::path kLibraries = HEDDLE_TEST_LIBRARIES;

/// What the library "right" says of itself.
Manifest manifest_of(const fs::path& library) {
  Manifest manifest;
  manifest.library = library;
  manifest.folder = library.parent_path();
  manifest.abi_major = HEDDLE_ABI_MAJOR;
  manifest.abi_minor = HEDDLE_ABI_MINOR;
  Technique technique;
  technique.id = "display/test";
  technique.title = "A test";
  technique.source = "none";
  Port radiance;
  radiance.name = "radiance";
  Port color;
  color.name = "color";
  color.direction = Direction::kOut;
  color.format = VK_FORMAT_R8G8B8A8_UNORM;
  technique.ports = {radiance, color};
  technique.stages = {{"main",
                       StageKind::kGpu,
                       {{"radiance", HEDDLE_ACCESS_SAMPLED, 0, {}}, {"color", HEDDLE_ACCESS_STORAGE_WRITE, 0, {}}}}};
  manifest.techniques = {technique};
  return manifest;
}

/// Mappings of this process whose name holds `name`.
int count_mappings(std::string_view name) {
  std::ifstream maps("/proc/self/maps");
  int count = 0;
  for (std::string line; std::getline(maps, line);) count += line.find(name) == std::string::npos ? 0 : 1;
  return count;
}

std::string message(const Manifest& manifest, heddle_status status) {
  try {
    const Library library(manifest);
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), status);
    std::string what = error.what();
    const std::string prefix = manifest.folder.string() + "/";
    for (std::size_t at = what.find(prefix); at != std::string::npos; at = what.find(prefix)) {
      what.erase(at, prefix.size());
    }
    return what;
  }
  return "no error";
}

TEST(Library, IsMappedWhileOpenAndGoneAfterwards) {
  const Manifest manifest = manifest_of(kLibraries / "right.so");
  ASSERT_EQ(count_mappings("right.so"), 0);
  {
    const Library library(manifest);
    EXPECT_GT(count_mappings("right.so"), 0);
    EXPECT_EQ(count_mappings(manifest.library.string()), 0);  // never the file itself
    EXPECT_STREQ(library.descriptor("display/test").title, "A test");
  }
  EXPECT_EQ(count_mappings("right.so"), 0);
}

TEST(Library, LeavesNoFileBehind) {
  const auto count = [] {
    std::ptrdiff_t files = 0;
    for (const auto& entry : fs::directory_iterator(fs::temp_directory_path())) {
      files += entry.path().string().ends_with("right.so.heddle-plugin") ? 1 : 0;
    }
    return files;
  };
  const std::ptrdiff_t before = count();
  const Library library(manifest_of(kLibraries / "right.so"));
  EXPECT_EQ(count(), before);
}

TEST(Library, ThatWasBuiltAgainIsReallyLoadedAgain) {
  const fs::path folder = fs::path(testing::TempDir()) / "rebuilt";
  fs::create_directories(folder);
  fs::copy_file(kLibraries / "right.so", folder / "x.so", fs::copy_options::overwrite_existing);
  Manifest manifest = manifest_of(folder / "x.so");
  const Library old(manifest);
  fs::copy_file(kLibraries / "other_title.so", folder / "x.so", fs::copy_options::overwrite_existing);  // in place
  manifest.techniques[0].title = "Another title";
  const Library fresh(manifest);
  EXPECT_STREQ(old.descriptor("display/test").title, "A test");
  EXPECT_STREQ(fresh.descriptor("display/test").title, "Another title");
  fs::remove_all(folder);
}

TEST(Library, CanBeOpenedAndClosedManyTimes) {
  const Manifest manifest = manifest_of(kLibraries / "right.so");
  for (int i = 0; i < 200; ++i) const Library library(manifest);
  EXPECT_EQ(count_mappings("right.so"), 0);
}

TEST(Library, PinsWhatCameWithItButNotItself) {
  {
    const Library library(manifest_of(kLibraries / "with_thread.so"));
    EXPECT_GT(count_mappings("with_thread.so"), 0);
    EXPECT_GT(count_mappings("libcompanion.so"), 0);
  }
  EXPECT_EQ(count_mappings("with_thread.so"), 0);
  EXPECT_GT(count_mappings("libcompanion.so"), 0);  // its thread still runs there
}

TEST(Library, DoesNotPinAnotherPluginThatWasOpenedLater) {
  Manifest second = manifest_of(kLibraries / "other_title.so");
  second.techniques[0].title = "Another title";
  auto first = std::make_unique<Library>(manifest_of(kLibraries / "right.so"));
  auto later = std::make_unique<Library>(second);
  first.reset();
  later.reset();
  EXPECT_EQ(count_mappings(".heddle-plugin"), 0);
}

TEST(Library, ThatIsMissingIsNamed) {
  EXPECT_EQ(
      message(manifest_of(kLibraries / "absent.so"), HEDDLE_FAILED),
      "absent.so: error: the library of this manifest is missing\n  help:     build the plugin again, or delete " +
          kLibraries.string());
}

TEST(Library, WithoutEntryIsRefused) {
  EXPECT_EQ(message(manifest_of(kLibraries / "no_entry.so"), HEDDLE_BUG),
            "no_entry.so: error: this library exports no heddle_entry\n"
            "  help:     build plugins with heddle_plugin() of plugins/heddle_plugin.cmake");
  EXPECT_EQ(count_mappings("no_entry.so"), 0);
  EXPECT_EQ(message(manifest_of(kLibraries / "null_entry.so"), HEDDLE_BUG),
            "null_entry.so: error: heddle_entry answered NULL\n  expected: a heddle_plugin");
  EXPECT_EQ(count_mappings("null_entry.so"), 0);
}

TEST(Library, OfAnotherAbiThanItsManifestSaysIsRefused) {
  EXPECT_EQ(
      message(manifest_of(kLibraries / "other_abi.so"), HEDDLE_UNSUPPORTED),
      "other_abi.so: error: this plugin was built for another version of Heddle's interface\n"
      "  found:    ABI 0.77\n  expected: ABI 0.1\n  help:     build the plugin again with this version's headers");
}

TEST(Library, ThatDisagreesWithItsManifestNamesTheFirstField) {
  EXPECT_EQ(message(manifest_of(kLibraries / "other_title.so"), HEDDLE_BAD_INPUT),
            "other_title.so: error: technique 'display/test': library and manifest disagree in 'title'\n"
            "  found:    \"Another title\" in the library\n  expected: \"A test\" as the manifest says\n"
            "  help:     build the plugin again: its manifest is not that of this library");
  Manifest manifest = manifest_of(kLibraries / "right.so");
  manifest.techniques[0].stages[0].accesses[1].access = HEDDLE_ACCESS_COLOR;
  EXPECT_EQ(message(manifest, HEDDLE_BAD_INPUT),
            "right.so: error: technique 'display/test': library and manifest disagree in 'stages/0/accesses/1/access'\n"
            "  found:    \"storage_write\" in the library\n  expected: \"color\" as the manifest says\n"
            "  help:     build the plugin again: its manifest is not that of this library");
  manifest = manifest_of(kLibraries / "right.so");
  manifest.techniques[0].ports.pop_back();
  EXPECT_THAT(message(manifest, HEDDLE_BAD_INPUT),
              HasSubstr("disagree in 'ports'\n  found:    2 elements in the library\n"
                        "  expected: 1 elements as the manifest says"));
  EXPECT_EQ(message(manifest_of(kLibraries / "two_techniques.so"), HEDDLE_BAD_INPUT),
            "two_techniques.so: error: library and manifest disagree in the number of techniques\n"
            "  found:    2 in the library\n  expected: 1 as the manifest says\n"
            "  help:     build the plugin again: its manifest is not that of this library");
}

TEST(Library, WithAnUndefinedSymbolIsRefusedWhenOpened) {
  EXPECT_EQ(message(manifest_of(kLibraries / "undefined_symbol.so"), HEDDLE_FAILED),
            "undefined_symbol.so: error: cannot load this library\n"
            "  found:    undefined symbol: heddle_test_symbol_that_nobody_defines");
}

TEST(Library, ThatNeedsAMissingLibraryIsRefusedAndNamesIt) {
  EXPECT_EQ(message(manifest_of(kLibraries / "without_companion.so"), HEDDLE_FAILED),
            "without_companion.so: error: cannot load this library\n"
            "  found:    libabsent.so: cannot open shared object file: No such file or directory\n"
            "  help:     install the library that is named, or build again: what this machine lacks is then left out");
}

TEST(Library, ThatIsNoLibraryIsRefused) {
  const fs::path file = fs::path(testing::TempDir()) / "text.so";
  std::ofstream(file) << "this is text, and long enough to be read as a header of a library that it is not";
  EXPECT_EQ(message(manifest_of(file), HEDDLE_FAILED),
            "text.so: error: cannot load this library\n  found:    invalid ELF header");
}

TEST(RegistryOpen, SharesALibraryUntilTheLastHolderLetsGo) {
  const fs::path root = fs::path(testing::TempDir()) / "shared_open";
  const fs::path folder = root / "display" / "test";
  fs::create_directories(folder);
  fs::copy_file(fs::path(HEDDLE_SOURCE_DIR) / "plugins/display/role.toml", root / "display/role.toml",
                fs::copy_options::overwrite_existing);
  fs::copy_file(kLibraries / "right.so", folder / "right.so", fs::copy_options::overwrite_existing);
  std::ofstream(folder / "test.manifest.json") << to_json(manifest_of(folder / "right.so"));
  Registry registry({root});
  const TechniqueEntry entry = registry.find("display/test");
  ASSERT_NE(entry.technique, nullptr);
  EXPECT_EQ(count_mappings("right.so"), 0);  // known without being open
  std::shared_ptr<Library> first = registry.open(entry);
  std::shared_ptr<Library> second = registry.open(entry);
  EXPECT_EQ(first, second);
  first.reset();
  EXPECT_GT(count_mappings("right.so"), 0);
  second.reset();
  EXPECT_EQ(count_mappings("right.so"), 0);
  EXPECT_NE(registry.open(entry), nullptr);
  fs::remove_all(root);
}

}  // namespace
}  // namespace heddle
