// SPDX-License-Identifier: Apache-2.0
// Tiles that pixels asked for -> which tiles are in the cache, in which slot, and what has to change this frame. No
// GPU, no texels. Invariants: each texture's root is resident and stays; a resident tile's parent is resident; what is
// wanted is never evicted. Source  Mittring 2008, "Advanced Virtual Texture Topics": quad-tree, least recently used,
// coarse first
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <unordered_map>
#include <unordered_set>
#include <vector>

namespace heddle::virtual_texture {

struct Tile {
  std::uint32_t texture = 0;
  std::uint32_t level = 0;  // 0: the finest
  std::uint32_t x = 0, y = 0;

  [[nodiscard]] Tile parent() const { return {texture, level + 1, x >> 1U, y >> 1U}; }
  [[nodiscard]] std::uint64_t key() const {
    return std::uint64_t{level} << 60U | std::uint64_t{texture} << 44U | std::uint64_t{y} << 22U | x;
  }
  friend bool operator==(const Tile&, const Tile&) = default;
};

/// What one frame changes, in this order: slots are filled, then the table is edited.
struct Changes {
  struct Upload {
    Tile tile;
    std::uint32_t slot = 0;
    bool is_there = false;  // with a tile of the same content, which came before
  };
  struct Edit {
    Tile tile;   // all cells below it ...
    Tile shown;  // ... show this one from now on: itself, or after an eviction its nearest resident ancestor
    std::uint32_t slot = 0;
  };
  std::vector<Upload> uploads;
  std::vector<Edit> edits;      // coarse ones first
  std::uint32_t evictions = 0;  // at most the budget, and one for each root
  std::uint32_t missing = 0;    // tiles that are wanted and not there, after this frame
  std::uint32_t wanted = 0;     // tiles, ancestors included
  std::uint32_t bias = 0;       // levels by which wishes were coarsened so that all have room
};

class Residency {
 public:
  /// What tiles of equal content have in common; nothing for a tile that may be like no other.
  using Content = std::function<std::optional<std::uint64_t>(const Tile&)>;

  /// roots: the coarsest level of each texture. There must be a slot for each root. Tiles of one content share a slot.
  Residency(std::uint32_t slot_count, std::vector<std::uint32_t> roots, Content content = {})
      : roots_(std::move(roots)), content_(std::move(content)) {
    for (std::uint32_t slot = slot_count; slot > 0; --slot) free_.push_back(slot - 1);
    slot_count_ = slot_count;
  }

  /// asked: what pixels of some frame asked for, in any order, repeated or not. window: frames that a wish lasts.
  /// budget: uploads, at least one; roots come besides. is_ready: whether a tile's texels can be had in this frame; it
  /// is asked for each that is missing, coarse ones first. Roots always are.
  template <typename IsReady>
  Changes step(const std::vector<Tile>& asked, std::uint64_t frame, std::uint32_t window, std::uint32_t budget,
               const IsReady& is_ready) {
    Changes changes;
    for (Tile tile : asked) {
      if (tile.texture >= roots_.size() || tile.level > roots_[tile.texture]) continue;
      const std::uint32_t side = roots_[tile.texture] - tile.level;
      if ((tile.x >> side) != 0 || (tile.y >> side) != 0) continue;
      wishes_[tile.key()] = {tile, frame};
    }
    std::erase_if(wishes_, [&](const auto& entry) { return entry.second.frame + window <= frame; });
    std::unordered_map<std::uint64_t, Tile> wanted;
    changes.bias = want(wanted);
    changes.wanted = static_cast<std::uint32_t>(wanted.size());

    std::vector<Tile> missing;
    for (const auto& [key, tile] : wanted) {
      const auto found = resident_.find(key);
      if (found == resident_.end())
        missing.push_back(tile);
      else
        found->second.wanted = frame;
    }
    std::ranges::sort(missing, is_before);
    std::vector<Tile> changed;
    bool has_room = true;
    for (const Tile& tile : missing) {
      const bool is_root = tile.level == roots_[tile.texture];
      // Asked for in any case: what takes long is then on its way. What is there already is not asked for.
      if (!is_root && !shared_slot(tile) && !is_ready(tile)) continue;
      // What another tile has brought already needs none.
      const std::optional<std::uint32_t> same = shared_slot(tile);
      if (!has_room && !same) continue;
      if (!is_root && (changes.uploads.size() >= budget || !resident_.contains(tile.parent().key()))) continue;
      const std::optional<std::uint32_t> slot = same ? same : room(frame, budget, changes, changed);
      if (!slot) {
        has_room = false;
        continue;
      }
      arrive(tile, *slot, frame);
      changes.uploads.push_back({tile, *slot, same.has_value()});
      changed.push_back(tile);
    }
    changes.missing = static_cast<std::uint32_t>(missing.size() - changes.uploads.size());
    std::ranges::sort(changed, is_before);
    for (const Tile& tile : changed) {
      Tile shown = tile;
      while (!resident_.contains(shown.key())) shown = shown.parent();
      changes.edits.push_back({tile, shown, resident_.at(shown.key()).slot});
    }
    return changes;
  }

