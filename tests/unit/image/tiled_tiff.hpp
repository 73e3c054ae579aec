// SPDX-License-Identifier: Apache-2.0
// Writes tiled TIFF files, which the host only reads. Tiles may share their bytes, so that an image of any size is a
// small file.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

namespace heddle_test {

struct TiledLevel {
  std::uint32_t width = 0, height = 0, tile = 0;  // tile: a multiple of 16
  bool is_repeated = false;                       // all tiles hold what the first one does
  std::function<void(std::uint32_t x, std::uint32_t y, std::uint8_t* rgb)> texel;
};

/// Little-endian, 8 bits, RGB, not compressed; levels after the first are marked as smaller versions of it.
inline void write_tiled_tiff(const std::filesystem::path& file, const std::vector<TiledLevel>& levels) {
  std::string bytes("II*\0", 4);
  const auto put = [&](std::uint64_t value, int size) {
    for (int i = 0; i < size; ++i) bytes.push_back(static_cast<char>(value >> (8 * i) & 255U));
  };
  std::size_t link = bytes.size();
  put(0, 4);
  for (std::size_t number = 0; number < levels.size(); ++number) {
    const TiledLevel& level = levels[number];
    const std::uint32_t across = (level.width + level.tile - 1) / level.tile;
    const std::uint32_t down = (level.height + level.tile - 1) / level.tile;
    const std::uint32_t tile_bytes = 3 * level.tile * level.tile;
    std::vector<std::uint32_t> offsets;
    for (std::uint32_t t = 0; t < across * down; ++t) {
      if (level.is_repeated && t > 0) {
        offsets.push_back(offsets.front());
        continue;
      }
      offsets.push_back(static_cast<std::uint32_t>(bytes.size()));
      for (std::uint32_t y = 0; y < level.tile; ++y) {
        for (std::uint32_t x = 0; x < level.tile; ++x) {
          std::uint8_t rgb[3] = {};
          level.texel(std::min(t % across * level.tile + x, level.width - 1),
                      std::min(t / across * level.tile + y, level.height - 1), rgb);
          bytes.append(reinterpret_cast<const char*>(rgb), 3);
        }
      }
    }
    const auto array = [&](const std::vector<std::uint32_t>& values) {
      const std::size_t at = bytes.size();
      for (const std::uint32_t value : values) put(value, 4);
      return static_cast<std::uint32_t>(at);
    };
    const auto count = static_cast<std::uint32_t>(offsets.size());
    const std::uint32_t offset_at = array(offsets);
    const std::uint32_t size_at = array(std::vector<std::uint32_t>(count, tile_bytes));
    const std::size_t bits_at = bytes.size();
    for (int i = 0; i < 3; ++i) put(8, 2);
    if (bytes.size() % 2 != 0) put(0, 1);
    const auto here = static_cast<std::uint32_t>(bytes.size());
    for (int i = 0; i < 4; ++i) bytes[link + static_cast<std::size_t>(i)] = static_cast<char>(here >> (8 * i) & 255U);
    struct Entry {
      std::uint32_t tag, type, count, value;
    };
    const Entry entries[] = {
        {254, 4, 1, number > 0 ? 1U : 0U},
        {256, 4, 1, level.width},
        {257, 4, 1, level.height},
        {258, 3, 3, static_cast<std::uint32_t>(bits_at)},
        {259, 3, 1, 1},  // not compressed
        {262, 3, 1, 2},  // RGB
        {277, 3, 1, 3},  // samples a pixel
        {284, 3, 1, 1},  // one plane
        {322, 4, 1, level.tile},
        {323, 4, 1, level.tile},
        {324, 4, count, count == 1 ? offsets[0] : offset_at},
        {325, 4, count, count == 1 ? tile_bytes : size_at},
    };
    put(std::size(entries), 2);
    for (const Entry& entry : entries) {
      put(entry.tag, 2);
      put(entry.type, 2);
      put(entry.count, 4);
      put(entry.value, 4);
    }
    link = bytes.size();
    put(0, 4);
  }
  std::ofstream(file, std::ios::binary) << bytes;
}

}  // namespace heddle_test
