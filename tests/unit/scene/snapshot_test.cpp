// SPDX-License-Identifier: Apache-2.0
// The triangles of a scene in host memory, and the alpha test against worked-out texels.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "scene/geometry.hpp"
#include "scene/upload.hpp"

namespace heddle::scene {
namespace {

/// A unit quad, masked, whose image is 2 x 1 texels: left closed, right open, unless changed.
Scene masked_quad() {
  Scene scene;
  Texture texture;
  texture.width = 2;
  texture.height = 1;
  texture.wrap = {2, 2};
  texture.rgba = {0, 0, 0, 255, 0, 0, 0, 0};
  scene.textures.push_back(texture);
  Material material;
  material.textures.fill(HEDDLE_NONE);
  material.textures[HEDDLE_TEXTURE_BASE_COLOR] = 0;
  material.record.base_color[3] = 1;
  material.record.alpha_mode = HEDDLE_ALPHA_MASK;
  material.record.alpha_cutoff = 0.5F;
  material.record.uv_rotation_scale[0] = material.record.uv_rotation_scale[3] = 1;
  scene.materials.push_back(material);
  Attributes attributes;
  attributes.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  attributes.normals.assign(4, {0, 0, 1});
  attributes.uvs[0] = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
  attributes.uvs[1] = {{1, 1}, {0, 1}, {0, 0}, {1, 0}};  // mirrored
  attributes.indices = {0, 1, 2, 0, 2, 3};
  scene.meshes.push_back(build_mesh("quad", 0, attributes, HEDDLE_NONE));
  scene.instances.push_back({"quad", 0, glm::dmat4(1.0), glm::dmat4(1.0)});
  return scene;
}

/// The alpha test at uv0 = (u, 1 - u * 0): triangle 0 has corners (0,1), (1,1), (1,0), so weight u of the second is u.
std::uint32_t at(const Scene& scene, float u) {
  Snapshot snapshot;
  const heddle_snapshot& record = snapshot.update(scene);
  return snapshot.alpha_test()(&record, 0, u, 0.0F);
}

TEST(Snapshot, AppliesTransformsInFloat64AroundTheBoundsCentre) {
  Scene scene = masked_quad();
  glm::dmat4 far(1.0);
  far[3] = glm::dvec4(1e8, 0, 0, 1);
  scene.instances[0].scene_from_object = far;
  far[3].x += 2.5;
  scene.instances.push_back({"second", 0, far, far});
  Snapshot snapshot;
  const heddle_snapshot& record = snapshot.update(scene);
  EXPECT_EQ(record.struct_size, sizeof(heddle_snapshot));
  EXPECT_EQ(record.vertex_count, 8U);
  EXPECT_EQ(record.triangle_count, 4U);
  EXPECT_EQ(record.origin[0], 1e8 + 1.75);
  EXPECT_EQ(record.positions[0], -1.75F);
  EXPECT_EQ(record.positions[4 * 3], 0.75F);
  EXPECT_EQ(record.indices[6], 4U);
  EXPECT_EQ(record.uvs[1], 1.0F);
  EXPECT_EQ(record.flags[0], HEDDLE_SURFACE_MASKED | HEDDLE_SURFACE_CASTS_SHADOW);
  EXPECT_EQ(record.materials[3], 0U);
}

TEST(Snapshot, TransformsNormalsAndKeepsFrontsOfMirroredInstances) {
  Scene scene = masked_quad();
  glm::dmat4& matrix = scene.instances[0].scene_from_object;
  matrix[0][0] = -3;  // mirrors
  matrix[0][2] = 3;   // and turns out of the plane: x goes to (-3, 0, 3)
  Snapshot snapshot;
  const heddle_snapshot& record = snapshot.update(scene);
  const glm::vec3 normal(record.normals[0], record.normals[1], record.normals[2]);
  EXPECT_NEAR(glm::distance(normal, glm::normalize(glm::vec3(1, 0, 1))), 0, 1e-6);
  std::array<glm::vec3, 3> corners;
  for (std::size_t k = 0; k < 3; ++k) {
    const float* p = record.positions + std::size_t{3} * record.indices[k];
    corners[k] = {p[0], p[1], p[2]};
  }
  EXPECT_GT(glm::dot(glm::cross(corners[1] - corners[0], corners[2] - corners[0]), normal), 0);
}

TEST(Snapshot, IsRebuiltOnlyWhenTheSceneChanged) {
  Scene scene = masked_quad();
  Snapshot snapshot;
  const heddle_snapshot* first = &snapshot.update(scene);
  const std::uint64_t revision = first->revision;
  EXPECT_EQ(&snapshot.update(scene), first);
  ++scene.motion_revision;
  EXPECT_NE(snapshot.update(scene).revision, revision);
  const std::uint64_t moved = snapshot.update(scene).revision;
  ++scene.content_revision;
  EXPECT_NE(snapshot.update(scene).revision, moved);
  Snapshot other;
  EXPECT_NE(other.update(masked_quad()).revision, snapshot.update(scene).revision);
}

TEST(Snapshot, OfAnEmptySceneHasNoTriangles) {
  Snapshot snapshot;
  const heddle_snapshot& record = snapshot.update(Scene());
  EXPECT_EQ(record.triangle_count, 0U);
  EXPECT_EQ(snapshot.alpha_test()(&record, 0, 0, 0), 1U);
}

TEST(AlphaTest, FiltersBilinearlyAgainstTheCutoff) {
  Scene scene = masked_quad();
  // Alpha falls from 1 at u = 0.25 to 0 at u = 0.75, and is flat beyond: clamped.
  EXPECT_EQ(at(scene, 0.0F), 1U);
  EXPECT_EQ(at(scene, 0.49F), 1U);
  EXPECT_EQ(at(scene, 0.51F), 0U);
  EXPECT_EQ(at(scene, 1.0F), 0U);
  scene.materials[0].record.alpha_cutoff = 0.25F;
  EXPECT_EQ(at(scene, 0.61F), 1U);
  EXPECT_EQ(at(scene, 0.64F), 0U);
  scene.materials[0].record.base_color[3] = 0.5F;  // halves alpha: 0.25 is reached in the middle
  EXPECT_EQ(at(scene, 0.49F), 1U);
  EXPECT_EQ(at(scene, 0.51F), 0U);
}

TEST(AlphaTest, ShowsWholeTexelsWhereTheSamplerDoes) {
  Scene scene = masked_quad();
  scene.materials[0].record.alpha_cutoff = 0.1F;
  EXPECT_EQ(at(scene, 0.55F), 1U) << "blended: alpha is still 0.4";
  scene.textures[0].filter = HEDDLE_FILTER_NEAREST_MAGNIFIED;
  EXPECT_EQ(at(scene, 0.55F), 0U);
  EXPECT_EQ(at(scene, 0.45F), 1U);
}

TEST(AlphaTest, WrapsAsTheSamplerDoes) {
  Scene scene = masked_quad();
  scene.materials[0].record.uv_offset[0] = 1.0F;  // one image further
  EXPECT_EQ(at(scene, 0.25F), 0U) << "clamp";
  scene.textures[0].wrap[0] = 0;
  EXPECT_EQ(at(scene, 0.25F), 1U) << "repeat";
  EXPECT_EQ(at(scene, 0.75F), 0U) << "repeat";
  scene.textures[0].wrap[0] = 1;
  EXPECT_EQ(at(scene, 0.25F), 0U) << "mirror";
  EXPECT_EQ(at(scene, 0.75F), 1U) << "mirror";
  scene.materials[0].record.uv_offset[0] = -2.0F;
  EXPECT_EQ(at(scene, 0.25F), 1U) << "mirrored twice, below zero";
}

TEST(AlphaTest, FollowsTheTransformAndTheSetOfCoordinates) {
  Scene scene = masked_quad();
  scene.materials[0].record.texture_uv_sets = 1U << HEDDLE_TEXTURE_BASE_COLOR;
  EXPECT_EQ(at(scene, 0.2F), 0U);
  EXPECT_EQ(at(scene, 0.8F), 1U);
  scene.materials[0].record.texture_uv_sets = 0;
  // u' = 1 - u
  scene.materials[0].record.uv_rotation_scale[0] = -1;
  scene.materials[0].record.uv_offset[0] = 1;
  EXPECT_EQ(at(scene, 0.2F), 0U);
  EXPECT_EQ(at(scene, 0.8F), 1U);
}

TEST(AlphaTest, MultipliesTheVerticesAlpha) {
  Scene scene = masked_quad();
  scene.materials[0].textures.fill(HEDDLE_NONE);
  EXPECT_EQ(at(scene, 0.5F), 1U);
  for (HeddleVertex& vertex : scene.meshes[0].vertices) {
    vertex.color = 0x40ffffffU;
  }
  EXPECT_EQ(at(scene, 0.5F), 0U);
}

TEST(AlphaTest, OpaqueSurfacesHaveNoHoles) {
  Scene scene = masked_quad();
  scene.materials[0].record.alpha_mode = HEDDLE_ALPHA_OPAQUE;
  EXPECT_EQ(at(scene, 1.0F), 1U);
  scene.materials[0].record.alpha_mode = HEDDLE_ALPHA_BLEND;
  EXPECT_EQ(at(scene, 1.0F), 1U);
}

TEST(AlphaTest, SurvivesTheScene) {
  Snapshot snapshot;
  const heddle_snapshot* record = nullptr;
  {
    const Scene scene = masked_quad();
    record = &snapshot.update(scene);
  }
  EXPECT_EQ(snapshot.alpha_test()(record, 0, 0.9F, 0), 0U);
}

}  // namespace
}  // namespace heddle::scene
