// SPDX-License-Identifier: Apache-2.0
// Scene overlays: what they change, and what is said of their mistakes.
#include "scene/overlay.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "unit/scene/gltf_fixture.hpp"

namespace heddle::scene {
namespace {

using Json = nlohmann::json;

class SceneOverlay : public GltfTest {
 protected:
  void SetUp() override {
    GltfTest::SetUp();
    GltfFile file;
    Json triangle = file.triangle();
    triangle["material"] = 0;
    file.json["materials"] = Json::array({{{"name", "paint"}}});
    file.json["cameras"] = Json::array({{{"type", "perspective"}, {"perspective", {{"yfov", 1}, {"znear", 0.1}}}}});
    file.json["extensions"]["KHR_lights_punctual"]["lights"] = Json::array({{{"type", "point"}, {"name", "lamp"}}});
    file.json["extensionsUsed"] = {"KHR_lights_punctual"};
    file.node({{"mesh", file.mesh(triangle)}});
    file.node({{"name", "eye"}, {"camera", 0}});
    file.node({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}, {"translation", {1, 2, 3}}});
    const int times = file.floats("SCALAR", 1, {0, 2});
    const int values = file.vec3({0, 0, 0, 4, 0, 0});
    for (const char* name : {"Walk", "Run"}) {
      file.json["animations"].push_back(
          {{"name", name},
           {"samplers", Json::array({{{"input", times}, {"output", values}}})},
           {"channels", Json::array({{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}})}});
    }
    save(file.glb());
  }
  Scene apply(const std::string& text) const {
    Scene scene;
    load_overlay(scene, save("file = \"a.glb\"\n" + text, "a.scene.toml"));
    return scene;
  }
  /// The message, without the folder.
  std::string mistake(const std::string& text) const {
    Scene scene;
    const std::uint64_t revision = scene.content_revision;
    const std::filesystem::path file = save(text, "a.scene.toml");
    try {
      load_overlay(scene, file);
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), HEDDLE_BAD_INPUT);
      EXPECT_EQ(scene.content_revision, revision);
      EXPECT_TRUE(scene.instances.empty() && scene.cameras.empty() && scene.lights.empty());
      std::string message = error.what();
      for (std::size_t at = 0; (at = message.find(folder_.string() + "/")) != std::string::npos;) {
        message.erase(at, folder_.string().size() + 1);
      }
      return message;
    }
    return "no error";
  }
};

TEST_F(SceneOverlay, ChangesWhatIsNamedAndLeavesTheRest) {
  const Scene scene = apply(R"(
[[material]]
name = "paint"
base_color = [0.1, 0.2, 0.3, 1]
roughness = 0.25
alpha_mode = "mask"
double_sided = true
[[light]]
name = "lamp"
intensity = [7, 8, 9]
range = 3
)");
  const HeddleMaterial& paint = scene.materials.at(0).record;
  EXPECT_EQ(paint.base_color[1], 0.2F);
  EXPECT_EQ(paint.roughness, 0.25F);
  EXPECT_EQ(paint.metalness, 1.0F) << "as in the file";
  EXPECT_EQ(paint.alpha_mode, HEDDLE_ALPHA_MASK);
  EXPECT_EQ(paint.flags, HEDDLE_MATERIAL_DOUBLE_SIDED);
  ASSERT_EQ(scene.lights.size(), 1U);
  EXPECT_EQ(scene.lights[0].record.intensity[2], 9.0F);
  EXPECT_EQ(scene.lights[0].record.range, 3.0F);
  EXPECT_EQ(scene.lights[0].record.type, HEDDLE_LIGHT_POINT);
  EXPECT_EQ(scene.lights[0].position, glm::dvec3(1, 2, 3));
}

TEST_F(SceneOverlay, NewNamesAddLightsAndCameras) {
  const Scene scene = apply(R"(
use_camera = "entrance"
[[camera]]
name = "entrance"
position = [0, 0, 5]
target = [0, 0, 1]
vertical_angle = 0.5
[[camera]]
name = "plan"
position = [0, 9, 0]
target = [0, 0, 0]
orthographic_half_height = 4
[[light]]
name = "sun"
type = "directional"
intensity = [1000, 1000, 900]
direction = [0, -2, 0]
)");
  ASSERT_EQ(scene.cameras.size(), 3U);
  EXPECT_EQ(scene.camera, 1U);
  const heddle_camera& entrance = scene.cameras[1].record;
  EXPECT_EQ(entrance.position[2], 5);
  EXPECT_NEAR(std::abs(entrance.rotation[3]), 1, 1e-15) << "along -Z, as a camera at rest";
  EXPECT_EQ(entrance.vertical_angle, 0.5);
  EXPECT_EQ(scene.cameras[2].record.is_orthographic, 1U);
  EXPECT_EQ(scene.cameras[2].record.vertical_angle, 4);
  ASSERT_EQ(scene.lights.size(), 2U);
  EXPECT_EQ(scene.lights[1].record.direction[1], -1.0F);
  EXPECT_EQ(scene.lights[1].record.id, 1U);
  EXPECT_EQ(scene.lights[1].record.flags, HEDDLE_LIGHT_CASTS_SHADOW);
}

