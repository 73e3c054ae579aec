// SPDX-License-Identifier: Apache-2.0
// bake_visibility/hemicube: its weights against the integrals that they are, its faces, and what it costs.
#include "baking.hpp"

#include "hemicube.hpp"

#include <fmt/format.h>

#include <numeric>

namespace {

using namespace baking;

TEST(Hemicube, WeightsOfAllPixelsAddUpToOne) {
  for (const std::uint32_t side : {4U, 8U, 32U, 256U}) {
    const std::vector<double> weights = hemicube::weights(side);
    ASSERT_EQ(weights.size(), std::size_t{3} * side * side);
    // Differences of numbers below 1/4, and as many of them: at most 2^-53 each.
    const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
    EXPECT_NEAR(sum, 1, static_cast<double>(weights.size()) * 0x1p-53) << side;
    EXPECT_GT(*std::min_element(weights.begin(), weights.end()), 0) << side;
  }
}

TEST(Hemicube, AWeightIsTheIntegralOfTheCosineOverItsPixel) {
  constexpr std::uint32_t kSide = 8;
  constexpr int kSteps = 64;  // midpoints: within (1 / (8 * 64))^2 of a smooth integrand
  const std::vector<double> weights = hemicube::weights(kSide);
  const auto faces = hemicube::faces(kSide);
  for (const hemicube::Face& face : faces)
    for (std::uint32_t j = 0; j < face.height; ++j)
      for (std::uint32_t i = 0; i < kSide; ++i) {
        double sum = 0;
        for (int b = 0; b < kSteps; ++b)
          for (int a = 0; a < kSteps; ++a) {
            const double step = 2.0 / kSide, x = -1 + (i + (a + 0.5) / kSteps) * step;
            const double y = 1 - (j + (b + 0.5) / kSteps) * step;
            const dvec3 at = face.forward + x * face.right + y * face.up;
            // dw = dA cos / r^2 on the face, times the cosine at the element, over pi.
            const double r2 = glm::dot(at, at);
            sum += at.z / (rendering::kPi * r2 * r2) * step * step / (kSteps * kSteps);
          }
        const double weight = weights[(face.first_row + j) * kSide + i];
        EXPECT_NEAR(weight / sum, 1, 1e-4) << face.first_row << ' ' << i << ' ' << j;
      }
}

TEST(Hemicube, FacesAreRightHandedAndAxesOrthonormal) {
  for (const hemicube::Face& face : hemicube::faces(16))
    EXPECT_LT(glm::length(glm::cross(face.right, face.up) + face.forward), 1e-15);
  for (const dvec3& n : {dvec3(0, 0, 1), dvec3(0, 0, -1), dvec3(1, 0, 0), glm::normalize(dvec3(-1, 2, -3))})
    for (const double angle : {0.0, 1.0, 4.0}) {
      const glm::dmat3 axes = hemicube::axes(n, angle);
      EXPECT_LT(glm::length(glm::cross(axes[0], axes[1]) - n), 1e-14);
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) EXPECT_NEAR(glm::dot(axes[i], axes[j]), i == j ? 1 : 0, 1e-14);
    }
}

/// A board above a floor, and a wall beside it: something in every face.
void add_corner(Scene& scene) {
  scene.add_floor(dvec3(0), 1);
  scene.add_box(dvec3(-1, 0, -1.2), dvec3(1, 1, -1));
  scene.add_box(dvec3(-0.2, 0.5, -0.6), dvec3(0.6, 0.55, 0.4));
}

TEST(Hemicube, NearsWhatRaysSeeTheMorePixelsItHas) {
  Scene scene;
  add_corner(scene);
  const std::vector<std::string> settings{"spacing=0.3", "fill=false"};
  std::vector<std::string> traced = settings;
  traced.emplace_back("directions=32768");
  const Result truth = bake(scene, "ray_traced", traced);
  std::map<std::pair<int, bool>, double> error;
  for (const bool is_turned : {false, true})
    for (const int side : {8, 16, 32, 64}) {
      std::vector<std::string> own = settings;
      own.push_back(fmt::format("resolution={}", side));
      own.push_back(is_turned ? "turned=true" : "turned=false");
      const Result result = bake(scene, "hemicube", own);
      double squares = 0, bent = 0;
      std::size_t count = 0;
      for (std::uint32_t instance = 0; instance < 3; ++instance) {
        const std::vector<Point> ours = points(result.baked, instance), rays = points(truth.baked, instance);
        ASSERT_EQ(ours.size(), rays.size());
        for (std::size_t p = 0; p < ours.size(); ++p, ++count) {
          squares += std::pow(ours[p].visibility - rays[p].visibility, 2);
          if (rays[p].visibility > 0.25) bent = std::max(bent, glm::length(ours[p].bent - rays[p].bent));
        }
      }
      const double rms = std::sqrt(squares / static_cast<double>(count));
      error[{side, is_turned}] = rms;
      fmt::print("side {:3} {:8}: rms {:.5f}, bent normals within {:.4f}\n", side, is_turned ? "turned" : "", rms,
                 bent);
      // A pixel stands for directions that are up to 1 / side from its middle.
      EXPECT_LT(bent, 1.0 / side);
    }
  // Rims through 4 pixels a row: an error of one pixel's share a row, independent of each other, is side^-1.5.
  for (const bool is_turned : {false, true}) {
    const double slope = std::log(error[{64, is_turned}] / error[{8, is_turned}]) / std::log(8.0);
    fmt::print("slope {:.2f}\n", slope);
    EXPECT_LT(slope, -0.8);
  }
  EXPECT_LT((error[{32, true}]), 0.003);
}

TEST(Hemicube, ManyElementsShareASubmissionAndLeaveTheSameBytes) {
  Scene scene;
  add_corner(scene);
  // Every element is looked at, none is known from an earlier bake.
  const std::vector<std::string> settings{"spacing=0.3", "resolution=8", "find_open=false"};
  Result first;
  for (const int batch : {1024, 100, 7}) {
    std::vector<std::string> own = settings;
    own.push_back(fmt::format("batch={}", batch));
    forget_all();
    Result result = bake(scene, "hemicube", own);
    const double elements = result.report["elements"].get<double>();
    EXPECT_EQ(result.report["faces"], 5 * elements);
    EXPECT_EQ(result.report["submissions"], std::ceil(elements / std::min<double>(batch, elements)));
    if (batch == 1024)
      first = std::move(result);
    else
      EXPECT_EQ(result.bytes, first.bytes) << batch;
  }
}

}  // namespace
