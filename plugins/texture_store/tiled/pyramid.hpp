// SPDX-License-Identifier: Apache-2.0
// All levels of a texture in a file of blocks, of which few are in memory at a time: level 0 is written as it comes,
// each coarser one is filtered from the one before, any rectangle of any level is read with what lies beyond its sides.
// Blocks know nothing of the tiles that are cut from them, and have no borders.
// Source  Mittring 2008, "Advanced Virtual Texture Topics": image class over a tiled temporary file, two passes
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "mip_kernels.hpp"
#include "texture_store.hpp"
#include "texture_tiles.hpp"

namespace heddle::texture_store {

using texture_tiles::Rgba8;

/// Linear values of sRGB codes; and the code whose value is nearest.
inline const std::array<float, 256>& linear_of_codes() {
  static const std::array<float, 256> kTable = [] {
    std::array<float, 256> table{};
    for (std::size_t code = 0; code < 256; ++code) {
      const double encoded = static_cast<double>(code) / 255.0;
      table[code] = static_cast<float>(encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4));
    }
    return table;
  }();
  return kTable;
}
inline std::uint8_t code_of_linear(float value) {
  static const texture_tiles::detail::Encoder kEncoder;
  return kEncoder.code(value);
}

/// Where blocks lie while they are not in memory. Both throw where it fails.
struct Disk {
  std::function<void(std::uint64_t offset, std::span<const std::byte> bytes)> write;
  std::function<void(std::uint64_t offset, std::span<std::byte> bytes)> read;
};

class Pyramid {
 public:
  static constexpr std::uint32_t kBlock = 256;         // texels a side: a quarter of a MiB
  static constexpr std::size_t kBlocksInMemory = 128;  // 32 MiB: two rows of neighbours of a part of 2048 texels

  /// extent: of level 0, a power of two; last: the coarsest level; address: texture_tiles::kWrap ...
  Pyramid(std::uint32_t extent, std::uint32_t last, std::uint32_t address, Disk disk)
      : extent_(extent), last_(last), address_(address), disk_(std::move(disk)) {
    // Small levels do not fill their block: what is behind them is there too.
    const std::array<std::byte, sizeof(Rgba8)> end{};
    disk_.write(offset_of(last_ + 1, 0, 0) - end.size(), end);
  }

  [[nodiscard]] std::uint32_t extent(std::uint32_t level) const { return std::max(extent_ >> level, 1U); }
  [[nodiscard]] std::uint32_t last() const { return last_; }
  /// Of all levels, in units of what `build` and writers of level 0 do.
  [[nodiscard]] std::uint64_t texels(std::uint32_t level) const { return std::uint64_t{extent(level)} * extent(level); }

  /// Rows of a part of a level that no block in memory has yet.
  void write(std::uint32_t level, std::uint32_t x, std::uint32_t y, std::uint32_t width, std::uint32_t height,
             const Rgba8* texels) {
    for (std::uint32_t block_y = y / kBlock; block_y * kBlock < y + height; ++block_y) {
      for (std::uint32_t block_x = x / kBlock; block_x * kBlock < x + width; ++block_x) {
        const std::uint32_t left = std::max(x, block_x * kBlock), right = std::min(x + width, (block_x + 1) * kBlock);
        const std::uint32_t top = std::max(y, block_y * kBlock), bottom = std::min(y + height, (block_y + 1) * kBlock);
        rows_.assign(std::size_t{kBlock} * (bottom - top), {});
        for (std::uint32_t row = top; row < bottom; ++row)
          std::copy_n(texels + std::size_t{width} * (row - y) + (left - x), right - left,
                      rows_.begin() + std::size_t{kBlock} * (row - top) + left % kBlock);
        const std::uint64_t at = offset_of(level, block_x, block_y);
        // Whole rows of a block at once, unless others have a part of them.
        const bool is_whole = right - left == std::min(kBlock, extent(level));
        if (is_whole) {
          disk_.write(at + row_bytes() * (top % kBlock), std::as_bytes(std::span(rows_)));
        } else {
          for (std::uint32_t row = top; row < bottom; ++row)
            disk_.write(at + row_bytes() * (row % kBlock) + sizeof(Rgba8) * (left % kBlock),
                        std::as_bytes(
                            std::span(rows_).subspan(std::size_t{kBlock} * (row - top) + left % kBlock, right - left)));
        }
      }
    }
  }

  /// Levels 1 to last() from level 0. `step` hears how many texels were made.
  void build(std::uint32_t kernel, const std::function<void(std::uint64_t)>& step) {
    for (std::uint32_t level = 1; level <= last_; ++level) {
      const std::uint32_t across = blocks(level);
      for (std::uint64_t code = 0; code < std::uint64_t{across} * across; ++code) {
        const std::uint32_t x = morton_x(code) * kBlock, y = morton_y(code) * kBlock;
        const std::uint32_t side = std::min(kBlock, extent(level));
        filter(kernel, level, x, y, side);
        write(level, x, y, side, side, filtered_.data());
        step(std::uint64_t{side} * side);
      }
    }
  }

