// SPDX-License-Identifier: Apache-2.0
// Pictures for tests of metrics.
#pragma once

#include "compare/picture.hpp"

#include <random>

namespace heddle::compare {

/// Uniform values of 0 to `top`, the same for the same seed on every machine.
inline image::Image noise(std::uint32_t width, std::uint32_t height, std::uint32_t channels, unsigned seed,
                          float top = 1.0F) {
  std::mt19937 random(seed);
  image::Image made{width, height, channels, {}};
  for (std::size_t i = 0; i < std::size_t{width} * height * channels; ++i)
    made.pixels.push_back(top * static_cast<float>(random() >> 8U) / 16777216.0F);
  return made;
}

inline image::Image constant(std::uint32_t width, std::uint32_t height, std::vector<float> value) {
  image::Image made{width, height, static_cast<std::uint32_t>(value.size()), {}};
  for (std::size_t i = 0; i < std::size_t{width} * height; ++i)
    made.pixels.insert(made.pixels.end(), value.begin(), value.end());
  return made;
}

/// What a call throws as Error(HEDDLE_BAD_INPUT).
template <class Call>
std::string error_from(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.status() == HEDDLE_BAD_INPUT ? error.what() : std::string("another status: ") + error.what();
  }
  return "no error";
}

}  // namespace heddle::compare
