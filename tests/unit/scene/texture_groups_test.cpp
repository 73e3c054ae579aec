// SPDX-License-Identifier: Apache-2.0
// Which arrays, layers and groups the textures of materials get.
#include "scene/texture_groups.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heddle::scene {
namespace {

std::uint32_t add_texture(Scene& scene, std::uint32_t size, bool is_srgb, std::array<std::uint32_t, 2> wrap = {0, 0}) {
  Texture texture;
  texture.width = texture.height = size;
  texture.is_srgb = is_srgb;
  texture.wrap = wrap;
  texture.rgba.resize(std::size_t{4} * size * size);
  scene.textures.push_back(std::move(texture));
  return static_cast<std::uint32_t>(scene.textures.size() - 1);
}

void add_material(Scene& scene, std::uint32_t base_color, std::uint32_t normal = HEDDLE_NONE) {
  Material material;
  material.textures.fill(HEDDLE_NONE);
  material.textures[HEDDLE_TEXTURE_BASE_COLOR] = base_color;
  material.textures[HEDDLE_TEXTURE_NORMAL] = normal;
  scene.materials.push_back(material);
}

TEST(TexturePlan, EqualShapesShareAnArrayAndMaterialsAGroup) {
  Scene scene;
  const std::uint32_t a = add_texture(scene, 8, true), b = add_texture(scene, 8, true);
  add_material(scene, a);
  add_material(scene, b);
  const TexturePlan plan = plan_textures(scene, 4096, 256);
  ASSERT_EQ(plan.arrays.size(), 1U);
  EXPECT_EQ(plan.arrays[0].mips, 4U);
  EXPECT_THAT(plan.arrays[0].textures, testing::ElementsAre(a, b));
  EXPECT_EQ(plan.groups.size(), 1U);
  EXPECT_EQ(plan.places[1].layers[HEDDLE_TEXTURE_BASE_COLOR], 1U);
  EXPECT_EQ(plan.places[1].layers[HEDDLE_TEXTURE_NORMAL], HEDDLE_NO_TEXTURE);
}

TEST(TexturePlan, FormatSizeWrapAndFilterKeepArraysApart) {
  Scene scene;
  add_material(scene, add_texture(scene, 8, true));
  add_material(scene, add_texture(scene, 8, false));
  add_material(scene, add_texture(scene, 16, true));
  add_material(scene, add_texture(scene, 8, true, {0, 2}));
  add_material(scene, add_texture(scene, 8, true));
  scene.textures.back().filter = HEDDLE_FILTER_NEAREST_MAGNIFIED;
  const TexturePlan plan = plan_textures(scene, 4096, 256);
  EXPECT_EQ(plan.arrays.size(), 5U);
  EXPECT_EQ(plan.groups.size(), 5U);
}

TEST(TexturePlan, MaterialsWithoutATextureJoinAnyGroupThatAgrees) {
  Scene scene;
  const std::uint32_t color = add_texture(scene, 8, true), normal = add_texture(scene, 8, false);
  add_material(scene, HEDDLE_NONE);
  add_material(scene, color);
  add_material(scene, color, normal);
  add_material(scene, HEDDLE_NONE, normal);
  const TexturePlan plan = plan_textures(scene, 4096, 256);
  EXPECT_EQ(plan.groups.size(), 1U);
  EXPECT_EQ(plan.groups[0][HEDDLE_TEXTURE_NORMAL], 1U);
  EXPECT_EQ(plan.groups[0][HEDDLE_TEXTURE_EMISSIVE], HEDDLE_NONE);
  EXPECT_EQ(plan.places[0].layers[HEDDLE_TEXTURE_BASE_COLOR], HEDDLE_NO_TEXTURE);
}

TEST(TexturePlan, ArraysStopAtTheDevicesLayers) {
  Scene scene;
  for (int i = 0; i < 5; ++i) {
    add_material(scene, add_texture(scene, 4, true));
  }
  const TexturePlan plan = plan_textures(scene, 4096, 2);
  ASSERT_EQ(plan.arrays.size(), 3U);
  EXPECT_EQ(plan.groups.size(), 3U);
  EXPECT_EQ(plan.places[4].group, 2U);
  EXPECT_EQ(plan.places[3].layers[0], 1U);
}

TEST(TexturePlan, TooLargeTexturesStartAtTheFirstMipThatFits) {
  Scene scene;
  add_material(scene, add_texture(scene, 64, true));
  add_material(scene, add_texture(scene, 16, true));
  const TexturePlan plan = plan_textures(scene, 16, 256);
  ASSERT_EQ(plan.arrays.size(), 1U);
  EXPECT_EQ(plan.arrays[0].width, 16U);
  EXPECT_EQ(plan.arrays[0].mips, 5U);
}

TEST(TexturePlan, UnusedTexturesTakeNoPlaceAndEmptyScenesHaveAGroup) {
  Scene scene;
  add_texture(scene, 8, true);
  const TexturePlan plan = plan_textures(scene, 4096, 256);
  EXPECT_TRUE(plan.arrays.empty());
  EXPECT_EQ(plan.groups.size(), 1U);
}

}  // namespace
}  // namespace heddle::scene