  /// Texels from (x, y) on, which may lie outside.
  void read(std::uint32_t level, std::int64_t x, std::int64_t y, std::uint32_t width, std::uint32_t height,
            Rgba8* out) {
    const std::uint32_t extent = this->extent(level);
    columns_.resize(width);
    for (std::uint32_t i = 0; i < width; ++i) columns_[i] = texture_tiles::addressed(x + i, extent, address_);
    for (std::uint32_t row = 0; row < height; ++row, out += width) {
      const std::uint32_t v = texture_tiles::addressed(y + row, extent, address_);
      for (std::uint32_t i = 0; i < width;) {
        // As far as the columns go on in one block.
        const std::uint32_t first = columns_[i], block_end = (first / kBlock + 1) * kBlock;
        std::uint32_t count = 1;
        while (i + count < width && columns_[i + count] == first + count && first + count < block_end) ++count;
        const Rgba8* texels = block(level, first / kBlock, v / kBlock);
        std::copy_n(texels + std::size_t{kBlock} * (v % kBlock) + first % kBlock, count, out + i);
        i += count;
      }
    }
  }

 private:
  struct Block {
    std::uint64_t offset = 0;
    std::vector<Rgba8> texels;
  };
  static constexpr std::uint64_t row_bytes() { return sizeof(Rgba8) * kBlock; }
  [[nodiscard]] std::uint32_t blocks(std::uint32_t level) const { return (extent(level) + kBlock - 1) / kBlock; }
  [[nodiscard]] std::uint64_t offset_of(std::uint32_t level, std::uint32_t x, std::uint32_t y) const {
    std::uint64_t before = morton(x, y);
    for (std::uint32_t finer = 0; finer < level; ++finer) before += std::uint64_t{blocks(finer)} * blocks(finer);
    return before * row_bytes() * kBlock;
  }

  const Rgba8* block(std::uint32_t level, std::uint32_t x, std::uint32_t y) {
    const std::uint64_t offset = offset_of(level, x, y);
    if (!recent_.empty() && recent_.front().offset == offset) return recent_.front().texels.data();
    if (const auto known = known_.find(offset); known != known_.end()) {
      recent_.splice(recent_.begin(), recent_, known->second);
      return recent_.front().texels.data();
    }
    if (recent_.size() < kBlocksInMemory) {
      recent_.emplace_front();
      recent_.front().texels.resize(std::size_t{kBlock} * kBlock);
    } else {
      known_.erase(recent_.back().offset);
      recent_.splice(recent_.begin(), recent_, std::prev(recent_.end()));
    }
    recent_.front().offset = offset;
    known_[offset] = recent_.begin();
    disk_.read(offset, std::as_writable_bytes(std::span(recent_.front().texels)));
    return recent_.front().texels.data();
  }

  void filter(std::uint32_t kernel, std::uint32_t level, std::uint32_t x, std::uint32_t y, std::uint32_t side) {
    const std::uint32_t wide = 2 * side + 2 * mip_kernels::kMargin;
    const std::int64_t margin = mip_kernels::kMargin;
    around_.resize(std::size_t{wide} * wide);
    read(level - 1, 2 * std::int64_t{x} - margin, 2 * std::int64_t{y} - margin, wide, wide, around_.data());
    const std::array<float, 256>& linear = linear_of_codes();
    planes_.resize(3 * around_.size());
    for (std::size_t i = 0; i < around_.size(); ++i) {
      planes_[i] = linear[around_[i].r];
      planes_[i + around_.size()] = linear[around_[i].g];
      planes_[i + 2 * around_.size()] = linear[around_[i].b];
    }
    const std::size_t count = std::size_t{side} * side;
    halved_.resize(3 * count);
    mip_kernels::halve(kernel, side, side, planes_, halved_, scratch_);
    filtered_.resize(count);
    for (std::size_t i = 0; i < count; ++i)
      filtered_[i] = {code_of_linear(halved_[i]), code_of_linear(halved_[i + count]),
                      code_of_linear(halved_[i + 2 * count]), 255};
  }

  std::uint32_t extent_, last_, address_;
  Disk disk_;
  std::list<Block> recent_;  // the last one used first
  std::unordered_map<std::uint64_t, std::list<Block>::iterator> known_;
  std::vector<Rgba8> rows_, around_, filtered_;
  std::vector<std::uint32_t> columns_;
  std::vector<float> planes_, halved_, scratch_;
};

}  // namespace heddle::texture_store
