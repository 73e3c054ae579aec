// SPDX-License-Identifier: Apache-2.0
// Relief that elements have beside their mesh's: of normal maps, against closed forms.
#include "baking.hpp"

namespace {

using namespace baking;

struct DetailTechnique {
  const char* name;
  std::vector<std::string> settings;
};
class BakedDetail : public testing::TestWithParam<DetailTechnique> {
 protected:
  static Result run(Scene& scene, std::vector<std::string> settings) {
    settings.insert(settings.begin(), GetParam().settings.begin(), GetParam().settings.end());
    return bake(scene, GetParam().name, settings);
  }
  static bool has_mean() { return std::ranges::count(GetParam().settings, "pipeline=split_ramp") == 0; }
};

/// A normal map of one texel, which leans by (x, y) along tangent and bitangent; where it leans, as its bytes say.
dvec3 use_leaning_map(Scene& scene, double x, double y) {
  const auto code = [](double v) { return static_cast<std::uint8_t>(std::lround((v * 0.5 + 0.5) * 255)); };
  const std::array<std::uint8_t, 4> texel{code(x), code(y), code(std::sqrt(1 - x * x - y * y)), 255};
  heddle_texture texture{};
  texture.struct_size = sizeof texture;
  texture.width = texture.height = 1;
  texture.rgba = texel.data();
  std::uint32_t id = 0;
  check(heddle_scene_add_texture(scene.handle, nullptr, &texture, &id));
  scene.use_material(Scene::grey(), HEDDLE_NONE, id);
  return glm::normalize(dvec3(texel[0], texel[1], texel[2]) / 127.5 - 1.0);
}
/// A floor of half size 1, u along its x, v along -z, so that tangent, bitangent and normal are x, z and y in glTF's
/// handedness.
void add_mapped_floor(Scene& scene, const dmat4& place) {
  scene.add_mesh({-1, 0, -1, -1, 0, 1, 1, 0, 1, 1, 0, -1}, {}, {0, 1, 2, 0, 2, 3}, place, {0, 1, 0, 0, 1, 0, 1, 1});
}

TEST_P(BakedDetail, ANormalThatLeansLosesWhatItsOwnSurfaceHides) {
  for (const char* elements : {"elements=lattice", "elements=texels"}) {
    Scene scene;
    const dvec3 lean = use_leaning_map(scene, 0.6, 0.0);
    add_mapped_floor(scene, dmat4(1.0));
    const std::vector<std::string> settings{elements, "spacing=0.5"};
    const Result plain = run(scene, settings);
    EXPECT_EQ(plain.report["mapped"], 0);
    for (const BakedValue& value : plain.baked.values) EXPECT_EQ(value.visibility, 1);
    std::vector<std::string> mapped = settings;
    mapped.emplace_back("detail=normal_map");
    // Along a normal that leans, grazing directions weigh more, in which a bias with a limit is too small.
    if (std::string(GetParam().name) == "depth_maps") mapped.emplace_back("bias_limit=0");
    const Result leaning = run(scene, mapped);
    EXPECT_EQ(leaning.report["mapped"], leaning.report["elements"]);
    EXPECT_EQ(leaning.report["parts_open"], 0) << "its own surface occludes";
    // Of the cosine-weighted hemisphere of a normal, what lies above a plane that leans by theta against it.
    const double expected = (1 + lean.z) / 2;
    for (const BakedValue& value : leaning.baked.values) EXPECT_NEAR(value.visibility, expected, 0.008) << elements;
  }
}

/// How far the mean of the directions above a plane leans, weighed by a normal that leans by `sine`: its part along the
/// plane, by a sum over the hemisphere.
double mean_lean(double sine) {
  constexpr int kSteps = 400;
  dvec3 sum(0);
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < kSteps; ++j) {
      const double z = (i + 0.5) / kSteps, phi = 2 * rendering::kPi * (j + 0.5) / kSteps, r = std::sqrt(1 - z * z);
      const dvec3 s(r * std::cos(phi), r * std::sin(phi), z);
      sum += std::max(sine * s.x + std::sqrt(1 - sine * sine) * s.z, 0.0) * s;
    }
  return sum.x / glm::length(sum);
}

