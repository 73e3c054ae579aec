// SPDX-License-Identifier: Apache-2.0
// Where occlusion is sampled around a point, and the tile that turns the samples from pixel to pixel: made once on the
// CPU in float64, the same for a seed on every machine.
#pragma once

#include <glm/glm.hpp>

#include <array>
#include <cstdint>
#include <vector>

namespace ssao {

enum class Directions : std::uint32_t { kFibonacci, kOctants, kRandom };  // in the order of the parameter's choices

/// Offsets in units of the radius, w = 0: directions over the sphere or the half with z > 0, lengths even over
/// [shortest, 1] in random order. With is_shuffled any first part of the set covers all directions, too.
std::vector<std::array<float, 4>> make_offsets(Directions kind, std::uint32_t count, double shortest,
                                               bool is_hemisphere, bool is_shuffled, std::uint64_t seed);

/// Unit vectors of a tile, spread evenly over the sphere, in random order: their mean reflection has no direction of
/// its own even in a tile of 16. w = 0.
std::vector<glm::dvec4> make_reflections(std::uint32_t tile, std::uint64_t seed);

/// Unit quaternions of a tile, even over all rotations.
std::vector<glm::dvec4> make_rotations(std::uint32_t tile, std::uint64_t seed);

}  // namespace ssao
