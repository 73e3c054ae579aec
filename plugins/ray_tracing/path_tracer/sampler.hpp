// SPDX-License-Identifier: Apache-2.0
// Seed, pixel and number of a sample -> its numbers in [0, 1), a pair at a time. README "Samples".
#pragma once

#include "owen_sobol.hpp"

namespace heddle::path_tracer {

enum class Points : std::uint32_t { kSobol = 0, kIndependent = 1 };

/// Samples of a pixel are dealt to this many scramblings in turn, so that their spread says how wrong their mean is:
/// points of one scrambling are not independent.
inline constexpr std::uint32_t kReplicates = 2;

/// The numbers of one path. Dimensions are numbered by what they are for, not by when they are asked for.
class Sampler {
 public:
  Sampler(Points points, std::uint64_t pixel_seed, std::uint64_t sample)
      : points_(points),
        index_(static_cast<std::uint32_t>(sample / kReplicates)),
        reversed_(sampling::reverse_bits(index_)),
        seed_(sampling::mix_bits(pixel_seed + 0x9e3779b97f4a7c15ULL * (sample % kReplicates + 1))) {}

  /// Of `count` samples that this one becomes, number `i`.
  [[nodiscard]] Sampler branch(std::uint32_t i, std::uint32_t count) const {
    Sampler own = *this;
    own.index_ = index_ * count + i;
    own.reversed_ = sampling::reverse_bits(own.index_);
    return own;
  }

  /// Pair `dimension` of this sample. Burley 2020, section 5: each pair of dimensions takes the points of the plane in
  /// an order of its own, shuffled so that any power of two of them from the first on still fills the square evenly.
  [[nodiscard]] glm::dvec2 pair(std::uint32_t dimension) const {
    const std::uint64_t seed = sampling::mix_bits(seed_ ^ (0xd1342543de82ef95ULL * (dimension + 1ULL)));
    if (points_ == Points::kIndependent) {
      const std::uint64_t x = sampling::mix_bits(seed ^ (0x2545f4914f6cdd1dULL * (index_ + 1ULL)));
      const std::uint64_t y = sampling::mix_bits(x);
      return {static_cast<double>(x >> 11U) * 0x1p-53, static_cast<double>(y >> 11U) * 0x1p-53};
    }
    // Sobol2 mixes the seed again: what it scrambles by does not depend on the order.
    const auto order = static_cast<std::uint32_t>(seed >> 32U);
    return sampling::Sobol2(seed).point(sampling::reverse_bits(sampling::hash_upwards(reversed_, order)));
  }

 private:
  Points points_;
  std::uint32_t index_, reversed_;  // ... with the lowest bit first
  std::uint64_t seed_;
};

}  // namespace heddle::path_tracer