TEST_P(BakedDetail, NormalsLeanAsTheInstanceStands) {
  // Leans along the bitangent, whose sense a mirror turns around: what is open leans the same way.
  const dmat4 turned = glm::rotate(dmat4(1.0), 0.7, glm::normalize(dvec3(1, 2, 0.5)));
  const std::array<dmat4, 3> places{dmat4(1.0), turned, turned * glm::scale(dmat4(1.0), dvec3(-2, 1, 1.5))};
  for (const dmat4& place : places) {
    Scene scene;
    const double sine = use_leaning_map(scene, 0.0, 0.6).y;
    add_mapped_floor(scene, place);
    const Result leaning = run(scene, {"spacing=1", "detail=normal_map"});
    const dvec3 along = glm::normalize(dvec3(place * glm::dvec4(0, 0, -1, 0)));  // where v grows
    const dvec3 across = glm::normalize(dvec3(place * glm::dvec4(1, 0, 0, 0)));
    for (const BakedValue& value : leaning.baked.values) {
      const auto bent = unpack_direction(value.bent);
      const dvec3 open(bent[0], bent[1], bent[2]);
      // glTF's bitangents point to where v falls. Pipelines of 8 bits have the normal in place of the mean.
      // The limit of the bias takes some of what grazes.
      EXPECT_NEAR(glm::dot(open, along), has_mean() ? -mean_lean(sine) : -sine, 0.03);
      EXPECT_NEAR(glm::dot(open, across), 0, 0.01);
    }
  }
}

TEST_P(BakedDetail, VisibilityIsTheMeshsOwn) {
  // A wall behind a normal that leans away from it, and one in front of a normal that leans towards it: by the closed
  // form for endless walls, of whose directions the normal's weight is another one in each case.
  constexpr double kHalf = 4, kHeight = 1, kDistance = 0.5;
  std::array<double, 2> seen{};
  for (const double side : {-1.0, 1.0}) {
    Scene scene;
    use_leaning_map(scene, 0.5 * side, 0.0);
    add_mapped_floor(scene, glm::scale(dmat4(1.0), dvec3(1e-3)));
    scene.use_material(Scene::grey());
    scene.add_box(dvec3(kDistance, -1, -kHalf), dvec3(kDistance + 0.1, kHeight, kHalf));
    const Result result = run(scene, {"spacing=1", "inset=0", "detail=normal_map", "fill=false"});
    // In the plane across the wall an endless one leaves open what is above its rim, at the angle e; of a normal at the
    // angle t from the zenith towards the wall, cosine-weighted: the part from the floor's far horizon to the rim.
    const double t = std::asin(0.5) * side, e = std::atan(kHeight / kDistance);
    const auto upto = [&](double angle) { return 0.5 * std::sin(angle - t); };  // of directions' angles from the zenith
    // Directions that the normal sees end 90 degrees from it; the floor's own horizon ends them at -90.
    const double far = std::max(-rendering::kPi / 2, t - rendering::kPi / 2);
    const double expected = upto(rendering::kPi / 2 - e) - upto(far);
    const double value = static_cast<double>(result.baked.values.at(result.baked.instances[0].first_value).visibility);
    EXPECT_NEAR(value, expected, 0.015) << side;
    seen[side > 0 ? 1 : 0] = value;
  }
  EXPECT_GT(seen[0], seen[1] + 0.2) << "what leans towards the wall sees more of it";
}

/// Which of two shapes are there.
std::string chosen(const char* show) {
  return std::string("[[pass]]\nrole = \"mesh_detail\"\ntechnique = \"chosen\"\nparams.show = \"") + show + "\"\n";
}
void set_fine(Scene& scene, std::uint32_t fine, std::uint32_t coarse) {
  check(heddle_scene_set_component(scene.handle, HEDDLE_OWNER_INSTANCE, fine, "mesh_detail.fine",
                                   ("{\"of\": " + std::to_string(coarse) + "}").c_str()));
}

