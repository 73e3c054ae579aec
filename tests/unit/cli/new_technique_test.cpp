// SPDX-License-Identifier: Apache-2.0
// `heddle new-technique`: for every role of the repository, in C and in C++, the folder builds with heddle_plugin() as
// it is, loads, and renders what its README says.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <heddle/heddle.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

const std::string kBuild = HEDDLE_BUILD_DIR;
const std::string kShipped = kBuild + "/lib/heddle/plugins";

struct Ran {
  int status = -1;
  std::string output;  // stdout and stderr
};

Ran run(const std::string& command) {
  Ran ran;
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return ran;
  char part[4096];
  while (std::size_t size = fread(part, 1, sizeof part, pipe)) ran.output.append(part, size);
  const int status = pclose(pipe);
  ran.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return ran;
}

Ran new_technique(const std::string& arguments) {
  return run(kBuild + "/bin/heddle new-technique --plugins " + kShipped + " " + arguments);
}

std::vector<std::string> role_names() {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(fs::path(HEDDLE_SOURCE_DIR) / "plugins")) {
    // Roles that make surfaces or artifacts have no template, which tests below show.
    const std::string name = entry.path().filename();
    const bool has_template =
        name != "subdivision" && name != "mesh_detail" && name != "bake_visibility" && name != "texture_store";
    if (has_template && fs::exists(entry.path() / "role.toml")) names.push_back(entry.path().filename());
  }
  return names;
}

