// SPDX-License-Identifier: Apache-2.0
// A store of textures as a job leaves it: the artifact says what lies where, the store beside it holds the tiles of all
// levels with their borders, each in as many whole clusters as it needs. What makes it and what reads it include this.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "block_compression.hpp"
#include "mip_kernels.hpp"

namespace heddle::texture_store {

inline constexpr std::uint32_t kMagic = 0x74736468U;  // "hdst"
inline constexpr std::uint32_t kVersion = 2;
inline constexpr std::uint64_t kCluster = 4096;  // of disks: tiles begin on them

/// One of the store's textures: 2^n tiles a side, levels 0, the finest, to n.
struct StoredTexture {
  std::uint32_t extent = 0;             // texels of level 0 along each side, a power of two
  std::uint32_t width = 0, height = 0;  // of what it was made from
  std::uint32_t reserved = 0;
  std::uint64_t first = 0;  // tiles of all textures before it
};

struct StoreHeader {
  std::uint32_t magic = kMagic, version = kVersion;
  std::uint32_t tile = 0, border = 0;  // texels
  std::uint32_t compression = 0;       // block_compression::Format
  std::uint32_t kernel = 0;            // mip_kernels::Kernel
  std::uint32_t address = 0;           // texture_tiles::kWrap ...
  std::uint32_t texture_count = 0;
  std::uint64_t contents = 0;  // hash of all tiles, in their order
  std::uint64_t kept = 0;      // tiles in the store: all, or those that differ
};

/// Behind each tile's texels: which it is (Store::mark_of), and what its bytes are.
struct TileMark {
  std::uint64_t place = 0, hash = 0;
};

/// Bits of x and y in turn: what is near in the texture is near on the disk.
inline std::uint64_t morton(std::uint32_t x, std::uint32_t y) {
  std::uint64_t code = 0;
  for (std::uint32_t bit = 0; bit < 32; ++bit)
    code |= (std::uint64_t{x >> bit & 1U} << (2 * bit)) | (std::uint64_t{y >> bit & 1U} << (2 * bit + 1));
  return code;
}
inline std::uint32_t morton_x(std::uint64_t code) {
  std::uint32_t x = 0;
  for (std::uint32_t bit = 0; bit < 32; ++bit) x |= static_cast<std::uint32_t>(code >> (2 * bit) & 1U) << bit;
  return x;
}
inline std::uint32_t morton_y(std::uint64_t code) {
  return morton_x(code >> 1U);
}

/// Tiles in front of (level, x, y) of a texture with 2^n tiles a side: coarse levels first.
inline std::uint64_t tiles_before(std::uint32_t n, std::uint32_t level, std::uint32_t x, std::uint32_t y) {
  return ((std::uint64_t{1} << (2 * (n - level))) - 1) / 3 + morton(x, y);
}
inline std::uint64_t tile_count(std::uint32_t n) {
  return ((std::uint64_t{4} << (2 * n)) - 1) / 3;
}

inline std::uint64_t place_of(std::uint32_t texture, std::uint32_t level, std::uint32_t x, std::uint32_t y) {
  return std::uint64_t{texture} << 40U | std::uint64_t{level} << 32U | std::uint64_t{y} << 16U | x;
}

struct Store {
  StoreHeader header;
  std::vector<StoredTexture> textures;
  /// Empty: every tile is there. Else which of those that are there each tile is, in the store's order.
  std::vector<std::uint32_t> index;

  [[nodiscard]] std::uint32_t pitch() const { return header.tile + 2 * header.border; }
  [[nodiscard]] std::uint64_t texel_bytes() const {
    return block_compression::bytes_of(header.compression, pitch(), pitch());
  }
  /// Of one tile with its mark: what is read.
  [[nodiscard]] std::uint64_t tile_bytes() const { return texel_bytes() + sizeof(TileMark); }
  [[nodiscard]] std::uint64_t stride() const { return (tile_bytes() + kCluster - 1) / kCluster * kCluster; }

