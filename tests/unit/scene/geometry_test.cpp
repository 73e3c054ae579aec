// SPDX-License-Identifier: Apache-2.0
// Missing attributes made: flat normals, tangents that are averaged and split as a normal map needs them.
#include "scene/geometry.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "unit/scene/gltf_fixture.hpp"

namespace heddle::scene {
namespace {

glm::vec4 tangent_of(const HeddleVertex& vertex) {
  return {vertex.tangent[0], vertex.tangent[1], vertex.tangent[2], vertex.tangent[3]};
}

/// A unit quad in the xy plane with an upright image: u grows along +X, v downwards.
Attributes quad() {
  Attributes attributes;
  attributes.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  attributes.normals.assign(4, {0, 0, 1});
  attributes.uvs[0] = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
  attributes.indices = {0, 1, 2, 0, 2, 3};
  return attributes;
}

TEST(BuildMesh, MissingNormalsAreFlat) {
  Attributes attributes = quad();
  attributes.normals.clear();
  attributes.positions[2].z = 1;  // the two triangles are no longer in one plane
  const Mesh mesh = build_mesh("a", 0, attributes, HEDDLE_NONE);
  ASSERT_EQ(mesh.vertices.size(), 6U);
  for (std::size_t i = 0; i < 6; i += 3) {
    const glm::vec3 a = position_of(mesh.vertices[i]), b = position_of(mesh.vertices[i + 1]),
                    c = position_of(mesh.vertices[i + 2]);
    const glm::vec3 expected = glm::normalize(glm::cross(b - a, c - a));
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(glm::distance(normal_of(mesh.vertices[i + k]), expected), 0, 1e-6);
    }
  }
  EXPECT_NE(normal_of(mesh.vertices[0]), normal_of(mesh.vertices[3]));
}

TEST(BuildMesh, NormalsAndTangentsAreUnitVectorsEvenOfNothing) {
  Attributes attributes = quad();
  attributes.positions.assign(4, {1, 2, 3});  // no area
  attributes.normals = {{0, 0, 5}, {0, 0, 0}, {3, 4, 0}, {0, -2, 0}};
  for (const std::uint32_t set : {0U, HEDDLE_NONE}) {
    for (const HeddleVertex& vertex : build_mesh("a", 0, attributes, set).vertices) {
      const glm::vec3 tangent(tangent_of(vertex));
      EXPECT_NEAR(glm::length(normal_of(vertex)), 1, 1e-6);
      EXPECT_NEAR(glm::length(tangent), 1, 1e-6);
      EXPECT_NEAR(glm::dot(tangent, normal_of(vertex)), 0, 1e-6);
    }
  }
}

TEST(BuildMesh, TangentFollowsUAndBitangentPointsUpInTheImage) {
  const Mesh mesh = build_mesh("a", 0, quad(), 0);
  ASSERT_EQ(mesh.vertices.size(), 4U);
  for (const HeddleVertex& vertex : mesh.vertices) {
    EXPECT_EQ(tangent_of(vertex), glm::vec4(1, 0, 0, 1));
    const glm::vec3 bitangent = vertex.tangent[3] * glm::cross(normal_of(vertex), glm::vec3(tangent_of(vertex)));
    EXPECT_EQ(bitangent, glm::vec3(0, 1, 0));  // v = 0 is the image's top row
  }
}

TEST(BuildMesh, MirroredImagesTurnTheHandedness) {
  Attributes attributes = quad();
  for (glm::vec2& uv : attributes.uvs[0]) {
    uv.x = 1 - uv.x;
  }
  for (const HeddleVertex& vertex : build_mesh("a", 0, attributes, 0).vertices) {
    EXPECT_EQ(tangent_of(vertex), glm::vec4(-1, 0, 0, -1));
  }
}

TEST(BuildMesh, VerticesBetweenMirroredHalvesAreSplit) {
  // Two quads with the common edge x = 1, where u is 1: left goes up to it, right comes down from it.
  Attributes attributes;
  attributes.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {2, 0, 0}, {2, 1, 0}};
  attributes.normals.assign(6, {0, 0, 1});
  attributes.uvs[0] = {{0, 1}, {1, 1}, {1, 0}, {0, 0}, {0, 1}, {0, 0}};
  attributes.indices = {0, 1, 2, 0, 2, 3, 1, 4, 5, 1, 5, 2};
  const Mesh mesh = build_mesh("a", 0, attributes, 0);
  EXPECT_EQ(mesh.vertices.size(), 8U);
  for (std::size_t corner = 0; corner < mesh.indices.size(); ++corner) {
    const float side = corner < 6 ? 1.0F : -1.0F;
    const HeddleVertex& vertex = mesh.vertices[mesh.indices[corner]];
    EXPECT_EQ(tangent_of(vertex), glm::vec4(side, 0, 0, side)) << "corner " << corner;
    EXPECT_EQ(position_of(vertex), attributes.positions[attributes.indices[corner]]);
  }
}

