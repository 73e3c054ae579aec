// SPDX-License-Identifier: Apache-2.0
// Animations of glTF files: what a scene is at a time, what was before, and what is uploaded for it.
#include <gmock/gmock.h>

#include <cmath>

#include "scene/upload.hpp"
#include "unit/scene/gltf_fixture.hpp"
#include "unit/vulkan/on_device.hpp"

namespace heddle::scene {
namespace {

using Json = nlohmann::json;

/// Adds a channel with a sampler of its own to the last animation.
void channel(GltfFile& file, int node, const char* path, int times, int values, const char* interpolation = "LINEAR") {
  Json& animation = file.json["animations"].back();
  animation["samplers"].push_back({{"input", times}, {"output", values}, {"interpolation", interpolation}});
  animation["channels"].push_back(
      {{"sampler", animation["samplers"].size() - 1}, {"target", {{"node", node}, {"path", path}}}});
}
void animation(GltfFile& file, const char* name) {
  file.json["animations"].push_back({{"name", name}, {"samplers", Json::array()}, {"channels", Json::array()}});
}
int times(GltfFile& file, const std::vector<float>& keys) {
  return file.floats("SCALAR", 1, keys);
}

/// Node 0 goes from x = 0 to x = 4 in two seconds; node 1, a morphing triangle; node 2 stays.
GltfFile moving() {
  GltfFile file;
  Json triangle = file.triangle();
  const int plain = file.mesh(triangle);
  triangle["attributes"]["NORMAL"] = file.vec3({0, 0, 1, 0, 0, 1, 0, 0, 1});
  triangle["targets"] = Json::array({{{"POSITION", file.vec3({0, 0, 8, 0, 0, 0, 0, 0, 0})}}});
  const int morphing = file.mesh(triangle);
  file.node({{"mesh", plain}, {"name", "goes"}});
  file.node({{"mesh", morphing}, {"name", "bends"}});
  file.node({{"mesh", plain}, {"name", "stays"}});
  animation(file, "first");
  channel(file, 0, "translation", times(file, {0, 2}), file.vec3({0, 0, 0, 4, 0, 0}));
  channel(file, 1, "weights", times(file, {0, 1}), file.floats("SCALAR", 1, {0, 1}));
  animation(file, "second");
  channel(file, 0, "translation", times(file, {0}), file.vec3({0, 9, 0}));
  return file;
}

float bend_of(const Scene& scene) {
  return position_of(scene.meshes.at(scene.instances.at(1).mesh).vertices.at(0)).z;
}

class GltfAnimation : public GltfTest {};

TEST_F(GltfAnimation, TimePosesWhatMovesAndNothingElse) {
  Scene scene = load(moving());
  ASSERT_EQ(scene.animation_count(), 2U);
  EXPECT_EQ(scene.rigs[0].instances.size(), 1U) << "only what moves is attached";
  scene.set_time(0.5);
  EXPECT_EQ(scene.instances[0].scene_from_object[3].x, 1);
  EXPECT_EQ(bend_of(scene), 4);
  EXPECT_EQ(scene.instances[2].scene_from_object, glm::dmat4(1.0));
  EXPECT_EQ(scene.meshes[scene.instances[1].mesh].bounds[1].z, 4);
  scene.set_time(100);
  EXPECT_EQ(scene.instances[0].scene_from_object[3].x, 4) << "the last key holds";
  EXPECT_EQ(bend_of(scene), 8);
}

TEST_F(GltfAnimation, ThePastIsTheLastFrameHoweverOftenTheTimeWasSet) {
  Scene scene = load(moving());
  scene.settle();
  for (const double time : {0.25, 0.75, 0.5}) {
    scene.set_time(time);
  }
  const Mesh& mesh = scene.meshes[scene.instances[1].mesh];
  EXPECT_EQ(scene.instances[0].previous_scene_from_object[3].x, 0);
  EXPECT_NE(mesh.shape, mesh.previous_shape);
  EXPECT_EQ(position_of(mesh.previous_vertices[0]).z, 0);
  EXPECT_EQ(position_of(mesh.vertices[0]).z, 4);
  scene.settle();
  EXPECT_EQ(scene.instances[0].previous_scene_from_object[3].x, 1);
  EXPECT_EQ(mesh.shape, mesh.previous_shape);
  scene.set_time(1);
  EXPECT_EQ(position_of(mesh.previous_vertices[0]).z, 4);
}

TEST_F(GltfAnimation, TheSameTimeAgainChangesNothing) {
  Scene scene = load(moving());
  scene.set_time(0.5);
  scene.settle();
  const std::uint64_t motion = scene.motion_revision, content = scene.content_revision;
  scene.set_time(0.5);
  EXPECT_EQ(scene.motion_revision, motion);
  EXPECT_EQ(scene.content_revision, content);
}

TEST_F(GltfAnimation, AnotherOneIsChosenOrNone) {
  Scene scene = load(moving());
  scene.set_time(0.5);
  scene.use_animation(1, false);
  EXPECT_EQ(scene.instances[0].scene_from_object[3].y, 9);
  EXPECT_EQ(scene.instances[0].scene_from_object[3].x, 0);
  EXPECT_EQ(bend_of(scene), 0) << "what the animation leaves alone is at rest";
  scene.use_animation(HEDDLE_NONE, false);
  EXPECT_EQ(scene.instances[0].scene_from_object, glm::dmat4(1.0));
  scene.use_animation(0, true);
  scene.set_time(3);
  EXPECT_EQ(scene.instances[0].scene_from_object[3].x, 2);
}

TEST_F(GltfAnimation, EveryFilePlaysItsOwn) {
  Scene scene = load(moving());
  load_gltf(scene, save(moving().glb()));
  ASSERT_EQ(scene.animation_count(), 4U);
  scene.use_animation(3, false);
  scene.set_time(0.5);
  EXPECT_EQ(scene.instances[0].scene_from_object[3].x, 1);
  EXPECT_EQ(scene.instances[3].scene_from_object[3].y, 9);
  EXPECT_EQ(bend_of(scene), 4);
  scene.use_animation(2, false);
  EXPECT_EQ(position_of(scene.meshes[scene.instances[4].mesh].vertices[0]).z, 4);
}

TEST_F(GltfAnimation, AFileIsLoadedAtTheScenesTimeAndHasNotMoved) {
  Scene scene;
  scene.set_time(0.5);
  load_gltf(scene, save(moving().glb()));
  EXPECT_EQ(scene.instances[0].scene_from_object[3].x, 1);
  EXPECT_EQ(scene.instances[0].previous_scene_from_object[3].x, 1);
  EXPECT_EQ(bend_of(scene), 4);
  EXPECT_FALSE(scene.settle());
}

TEST_F(GltfAnimation, LightsAndCamerasRide) {
  GltfFile file = moving();
  file.json["cameras"] = Json::array({{{"type", "perspective"}, {"perspective", {{"yfov", 1}, {"znear", 0.1}}}}});
  file.json["extensions"]["KHR_lights_punctual"]["lights"] = Json::array({{{"type", "point"}}});
  file.json["extensionsUsed"] = {"KHR_lights_punctual"};
  file.json["nodes"][0]["camera"] = 0;
  file.json["nodes"][0]["extensions"]["KHR_lights_punctual"]["light"] = 0;
  Scene scene = load(file);
  scene.set_time(1.5);
  EXPECT_EQ(scene.lights.at(0).position.x, 3);
  EXPECT_EQ(scene.cameras.at(0).record.position[0], 3);
}

TEST_F(GltfAnimation, TheMadeUpCameraShowsAllOfItAndStandsStill) {
  Scene scene = load(moving());
  const heddle_camera first = scene.active_camera(100, 100);
  scene.set_time(1.3);
  const heddle_camera later = scene.active_camera(100, 100);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(first.position[i], later.position[i]);
  }
  scene.use_animation(1, false);
  EXPECT_NE(scene.active_camera(100, 100).position[1], first.position[1]);
}

TEST_F(GltfAnimation, NormalizedIntegersOfEveryKindAreKeys) {
  GltfFile file;
  file.node({{"mesh", file.mesh(file.triangle())}});
  animation(file, "turn");
  // A half turn about z, as signed shorts: (0, 0, 1, 0); then as bytes.
  channel(file, 0, "rotation", times(file, {0, 1}),
          file.accessor(kShort, "VEC4", 4, std::vector<std::int16_t>{0, 0, 0, 32767, 0, 0, 32767, 0}, true));
  animation(file, "bytes");
  channel(file, 0, "rotation", times(file, {0, 1}),
          file.accessor(kByte, "VEC4", 4, std::vector<std::int8_t>{0, 0, 0, 127, 0, 0, 127, 0}, true));
  animation(file, "unsigned");
  channel(file, 0, "rotation", times(file, {0, 1}),
          file.accessor(kUnsignedByte, "VEC4", 4, std::vector<std::uint8_t>{0, 0, 0, 255, 0, 0, 255, 0}, true));
  animation(file, "unsigned shorts");
  channel(file, 0, "rotation", times(file, {0, 1}),
          file.accessor(kUnsignedShort, "VEC4", 4, std::vector<std::uint16_t>{0, 0, 0, 65535, 0, 0, 65535, 0}, true));
  Scene scene = load(file);
  scene.set_time(0.5);
  for (std::uint32_t id = 0; id < 4; ++id) {
    scene.use_animation(id, false);
    const glm::dvec4 turned = scene.instances[0].scene_from_object * glm::dvec4(1, 0, 0, 0);
    EXPECT_NEAR(glm::distance(glm::dvec3(turned), glm::dvec3(0, 1, 0)), 0, 1e-15) << id;
  }
}

TEST_F(GltfAnimation, MirroringJointsTurnTrianglesWhileTheyMove) {
  GltfFile file;
  Json triangle = file.triangle();
  triangle["attributes"]["NORMAL"] = file.vec3({0, 0, 1, 0, 0, 1, 0, 0, 1});
  triangle["attributes"]["JOINTS_0"] = file.accessor(kUnsignedByte, "VEC4", 4, std::vector<std::uint8_t>(12, 0));
  triangle["attributes"]["WEIGHTS_0"] = file.floats("VEC4", 4, {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  file.json["skins"] = Json::array({{{"joints", {1}}}});
  file.node({{"mesh", file.mesh(triangle)}, {"skin", 0}});
  file.node(Json::object());
  animation(file, "flip");
  channel(file, 1, "scale", times(file, {0, 1}), file.vec3({1, 1, 1, -1, 1, 1}));
  Scene scene = load(file);
  const std::uint64_t content = scene.content_revision;
  for (const double time : {0.25, 0.75, 1.0, 0.0}) {
    scene.set_time(time);
    const Mesh& mesh = scene.meshes[0];
    const glm::vec3 a = position_of(mesh.vertices[mesh.indices[0]]), b = position_of(mesh.vertices[mesh.indices[1]]),
                    c = position_of(mesh.vertices[mesh.indices[2]]);
    EXPECT_GT(glm::dot(glm::cross(b - a, c - a), normal_of(mesh.vertices[0])), 0) << time;
  }
  EXPECT_NE(scene.content_revision, content) << "the indices were changed";
}

TEST_F(GltfAnimation, WhatCannotBePosedLeavesTheSceneAsItWas) {
  GltfFile file;
  const int mesh = file.mesh(file.triangle());
  file.json["nodes"] = Json::array({{{"children", {1}}}, {{"mesh", mesh}, {"scale", {1e300, 1, 1}}}});
  file.json["scenes"][0]["nodes"] = {0};
  animation(file, "grows");
  channel(file, 0, "scale", times(file, {0, 1}), file.vec3({1, 1, 1, 1e30F, 1, 1}));
  Scene scene = load(file);
  const glm::dmat4 before = scene.instances[0].scene_from_object;
  EXPECT_THROW(scene.set_time(1), Error);
  EXPECT_EQ(scene.time, 0);
  EXPECT_EQ(scene.instances[0].scene_from_object, before);
}

class GltfAnimationErrors : public GltfTest {
 protected:
  void SetUp() override {
    GltfTest::SetUp();
    file_ = moving();
  }
  Json& first() { return file_.json["animations"][0]; }
  GltfFile file_;
};

TEST_F(GltfAnimationErrors, BrokenChannels) {
  const auto wrong = [&](const char* pointer, Json value) {
    GltfFile broken = file_;
    broken.json[Json::json_pointer(pointer)] = std::move(value);
    return error_of(broken);
  };
  EXPECT_EQ(wrong("/animations/0/channels/0/target/node", 7),
            "animation 0 'first': a channel moves node 7, which does not exist\n  found:    3 nodes");
  EXPECT_EQ(wrong("/animations/0/channels/0/sampler", 5),
            "animation 0 'first': a channel uses sampler 5, which does not exist\n  found:    2 samplers");
  EXPECT_EQ(wrong("/animations/0/samplers/0/interpolation", "BEZIER"),
            "animation 0 'first': sampler 0 has an unknown interpolation\n  found:    BEZIER\n"
            "  expected: LINEAR, STEP or CUBICSPLINE");
  EXPECT_EQ(wrong("/animations/0/samplers/0/interpolation", "CUBICSPLINE"),
            "values of sampler 0 of animation 0 'first': there are not as many as its 2 keys need\n"
            "  found:    6\n  expected: 18");
  EXPECT_EQ(wrong("/animations/0/samplers/0/input", 99),
            "times of sampler 0 of animation 0 'first': there is no accessor 99\n  found:    " +
                std::to_string(file_.json["accessors"].size()) + " accessors");
}

TEST_F(GltfAnimationErrors, TimesThatRunBackwards) {
  first()["samplers"][0]["input"] = file_.floats("SCALAR", 1, {2, 1});
  EXPECT_EQ(error_of(file_),
            "times of sampler 0 of animation 0 'first': key 1 is earlier than the one before\n  found:    1 after 2");
}

TEST_F(GltfAnimationErrors, UnknownPropertiesAndFixedNodesAreLeftOutAndSaid) {
  first()["channels"][0]["target"]["path"] = "pointer";
  Json extra = first()["channels"][1];
  extra["target"] = {{"node", 2}, {"path", "weights"}};
  first()["channels"].push_back(extra);
  file_.json["nodes"][2]["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  file_.json["animations"][1]["channels"][0]["target"]["node"] = 2;
  EXPECT_THAT(
      load(file_).warnings,
      testing::ElementsAre("animation 0 'first': a channel moves 'pointer', which is not known here",
                           "animation 0 'first': a channel weighs morph targets of node 2 'stays', which has none",
                           "animation 1 'second': node 2 'stays' has a matrix, which channels cannot move"));
}

class AnimatedUpload : public vulkan::OnDevice {
 protected:
  static Scene load_moving() {
    const std::filesystem::path path =
        std::filesystem::temp_directory_path() / ("heddle_animated_" + std::to_string(getpid()) + ".glb");
    std::ofstream(path, std::ios::binary) << moving().glb();
    Scene scene;
    load_gltf(scene, path);
    std::filesystem::remove(path);
    return scene;
  }
};

TEST_F(AnimatedUpload, WhatBendsIsCulledByItsShapeOfNow) {
  Scene scene = load_moving();
  const VkDescriptorSetLayout layout = make_materials_layout(*device_);
  {
    SceneBuffers buffers(*device_, layout);
    // Sees x and y from -20 to 20 and z from 5 to 8, where only a bent corner ever comes.
    heddle_camera camera{};
    camera.struct_size = sizeof camera;
    camera.position[2] = 9;
    camera.rotation[3] = 1;
    camera.is_orthographic = 1;
    camera.vertical_angle = 20;
    camera.aspect = 1;
    camera.near_distance = 1;
    camera.far_distance = 4;
    const Frustum frustum(make_view(camera, 16, 16, glm::dvec3(0.0)));
    for (const auto& [time, drawn] : std::map<double, std::uint32_t>{{0, 0}, {0.5, 0}, {0.75, 1}, {1, 1}, {0.25, 0}}) {
      scene.set_time(time);
      buffers.update(scene, glm::dvec3(0.0));
      std::uint32_t found = 0, culled = 0;
      for (const DrawGroup& group : buffers.groups()) {
        found += buffers.draws().visible(group, &frustum).drawn;
        culled += buffers.draws().visible(group, &frustum).culled;
      }
      EXPECT_EQ(found, drawn) << "at " << time;
      EXPECT_EQ(found + culled, 3U);
      scene.settle();
    }
  }
}

TEST_F(AnimatedUpload, BentShapesTakeTurnsAndFramesAtOneTimeUploadNothing) {
  const VkDescriptorSetLayout layout = make_materials_layout(*device_);
  Scene scene = load_moving();
  {
    SceneBuffers buffers(*device_, layout);
    const auto frame = [&](double time) {
      scene.set_time(time);
      const std::uint64_t before = device_->counters().uploaded_bytes;
      buffers.update(scene, {0, 0, 0});
      return device_->counters().uploaded_bytes - before;
    };
    // Positions that the draw command of the bent mesh shows, now and before.
    const auto shown = [&] {
      std::array<float, 2> z{};
      const std::vector<std::byte> commands = device_->read_back(buffers.commands(), 0, buffers.commands().size());
      const std::vector<std::byte> vertices = device_->read_back(buffers.vertices(), 0, buffers.vertices().size());
      const std::vector<std::byte> instances = device_->read_back(buffers.instances(), 0, buffers.instances().size());
      std::size_t found = 0;
      for (std::size_t i = 0; i < instances.size() / sizeof(HeddleInstance); ++i) {
        HeddleInstance instance;
        std::memcpy(&instance, &instances[i * sizeof instance], sizeof instance);
        if (instance.object != 1) continue;
        for (std::size_t k = 0; (k + 1) * sizeof(VkDrawIndexedIndirectCommand) <= commands.size(); ++k) {
          VkDrawIndexedIndirectCommand command;
          std::memcpy(&command, &commands[k * sizeof command], sizeof command);
          if (command.instanceCount == 0 || command.firstInstance != i) continue;
          HeddleVertex now, before;
          const auto index = static_cast<std::uint32_t>(command.vertexOffset);
          std::memcpy(&now, &vertices[index * sizeof now], sizeof now);
          std::memcpy(&before, &vertices[std::uint32_t{index + instance.previous_vertex} * sizeof now], sizeof now);
          z = {now.position[2], before.position[2]};
          ++found;
        }
      }
      EXPECT_EQ(found, 1U);
      return z;
    };
    const std::size_t shape = 3 * sizeof(HeddleVertex), places = 3 * sizeof(HeddleInstance);
    frame(0);
    EXPECT_THAT(shown(), testing::ElementsAre(0, 0));
    scene.settle();
    EXPECT_EQ(frame(0.25), shape + places + buffers.commands().size()) << "one shape, and which of the two is now";
    EXPECT_THAT(shown(), testing::ElementsAre(2, 0));
    scene.settle();
    EXPECT_EQ(frame(0.5), shape + places + buffers.commands().size());
    EXPECT_THAT(shown(), testing::ElementsAre(4, 2));
    scene.settle();
    EXPECT_EQ(frame(0.5), places) << "what moved has arrived";
    EXPECT_THAT(shown(), testing::ElementsAre(4, 4));
    scene.settle();
    EXPECT_EQ(frame(0.5), 0U);
    scene.settle();
    EXPECT_EQ(frame(0.5), 0U);
    // Set twice before a frame: the past is what was last drawn.
    scene.set_time(0.75);
    frame(1);
    EXPECT_THAT(shown(), testing::ElementsAre(8, 4));
    // Buffers that come late have both shapes too.
    SceneBuffers late(*device_, layout);
    late.update(scene, {0, 0, 0});
    const std::vector<std::byte> vertices = device_->read_back(late.vertices(), 0, late.vertices().size());
    std::vector<float> z;
    for (std::size_t i = 0; i < vertices.size() / sizeof(HeddleVertex); ++i) {
      HeddleVertex vertex;
      std::memcpy(&vertex, &vertices[i * sizeof vertex], sizeof vertex);
      z.push_back(vertex.position[2]);
    }
    EXPECT_THAT(z, testing::IsSupersetOf({8.0F, 4.0F}));
  }
}

}  // namespace
}  // namespace heddle::scene
