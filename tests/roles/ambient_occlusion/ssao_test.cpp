// SPDX-License-Identifier: Apache-2.0
// ssao.glsl, compiled here as C++ (glm; literals are float by a compiler option, as in GLSL), and its sample sets,
// against float64 and against the closed form of a corner. Needs no device.
#include "ambient_occlusion/ssao/samples.hpp"
#include "corner.hpp"

#include <glm/gtc/packing.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>

namespace glsl {
using namespace glm;
#include "ambient_occlusion/ssao/ssao.glsl"
}  // namespace glsl

namespace {

using glm::dvec3;
using glm::ivec2;
using glm::vec3;
using glm::vec4;

// With literals float by option, these are double.
constexpr double operator""_d(long double value) {
  return static_cast<double>(value);
}
constexpr double operator""_d(unsigned long long value) {
  return static_cast<double>(value);
}

const vec3 kNear(1);
const vec3 kFar(1, 0.6f, 0.3f);

std::vector<dvec3> directions(std::uint32_t count) {
  std::vector<dvec3> vs;
  for (const auto& o : ssao::make_offsets(ssao::Directions::kRandom, count, 1, false, false, 7)) {
    vs.push_back(glm::normalize(dvec3(double(o[0]), double(o[1]), double(o[2]))));
  }
  return vs;
}

// ---- equations against float64 ----

TEST(Ssao, ReflectionAndRotationKeepTheLengthAndEqualFloat64) {
  const std::vector<dvec3> vs = directions(200);
  const std::vector<glm::dvec4> rotations = ssao::make_rotations(16, 3);
  for (std::size_t i = 0; i < 199; ++i) {
    const dvec3 v = 0.75_d * vs[i];
    const dvec3 r = vs[i + 1];
    // Unit vectors arrive rounded; six operations of float32 on values up to 3 are good to 1e-6.
    EXPECT_LT(glm::distance(dvec3(glsl::reflect_offset(vec3(v), vec3(r))), v - 2_d * glm::dot(v, r) * r), 1e-6_d);
    const glm::dvec4 q = rotations[i % rotations.size()];
    const double w = q.w;
    const dvec3 u(q);
    const dvec3 rotated = 2_d * glm::dot(u, v) * u + (w * w - glm::dot(u, u)) * v + 2_d * w * glm::cross(u, v);
    EXPECT_LT(glm::distance(dvec3(glsl::rotate_offset(vec3(v), vec4(q))), rotated), 1e-6_d);
  }
}

TEST(Ssao, VectorsThatQuantizationShortenedOrErasedKeepTheLength) {
  for (const dvec3& v : directions(50)) {
    for (const dvec3& r : directions(50)) {
      const auto stored = vec3(glm::unpackSnorm4x8(glm::packSnorm4x8(vec4(vec3(r), 0.0f))));
      EXPECT_NEAR(glm::length(glsl::reflect_offset(vec3(v), stored)), 1.0f, 1e-6f);
    }
    EXPECT_EQ(glsl::reflect_offset(vec3(v), vec3(0)), vec3(v)) << "the zero vector reflects nothing";
    EXPECT_EQ(glsl::rotate_offset(vec3(v), vec4(0)), vec3(v));
  }
}

TEST(Ssao, NoSampleLiesBelowTheTangentPlane) {
  for (const dvec3& n : directions(40)) {
    for (const dvec3& v : directions(40)) {
      EXPECT_GE(glm::dot(glsl::flip_offset(vec3(v), vec3(n)), vec3(n)), 0.0f);
      const vec3 up(v.x, v.y, std::abs(v.z));
      const vec3 based = glsl::basis_offset(up, vec3(n), vec3(v));
      EXPECT_NEAR(double(glm::dot(based, vec3(n))), double(up.z), 1e-6_d);
      EXPECT_NEAR(glm::length(based), 1.0f, 2e-6f);
      // Random vectors along the normal have no part across it.
      EXPECT_NEAR(glm::length(glsl::basis_offset(up, vec3(n), vec3(n))), 1.0f, 2e-6f);
    }
  }
}

TEST(Ssao, OcclusionIsTheCurveOfEveryKindAndNothingOutsideOfIt) {
  const glsl::OcclusionCurve curve{0.25f, 1.0f, 2.0f};
  for (const unsigned kind : {0u, 1u, 2u, 3u, 4u}) {
    float last = 1.0f;
    EXPECT_EQ(glsl::occlusion(kind, 0, curve, kNear, kFar), 0.0f) << "what is seen is not occluded";
    EXPECT_EQ(glsl::occlusion(kind, -5, curve, kNear, kFar), 0.0f);
    EXPECT_EQ(glsl::occlusion(kind, std::numeric_limits<float>::quiet_NaN(), curve, kNear, kFar), 0.0f);
    for (int i = 1; i <= 1000; ++i) {
      const float d = static_cast<float>(i) / 1000.0f;
      const float o = glsl::occlusion(kind, d, curve, kNear, kFar);
      EXPECT_LE(o, last + 1e-6f) << kind << " " << d;
      EXPECT_GE(o, 0.0f);
      last = o;
    }
    EXPECT_EQ(glsl::occlusion(kind, 1.001f, curve, kNear, kFar), 0.0f);
    EXPECT_EQ(glsl::occlusion(kind, std::numeric_limits<float>::infinity(), curve, kNear, kFar), 0.0f);
  }
  for (int i = 1; i < 100; ++i) {
    const double d = i / 100_d;
    const auto got = [&](unsigned kind) {
      return double(glsl::occlusion(kind, static_cast<float>(d), curve, kNear, kFar));
    };
    EXPECT_EQ(got(glsl::kFalloffNone), 1_d);
    EXPECT_NEAR(got(glsl::kFalloffLinear), 1_d - d, 1e-6_d);
    const double left = std::clamp((1_d - d) / 0.75_d, 0_d, 1_d);
    EXPECT_NEAR(got(glsl::kFalloffPower), left * left, 1e-6_d);
    EXPECT_NEAR(got(glsl::kFalloffQuadratic), 1_d / (1_d + d * d / 0.0625_d), 1e-6_d);
    const double nodes[] = {1, 1, 1, 1, 0.6_d, 0.3_d, 0};
    const int cell = std::min(static_cast<int>(d * 6_d), 5);
    const double t = d * 6_d - cell;
    EXPECT_NEAR(got(glsl::kFalloffCurve), nodes[cell] * (1_d - t) + nodes[cell + 1] * t, 1e-6_d) << d;
  }
}

TEST(Ssao, CurvesWithoutAWidthAreSteps) {
  for (const float width : {0.0f, 1e-7f}) {
    const glsl::OcclusionCurve step{1.0f, 1.0f + width, 0.0f};
    EXPECT_EQ(glsl::occlusion(glsl::kFalloffPower, 0.999f, step, kNear, kFar), 1.0f);
    EXPECT_EQ(glsl::occlusion(glsl::kFalloffPower, 1.0f, step, kNear, kFar), 1.0f);
    EXPECT_EQ(glsl::occlusion(glsl::kFalloffPower, 1.001f, step, kNear, kFar), 0.0f);
  }
  // full beyond range is range; no power of 0 makes 0^0.
  EXPECT_EQ(glsl::occlusion(glsl::kFalloffPower, 1.5f, {2.0f, 1.0f, 1.0f}, kNear, kFar), 0.0f);
  EXPECT_LT(glsl::occlusion(glsl::kFalloffPower, std::nextafter(1.0f, 0.0f), {0.0f, 1.0f, 0.0f}, kNear, kFar), 1.0f);
  EXPECT_TRUE(std::isfinite(glsl::occlusion(glsl::kFalloffQuadratic, 1e-30f, {0.0f, 1.0f, 1.0f}, kNear, kFar)));
}

TEST(Ssao, OnlyWhatRisesAboveThePlaneOccludes) {
  const vec3 n(0, 1, 0);
  EXPECT_FALSE(glsl::is_above_plane(vec3(1, 0, 0), n, 10));
  EXPECT_FALSE(glsl::is_above_plane(vec3(1, -0.5f, 0), n, 10));
  EXPECT_TRUE(glsl::is_above_plane(vec3(1, 0.01f, 0), n, 10)) << "half a degree";
  EXPECT_FALSE(glsl::is_above_plane(vec3(1e-3f, 1e-6f, 0), n, 1000)) << "less than float32 knows at 1 km";
  EXPECT_FALSE(glsl::is_above_plane(vec3(1e30f, 1e25f, 0), n, 10)) << "where there is no surface";
}

TEST(Ssao, TheFootprintNeverExceedsItsLimit) {
  for (float radius = 0.01f; radius < 1e6f; radius *= 1.7f) {
    EXPECT_LE(glsl::footprint_scale(radius, 50) * radius, 50.0f * (1.0f + 1e-6f));
    EXPECT_EQ(glsl::footprint_scale(radius, 50), radius <= 50 ? 1.0f : 50 / radius);
    // The rival takes more samples as the camera comes closer: one to four times.
    const int samples = glsl::samples_for_footprint(16, radius, 50);
    EXPECT_EQ(samples, 16 * static_cast<int>(std::clamp(std::ceil(radius / 50), 1.0f, 4.0f)));
  }
}

TEST(Ssao, ReducedPixelsStandForPixelsInside) {
  for (const int size : {1, 2, 3, 1079, 1919, 1920}) {
    for (const int divisor : {1, 2, 3, 4}) {
      const int reduced = (size + divisor - 1) / divisor;
      for (const int i : {0, reduced / 2, reduced - 1}) {
        const ivec2 pixel = glsl::representative(ivec2(i), divisor, ivec2(size));
        EXPECT_GE(pixel.x, i * divisor);
        EXPECT_LT(pixel.x, std::min((i + 1) * divisor, size));
      }
    }
  }
}

TEST(Ssao, NeighboursOffTheSurfaceWeighLittleAndNeverNothing) {
  EXPECT_EQ(glsl::same_surface(0, 1), 1.0f);
  EXPECT_EQ(glsl::same_surface(1, 1), 0.5f);
  EXPECT_LT(glsl::same_surface(10, 1), 2e-4f);
  EXPECT_LT(glsl::same_surface(0, -1), 3e-3f);
  EXPECT_GT(glsl::same_surface(std::numeric_limits<float>::infinity(), -1), 1e-16f);
  EXPECT_EQ(glsl::same_surface(-3, 0.5f), glsl::same_surface(3, 0.5f));
}

TEST(Ssao, TheMedianOfFourIsOneOfTheMiddleTwo) {
  float d[4] = {1, 2, 3, 4};
  do {
    EXPECT_EQ(glsl::median_depth(vec4(d[0], d[1], d[2], d[3])), 3.0f);
  } while (std::next_permutation(d, d + 4));
}

// ---- the estimator at a corner: floor y = 0, wall x = 0, a point at distance k radii from the wall ----

using Sets = std::function<std::vector<std::array<float, 4>>(std::uint64_t seed)>;

/// Occlusion at distance k with one element of a pattern: every function as occlude.comp.glsl calls it.
double occlusion_at(double k, const std::vector<std::array<float, 4>>& offsets, std::uint32_t randomize,
                    const glm::dvec4& random) {
  const vec3 n(0, 1, 0);
  double sum = 0;
  for (const auto& o : offsets) {
    vec3 v(o[0], o[1], o[2]);
    v = randomize == glsl::kRandomizeReflect ? glsl::reflect_offset(v, vec3(random))
                                             : glsl::rotate_offset(v, vec4(random));
    v = glsl::flip_offset(v, n);
    // Whatever the view, a sample in the wall is behind it.
    const auto behind = static_cast<float>(-(k + double(v.x)));
    sum += double(glsl::occlusion(glsl::kFalloffNone, behind, {1, 10, 1}, kNear, kFar));
  }
  return sum / static_cast<double>(offsets.size());
}

struct Moments {
  double mean = 0, sigma = 0;
};
Moments over_pattern(double k, const std::vector<std::array<float, 4>>& offsets, std::uint32_t randomize) {
  const auto pattern =
      randomize == glsl::kRandomizeReflect ? ssao::make_reflections(64, 1) : ssao::make_rotations(64, 1);
  Moments m;
  double squares = 0;
  for (const glm::dvec4& random : pattern) {
    const double o = occlusion_at(k, offsets, randomize, random);
    m.mean += o / static_cast<double>(pattern.size());
    squares += o * o / static_cast<double>(pattern.size());
  }
  m.sigma = std::sqrt(std::max(0_d, squares - m.mean * m.mean));
  return m;
}

TEST(Ssao, AtACornerItIsTheClosedFormForEveryDistance) {
  const auto offsets = ssao::make_offsets(ssao::Directions::kFibonacci, 4096, 0.5_d, false, false, 1);
  for (int i = 0; i <= 20; ++i) {
    const double k = i / 20_d;
    // Lengths meet directions at random: at most sqrt(p (1 - p) / 4096) = 0.008, less by what even directions take
    // away.
    EXPECT_NEAR(occlusion_at(k, offsets, glsl::kRandomizeReflect, {0.6_d, 0, 0.8_d, 0}), corner::occlusion(k), 0.005_d)
        << k;
  }
}

TEST(Ssao, ItsNoiseAndBiasAreThoseOfTheSampleSets) {
  struct Row {
    ssao::Directions directions;
    std::uint32_t samples;
    double sigma;  // what 4096 reflections gave, over 32 sets
  };
  const double k = 0.25_d;
  const auto measure = [&](ssao::Directions kind, std::uint32_t samples, std::uint32_t randomize) {
    constexpr std::uint64_t kSets = 32;
    double sigma = 0;
    double squared_bias = 0;
    for (std::uint64_t seed = 0; seed < kSets; ++seed) {
      const Moments m = over_pattern(k, ssao::make_offsets(kind, samples, 0.5_d, false, false, seed), randomize);
      sigma += m.sigma / kSets;
      squared_bias += std::pow(m.mean - corner::occlusion(k), 2_d) / kSets;
    }
    const double bias = std::sqrt(squared_bias);
    std::printf("  directions %u samples %2u randomize %u: sigma %.4f rms bias %.4f\n", unsigned(kind), samples,
                randomize, sigma, bias);
    return std::pair(sigma, bias);
  };
  // Reflections damp the l-th band of a set's imbalance by 1 / (2 l + 1) only, so random sets stay biased; rotations
  // leave nothing but the pattern's own 4096.
  for (const auto& [kind, samples, expected] :
       {Row{ssao::Directions::kRandom, 8, 0.169_d}, Row{ssao::Directions::kRandom, 32, 0.084_d},
        Row{ssao::Directions::kOctants, 8, 0.131_d}, Row{ssao::Directions::kFibonacci, 8, 0.107_d},
        Row{ssao::Directions::kFibonacci, 16, 0.061_d}, Row{ssao::Directions::kFibonacci, 32, 0.036_d}}) {
    const auto [sigma, bias] = measure(kind, samples, glsl::kRandomizeReflect);
    EXPECT_NEAR(sigma, expected, 0.15_d * expected);
    if (kind == ssao::Directions::kFibonacci) {
      EXPECT_LT(bias, 0.01_d) << samples;
    }
    if (kind == ssao::Directions::kRandom && samples == 8) {
      EXPECT_GT(bias, 0.02_d);
    }
    const auto [rotated_sigma, rotated_bias] = measure(kind, samples, glsl::kRandomizeRotate);
    EXPECT_NEAR(rotated_sigma, sigma, 0.25_d * sigma);
    EXPECT_LT(rotated_bias, 0.003_d) << samples;
  }
}

TEST(Ssao, TheDarkerOfTwoNoisyMeansIsTooDarkAndTheDarkerOfTheirMeansIsNot) {
  // Both sets mean the same, so the right answer is that mean; s^2 = p (1 - p) / n of each set gives
  // E[max] - max(E) = sqrt((s1^2 + s2^2) / (2 pi)) = 0.11 for 4 and 12 of 16 samples.
  const double k = 0.25_d;
  const double truth = corner::occlusion(k);
  double before = 0;
  double after_tight = 0;
  double after_wide = 0;
  constexpr std::uint64_t kSets = 64;
  const auto pattern = ssao::make_rotations(16, 1);
  for (std::uint64_t seed = 0; seed < kSets; ++seed) {
    const auto tight = ssao::make_offsets(ssao::Directions::kRandom, 4, 0.5_d, false, false, 2 * seed);
    const auto wide = ssao::make_offsets(ssao::Directions::kRandom, 12, 0.5_d, false, false, 2 * seed + 1);
    for (const glm::dvec4& random : pattern) {
      const double a = occlusion_at(k, tight, glsl::kRandomizeRotate, random);
      const double b = occlusion_at(k, wide, glsl::kRandomizeRotate, random);
      const double weight = 1_d / static_cast<double>(kSets * pattern.size());
      before += weight * std::max(a, b);
      after_tight += weight * a;
      after_wide += weight * b;
    }
  }
  const double p = truth * (1_d - truth);
  const double expected = std::sqrt((p / 4_d + p / 12_d) / (2_d * std::numbers::pi_v<double>));
  std::printf("  bias before the blur %.4f (expected %.4f), after it %.4f\n", before - truth, expected,
              std::max(after_tight, after_wide) - truth);
  EXPECT_NEAR(before - truth, expected, 0.15_d * expected);
  EXPECT_LT(std::max(after_tight, after_wide) - truth, 0.01_d);
}

// ---- sample sets ----

TEST(Ssao, SampleSetsAreEvenOverTheSphereAndTheirLengths) {
  for (const auto kind : {ssao::Directions::kFibonacci, ssao::Directions::kOctants}) {
    for (const std::uint32_t count : {8u, 32u, 64u}) {
      const auto offsets = ssao::make_offsets(kind, count, 0.5_d, false, false, 5);
      int octants[8] = {};
      std::vector<float> lengths;
      for (const auto& o : offsets) {
        ++octants[(o[0] < 0 ? 1 : 0) + (o[1] < 0 ? 2 : 0) + (o[2] < 0 ? 4 : 0)];
        lengths.push_back(glm::length(vec3(o[0], o[1], o[2])));
      }
      for (const int in_octant : octants) {
        EXPECT_NEAR(in_octant, static_cast<int>(count) / 8, kind == ssao::Directions::kOctants ? 0 : 2);
      }
      std::sort(lengths.begin(), lengths.end());
      for (std::uint32_t i = 0; i < count; ++i) {
        const double expected = 0.5_d + 0.5_d * (i + 0.5_d) / count;
        EXPECT_NEAR(double(lengths[i]), expected, 1e-6_d);
      }
    }
  }
  for (const auto& o : ssao::make_offsets(ssao::Directions::kFibonacci, 64, 0.0_d, true, true, 5)) {
    EXPECT_GT(o[2], 0.0f) << "a hemisphere";
  }
}

TEST(Ssao, PatternsAreUnitAndHaveNoDirectionOfTheirOwn) {
  for (const std::uint32_t tile : {4u, 16u, 64u}) {
    dvec3 sum(0);
    double second[3] = {};
    for (const glm::dvec4& v : ssao::make_reflections(tile, 9)) {
      EXPECT_NEAR(glm::length(dvec3(v)), 1_d, 1e-12_d);
      sum += dvec3(v);
      for (int i = 0; i < 3; ++i) second[i] += v[i] * v[i];
    }
    const double count = tile * tile;
    EXPECT_LT(glm::length(sum) / count, 0.02_d) << tile;
    for (const double s : second) EXPECT_NEAR(s / count, 1_d / 3_d, 0.02_d) << tile;
    for (const glm::dvec4& q : ssao::make_rotations(tile, 9)) EXPECT_NEAR(glm::length(q), 1_d, 1e-12_d);
  }
}

TEST(Ssao, ASeedAlwaysMakesTheSameSets) {
  EXPECT_EQ(ssao::make_offsets(ssao::Directions::kRandom, 16, 0.5_d, false, false, 4),
            ssao::make_offsets(ssao::Directions::kRandom, 16, 0.5_d, false, false, 4));
  EXPECT_NE(ssao::make_offsets(ssao::Directions::kRandom, 16, 0.5_d, false, false, 4),
            ssao::make_offsets(ssao::Directions::kRandom, 16, 0.5_d, false, false, 5));
  EXPECT_EQ(ssao::make_reflections(4, 1), ssao::make_reflections(4, 1));
  EXPECT_NE(ssao::make_reflections(4, 1), ssao::make_reflections(4, 2));
}

}  // namespace
