// SPDX-License-Identifier: Apache-2.0
// Parts of bakes: which an edit of the scene leaves as they are, which nothing can occlude, and which settle.
#include "baking.hpp"

#include <fmt/format.h>

namespace {

using namespace baking;

struct House {
  dvec3 toy{0, 1, 0};  // its centre
  double table = 2;    // height
  float grey = 0.5F;
};

/// 0 a floor, 1 a wall beside it, 2 a shelf, facing up, 3 a roof, facing up, above all, 4 a toy box under the shelf.
void build(Scene& scene, const House& house) {
  HeddleMaterial material = Scene::grey();
  material.base_color[0] = house.grey;
  scene.use_material(material);
  scene.add_floor(dvec3(0), 4);
  scene.add_box(dvec3(-4, 0, -4), dvec3(-3.8, 4, 4));
  scene.add_floor(dvec3(0, 3.9, 0), 1.5);
  scene.add_floor(dvec3(0, 4.5, 0), 1);
  scene.add_box(house.toy - 0.25, house.toy + 0.25);
}

Result bake_house(const std::string& technique, const House& house, const std::vector<std::string>& more) {
  Scene scene;
  build(scene, house);
  std::vector<std::string> settings{"spacing=1", "resolution=64"};
  if (technique == "hemicube") settings = {"spacing=1", "resolution=8"};
  if (technique == "ray_traced") settings = {"spacing=1", "directions=64"};
  if (technique == "depth_maps") settings.emplace_back("directions=64");
  settings.insert(settings.end(), more.begin(), more.end());
  return bake(scene, technique, settings);
}

double work_of(const Result& result) {
  return result.report[result.report.contains("pairs") ? "pairs" : "faces"].get<double>();
}

class BakedParts : public testing::TestWithParam<std::pair<const char*, std::vector<std::string>>> {};

TEST_P(BakedParts, AnEditBakesOnlyWhatDependsOnItAnew) {
  const auto& [technique, more] = GetParam();
  forget_all();
  const Result first = bake_house(technique, {}, more);
  EXPECT_EQ(first.origin, "made");
  EXPECT_EQ(first.report["parts"], 1 + 6 + 1 + 1 + 6);
  EXPECT_EQ(first.report["parts_known"], 0);
  EXPECT_EQ(first.report["parts_open"], 1) << "the roof";
  EXPECT_GT(work_of(first), 0);

  // The toy moves: it is above the floor and in front of the wall, and nothing to the shelf and the wall's other sides.
  House moved;
  moved.toy = dvec3(1, 1.5, 0.5);
  const Result edited = bake_house(technique, moved, more);
  EXPECT_EQ(edited.origin, "made");
  EXPECT_EQ(edited.report["parts_known"], 1 + 5);
  EXPECT_EQ(edited.report["parts_open"], 1);
  EXPECT_LT(work_of(edited), 0.75 * work_of(first));
  EXPECT_NE(edited.bytes, first.bytes);

  // Colours occlude nothing: all is as it was, and there is nothing to do.
  House painted = moved;
  painted.grey = 0.9F;
  const Result repainted = bake_house(technique, painted, more);
  EXPECT_EQ(repainted.origin, "made");
  EXPECT_EQ(repainted.report["parts_known"], 14);
  EXPECT_EQ(work_of(repainted), 0);
  EXPECT_EQ(repainted.report.value("maps", 0), 0) << "nothing is drawn";
  EXPECT_EQ(repainted.bytes, edited.bytes);

  // Back to where it was.
  painted.toy = House{}.toy;
  const Result back = bake_house(technique, painted, more);
  EXPECT_EQ(back.report["parts_known"], 14);
  EXPECT_EQ(back.bytes, first.bytes);

  // As if nothing had been known.
  forget_all();
  const Result whole = bake_house(technique, moved, more);
  EXPECT_EQ(whole.report["parts_known"], 0);
  EXPECT_EQ(whole.bytes, edited.bytes);
}

INSTANTIATE_TEST_SUITE_P(Techniques, BakedParts,
                         testing::Values(std::pair("depth_maps", std::vector<std::string>{}),
                                         std::pair("depth_maps", std::vector<std::string>{"pipeline=split_ramp"}),
                                         std::pair("depth_maps", std::vector<std::string>{"pipeline=cpu_compare",
                                                                                          "depth_format=d16"}),
                                         std::pair("depth_maps", std::vector<std::string>{"settled=0.1"}),
                                         std::pair("ray_traced", std::vector<std::string>{}),
                                         std::pair("hemicube", std::vector<std::string>{})),
                         [](const auto& one) {
                           std::string name = one.param.first;
                           for (const std::string& more : one.param.second) name += "_" + more;
                           std::ranges::replace_if(
                               name, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; }, '_');
                           return name;
                         });

