// SPDX-License-Identifier: Apache-2.0
// Artifacts on disk: what long work has made, by a key of everything that it depends on. A file is whole or not there,
// for any number of processes; what a damaged one held is told, and it counts as none.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace heddle::graph {

/// Bytes by the names of the ports that they are for.
using ArtifactParts = std::map<std::string, std::vector<std::byte>, std::less<>>;
using ArtifactViews = std::map<std::string, std::span<const std::byte>, std::less<>>;

class ArtifactCache {
 public:
  /// `folder` is made when something is written; empty: nothing is kept. `most_bytes`: of all artifacts together.
  ArtifactCache(std::filesystem::path folder, std::uint64_t most_bytes)
      : folder_(std::move(folder)), most_bytes_(most_bytes) {}

  /// What was kept under a key. Nothing if there is none; `damage` then says what is wrong with the file, if there is
  /// one. Counts as a use: what was not used for longest goes first.
  std::optional<ArtifactParts> read(const std::string& key, std::string& damage) const;
  /// Written under a temporary name and renamed; afterwards what is used least goes until no more than most_bytes are
  /// left, this one never. Says in words what went wrong, or nothing. `makes_room` false: nothing goes yet, as looking
  /// for what does takes as long as there are artifacts; a later one makes up for it.
  std::string write(const std::string& key, const ArtifactViews& parts, bool makes_room = true) const;
  /// What is no longer of use; nothing happens where there is none.
  void remove(const std::string& key) const;
  [[nodiscard]] std::filesystem::path file(const std::string& key) const;
  /// What is too large for a part lies beside the artifact, in a file of its own, and goes with it; and where it lies
  /// before it is whole. Makes the folder.
  [[nodiscard]] std::filesystem::path store(const std::string& key, std::string_view part) const;
  [[nodiscard]] std::filesystem::path new_store(const std::string& key, std::string_view part) const;
  [[nodiscard]] bool keeps_anything() const { return !folder_.empty(); }

 private:
  void make_room(const std::filesystem::path& keep) const;

  std::filesystem::path folder_;
  std::uint64_t most_bytes_;
};

}  // namespace heddle::graph
