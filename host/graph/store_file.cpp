// SPDX-License-Identifier: Apache-2.0
#include "graph/store_file.hpp"

#include "diagnostics.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>

namespace heddle::graph {

namespace {

namespace fs = std::filesystem;
/// Of memory, offset and size of reads past the system's cache. 4 KiB is a page, and what disks of today ask for at
/// most.
constexpr std::uint64_t kCluster = 4096;

std::uint64_t rounded_up(std::uint64_t bytes) {
  return (bytes + kCluster - 1) / kCluster * kCluster;
}

/// All of it, unless the file ends or there is an error: then errno is not 0.
template <typename Call>
std::uint64_t transfer(std::uint64_t bytes, const Call& call) {
  std::uint64_t done = 0;
  errno = 0;
  while (done < bytes) {
    const ssize_t one = call(done);
    if (one < 0 && errno == EINTR) {
      errno = 0;
      continue;
    }
    if (one <= 0) break;
    done += static_cast<std::uint64_t>(one);
  }
  return done;
}

}  // namespace

StorePlace::StorePlace(fs::path store_file, std::span<const std::byte> part) : file(std::move(store_file)) {
  if (part.size() == sizeof bytes) std::memcpy(&bytes, part.data(), sizeof bytes);
}

StorePlace::~StorePlace() {
  std::error_code ignored;
  if (is_temporary) fs::remove(file, ignored);
}

std::string StorePlace::damage() const {
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return fmt::format("its store {} is not there", file.string());
  const std::uintmax_t found = fs::file_size(file, error);
  if (error || found != bytes)
    return fmt::format("its store {} has {} bytes of {}", file.string(), error ? 0 : found, bytes);
  return {};
}

void StoreFile::Aligned::operator()(std::byte* memory) const {
  std::free(memory);
}

StoreFile::StoreFile(const fs::path& file) : file_(file) {
  descriptor_ = ::open(file.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (descriptor_ < 0) fail("the store cannot be made", std::strerror(errno));
  counts_.struct_size = sizeof counts_;
}

StoreFile::StoreFile(std::shared_ptr<const StorePlace> place) : file_(place->file), place_(std::move(place)) {
  // Not every file system goes past the cache.
  descriptor_ = ::open(file_.c_str(), O_RDONLY | O_DIRECT | O_CLOEXEC);
  if (descriptor_ < 0 && errno == EINVAL) descriptor_ = ::open(file_.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor_ < 0) fail("the store cannot be read", std::strerror(errno));
  size_ = place_->bytes;
  counts_.struct_size = sizeof counts_;
  struct stat found {};
  if (::fstat(descriptor_, &found) == 0 && static_cast<std::uint64_t>(found.st_size) != size_) {
    const std::string said = fmt::format("{} bytes of {}", found.st_size, size_);
    ::close(descriptor_);
    fail("the store is not what was made", said);
  }
}

StoreFile::~StoreFile() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
  ::close(descriptor_);
  std::error_code ignored;
  if (place_ == nullptr && !is_kept_) fs::remove(file_, ignored);
}

void StoreFile::fail(const std::string& what, const std::string& found) const {
  throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                           {file_.string(), 0, 0},
                                           what,
                                           found,
                                           "",
                                           place_ == nullptr ? "" : "remove the file: the job makes it again"});
}

std::uint64_t StoreFile::size() const {
  const std::lock_guard lock(mutex_);
  return size_;
}

void StoreFile::write(std::uint64_t offset, std::span<const std::byte> bytes) {
  const std::uint64_t done = transfer(bytes.size(), [&](std::uint64_t at) {
    return ::pwrite(descriptor_, bytes.data() + at, bytes.size() - at, static_cast<off_t>(offset + at));
  });
  if (done != bytes.size()) fail("the store cannot be written", std::strerror(errno));
  const std::lock_guard lock(mutex_);
  size_ = std::max(size_, offset + bytes.size());
}

