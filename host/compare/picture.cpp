// SPDX-License-Identifier: Apache-2.0
#include "compare/picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace heddle::compare {
namespace {

std::string shape_of(const Picture& picture) {
  return fmt::format("{} x {} x {}", picture.width, picture.height, picture.channels);
}

void check_finite(const Picture& picture, std::string_view name) {
  const auto is_bad = [](float value) { return !std::isfinite(value); };
  const auto bad = std::find_if(picture.pixels.begin(), picture.pixels.end(), is_bad);
  if (bad == picture.pixels.end()) return;
  const auto index = static_cast<std::size_t>(bad - picture.pixels.begin());
  const std::size_t pixel = index / picture.channels;
  const auto others = std::count_if(bad + 1, picture.pixels.end(), is_bad);
  throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                           {},
                                           fmt::format("a value of {} is not finite", name),
                                           fmt::format("{} at x {}, y {}, channel {}{}", *bad, pixel % picture.width,
                                                       pixel / picture.width, index % picture.channels,
                                                       others > 0 ? fmt::format(", and {} more", others) : ""),
                                           "finite values",
                                           ""});
}

}  // namespace

void check_pair(const Picture& a, const Picture& b) {
  if (a.width != b.width || a.height != b.height || a.channels != b.channels) {
    throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                             {},
                                             "images of different shapes cannot be compared",
                                             fmt::format("image a is {}, image b {}", shape_of(a), shape_of(b)),
                                             "the same width, height and channels",
                                             ""});
  }
  for (const Picture* picture : {&a, &b}) {
    if (picture->pixels.empty() ||
        picture->pixels.size() != std::size_t{picture->width} * picture->height * picture->channels) {
      throw Error(HEDDLE_BAD_INPUT,
                  Diagnostic{Severity::kError,
                             {},
                             "an image without pixels cannot be compared",
                             fmt::format("{} with {} values", shape_of(*picture), picture->pixels.size()),
                             "width x height x channels values, at least one",
                             ""});
    }
  }
  check_finite(a, "image a");
  check_finite(b, "image b (the reference)");
}

void check_colors(const Picture& picture, std::string_view metric) {
  if (picture.colors() == 1 || picture.colors() == 3) return;
  throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                           {},
                                           fmt::format("'{}' is a metric of colours", metric),
                                           fmt::format("images of {} channels", picture.channels),
                                           "1 (gray), 2 (gray, alpha), 3 (RGB) or 4 (RGB, alpha)",
                                           ""});
}

}  // namespace heddle::compare
