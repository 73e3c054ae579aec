// SPDX-License-Identifier: Apache-2.0
// A file beside an artifact, for what is too large for memory: written where it is made, read there and later at any
// place, at once or on a thread of its own. Reads go past the system's cache where the file system can do that, in
// whole clusters; callers see none of it.
#pragma once

#include <heddle/stores.h>

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

namespace heddle::graph {

/// In an artifact, behind the name of the port: the size of its store, 8 bytes.
inline constexpr std::string_view kStorePart = ".store";

/// Where a store that is whole lies.
struct StorePlace {
  std::filesystem::path file;
  std::uint64_t bytes = 0;
  bool is_temporary = false;  // goes with its last reader

  StorePlace(std::filesystem::path store_file, std::uint64_t store_bytes, bool goes)
      : file(std::move(store_file)), bytes(store_bytes), is_temporary(goes) {}
  /// From what the artifact says of it; 0 bytes if that is not what it should be.
  StorePlace(std::filesystem::path store_file, std::span<const std::byte> part);
  ~StorePlace();
  StorePlace(const StorePlace&) = delete;
  StorePlace& operator=(const StorePlace&) = delete;
  /// What is wrong with the file, or nothing.
  [[nodiscard]] std::string damage() const;
};

/// All functions throw Error with the file and the reason.
class StoreFile {
 public:
  /// A new one, to write and read; removed with the object unless `keep_as` is called.
  explicit StoreFile(const std::filesystem::path& file);
  /// One that is whole, to read.
  explicit StoreFile(std::shared_ptr<const StorePlace> place);
  ~StoreFile();
  StoreFile(const StoreFile&) = delete;
  StoreFile& operator=(const StoreFile&) = delete;

  void write(std::uint64_t offset, std::span<const std::byte> bytes);
  void read(std::uint64_t offset, std::span<std::byte> out);
  [[nodiscard]] std::uint64_t size() const;
  [[nodiscard]] const char* name() const { return file_.c_str(); }
  /// Done with writing: the file's name from now on.
  void keep_as(const std::filesystem::path& file);

  /// Asks the thread for bytes; a number for `collect`. Requests are served in their order.
  std::uint64_t request(std::uint64_t offset, std::uint64_t bytes);
  /// nullptr: not there yet. waits: for it, which is counted. Valid until `release`.
  const std::byte* collect(std::uint64_t ticket, bool waits);
  void release(std::uint64_t ticket);
  [[nodiscard]] heddle_store_counts counts() const;

 private:
  struct Aligned {
    void operator()(std::byte* memory) const;
  };
  struct Request {
    std::uint64_t offset = 0, bytes = 0;
    std::unique_ptr<std::byte, Aligned> memory;
    std::uint64_t skipped = 0;  // bytes in front of what was asked for
    bool is_done = false, is_unwanted = false;
    int error = 0;
    std::uint64_t read = 0;  // bytes of it that the file has
  };
  void work();
  void serve(Request& request);
  [[noreturn]] void fail(const std::string& what, const std::string& found) const;

  std::filesystem::path file_;
  std::shared_ptr<const StorePlace> place_;  // nullptr: it is being made
  bool is_kept_ = false;
  int descriptor_ = -1;
  mutable std::mutex mutex_;
  std::condition_variable wake_, done_;
  std::map<std::uint64_t, Request> requests_;
  std::deque<std::uint64_t> waiting_;
  std::uint64_t last_ticket_ = 0, size_ = 0;
  heddle_store_counts counts_{};
  bool is_ending_ = false;
  std::jthread thread_;  // from the first request on; last, so that it ends before what it uses
};

}  // namespace heddle::graph
