// SPDX-License-Identifier: Apache-2.0
// What something looks like, as a number: equal ones look the same, up to a chance of 2^-128.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

namespace heddle::scene {

/// Steele, Lea and Flood 2014, "Fast splittable pseudorandom number generators": the finalizer, chained twice with
/// different increments. Much faster than ContentHash, and of this process only.
class Look {
 public:
  void add(std::uint64_t word) {
    words_[0] = mix(words_[0] + 0x9e3779b97f4a7c15ULL + word);
    words_[1] = mix(std::rotl(words_[1], 29) ^ (word * 0xd6e8feb86659fd93ULL + 0xa0761d6478bd642fULL));
  }
  void add(const Look& look) {
    add(look.words_[0]);
    add(look.words_[1]);
  }
  [[nodiscard]] const std::array<std::uint64_t, 2>& words() const { return words_; }
  bool operator==(const Look&) const = default;

 private:
  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31U);
  }
  std::array<std::uint64_t, 2> words_{};
};

}  // namespace heddle::scene
