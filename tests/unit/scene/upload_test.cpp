// SPDX-License-Identifier: Apache-2.0
// A scene on a device: draw lists, records and texels read back and compared with the scene's.
#include "scene/draw_order.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "scene/geometry.hpp"
#include "unit/vulkan/on_device.hpp"

namespace heddle::scene {
namespace {

class SceneUpload : public vulkan::OnDevice {
 protected:
  SceneUpload() : layout_(make_materials_layout(*device_)) {}

  template <typename Element>
  std::vector<Element> read(const vulkan::Buffer& buffer, std::size_t count) {
    const std::vector<std::byte> bytes = device_->read_back(buffer, 0, count * sizeof(Element));
    std::vector<Element> elements(count);
    std::memcpy(static_cast<void*>(elements.data()), bytes.data(), bytes.size());
    return elements;
  }

  VkDescriptorSetLayout layout_;
};

std::uint32_t add_material(Scene& scene, std::uint32_t alpha_mode, std::uint32_t flags = 0,
                           std::uint32_t texture = HEDDLE_NONE) {
  Material material;
  material.textures.fill(HEDDLE_NONE);
  material.textures[0] = texture;
  material.record.alpha_mode = alpha_mode;
  material.record.flags = flags;
  scene.materials.push_back(material);
  return static_cast<std::uint32_t>(scene.materials.size() - 1);
}

std::uint32_t add_mesh(Scene& scene, std::uint32_t material, std::size_t triangles) {
  Attributes attributes;
  for (std::size_t i = 0; i < triangles; ++i) {
    const auto z = static_cast<float>(i);
    attributes.positions.insert(attributes.positions.end(), {{0, 0, z}, {1, 0, z}, {0, 1, z}});
  }
  attributes.normals.assign(attributes.positions.size(), {0, 0, 1});
  for (std::uint32_t i = 0; i < triangles * 3; ++i) {
    attributes.indices.push_back(i);
  }
  scene.meshes.push_back(build_mesh("mesh", material, attributes, HEDDLE_NONE));
  return static_cast<std::uint32_t>(scene.meshes.size() - 1);
}

void add_instance(Scene& scene, std::uint32_t mesh, const glm::dvec3& place, double scale = 1) {
  glm::dmat4 matrix(1.0);
  matrix[0][0] = scale;
  matrix[3] = glm::dvec4(place, 1.0);
  scene.instances.push_back({"instance", mesh, matrix, matrix});
}

TEST_F(SceneUpload, EmptyScenesHaveBuffersAndASet) {
  SceneBuffers buffers(*device_, layout_);
  buffers.update(Scene(), {0, 0, 0});
  for (const vulkan::Buffer* buffer :
       {&buffers.vertices(), &buffers.indices(), &buffers.instances(), &buffers.materials(), &buffers.commands()}) {
    EXPECT_TRUE(static_cast<bool>(*buffer));
    EXPECT_GE(buffer->size(), 64U);
  }
  EXPECT_TRUE(buffers.groups().empty());
  EXPECT_NE(buffers.material_set(0), VkDescriptorSet{VK_NULL_HANDLE});
}

TEST_F(SceneUpload, BlendedDrawsComeFarthestFirst) {
  Scene scene;
  const std::uint32_t glass = add_material(scene, HEDDLE_ALPHA_BLEND);
  const std::uint32_t leaf = add_material(scene, HEDDLE_ALPHA_BLEND, HEDDLE_MATERIAL_DOUBLE_SIDED);
  const std::uint32_t a = add_mesh(scene, glass, 1), b = add_mesh(scene, leaf, 3);  // b: triangles at z 0, 1, 2
  add_instance(scene, a, {1e5, 0, -1});                                             // 0
  add_instance(scene, a, {1e5, 0, -3});                                             // 1
  add_instance(scene, b, {1e5, 0, -6});                                             // 2: from -6 to -4
  add_instance(scene, a, {1e5, 0, -3});                                             // 3: as far as 1
  add_instance(scene, b, {1e5, 0, -3});                                             // 4: from -3 to -1
  SceneBuffers buffers(*device_, layout_);
  const glm::dvec3 origin(1e5, 0, 0);
  buffers.update(scene, origin);
  std::vector<DrawSource> sources(1);
  sources[0].list = buffers.draws();
  for (const DrawGroup& group : buffers.groups()) sources[0].groups.push_back(&group);
  heddle_camera camera{};
  camera.vertical_angle = 1.0;
  camera.position[0] = 1e5;
  const HeddleView view = make_view(camera, 8, 8, origin);

  const auto objects_of = [&](const OrderedDraws& ordered) {
    std::vector<std::uint32_t> objects;
    for (const OrderedDraw& draw : ordered.draws)
      for (std::uint32_t i = 0; i < draw.instance_count; ++i)
        objects.push_back(buffers.order()[draw.first_instance + i]);
    return objects;
  };
  const OrderedDraws instances = order_back_to_front(scene, sources, view, origin, false);
  EXPECT_THAT(objects_of(instances), testing::ElementsAre(2, 1, 3, 4, 0));
  EXPECT_TRUE(instances.indices.empty());
  const OrderedDraws triangles = order_back_to_front(scene, sources, view, origin, true);
  EXPECT_THAT(objects_of(triangles), testing::ElementsAre(2, 1, 3, 4, 0));
  EXPECT_THAT(
      std::vector(triangles.indices.begin(), triangles.indices.begin() + 9),
      testing::ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8));  // the camera looks along -Z: z 0 of the mesh is farthest

