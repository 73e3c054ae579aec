// SPDX-License-Identifier: Apache-2.0
// The hard cases of role bake_visibility, for every technique of it, against closed forms.
#include "baking.hpp"

#include "parsed.hpp"
#include "roles/readme.hpp"

namespace {

using namespace baking;

struct Technique {
  const char* name;
  std::vector<std::string> settings;  // beside the cases' own
};
class BakeVisibilityHardCases : public testing::TestWithParam<Technique> {
 protected:
  /// `settings`: the cases', of which hemicubes have no use for those of directions.
  Result run(Scene& scene, std::vector<std::string> settings) {
    if (is_hemicube()) std::erase_if(settings, [](const auto& one) { return one.rfind("directions=", 0) == 0; });
    settings.insert(settings.begin(), GetParam().settings.begin(), GetParam().settings.end());
    return bake(scene, GetParam().name, settings);
  }
  [[nodiscard]] bool is(const char* name) const { return std::string(GetParam().name) == name; }
  [[nodiscard]] bool is_hemicube() const { return is("hemicube"); }
  /// Those that look into depth maps of the whole scene, and so need a bias.
  [[nodiscard]] bool is_biased() const { return is("depth_maps"); }
};

double least(const Baked& baked) {
  double least = 1;
  for (const BakedValue& value : baked.values) least = std::min(least, static_cast<double>(value.visibility));
  return least;
}

TEST_P(BakeVisibilityHardCases, H1AConvexBodyIsOpenEverywhere) {
  const std::array<void (*)(Scene&), 2> bodies{
      [](Scene& scene) { scene.add_sphere(dvec3(0), 1, 16); },
      [](Scene& scene) { scene.add_box(dvec3(-1, -0.5, -2), dvec3(1, 0.5, 2)); },
  };
  for (std::size_t body = 0; body < bodies.size(); ++body) {
    Scene scene;
    bodies[body](scene);
    std::vector<std::string> settings{"elements=vertices", "directions=1024", "inset=0", "find_open=false"};
    if (is_biased()) settings.emplace_back("resolution=256");
    const Result clamped = run(scene, settings);
    std::size_t acne = 0;
    for (const BakedValue& value : clamped.baked.values) acne += value.visibility < 1 ? 1 : 0;
    RecordProperty("acne_share",
                   std::to_string(static_cast<double>(acne) / static_cast<double>(clamped.baked.values.size())));
    // Of the weight, (1/8)^2 is at slopes beyond the limit.
    EXPECT_GE(least(clamped.baked), 1 - 1.0 / 64) << body;
    if (!is_biased()) {
      // Rays and eyes start off their surface: vertices of a body that is faceted lose nothing either.
      EXPECT_EQ(least(clamped.baked), 1) << body;
      continue;
    }
    std::vector<std::string> unclamped = settings;
    unclamped.emplace_back("bias_limit=0");
    EXPECT_EQ(least(run(scene, unclamped).baked), 1) << body;
  }
}

TEST_P(BakeVisibilityHardCases, H2AClosedBoxIsClosedAwayFromItsEdges) {
  Scene scene;
  add_room(scene);
  const Result result = run(scene, {"spacing=0.25", "inset=0", "fill=false", "directions=256"});
  // The bias reaches 8 texels at most, of a view of 2 sqrt(3) m; and half a texel is the element's own.
  const double band = !is_biased() ? 1e-3 : 9.0 * 2 * std::sqrt(3.0) / 500;
  std::size_t inner = 0;
  for (const Point& p : points(result.baked, 0)) {
    dvec3 to_wall = dvec3(1) - glm::abs(p.position);
    std::sort(&to_wall.x, &to_wall.x + 3);
    if (to_wall.y <= band) continue;  // of the second wall; the first is its own
    ++inner;
    // A direction at the cosine h to the wall comes out of the map within a texel of its end, whose centre may lie
    // outside, if h < texel / t, where t >= d is how far the next wall is along it: of the weight at most (texel /
    // d)^2, and for so few directions one more than their share.
    const double grazing = 2 * std::sqrt(3.0) / 508 / to_wall.y;
    EXPECT_LE(p.visibility, !is_biased() ? 0 : grazing * grazing + grazing * 4 / 256)
        << p.position.x << ' ' << p.position.y << ' ' << p.position.z;
  }
  EXPECT_GE(inner, 6U * 49);
}

TEST_P(BakeVisibilityHardCases, H3ABallOverAPlaneCoversWhatItShould) {
  constexpr double kRadius = 0.4, kHeight = 0.7;
  Scene scene;
  scene.add_floor(dvec3(0), 2);
  // Hemicubes draw the ball five times an element: fewer of them, and of its triangles.
  scene.add_sphere(dvec3(0, kHeight, 0), kRadius, is_hemicube() ? 24 : 48);
  const Result result = run(scene, {is_hemicube() ? "spacing=0.4" : "spacing=0.13", "directions=1024"});
  double squares = 0, most = 0;
  std::size_t count = 0;
  for (const Point& p : points(result.baked, 0)) {
    if (std::max(std::abs(p.position.x), std::abs(p.position.z)) > 1.99) continue;  // its rim is inset
    const double d2 = glm::dot(p.position, p.position) + kHeight * kHeight;
    const double error = p.visibility - (1 - kRadius * kRadius / d2 * kHeight / std::sqrt(d2));
    squares += error * error;
    most = std::max(most, std::abs(error));
    ++count;
  }
  EXPECT_GT(count, is_hemicube() ? 200U : 500U);
  EXPECT_LT(std::sqrt(squares / static_cast<double>(count)), 0.006);
  EXPECT_LT(most, 0.02);
}

TEST_P(BakeVisibilityHardCases, H4ABowlIsHalfOpenInEveryPoint) {
  Scene scene;
  add_bowl(scene, 1, 0.5 * rendering::kPi, is_hemicube() ? 12 : 24);
  const Result result = run(scene, {"elements=vertices", "directions=1024", "inset=0", "fill=false"});
  double sum = 0, squares = 0;
  std::size_t count = 0;
  for (const Point& p : points(result.baked, 0)) {
    if (p.position.y > -0.02) continue;  // two texels of the rim
    sum += p.visibility;
    squares += p.visibility * p.visibility;
    ++count;
  }
  const double mean = sum / static_cast<double>(count);
  EXPECT_NEAR(mean, 0.5, 0.005);
  EXPECT_LT(std::sqrt(std::max(squares / static_cast<double>(count) - mean * mean, 0.0)), 0.01);
}

TEST_P(BakeVisibilityHardCases, H5AWallCoversHalfOfWhatItsElevationDoes) {
  // A wall of half width w and height h at the distance x from points in front of its middle covers
  // (atan(w / x) - x / sqrt(x^2 + h^2) atan(w / sqrt(x^2 + h^2))) / pi: for w without end (1 - cos theta) / 2.
  constexpr double kHalf = 2;
  for (const double height : {0.5, 2.0}) {
    Scene scene;
    scene.add_floor(dvec3(0, 0, 1), 1);
    scene.add_box(dvec3(-kHalf, 0, -0.2), dvec3(kHalf, height, 0));
    const Result result = run(scene, {is_hemicube() ? "spacing=0.26" : "spacing=0.13", "directions=1024", "inset=0"});
    std::size_t count = 0;
    for (const Point& p : points(result.baked, 0)) {
      const double x = p.position.z + 1;
      if (std::abs(p.position.x) > 1e-3 || x < 0.05) continue;
      const double r = std::sqrt(x * x + height * height);
      const double covered = (std::atan(kHalf / x) - x / r * std::atan(kHalf / r)) / rendering::kPi;
      EXPECT_NEAR(p.visibility, 1 - covered, 0.01) << "height " << height << ", x " << x;
      ++count;
    }
    EXPECT_GT(count, 5U);
  }
}

TEST_P(BakeVisibilityHardCases, H6WhatIsDegenerateGivesNumbers) {
  Scene scene;
  scene.add_floor(dvec3(0), 1);
  // One proper triangle, one without area, one that is a point; a vertex's normal is zero.
  scene.add_mesh({0, 1, 0, 1, 1, 0, 0, 1, 1, 2, 1, 0, 3, 1, 0, 5, 5, 5},
                 {0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0}, {0, 2, 1, 1, 3, 4, 5, 5, 5}, dmat4(1.0));
  scene.add_mesh({0, 0, 0, 1, 0, 0, 0, 0, 1}, {0, 1, 0, 0, 1, 0, 0, 1, 0}, {0, 2, 1},
                 glm::scale(dmat4(1.0), dvec3(0.0)));
  const Result result = run(scene, {"spacing=0.5", "directions=64"});
  for (const BakedValue& value : result.baked.values) {
    EXPECT_TRUE(std::isfinite(value.visibility));
    EXPECT_GE(value.visibility, 0);
    EXPECT_LE(value.visibility, 1);
  }
}

TEST_P(BakeVisibilityHardCases, H7TheSameBakeTwiceGivesTheSameBytes) {
  Scene scene;
  scene.add_floor(dvec3(0), 2);
  scene.add_box(dvec3(-0.5, 0, -0.5), dvec3(0.5, 1, 0.5));
  const std::vector<std::string> settings{"spacing=0.5", "directions=128"};
  const Result once = run(scene, settings);
  const Result found = run(scene, settings);
  EXPECT_EQ(once.origin, "made");
  EXPECT_EQ(found.origin, "cache");
  EXPECT_EQ(once.bytes, found.bytes);
  forget_all();
  const Result again = run(scene, settings);
  EXPECT_EQ(again.origin, "made");
  EXPECT_EQ(once.bytes, again.bytes);
}

TEST_P(BakeVisibilityHardCases, SayWhereTheirSpacingIsNotKept) {
  Scene scene;
  scene.add_floor(dvec3(0), 1);  // 2 m a side, so that diagonals are sqrt(8) m
  scene.add_mesh({0, 5, 0, 300, 5, 0, 0, 5, 400}, {0, -1, 0, 0, -1, 0, 0, -1, 0}, {0, 1, 2}, dmat4(1.0));
  if (!is_hemicube()) {  // for which these are 40000 drawings
    const Result kept = run(scene, {"spacing=4", "directions=1"});
    EXPECT_EQ(kept.report["reached"], 500.0 / 128) << "powers of two";
    EXPECT_EQ(kept.remarks, "");
  }
  const Result wide = run(scene, {"spacing=0.5", "directions=1"});
  EXPECT_EQ(wide.report["spacing"], 0.5);
  EXPECT_EQ(wide.report["reached"], 500.0 / 128);
  EXPECT_EQ(
      wide.remarks,
      "elements of 1 of 2 meshes are further apart than 0.5 m: up to 3.90625 m, on mesh 1, as a side of a triangle "
      "has at most 128 steps: split its largest triangles, or raise spacing\n");
}

TEST_P(BakeVisibilityHardCases, SayThatNothingWasBaked) {
  Scene scene;
  const Result result = run(scene, {"directions=1"});
  EXPECT_EQ(result.report["elements"], 0);
  EXPECT_EQ(result.remarks.rfind("nothing was baked", 0), 0U) << result.remarks;
}

TEST_P(BakeVisibilityHardCases, HaveTheParametersThatTheirReadmesSay) {
  const char* text = nullptr;
  check(heddle_list(rendering::Host::get().handle, &text));
  const std::string id = std::string("bake_visibility/") + GetParam().name;
  const std::string table = rendering::parameter_table(parsed::json(text), id);
  EXPECT_NE(rendering::readme_of(id).find(table), std::string::npos) << table;
  EXPECT_FALSE(table.empty());
}

INSTANTIATE_TEST_SUITE_P(Techniques, BakeVisibilityHardCases,
                         testing::Values(Technique{"depth_maps", {"resolution=512"}}, Technique{"ray_traced", {}},
                                         Technique{"hemicube", {}}),
                         [](const auto& one) { return std::string(one.param.name); });

}  // namespace
