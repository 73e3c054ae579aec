// SPDX-License-Identifier: Apache-2.0
// Components: how role.toml declares them, how their elements lie in memory, and what is said of wrong values.
#include "plugin/component.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "plugin/technique.hpp"

namespace heddle {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;

ComponentProperty property(std::string name, PropertyType type, std::array<double, 3> value = {0, 0, 0}) {
  ComponentProperty made;
  made.name = std::move(name);
  made.type = type;
  made.default_value = value;
  return made;
}

ComponentType cloud() {
  ComponentType type;
  type.name = "cloud.layer";
  type.on = {Owner::kScene, Owner::kInstance};
  type.properties = {property("density", PropertyType::kFloat, {0.5, 0, 0}),
                     property("octaves", PropertyType::kInt),
                     property("tint", PropertyType::kColor, {1, 2, 3}),
                     property("is_lit", PropertyType::kBool),
                     property("shape", PropertyType::kChoice),
                     property("wind", PropertyType::kFloat3)};
  type.properties[0].unit = "1/m";
  type.properties[0].range = {{0, 2}};
  type.properties[4].choices = {"flat", "billowy"};
  return type;
}

TEST(Component, ElementsFollowStd430) {
  // GLSL 4.60, 7.6.2.2: scalars align to 4, vec3 to 16 and take 12, so a scalar may follow in the same 16.
  const ComponentLayout layout = component_layout(cloud());
  EXPECT_THAT(layout.offsets, ElementsAre(8, 12, 16, 28, 32, 48));
  EXPECT_EQ(layout.stride, 64U);
  ComponentType small;
  small.properties = {property("a", PropertyType::kFloat)};
  EXPECT_EQ(component_layout(small).stride, 12U);
}

TEST(Component, IsDeclaredToShadersWithABitForEachProperty) {
  ComponentType type;
  type.name = "snow.surface_layer";
  type.on = {Owner::kMaterial};
  type.properties = {property("depth", PropertyType::kFloat, {0.25, 0, 0}),
                     property("tint", PropertyType::kColor, {1, 0.5, 0}), property("count", PropertyType::kInt, {-3})};
  EXPECT_EQ(component_port(type, Owner::kMaterial), "snow_surface_layer_material");
  EXPECT_EQ(
      component_glsl(type),
      "#ifndef HeddleSnowSurfaceLayer_DECLARED\n"
      "#define HeddleSnowSurfaceLayer_DECLARED\n"
      "struct HeddleSnowSurfaceLayer { uint is_present; uint written; float depth; vec3 tint; int count; };\n"
      "const uint HeddleSnowSurfaceLayer_depth = 1u;\n"
      "const uint HeddleSnowSurfaceLayer_tint = 2u;\n"
      "const uint HeddleSnowSurfaceLayer_count = 4u;\n"
      "HeddleSnowSurfaceLayer HeddleSnowSurfaceLayer_absent() { return HeddleSnowSurfaceLayer(0u, 0u, float(0.25), "
      "vec3(float(1), float(0.5), float(0)), -3); }\n"
      "#endif\n");
}

class ComponentValue : public testing::Test {
 protected:
  ComponentValue() { catalog_.add(type_); }
  std::optional<ComponentValues> read(std::string_view json, std::string_view name = "cloud.layer",
                                      Owner owner = Owner::kScene) {
    problems_.clear();
    GivenComponent given{std::string(name), {"a.toml", 3, 1}, "scene", {}};
    const Json properties = parse_json(json);
    for (const auto& [key, value] : properties.items()) given.properties.push_back({key, value, {}, "scene"});
    return read_component(&catalog_, given, {&owner, 1}, problems_);
  }
  std::string message(std::string_view json, std::string_view name = "cloud.layer", Owner owner = Owner::kScene) {
    EXPECT_FALSE(read(json, name, owner).has_value());
    return to_text(problems_);
  }
  ComponentType type_ = cloud();
  ComponentCatalog catalog_;
  std::vector<Diagnostic> problems_;
};

TEST_F(ComponentValue, IsReadWithDefaultsWhereNothingIsWritten) {
  const auto values = read(R"({"octaves": 3.0, "is_lit": true, "shape": "billowy", "wind": [1, -2.5, 3]})");
  ASSERT_TRUE(values.has_value()) << to_text(problems_);
  EXPECT_THAT(values->values, ElementsAre(0.5, 3, 1, 2, 3, 1, 1, 1, -2.5, 3));
  EXPECT_EQ(values->written, 0b111010U);
}

TEST_F(ComponentValue, OfANameThatNoRoleReadsIsAnErrorWithTheNearestName) {
  EXPECT_EQ(message("{}", "cloud.layr"),
            "a.toml:3:1: error: scene: no role reads a component 'cloud.layr'\n"
            "  expected: one of cloud.layer\n"
            "  help:     did you mean 'cloud.layer'?");
}

TEST_F(ComponentValue, OnAThingThatItCannotSitOnIsAnError) {
  EXPECT_EQ(message("{}", "cloud.layer", Owner::kLight),
            "a.toml:3:1: error: scene: the component 'cloud.layer' cannot sit here\n"
            "  found:    light\n"
            "  expected: scene or instance");
}

TEST_F(ComponentValue, OfAnUnknownPropertyIsAnErrorWithTheNearestName) {
  EXPECT_EQ(message(R"({"denisty": 1})"),
            "error: scene: the component 'cloud.layer' has no property 'denisty'\n"
            "  expected: one of density, octaves, tint, is_lit, shape, wind\n"
            "  help:     did you mean 'density'?");
}

TEST_F(ComponentValue, OfAWrongTypeSaysWhatIsExpected) {
  EXPECT_EQ(message(R"({"density": "1"})"),
            "error: scene: 'density' has the wrong type\n  found:    \"1\"\n  expected: a number, 1/m, 0 to 2");
  EXPECT_EQ(message(R"({"octaves": 2.5})"),
            "error: scene: 'octaves' has the wrong type\n  found:    2.5\n  expected: an integer");
  EXPECT_EQ(message(R"({"tint": [1, 2]})"),
            "error: scene: 'tint' has the wrong type\n  found:    [1,2]\n  expected: three numbers");
  EXPECT_EQ(message(R"({"is_lit": 1})"),
            "error: scene: 'is_lit' has the wrong type\n  found:    1\n  expected: true or false");
  EXPECT_EQ(message(R"({"shape": "bilowy"})"),
            "error: scene: 'shape' has the wrong word\n  found:    \"bilowy\"\n  expected: one of flat, billowy\n"
            "  help:     did you mean 'billowy'?");
}

TEST_F(ComponentValue, OutOfRangeSaysTheRange) {
  EXPECT_EQ(message(R"({"density": -0.1})"),
            "error: scene: 'density' is out of range\n  found:    -0.1\n  expected: a number, 1/m, 0 to 2");
  EXPECT_EQ(message(R"({"wind": [0, 1e39, 0]})"),
            "error: scene: 'wind' is out of range\n  found:    [0,1e+39,0]\n  expected: three numbers");
  EXPECT_EQ(message(R"({"octaves": 3000000000})"),
            "error: scene: 'octaves' is out of range\n  found:    3000000000\n  expected: an integer");
}

TEST_F(ComponentValue, ReportsAllMistakesAtOnce) {
  EXPECT_FALSE(read(R"({"density": 3, "tnt": 1, "is_lit": 0})").has_value());
  EXPECT_EQ(problems_.size(), 3U);
}

class ComponentDeclaration : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name() / "blur";
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_.parent_path()); }
  Role read(std::string_view text) const {
    std::ofstream(folder_ / "role.toml")
        << "role = \"blur\"\nrevision = 1\ntitle = \"A blur\"\n[[port]]\nname = \"a\"\n"
           "direction = \"out\"\ntype = \"image\"\nhelp = \"h\"\n"
        << text;
    return read_role(folder_ / "role.toml");
  }
  std::string message(std::string_view text) const {
    try {
      (void)read(text);
    } catch (const Error& error) {
      std::string what = error.what();
      const std::string prefix = folder_.string() + "/";
      for (std::size_t at = 0; (at = what.find(prefix)) != std::string::npos;) what.erase(at, prefix.size());
      return what;
    }
    return "no error";
  }
  fs::path folder_;
};

