// SPDX-License-Identifier: Apache-2.0
// Folders of plugins: what is found, what wins, and what is said of a technique that breaks its role's contract.
#include "plugin/registry.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <ctime>
#include <fstream>
#include <functional>

#include "diagnostics.hpp"

namespace heddle {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::string_view kBlurRole = R"toml(role = "blur"
revision = 2
title = "A blur"
[[port]]
name = "radiance"
direction = "in"
type = "image"
help = "the role's help"
[[port]]
name = "weights"
direction = "in"
type = "value"
glsl = "float weights[];"
help = "h"
[[port]]
name = "color"
direction = "out"
type = "image"
help = "h"
)toml";
constexpr std::string_view kNoiseRole = R"toml(role = "noise"
revision = 1
title = "A noise"
[[function]]
name = "noise"
signature = "float noise(vec3 x)"
neutral = "return 0.0;"
help = "h"
)toml";

Port port(std::string name, PortType type, Direction direction) {
  Port result;
  result.name = std::move(name);
  result.type = type;
  result.direction = direction;
  if (type == PortType::kImage && direction == Direction::kOut) result.format = VK_FORMAT_R8G8B8A8_UNORM;
  return result;
}

Technique blur(std::string name) {
  Technique technique;
  technique.id = "blur/" + name;
  technique.title = "A blur";
  technique.ports = {port("radiance", PortType::kImage, Direction::kIn),
                     port("weights", PortType::kValue, Direction::kIn),
                     port("color", PortType::kImage, Direction::kOut)};
  technique.stages = {{"main", StageKind::kGpu, {{"color", HEDDLE_ACCESS_STORAGE_WRITE, 0, {}}}}};
  return technique;
}

class Folders : public testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(root_);
    write("a/blur/role.toml", kBlurRole);
    write("a/noise/role.toml", kNoiseRole);
    fs::create_directories(root_ / "a" / "shared");
  }
  void TearDown() override { fs::remove_all(root_); }

  void write(const fs::path& file, std::string_view text) {
    fs::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << text;
  }
  // A manifest in <folder>/<id>/, as the build would have written it.
  void add(std::string_view folder, const std::vector<Technique>& techniques, std::uint32_t minor = HEDDLE_ABI_MINOR) {
    Manifest manifest;
    const std::string name(techniques.front().name());
    manifest.library = name + ".so";
    manifest.abi_major = HEDDLE_ABI_MAJOR;
    manifest.abi_minor = minor;
    manifest.techniques = techniques;
    write(fs::path(folder) / techniques.front().id / (name + ".manifest.json"), to_json(manifest));
  }
  std::string message(std::vector<fs::path> folders) {
    for (fs::path& folder : folders) folder = root_ / folder;
    try {
      const Registry registry(folders);
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), HEDDLE_BAD_INPUT);
      std::string what = error.what();
      for (std::size_t at = what.find(root_.string()); at != std::string::npos; at = what.find(root_.string())) {
        what.erase(at, root_.string().size() + 1);
      }
      return what;
    }
    return "no error";
  }
  std::string message_after(const std::function<void(Technique&)>& change) {
    Technique technique = blur("box");
    change(technique);
    add("a", {technique});
    return message({"a"});
  }

  fs::path root_;
};
using Registry_ = Folders;

constexpr std::string_view kComponent = R"toml([[component]]
name = "blur.area"
on = ["instance"]
title = "Where it is blurred"
[[component.property]]
name = "radius"
type = "float"
default = 2
help = "h"
)toml";

TEST_F(Registry_, LaysOutAValueThatGoesByAComponentsName) {
  write("a/blur/role.toml", std::string(kBlurRole) + std::string(kComponent));
  Technique technique = blur("box");
  technique.components = {"blur.area"};
  technique.ports.push_back(port("blur_area_instance", PortType::kValue, Direction::kIn));
  add("a", {technique});
  const Registry registry({root_ / "a"});
  const Port& completed = *registry.find("blur/box").technique->find_port("blur_area_instance");
  EXPECT_EQ(completed.glsl, "HeddleBlurArea blur_area_instance[];");
  EXPECT_THAT(completed.types, HasSubstr("struct HeddleBlurArea { uint is_present; uint written; float radius; };"));
  EXPECT_EQ(completed.help, "Where it is blurred");
  EXPECT_EQ(registry.components().find_port("blur_area_instance")->owner, Owner::kInstance);
  EXPECT_FALSE(registry.components().find_port("blur_area_light").has_value());
}

TEST_F(Registry_, KnowsTheComponentsThatTechniquesRead) {
  write("a/blur/role.toml", std::string(kBlurRole) + std::string(kComponent));
  EXPECT_EQ(message_after([](Technique& technique) {
              technique.components = {"blur.aera"};
              technique.ports.push_back(port("blur_area_instance", PortType::kValue, Direction::kIn));
            }),
            "a/blur/box/box.so: error: technique 'blur/box': reads the unknown component 'blur.aera'\n"
            "  expected: one of blur.area\n"
            "  help:     did you mean 'blur.area'?\n"
            "a/blur/box/box.so: error: technique 'blur/box': port 'blur_area_instance' reads a component that the "
            "technique does not name\n"
            "  expected: 'blur.area' in heddle_technique.components");
}

