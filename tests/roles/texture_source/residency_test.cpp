// SPDX-License-Identifier: Apache-2.0
// Which tiles are where, over long random walks: nothing here needs a device or a texel.
#include "texture_source/virtual/residency.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <random>
#include <set>

namespace {

using heddle::virtual_texture::Changes;
using heddle::virtual_texture::Residency;
using heddle::virtual_texture::Tile;

/// The table that the edits make, kept the slow way: what each tile of each level shows.
class Table {
 public:
  explicit Table(std::uint32_t root) : root_(root), cells_(root + 1) {
    for (std::uint32_t level = 0; level <= root; ++level) cells_[level].resize(std::size_t{1} << (2 * (root - level)));
  }
  struct Cell {
    Tile tile;
    std::uint32_t slot = ~0U;
  };
  void apply(const Changes& changes) {
    for (const Changes::Edit& edit : changes.edits) {
      for (std::uint32_t down = 0; down <= edit.tile.level; ++down) {
        const std::uint32_t side = 1U << down, level = edit.tile.level - down;
        for (std::uint32_t y = 0; y < side; ++y)
          for (std::uint32_t x = 0; x < side; ++x)
            at(level, (edit.tile.x << down) + x, (edit.tile.y << down) + y) = {edit.shown, edit.slot};
      }
    }
  }
  Cell& at(std::uint32_t level, std::uint32_t x, std::uint32_t y) {
    return cells_[level][(std::size_t{y} << (root_ - level)) + x];
  }
  std::uint32_t root_;
  std::vector<std::vector<Cell>> cells_;
};

/// A square of 3 x 3 tiles of one level, and one coarser around it.
std::vector<Tile> view_at(std::uint32_t root, std::uint32_t level, std::uint32_t x, std::uint32_t y) {
  std::vector<Tile> asked;
  for (std::uint32_t j = 0; j < 3; ++j) {
    for (std::uint32_t i = 0; i < 3; ++i) {
      const std::uint32_t side = 1U << (root - level);
      asked.push_back({0, level, (x + i) % side, (y + j) % side});
      if (level < root) asked.push_back(asked.back().parent());
    }
  }
  return asked;
}

/// Five contents, which three of four fine tiles have.
std::optional<std::uint64_t> content_of(const Tile& tile) {
  if (tile.level > 3 || ((tile.x ^ tile.y) & 3U) == 0) return std::nullopt;
  return (3 * tile.x + tile.y) % 5;
}

void fly_at_random(const Residency::Content& content, std::size_t& out_shared) {
  constexpr std::uint32_t kRoot = 5, kSlots = 40;
  Residency residency(kSlots, {kRoot}, content);
  Table table(kRoot);
  std::vector<Tile> in_slot(kSlots);
  std::mt19937 random(7);
  const auto number = [&](std::uint32_t below) { return static_cast<std::uint32_t>(random() % below); };
  std::uint32_t x = 0, y = 0, level = 0;
  for (std::uint64_t frame = 0; frame < 10000; ++frame) {
    if (frame % 50 == 0) {  // a teleport, else steps
      level = number(4);
      x = number(32);
      y = number(32);
    } else if (random() % 3 == 0) {
      x += static_cast<std::uint32_t>(random() & 1U);
      y += static_cast<std::uint32_t>(random() & 1U);
    }
    const std::vector<Tile> asked = view_at(kRoot, level, x, y);
    const Changes changes = residency.step(asked, frame, 4, 3);
    std::set<std::uint64_t> uploaded;
    for (const Changes::Upload& one : changes.uploads) {
      if (one.is_there) {
        ASSERT_EQ(content(in_slot[one.slot]), content(one.tile)) << "frame " << frame;
        ++out_shared;
      } else {
        in_slot[one.slot] = one.tile;
      }
      uploaded.insert(one.tile.key());
    }
    table.apply(changes);
    for (const Changes::Edit& edit : changes.edits)
      if (edit.tile != edit.shown) {
        EXPECT_FALSE(uploaded.contains(edit.tile.key())) << "evicted and wanted at once";
      }
    EXPECT_LE(changes.uploads.size(), 3U + 1U);
    ASSERT_TRUE(residency.is_consistent()) << "frame " << frame;
    if (frame % 8 != 0 && changes.evictions == 0) continue;
    for (std::uint32_t l = 0; l <= kRoot; ++l) {
      for (std::uint32_t ty = 0; ty < 1U << (kRoot - l); ++ty) {
        for (std::uint32_t tx = 0; tx < 1U << (kRoot - l); ++tx) {
          Tile shown{0, l, tx, ty};
          while (!residency.slot_of(shown)) shown = shown.parent();
          const Table::Cell& cell = table.at(l, tx, ty);
          ASSERT_EQ(cell.tile, shown) << "frame " << frame;
          const bool is_like_it = content && content(shown) && content(in_slot[cell.slot]) == content(shown);
          ASSERT_TRUE(is_like_it || in_slot[cell.slot] == shown) << "the slot holds another tile, frame " << frame;
        }
      }
    }
  }
}

TEST(Residency, HoldsItsInvariantsAndItsTableOverARandomFlight) {
  std::size_t shared = 0;
  fly_at_random({}, shared);
  EXPECT_EQ(shared, 0U);
}

TEST(Residency, HoldsThemWhereTilesOfOneContentShareASlot) {
  std::size_t shared = 0;
  fly_at_random(content_of, shared);
  EXPECT_GT(shared, 1000U);
  // Nine tiles of five contents at most, their parents and the root: room for all, where each by itself has none.
  Residency alone(12, {6}), together(12, {6}, [](const Tile&tile) -> std::optional<std::uint64_t> {
    if (tile.level > 2) return std::nullopt;
    return 10 * tile.level + (tile.x + tile.y) % 2;
  });
  Changes of_alone, of_together;
  for (std::uint64_t frame = 0; frame < 40; ++frame) {
    of_alone = alone.step(view_at(6, 0, 10, 20), frame, 8, 4);
    of_together = together.step(view_at(6, 0, 10, 20), frame, 8, 4);
    ASSERT_TRUE(together.is_consistent());
  }
  EXPECT_GT(of_alone.bias, 0U);
  EXPECT_EQ(of_together.bias, 0U);
  EXPECT_EQ(of_together.missing, 0U);
  EXPECT_GT(together.resident_count(), 12U);
  EXPECT_LE(together.slots_in_use(), 12U);
}

TEST(Residency, GoesQuietWhenNothingMoves) {
  Residency residency(64, {6});
  std::uint64_t frame = 0;
  for (; frame < 20; ++frame) residency.step(view_at(6, 0, 10, 20), frame, 8, 4);
  for (; frame < 40; ++frame) {
    const Changes changes = residency.step(view_at(6, 0, 10, 20), frame, 8, 4);
    EXPECT_TRUE(changes.uploads.empty());
    EXPECT_TRUE(changes.edits.empty());
    EXPECT_EQ(changes.missing, 0U);
  }
}

TEST(Residency, ArrivesWithinTheFramesThatItsBudgetNeeds) {
  Residency residency(64, {6});
  const Changes first = residency.step(view_at(6, 0, 10, 20), 0, 8, 4);
  std::uint32_t frames = 1;
  for (std::uint32_t missing = first.missing; missing > 0; ++frames)
    missing = residency.step(view_at(6, 0, 10, 20), frames, 8, 4).missing;
  EXPECT_LE(frames, (first.wanted + 3) / 4);
}

TEST(Residency, CoarsensAllWishesWhereTheyHaveNoRoom) {
  Residency residency(12, {6});
  std::vector<Tile> asked;
  for (std::uint32_t i = 0; i < 64; ++i) asked.push_back({0, 0, i, 20});
  Changes changes;
  for (std::uint64_t frame = 0; frame < 60; ++frame) {
    changes = residency.step(asked, frame, 8, 4);
    ASSERT_TRUE(residency.is_consistent());
    EXPECT_LE(changes.wanted, 12U);
    if (frame > 20) {
      EXPECT_TRUE(changes.uploads.empty()) << "no thrashing";
    }
  }
  EXPECT_GT(changes.bias, 0U);
  EXPECT_EQ(changes.missing, 0U);
}

TEST(Residency, DoesNotDependOnTheOrderOfWishes) {
  Residency a(24, {6}), b(24, {6});
  std::mt19937 random(3);
  const auto number = [&](std::uint32_t below) { return static_cast<std::uint32_t>(random() % below); };
  for (std::uint64_t frame = 0; frame < 200; ++frame) {
    std::vector<Tile> asked = view_at(6, number(3), number(64), number(64));
    const Changes first = a.step(asked, frame, 4, 2);
    std::shuffle(asked.begin(), asked.end(), random);
    const Changes second = b.step(asked, frame, 4, 2);
    ASSERT_EQ(first.uploads.size(), second.uploads.size());
    for (std::size_t i = 0; i < first.uploads.size(); ++i) {
      EXPECT_EQ(first.uploads[i].tile, second.uploads[i].tile);
      EXPECT_EQ(first.uploads[i].slot, second.uploads[i].slot);
    }
  }
}

TEST(Residency, IgnoresWishesForTilesThatAreNoTiles) {
  Residency residency(8, {2});
  residency.step({{0, 0, 4, 0}, {0, 3, 0, 0}, {1, 0, 0, 0}, {0, 1, 0, 2}}, 0, 4, 4);
  EXPECT_EQ(residency.resident_count(), 1U);
}

}  // namespace