/// A ball of radius 1 with bumps all over: directions by angle from +Y, and around it.
constexpr double kBumps = 0.15;
dvec3 outward(double theta, double phi) {
  return {std::sin(theta) * std::sin(phi), std::cos(theta), std::sin(theta) * std::cos(phi)};
}
dvec3 bumpy(double theta, double phi) {
  // Flat at the poles, where all angles meet.
  return outward(theta, phi) *
         (1 + kBumps * std::sin(theta) * std::sin(theta) * std::sin(8 * phi) * std::sin(8 * theta));
}
dvec3 bumpy_normal(double theta, double phi) {
  constexpr double kStep = 1e-4;
  const double at = std::clamp(theta, 1e-3, rendering::kPi - 1e-3);
  return glm::normalize(
      glm::cross(bumpy(at + kStep, phi) - bumpy(at - kStep, phi), bumpy(at, phi + kStep) - bumpy(at, phi - kStep)));
}
void add_ball(Scene& scene, std::uint32_t rings, bool has_bumps) {
  std::vector<float> positions, normals, uvs;
  std::vector<std::uint32_t> indices;
  const std::uint32_t sectors = 2 * rings;
  for (std::uint32_t i = 0; i <= rings; ++i)
    for (std::uint32_t j = 0; j <= sectors; ++j) {
      const double v = static_cast<double>(i) / rings, u = static_cast<double>(j) / sectors;
      const double theta = rendering::kPi * v, phi = 2 * rendering::kPi * u;
      const dvec3 p = has_bumps ? bumpy(theta, phi) : outward(theta, phi);
      const dvec3 n = has_bumps ? bumpy_normal(theta, phi) : outward(theta, phi);
      for (int c = 0; c < 3; ++c) {
        positions.push_back(static_cast<float>(p[c]));
        normals.push_back(static_cast<float>(n[c]));
      }
      uvs.insert(uvs.end(), {static_cast<float>(u), static_cast<float>(v)});
      if (i == rings || j == sectors) continue;
      const std::uint32_t a = i * (sectors + 1) + j, b = a + sectors + 1;
      indices.insert(indices.end(), {a, b, b + 1, a, b + 1, a + 1});
    }
  scene.add_mesh(positions, normals, indices, dmat4(1.0), uvs);
}
/// Instance 0: the smooth ball with a normal map of the bumpy one, which is instance 1.
void build_balls(Scene& scene) {
  constexpr std::uint32_t kSide = 64;
  std::vector<std::uint8_t> texels;
  for (std::uint32_t y = 0; y < kSide; ++y)
    for (std::uint32_t x = 0; x < kSide; ++x) {
      const double theta = rendering::kPi * (y + 0.5) / kSide, phi = 2 * rendering::kPi * (x + 0.5) / kSide;
      const dvec3 n = bumpy_normal(theta, phi), around(std::cos(phi), 0, -std::sin(phi));
      const dvec3 up = glm::cross(outward(theta, phi), around);
      for (const double part : {glm::dot(n, around), glm::dot(n, up), glm::dot(n, outward(theta, phi))})
        texels.push_back(static_cast<std::uint8_t>(std::lround((part * 0.5 + 0.5) * 255)));
      texels.push_back(255);
    }
  heddle_texture texture{};
  texture.struct_size = sizeof texture;
  texture.width = texture.height = kSide;
  texture.rgba = texels.data();
  std::uint32_t id = 0;
  check(heddle_scene_add_texture(scene.handle, nullptr, &texture, &id));
  scene.use_material(Scene::grey(), HEDDLE_NONE, id);
  add_ball(scene, 12, false);
  scene.use_material(Scene::grey());
  add_ball(scene, 48, true);
  set_fine(scene, 1, 0);
}

double rms(const Result& a, const Result& b) {
  EXPECT_EQ(a.baked.values.size(), b.baked.values.size());
  double squares = 0;
  for (std::size_t v = 0; v < a.baked.values.size(); ++v)
    squares += std::pow(static_cast<double>(a.baked.values[v].visibility - b.baked.values[v].visibility), 2);
  return std::sqrt(squares / static_cast<double>(a.baked.values.size()));
}

