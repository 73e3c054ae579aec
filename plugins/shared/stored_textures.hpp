// SPDX-License-Identifier: Apache-2.0
// The input `store` of techniques of texture_source -> what it holds, and its tiles, each checked.
#pragma once

#include <heddle/stores.h>
#include <heddle/pass.hpp>

#include <string>
#include <vector>

#include "texture_store.hpp"

namespace heddle::texture_store {

class StoredTextures {
 public:
  /// In declare. Nothing is open if the port is unbound. What is open already stays if it is the same.
  heddle_status open(const pass::PassHost& host) {
    std::uint64_t size = 0;
    const void* bytes = host.raw()->value(host.raw(), nullptr, "store", &size);
    const std::vector<std::byte> artifact(static_cast<const std::byte*>(bytes),
                                          static_cast<const std::byte*>(bytes) + (bytes == nullptr ? 0 : size));
    if (artifact == artifact_ && (file_ != nullptr) == !artifact.empty()) return HEDDLE_OK;
    artifact_ = artifact;
    store_ = {};
    service_ = host.service<heddle_stores_service>(HEDDLE_STORES_SERVICE);
    if (file_ != nullptr && service_ != nullptr) service_->close(host.raw(), file_);
    file_ = nullptr;
    if (artifact.empty()) return HEDDLE_OK;
    if (service_ == nullptr) return host.fail(HEDDLE_UNSUPPORTED, "this host has no service " HEDDLE_STORES_SERVICE);
    const std::optional<Store> found = store_of(artifact);
    if (!found)
      return host.fail(HEDDLE_BAD_INPUT,
                       "what input 'store' is bound to is no store of textures; expected: the artifact 'store' of a "
                       "technique of role texture_store");
    if (const heddle_status status = service_->open(host.raw(), "store", &file_); status != HEDDLE_OK) return status;
    if (file_ == nullptr)
      return host.fail(HEDDLE_BAD_INPUT,
                       "what input 'store' is bound to has no store beside it; expected: the artifact 'store' of a "
                       "technique of role texture_store");
    store_ = *found;
    return HEDDLE_OK;
  }

  [[nodiscard]] bool is_open() const { return file_ != nullptr; }
  [[nodiscard]] const Store& store() const { return store_; }
  [[nodiscard]] const heddle_stores_service& service() const { return *service_; }
  [[nodiscard]] heddle_store* file() const { return file_; }
  [[nodiscard]] const std::vector<std::byte>& artifact() const { return artifact_; }

  /// Bytes of a tile that have come: are they what was written?
  heddle_status check(const pass::PassHost& host, std::uint32_t texture, std::uint32_t level, std::uint32_t x,
                      std::uint32_t y, std::span<const std::byte> bytes) const {
    const std::string damage = damage_of(store_, store_.mark_of(texture, level, x, y), bytes);
    if (damage.empty()) return HEDDLE_OK;
    return host.fail(HEDDLE_BAD_INPUT, std::string("the store ") + service_->file(host.raw(), file_) +
                                           " was changed since it was made: tile " + std::to_string(x) + ", " +
                                           std::to_string(y) + " of level " + std::to_string(level) + " of texture " +
                                           std::to_string(texture) + ", " + std::to_string(store_.tile_bytes()) +
                                           " bytes at " + std::to_string(store_.offset_of(texture, level, x, y)) +
                                           ": " + damage + "; remove the file: the job makes it again");
  }

  /// Waits for it; texels as they are stored, with the border.
  heddle_status read(const pass::PassHost& host, std::uint32_t texture, std::uint32_t level, std::uint32_t x,
                     std::uint32_t y, std::vector<std::byte>& out) const {
    out.resize(store_.tile_bytes());
    heddle_status status =
        service_->read(host.raw(), file_, store_.offset_of(texture, level, x, y), out.data(), out.size());
    if (status == HEDDLE_OK) status = check(host, texture, level, x, y, out);
    out.resize(store_.texel_bytes());
    return status;
  }

 private:
  const heddle_stores_service* service_ = nullptr;
  heddle_store* file_ = nullptr;
  std::vector<std::byte> artifact_;
  Store store_;
};

}  // namespace heddle::texture_store