TEST_F(SceneOverlay, PlaysAnAnimationOrNone) {
  Scene scene = apply("animation = \"Run\"\nloop = true");
  EXPECT_EQ(scene.rigs.at(0).animation, 1U);
  EXPECT_TRUE(scene.rigs[0].loops);
  scene = apply("animation = \"none\"");
  EXPECT_EQ(scene.rigs.at(0).animation, HEDDLE_NONE);
}

TEST_F(SceneOverlay, WithoutAFileChangesTheSceneThatIsThere) {
  Scene scene;
  load_gltf(scene, folder_ / "a.glb");
  const std::uint64_t revision = scene.content_revision;
  load_overlay(scene, save("[[material]]\nname = \"paint\"\nmetalness = 0\n", "b.scene.toml"));
  EXPECT_EQ(scene.materials.at(0).record.metalness, 0.0F);
  EXPECT_NE(scene.content_revision, revision);
  EXPECT_EQ(scene.instances.size(), 1U);
}

TEST_F(SceneOverlay, AllMistakesAreReportedWithTheirPlaces) {
  EXPECT_EQ(mistake("file = \"a.glb\"\n"
                    "colour = 1\n"
                    "use_camera = \"eey\"\n"
                    "animation = \"Wakl\"\n"
                    "[[material]]\n"
                    "name = \"pant\"\n"
                    "roughness = 7\n"
                    "ior = 0\n"
                    "[[light]]\n"
                    "name = \"lamp\"\n"
                    "type = \"sopt\"\n"
                    "direction = [0, 0, 0]\n"
                    "intensity = [1, 2]\n"
                    "[[light]]\n"
                    "name = \"another\"\n"
                    "radius = \"wide\"\n"
                    "[[camera]]\n"
                    "position = [0, 0, 0]\n"
                    "[[camera]]\n"
                    "name = \"eye\"\n"
                    "vertical_angle = nan\n"
                    "nera = 1\n"),
            "a.scene.toml:2:1: error: the overlay: unknown key 'colour'\n"
            "  expected: one of file, camera, light, material, instance, components, use_camera, animation, loop\n"
            "a.scene.toml:3:14: error: the overlay: the scene has no camera 'eey'\n"
            "  expected: one of eye\n"
            "  help:     did you mean 'eye'?\n"
            "a.scene.toml:4:13: error: the overlay: the scene has no animation 'Wakl'\n"
            "  expected: one of Walk, Run\n"
            "  help:     did you mean 'Walk'?\n"
            "a.scene.toml:6:8: error: material 'pant': the scene has no such material\n"
            "  expected: one of paint\n"
            "  help:     did you mean 'paint'?\n"
            "a.scene.toml:7:13: error: material 'pant': 'roughness' is out of range\n"
            "  found:    7\n"
            "  expected: 0 to 1\n"
            "a.scene.toml:8:7: error: material 'pant': 'ior' is out of range\n"
            "  found:    0\n"
            "  expected: at least 1\n"
            "a.scene.toml:11:8: error: light 'lamp': there is no type 'sopt'\n"
            "  expected: one of directional, point, spot, sphere, capsule, cone, wedge, box, rectangle, environment\n"
            "  help:     did you mean 'spot'?\n"
            "a.scene.toml:12:13: error: light 'lamp': 'direction' has no length\n"
            "  expected: a direction\n"
            "a.scene.toml:13:13: error: light 'lamp': 'intensity' is of the wrong form\n"
            "  found:    2 numbers\n"
            "  expected: 3 numbers\n"
            "a.scene.toml:14:1: error: light 'another': a new light needs a type and an intensity\n"
            "  expected: type = \"point\", intensity = [1, 1, 1]\n"
            "  help:     to change a light, write the name that it has\n"
            "a.scene.toml:16:10: error: light 'another': 'radius' is of the wrong type\n"
            "  expected: a number\n"
            "a.scene.toml:17:1: error: camera: it has no name\n"
            "  expected: name = \"...\", of the camera that it changes\n"
            "a.scene.toml:21:18: error: camera 'eye': 'vertical_angle' is out of range\n"
            "  found:    nan\n"
            "  expected: 1e-06 to 3.14159\n"
            "a.scene.toml:22:1: error: camera 'eye': unknown key 'nera'\n"
            "  expected: one of name, position, target, vertical_angle, orthographic_half_height, near\n"
            "  help:     did you mean 'near'?");
}

TEST_F(SceneOverlay, FilesThatAreNone) {
  EXPECT_THAT(mistake("file = "), testing::StartsWith("a.scene.toml:1:8: error: this is no TOML: "));
  EXPECT_EQ(mistake("file = \"b.glb\""), "b.glb: error: there is no such file");
  EXPECT_EQ(mistake("[camera]\nname = \"eye\"\n"),
            "a.scene.toml:1:1: error: the overlay: 'camera' is of the wrong form\n"
            "  expected: [[camera]] before the keys of each, in two brackets");
  Scene scene;
  EXPECT_THROW(load_overlay(scene, folder_ / "none.scene.toml"), Error);
}

}  // namespace
}  // namespace heddle::scene