TEST(BakedFineDetail, CarriedOverErrsLessThanNormalMapsAndThoseLessThanNothing) {
  Scene scene;
  build_balls(scene);
  const std::vector<std::string> texels{"elements=texels", "spacing=0.055", "inset=0"};
  const auto with = [&](std::vector<std::string> settings, const std::vector<std::string>& more) {
    settings.insert(settings.end(), texels.begin(), texels.end());
    settings.insert(settings.end(), more.begin(), more.end());
    return settings;
  };
  const Result truth =
      bake(scene, "ray_traced", with({"directions=2048"}, {"detail=fine_points", "reach=0.25"}), chosen("fine"));
  EXPECT_EQ(truth.report["refined"], truth.report["elements"]);
  EXPECT_EQ(truth.report["missed"], 0);
  for (const auto& [technique, settings] :
       {std::pair("ray_traced", std::vector<std::string>{"directions=512"}),
        std::pair("depth_maps", std::vector<std::string>{"directions=512", "resolution=512"})}) {
    const Result plain = bake(scene, technique, with(settings, {}), chosen("coarse"));
    const Result mapped = bake(scene, technique, with(settings, {"detail=normal_map"}), chosen("coarse"));
    const Result carried =
        bake(scene, technique, with(settings, {"detail=fine_vertices", "reach=0.25"}), chosen("fine"));
    const Result placed = bake(scene, technique, with(settings, {"detail=fine_points", "reach=0.25"}), chosen("fine"));
    const double of_plain = rms(plain, truth), of_mapped = rms(mapped, truth), of_carried = rms(carried, truth);
    const double of_placed = rms(placed, truth);
    std::printf("%s: RMS without detail %.4f, by normal map %.4f, from fine vertices %.4f, at fine points %.4f\n",
                technique, of_plain, of_mapped, of_carried, of_placed);
    EXPECT_LT(of_carried, 0.5 * of_mapped) << technique;
    EXPECT_LT(of_mapped, of_plain) << technique;
    EXPECT_LT(of_placed, of_carried) << technique;
    // As many questions as the fine mesh has vertices, whatever the texels are.
    EXPECT_EQ(carried.report["elements"], 49 * 97);
    EXPECT_EQ(placed.report["elements"], truth.report["elements"]);
    // A frame that shows the coarse ball has nothing to look up of the fine one.
    EXPECT_EQ(carried.baked.instances.at(1).kind, kNothing);
    EXPECT_EQ(carried.baked.values.size(), plain.baked.values.size());
  }
}

/// A floor of half size 1 as two triangles, the same as a grid of steps of 1/4, and a box that stands on both.
void build_floors(Scene& scene, double height_of_fine) {
  add_mapped_floor(scene, dmat4(1.0));
  std::vector<float> positions;
  std::vector<std::uint32_t> indices;
  for (std::uint32_t i = 0; i <= 8; ++i)
    for (std::uint32_t j = 0; j <= 8; ++j) {
      positions.insert(positions.end(), {static_cast<float>(j) / 4 - 1, 0.0F, static_cast<float>(i) / 4 - 1});
      if (i == 8 || j == 8) continue;
      const std::uint32_t a = 9 * i + j;
      indices.insert(indices.end(), {a, a + 9, a + 10, a, a + 10, a + 1});
    }
  std::vector<float> normals;
  for (std::size_t v = 0; v < positions.size() / 3; ++v) normals.insert(normals.end(), {0, 1, 0});
  scene.add_mesh(positions, normals, indices, glm::translate(dmat4(1.0), dvec3(0, height_of_fine, 0)));
  scene.add_box(dvec3(-0.3, -0.2, -0.3), dvec3(0.3, 0.5, 0.3));
  set_fine(scene, 1, 0);
}

TEST(BakedFineDetail, WhatIsBuriedDarkensNoNeighbours) {
  Scene scene;
  build_floors(scene, 0.01);
  const auto run = [&](const char* technique, const char* detail, const char* fill) {
    std::vector<std::string> settings{"elements=texels", "spacing=0.05", "inset=0", detail, fill};
    if (std::string(technique) != "hemicube") settings.emplace_back("directions=256");
    return bake(scene, technique, settings, chosen("fine"));
  };
  const Result truth = run("ray_traced", "detail=fine_points", "fill=false");
  for (const char* technique : {"ray_traced", "depth_maps", "hemicube"}) {
    std::array<double, 2> squares{};
    std::size_t count = 0;
    const Result bare = run(technique, "detail=fine_vertices", "fill=false");
    const Result filled = run(technique, "detail=fine_vertices", "fill=true");
    const BakedInstance& tile = truth.baked.instances.at(0);
    for (std::uint32_t y = 0; y < tile.height; ++y)
      for (std::uint32_t x = 0; x < tile.width; ++x) {
        const double far =
            std::max(std::abs((x + 0.5) / tile.width * 2 - 1), std::abs((y + 0.5) / tile.height * 2 - 1));
        if (far < 0.33 || far > 0.5) continue;  // beside the box, between vertices under it and in front of it
        const std::size_t value = tile.first_value + y * tile.width + x;
        const auto error = [&](const Result& result) {
          return static_cast<double>(result.baked.values[value].visibility - truth.baked.values[value].visibility);
        };
        squares[0] += error(bare) * error(bare);
        squares[1] += error(filled) * error(filled);
        ++count;
      }
    ASSERT_GT(count, 100U);
    std::printf("%s: RMS beside a box with buried vertices %.4f, without %.4f\n", technique,
                std::sqrt(squares[0] / static_cast<double>(count)), std::sqrt(squares[1] / static_cast<double>(count)));
    EXPECT_LT(squares[1], 0.4 * squares[0]) << technique;
  }
}

