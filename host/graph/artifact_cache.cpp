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
#include <utility>

namespace heddle::graph {

namespace {

namespace fs = std::filesystem;
constexpr std::string_view kMagic = "heddle-artifact 1\n";
constexpr std::string_view kExtension = ".artifact", kTemporary = ".new", kStore = ".store";
/// Temporary files of processes that were killed; a living one does not pause for so long.
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

/// The name up to its first point.
std::string key_of(const fs::path& file) {
  const std::string name = file.filename().string();
  return name.substr(0, name.find('.'));
}

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

fs::path ArtifactCache::store(const std::string& key, std::string_view part) const {
  return folder_ / fmt::format("{}.{}{}", key, part, kStore);
}

fs::path ArtifactCache::new_store(const std::string& key, std::string_view part) const {
  std::error_code ignored;  // whoever opens the file says why it cannot be
  fs::create_directories(folder_, ignored);
  static std::atomic<std::uint32_t> count = 0;
  return folder_ / fmt::format("{}.{}.{}.{}{}", key, part, ::getpid(), count++, kTemporary);
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
  if (folder_.empty()) return;
  std::error_code ignored;
  fs::remove_all(file(key), ignored);
  for (fs::directory_iterator entry(folder_, ignored), end; !ignored && entry != end; entry.increment(ignored))
    if (std::error_code gone; entry->path().extension() == kStore && key_of(entry->path()) == key)
      fs::remove(entry->path(), gone);
}

void ArtifactCache::make_room(const fs::path& keep) const {
  struct Kept {
    fs::file_time_type used = fs::file_time_type::min();
    std::uintmax_t bytes = 0;
    std::vector<fs::path> files;  // the artifact last: a store without one is nobody's, the other way round is damage
  };
  // Other processes add and remove files meanwhile: what is gone is no error.
  std::error_code ignored;
  std::map<std::string, Kept> all;  // by key
  std::uintmax_t total = 0;
  for (fs::directory_iterator entry(folder_, ignored), end; !ignored && entry != end; entry.increment(ignored)) {
    std::error_code gone;
    const fs::path& path = entry->path();
    const fs::file_time_type used = entry->last_write_time(gone);
    const std::uintmax_t bytes = entry->file_size(gone);
    if (gone) continue;
    if (path.extension() == kTemporary) {
      if (fs::file_time_type::clock::now() - used > kAbandoned) fs::remove(path, gone);
    } else if (path.extension() == kExtension || path.extension() == kStore) {
      Kept& kept = all[key_of(path)];
      kept.used = std::max(kept.used, used);
      kept.bytes += bytes;
      kept.files.insert(path.extension() == kStore ? kept.files.begin() : kept.files.end(), path);
      total += bytes;
    }
  }
  all.erase(key_of(keep));
  std::vector<std::pair<std::string, Kept>> oldest(all.begin(), all.end());
  std::ranges::sort(oldest, {}, [](const auto& one) { return std::pair(one.second.used, one.first); });
  for (const auto& [key, kept] : oldest) {
    if (total <= most_bytes_) return;
    for (const fs::path& file : kept.files) fs::remove(file, ignored);
    total -= kept.bytes;
  }
}

}  // namespace heddle::graph