TEST(BakedPartsThatNothingOccludes, AreNotLookedAt) {
  for (const char* technique : {"depth_maps", "ray_traced", "hemicube"}) {
    Scene scene;
    scene.add_box(dvec3(-1, -0.5, -2), dvec3(1, 0.5, 2));
    scene.add_sphere(dvec3(0, 0, 9), 0.4, 12);  // before the box's one end
    std::vector<std::string> settings{"elements=vertices", "inset=0"};
    if (std::string(technique) != "hemicube") settings.emplace_back("directions=64");
    forget_all();
    const Result found = bake(scene, technique, settings);
    forget_all();
    settings.emplace_back("find_open=false");
    const Result looked = bake(scene, technique, settings);
    EXPECT_EQ(looked.report["parts_open"], 0);
    // All sides but the one before which the ball is, and all of the ball's that no plane of which meets the box: its
    // far one.
    EXPECT_EQ(found.report["parts_open"], 5 + 1) << technique;
    EXPECT_LT(work_of(found), work_of(looked));
    ASSERT_EQ(found.baked.values.size(), looked.baked.values.size());
    for (std::size_t v = 0; v < found.baked.values.size(); ++v)
      // What is open is so exactly, where a bias that has a limit may lose (1/8)^2.
      EXPECT_GE(found.baked.values[v].visibility, looked.baked.values[v].visibility) << technique << ' ' << v;
  }
}

TEST(BakedPartsThatAreNotConvex, AreLookedAt) {
  for (const char* technique : {"depth_maps", "ray_traced", "hemicube"}) {
    Scene bowl;
    add_bowl(bowl, 1, 0.5 * rendering::kPi, 6);
    const Result result = bake(bowl, technique, {"elements=vertices", "inset=0"});
    EXPECT_EQ(result.report["parts_open"], 0) << technique;
  }
}

TEST(BakedPartsThatSettle, SaveDirectionsAndErrByLessThanTheirBoundInTheMean) {
  Scene scene;
  scene.add_floor(dvec3(0), 4);
  for (int x = -1; x <= 1; ++x)
    for (int z = -1; z <= 1; ++z)
      scene.add_box(dvec3(2 * x - 0.5, 0, 2 * z - 0.5), dvec3(2 * x + 0.5, 1 + 0.3 * (x + 1) + 0.1 * z, 2 * z + 0.5));
  const std::vector<std::string> settings{"spacing=1", "resolution=128", "directions=1024", "fill=false"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.end(), settings.begin(), settings.end());
    return bake(scene, "depth_maps", more);
  };
  const Result whole = with({});
  double before = work_of(whole);
  for (const double most : {0.01, 0.03, 0.1}) {
    const std::string bound = fmt::format("settled={}", most);
    const Result floats = with({bound}), cpu = with({bound, "pipeline=cpu_compare"});
    double worst = 0, squares = 0;
    for (std::size_t v = 0; v < whole.baked.values.size(); ++v) {
      const double error = std::abs(static_cast<double>(floats.baked.values[v].visibility) -
                                    static_cast<double>(whole.baked.values[v].visibility));
      worst = std::max(worst, error);
      squares += error * error;
    }
    const double rms = std::sqrt(squares / static_cast<double>(whole.baked.values.size()));
    fmt::print("settled {}: {} of {} parts, {:.0f} % of pairs, {} looks; rms {:.4f}, most {:.4f}\n", most,
               floats.report["parts_settled"].dump(), floats.report["parts"].dump(),
               100 * work_of(floats) / work_of(whole), floats.report["read_backs"].dump(), rms, worst);
    EXPECT_GT(floats.report["parts_settled"], 0);
    EXPECT_LT(work_of(floats), before);
    before = work_of(floats);
    // A change of less says little of a single element: what its next directions meet may be at rims. But most of a
    // part's elements change less than the one that changes most.
    EXPECT_LT(rms, 0.5 * most);
    EXPECT_LT(worst, 4 * most);
    // Whoever adds up settles at the same looks, but for what float32 rounds.
    EXPECT_NEAR(work_of(cpu), work_of(floats), 0.02 * work_of(whole));
  }
}

}  // namespace
