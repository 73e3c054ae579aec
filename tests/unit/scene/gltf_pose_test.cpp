// SPDX-License-Identifier: Apache-2.0
// Skins and morph targets as the file poses them.
#include <gmock/gmock.h>

#include "unit/scene/gltf_fixture.hpp"

namespace heddle::scene {
namespace {

using Json = nlohmann::json;

class GltfPose : public GltfTest {
 protected:
  /// A triangle bound to two joints; weights of the three vertices for each.
  GltfFile skinned(const std::vector<float>& first, const std::vector<float>& second) const {
    GltfFile file;
    Json triangle = file.triangle();
    std::vector<std::uint8_t> joints;
    std::vector<float> weights;
    for (std::size_t i = 0; i < 3; ++i) {
      joints.insert(joints.end(), {0, 1, 0, 0});
      weights.insert(weights.end(), {first[i], second[i], 0, 0});
    }
    triangle["attributes"]["JOINTS_0"] = file.accessor(kUnsignedByte, "VEC4", 4, joints);
    triangle["attributes"]["WEIGHTS_0"] = file.floats("VEC4", 4, weights);
    triangle["attributes"]["NORMAL"] = file.vec3({0, 0, 1, 0, 0, 1, 0, 0, 1});
    // Bind pose: both joints at the origin.
    std::vector<float> identity(32, 0.0F);
    for (std::size_t i = 0; i < 32; i += 16) {
      identity[i] = identity[i + 5] = identity[i + 10] = identity[i + 15] = 1;
    }
    file.json["skins"] =
        Json::array({{{"joints", {1, 2}}, {"inverseBindMatrices", file.floats("MAT4", 16, identity)}}});
    // The mesh's own node is far away, which does not count.
    file.node({{"mesh", file.mesh(triangle)}, {"skin", 0}, {"translation", {500, 0, 0}}});
    file.node({{"translation", {10, 0, 0}}});
    file.node({{"translation", {0, 20, 0}}});
    return file;
  }
  static std::vector<glm::dvec3> placed(const Scene& scene) {
    const Instance& instance = scene.instances.at(0);
    std::vector<glm::dvec3> positions;
    for (const HeddleVertex& vertex : scene.meshes.at(instance.mesh).vertices) {
      positions.emplace_back(instance.scene_from_object * glm::dvec4(position_of(vertex), 1.0));
    }
    return positions;
  }
};

TEST_F(GltfPose, JointsPlaceSkinnedVerticesAndTheNodeDoesNot) {
  const Scene scene = load(skinned({1, 0, 0.5F}, {0, 1, 0.5F}));
  EXPECT_THAT(placed(scene), testing::ElementsAre(glm::dvec3(10, 0, 0), glm::dvec3(1, 20, 0), glm::dvec3(5, 11, 0)));
  EXPECT_EQ(normal_of(scene.meshes[0].vertices[0]), glm::vec3(0, 0, 1));
}

TEST_F(GltfPose, WeightsNeedNotSumToOne) {
  EXPECT_THAT(placed(load(skinned({0.25F, 0, 0.2F}, {0, 3, 0.2F}))),
              testing::ElementsAre(glm::dvec3(10, 0, 0), glm::dvec3(1, 20, 0), glm::dvec3(5, 11, 0)));
}

TEST_F(GltfPose, VerticesWithoutWeightsFollowTheFirstJoint) {
  EXPECT_EQ(placed(load(skinned({0, 0, 0}, {0, 0, 0})))[0], glm::dvec3(10, 0, 0));
}

TEST_F(GltfPose, LargeTranslationsOfJointsStayInFloat64) {
  GltfFile file = skinned({1, 1, 1}, {0, 0, 0});
  file.json["nodes"][1]["translation"] = {1e8 + 0.25, 0, 0};
  const Scene scene = load(file);
  EXPECT_EQ(placed(scene)[0], glm::dvec3(1e8 + 0.25, 0, 0));
  EXPECT_EQ(placed(scene)[1], glm::dvec3(1e8 + 1.25, 0, 0));
}

TEST_F(GltfPose, TurningJointsTurnNormals) {
  GltfFile file = skinned({1, 1, 1}, {0, 0, 0});
  const double half = std::sqrt(0.5);
  file.json["nodes"][1] = {{"rotation", {half, 0, 0, half}}, {"scale", {1, 4, 1}}};  // z turns to -y
  const Scene scene = load(file);
  EXPECT_NEAR(glm::distance(normal_of(scene.meshes[0].vertices[0]), glm::vec3(0, -1, 0)), 0, 1e-6);
  EXPECT_NEAR(glm::distance(placed(scene)[2], glm::dvec3(0, 0, 4)), 0, 1e-6);
}

TEST_F(GltfPose, MirroringJointsKeepFrontsInFront) {
  GltfFile file = skinned({1, 1, 1}, {0, 0, 0});
  file.json["nodes"][1] = {{"scale", {-1, 1, 1}}};
  const Scene scene = load(file);
  const Mesh& mesh = scene.meshes[0];
  const glm::vec3 a = position_of(mesh.vertices[mesh.indices[0]]), b = position_of(mesh.vertices[mesh.indices[1]]),
                  c = position_of(mesh.vertices[mesh.indices[2]]);
  EXPECT_GT(glm::dot(glm::cross(b - a, c - a), normal_of(mesh.vertices[0])), 0);
}

TEST_F(GltfPose, BrokenSkinsAreErrors) {
  GltfFile file = skinned({1, 0, 0}, {0, 1, 1});
  file.json["skins"][0]["joints"] = {1};
  EXPECT_THAT(error_of(file), testing::HasSubstr("names a joint that does not exist\n  found:    1"));
  file.json["skins"][0]["joints"] = {1, 99};
  EXPECT_THAT(error_of(file), testing::HasSubstr("joint 1 of skin 0 is node 99, which does not exist"));
  file.json["skins"][0]["joints"] = {1, 2, 2};
  EXPECT_THAT(error_of(file), testing::HasSubstr("there are fewer than joints"));
  file = skinned({1, 0, 0}, {0, 1, 1});
  file.json["meshes"][0]["primitives"][0]["attributes"].erase("WEIGHTS_0");
  EXPECT_THAT(error_of(file), testing::HasSubstr("JOINTS_0 has no WEIGHTS_0"));
}

TEST_F(GltfPose, MorphTargetsApplyTheirDefaultWeights) {
  GltfFile file;
  Json triangle = file.triangle();
  triangle["targets"] = Json::array(
      {{{"POSITION", file.vec3({0, 0, 8, 0, 0, 0, 0, 0, 0})}}, {{"POSITION", file.vec3({0, 0, 0, 4, 0, 0, 0, 0, 0})}}});
  const int mesh = file.mesh(triangle);
  file.json["meshes"][0]["weights"] = {0.5, 0};
  file.node({{"mesh", mesh}});
  file.node({{"mesh", mesh}, {"weights", {0, 0.25}}});
  file.node({{"mesh", mesh}});
  const Scene scene = load(file);
  ASSERT_EQ(scene.meshes.size(), 2U) << "equal weights share a mesh";
  EXPECT_EQ(position_of(scene.meshes[0].vertices[0]), glm::vec3(0, 0, 4));
  EXPECT_EQ(position_of(scene.meshes[1].vertices[0]), glm::vec3(0, 0, 0));
  EXPECT_EQ(position_of(scene.meshes[1].vertices[1]), glm::vec3(2, 0, 0));
  EXPECT_EQ(scene.instances[2].mesh, 0U);
  // Flat normals belong to the posed shape.
  EXPECT_LT(normal_of(scene.meshes[0].vertices[0]).z, 0.9F);
}

TEST_F(GltfPose, MorphTargetsOfOtherLengthsAreErrors) {
  GltfFile file;
  Json triangle = file.triangle();
  triangle["targets"] = Json::array({{{"POSITION", file.vec3({0, 0, 8})}}});
  file.node({{"mesh", file.mesh(triangle)}, {"weights", {1}}});
  EXPECT_THAT(error_of(file), testing::HasSubstr("there are more or fewer than positions"));
}

}  // namespace
}  // namespace heddle::scene