std::string read_text(const fs::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// A folder with one technique a role and language, built once for all tests.
class Generated : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    root = fs::path(testing::TempDir()) / "heddle_new_technique";
    fs::remove_all(root);
    for (const std::string& role : role_names()) {
      for (const char* language : {"c", "c++"}) {
        const std::string name = language == std::string("c") ? "fresh_c" : "fresh";
        const Ran ran =
            new_technique(role + " " + name + " --language " + language + " --folder " + (root / "plugins").string());
        ASSERT_EQ(ran.status, 0) << role << "\n" << ran.output;
      }
    }
    build();
  }
  static void TearDownTestSuite() { fs::remove_all(root); }

  // As in the repository, but with the tools that are built already.
  static void build() {
    std::ofstream project(root / "CMakeLists.txt");
    project
        << "cmake_minimum_required(VERSION 3.25)\nproject(fresh LANGUAGES C CXX)\n"
           "set(CMAKE_C_STANDARD 11)\nset(CMAKE_CXX_STANDARD 20)\nset(CMAKE_CXX_EXTENSIONS OFF)\n"
           "add_library(heddle_api INTERFACE)\n"
           "target_include_directories(heddle_api INTERFACE " HEDDLE_SOURCE_DIR
           "/api)\n"
           "add_library(heddle_warnings INTERFACE)\n"
           "target_compile_options(heddle_warnings INTERFACE -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror)\n"
           "add_custom_target(heddle_contracts)\n";
    for (const auto& [target, file] :
         {std::pair("heddle_manifest", "heddle-manifest"), std::pair("heddle_check_shaders", "heddle-check-shaders")}) {
      project << "add_executable(" << target << " IMPORTED GLOBAL)\nset_target_properties(" << target
              << " PROPERTIES IMPORTED_LOCATION " << kBuild << "/bin/" << file << ")\n";
    }
    project << "set_property(GLOBAL PROPERTY HEDDLE_PLUGIN_CONTRACTS " << kShipped << ")\n"
            << "set(HEDDLE_PLUGIN_OUTPUT ${CMAKE_BINARY_DIR}/plugins)\n"
            << "include(" HEDDLE_SOURCE_DIR "/plugins/heddle_plugin.cmake)\n";
    for (const std::string& role : role_names()) {
      project << "add_subdirectory(plugins/" << role << "/fresh)\nadd_subdirectory(plugins/" << role << "/fresh_c)\n";
    }
    project.close();
    const std::string folder = (root / "build").string();
    const Ran configured = run(std::string(HEDDLE_CMAKE) + " -G Ninja -S " + root.string() + " -B " + folder +
                               " -DCMAKE_C_COMPILER=" HEDDLE_C " -DCMAKE_CXX_COMPILER=" HEDDLE_CXX
                               " -DCMAKE_C_COMPILER_LAUNCHER= -DCMAKE_CXX_COMPILER_LAUNCHER=");
    ASSERT_EQ(configured.status, 0) << configured.output;
    const Ran built = run(std::string(HEDDLE_CMAKE) + " --build " + folder);
    ASSERT_EQ(built.status, 0) << built.output;
    EXPECT_EQ(built.output.find("warning"), std::string::npos) << built.output;
  }

  void SetUp() override {
    ASSERT_FALSE(HasFatalFailure());
    const std::string path = (root / "build/plugins").string() + ":" + kShipped;
    heddle_host_options options{};
    options.struct_size = sizeof options;
    options.plugin_path = path.c_str();
    ASSERT_EQ(heddle_create(&options, &host), HEDDLE_OK) << heddle_error(nullptr);
    ASSERT_EQ(heddle_scene_create(host, &scene), HEDDLE_OK);
    build_scene();
  }
  void TearDown() override {
    heddle_scene_destroy(scene);
    heddle_destroy(host);
  }

  // A lit square metre in front of the camera, with free background around it.
  void build_scene() {
    const float positions[] = {-0.5F, -0.5F, 0, 0.5F, -0.5F, 0, 0.5F, 0.5F, 0, -0.5F, 0.5F, 0};
    const std::uint32_t indices[] = {0, 1, 2, 0, 2, 3};
    const double place[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -2, 1};
    std::uint32_t id = HEDDLE_NONE;
    heddle_material material{};
    material.struct_size = sizeof material;
    std::fill(std::begin(material.textures), std::end(material.textures), HEDDLE_NONE);
    std::fill(std::begin(material.record.base_color), std::end(material.record.base_color), 1.0F);
    material.record.roughness = 0.5F;
    material.record.ior = 1.5F;
    material.record.normal_scale = material.record.occlusion_strength = 1.0F;
    material.record.uv_rotation_scale[0] = material.record.uv_rotation_scale[3] = 1.0F;
    check(heddle_scene_add_material(scene, nullptr, &material, &id));
    heddle_mesh mesh{};
    mesh.struct_size = sizeof mesh;
    mesh.vertex_count = 4;
    mesh.index_count = 6;
    mesh.positions = positions;
    mesh.indices = indices;
    check(heddle_scene_add_mesh(scene, nullptr, &mesh, id, &id));
    check(heddle_scene_add_instance(scene, nullptr, id, place, &id));
    heddle_light light{};
    light.struct_size = sizeof light;
    light.record.type = HEDDLE_LIGHT_DIRECTIONAL;
    light.record.direction[2] = -1.0F;
    light.record.tangent[0] = 1.0F;
    light.record.flags = HEDDLE_LIGHT_CASTS_SHADOW;
    std::fill(std::begin(light.record.intensity), std::end(light.record.intensity), 2.0F);
    check(heddle_scene_add_light(scene, nullptr, &light, &id));
    heddle_camera camera{};
    camera.struct_size = sizeof camera;
    camera.rotation[3] = 1;
    camera.vertical_angle = 1;
    check(heddle_scene_add_camera(scene, nullptr, &camera, &id));
    check(heddle_scene_use_camera(scene, id));
  }

  void check(heddle_status status) const { ASSERT_EQ(status, HEDDLE_OK) << heddle_error(host); }

  // The whole pipeline with one word of it changed.
  std::vector<float> render(const std::string& setting, const char* port) {
    static const std::string text =
        "extent = [40, 24]\noutput = \"screen.color\"\n"
        "[[pass]]\nname = \"brdf\"\nrole = \"surface_material\"\ntechnique = \"ggx\"\n"
        "[[pass]]\nname = \"sky\"\nrole = \"sky\"\ntechnique = \"uniform\"\n"
        "[[pass]]\nname = \"gbuffer\"\nrole = \"gbuffer\"\ntechnique = \"raster\"\n"
        "[[pass]]\nname = \"ao\"\nrole = \"ambient_occlusion\"\ntechnique = \"gtao\"\n"
        "[[pass]]\nname = \"shadow\"\nrole = \"shadow\"\ntechnique = \"shadow_map\"\n"
        "[[pass]]\nname = \"light\"\nrole = \"lighting\"\ntechnique = \"deferred\"\n"
        "[[pass]]\nname = \"screen\"\nrole = \"display\"\ntechnique = \"linear\"\n";
    const char* settings[] = {setting.c_str()};
    heddle_graph* graph = nullptr;
    std::vector<float> pixels;
    EXPECT_EQ(heddle_graph_parse(host, text.c_str(), "test.toml", ".", settings, setting.empty() ? 0 : 1, &graph),
              HEDDLE_OK)
        << heddle_error(host);
    if (graph == nullptr) return pixels;
    EXPECT_EQ(heddle_graph_keep(graph, port), HEDDLE_OK) << heddle_error(host);
    EXPECT_EQ(heddle_render(graph, scene, nullptr), HEDDLE_OK) << heddle_error(host);
    heddle_image image{};
    image.struct_size = sizeof image;
    EXPECT_EQ(heddle_read(graph, port, 0, 0, &image), HEDDLE_OK) << heddle_error(host);
    EXPECT_EQ(image.width, 40U);
    EXPECT_EQ(image.height, 24U);
    if (image.pixels != nullptr) {
      pixels.assign(image.pixels, image.pixels + std::size_t{image.width} * image.height * image.channels);
    }
    heddle_graph_destroy(graph);
    return pixels;
  }

  static fs::path root;
  heddle_host* host = nullptr;
  heddle_scene* scene = nullptr;
};
fs::path Generated::root;

