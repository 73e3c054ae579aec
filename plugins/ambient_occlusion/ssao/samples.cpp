// SPDX-License-Identifier: Apache-2.0
#include "samples.hpp"

#include <cmath>
#include <numbers>
#include <utility>

namespace ssao {

namespace {

/// Numbers in [0, 1) and permutations; the outputs of SplitMix64 (Steele, Lea and Flood 2014).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed * 0x9e3779b97f4a7c15ULL + 0x632be59bd9b4e019ULL) {}

  double uniform() {
    state_ += 0x9e3779b97f4a7c15ULL;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
    return static_cast<double>((z ^ (z >> 31U)) >> 11U) * 0x1p-53;
  }
  template <typename T>
  void shuffle(std::vector<T>& items) {
    for (std::size_t i = items.size(); i > 1; --i) {
      std::swap(items[i - 1], items[static_cast<std::size_t>(uniform() * static_cast<double>(i))]);
    }
  }

 private:
  std::uint64_t state_;
};

/// Unit vector of height z.
glm::dvec3 on_sphere(double z, double phi) {
  const double r = std::sqrt(std::fmax(0.0, 1.0 - z * z));
  return {r * std::cos(phi), r * std::sin(phi), z};
}

/// Unit vectors over the sphere, or over the half with z > 0.
std::vector<glm::dvec3> make_directions(Directions kind, std::uint32_t count, bool is_hemisphere, Random& random) {
  constexpr double kGoldenAngle = std::numbers::pi * 0.76393202250021030;  // pi (3 - sqrt(5))
  std::vector<glm::dvec3> directions;
  for (std::uint32_t i = 0; i < count; ++i) {
    // Even in z is even on the sphere (Archimedes).
    if (kind == Directions::kFibonacci) {
      const double t = (i + 0.5) / count;
      directions.push_back(on_sphere(is_hemisphere ? 1.0 - t : 1.0 - 2.0 * t, i * kGoldenAngle));
      continue;
    }
    const double u = random.uniform();
    glm::dvec3 v = on_sphere(is_hemisphere ? u : 1.0 - 2.0 * u, 2.0 * std::numbers::pi * random.uniform());
    if (kind == Directions::kOctants) {
      v = glm::abs(v);
      if ((i & 1U) != 0) v.x = -v.x;
      if ((i & 2U) != 0) v.y = -v.y;
      if ((i & 4U) != 0 && !is_hemisphere) v.z = -v.z;
    }
    directions.push_back(v);
  }
  return directions;
}

}  // namespace

std::vector<std::array<float, 4>> make_offsets(Directions kind, std::uint32_t count, double shortest,
                                               bool is_hemisphere, bool is_shuffled, std::uint64_t seed) {
  Random random(seed);
  std::vector<glm::dvec3> directions = make_directions(kind, count, is_hemisphere, random);
  if (is_shuffled) random.shuffle(directions);
  std::vector<double> lengths;
  for (std::uint32_t i = 0; i < count; ++i) lengths.push_back(shortest + (1.0 - shortest) * (i + 0.5) / count);
  random.shuffle(lengths);
  std::vector<std::array<float, 4>> offsets;
  for (std::uint32_t i = 0; i < count; ++i) {
    const glm::dvec3 v = lengths[i] * directions[i];
    offsets.push_back({static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z), 0.0F});
  }
  return offsets;
}

std::vector<glm::dvec4> make_reflections(std::uint32_t tile, std::uint64_t seed) {
  Random random(seed);
  std::vector<glm::dvec4> pattern;
  for (const glm::dvec3& v : make_directions(Directions::kFibonacci, tile * tile, false, random)) {
    pattern.emplace_back(v, 0.0);
  }
  random.shuffle(pattern);
  return pattern;
}

std::vector<glm::dvec4> make_rotations(std::uint32_t tile, std::uint64_t seed) {
  // Shoemake 1992, "Uniform Random Rotations", at the points of Roberts' additive recurrence in three dimensions
  // (2018).
  constexpr double kPlastic = 1.22074408460575947536;  // the real root of x^4 = x + 1
  Random random(seed);
  const glm::dvec3 start(random.uniform(), random.uniform(), random.uniform());
  const glm::dvec3 step(1.0 / kPlastic, 1.0 / (kPlastic * kPlastic), 1.0 / (kPlastic * kPlastic * kPlastic));
  std::vector<glm::dvec4> pattern;
  for (std::uint32_t i = 0; i < tile * tile; ++i) {
    const glm::dvec3 u = glm::fract(start + static_cast<double>(i) * step);
    const double a = 2.0 * std::numbers::pi * u.y;
    const double b = 2.0 * std::numbers::pi * u.z;
    const double low = std::sqrt(1.0 - u.x);
    const double high = std::sqrt(u.x);
    pattern.emplace_back(low * std::sin(a), low * std::cos(a), high * std::sin(b), high * std::cos(b));
  }
  random.shuffle(pattern);
  return pattern;
}

}  // namespace ssao
