// SPDX-License-Identifier: Apache-2.0
// Tiles that are asked for -> their bytes, some frames later, from a store on a disk. Nothing waits, but for a frame
// that is to repeat to the bit: there a tile comes exactly `frames` after it was asked for.
#pragma once

#include <map>
#include <span>
#include <utility>

#include "residency.hpp"
#include "stored_textures.hpp"

namespace heddle::virtual_texture {

class TileReader {
 public:
  TileReader(const texture_store::StoredTextures& stored, std::size_t most) : stored_(stored), most_(most) {}

  /// `texture`: its number in the store. True when its bytes are there, for as long as the tile is asked for in every
  /// frame. False also where it cannot be read: then `status` says so.
  bool has(const pass::PassHost& host, const Tile& tile, std::uint32_t texture, std::uint64_t frame,
           std::uint32_t frames) {
    // Tiles of one content are one read.
    const auto [found, is_new] = reads_.try_emplace(key_of(tile, texture));
    Read& read = found->second;
    if (is_new) {
      if (reads_.size() > most_ || status_ != HEDDLE_OK) {
        reads_.erase(found);
        return false;
      }
      const std::uint64_t offset = stored_.store().offset_of(texture, tile.level, tile.x, tile.y);
      status_ =
          stored_.service().request(host.raw(), stored_.file(), offset, stored_.store().tile_bytes(), &read.ticket);
      read.asked = frame;
      ++requests_;
    }
    read.wanted = frame;
    if (read.bytes == nullptr && status_ == HEDDLE_OK) {
      const void* bytes = nullptr;
      status_ = stored_.service().collect(host.raw(), stored_.file(), read.ticket, frame >= read.asked + frames ? 1 : 0,
                                          &bytes);
      if (status_ == HEDDLE_OK && bytes != nullptr) {
        read.bytes = static_cast<const std::byte*>(bytes);
        status_ = stored_.check(host, texture, tile.level, tile.x, tile.y, {read.bytes, stored_.store().tile_bytes()});
      }
    }
    return read.bytes != nullptr && status_ == HEDDLE_OK;
  }

  [[nodiscard]] std::span<const std::byte> bytes(const Tile& tile, std::uint32_t texture) const {
    return {reads_.at(key_of(tile, texture)).bytes, stored_.store().texel_bytes()};
  }
  /// Its bytes are where they should be.
  void release(const pass::PassHost& host, const Tile& tile, std::uint32_t texture) {
    const auto found = reads_.find(key_of(tile, texture));
    if (found == reads_.end()) return;
    stored_.service().release(host.raw(), stored_.file(), found->second.ticket);
    reads_.erase(found);
  }
  /// What nobody has asked for in this frame any more.
  void forget(const pass::PassHost& host, std::uint64_t frame) {
    std::erase_if(reads_, [&](const auto& one) {
      if (one.second.wanted == frame) return false;
      stored_.service().release(host.raw(), stored_.file(), one.second.ticket);
      return true;
    });
  }
  void forget_all(const pass::PassHost& host) {
    for (const auto& [key, read] : reads_) stored_.service().release(host.raw(), stored_.file(), read.ticket);
    reads_.clear();
    status_ = HEDDLE_OK;
  }
  [[nodiscard]] heddle_status status() const { return status_; }
  [[nodiscard]] std::size_t in_flight() const { return reads_.size(); }
  /// How many tiles were asked for since the last call.
  std::uint64_t take_requests() { return std::exchange(requests_, 0); }

 private:
  [[nodiscard]] std::uint64_t key_of(const Tile& tile, std::uint32_t texture) const {
    return stored_.store().kept_of(texture, tile.level, tile.x, tile.y);
  }
  struct Read {
    std::uint64_t ticket = 0, asked = 0, wanted = 0;  // frames
    const std::byte* bytes = nullptr;
  };
  const texture_store::StoredTextures& stored_;
  std::size_t most_;
  std::map<std::uint64_t, Read> reads_;
  heddle_status status_ = HEDDLE_OK;
  std::uint64_t requests_ = 0;
};

}  // namespace heddle::virtual_texture