  Changes step(const std::vector<Tile>& asked, std::uint64_t frame, std::uint32_t window, std::uint32_t budget) {
    return step(asked, frame, window, budget, [](const Tile&) { return true; });
  }

  [[nodiscard]] std::optional<std::uint32_t> slot_of(const Tile& tile) const {
    const auto found = resident_.find(tile.key());
    return found == resident_.end() ? std::nullopt : std::optional(found->second.slot);
  }
  [[nodiscard]] std::size_t resident_count() const { return resident_.size(); }
  [[nodiscard]] std::size_t slots_in_use() const { return slot_count_ - free_.size(); }
  /// Roots are there, parents are there, children are counted right, and no slot is used twice but by equal tiles.
  [[nodiscard]] bool is_consistent() const {
    std::vector<std::uint32_t> used(slot_count_, 0);
    std::vector<std::optional<std::uint64_t>> contents(slot_count_);
    std::unordered_map<std::uint64_t, std::uint32_t> children;
    for (const auto& [key, entry] : resident_) {
      if (entry.slot >= slot_count_) return false;
      const auto content = content_of(entry.tile);
      if (used[entry.slot]++ > 0 && (!content || content != contents[entry.slot])) return false;
      contents[entry.slot] = content;
      if (entry.tile.level == roots_[entry.tile.texture]) continue;
      if (!resident_.contains(entry.tile.parent().key())) return false;
      ++children[entry.tile.parent().key()];
    }
    for (const auto& [key, entry] : resident_)
      if (entry.children != (children.contains(key) ? children.at(key) : 0U)) return false;
    for (const auto& [content, shared] : shared_)
      if (used[shared.slot] != shared.count) return false;
    const auto in_use = static_cast<std::size_t>(std::ranges::count_if(used, [](std::uint32_t n) { return n > 0; }));
    return in_use + free_.size() == slot_count_;
  }

 private:
  struct Resident {
    Tile tile;
    std::uint32_t slot = 0, children = 0;
    std::uint64_t wanted = 0;  // frame
  };
  struct Wish {
    Tile tile;
    std::uint64_t frame = 0;
  };

  /// Coarse before fine; else by place, so that the order of the wishes does not matter.
  static bool is_before(const Tile& a, const Tile& b) {
    return a.level != b.level ? a.level > b.level : a.key() < b.key();
  }

  struct Shared {
    std::uint32_t slot = 0, count = 0;
  };

  [[nodiscard]] std::optional<std::uint64_t> content_of(const Tile& tile) const {
    return content_ ? content_(tile) : std::nullopt;
  }
  [[nodiscard]] std::optional<std::uint32_t> shared_slot(const Tile& tile) const {
    const auto content = content_of(tile);
    const auto found = content ? shared_.find(*content) : shared_.end();
    return found == shared_.end() ? std::nullopt : std::optional(found->second.slot);
  }

