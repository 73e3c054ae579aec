// SPDX-License-Identifier: Apache-2.0
// A file holds the magic line, its key, the hash of the rest, and the rest: a count, then name, size and bytes of each
// part. Numbers are as this machine has them: the cache is its own.
#include "graph/artifact_cache.hpp"

#include "content_hash.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <fstream>

namespace heddle::graph {

namespace {

namespace fs = std::filesystem;
constexpr std::string_view kMagic = "heddle-artifact 1\n";
constexpr std::string_view kExtension = ".artifact", kTemporary = ".new";
/// Temporary files of processes that were killed; a living one writes for seconds.
constexpr auto kAbandoned = std::chrono::hours(1);

void append(std::vector<std::byte>& out, const void* data, std::size_t size) {
  const auto* bytes = static_cast<const std::byte*>(data);
  out.insert(out.end(), bytes, bytes + size);
}

void append(std::vector<std::byte>& out, std::uint64_t number) {
  append(out, &number, sizeof number);
}

class Reader {
 public:
  explicit Reader(std::span<const std::byte> bytes) : bytes_(bytes) {}
  std::uint64_t number() {
    std::uint64_t value = 0;
    const auto taken = take(sizeof value);
    if (!taken.empty()) std::memcpy(&value, taken.data(), sizeof value);
    return value;
  }
  std::span<const std::byte> take(std::uint64_t size) {
    is_good_ = is_good_ && size <= bytes_.size();
    if (!is_good_) return {};
    const auto taken = bytes_.first(size);
    bytes_ = bytes_.subspan(size);
    return taken;
  }
  [[nodiscard]] bool is_good() const { return is_good_; }
  [[nodiscard]] bool is_at_end() const { return is_good_ && bytes_.empty(); }

 private:
  std::span<const std::byte> bytes_;
  bool is_good_ = true;
};

std::string_view text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::string hash_of(std::span<const std::byte> bytes) {
  ContentHash hash;
  hash.add_long(bytes);
  return hash.hexadecimal();
}

/// Nothing if there is no such file, or something else in its place: a folder opens as a file does, and claims to be
/// as long as can be; a pipe lets its reader wait.
std::optional<std::vector<std::byte>> contents(const fs::path& file) {
  std::error_code unknown;
  if (!fs::is_regular_file(file, unknown)) return std::nullopt;
  std::ifstream stream(file, std::ios::binary | std::ios::ate);
  if (!stream) return std::nullopt;
  std::vector<std::byte> bytes(static_cast<std::size_t>(std::max<std::streamoff>(stream.tellg(), 0)));
  stream.seekg(0);
  stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(stream.gcount()));
  return bytes;
}

}  // namespace

fs::path ArtifactCache::file(const std::string& key) const {
  return folder_ / (key + std::string(kExtension));
}

std::optional<ArtifactParts> ArtifactCache::read(const std::string& key, std::string& damage) const {
  damage.clear();
  if (folder_.empty()) return std::nullopt;
  const std::optional<std::vector<std::byte>> bytes = contents(file(key));
  if (!bytes) {
    std::error_code unknown;
    const fs::file_status found = fs::status(file(key), unknown);
    if (fs::exists(found) && !fs::is_regular_file(found)) damage = "it is no file";
    return std::nullopt;
  }
  Reader in(*bytes);
  if (text_of(in.take(kMagic.size())) != kMagic) {
    damage = "it does not begin as an artifact does";
    return std::nullopt;
  }
  if (text_of(in.take(key.size())) != key) {
    damage = "it holds another key than its name says";
    return std::nullopt;
  }
  const std::string_view hash = text_of(in.take(key.size()));
  const std::size_t head = kMagic.size() + 2 * key.size();
  if (!in.is_good() || hash != hash_of(std::span(*bytes).subspan(head))) {
    damage = "its bytes are not those that were written";
    return std::nullopt;
  }
  ArtifactParts parts;
  const std::uint64_t count = in.number();
  for (std::uint64_t i = 0; i < count && in.is_good(); ++i) {
    const std::string name(text_of(in.take(in.number())));
    const auto part = in.take(in.number());
    parts[name].assign(part.begin(), part.end());
  }
  if (!in.is_at_end()) {
    damage = "its parts do not add up to it";
    return std::nullopt;
  }
  std::error_code ignored;
  fs::last_write_time(file(key), fs::file_time_type::clock::now(), ignored);
  return parts;
}

std::string ArtifactCache::write(const std::string& key, const ArtifactViews& parts, bool makes_room) const {
  if (folder_.empty()) return {};
  std::vector<std::byte> payload;
  append(payload, parts.size());
  for (const auto& [name, bytes] : parts) {
    append(payload, name.size());
    append(payload, name.data(), name.size());
    append(payload, bytes.size());
    append(payload, bytes.data(), bytes.size());
  }
  std::error_code error;
  fs::create_directories(folder_, error);
  if (error) return fmt::format("the artifact cache {} cannot be made: {}", folder_.string(), error.message());
  static std::atomic<std::uint32_t> count = 0;
  const fs::path temporary = folder_ / fmt::format("{}.{}.{}{}", key, ::getpid(), count++, kTemporary);
  {
    std::ofstream stream(temporary, std::ios::binary);
    stream << kMagic << key << hash_of(payload);
    stream.write(reinterpret_cast<const char*>(payload.data()), static_cast<std::streamsize>(payload.size()));
    stream.close();
    if (!stream) {
      fs::remove(temporary, error);
      return fmt::format("the artifact cache {} cannot be written", folder_.string());
    }
  }
  // A folder in an artifact's place holds nothing of ours, and no file can take its place.
  if (fs::is_directory(fs::symlink_status(file(key), error))) fs::remove_all(file(key), error);
  fs::rename(temporary, file(key), error);
  if (error) {
    const std::string why = error.message();
    fs::remove(temporary, error);
    return fmt::format("the artifact cache {} cannot be written: {}", folder_.string(), why);
  }
  if (makes_room) make_room(file(key));
  return {};
}

void ArtifactCache::remove(const std::string& key) const {
  std::error_code ignored;
  if (!folder_.empty()) fs::remove_all(file(key), ignored);
}

void ArtifactCache::make_room(const fs::path& keep) const {
  struct Kept {
    fs::file_time_type used;
    std::uintmax_t bytes = 0;
    fs::path file;
  };
  // Other processes add and remove files meanwhile: what is gone is no error.
  std::error_code ignored;
  std::vector<Kept> all;
  std::uintmax_t total = 0;
  for (fs::directory_iterator entry(folder_, ignored), end; !ignored && entry != end; entry.increment(ignored)) {
    std::error_code gone;
    const Kept kept{entry->last_write_time(gone), entry->file_size(gone), entry->path()};
    if (gone) continue;
    if (kept.file.extension() == kTemporary) {
      if (fs::file_time_type::clock::now() - kept.used > kAbandoned) fs::remove(kept.file, gone);
    } else if (kept.file.extension() == kExtension) {
      total += kept.bytes;
      if (kept.file != keep) all.push_back(kept);
    }
  }
  std::ranges::sort(all, {}, [](const Kept& kept) { return std::pair(kept.used, kept.file); });
  for (const Kept& kept : all) {
    if (total <= most_bytes_) return;
    fs::remove(kept.file, ignored);
    total -= kept.bytes;
  }
}

}  // namespace heddle::graph