TEST_F(Registry_, RefusesAComponentOfTwoRoles) {
  write("a/blur/role.toml", std::string(kBlurRole) + std::string(kComponent));
  write("a/noise/role.toml", std::string(kNoiseRole) + std::string(kComponent));
  EXPECT_EQ(message({"a"}),
            "error: two roles declare the component 'blur.area': a/blur/role.toml and a/noise/role.toml");
}

TEST_F(Registry_, FindsRolesAndTechniques) {
  add("a", {blur("box")});
  add("a", {blur("a_first"), blur("a_second")});
  const Registry registry({root_ / "a"});
  EXPECT_EQ(registry.roles().size(), 2U);
  ASSERT_NE(registry.find_role("blur"), nullptr);
  EXPECT_EQ(registry.find_role("blur")->revision, 2U);
  EXPECT_EQ(registry.find_role("bloor"), nullptr);
  EXPECT_THAT(registry.technique_names("blur"), ElementsAre("a_first", "a_second", "box"));
  EXPECT_TRUE(registry.technique_names("noise").empty());
  ASSERT_EQ(registry.techniques().size(), 3U);
  EXPECT_EQ(registry.techniques()[2]->id, "blur/box");
  const TechniqueEntry entry = registry.find("blur/a_second");
  ASSERT_NE(entry.technique, nullptr);
  EXPECT_EQ(entry.manifest->library, root_ / "a/blur/a_first/a_first.so");
  EXPECT_EQ(entry.manifest->folder, root_ / "a/blur/a_first");
  EXPECT_EQ(registry.find("blur/none").technique, nullptr);
  EXPECT_THAT(registry.shared_folders(), ElementsAre(root_ / "a/shared"));
}

TEST_F(Registry_, TakesFromTheRoleWhatTheTechniqueLeavesOpen) {
  Technique technique = blur("box");
  technique.ports[2].help = "its own";
  add("a", {technique});
  const Registry registry({root_ / "a"});
  const Technique& found = *registry.find("blur/box").technique;
  EXPECT_EQ(found.find_port("weights")->glsl, "float weights[];");
  EXPECT_EQ(found.find_port("radiance")->help, "the role's help");
  EXPECT_EQ(found.find_port("color")->help, "its own");
  // The manifest stays what the library says: they are compared when it is opened.
  EXPECT_EQ(registry.find("blur/box").manifest->techniques[0].find_port("weights")->glsl, "");
}

TEST_F(Registry_, PrefersTheFirstFolder) {
  Technique mine = blur("box");
  mine.title = "Mine";
  add("b", {mine});
  add("b", {blur("tent")});  // for a role of the other folder
  add("a", {blur("box")});
  const Registry registry({root_ / "b", root_ / "a"});
  EXPECT_EQ(registry.find("blur/box").technique->title, "Mine");
  EXPECT_EQ(registry.find("blur/tent").manifest->folder, root_ / "b/blur/tent");
  EXPECT_EQ(registry.techniques().size(), 2U);
}

TEST_F(Registry_, KnowsWhatTheBuildLeftOutUnlessAnotherFolderBringsIt) {
  write("a/blur/box/left_out.txt", "this build has no Boxes\n");
  write("a/blur/tent/left_out.txt", "this build has no Tents\n");
  add("b", {blur("tent")});
  const Registry registry({root_ / "a", root_ / "b"});
  EXPECT_THAT(registry.left_out(), ElementsAre(testing::Pair("blur/box", "this build has no Boxes")));
  EXPECT_EQ(registry.find("blur/box").technique, nullptr);
}

TEST_F(Registry_, RefusesTwoLibrariesWithOneTechniqueInOneFolder) {
  add("a", {blur("box")});
  add("a", {blur("a_box"), blur("box")});
  EXPECT_EQ(message({"a"}),
            "error: two libraries bring the technique 'blur/box': a/blur/a_box/a_box.so and a/blur/box/box.so");
}

TEST_F(Registry_, NamesAFolderThatIsMissing) {
  EXPECT_EQ(message({"nowhere"}),
            "nowhere: error: cannot look for plugins in this folder\n"
            "  found:    No such file or directory\n"
            "  expected: a folder with <role>/role.toml and <role>/<technique>/");
}

TEST_F(Registry_, NamesABrokenFile) {
  write("a/blur/box/box.manifest.json", "{");
  EXPECT_THAT(message({"a"}), HasSubstr("a/blur/box/box.manifest.json:1:2: error: manifest: this is no JSON"));
}

