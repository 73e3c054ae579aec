// SPDX-License-Identifier: Apache-2.0
// Who has which part of an atlas: squares whose sides are a layer's, halved some times. What has a place keeps it as
// long as it can, so that what is drawn there stays good. Pure. Source  Knowlton 1965, "A fast storage allocator":
// buddies, here in two dimensions
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace depth_maps {

/// A square part of a layer, in texels.
struct Tile {
  std::uint32_t layer = 0, x = 0, y = 0, side = 0;
  bool operator==(const Tile&) const = default;
};

/// The same as the atlas is divided: `x` and `y` count squares of a layer's side halved `level` times.
struct Square {
  std::uint32_t layer = 0, level = 0, x = 0, y = 0;
  bool operator==(const Square&) const = default;
};

inline Tile tile_of(const Square& square, std::uint32_t layer_side) {
  // Odd sides leave a line free where they are halved.
  Tile tile{square.layer, 0, 0, layer_side};
  for (std::uint32_t bit = square.level; bit-- > 0;) {
    tile.side /= 2;
    tile.x += (square.x >> bit & 1U) * tile.side;
    tile.y += (square.y >> bit & 1U) * tile.side;
  }
  return tile;
}

class AtlasRoom {
 public:
  AtlasRoom(std::uint32_t layers, std::uint32_t levels)
      : layers_(layers), levels_(levels), states_(std::size_t{layers} * first_of(levels), State::kFree) {}

  void reserve(Square square) {
    at(square) = State::kTaken;
    while (square.level > 0) {
      square = parent(square);
      at(square) = State::kParted;
    }
  }

  /// `count` squares, or none if there are not so many. Those that leave the largest squares whole; of equal ones the
  /// first by layer, row and column.
  std::vector<Square> take(std::uint32_t level, std::uint32_t count) {
    const std::vector<State> before = states_;
    std::vector<Square> taken;
    while (taken.size() < count) {
      const std::optional<Square> found = find(level);
      if (!found) {
        states_ = before;
        return {};
      }
      reserve(*found);
      taken.push_back(*found);
    }
    return taken;
  }

 private:
  enum class State : std::uint8_t { kFree, kParted, kTaken };

  static std::size_t first_of(std::uint32_t level) { return ((std::size_t{1} << 2 * level) - 1) / 3; }
  static Square parent(const Square& square) { return {square.layer, square.level - 1, square.x / 2, square.y / 2}; }
  State& at(const Square& square) {
    const std::size_t row = std::size_t{1} << square.level;
    return states_[square.layer * first_of(levels_) + first_of(square.level) + square.y * row + square.x];
  }
  std::optional<Square> find(std::uint32_t level) {
    std::optional<Square> best;
    std::uint32_t best_parted = 0;
    for (std::uint32_t layer = 0; layer < layers_; ++layer) {
      for (std::uint32_t y = 0; y < 1U << level; ++y) {
        for (std::uint32_t x = 0; x < 1U << level; ++x) {
          const Square square{layer, level, x, y};
          if (at(square) != State::kFree) continue;
          // How finely is parted already what holds it: 0 where a whole layer would be broken up.
          Square above = square;
          while (above.level > 0 && at(above) == State::kFree) above = parent(above);
          if (at(above) == State::kTaken) continue;
          const std::uint32_t parted = at(above) == State::kParted ? above.level + 1 : 0;
          if (best && parted <= best_parted) continue;
          best = square;
          best_parted = parted;
        }
      }
    }
    return best;
  }

  std::uint32_t layers_, levels_;
  std::vector<State> states_;  // of each layer: level by level, row by row
};

/// What an owner of maps asks for.
struct AtlasWish {
  std::uint64_t owner = 0;  // unique
  std::uint32_t level = 0;  // as large as this, ...
  std::uint32_t least = 0;  // ... or as small as this where there is no room
  std::uint32_t count = 0;
  bool operator==(const AtlasWish&) const = default;
};

class AtlasPlaces {
 public:
  /// For each wish, in their order of importance: its squares, or none.
  const std::vector<std::vector<Square>>& grant(std::span<const AtlasWish> wishes, std::uint32_t layers,
                                                std::uint32_t levels) {
    const bool is_same = layers == layers_ && levels == levels_ && std::ranges::equal(wishes, wishes_);
    if (is_same) return granted_;
    std::vector<std::vector<Square>> granted = stay(wishes, layers, levels);
    if (granted.empty()) granted = start_over(wishes, layers, levels);
    granted_ = std::move(granted);
    wishes_.assign(wishes.begin(), wishes.end());
    layers_ = layers;
    levels_ = levels;
    return granted_;
  }

 private:
  /// Everybody who has what he asks for stays. Empty if the others do not all find room then.
  std::vector<std::vector<Square>> stay(std::span<const AtlasWish> wishes, std::uint32_t layers, std::uint32_t levels) {
    std::vector<std::vector<Square>> granted(wishes.size());
    if (layers != layers_ || levels != levels_) return {};
    AtlasRoom room(layers, levels);
    for (std::size_t i = 0; i < wishes.size(); ++i) {
      const auto before = std::ranges::find(wishes_, wishes[i]);
      if (before == wishes_.end()) continue;
      const std::vector<Square>& had = granted_[static_cast<std::size_t>(before - wishes_.begin())];
      if (had.empty() || had.front().level != wishes[i].level) continue;
      granted[i] = had;
      for (const Square& square : had) room.reserve(square);
    }
    for (std::size_t i = 0; i < wishes.size(); ++i) {
      if (!granted[i].empty() || wishes[i].count == 0) continue;
      granted[i] = room.take(wishes[i].level, wishes[i].count);
      if (granted[i].empty()) return {};
    }
    return granted;
  }

  /// The most important first, each as large as there is room.
  static std::vector<std::vector<Square>> start_over(std::span<const AtlasWish> wishes, std::uint32_t layers,
                                                     std::uint32_t levels) {
    std::vector<std::vector<Square>> granted(wishes.size());
    AtlasRoom room(layers, levels);
    for (std::size_t i = 0; i < wishes.size(); ++i)
      for (std::uint32_t level = wishes[i].level; level <= wishes[i].least && granted[i].empty(); ++level)
        granted[i] = room.take(level, wishes[i].count);
    return granted;
  }

  std::vector<AtlasWish> wishes_;
  std::vector<std::vector<Square>> granted_;  // parallel to wishes_
  std::uint32_t layers_ = 0, levels_ = 0;
};

}  // namespace depth_maps
