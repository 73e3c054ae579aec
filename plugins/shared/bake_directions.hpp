// SPDX-License-Identifier: Apache-2.0
// How many directions -> unit vectors over the whole sphere, in an order whose beginnings are spread well too. Pure, in
// float64.
#pragma once

#include "point_sequences.hpp"

#include <glm/glm.hpp>

#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

namespace baked_visibility {

enum class DirectionSet : std::uint32_t { kFibonacci, kRandom };

/// Numbers below `count` in the order of their mirrored digits: 0, 4, 2, 6, 1, 5, 3, 7.
inline std::vector<std::uint32_t> mirrored_order(std::uint32_t count) {
  const int digits = static_cast<int>(std::bit_width(count - 1));
  std::vector<std::uint32_t> order;
  order.reserve(count);
  for (std::uint32_t i = 0; i < 1U << digits; ++i) {
    std::uint32_t mirrored = 0;
    for (int digit = 0; digit < digits; ++digit) mirrored |= (i >> digit & 1U) << (digits - 1 - digit);
    if (mirrored < count) order.push_back(mirrored);
  }
  return order;
}

/// Fibonacci: z in equal steps, each turned by the golden angle (Vogel 1979). `seed` turns the set about the poles, or
/// chooses the random one.
inline std::vector<glm::dvec3> directions(std::uint32_t count, DirectionSet set, std::uint32_t seed) {
  std::vector<glm::dvec3> made(count);
  const double turn = seed == 0 ? 0.0 : sampling::random_number(seed);
  const std::vector<std::uint32_t> order = mirrored_order(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint64_t counter = (std::uint64_t{seed} << 32) + 2ULL * i;
    const bool is_random = set == DirectionSet::kRandom;
    const double u = is_random ? sampling::random_number(counter) : (order[i] + 0.5) / count;
    const double v = is_random ? sampling::random_number(counter + 1)
                               : sampling::fraction(turn + order[i] * (0.5 * std::sqrt(5.0) - 0.5));
    const double z = 1 - 2 * u, r = std::sqrt(std::fmax(0.0, 1 - z * z)), phi = 2 * std::numbers::pi * v;
    made[i] = {r * std::cos(phi), r * std::sin(phi), z};
  }
  return made;
}

}  // namespace baked_visibility
