// SPDX-License-Identifier: Apache-2.0
// Components of a scene: attached, merged, read from glTF files and overlays, and laid out for shaders.
#include "scene/components.hpp"
#include "parsed.hpp"

#include <gmock/gmock.h>

#include <cstring>

#include "scene/overlay.hpp"
#include "unit/scene/gltf_fixture.hpp"

namespace heddle::scene {
namespace {

using testing::ElementsAre;
using Json = nlohmann::json;

ComponentProperty property(std::string name, PropertyType type, double value = 0) {
  ComponentProperty made;
  made.name = std::move(name);
  made.type = type;
  made.default_value[0] = value;
  return made;
}

class SceneComponents : public GltfTest {
 protected:
  SceneComponents() {
    lamp_.name = "lamp.settings";
    lamp_.on = {Owner::kLight};
    lamp_.properties = {property("power", PropertyType::kInt, 7), property("reach", PropertyType::kFloat)};
    lamp_.properties[1].range = {{0, 10}};
    tag_.name = "tag.mark";
    tag_.on = {Owner::kInstance, Owner::kMaterial, Owner::kScene};
    tag_.properties = {property("number", PropertyType::kInt)};
    catalog_.add(lamp_);
    catalog_.add(tag_);
  }
  void SetUp() override {
    GltfTest::SetUp();
    Json triangle = file_.triangle();
    triangle["material"] = 0;
    file_.json["materials"] = Json::array({{{"name", "paint"}}});
    file_.json["extensions"]["KHR_lights_punctual"]["lights"] = Json::array({{{"type", "point"}, {"name", "lamp"}}});
    file_.json["extensionsUsed"] = {"KHR_lights_punctual", "HEDDLE_components"};
    file_.node({{"name", "box"}, {"mesh", file_.mesh(triangle)}});
    file_.node({{"name", "post"}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  }
  Scene load_with_catalog() const {
    Scene scene;
    scene.components.catalog = &catalog_;
    load_gltf(scene, save(file_.glb()));
    return scene;
  }
  /// "lamp.settings light 0: 7 3 | 2": name, owner, values, which were written.
  static std::vector<std::string> list(const Scene& scene) {
    std::vector<std::string> texts;
    for (const Component& component : scene.components.all()) {
      std::string text =
          component.type->name + " " + std::string(to_word(component.owner)) + " " + std::to_string(component.id) + ":";
      for (const double value : component.values) text += " " + std::to_string(static_cast<int>(value));
      texts.push_back(text + " | " + std::to_string(component.written));
    }
    return texts;
  }
  std::string message(const std::function<void()>& work) const {
    try {
      work();
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), HEDDLE_BAD_INPUT);
      std::string text = error.what();
      for (std::size_t at = 0; (at = text.find(folder_.string() + "/")) != std::string::npos;) {
        text.erase(at, folder_.string().size() + 1);
      }
      return text;
    }
    return "no error";
  }