TEST(BuildMesh, EqualCornersShareTheirTangentsAverage) {
  // A roof of two quads over the edge x = 0, with equal normals and coordinates there, stored without sharing vertices.
  Attributes attributes;
  attributes.positions = {{-1, 0, 0}, {0, 0, 1}, {0, 1, 1}, {0, 0, 1}, {1, 0, 0}, {0, 1, 1}};
  attributes.normals.assign(6, {0, 0, 1});
  attributes.uvs[0] = {{0, 1}, {1, 1}, {1, 0}, {1, 1}, {2, 1}, {1, 0}};
  attributes.indices = {0, 1, 2, 3, 4, 5};
  const Mesh mesh = build_mesh("a", 0, attributes, 0);
  EXPECT_EQ(tangent_of(mesh.vertices[1]), tangent_of(mesh.vertices[3]));
  EXPECT_EQ(tangent_of(mesh.vertices[1]), glm::vec4(1, 0, 0, 1));  // across the ridge: the slopes cancel
}

TEST(BuildMesh, TangentsFollowTheImageWhereItsTransformTurnsIt) {
  // u' = v, v' = -u: the image's axis u' grows where v does, downwards on the quad.
  const Mesh turned = build_mesh("a", 0, quad(), 0, {0, -1, 1, 0});
  EXPECT_NEAR(glm::distance(tangent_of(turned.vertices[0]), glm::vec4(0, -1, 0, 1)), 0, 1e-6);
  // Mirrored along u: the tangent turns round, and the handedness with it.
  const Mesh mirrored = build_mesh("a", 0, quad(), 0, {-1, 0, 0, 1});
  EXPECT_NEAR(glm::distance(tangent_of(mirrored.vertices[0]), glm::vec4(-1, 0, 0, -1)), 0, 1e-6);
}

TEST(BuildMesh, GivenTangentsStay) {
  Attributes attributes = quad();
  attributes.tangents.assign(4, {0, 2, 0, -1});
  const Mesh mesh = build_mesh("a", 0, attributes, 0);
  EXPECT_EQ(tangent_of(mesh.vertices[0]), glm::vec4(0, 1, 0, -1));
}

TEST(BuildMesh, PacksColoursAndBounds) {
  Attributes attributes = quad();
  attributes.colors.assign(4, {1, 0.5F, -1, 2});
  const Mesh mesh = build_mesh("a", 7, attributes, HEDDLE_NONE);
  EXPECT_EQ(mesh.vertices[0].color, 0xff0080ffU);  // 0.5 rounds to 128
  EXPECT_EQ(mesh.bounds[0], glm::vec3(0, 0, 0));
  EXPECT_EQ(mesh.bounds[1], glm::vec3(1, 1, 0));
  EXPECT_EQ(mesh.material, 7U);
  EXPECT_EQ(build_mesh("a", 0, quad(), HEDDLE_NONE).vertices[3].color, 0xffffffffU);
}

TEST(NormalMatrix, KeepsNormalsAcrossSurfacesWhateverTheTransform) {
  glm::dmat3 skewed(2, 0.5, 0, 0, -3, 1, 0.25, 0, 0.5);
  for (const double flip : {1.0, -1.0}) {
    skewed[0] *= flip;
    const glm::dvec3 u(1, 2, 3), v(-2, 1, 0.5), n = glm::cross(u, v);
    const glm::dvec3 turned = normal_matrix(skewed) * n;
    EXPECT_NEAR(glm::dot(turned, skewed * u), 0, 1e-12);
    EXPECT_NEAR(glm::dot(turned, skewed * v), 0, 1e-12);
    // The side that was in front stays in front.
    EXPECT_GT(glm::dot(turned, skewed * n), 0);
  }
  const glm::dvec3 flattened = normal_matrix(glm::dmat3(1, 0, 0, 0, 1, 0, 0, 0, 0)) * glm::dvec3(0, 0, 1);
  EXPECT_EQ(flattened, glm::dvec3(0, 0, 1));
}

}  // namespace
}  // namespace heddle::scene
