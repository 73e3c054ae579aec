// SPDX-License-Identifier: Apache-2.0
// host/graph/artifact_cache.cpp: whole or nothing, whatever happens to files and processes.
#include "graph/artifact_cache.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <iterator>

namespace heddle::graph {
namespace {

namespace fs = std::filesystem;

const std::string kKey(32, 'a'), kOther(32, 'b'), kThird(32, 'c');
constexpr std::uint64_t kPlenty = 1ULL << 40U;

class ArtifactCacheTest : public testing::Test {
 protected:
  ArtifactCacheTest() : folder_(fs::path(testing::TempDir()) / ("heddle_artifact_cache_" + std::to_string(getpid()))) {
    fs::remove_all(folder_);
  }
  ~ArtifactCacheTest() override { fs::remove_all(folder_); }

  static std::vector<std::byte> bytes(std::size_t size, int value) {
    return std::vector<std::byte>(size, static_cast<std::byte>(value));
  }
  [[nodiscard]] std::string contents() const {
    std::ifstream stream(ArtifactCache(folder_, kPlenty).file(kKey), std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  void replace(const std::string& text) const {
    std::ofstream(ArtifactCache(folder_, kPlenty).file(kKey), std::ios::binary) << text;
  }
  [[nodiscard]] std::string damage() const {
    std::string told;
    EXPECT_FALSE(ArtifactCache(folder_, kPlenty).read(kKey, told));
    return told;
  }
  [[nodiscard]] std::size_t count() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }

  fs::path folder_;
};

TEST_F(ArtifactCacheTest, GivesBackWhatWasWritten) {
  const ArtifactCache cache(folder_, kPlenty);
  std::string told = "before";
  EXPECT_FALSE(cache.read(kKey, told));
  EXPECT_EQ(told, "") << "no file is no damage";
  const ArtifactParts parts{{"empty", {}}, {"image", bytes(1000, 7)}, {"value", bytes(3, 9)}};
  EXPECT_EQ(cache.write(kKey, {parts.begin(), parts.end()}), "");
  EXPECT_EQ(cache.read(kKey, told), parts);
  EXPECT_FALSE(cache.read(kOther, told));
  EXPECT_EQ(count(), 1U);
}

TEST_F(ArtifactCacheTest, WithoutAFolderKeepsNothing) {
  const ArtifactCache cache({}, kPlenty);
  EXPECT_EQ(cache.write(kKey, {}), "");
  std::string told;
  EXPECT_FALSE(cache.read(kKey, told));
}

TEST_F(ArtifactCacheTest, TellsEveryChangedByteAndEveryMissingEnd) {
  const auto part = bytes(40, 5);
  ASSERT_EQ(ArtifactCache(folder_, kPlenty).write(kKey, {{"image", part}}), "");
  const std::string whole = contents();
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string changed = whole;
    changed[at] = static_cast<char>(changed[at] ^ 0x10);
    replace(changed);
    EXPECT_NE(damage(), "") << "byte " << at;
    replace(whole.substr(0, at));
    EXPECT_NE(damage(), "") << "the first " << at << " bytes";
  }
  replace(whole + "x");
  EXPECT_EQ(damage(), "its bytes are not those that were written");
  replace("heddle-shader 1\nand more of it");
  EXPECT_EQ(damage(), "it does not begin as an artifact does");
  replace(whole.substr(0, 18) + kOther + whole.substr(50));
  EXPECT_EQ(damage(), "it holds another key than its name says");
}

TEST_F(ArtifactCacheTest, TellsWhatIsNoFileAndPutsOneInItsPlace) {
  const ArtifactCache cache(folder_, kPlenty);
  const auto part = bytes(40, 5);
  fs::create_directories(cache.file(kKey) / "with" / "folders");
  EXPECT_EQ(damage(), "it is no file");
  EXPECT_EQ(cache.write(kOther, {{"image", part}}), "") << "others have room beside it";
  EXPECT_EQ(cache.write(kKey, {{"image", part}}), "");
  EXPECT_TRUE(fs::is_regular_file(cache.file(kKey)));
  EXPECT_EQ(count(), 2U) << "nothing unfinished";
  std::string told;
  EXPECT_TRUE(cache.read(kKey, told)) << told;
  cache.remove(kKey);
  fs::create_directories(cache.file(kKey) / "again");
  cache.remove(kKey);
  EXPECT_FALSE(fs::exists(cache.file(kKey)));
  ASSERT_EQ(mkfifo(cache.file(kKey).c_str(), 0600), 0);
  EXPECT_EQ(damage(), "it is no file") << "and nobody waits for who writes to it";
  EXPECT_EQ(cache.write(kKey, {{"image", part}}), "");
  EXPECT_TRUE(cache.read(kKey, told)) << told;
}

TEST_F(ArtifactCacheTest, IsWholeOrNotThereAfterTheWriterWasKilled) {
  const ArtifactCache cache(folder_, kPlenty);
  const auto part = bytes(1 << 20, 1);
  int kept = 0, lost = 0;
  // A child writes; it is killed as soon as a file, under whichever name, has bytes, or has been renamed.
  for (int round = 0; round < 5; ++round) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      cache.write(kKey, {{"image", part}});
      _exit(0);
    }
    const auto has_begun = [&] {
      std::error_code gone;
      for (const auto& entry : fs::directory_iterator(folder_))
        if (entry.file_size(gone) > 0 && !gone) return true;
      return false;
    };
    bool has_ended = false;
    while (!has_ended && !has_begun()) has_ended = waitpid(child, nullptr, WNOHANG) == child;
    if (!has_ended) {
      kill(child, SIGKILL);
      waitpid(child, nullptr, 0);
    }
    std::string told;
    const auto found = cache.read(kKey, told);
    EXPECT_EQ(told, "");
    if (found) {
      EXPECT_EQ(found->at("image"), part);
      ++kept;
    } else {
      ++lost;
    }
    EXPECT_EQ(cache.write(kKey, {{"image", part}}), "") << "what a killed one left is in nobody's way";
    EXPECT_TRUE(cache.read(kKey, told));
  }
  EXPECT_EQ(kept + lost, 5);
}