TEST_F(Registry_, RefusesATechniqueOfAnUnknownRole) {
  EXPECT_EQ(message_after([](Technique& t) { t.id = "blurr/box"; }),
            "a/blurr/box/box.so: error: technique 'blurr/box': this role has no role.toml\n"
            "  found:    'blurr'\n  expected: one of blur, noise\n  help:     did you mean 'blur'?");
}

TEST_F(Registry_, RefusesPortsThatDisagreeWithTheRole) {
  EXPECT_EQ(message_after([](Technique& t) {
              t.ports[2] = port("color", PortType::kBuffer, Direction::kInout);
              t.ports[2].glsl = "float x;";
            }),
            "a/blur/box/box.so: error: technique 'blur/box': port 'color' has another type than in the role\n"
            "  found:    buffer\n  expected: image\n"
            "a/blur/box/box.so: error: technique 'blur/box': port 'color' has another direction than in the role\n"
            "  found:    inout\n  expected: out");
}

TEST_F(Registry_, RefusesATechniqueWithoutItsRolesOutput) {
  EXPECT_EQ(message_after([](Technique& t) {
              t.ports.pop_back();
              t.stages.clear();
            }),
            "a/blur/box/box.so: error: technique 'blur/box': the role's output 'color' is missing\n"
            "  expected: an out port of type image");
}

TEST_F(Registry_, RefusesATechniqueWithoutItsRolesFunction) {
  EXPECT_EQ(message_after([](Technique& t) {
              t.id = "noise/box";
              t.ports.clear();
              t.stages.clear();
            }),
            "a/noise/box/box.so: error: technique 'noise/box': the role's function 'noise' is missing\n"
            "  expected: a heddle_function for the role");
}

TEST_F(Registry_, RefusesAFunctionThatNoRoleDefines) {
  EXPECT_EQ(message_after([](Technique& t) {
              t.functions = {{"blur", "x.glsl", {}, {}, false}};
            }),
            "a/blur/box/box.so: error: technique 'blur/box': provides a function of the role 'blur', which has none");
  EXPECT_EQ(message_after([](Technique& t) {
              t.functions = {{"nois", "x.glsl", {}, {}, false}};
            }),
            "a/blur/box/box.so: error: technique 'blur/box': provides a function of the unknown role 'nois'\n"
            "  found:    'nois'\n  expected: one of blur, noise\n  help:     did you mean 'noise'?");
  EXPECT_EQ(message_after([](Technique& t) {
              t.shaders = {{"main", ShaderKind::kCompute, "main", "x.comp.glsl", {"niose"}, 0, 0, 0}};
            }),
            "a/blur/box/box.so: error: technique 'blur/box': calls functions of the unknown role 'niose'\n"
            "  found:    'niose'\n  expected: one of blur, noise\n  help:     did you mean 'noise'?");
}

TEST_F(Registry_, RefusesATechniqueMadeForANewerRole) {
  EXPECT_EQ(message_after([](Technique& t) { t.role_revision = 3; }),
            "a/blur/box/box.so: error: technique 'blur/box': made for a newer revision of its role\n"
            "  found:    revision 3\n  expected: at most 2, as a/blur/role.toml says");
}

TEST_F(Registry_, RefusesABlockOfItsOwnWithoutMembers) {
  EXPECT_EQ(
      message_after([](Technique& t) { t.ports.push_back(port("histogram", PortType::kBuffer, Direction::kIn)); }),
      "a/blur/box/box.so: error: technique 'blur/box': port 'histogram' is the technique's own and has no glsl\n"
      "  expected: the members of the block as shaders see them");
}

TEST_F(Registry_, ListsATechniqueOfAnotherAbiAndRefusesToOpenIt) {
  add("a", {blur("box")}, 7);
  Registry registry({root_ / "a"});
  const TechniqueEntry entry = registry.find("blur/box");
  ASSERT_NE(entry.technique, nullptr);
  try {
    registry.open(entry);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), HEDDLE_UNSUPPORTED);
    EXPECT_EQ(error.what(), (root_ / "a/blur/box/box.so").string() +
                                ": error: this plugin was built for another version of Heddle's interface\n"
                                "  found:    ABI 0.7\n  expected: ABI 0.1\n"
                                "  help:     build the plugin again with this version's headers");
  }
}

TEST_F(Registry_, ReadsAHundredTechniquesInMilliseconds) {
  for (int i = 0; i < 100; ++i) add("a", {blur("t" + std::to_string(i))});
  // The processor's time: what else the machine does is not the registry's.
  const std::clock_t start = std::clock();
  const Registry registry({root_ / "a"});
  const double time_ms = 1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  EXPECT_EQ(registry.techniques().size(), 100U);
  // `heddle list` has 50 ms in all for some ten techniques, so ten times as many may take that alone; measured 6 to 9
  // ms without a sanitizer.
  EXPECT_LT(time_ms, 50.0);
}

}  // namespace
}  // namespace heddle
