// SPDX-License-Identifier: Apache-2.0
// Source: Fowler, Noll, Vo, "The FNV hash algorithm".
#include "content_hash.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <vector>

namespace heddle {

void ContentHash::add(std::string_view bytes) {
  const std::uint64_t size = bytes.size();
  for (unsigned shift = 0; shift < 64; shift += 8) mix((size >> shift) & 0xffU);
  for (const char c : bytes) mix(static_cast<unsigned char>(c));
}

void ContentHash::add_long(std::span<const std::byte> bytes) {
  Quarters quarters;
  const std::size_t size = bytes.size() / quarters.size();
  const auto* p = reinterpret_cast<const char*>(bytes.data());
  mix_side_by_side(quarters, {p, p + size, p + 2 * size, p + 3 * size}, size);
  add_quarters(quarters, {p + quarters.size() * size, bytes.size() - quarters.size() * size}, bytes.size());
}

void ContentHash::mix_side_by_side(Quarters& quarters, const std::array<const char*, 4>& from, std::size_t count) {
  ContentHash a = quarters[0], b = quarters[1], c = quarters[2], d = quarters[3];
  for (std::size_t i = 0; i < count; ++i) {
    a.mix(static_cast<unsigned char>(from[0][i]));
    b.mix(static_cast<unsigned char>(from[1][i]));
    c.mix(static_cast<unsigned char>(from[2][i]));
    d.mix(static_cast<unsigned char>(from[3][i]));
  }
  quarters = {a, b, c, d};
}

void ContentHash::add_quarters(Quarters& quarters, std::span<const char> rest, std::uint64_t size) {
  for (const char c : rest) quarters.back().mix(static_cast<unsigned char>(c));
  add(fmt::format("{} {} {} {} {}", size, quarters[0].hexadecimal(), quarters[1].hexadecimal(),
                  quarters[2].hexadecimal(), quarters[3].hexadecimal()));
}

std::string ContentHash::hexadecimal() const {
  return fmt::format("{:016x}{:016x}", high_, low_);
}

std::optional<std::string> hash_of_file(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) return std::nullopt;
  const std::uint64_t size = std::filesystem::file_size(file, error);
  if (error) return std::nullopt;
  // The quarters of add_long, a piece of each at a time: files may be larger than memory.
  ContentHash::Quarters hashes;
  const std::uint64_t quarter = size / hashes.size();
  std::array<std::ifstream, std::tuple_size_v<ContentHash::Quarters>> streams;
  for (std::size_t q = 0; q < streams.size(); ++q) {
    streams[q].open(file, std::ios::binary);
    streams[q].seekg(static_cast<std::streamoff>(q * quarter));
    if (!streams[q]) return std::nullopt;
  }
  constexpr std::uint64_t kPiece = 1U << 18U;
  std::array<std::vector<char>, std::tuple_size_v<ContentHash::Quarters>> pieces;
  const auto read = [&](std::size_t q, std::uint64_t bytes) {
    pieces[q].resize(bytes);
    return static_cast<bool>(streams[q].read(pieces[q].data(), static_cast<std::streamsize>(bytes)));
  };
  for (std::uint64_t at = 0; at < quarter; at += kPiece) {
    const std::uint64_t count = std::min(kPiece, quarter - at);
    for (std::size_t q = 0; q < streams.size(); ++q)
      if (!read(q, count)) return std::nullopt;
    ContentHash::mix_side_by_side(hashes, {pieces[0].data(), pieces[1].data(), pieces[2].data(), pieces[3].data()},
                                  count);
  }
  const std::uint64_t rest = size - hashes.size() * quarter;
  if (!read(hashes.size() - 1, rest)) return std::nullopt;
  ContentHash hash;
  hash.add_quarters(hashes, pieces.back(), size);
  return hash.hexadecimal();
}

}  // namespace heddle