TEST_F(ArtifactCacheTest, IsNeverTakenHalfWhereWritingEndsInTheMiddle) {
  const ArtifactCache cache(folder_, kPlenty);
  const auto part = bytes(1 << 20, 1);
  // A limit on the size of files ends the writing at exactly half: by a signal that kills, or as a full disk does.
  for (const bool is_killed : {true, false}) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      const rlimit half{1 << 19, 1 << 19}, no_core{0, 0};
      setrlimit(RLIMIT_CORE, &no_core);
      setrlimit(RLIMIT_FSIZE, &half);
      signal(SIGXFSZ, is_killed ? SIG_DFL : SIG_IGN);
      const std::string problem = cache.write(kKey, {{"image", part}});
      _exit(problem == "the artifact cache " + folder_.string() + " cannot be written" ? 0 : 1);
    }
    int status = -1;
    waitpid(child, &status, 0);
    if (is_killed)
      EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGXFSZ) << status;
    else
      EXPECT_EQ(status, 0) << "it says so";
    std::string told;
    EXPECT_FALSE(cache.read(kKey, told));
    EXPECT_EQ(told, "");
    EXPECT_EQ(count(), 1U) << "the half of the killed one, under a temporary name; a full disk leaves none";
  }
  EXPECT_EQ(cache.write(kKey, {{"image", part}}), "");
  cache.remove(kKey);
  cache.remove(kOther);
  std::string told;
  EXPECT_FALSE(cache.read(kKey, told)) << "it was removed";
}