void StoreFile::read(std::uint64_t offset, std::span<std::byte> out) {
  if (place_ != nullptr) {
    const std::uint64_t ticket = request(offset, out.size());
    std::memcpy(out.data(), collect(ticket, true), out.size());
    release(ticket);
    return;
  }
  const std::uint64_t done = transfer(out.size(), [&](std::uint64_t at) {
    return ::pread(descriptor_, out.data() + at, out.size() - at, static_cast<off_t>(offset + at));
  });
  if (done != out.size())
    fail("the store cannot be read",
         errno != 0 ? std::strerror(errno)
                    : fmt::format("it ends at byte {}; {} at {} are asked for", size(), out.size(), offset));
}

void StoreFile::keep_as(const fs::path& file) {
  // The name stands for whole contents after a crash of the machine too.
  if (::fdatasync(descriptor_) != 0) fail("the store cannot be written", std::strerror(errno));
  std::error_code error;
  if (fs::is_directory(fs::symlink_status(file, error))) fs::remove_all(file, error);
  fs::rename(file_, file, error);
  if (error) fail("the store cannot be put in place", error.message());
  file_ = file;
  is_kept_ = true;
}

std::uint64_t StoreFile::request(std::uint64_t offset, std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  if (bytes == 0 || offset + bytes > size_)
    throw Error(HEDDLE_BUG, fmt::format("{} bytes at {} are asked for of the store {} with {}", bytes, offset,
                                        file_.string(), size_));
  Request& one = requests_[++last_ticket_];
  one.offset = offset;
  one.bytes = bytes;
  waiting_.push_back(last_ticket_);
  if (!thread_.joinable()) thread_ = std::jthread([this] { work(); });
  wake_.notify_one();
  return last_ticket_;
}

const std::byte* StoreFile::collect(std::uint64_t ticket, bool waits) {
  std::unique_lock lock(mutex_);
  const auto found = requests_.find(ticket);
  if (found == requests_.end() || found->second.is_unwanted)
    throw Error(HEDDLE_BUG, fmt::format("the store {} has no request {}", file_.string(), ticket));
  Request& one = found->second;
  if (!one.is_done && waits) {
    const auto start = std::chrono::steady_clock::now();
    done_.wait(lock, [&] { return one.is_done; });
    ++counts_.waits;
    counts_.wait_ns += static_cast<std::uint64_t>(
        std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now() - start).count());
  }
  if (!one.is_done) return nullptr;
  if (one.error != 0) fail("the store cannot be read", std::strerror(one.error));
  if (one.read < one.skipped + one.bytes)
    fail("the store was cut off since it was opened",
         fmt::format("it ends at byte {}; {} at {} are asked for", one.offset - one.skipped + one.read, one.bytes,
                     one.offset));
  return one.memory.get() + one.skipped;
}

void StoreFile::release(std::uint64_t ticket) {
  const std::lock_guard lock(mutex_);
  const auto found = requests_.find(ticket);
  if (found == requests_.end()) return;
  // The thread may be at it; then it lets go of it.
  if (found->second.is_done)
    requests_.erase(found);
  else
    found->second.is_unwanted = true;
}

heddle_store_counts StoreFile::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

void StoreFile::work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    wake_.wait(lock, [&] { return is_ending_ || !waiting_.empty(); });
    if (is_ending_) return;
    const std::uint64_t ticket = waiting_.front();
    waiting_.pop_front();
    Request& one = requests_.at(ticket);
    if (one.is_unwanted) {
      requests_.erase(ticket);
      continue;
    }
    lock.unlock();
    serve(one);
    lock.lock();
    ++counts_.reads;
    counts_.bytes_read += one.read;
    if (one.is_unwanted) {
      requests_.erase(ticket);
      continue;
    }
    counts_.bytes_used += one.bytes;
    one.is_done = true;
    done_.notify_all();
  }
}

void StoreFile::serve(Request& request) {
  const std::uint64_t first = request.offset / kCluster * kCluster;
  const std::uint64_t size = rounded_up(request.offset + request.bytes) - first;
  request.skipped = request.offset - first;
  request.memory.reset(static_cast<std::byte*>(std::aligned_alloc(kCluster, size)));
  if (request.memory == nullptr) {
    request.error = ENOMEM;
    return;
  }
  request.read = transfer(size, [&](std::uint64_t at) {
    return ::pread(descriptor_, request.memory.get() + at, size - at, static_cast<off_t>(first + at));
  });
  request.error = errno;
}

}  // namespace heddle::graph