TEST(BakedFineDetail, IsLookedForWithinReachAndMissedOtherwise) {
  for (const char* detail : {"detail=fine_vertices", "detail=fine_points"}) {
    Scene scene;
    build_floors(scene, -0.2);
    const std::vector<std::string> settings{"elements=texels", "spacing=0.25", "directions=16", detail};
    std::vector<std::string> far = settings;
    far.emplace_back("reach=0.25");
    const Result found = bake(scene, "ray_traced", far, chosen("fine"));
    EXPECT_EQ(found.report["missed"], 0);
    EXPECT_EQ(found.report["refined"], 64);
    EXPECT_EQ(found.remarks.find("reach"), std::string::npos);
    std::vector<std::string> near = settings;
    near.emplace_back("reach=0.1");
    const Result missed = bake(scene, "ray_traced", near, chosen("fine"));
    EXPECT_EQ(missed.report["missed"], 64);
    EXPECT_NE(missed.remarks.find("64 of 64 points of coarse meshes have no finer surface within 0.100000 m and answer "
                                  "for themselves: raise reach\n"),
              std::string::npos)
        << missed.remarks;
  }
  Scene bare;
  bare.add_floor(dvec3(0), 1);
  const Result alone = bake(bare, "ray_traced", {"detail=fine_points", "directions=16"});
  EXPECT_EQ(
      alone.remarks,
      "no instance has a finer one, so all elements lie on their own meshes: put the component mesh_detail.fine on "
      "the finer instances\n");
}

TEST(BakedFineDetail, RefusesSurfacesThatShowTheSameTwice) {
  Scene scene;
  build_floors(scene, 0.01);
  for (const auto& [above, detail, instance] :
       {std::tuple(std::string(), "fine_points", 0), std::tuple(chosen("coarse"), "fine_vertices", 0),
        std::tuple(std::string(), "none", 1), std::tuple(chosen("fine"), "normal_map", 1)}) {
    const Graph graph(job("ray_traced", above), {std::string("bake.params.detail=") + detail});
    EXPECT_EQ(heddle_job_run(graph.handle, scene.handle, nullptr, nullptr), HEDDLE_BAD_INPUT);
    EXPECT_NE(
        std::string(heddle_error(rendering::Host::get().handle))
            .find("instance " + std::to_string(instance) +
                  " is among the surfaces beside the one that it shows the same as, and would hide it; put a pass "
                  "of role mesh_detail above, with params.show = \"fine\" for params.detail = \"fine_vertices\" "
                  "and \"fine_points\", else \"coarse\""),
        std::string::npos)
        << heddle_error(rendering::Host::get().handle);
  }
}

TEST(BakedFineDetail, AnEditBakesOnlyWhatDependsOnItAnew) {
  // The pass that takes the coarse floor away makes nothing: all else keeps its own key.
  const std::vector<std::string> settings{"elements=texels", "spacing=0.25", "directions=64", "detail=fine_vertices"};
  forget_all();
  for (const double x : {4.0, 5.0}) {
    Scene scene;
    build_floors(scene, 0.01);
    scene.add_box(dvec3(-9, -3, -9), dvec3(9, -2.9, 9));  // so that the bounding sphere stays
    scene.add_box(dvec3(x, -2.5, 0), dvec3(x + 0.5, -2, 0.5));
    const Result result = bake(scene, "ray_traced", settings, chosen("fine"));
    const double parts = result.report["parts"], known = result.report["parts_known"];
    if (x < 4.5) {
      EXPECT_EQ(known, 0);
    } else {
      EXPECT_GE(known, 1) << "the floor above sees nothing of the box that moved, of " << parts << " parts";
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Techniques, BakedDetail,
    testing::Values(DetailTechnique{"depth_maps", {"directions=1024", "resolution=256"}},
                    DetailTechnique{"depth_maps", {"directions=1024", "resolution=256", "pipeline=split_ramp"}},
                    DetailTechnique{"depth_maps",
                                    {"directions=1024", "resolution=256", "pipeline=cpu_compare", "batch=1"}},
                    DetailTechnique{"ray_traced", {"directions=1024"}}, DetailTechnique{"hemicube", {}}),
    [](const auto& one) {
      std::string name = one.param.name;
      if (one.param.settings.size() > 2) name += one.param.settings[2].substr(8);
      std::ranges::replace(name, '=', '_');
      return name;
    });

}  // namespace