  ComponentType lamp_, tag_;
  ComponentCatalog catalog_;
  GltfFile file_;
};

TEST_F(SceneComponents, OfAFileComeFromExtrasAndTheExtension) {
  file_.json["nodes"][0]["extras"] = {{"heddle", {{"tag.mark", {{"number", 1}}}}}, {"blender", {{"tag.mark", 5}}}};
  file_.json["nodes"][1]["extensions"]["HEDDLE_components"] = {{"lamp.settings", {{"reach", 3}}}};
  file_.json["materials"][0]["extras"]["heddle"]["tag.mark"]["number"] = 2;
  file_.json["scenes"][0]["extensions"]["HEDDLE_components"]["tag.mark"]["number"] = 3;
  const Scene scene = load_with_catalog();
  EXPECT_THAT(list(scene), ElementsAre("lamp.settings light 0: 7 3 | 2", "tag.mark scene 0: 3 | 1",
                                       "tag.mark instance 0: 1 | 1", "tag.mark material 0: 2 | 1"));
  EXPECT_TRUE(scene.ignored_extensions.empty());
}

TEST_F(SceneComponents, OfASharedMeshOrLightYieldToTheNodes) {
  file_.json["extensions"]["KHR_lights_punctual"]["lights"][0]["extras"]["heddle"]["lamp.settings"] = {{"power", 1},
                                                                                                       {"reach", 2}};
  file_.json["nodes"][1]["extras"]["heddle"]["lamp.settings"]["reach"] = 5;
  file_.json["meshes"][0]["extras"]["heddle"]["tag.mark"]["number"] = 4;
  EXPECT_THAT(list(load_with_catalog()), ElementsAre("lamp.settings light 0: 1 5 | 3", "tag.mark instance 0: 4 | 1"));
}

TEST_F(SceneComponents, OfAFileAreCheckedWithTheirJsonPointers) {
  file_.json["nodes"][0]["extras"]["heddle"] = {{"tag.mrk", Json::object()}, {"lamp.settings", {{"rech", 1}}}};
  file_.json["nodes"][1]["extras"]["heddle"]["lamp.settings"]["reach"] = 11;
  file_.json["materials"][0]["extras"]["heddle"] = "tag.mark";
  Scene scene;
  scene.components.catalog = &catalog_;
  EXPECT_EQ(
      message([&] { load_gltf(scene, save(file_.glb())); }),
      "a.glb: error: /nodes/0/extras/heddle/lamp.settings: the component 'lamp.settings' cannot sit here\n"
      "  found:    instance\n"
      "  expected: light\n"
      "a.glb: error: /nodes/0/extras/heddle/lamp.settings/rech: the component 'lamp.settings' has no property 'rech'\n"
      "  expected: one of power, reach\n"
      "  help:     did you mean 'reach'?\n"
      "a.glb: error: /nodes/0/extras/heddle/tag.mrk: no role reads a component 'tag.mrk'\n"
      "  expected: one of lamp.settings, tag.mark\n"
      "  help:     did you mean 'tag.mark'?\n"
      "a.glb: error: /nodes/1/extras/heddle/lamp.settings/reach: 'reach' is out of range\n"
      "  found:    11\n"
      "  expected: a number, 0 to 10\n"
      "a.glb: error: /materials/0/extras/heddle: this is of the wrong form\n"
      "  found:    \"tag.mark\"\n"
      "  expected: an object of components by name");
  EXPECT_TRUE(scene.instances.empty() && scene.components.all().empty());
}

TEST_F(SceneComponents, WithoutPropertiesAreThereAllTheSame) {
  file_.json["nodes"][0]["extras"]["heddle"]["tag.mark"] = Json::object();
  EXPECT_THAT(list(load_with_catalog()), ElementsAre("tag.mark instance 0: 0 | 0"));
}

TEST_F(SceneComponents, OfAnOverlayChangeWhatIsThere) {
  file_.json["nodes"][1]["extras"]["heddle"]["lamp.settings"] = {{"power", 1}, {"reach", 2}};
  Scene scene = load_with_catalog();
  load_overlay(scene, save("components.tag.mark.number = 9\n"
                           "[[light]]\nname = \"lamp\"\ncomponents.lamp.settings.power = 5\n"
                           "[[instance]]\nname = \"box\"\ncomponents.\"tag.mark\" = { number = 6 }\n"
                           "[[material]]\nname = \"paint\"\ncomponents.tag.mark.number = 7\n",
                           "a.scene.toml"));
  EXPECT_THAT(list(scene), ElementsAre("lamp.settings light 0: 5 2 | 3", "tag.mark scene 0: 9 | 1",
                                       "tag.mark instance 0: 6 | 1", "tag.mark material 0: 7 | 1"));
}

TEST_F(SceneComponents, OfAnOverlayAreCheckedWithTheirPlaces) {
  Scene scene = load_with_catalog();
  EXPECT_EQ(message([&] {
              load_overlay(scene, save("[[light]]\nname = \"lamp\"\ncomponents.lamp.settings.powr = 5\n"
                                       "components.tag.mark.number = 1\n"
                                       "[[instance]]\nname = \"bx\"\n",
                                       "a.scene.toml"));
            }),
            "a.scene.toml:3:26: error: light 'lamp': the component 'lamp.settings' has no property 'powr'\n"
            "  expected: one of power, reach\n"
            "  help:     did you mean 'power'?\n"
            "a.scene.toml:4:16: error: light 'lamp': the component 'tag.mark' cannot sit here\n"
            "  found:    light\n"
            "  expected: instance or material or scene\n"
            "a.scene.toml:6:8: error: instance 'bx': the scene has no such instance\n"
            "  expected: one of box\n"
            "  help:     did you mean 'box'?");
}

TEST_F(SceneComponents, AreFeaturesAndMoveWithTheirThingsWhenFilesAreMerged) {
  file_.json["nodes"][1]["extras"]["heddle"]["lamp.settings"]["power"] = 1;
  file_.json["nodes"][0]["extras"]["heddle"]["tag.mark"]["number"] = 2;
  Scene scene = load_with_catalog();
  const std::uint64_t before = scene.components.revision();
  load_gltf(scene, save(file_.glb()));
  EXPECT_GT(scene.components.revision(), before);
  EXPECT_THAT(list(scene), ElementsAre("lamp.settings light 0: 1 0 | 1", "lamp.settings light 1: 1 0 | 1",
                                       "tag.mark instance 0: 2 | 1", "tag.mark instance 1: 2 | 1"));
  EXPECT_THAT(scene.features(), ElementsAre("surfaces", "lights", "lamp.settings", "tag.mark"));
  const Json described = parsed::json(scene.describe_json());
  EXPECT_EQ(described["components"][0].dump(),
            R"({"id":0,"name":"lamp.settings","on":"light","properties":{"power":1}})");
}

TEST_F(SceneComponents, ReachShadersWithDefaultsForOwnersWithout) {
  Components components;
  ComponentValues values{&lamp_, {-2, 0.5}, 3};
  components.attach(values, Owner::kLight, 1);
  const std::vector<std::byte> bytes = component_elements(components, lamp_, Owner::kLight);
  struct Element {
    std::uint32_t is_present, written;
    std::int32_t power;
    float reach;
  };
  ASSERT_EQ(bytes.size(), 2 * sizeof(Element));
  std::array<Element, 2> elements{};
  std::memcpy(elements.data(), bytes.data(), bytes.size());
  EXPECT_EQ(elements[0].is_present, 0U);
  EXPECT_EQ(elements[0].power, 7);
  EXPECT_EQ(elements[1].is_present, 1U);
  EXPECT_EQ(elements[1].written, 3U);
  EXPECT_EQ(elements[1].power, -2);
  EXPECT_EQ(elements[1].reach, 0.5F);
  EXPECT_TRUE(component_elements(components, tag_, Owner::kInstance).empty());
}

}  // namespace
}  // namespace heddle::scene
