// SPDX-License-Identifier: Apache-2.0
// Source: Fowler, Noll, Vo, "The FNV hash algorithm".
#include "content_hash.hpp"

#include <fmt/format.h>

#include <fstream>
#include <sstream>

namespace heddle {

void ContentHash::add(std::string_view bytes) {
  const std::uint64_t size = bytes.size();
  for (unsigned shift = 0; shift < 64; shift += 8) mix((size >> shift) & 0xffU);
  for (const char c : bytes) mix(static_cast<unsigned char>(c));
}

void ContentHash::add_long(std::span<const std::byte> bytes) {
  constexpr std::size_t kQuarters = 4;
  const std::size_t size = bytes.size() / kQuarters;
  std::array<ContentHash, kQuarters> quarters;
  ContentHash &a = quarters[0], &b = quarters[1], &c = quarters[2], &d = quarters[3];
  const std::byte* p = bytes.data();
  for (std::size_t i = 0; i < size; ++i) {
    a.mix(std::to_integer<std::uint64_t>(p[i]));
    b.mix(std::to_integer<std::uint64_t>(p[size + i]));
    c.mix(std::to_integer<std::uint64_t>(p[2 * size + i]));
    d.mix(std::to_integer<std::uint64_t>(p[3 * size + i]));
  }
  for (std::size_t i = kQuarters * size; i < bytes.size(); ++i) d.mix(std::to_integer<std::uint64_t>(p[i]));
  add(fmt::format("{} {} {} {} {}", bytes.size(), a.hexadecimal(), b.hexadecimal(), c.hexadecimal(), d.hexadecimal()));
}

std::string ContentHash::hexadecimal() const {
  return fmt::format("{:016x}{:016x}", high_, low_);
}

std::optional<std::string> hash_of_file(const std::filesystem::path& file) {
  std::error_code ignored;
  std::ifstream stream(file, std::ios::binary);
  if (!stream || !std::filesystem::is_regular_file(file, ignored)) return std::nullopt;
  std::ostringstream text;
  text << stream.rdbuf();
  ContentHash hash;
  hash.add_long(std::as_bytes(std::span(text.view())));
  return hash.hexadecimal();
}

}  // namespace heddle
