// SPDX-License-Identifier: Apache-2.0
// How well sets of directions integrate: the table of the README of bake_visibility/depth_maps.
#include "bake_directions.hpp"

#include <gtest/gtest.h>

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <map>
#include <vector>

namespace {

using namespace baked_visibility;
using glm::dvec3;

constexpr double kConeAngle = 0.5;  // half of it, radians
constexpr std::uint32_t kCases = 400;

/// A normal and the axis of an occluding cone that is above its horizon: 1 - sin^2(a) cos(beta) of it is open.
struct Case {
  dvec3 normal, axis;
};
const std::vector<Case>& cases() {
  static const std::vector<Case> kAll = [] {
    std::vector<Case> all;
    const auto normals = directions(16 * kCases, DirectionSet::kRandom, 77);
    const auto axes = directions(16 * kCases, DirectionSet::kRandom, 78);
    for (std::size_t i = 0; all.size() < kCases; ++i)
      if (glm::dot(normals[i], axes[i]) > std::sin(kConeAngle)) all.push_back({normals[i], axes[i]});
    return all;
  }();
  return kAll;
}

/// Root mean square error of visibility; and of 8-bit weights against float ones.
struct Errors {
  double rms = 0, bits = 0;
};
Errors errors(const std::vector<dvec3>& set, std::size_t count) {
  Errors sum;
  for (const auto& [normal, axis] : cases()) {
    double weight = 0, open = 0, weight8 = 0, open8 = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const double h = glm::dot(normal, set[i]);
      if (h <= 0) continue;
      const double h8 = std::floor(h * 255 + 0.5);
      const bool is_open = glm::dot(axis, set[i]) < std::cos(kConeAngle);
      weight += h;
      weight8 += h8;
      open += is_open ? h : 0;
      open8 += is_open ? h8 : 0;
    }
    const double is = open / weight, is8 = open8 / weight8;
    const double error = is - (1 - std::pow(std::sin(kConeAngle), 2) * glm::dot(normal, axis));
    sum.rms += error * error / kCases;
    sum.bits += (is8 - is) * (is8 - is) / kCases;
  }
  return {std::sqrt(sum.rms), std::sqrt(sum.bits)};
}

double slope(double at_64, double at_4096) {
  return std::log(at_4096 / at_64) / std::log(64.0);
}

TEST(Directions, ConvergeAsTheReadmeSays) {
  std::map<std::uint32_t, double> even, random;
  // What another program found for the same question: even, random, 8 bits; within a quarter.
  const std::map<std::uint32_t, std::array<double, 3>> known{{64, {0.0271, 0.0780, 1.4e-4}},
                                                             {256, {0.0114, 0.0371, 7e-5}},
                                                             {1024, {0.0043, 0.0227, 3.5e-5}},
                                                             {4096, {0.0013, 0.0101, 1.7e-5}},
                                                             {16384, {0.00045, 0.0055, 8e-6}}};
  for (const std::uint32_t n : {64U, 256U, 1024U, 4096U, 16384U}) {
    const Errors set = errors(directions(n, DirectionSet::kFibonacci, 0), n);
    even[n] = set.rms;
    double squares = 0;  // over seeds: one random set says little
    for (std::uint32_t seed = 1; seed <= 4; ++seed)
      squares += std::pow(errors(directions(n, DirectionSet::kRandom, seed), n).rms, 2) / 4;
    random[n] = std::sqrt(squares);
    fmt::print("{:6} even {:.5f} random {:.5f} 8 bits {:.1e}\n", n, even[n], random[n], set.bits);
    EXPECT_NEAR(even[n] / known.at(n)[0], 1, 0.25);
    EXPECT_NEAR(random[n] / known.at(n)[1], 1, 0.25);
    EXPECT_NEAR(set.bits / known.at(n)[2], 1, 0.25);
    // Rounded weights are far below either.
    EXPECT_LT(set.bits, 0.05 * set.rms);
  }
  EXPECT_LE(slope(even[64], even[4096]), -0.65);
  EXPECT_NEAR(slope(random[64], random[4096]), -0.5, 0.1);
}

TEST(Directions, AreUnitAndEvenOverTheSphere) {
  for (const std::uint32_t n : {1U, 7U, 64U, 1000U}) {
    const auto set = directions(n, DirectionSet::kFibonacci, 3);
    ASSERT_EQ(set.size(), n);
    dvec3 sum(0.0);
    for (const dvec3& s : set) {
      EXPECT_NEAR(glm::length(s), 1, 1e-15);
      sum += s;
    }
    EXPECT_LT(glm::length(sum), n == 1 ? 1.0 : 2.0) << n;
  }
}

TEST(Directions, HaveBeginningsThatAreSpreadToo) {
  for (const std::uint32_t n : {1024U, 4096U}) {
    const auto set = directions(n, DirectionSet::kFibonacci, 0);
    for (const std::uint32_t part : {2U, 4U, 8U}) {
      const double early = errors(set, n / part).rms;
      const double alone = errors(directions(n / part, DirectionSet::kFibonacci, 0), n / part).rms;
      fmt::print("{:6} / {}: {:.5f}, a set of its own {:.5f}\n", n, part, early, alone);
      EXPECT_LT(early, 2 * alone) << n << " / " << part;
    }
  }
}

}  // namespace