  /// All wishes with their ancestors, coarsened by as many levels as it takes for all to have room: 0 mostly.
  std::uint32_t want(std::unordered_map<std::uint64_t, Tile>& wanted) const {
    std::unordered_set<std::uint64_t> contents;
    for (std::uint32_t bias = 0;; ++bias) {
      wanted.clear();
      contents.clear();
      std::size_t slots = 0;
      const auto add = [&](Tile tile) {
        while (wanted.try_emplace(tile.key(), tile).second) {
          const auto content = content_of(tile);
          slots += !content || contents.insert(*content).second ? 1 : 0;
          if (tile.level == roots_[tile.texture]) break;
          tile = tile.parent();
        }
      };
      for (std::uint32_t t = 0; t < roots_.size(); ++t) add({t, roots_[t], 0, 0});
      bool is_all_roots = true;
      for (const auto& [key, wish] : wishes_) {
        Tile tile = wish.tile;
        for (std::uint32_t i = 0; i < bias && tile.level < roots_[tile.texture]; ++i) tile = tile.parent();
        is_all_roots = is_all_roots && tile.level == roots_[tile.texture];
        add(tile);
        if (slots > slot_count_ && !is_all_roots) break;
      }
      if (slots <= slot_count_ || is_all_roots) return bias;
    }
  }

  /// A free slot, or that of the leaf that nobody has wanted for longest; finer ones first where that is equal.
  std::optional<std::uint32_t> room(std::uint64_t frame, std::uint32_t budget, Changes& changes,
                                    std::vector<Tile>& changed) {
    // Those that share a slot all have to go before it is free; in a later frame, if they are too many.
    while (free_.empty()) {
      if (changes.evictions >= budget + roots_.size()) return std::nullopt;
      const Resident* oldest = nullptr;
      for (const auto& [key, entry] : resident_) {
        if (entry.children > 0 || entry.wanted == frame || entry.tile.level == roots_[entry.tile.texture]) continue;
        const auto is_older = [&] {
          if (entry.wanted != oldest->wanted) return entry.wanted < oldest->wanted;
          return is_before(oldest->tile, entry.tile);
        };
        if (oldest == nullptr || is_older()) oldest = &entry;
      }
      if (oldest == nullptr) return std::nullopt;
      const Tile gone = oldest->tile;
      leave(gone, oldest->slot);
      --resident_.at(gone.parent().key()).children;
      resident_.erase(gone.key());
      changed.push_back(gone);
      ++changes.evictions;
    }
    const std::uint32_t slot = free_.back();
    free_.pop_back();
    return slot;
  }

  void leave(const Tile& tile, std::uint32_t slot) {
    if (const auto content = content_of(tile)) {
      const auto found = shared_.find(*content);
      if (--found->second.count > 0) return;
      shared_.erase(found);
    }
    free_.push_back(slot);
  }

  void arrive(const Tile& tile, std::uint32_t slot, std::uint64_t frame) {
    if (const auto content = content_of(tile)) {
      Shared& shared = shared_[*content];
      shared.slot = slot;
      ++shared.count;
    }
    resident_[tile.key()] = {tile, slot, 0, frame};
    if (tile.level < roots_[tile.texture]) ++resident_.at(tile.parent().key()).children;
  }

  std::vector<std::uint32_t> roots_;
  std::uint32_t slot_count_ = 0;
  Content content_;
  std::unordered_map<std::uint64_t, Shared> shared_;  // by content
  std::vector<std::uint32_t> free_;
  std::unordered_map<std::uint64_t, Resident> resident_;
  std::unordered_map<std::uint64_t, Wish> wishes_;
};

}  // namespace heddle::virtual_texture