  // From behind all is the other way round, but equal ones still come in the scene's order.
  camera.position[2] = -10;
  camera.rotation[1] = 1;
  const HeddleView behind = make_view(camera, 8, 8, origin);
  const OrderedDraws turned = order_back_to_front(scene, sources, behind, origin, true);
  EXPECT_THAT(objects_of(turned), testing::ElementsAre(0, 4, 1, 3, 2));
  EXPECT_THAT(std::vector(turned.indices.end() - 9, turned.indices.end()),
              testing::ElementsAre(6, 7, 8, 3, 4, 5, 0, 1, 2));
}

TEST_F(SceneUpload, DrawsAreMergedByStateAndMesh) {
  Scene scene;
  const std::uint32_t opaque = add_material(scene, HEDDLE_ALPHA_OPAQUE);
  const std::uint32_t masked = add_material(scene, HEDDLE_ALPHA_MASK, HEDDLE_MATERIAL_DOUBLE_SIDED);
  const std::uint32_t blended = add_material(scene, HEDDLE_ALPHA_BLEND);
  const std::uint32_t a = add_mesh(scene, opaque, 1), b = add_mesh(scene, opaque, 2);
  const std::uint32_t leaf = add_mesh(scene, masked, 3), glass = add_mesh(scene, blended, 1);
  const std::uint32_t empty = add_mesh(scene, opaque, 0);
  add_instance(scene, glass, {0, 0, 0});    // 0
  add_instance(scene, b, {0, 0, 0});        // 1
  add_instance(scene, leaf, {0, 0, 0});     // 2
  add_instance(scene, a, {0, 0, 0});        // 3
  add_instance(scene, b, {1, 0, 0});        // 4
  add_instance(scene, a, {2, 0, 0}, -1.0);  // 5, mirrored
  add_instance(scene, empty, {0, 0, 0});    // 6
  SceneBuffers buffers(*device_, layout_);
  buffers.update(scene, {0, 0, 0});

  const std::span<const DrawGroup> groups = buffers.groups();
  ASSERT_EQ(groups.size(), 4U);
  EXPECT_EQ(groups[0].flags, HEDDLE_SURFACE_OPAQUE | HEDDLE_SURFACE_CASTS_SHADOW);
  EXPECT_FALSE(groups[0].is_flipped);
  EXPECT_EQ(groups[0].command_count, 2U);
  EXPECT_TRUE(groups[1].is_flipped);
  EXPECT_EQ(groups[1].first_command, 2U);
  EXPECT_EQ(groups[2].flags, HEDDLE_SURFACE_MASKED | HEDDLE_SURFACE_CASTS_SHADOW | HEDDLE_SURFACE_DOUBLE_SIDED);
  EXPECT_EQ(groups[3].flags, HEDDLE_SURFACE_BLENDED);

  const auto commands = read<VkDrawIndexedIndirectCommand>(buffers.commands(), 5);
  EXPECT_EQ(commands[0].indexCount, 3U);
  EXPECT_EQ(commands[0].instanceCount, 1U);
  EXPECT_EQ(commands[1].indexCount, 6U);
  EXPECT_EQ(commands[1].instanceCount, 2U);
  EXPECT_EQ(commands[1].firstIndex, 3U);
  EXPECT_EQ(commands[1].vertexOffset, 3);
  const auto instances = read<HeddleInstance>(buffers.instances(), 6);
  std::vector<std::uint32_t> objects;
  for (const HeddleInstance& instance : instances) {
    objects.push_back(instance.object);
  }
  EXPECT_THAT(objects, testing::ElementsAre(3, 1, 4, 5, 2, 0));
  EXPECT_EQ(instances[3].flip, 1U);
  EXPECT_EQ(instances[4].material, masked);
  // Every command's instances are those of its mesh, and its vertices are the mesh's.
  const auto vertices = read<HeddleVertex>(buffers.vertices(), buffers.vertices().size() / sizeof(HeddleVertex));
  const auto indices = read<std::uint32_t>(buffers.indices(), buffers.indices().size() / 4);
  for (const VkDrawIndexedIndirectCommand& command : commands) {
    const Mesh& mesh = scene.meshes[scene.instances[instances[command.firstInstance].object].mesh];
    ASSERT_EQ(command.indexCount, mesh.indices.size());
    for (std::uint32_t i = 0; i < command.indexCount; ++i) {
      const std::size_t vertex = static_cast<std::size_t>(command.vertexOffset) + indices[command.firstIndex + i];
      EXPECT_EQ(std::memcmp(&vertices[vertex], &mesh.vertices[mesh.indices[i]], sizeof(HeddleVertex)), 0);
    }
  }
}

TEST_F(SceneUpload, InstancesAreRelativeToTheOriginInFloat64) {
  Scene scene;
  add_instance(scene, add_mesh(scene, add_material(scene, HEDDLE_ALPHA_OPAQUE), 1), {1e8 + 0.125, 2, 3});
  scene.instances[0].previous_scene_from_object[3].x = 1e8 - 0.5;
  SceneBuffers buffers(*device_, layout_);
  buffers.update(scene, {1e8, 0, 0});
  const HeddleInstance instance = read<HeddleInstance>(buffers.instances(), 1)[0];
  EXPECT_EQ(instance.rel_from_object[12], 0.125F);
  EXPECT_EQ(instance.rel_from_object[13], 2.0F);
  EXPECT_EQ(instance.rel_from_object[15], 1.0F);
  EXPECT_EQ(instance.previous_rel_from_object[12], -0.5F);
}

TEST_F(SceneUpload, OnlyWhatChangedIsUploaded) {
  Scene scene;
  add_instance(scene, add_mesh(scene, add_material(scene, HEDDLE_ALPHA_OPAQUE), 100), {0, 0, 0});
  SceneBuffers buffers(*device_, layout_);
  const auto uploaded = [&](const glm::dvec3& origin) {
    const std::uint64_t before = device_->counters().uploaded_bytes;
    buffers.update(scene, origin);
    return device_->counters().uploaded_bytes - before;
  };
  EXPECT_GT(uploaded({0, 0, 0}), 300 * sizeof(HeddleVertex));
  EXPECT_EQ(uploaded({0, 0, 0}), 0U);
  EXPECT_EQ(uploaded({1, 0, 0}), sizeof(HeddleInstance)) << "the origin moved";
  scene.instances[0].scene_from_object[3].x = 5;
  ++scene.motion_revision;
  EXPECT_EQ(uploaded({1, 0, 0}), sizeof(HeddleInstance)) << "an instance moved";
  EXPECT_FALSE(buffers.groups()[0].is_flipped);
  scene.instances[0].scene_from_object[0][0] = -1;
  ++scene.motion_revision;
  EXPECT_EQ(uploaded({1, 0, 0}), sizeof(HeddleInstance) + 64) << "it turned over: commands are sorted anew";
  EXPECT_TRUE(buffers.groups()[0].is_flipped);
  ++scene.content_revision;
  EXPECT_GT(uploaded({1, 0, 0}), 300 * sizeof(HeddleVertex));
}

TEST_F(SceneUpload, MaterialsGetLayersAndGroups) {
  Scene scene;
  for (const std::uint32_t size : {2U, 2U, 4U}) {
    Texture texture;
    texture.width = texture.height = size;
    texture.is_srgb = true;
    texture.rgba.assign(std::size_t{4} * size * size, 200);
    scene.textures.push_back(texture);
  }
  for (const std::uint32_t texture : {0U, 1U, 2U, HEDDLE_NONE}) {
    add_instance(scene, add_mesh(scene, add_material(scene, HEDDLE_ALPHA_OPAQUE, 0, texture), 1), {0, 0, 0});
  }
  SceneBuffers buffers(*device_, layout_);
  buffers.update(scene, {0, 0, 0});
  const auto materials = read<HeddleMaterial>(buffers.materials(), 4);
  EXPECT_EQ(materials[1].texture_layer[0], 1U);
  EXPECT_EQ(materials[1].texture_group, materials[0].texture_group);
  EXPECT_NE(materials[2].texture_group, materials[0].texture_group);
  EXPECT_EQ(materials[2].texture_layer[0], 0U);
  EXPECT_EQ(materials[3].texture_layer[0], HEDDLE_NO_TEXTURE);
  EXPECT_EQ(materials[3].texture_layer_4, HEDDLE_NO_TEXTURE);
  EXPECT_EQ(materials[3].id, 3U);
  EXPECT_EQ(buffers.groups().size(), 2U);
  EXPECT_NE(buffers.material_set(materials[0].texture_group), buffers.material_set(materials[2].texture_group));
}

TEST_F(SceneUpload, NothingOutlivesTheBuffers) {
  const vulkan::Counters before = device_->counters();
  {
    Scene scene;
    Texture texture;
    texture.width = texture.height = 4;
    texture.rgba.assign(64, 1);
    scene.textures.push_back(texture);
    add_instance(scene, add_mesh(scene, add_material(scene, HEDDLE_ALPHA_OPAQUE, 0, 0), 1), {0, 0, 0});
    SceneBuffers buffers(*device_, layout_);
    buffers.update(scene, {0, 0, 0});
    ++scene.content_revision;
    buffers.update(scene, {0, 0, 0});
    EXPECT_GT(device_->counters().live_images, before.live_images);
  }
  EXPECT_EQ(device_->counters().live_images, before.live_images);
  EXPECT_EQ(device_->counters().live_buffers, before.live_buffers);
}

TEST(SceneLights, AreRelativeToTheOriginInTheScenesOrder) {
  Scene scene;
  scene.lights.resize(2);
  scene.lights[1].position = {1e8 + 1.5, 2, 3};
  scene.lights[1].record.intensity[0] = 7;
  const std::vector<HeddleLight> lights = SceneBuffers::lights(scene, {1e8, 0, 4});
  ASSERT_EQ(lights.size(), 2U);
  EXPECT_EQ(lights[1].position_rel[0], 1.5F);
  EXPECT_EQ(lights[1].position_rel[2], -1.0F);
  EXPECT_EQ(lights[1].intensity[0], 7.0F);
  EXPECT_EQ(lights[1].id, 1U);
}

}  // namespace
}  // namespace heddle::scene