TEST_F(ComponentDeclaration, IsReadAsWritten) {
  const Role role = read(R"toml([[component]]
name = "snow.surface"
on = ["material", "instance"]
title = "Where snow lies"
[[component.property]]
name = "depth"
type = "float"
unit = "m"
range = [0, 10]
default = 0.25
help = "of the layer"
[[component.property]]
name = "kind"
type = "choice"
choices = ["fresh", "old"]
default = "old"
help = "its look"
)toml");
  ASSERT_EQ(role.components.size(), 1U);
  const ComponentType& type = role.components[0];
  EXPECT_EQ(type.name, "snow.surface");
  EXPECT_THAT(type.on, ElementsAre(Owner::kMaterial, Owner::kInstance));
  EXPECT_EQ(type.title, "Where snow lies");
  ASSERT_EQ(type.properties.size(), 2U);
  EXPECT_EQ(type.properties[0].unit, "m");
  EXPECT_TRUE(type.properties[0].has_default);
  EXPECT_EQ(type.properties[0].default_value[0], 0.25);
  EXPECT_THAT(type.properties[1].choices, ElementsAre("fresh", "old"));
  EXPECT_EQ(type.properties[1].default_value[0], 1);
}

TEST_F(ComponentDeclaration, IsCheckedLikeTheRestOfARole) {
  EXPECT_EQ(message("[[component]]\nname = \"snow\"\non = [\"rock\"]\ntitle = \"t\"\ncolour = 1\n"),
            "role.toml:13:1: error: component 'snow' has no key 'colour'\n"
            "  expected: one of name, on, title, property\n"
            "role.toml:10:8: error: component: 'name' is no name of a component\n"
            "  found:    \"snow\"\n"
            "  expected: two names with a dot between, \"cloud.layer\"\n"
            "role.toml:11:7: error: component 'snow': 'on' has a wrong element\n"
            "  found:    the string \"rock\"\n"
            "  expected: a list of some of \"scene\", \"instance\", \"material\", \"light\"");
  EXPECT_EQ(message("[[component]]\nname = \"a.b\"\non = [\"light\"]\ntitle = \"t\"\n[[component.property]]\n"
                    "name = \"x\"\ntype = \"float\"\nrange = [0, 1]\ndefault = 2\nhelp = \"h\"\n"),
            "role.toml:17:11: error: component 'a.b': property 'x': its default: 'x' is out of range\n"
            "  found:    2\n"
            "  expected: a number, 0 to 1");
}

}  // namespace
}  // namespace heddle
