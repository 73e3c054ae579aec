// SPDX-License-Identifier: Apache-2.0
// What metrics read: two pictures that somebody else owns, checked once; and work spread over rows.
#pragma once

#include "image/image.hpp"

#include <cstdint>
#include <exception>
#include <span>
#include <string_view>
#include <thread>
#include <vector>

namespace heddle::compare {

/// Borrowed pixels, top row first, tightly packed.
struct Picture {
  std::uint32_t width = 0, height = 0, channels = 0;
  std::span<const float> pixels;

  Picture() = default;
  Picture(std::uint32_t columns, std::uint32_t rows, std::uint32_t components, std::span<const float> values)
      : width(columns), height(rows), channels(components), pixels(values) {}
  Picture(const image::Image& image)  // NOLINT(google-explicit-constructor): an image is a picture
      : width(image.width), height(image.height), channels(image.channels), pixels(image.pixels) {}

  /// Channels that are colours: the fourth is alpha, and the second of two.
  [[nodiscard]] std::uint32_t colors() const { return channels == 2 || channels == 4 ? channels - 1 : channels; }
};

/// Throws Error(HEDDLE_BAD_INPUT) if shapes differ, a picture is empty, or a value is not finite (names picture, pixel
/// and channel, and says how many there are).
void check_pair(const Picture& a, const Picture& b);
/// Throws unless the picture has one colour or three: `metric` is of colours.
void check_colors(const Picture& picture, std::string_view metric);

/// Calls work(first, last) for strips of rows that cover 0 .. rows - 1, on `threads` threads (0: one a processor). What
/// a row's result is must not depend on its strip: then bits do not depend on threads.
template <class Work>
void for_rows(std::uint32_t rows, std::uint32_t threads, const Work& work) {
  // A strip of fewer rows costs more to start than to work off.
  constexpr std::uint32_t kLeastRows = 16;
  const std::uint32_t wanted = threads != 0 ? threads : std::max(1U, std::thread::hardware_concurrency());
  const std::uint32_t strips = std::max(1U, std::min(wanted, rows / kLeastRows));
  std::vector<std::exception_ptr> failures(strips);
  const auto run = [&](std::uint32_t strip) {
    try {
      const auto bound = [&](std::uint64_t i) { return static_cast<std::uint32_t>(i * rows / strips); };
      work(bound(strip), bound(strip + 1ULL));
    } catch (...) {
      failures[strip] = std::current_exception();
    }
  };
  std::vector<std::jthread> others;
  for (std::uint32_t strip = 1; strip < strips; ++strip) others.emplace_back(run, strip);
  run(0);
  others.clear();  // waits
  for (const std::exception_ptr& failure : failures) {
    if (failure) std::rethrow_exception(failure);
  }
}

}  // namespace heddle::compare
