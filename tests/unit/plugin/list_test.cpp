// SPDX-License-Identifier: Apache-2.0
// The list that the command, Python and editors read.
#include "plugin/list.hpp"
#include "json.hpp"

#include <gtest/gtest.h>

#include <fstream>

namespace heddle {
namespace {

namespace fs = std::filesystem;

TEST(List, SaysEverythingOfTheRepositorysRoles) {
  const Registry registry({fs::path(HEDDLE_SOURCE_DIR) / "plugins"});
  const auto list = parse_json(list_json(registry));
  EXPECT_EQ(list["abi"], Json({HEDDLE_ABI_MAJOR, HEDDLE_ABI_MINOR}));
  ASSERT_EQ(list["roles"].size(), registry.roles().size());
  for (const auto& json : list["roles"]) {
    const Role& role = *registry.find_role(json["name"].get<std::string>());
    EXPECT_EQ(json["revision"], role.revision);
    EXPECT_EQ(json["ports"].size(), role.ports.size());
    EXPECT_EQ(json["functions"].size(), role.functions.size());
    EXPECT_EQ(json["hard_cases"].size(), role.hard_cases.size());
    ASSERT_EQ(json["components"].size(), role.components.size());
    for (std::size_t i = 0; i < role.components.size(); ++i) {
      EXPECT_EQ(json["components"][i]["name"], role.components[i].name);
      EXPECT_EQ(json["components"][i]["properties"].size(), role.components[i].properties.size());
    }
  }
  const auto role = [&](const char* name) {
    return *std::find_if(list["roles"].begin(), list["roles"].end(),
                         [&](const auto& one) { return one["name"] == name; });
  };
  const auto ao = role("ambient_occlusion");
  EXPECT_EQ(ao["references"]["same_model"]["technique"], "ambient_occlusion/ray_traced");
  EXPECT_EQ(ao["references"]["physical"]["technique"], "ray_tracing/path_tracer");
  EXPECT_EQ(ao["references"]["physical"]["port"], "occlusion");
  EXPECT_EQ(ao["references"]["physical"]["shared"]["occlusion_radius"], "radius");
  EXPECT_EQ(ao["ports"][0]["neutral"], parse_json(R"(["inf", 0.0, 0.0, 1.0])"));
  EXPECT_EQ(ao["ports"][4]["range"], parse_json("[0.0, 1.0]"));
  EXPECT_EQ(ao["measure"]["metric"], "rmse");
  const auto gbuffer = role("gbuffer");
  EXPECT_EQ(gbuffer["references"]["same_model"]["params"]["precision"], "float32");
}

TEST(List, SaysEverythingOfATechnique) {
  const fs::path root = fs::path(testing::TempDir()) / "list";
  const fs::path folder = root / "display" / "test";
  fs::create_directories(folder);
  fs::copy_file(fs::path(HEDDLE_SOURCE_DIR) / "plugins/display/role.toml", root / "display/role.toml",
                fs::copy_options::overwrite_existing);
  Technique technique;
  technique.id = "display/test";
  technique.title = "A test";
  Port color;
  color.name = "color";
  color.direction = Direction::kOut;
  color.format = VK_FORMAT_R8G8B8A8_UNORM;
  technique.ports = {color};
  Parameter parameter;
  parameter.name = "n";
  parameter.flags = HEDDLE_PARAMETER_KNOB;
  parameter.maximum = std::numeric_limits<double>::infinity();
  parameter.default_value[0] = 0.1;
  parameter.ladder = {1, 2};
  technique.parameters = {parameter};
  technique.stages = {{"main", StageKind::kGpu, {{"color", HEDDLE_ACCESS_STORAGE_WRITE, 0, {}}}}};
  const Manifest manifest{"test.so", {}, HEDDLE_ABI_MAJOR, HEDDLE_ABI_MINOR, {technique}};
  std::ofstream(folder / "test.manifest.json") << to_json(manifest);
  const auto list = parse_json(list_json(Registry({root})));
  ASSERT_EQ(list["techniques"].size(), 1U);
  const auto& json = list["techniques"][0];
  EXPECT_EQ(json["id"], "display/test");
  EXPECT_EQ(json["role"], "display");
  EXPECT_EQ(json["name"], "test");
  EXPECT_EQ(json["is_loadable"], true);
  EXPECT_EQ(json["library"], (folder / "test.so").string());
  EXPECT_EQ(json["parameters"][0]["maximum"], "inf");
  EXPECT_EQ(json["parameters"][0]["default"][0], 0.1);
  EXPECT_EQ(json["parameters"][0]["ladder"], parse_json("[1.0, 2.0]"));
  EXPECT_EQ(json["stages"][0]["accesses"][0]["access"], "storage_write");
  EXPECT_EQ(list["roles"][0]["techniques"][0], "test");
  fs::remove_all(root);
}

}  // namespace
}  // namespace heddle