TEST_F(ArtifactCacheTest, IsWholeForReadersWhileManyWrite) {
  const ArtifactCache cache(folder_, kPlenty);
  const auto part = bytes(100000, 3);
  std::vector<pid_t> writers;
  for (int i = 0; i < 3; ++i) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      int failures = 0;
      for (int k = 0; k < 20; ++k) failures += cache.write(kKey, {{"image", part}}).empty() ? 0 : 1;
      _exit(failures);
    }
    writers.push_back(child);
  }
  std::string told;
  for (int k = 0; k < 50; ++k) {
    const auto found = cache.read(kKey, told);
    EXPECT_EQ(told, "");
    if (found) {
      EXPECT_EQ(found->at("image"), part);
    }
  }
  for (const pid_t writer : writers) {
    int status = -1;
    waitpid(writer, &status, 0);
    EXPECT_EQ(status, 0);
  }
  EXPECT_TRUE(cache.read(kKey, told));
  EXPECT_EQ(count(), 1U);
}

TEST_F(ArtifactCacheTest, MakesRoomByWhatWasNotUsedForLongest) {
  const auto part = bytes(1000, 1);
  const ArtifactCache cache(folder_, 2500);  // two of them, with their heads
  const auto used = [&](const std::string& key, int hours_ago) {
    fs::last_write_time(cache.file(key), fs::file_time_type::clock::now() - std::chrono::hours(hours_ago));
  };
  std::string told;
  cache.write(kKey, {{"image", part}});
  used(kKey, 5);
  cache.write(kOther, {{"image", part}});
  used(kOther, 3);
  EXPECT_TRUE(cache.read(kKey, told));  // from now on the one that was used last
  cache.write(kThird, {{"image", part}});
  EXPECT_TRUE(cache.read(kKey, told));
  EXPECT_FALSE(cache.read(kOther, told));
  EXPECT_TRUE(cache.read(kThird, told));
  EXPECT_EQ(ArtifactCache(folder_, 10).write(kOther, {{"image", part}}), "");
  EXPECT_TRUE(cache.read(kOther, told)) << "never the new one";
  EXPECT_EQ(count(), 1U);
}

TEST_F(ArtifactCacheTest, StoresGoWithTheirArtifactAndCountAsPartOfIt) {
  const ArtifactCache cache(folder_, 2500);
  const std::vector<std::byte> part(1000);
  cache.write(kKey, {{"image", part}});
  std::ofstream(cache.store(kKey, "image")) << std::string(1000, 'x');
  EXPECT_EQ(cache.new_store(kKey, "image").parent_path(), folder_);
  EXPECT_NE(cache.new_store(kKey, "image"), cache.new_store(kKey, "image"));
  for (const fs::path& file : {cache.file(kKey), cache.store(kKey, "image")})
    fs::last_write_time(file, fs::file_time_type::clock::now() - std::chrono::hours(5));
  cache.write(kOther, {{"image", part}});
  EXPECT_FALSE(fs::exists(cache.file(kKey)));
  EXPECT_FALSE(fs::exists(cache.store(kKey, "image")));
  EXPECT_TRUE(fs::exists(cache.file(kOther)));
  std::ofstream(cache.store(kOther, "image")) << "x";
  cache.remove(kOther);
  EXPECT_EQ(count(), 0U);
}

TEST_F(ArtifactCacheTest, RemovesTemporaryFilesOfLongAgoAndNoOthers) {
  fs::create_directories(folder_);
  std::ofstream(folder_ / "old.new") << "x";
  std::ofstream(folder_ / "young.new") << "x";
  std::ofstream(folder_ / "notes.txt") << "x";
  for (const char* name : {"old.new", "notes.txt"})
    fs::last_write_time(folder_ / name, fs::file_time_type::clock::now() - std::chrono::hours(2));
  EXPECT_EQ(ArtifactCache(folder_, kPlenty).write(kKey, {}), "");
  EXPECT_FALSE(fs::exists(folder_ / "old.new"));
  EXPECT_TRUE(fs::exists(folder_ / "young.new"));
  EXPECT_TRUE(fs::exists(folder_ / "notes.txt"));
}

TEST_F(ArtifactCacheTest, ThatCannotBeMadeSaysSo) {
  std::ofstream(folder_) << "a file where the folder should be";
  EXPECT_EQ(ArtifactCache(folder_, kPlenty).write(kKey, {}),
            "the artifact cache " + folder_.string() + " cannot be made: Not a directory");
}

}  // namespace
}  // namespace heddle::graph
