// SPDX-License-Identifier: Apache-2.0
// Number of a point -> where it is: Owen-scrambled Sobol points in pairs of dimensions, and numbers from hashes. Pure.
#pragma once

#include <glm/glm.hpp>

#include <cstdint>

namespace sampling {

/// Finalizer of Steele, Lea and Flood 2014, "Fast Splittable Pseudorandom Number Generators" (SplitMix64).
inline std::uint64_t mix_bits(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31U);
}

inline std::uint32_t reverse_bits(std::uint32_t x) {
  x = ((x >> 1U) & 0x55555555U) | ((x & 0x55555555U) << 1U);
  x = ((x >> 2U) & 0x33333333U) | ((x & 0x33333333U) << 2U);
  x = ((x >> 4U) & 0x0f0f0f0fU) | ((x & 0x0f0f0f0fU) << 4U);
  return __builtin_bswap32(x);
}

/// Two words at once.
inline std::uint64_t reverse_bits_of_both(std::uint64_t x) {
  x = ((x >> 1U) & 0x5555555555555555ULL) | ((x & 0x5555555555555555ULL) << 1U);
  x = ((x >> 2U) & 0x3333333333333333ULL) | ((x & 0x3333333333333333ULL) << 2U);
  x = ((x >> 4U) & 0x0f0f0f0f0f0f0f0fULL) | ((x & 0x0f0f0f0f0f0f0f0fULL) << 4U);
  x = __builtin_bswap64(x);
  return (x >> 32U) | (x << 32U);
}

/// A hash in which a bit changes higher bits only: Burley 2020, "Practical Hash-based Owen Scrambling", with the
/// multipliers of Vegdahl 2021, "Building a Better LK Hash".
inline std::uint32_t hash_upwards(std::uint32_t x, std::uint32_t seed) {
  x ^= x * 0x3d20adeaU;
  x += seed;
  x *= (seed >> 16U) | 1U;
  x ^= x * 0x05526c56U;
  x ^= x * 0x53a22864U;
  return x;
}

/// Nested uniform (Owen) scrambling: the same hash from the highest bit down.
inline std::uint32_t scramble_owen(std::uint32_t x, std::uint32_t seed) {
  return reverse_bits(hash_upwards(reverse_bits(x), seed));
}

/// Point `index` of the first two Sobol dimensions, scrambled: in (0, 1)^2. Sobol 1967; the second dimension belongs to
/// the polynomial x + 1, whose direction numbers follow from one another by v ^= v >> 1.
class Sobol2 {
 public:
  explicit Sobol2(std::uint64_t seed) {
    const std::uint64_t both = mix_bits(seed);
    seed_x_ = static_cast<std::uint32_t>(both);
    seed_y_ = static_cast<std::uint32_t>(both >> 32U);
  }

  [[nodiscard]] glm::dvec2 point(std::uint32_t index) const {
    // Multiplying by Pascal's triangle modulo 2: what adding v, v ^ (v >> 1), ... for each bit of the index comes to.
    // Both coordinates are kept with their lowest bit first, as the hash takes them, until they are done.
    std::uint32_t y = index;
    y ^= (y >> 1U) & 0x55555555U;
    y ^= (y >> 2U) & 0x33333333U;
    y ^= (y >> 4U) & 0x0f0f0f0fU;
    y ^= (y >> 8U) & 0x00ff00ffU;
    y ^= (y >> 16U) & 0x0000ffffU;
    const std::uint64_t both =
        reverse_bits_of_both((std::uint64_t{hash_upwards(y, seed_y_)} << 32U) | hash_upwards(index, seed_x_));
    return {unit(static_cast<std::uint32_t>(both)), unit(static_cast<std::uint32_t>(both >> 32U))};
  }

 private:
  /// Middle of the interval of 2^-32 that the bits name: never 0, never 1.
  static double unit(std::uint32_t bits) { return (static_cast<double>(bits) + 0.5) * 0x1p-32; }

  std::uint32_t seed_x_, seed_y_;
};

/// Seed of a pixel: a different scrambling for every pixel and every seed of the frame.
inline std::uint64_t pixel_seed(std::uint64_t seed, std::uint32_t x, std::uint32_t y) {
  return mix_bits(mix_bits(seed) ^ ((static_cast<std::uint64_t>(y) << 32U) | x));
}

}  // namespace sampling
