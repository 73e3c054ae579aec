// SPDX-License-Identifier: Apache-2.0
// Times and sizes of files, for noticing that they changed: a hundred of them five times a second cost nothing that is
// seen, and every editor and file system takes part.
#pragma once

#include <filesystem>
#include <map>
#include <set>

namespace heddle {

struct FileStamp {
  std::filesystem::file_time_type time;
  std::uintmax_t size = 0;
  bool operator==(const FileStamp&) const = default;
};
using FileStamps = std::map<std::filesystem::path, FileStamp>;

/// Of each file; the smallest time for one that is not there.
FileStamps stamps_of(const std::set<std::filesystem::path>& files);

/// What to compare with next: files that were known keep the stamp they had in `seen`, when the waiting ended. Of those
/// that came into `files` just now nobody knows whether they were read before or after a change since `began`: they
/// count as changed.
FileStamps stamps_after(const std::set<std::filesystem::path>& files, const FileStamps& seen,
                        std::filesystem::file_time_type began);

}  // namespace heddle
