// SPDX-License-Identifier: Apache-2.0
// A name for contents: what caches are keyed and checked by.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace heddle {

/// 32 hexadecimal digits of FNV-1a with 128 bits.
class ContentHash {
 public:
  void add(std::string_view bytes);  // its length goes in as well
  /// For megabytes: four quarters are hashed side by side, which keeps the processor busy, and their hashes go in.
  void add_long(std::span<const std::byte> bytes);
  /// add_long in steps: the first count bytes of each quarter, and so on; then what is left of the last one.
  using Quarters = std::array<ContentHash, 4>;
  static void mix_side_by_side(Quarters& quarters, const std::array<const char*, 4>& from, std::size_t count);
  void add_quarters(Quarters& quarters, std::span<const char> rest, std::uint64_t size);
  [[nodiscard]] std::string hexadecimal() const;

 private:
  void mix(std::uint64_t byte) {
    // The prime is 2^88 + 0x13b; low * 0x13b as 128 bits from halves of 32.
    constexpr std::uint64_t kPrimeLow = 0x13b;
    low_ ^= byte;
    const std::uint64_t part_low = (low_ & 0xffffffffULL) * kPrimeLow;
    const std::uint64_t part_high = (low_ >> 32U) * kPrimeLow + (part_low >> 32U);
    high_ = high_ * kPrimeLow + (part_high >> 32U) + (low_ << 24U);
    low_ = (part_high << 32U) | (part_low & 0xffffffffULL);
  }

  std::uint64_t high_ = 0x6c62272e07bb0142ULL, low_ = 0x62b821756295c58dULL;
};

/// Of a file's bytes; nothing if it cannot be read.
std::optional<std::string> hash_of_file(const std::filesystem::path& file);

}  // namespace heddle