constexpr const char* kNames[] = {"fresh", "fresh_c"};

TEST_F(Generated, TechniquesAreListed) {
  const char* list = nullptr;
  check(heddle_list(host, &list));
  for (const std::string& role : role_names()) {
    for (const char* name : kNames) EXPECT_THAT(list, HasSubstr("\"id\": \"" + role + "/" + name + "\""));
  }
}

TEST(NewTechnique, ReadsTheListsOfItsRole) {
  const fs::path folder = fs::path(testing::TempDir()) / "heddle_role_with_lists";
  fs::remove_all(folder);
  fs::create_directories(folder / "roles/tiles");
  std::ofstream(folder / "roles/tiles/role.toml")
      << "role = \"tiles\"\nrevision = 1\ntitle = \"Shaded tiles\"\n"
         "[[port]]\nname = \"tiles\"\ndirection = \"in\"\ntype = \"buffer\"\nlist = true\noptional = true\n"
         "glsl = \"uvec4 tiles[];\"\nhelp = \"what is shaded\"\n"
         "[[port]]\nname = \"color\"\ndirection = \"out\"\ntype = \"image\"\nneutral = [0, 0, 0, 0]\n"
         "help = \"a picture\"\n";
  for (const char* language : {"c", "c++"}) {
    const Ran ran = run(kBuild + "/bin/heddle new-technique --plugins " + (folder / "roles").string() +
                        " tiles fresh --language " + language + " --folder " + (folder / language).string());
    ASSERT_EQ(ran.status, 0) << ran.output;
  }
  EXPECT_THAT(read_text(folder / "c++/tiles/fresh/pass.cpp"),
              HasSubstr("    list_in(\"tiles\", nullptr, nullptr, HEDDLE_PORT_OPTIONAL),\n"));
  EXPECT_THAT(read_text(folder / "c/tiles/fresh/pass.c"),
              HasSubstr("     .flags = HEDDLE_PORT_OPTIONAL | HEDDLE_PORT_LIST},\n"));
  fs::remove_all(folder);
}

TEST_F(Generated, AmbientOcclusionIsOpenEverywhere) {
  for (const char* name : kNames) {
    const std::vector<float> pixels = render(std::string("ao.technique=") + name, "ao.visibility");
    ASSERT_EQ(pixels.size(), 40U * 24U * 4U);
    for (const float value : pixels) ASSERT_EQ(value, 1.0F);
  }
}

TEST_F(Generated, GbufferIsInfinitelyFar) {
  for (const char* name : kNames) {
    const std::vector<float> pixels = render(std::string("gbuffer.technique=") + name, "gbuffer.depth");
    ASSERT_EQ(pixels.size(), 40U * 24U * 4U);
    for (std::size_t i = 0; i < pixels.size(); i += 4) ASSERT_EQ(pixels[i], INFINITY);
  }
}

TEST_F(Generated, LightingIsDark) {
  for (const char* name : kNames) {
    const std::vector<float> pixels = render(std::string("light.technique=") + name, "light.radiance");
    ASSERT_EQ(pixels.size(), 40U * 24U * 4U);
    for (const float value : pixels) ASSERT_EQ(value, 0.0F);
  }
}

TEST_F(Generated, DisplayShowsTheRadianceInRange) {
  for (const char* name : kNames) {
    const std::string setting = std::string("screen.technique=") + name;
    const std::vector<float> radiance = render(setting, "light.radiance");
    const std::vector<float> color = render(setting, "screen.color");
    ASSERT_EQ(radiance.size(), color.size());
    bool has_light = false;
    for (std::size_t i = 0; i < color.size(); ++i) {
      ASSERT_EQ(color[i], std::fmin(std::fmax(radiance[i], 0.0F), 1.0F)) << i;
      has_light = has_light || (i % 4 != 3 && color[i] > 0.0F);
    }
    EXPECT_TRUE(has_light);
  }
}

