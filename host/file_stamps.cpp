// SPDX-License-Identifier: Apache-2.0
#include "file_stamps.hpp"

namespace heddle {

FileStamps stamps_of(const std::set<std::filesystem::path>& files) {
  FileStamps stamps;
  for (const std::filesystem::path& file : files) {
    std::error_code error;
    FileStamp stamp;
    stamp.time = std::filesystem::last_write_time(file, error);
    // Gone; or between two steps of an editor's saving.
    if (error) stamp.time = std::filesystem::file_time_type::min();
    stamp.size = std::filesystem::file_size(file, error);
    stamps.emplace(file, stamp);
  }
  return stamps;
}

FileStamps stamps_after(const std::set<std::filesystem::path>& files, const FileStamps& seen,
                        std::filesystem::file_time_type began) {
  FileStamps stamps = stamps_of(files);
  for (auto& [file, stamp] : stamps) {
    if (const auto known = seen.find(file); known != seen.end())
      stamp = known->second;
    else if (stamp.time >= began)
      stamp = {};
  }
  return stamps;
}

}  // namespace heddle
