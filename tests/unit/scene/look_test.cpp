// SPDX-License-Identifier: Apache-2.0
#include "scene/look.hpp"

#include <gtest/gtest.h>

#include <set>

namespace heddle::scene {
namespace {

TEST(Look, TellsWordsTheirOrderAndTheirNumberApart) {
  std::set<std::array<std::uint64_t, 2>> seen;
  const auto add = [&](std::initializer_list<std::uint64_t> words) {
    Look look;
    for (const std::uint64_t word : words) look.add(word);
    EXPECT_TRUE(seen.insert(look.words()).second);
  };
  add({});
  add({0});
  add({0, 0});
  for (std::uint64_t bit = 0; bit < 64; ++bit) {
    add({1ULL << bit});
    add({1ULL << bit, 0});
    add({0, 1ULL << bit});
    add({1ULL << bit, 1ULL << bit});
  }
  Look inner, outer, plain;
  inner.add(5);
  outer.add(inner);
  plain.add(5);
  EXPECT_NE(outer, plain);
}

TEST(Look, FlipsHalfOfItsBitsForAnyOneBit) {
  for (std::size_t word = 0; word < 2; ++word) {
    int flipped = 0;
    for (std::uint64_t bit = 0; bit < 64; ++bit) {
      for (std::uint64_t base = 0; base < 64; ++base) {
        Look a, b;
        a.add(base * 0x123456789abcdefULL);
        b.add(base * 0x123456789abcdefULL ^ (1ULL << bit));
        flipped += std::popcount(a.words()[word] ^ b.words()[word]);
      }
    }
    // 64 x 64 trials of 64 bits: 131072 expected, with a deviation of 256 for independent ones; ten of those.
    EXPECT_NEAR(flipped, 131072, 2560);
  }
}

}  // namespace
}  // namespace heddle::scene
