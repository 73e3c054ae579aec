// SPDX-License-Identifier: Apache-2.0
// Stores: what is written is read, at once and later, in whole clusters; what was cut off or is gone is told.
#include "graph/store_file.hpp"

#include "diagnostics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <random>

namespace heddle::graph {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class Stores : public testing::Test {
 protected:
  Stores() : folder_(fs::path(testing::TempDir()) / ("heddle_stores_" + std::to_string(getpid()))) {
    fs::create_directories(folder_);
  }
  ~Stores() override { fs::remove_all(folder_); }
  /// Byte i of it is (i * 31 >> 3) & 255.
  std::shared_ptr<StorePlace> make(std::uint64_t size) const {
    std::vector<std::byte> bytes(size);
    for (std::uint64_t i = 0; i < size; ++i) bytes[i] = byte_at(i);
    StoreFile store(folder_ / "a.new");
    // Back to front: any order will do.
    const std::uint64_t half = size / 2;
    store.write(half, std::span(bytes).subspan(half));
    store.write(0, std::span(bytes).first(half));
    EXPECT_EQ(store.size(), size);
    store.keep_as(folder_ / "a.store");
    return std::make_shared<StorePlace>(folder_ / "a.store", size, false);
  }
  static std::byte byte_at(std::uint64_t i) { return static_cast<std::byte>(i * 31 >> 3 & 255U); }

  fs::path folder_;
};

std::string error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST_F(Stores, AnswerEveryRequestWithItsOwnBytesWhateverTheOrder) {
  constexpr std::uint64_t kSize = 1'000'003;
  StoreFile store(make(kSize));
  std::mt19937 random(2);
  struct Asked {
    std::uint64_t ticket, offset, bytes;
  };
  std::vector<Asked> asked;
  std::uint64_t used = 0;
  for (int i = 0; i < 200; ++i) {
    const std::uint64_t offset = random() % kSize,
                        bytes = 1 + random() % std::min<std::uint64_t>(kSize - offset, 20000);
    asked.push_back({store.request(offset, bytes), offset, bytes});
    used += bytes;
  }
  std::ranges::shuffle(asked, random);
  std::size_t wrong = 0;
  for (const Asked& one : asked) {
    const std::byte* data = store.collect(one.ticket, true);
    ASSERT_NE(data, nullptr);
    for (std::uint64_t i = 0; i < one.bytes; ++i) wrong += data[i] == byte_at(one.offset + i) ? 0U : 1U;
    store.release(one.ticket);
  }
  EXPECT_EQ(wrong, 0U);
  const heddle_store_counts counts = store.counts();
  EXPECT_EQ(counts.reads, 200U);
  EXPECT_EQ(counts.bytes_used, used);
  // Whole clusters: at each end less than one beyond what is asked for, but for the end of the file.
  EXPECT_GE(counts.bytes_read, used);
  EXPECT_LT(counts.bytes_read, used + std::uint64_t{200} * 2 * 4096);
}

TEST_F(Stores, WhatNobodyWantsAnyMoreIsForgotten) {
  StoreFile store(make(100'000));
  std::vector<std::uint64_t> tickets;
  for (int i = 0; i < 50; ++i) tickets.push_back(store.request(0, 100'000));
  for (const std::uint64_t ticket : tickets) store.release(ticket);
  EXPECT_THAT(error_of([&] { (void)store.collect(tickets.back(), true); }), HasSubstr("has no request 50"));
  const std::uint64_t last = store.request(5, 1);
  EXPECT_EQ(*store.collect(last, true), byte_at(5));
}

TEST_F(Stores, ReadBackWhatWasWrittenWhileTheyAreMade) {
  StoreFile store(folder_ / "b.new");
  const std::array<std::byte, 3> bytes{std::byte{1}, std::byte{2}, std::byte{3}};
  store.write(10'000, bytes);
  std::array<std::byte, 4> back{};
  store.read(9'999, back);
  EXPECT_THAT(back, testing::ElementsAre(std::byte{0}, std::byte{1}, std::byte{2}, std::byte{3}));
  EXPECT_THAT(error_of([&] { store.read(10'001, back); }),
              HasSubstr("it ends at byte 10003; 4 at 10001 are asked for"));
}

TEST_F(Stores, ThatAreNotKeptAreGone) {
  { const StoreFile store(folder_ / "c.new"); }
  { const StorePlace place(make(10)->file, 10, true); }
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(Stores, TellWhatIsWrongWithTheirFile) {
  const auto place = make(50'000);
  EXPECT_EQ(place->damage(), "");
  {
    StoreFile store(place);
    fs::resize_file(place->file, 40'000);
    const std::uint64_t there = store.request(39'000, 1'000), gone = store.request(39'000, 1'001);
    EXPECT_NE(store.collect(there, true), nullptr);
    EXPECT_THAT(error_of([&] { (void)store.collect(gone, true); }),
                AllOf(HasSubstr("a.store: error: the store was cut off since it was opened"),
                      HasSubstr("it ends at byte 40000; 1001 at 39000 are asked for")));
    EXPECT_THAT(error_of([&] { (void)store.request(50'000, 1); }), HasSubstr("1 bytes at 50000 are asked for"));
  }
  EXPECT_THAT(place->damage(), HasSubstr("has 40000 bytes of 50000"));
  EXPECT_THAT(error_of([&] { const StoreFile store(place); }),
              AllOf(HasSubstr("the store is not what was made"), HasSubstr("40000 bytes of 50000"),
                    HasSubstr("remove the file: the job makes it again")));
  fs::remove(place->file);
  EXPECT_THAT(place->damage(), HasSubstr("is not there"));
  EXPECT_THAT(error_of([&] { const StoreFile store(place); }), HasSubstr("No such file"));
}

}  // namespace
}  // namespace heddle::graph
