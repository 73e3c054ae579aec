// SPDX-License-Identifier: Apache-2.0
// Bytes -> a number that differs where they do.
#pragma once

#include "owen_sobol.hpp"

#include <cstddef>
#include <cstring>
#include <type_traits>

namespace heddle::path_tracer {

/// Sums of mixed words: 64 bits, so that by chance two scenes in 2^32 agree. Not against people who try.
class ContentHash {
 public:
  void add_bytes(const void* data, std::size_t bytes) {
    const auto* from = static_cast<const std::byte*>(data);
    for (; bytes >= 8; from += 8, bytes -= 8) {
      std::uint64_t word = 0;
      std::memcpy(&word, from, 8);
      add_word(word);
    }
    std::uint64_t rest = bytes;  // the length too, so that zeros at an end count
    std::memcpy(reinterpret_cast<std::byte*>(&rest) + 1, from, bytes);
    add_word(rest);
  }
  template <typename T>
  void add(const T& value) {
    static_assert(std::is_trivially_copyable_v<T> && !std::is_pointer_v<T>);
    add_bytes(&value, sizeof value);
  }
  [[nodiscard]] std::uint64_t value() const { return sampling::mix_bits(state_); }

 private:
  void add_word(std::uint64_t word) { state_ = sampling::mix_bits(state_ ^ word) + 0x9e3779b97f4a7c15ULL; }
  std::uint64_t state_ = 0x6a09e667f3bcc909ULL;
};

}  // namespace heddle::path_tracer
