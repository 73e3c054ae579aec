// SPDX-License-Identifier: Apache-2.0
// Values of a graph's output -> bytes for the screen, the same that a file of 8 bits gets.
#pragma once

#include "view/state.hpp"

#include <mutex>

namespace heddle::view {

/// Pictures in the memory of those that nobody shows any more: megabytes that are new for each frame cost the system a
/// page fault for every 4 KiB, more than what is copied into them.
class PictureMemory {
 public:
  /// As it was left: all but `rgba`, which has any bytes, is 0. May end on any thread.
  std::shared_ptr<Picture> take();

 private:
  // A and B, each as rendered, as published and as the window has it, and one that is being read.
  static constexpr std::size_t kMostFree = 7;
  struct Free {
    std::mutex mutex;
    std::vector<std::vector<std::uint8_t>> bytes;
  };
  std::shared_ptr<Free> free_ = std::make_shared<Free>();
};

/// RGBA of values with 1 to 4 channels (two: grey and alpha), as stored: 0 to 1, clamped, NaN as 0; alpha is 255.
std::vector<std::uint8_t> bytes_of(const std::vector<float>& values, std::uint32_t channels);

/// How far two pictures of the same shape are apart, in steps of 8 bits over red, green and blue.
struct Distance {
  int maximum = 0;
  double root_mean_square = 0;
  std::uint64_t differing_pixels = 0;
};
/// Also makes |a - b| times `gain`.
Distance difference(const Picture& a, const Picture& b, double gain, std::vector<std::uint8_t>& rgba);

}  // namespace heddle::view