  /// Which of the tiles that are there it is: the same number, the same bytes.
  [[nodiscard]] std::uint64_t kept_of(std::uint32_t texture, std::uint32_t level, std::uint32_t x,
                                      std::uint32_t y) const {
    const StoredTexture& of = textures[texture];
    const auto n = static_cast<std::uint32_t>(std::countr_zero(of.extent / header.tile));
    const std::uint64_t tile = of.first + tiles_before(n, level, x, y);
    return index.empty() ? tile : index[static_cast<std::size_t>(tile)];
  }
  [[nodiscard]] std::uint64_t offset_of(std::uint32_t texture, std::uint32_t level, std::uint32_t x,
                                        std::uint32_t y) const {
    return kept_of(texture, level, x, y) * stride();
  }
  /// As TileMark::place has it.
  [[nodiscard]] std::uint64_t mark_of(std::uint32_t texture, std::uint32_t level, std::uint32_t x,
                                      std::uint32_t y) const {
    return index.empty() ? place_of(texture, level, x, y) : kept_of(texture, level, x, y);
  }
};

/// Not against malice: finds what a disk or a copy has changed.
inline std::uint64_t hash_of(std::span<const std::byte> bytes, std::uint64_t seed = 0) {
  std::uint64_t hash = seed ^ 0x9E3779B97F4A7C15ULL ^ bytes.size();
  std::size_t at = 0;
  for (; at + 8 <= bytes.size(); at += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + at, 8);
    hash = (hash ^ word) * 0xFF51AFD7ED558CCDULL;
    hash ^= hash >> 32U;
  }
  for (; at < bytes.size(); ++at) hash = (hash ^ std::to_integer<std::uint64_t>(bytes[at])) * 0xFF51AFD7ED558CCDULL;
  return hash ^ hash >> 29U;
}

inline std::vector<std::byte> artifact_of(const Store& store) {
  std::vector<std::byte> bytes;
  const auto add = [&](std::span<const std::byte> part) { bytes.insert(bytes.end(), part.begin(), part.end()); };
  add(std::as_bytes(std::span(&store.header, 1)));
  add(std::as_bytes(std::span(store.textures)));
  add(std::as_bytes(std::span(store.index)));
  return bytes;
}

/// Nothing if these bytes are no artifact of this version.
inline std::optional<Store> store_of(std::span<const std::byte> artifact) {
  Store store;
  if (artifact.size() < sizeof(StoreHeader)) return std::nullopt;
  std::memcpy(&store.header, artifact.data(), sizeof(StoreHeader));
  artifact = artifact.subspan(sizeof(StoreHeader));
  const StoreHeader& header = store.header;
  const std::size_t table = std::size_t{header.texture_count} * sizeof(StoredTexture);
  if (header.magic != kMagic || header.version != kVersion || header.tile == 0 || artifact.size() < table)
    return std::nullopt;
  store.textures.resize(header.texture_count);
  if (table > 0) std::memcpy(store.textures.data(), artifact.data(), table);
  artifact = artifact.subspan(table);
  std::uint64_t tiles = 0;
  for (const StoredTexture& texture : store.textures) {
    if (!std::has_single_bit(texture.extent) || texture.extent < header.tile || texture.first != tiles)
      return std::nullopt;
    tiles += tile_count(static_cast<std::uint32_t>(std::countr_zero(texture.extent / header.tile)));
  }
  if (artifact.empty()) return header.kept == tiles ? std::optional(store) : std::nullopt;
  if (artifact.size() != tiles * sizeof(std::uint32_t)) return std::nullopt;
  store.index.resize(static_cast<std::size_t>(tiles));
  std::memcpy(store.index.data(), artifact.data(), artifact.size());
  for (const std::uint32_t kept : store.index)
    if (kept >= header.kept) return std::nullopt;
  return store;
}

/// What is wrong with the bytes of a tile, or nothing.
inline std::string damage_of(const Store& store, std::uint64_t place, std::span<const std::byte> bytes) {
  TileMark mark;
  std::memcpy(&mark, bytes.data() + store.texel_bytes(), sizeof mark);
  if (mark.place != place) return "another tile is in its place";
  if (mark.hash != hash_of(bytes.first(store.texel_bytes()))) return "its bytes are not those that were written";
  return {};
}

}  // namespace heddle::texture_store
