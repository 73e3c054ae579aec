// SPDX-License-Identifier: Apache-2.0
// Bounds, the made-up camera, features, descriptions, revisions.
#include "scene/scene.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "json.hpp"
#include "scene/geometry.hpp"

namespace heddle::scene {
namespace {

Mesh box_mesh(const glm::vec3& low, const glm::vec3& high) {
  Attributes attributes;
  for (int i = 0; i < 8; ++i) {
    attributes.positions.emplace_back((i & 1) != 0 ? high.x : low.x, (i & 2) != 0 ? high.y : low.y,
                                      (i & 4) != 0 ? high.z : low.z);
  }
  attributes.normals.assign(8, {0, 1, 0});
  attributes.indices = {0, 1, 2, 1, 3, 2, 4, 6, 5, 5, 6, 7};
  return build_mesh("box", 0, attributes, HEDDLE_NONE);
}

Scene one_box() {
  Scene scene;
  scene.materials.emplace_back();
  scene.materials.back().textures.fill(HEDDLE_NONE);
  scene.meshes.push_back(box_mesh({-1, -2, -3}, {1, 2, 3}));
  scene.instances.push_back({"box", 0, glm::dmat4(1.0), glm::dmat4(1.0)});
  return scene;
}

glm::dmat4 at(const glm::dvec3& place) {
  glm::dmat4 matrix(1.0);
  matrix[3] = glm::dvec4(place, 1.0);
  return matrix;
}

TEST(SceneBounds, HoldAllInstancesInFloat64) {
  Scene scene = one_box();
  // A quarter turn about z swaps x and y; 10^8 metres away, float32 would lose the metre.
  scene.instances[0].scene_from_object =
      at({1e8, 0, 0}) * glm::mat4_cast(glm::angleAxis(glm::radians(90.0), glm::dvec3(0, 0, 1)));
  const std::array<glm::dvec3, 2> bounds = scene.bounds();
  for (int i = 0; i < 3; ++i) {
    const glm::dvec3 half(2, 1, 3);
    EXPECT_NEAR(bounds[0][i], (i == 0 ? 1e8 : 0) - half[i], 1e-7);
    EXPECT_NEAR(bounds[1][i], (i == 0 ? 1e8 : 0) + half[i], 1e-7);
  }
}

TEST(SceneBounds, OfNothingAreZero) {
  EXPECT_EQ(Scene().bounds()[0], glm::dvec3(0));
  EXPECT_EQ(Scene().bounds()[1], glm::dvec3(0));
}

TEST(ActiveCamera, FramesTheWholeSceneInEveryShape) {
  Scene scene = one_box();
  scene.instances[0].scene_from_object = at({1000, 50, -7});
  for (const auto& [width, height] : {std::pair(1280U, 720U), std::pair(300U, 900U), std::pair(64U, 64U)}) {
    const heddle_camera camera = scene.active_camera(width, height);
    EXPECT_EQ(camera.aspect, static_cast<double>(width) / height);
    const glm::dvec3 position(camera.position[0], camera.position[1], camera.position[2]);
    const HeddleView view = make_view(camera, width, height, position);
    glm::dmat4 clip_from_rel;
    for (int i = 0; i < 16; ++i) {
      clip_from_rel[i / 4][i % 4] = view.clip_from_rel[i];
    }
    double widest = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const glm::dvec3 offset((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 2 : -2, (corner & 4) != 0 ? 3 : -3);
      const glm::dvec4 clip = clip_from_rel * glm::dvec4(glm::dvec3(1000, 50, -7) + offset - position, 1.0);
      EXPECT_GT(clip.w, view.near_distance);
      widest = std::max({widest, std::abs(clip.x / clip.w), std::abs(clip.y / clip.w)});
    }
    EXPECT_LT(widest, 1.0);
    EXPECT_GT(widest, 0.4) << "the scene is lost in the frame";
    // Slightly from above and the side, in front.
    EXPECT_GT(position.y, 50);
    EXPECT_GT(position.x, 1000);
    EXPECT_GT(position.z, -7);
  }
}

TEST(ActiveCamera, OfAnEmptySceneIsStillACamera) {
  const heddle_camera camera = Scene().active_camera(64, 64);
  EXPECT_GT(camera.vertical_angle, 0);
  EXPECT_GT(camera.near_distance, 0);
  EXPECT_TRUE(std::isfinite(camera.position[2]));
}

TEST(ActiveCamera, IsTheOneInUseWithItsDefaultsFilledIn) {
  Scene scene = one_box();
  heddle_camera record{};
  record.position[0] = 3;
  record.rotation[3] = 1;
  record.vertical_angle = 0.5;
  scene.cameras.push_back({"a", record});
  scene.camera = 0;
  const heddle_camera camera = scene.active_camera(200, 100);
  EXPECT_EQ(camera.position[0], 3);
  EXPECT_EQ(camera.vertical_angle, 0.5);
  EXPECT_EQ(camera.aspect, 2);
  EXPECT_NEAR(camera.near_distance, 1e-3 * std::sqrt(4 + 16 + 36), 1e-12);  // of a diagonal of less than 10 m
}

TEST(ActiveCamera, HasPlanesThatFollowTheScenesSizeWhereItSaysNone) {
  const auto camera_of = [](double scale, double near, bool is_orthographic) {
    Scene scene = one_box();
    scene.instances[0].scene_from_object = glm::dmat4(glm::dmat3(scale));
    heddle_camera record{};
    record.is_orthographic = is_orthographic ? 1 : 0;
    record.position[2] = 10 * scale;
    record.rotation[3] = 1;
    record.vertical_angle = is_orthographic ? scale : 0.5;
    record.near_distance = near;
    scene.cameras.push_back({"a", record});
    scene.camera = 0;
    return scene.active_camera(1, 1);
  };
  const double diagonal = std::sqrt(4 + 16 + 36);
  EXPECT_NEAR(camera_of(1e-3, 0, false).near_distance, 1e-6 * diagonal, 1e-15);
  EXPECT_EQ(camera_of(1e3, 0, false).near_distance, 0.01) << "large scenes have small things in them";
  EXPECT_EQ(camera_of(1e-3, 0.05, false).near_distance, 0.05) << "what is said counts";
  for (const double scale : {1e-3, 1.0, 1e3}) {
    // To the farthest corner, twice.
    EXPECT_NEAR(camera_of(scale, 0, true).far_distance, 2 * scale * std::sqrt(1.0 + 4.0 + 13.0 * 13.0), 1e-9 * scale);
  }
  EXPECT_EQ(camera_of(0, 0, false).near_distance, 0.01) << "a scene without extent";
  EXPECT_EQ(camera_of(0, 0, true).far_distance, 1000);
}

TEST(SceneExtent, IsFoundAnewWhenSomethingHasMoved) {
  Scene scene = one_box();
  EXPECT_EQ(scene.reach()[1], glm::dvec3(1, 2, 3));
  EXPECT_NEAR(scene.typical_size(), std::sqrt(4 + 16 + 36), 1e-12);
  scene.instances[0].scene_from_object = at({10, 0, 0});
  ++scene.motion_revision;
  EXPECT_EQ(scene.reach()[1], glm::dvec3(11, 2, 3));
  // Two large ones beside it: half of three are no longer than the second.
  for (const double scale : {5.0, 100.0}) {
    scene.instances.push_back({"box", 0, glm::dmat4(glm::dmat3(scale)), glm::dmat4(1.0)});
  }
  EXPECT_EQ(scene.reach()[1], glm::dvec3(100, 200, 300));
  EXPECT_NEAR(scene.typical_size(), 5 * std::sqrt(4 + 16 + 36), 1e-12);
}

TEST(Features, NameWhatInstancesShow) {
  Scene scene = one_box();
  EXPECT_THAT(scene.features(), testing::ElementsAre("surfaces"));
  HeddleMaterial& material = scene.materials[0].record;
  material.alpha_mode = HEDDLE_ALPHA_MASK;
  material.flags = HEDDLE_MATERIAL_DOUBLE_SIDED;
  material.emissive[1] = 2;
  scene.materials[0].textures[HEDDLE_TEXTURE_OCCLUSION] = 0;
  scene.lights.emplace_back();
  EXPECT_THAT(scene.features(),
              testing::ElementsAre("surfaces", "lights", "masked", "emissive", "double_sided", "textures"));
  material.alpha_mode = HEDDLE_ALPHA_BLEND;
  EXPECT_THAT(scene.features(), testing::Contains("blended"));
  material.alpha_mode = HEDDLE_ALPHA_OPAQUE;
  EXPECT_THAT(scene.features(), testing::Not(testing::Contains("blended")));
  material.transmission = 0.5F;
  EXPECT_THAT(scene.features(), testing::Contains("blended"));
  scene.environment.emplace();
  EXPECT_THAT(scene.features(), testing::Contains("environment"));
  scene.environment.reset();
  scene.instances.clear();
  EXPECT_THAT(scene.features(), testing::ElementsAre("lights"));
  EXPECT_THAT(Scene().features(), testing::IsEmpty());
}

TEST(Describe, CountsInstancedTrianglesAndSurvivesBadNames) {
  Scene scene = one_box();
  scene.instances.push_back(scene.instances[0]);
  scene.materials[0].name = "bad \xff name";
  scene.warnings.emplace_back("a warning");
  scene.ignored_extensions.emplace_back("KHR_x");
  const Json json = parse_json(scene.describe_json());
  EXPECT_EQ(json["counts"]["triangles"], 8);
  EXPECT_EQ(json["counts"]["stored_triangles"], 4);
  EXPECT_EQ(json["counts"]["instances"], 2);
  EXPECT_EQ(json["bounds"][1][2], 3.0);
  EXPECT_EQ(json["materials"][0], "bad \xef\xbf\xbd name");
  EXPECT_EQ(json["ignored_extensions"][0], "KHR_x");
  EXPECT_TRUE(json["camera"].is_null());
}

TEST(Revisions, AreFarApartBetweenScenes) {
  const Scene a, b;
  EXPECT_GT(b.content_revision - a.content_revision, 1ULL << 31);
  EXPECT_NE(a.content_revision, a.motion_revision);
}

TEST(Settle, MakesThisFramesPlacesTheLastOnes) {
  Scene scene = one_box();
  EXPECT_FALSE(scene.settle());
  scene.instances[0].scene_from_object = at({1, 0, 0});
  const std::uint64_t before = scene.motion_revision;
  EXPECT_TRUE(scene.settle());
  EXPECT_NE(scene.motion_revision, before);
  EXPECT_EQ(scene.instances[0].previous_scene_from_object, at({1, 0, 0}));
  EXPECT_FALSE(scene.settle());
}

TEST(Settle, WaitsUntilEverybodyHasSeenAFrame) {
  Scene scene = one_box();
  const int one = 0, two = 0;
  const auto step = [&] {
    return scene.instances[0].scene_from_object[3][0] - scene.instances[0].previous_scene_from_object[3][0];
  };
  for (const double x : {1.0, 3.0}) {
    scene.begin_move();
    scene.instances[0].scene_from_object = at({x, 0, 0});
    for (const int* graph : {&one, &two}) {
      scene.begin_frame(graph);
      EXPECT_EQ(step(), x == 1.0 ? 1.0 : 2.0);
      scene.end_frame(graph);
    }
  }
  scene.begin_frame(&one);
  EXPECT_EQ(step(), 0.0) << "a second frame of the same places";
}

}  // namespace
}  // namespace heddle::scene