TEST_F(Generated, FunctionsAreWhatTheirRolesSayOfNobody) {
  for (const char* pass : {"brdf", "sky", "shadow"}) {
    const std::vector<float> without = render(std::string(pass) + ".technique=none", "light.radiance");
    ASSERT_FALSE(without.empty());
    for (const char* name : kNames) {
      EXPECT_EQ(render(std::string(pass) + ".technique=" + name, "light.radiance"), without) << pass << " " << name;
    }
  }
  // And it is not that the pass does nothing anyway.
  EXPECT_NE(render("", "light.radiance"), render("sky.technique=none", "light.radiance"));
}

TEST_F(Generated, FoldersHoldWhatTheStyleAsksFor) {
  for (const std::string& role : role_names()) {
    const fs::path folder = root / "plugins" / role / "fresh";
    const std::string cmake = read_text(folder / "CMakeLists.txt");
    EXPECT_EQ(std::count(cmake.begin(), cmake.end(), '\n'), 3) << cmake;
    const std::string readme = read_text(folder / "README.md");
    EXPECT_THAT(readme, testing::StartsWith("# " + role + "/fresh\n"));
    for (const char* head : {"## Source", "## Method", "## Parameters", "## Known limits", "## Measured"}) {
      EXPECT_THAT(readme, HasSubstr(head));
    }
    for (const auto& entry : fs::directory_iterator(folder)) {
      const std::string text = read_text(entry.path());
      if (entry.path().filename() != "README.md") {
        EXPECT_THAT(text.substr(0, text.find('\n')), HasSubstr("SPDX-License-Identifier: Apache-2.0")) << entry.path();
      }
    }
  }
}

TEST(NewTechnique, RefusesAnUnknownRole) {
  const Ran ran = new_technique("shadwo soft --folder /nowhere");
  EXPECT_EQ(ran.status, HEDDLE_BAD_INPUT);
  EXPECT_EQ(
      ran.output,
      "error: there is no role 'shadwo'\n"
      "  expected: one of ambient_occlusion, antialiasing, bake_visibility, display, function_image, gbuffer, "
      "light_assignment, light_count, lighting, mesh_detail, ray_tracing, shadow, sky, subdivision, surface_material, "
      "surface_program, texture_source, texture_store, transparency\n"
      "  help:     a new role begins with a role.toml in a folder of its own\n");
}

TEST(NewTechnique, HasNoTemplateForRolesThatMakeSurfaces) {
  const Ran ran = new_technique("subdivision mine --folder /nowhere");
  EXPECT_EQ(ran.status, HEDDLE_UNSUPPORTED);
  EXPECT_EQ(ran.output,
            "error: no template for role 'subdivision': its 'surfaces' are surfaces that techniques make\n"
            "  help:     begin with a copy of another technique's folder\n");
}

TEST(NewTechnique, HasNoTemplateForRolesThatMakeArtifacts) {
  const Ran ran = new_technique("bake_visibility mine --folder /nowhere");
  EXPECT_EQ(ran.status, HEDDLE_UNSUPPORTED);
  EXPECT_EQ(
      ran.output,
      "error: no template for role 'bake_visibility': its output 'occlusion' is no image but of the type artifact\n"
      "  help:     begin with a copy of another technique's folder\n");
}

TEST(NewTechnique, RefusesABadName) {
  for (const char* name : {"none", "2d", "Soft", "a-b", "a__b", "../x"}) {
    const Ran ran = new_technique(std::string("shadow ") + name + " --folder /nowhere");
    EXPECT_EQ(ran.status, HEDDLE_BAD_INPUT) << name;
    EXPECT_EQ(ran.output, std::string("error: '") + name +
                              "' is no name for a technique\n  expected: small letters, digits and single underscores, "
                              "a letter first; not 'none'\n");
  }
}

TEST(NewTechnique, LeavesAnExistingFolderAlone) {
  const fs::path folder = fs::path(testing::TempDir()) / "heddle_existing";
  fs::create_directories(folder / "sky/mine");
  const Ran ran = new_technique("sky mine --folder " + folder.string());
  EXPECT_EQ(ran.status, HEDDLE_BAD_INPUT);
  EXPECT_EQ(ran.output,
            (folder / "sky/mine").string() + ": error: this folder exists already\n  help:     choose another name\n");
  EXPECT_TRUE(fs::is_empty(folder / "sky/mine"));
  fs::remove_all(folder);
}

TEST(NewTechnique, NamesAFolderThatCannotBeMade) {
  const Ran ran = new_technique("sky mine --folder /proc/nowhere");
  EXPECT_EQ(ran.status, HEDDLE_FAILED);
  EXPECT_EQ(ran.output,
            "/proc/nowhere/sky/mine: error: cannot make this folder\n  found:    No such file or directory\n");
}

}  // namespace
