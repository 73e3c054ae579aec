// SPDX-License-Identifier: Apache-2.0
// What a right glTF file becomes: meshes, materials, nodes, cameras, lights, textures.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "image/image.hpp"
#include "unit/scene/gltf_fixture.hpp"

namespace heddle::scene {
namespace {

using Json = nlohmann::json;

std::vector<glm::vec3> corners(const Mesh& mesh) {
  std::vector<glm::vec3> positions;
  for (const std::uint32_t index : mesh.indices) {
    positions.push_back(position_of(mesh.vertices[index]));
  }
  return positions;
}

class Gltf : public GltfTest {
 protected:
  /// A PNG of one texel, as the bytes of a view of the file.
  int png(GltfFile& file, std::array<float, 4> rgba) const {
    const std::filesystem::path path = folder_ / "texel.png";
    image::write(path, {1, 1, 4, {rgba.begin(), rgba.end()}});
    std::ifstream stream(path, std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
    file.json["images"].push_back({{"bufferView", file.view(bytes.data(), bytes.size())}, {"mimeType", "image/png"}});
    return static_cast<int>(file.json["images"].size() - 1);
  }
  static int texture(GltfFile& file, int image, int sampler = -1) {
    Json made = {{"source", image}};
    if (sampler >= 0) {
      made["sampler"] = sampler;
    }
    file.json["textures"].push_back(made);
    return static_cast<int>(file.json["textures"].size() - 1);
  }
  Material material(const Json& json, const Json& used = Json::array()) const {
    GltfFile file;
    Json triangle = file.triangle();
    triangle["material"] = 0;
    file.node({{"mesh", file.mesh(triangle)}});
    file.json["materials"] = Json::array({json});
    file.json["extensionsUsed"] = used;
    return load(file).materials.at(0);
  }
};

TEST_F(Gltf, TriangleIsLoadedWithDefaults) {
  GltfFile file;
  file.node({{"mesh", file.mesh(file.triangle())}, {"name", "corner"}});
  const Scene scene = load(file);
  ASSERT_EQ(scene.meshes.size(), 1U);
  EXPECT_THAT(corners(scene.meshes[0]), testing::ElementsAre(glm::vec3(0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)));
  EXPECT_EQ(normal_of(scene.meshes[0].vertices[0]), glm::vec3(0, 0, 1));
  ASSERT_EQ(scene.instances.size(), 1U);
  EXPECT_EQ(scene.instances[0].name, "corner");
  ASSERT_EQ(scene.materials.size(), 1U);
  const HeddleMaterial& record = scene.materials[0].record;
  EXPECT_EQ(record.base_color[0], 1);
  EXPECT_EQ(record.metalness, 1);
  EXPECT_EQ(record.roughness, 1);
  EXPECT_EQ(record.ior, 1.5F);
  EXPECT_EQ(record.normal_scale, 1);
  EXPECT_EQ(record.alpha_mode, HEDDLE_ALPHA_OPAQUE);
  EXPECT_EQ(record.alpha_cutoff, 0.5F);
  EXPECT_EQ(record.uv_rotation_scale[0], 1);
  EXPECT_EQ(record.uv_rotation_scale[3], 1);
  EXPECT_THAT(scene.warnings, testing::IsEmpty());
}

TEST_F(Gltf, StripsAndFansKeepTheirWinding) {
  const std::vector<float> points = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
  for (const int mode : {5, 6}) {
    GltfFile file;
    // The fan's points go round; the strip's go in a zigzag.
    const std::vector<float> fan = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
    file.node(
        {{"mesh", file.mesh({{"attributes", {{"POSITION", file.vec3(mode == 5 ? points : fan)}}}, {"mode", mode}})}});
    const Scene scene = load(file);
    const std::vector<glm::vec3> list = corners(scene.meshes.at(0));
    ASSERT_EQ(list.size(), 6U);
    for (std::size_t i = 0; i < 6; i += 3) {
      EXPECT_GT(glm::cross(list[i + 1] - list[i], list[i + 2] - list[i]).z, 0) << "mode " << mode;
    }
  }
}

TEST_F(Gltf, StripsDropTheTrianglesThatJoinThem) {
  GltfFile file;
  Json strip = {{"attributes", {{"POSITION", file.vec3({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0})}}},
                {"indices", file.indices({0, 1, 2, 2, 3})},
                {"mode", 5}};
  file.node({{"mesh", file.mesh(strip)}});
  EXPECT_EQ(load(file).meshes.at(0).indices.size(), 3U);
}

TEST_F(Gltf, PointsAndLinesAreSkippedAndSaid) {
  GltfFile file;
  const int positions = file.vec3({0, 0, 0, 1, 0, 0, 0, 1, 0});
  file.node({{"mesh", file.mesh({{"attributes", {{"POSITION", positions}}}, {"mode", 0}})}});
  file.node({{"mesh", file.mesh({{"attributes", {{"POSITION", positions}}}, {"mode", 3}})}});
  const Scene scene = load(file);
  EXPECT_TRUE(scene.meshes.empty());
  EXPECT_TRUE(scene.instances.empty());
  EXPECT_THAT(scene.warnings, testing::ElementsAre("primitive 0 of mesh 0 '' is made of points, which are not drawn",
                                                   "primitive 0 of mesh 1 '' is made of lines, which are not drawn"));
}

TEST_F(Gltf, AllIndexTypesAreRead) {
  for (const int type : {kUnsignedByte, kUnsignedShort, kUnsignedInt}) {
    GltfFile file;
    Json triangle = file.triangle();
    triangle["indices"] = type == kUnsignedByte ? file.accessor(type, "SCALAR", 1, std::vector<std::uint8_t>{2, 0, 1})
                          : type == kUnsignedShort
                              ? file.accessor(type, "SCALAR", 1, std::vector<std::uint16_t>{2, 0, 1})
                              : file.accessor(type, "SCALAR", 1, std::vector<std::uint32_t>{2, 0, 1});
    file.node({{"mesh", file.mesh(triangle)}});
    EXPECT_EQ(corners(load(file).meshes.at(0))[0], glm::vec3(0, 1, 0)) << type;
  }
}

TEST_F(Gltf, NormalizedAttributesAreScaled) {
  GltfFile file;
  Json triangle = file.triangle();
  Json& attributes = triangle["attributes"];
  attributes["TEXCOORD_0"] =
      file.accessor(kUnsignedShort, "VEC2", 2, std::vector<std::uint16_t>{0, 65535, 32768, 0, 1, 2}, true);
  attributes["TEXCOORD_1"] =
      file.accessor(kUnsignedByte, "VEC2", 2, std::vector<std::uint8_t>{0, 255, 51, 0, 1, 2}, true);
  attributes["COLOR_0"] =
      file.accessor(kUnsignedByte, "VEC4", 4, std::vector<std::uint8_t>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}, true);
  attributes["NORMAL"] =
      file.accessor(kByte, "VEC3", 3, std::vector<std::int8_t>{0, 0, 127, 0, -128, 0, 127, 0, 0}, true);
  file.node({{"mesh", file.mesh(triangle)}});
  const Scene scene = load(file);
  const std::vector<HeddleVertex>& vertices = scene.meshes.at(0).vertices;
  EXPECT_EQ(vertices[0].v0, 1.0F);
  EXPECT_EQ(vertices[1].u0, 32768.0F / 65535.0F);
  EXPECT_EQ(vertices[1].u1, 0.2F);
  EXPECT_EQ(vertices[0].color, 0x04030201U);
  EXPECT_EQ(normal_of(vertices[1]), glm::vec3(0, -1, 0));
  EXPECT_EQ(normal_of(vertices[0]), glm::vec3(0, 0, 1));
}

TEST_F(Gltf, ColoursOfThreeComponentsAreOpaque) {
  GltfFile file;
  Json triangle = file.triangle();
  triangle["attributes"]["COLOR_0"] = file.vec3({1, 0, 0, 0, 1, 0, 0, 0, 0.5F});
  file.node({{"mesh", file.mesh(triangle)}});
  EXPECT_EQ(load(file).meshes.at(0).vertices[2].color, 0xff800000U);
}

TEST_F(Gltf, InterleavedAttributesFollowTheirStride) {
  GltfFile file;
  const std::vector<float> data = {0, 0, 0, 0.5F, 0.25F, 1, 0, 0, 1, 2, 0, 1, 0, 3, 4};
  const int view = file.view(data.data(), data.size() * 4);
  file.json["bufferViews"][static_cast<std::size_t>(view)]["byteStride"] = 20;
  file.json["accessors"] = Json::array(
      {{{"bufferView", view}, {"componentType", kFloat}, {"type", "VEC3"}, {"count", 3}},
       {{"bufferView", view}, {"byteOffset", 12}, {"componentType", kFloat}, {"type", "VEC2"}, {"count", 3}}});
  file.node({{"mesh", file.mesh({{"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}}}})}});
  const Scene scene = load(file);
  EXPECT_EQ(position_of(scene.meshes.at(0).vertices[2]), glm::vec3(0, 1, 0));
  EXPECT_EQ(scene.meshes[0].vertices[2].u0, 3);
  EXPECT_EQ(scene.meshes[0].vertices[1].v0, 2);
}

TEST_F(Gltf, SparseAccessorsReplaceElements) {
  GltfFile file;
  Json triangle = file.triangle();
  const std::vector<std::uint16_t> places = {1};
  const std::vector<float> values = {5, 6, 7};
  Json& positions = file.json["accessors"][triangle["attributes"]["POSITION"].get<std::size_t>()];
  positions["sparse"] = {{"count", 1},
                         {"indices", {{"bufferView", file.view(places.data(), 2)}, {"componentType", kUnsignedShort}}},
                         {"values", {{"bufferView", file.view(values.data(), 12)}}}};
  file.node({{"mesh", file.mesh(triangle)}});
  EXPECT_THAT(corners(load(file).meshes.at(0)),
              testing::ElementsAre(glm::vec3(0), glm::vec3(5, 6, 7), glm::vec3(0, 1, 0)));
}

TEST_F(Gltf, NodesComposeInFloat64AndShareMeshes) {
  GltfFile file;
  const int mesh = file.mesh(file.triangle());
  // 10^8 and a millimetre do not fit into one float32.
  file.json["nodes"] = Json::array({{{"translation", {1e8, 0, 0}}, {"children", {1, 2}}},
                                    {{"mesh", mesh}, {"translation", {0.001, 0, 0}}, {"scale", {2, 2, 2}}},
                                    {{"mesh", mesh}, {"matrix", {0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 3, 4, 5, 1}}}});
  file.json["scenes"][0]["nodes"] = {0};
  const Scene scene = load(file);
  EXPECT_EQ(scene.meshes.size(), 1U);
  ASSERT_EQ(scene.instances.size(), 2U);
  EXPECT_EQ(scene.instances[0].scene_from_object[3].x, 1e8 + 0.001);
  EXPECT_EQ(scene.instances[0].scene_from_object[1][1], 2);
  EXPECT_EQ(glm::dvec3(scene.instances[1].scene_from_object * glm::dvec4(1, 0, 0, 1)), glm::dvec3(1e8 + 3, 5, 5));
  EXPECT_EQ(scene.instances[1].previous_scene_from_object, scene.instances[1].scene_from_object);
}

TEST_F(Gltf, RotationsAreNormalized) {
  GltfFile file;
  file.node(
      {{"mesh", file.mesh(file.triangle())}, {"rotation", {0, 0, 2, 2}}});  // a quarter turn about z, twice as long
  const Scene scene = load(file);
  const glm::dvec4 turned = scene.instances.at(0).scene_from_object * glm::dvec4(1, 0, 0, 0);
  EXPECT_NEAR(glm::distance(glm::dvec3(turned), glm::dvec3(0, 1, 0)), 0, 1e-15);
}

TEST_F(Gltf, OnlyTheFilesSceneIsShown) {
  GltfFile file;
  const int mesh = file.mesh(file.triangle());
  file.node({{"mesh", mesh}, {"name", "shown"}});
  file.json["nodes"].push_back({{"mesh", mesh}, {"name", "in no scene"}});
  EXPECT_EQ(load(file).instances.size(), 1U);
  file.json.erase("scenes");
  file.json.erase("scene");
  EXPECT_EQ(load(file).instances.size(), 2U) << "without scenes, all roots are shown";
}

TEST_F(Gltf, MaterialsKeepEveryFactor) {
  const Material made = material(
      {{"name", "paint"},
       {"pbrMetallicRoughness",
        {{"baseColorFactor", {0.1, 0.2, 0.3, 0.4}}, {"metallicFactor", 0.25}, {"roughnessFactor", 0.75}}},
       {"emissiveFactor", {1, 0.5, 0}},
       {"alphaMode", "MASK"},
       {"alphaCutoff", 0.3},
       {"doubleSided", true},
       {"extensions",
        {{"KHR_materials_emissive_strength", {{"emissiveStrength", 8}}},
         {"KHR_materials_ior", {{"ior", 1.33}}},
         {"KHR_materials_transmission", {{"transmissionFactor", 0.9}}},
         {"KHR_materials_unlit", Json::object()}}}},
      {"KHR_materials_emissive_strength", "KHR_materials_ior", "KHR_materials_transmission", "KHR_materials_unlit"});
  EXPECT_EQ(made.name, "paint");
  const HeddleMaterial& record = made.record;
  EXPECT_EQ(record.base_color[3], 0.4F);
  EXPECT_EQ(record.metalness, 0.25F);
  EXPECT_EQ(record.roughness, 0.75F);
  EXPECT_EQ(record.emissive[0], 8);
  EXPECT_EQ(record.emissive[1], 4);
  EXPECT_EQ(record.alpha_mode, HEDDLE_ALPHA_MASK);
  EXPECT_EQ(record.alpha_cutoff, 0.3F);
  EXPECT_EQ(record.flags, HEDDLE_MATERIAL_DOUBLE_SIDED | HEDDLE_MATERIAL_UNLIT);
  EXPECT_EQ(record.ior, 1.33F);
  EXPECT_EQ(record.transmission, 0.9F);
}

TEST_F(Gltf, UnusedMaterialsAreLeftOut) {
  GltfFile file;
  Json triangle = file.triangle();
  triangle["material"] = 1;
  file.node({{"mesh", file.mesh(triangle)}});
  file.json["materials"] = Json::array({{{"name", "unused"}}, {{"name", "used"}}});
  const Scene scene = load(file);
  ASSERT_EQ(scene.materials.size(), 1U);
  EXPECT_EQ(scene.materials[0].name, "used");
}

TEST_F(Gltf, TexturesAreStoredForEachUse) {
  GltfFile file;
  const int image = png(file, {1, 0.2F, 0, 1});
  file.json["samplers"] = Json::array({{{"wrapS", 33071}, {"wrapT", 33648}}});
  const int plain = texture(file, image), clamped = texture(file, image, 0);
  Json triangle = file.triangle();
  triangle["material"] = 0;
  file.node({{"mesh", file.mesh(triangle)}});
  file.json["materials"] =
      Json::array({{{"pbrMetallicRoughness",
                     {{"baseColorTexture", {{"index", plain}}}, {"metallicRoughnessTexture", {{"index", plain}}}}},
                    {"emissiveTexture", {{"index", plain}}},
                    {"occlusionTexture", {{"index", clamped}, {"texCoord", 1}, {"strength", 0.5}}}}});
  const Scene scene = load(file);
  ASSERT_EQ(scene.textures.size(), 3U) << "colour, data, data with other wrapping";
  const Material& made = scene.materials.at(0);
  EXPECT_EQ(made.textures[HEDDLE_TEXTURE_BASE_COLOR], made.textures[HEDDLE_TEXTURE_EMISSIVE]);
  EXPECT_EQ(made.textures[HEDDLE_TEXTURE_NORMAL], HEDDLE_NONE);
  EXPECT_TRUE(scene.textures[made.textures[HEDDLE_TEXTURE_BASE_COLOR]].is_srgb);
  EXPECT_FALSE(scene.textures[made.textures[HEDDLE_TEXTURE_METALLIC_ROUGHNESS]].is_srgb);
  const Texture& occlusion = scene.textures[made.textures[HEDDLE_TEXTURE_OCCLUSION]];
  EXPECT_THAT(occlusion.wrap, testing::ElementsAre(2, 1));
  for (const Texture& stored : scene.textures) {
    EXPECT_THAT(stored.rgba, testing::ElementsAre(255, 51, 0, 255));
    EXPECT_EQ(stored.width, 1U);
  }
  EXPECT_EQ(made.record.texture_uv_sets, 1U << HEDDLE_TEXTURE_OCCLUSION);
  EXPECT_EQ(made.record.occlusion_strength, 0.5F);
}

TEST_F(Gltf, TextureTransformTurnsCounterClockwiseAsSeen) {
  GltfFile file;
  const int image = png(file, {1, 1, 1, 1});
  Json triangle = file.triangle();
  triangle["material"] = 0;
  file.node({{"mesh", file.mesh(triangle)}});
  Json info = {{"index", texture(file, image)},
               {"extensions",
                {{"KHR_texture_transform",
                  {{"offset", {0.25, 0.5}}, {"rotation", std::numbers::pi / 2}, {"scale", {2, 3}}, {"texCoord", 1}}}}}};
  file.json["materials"] = Json::array({{{"pbrMetallicRoughness", {{"baseColorTexture", info}}}}});
  file.json["extensionsUsed"] = {"KHR_texture_transform"};
  file.json["extensionsRequired"] = {"KHR_texture_transform"};
  const HeddleMaterial record = load(file).materials.at(0).record;
  const auto transform = [&](float u, float v) {
    const float* m = record.uv_rotation_scale;
    return glm::vec2(m[0] * u + m[2] * v + record.uv_offset[0], m[1] * u + m[3] * v + record.uv_offset[1]);
  };
  // u' = v * 3 + 0.25, v' = -u * 2 + 0.5
  EXPECT_NEAR(glm::distance(transform(1, 0), glm::vec2(0.25F, -1.5F)), 0, 1e-6);
  EXPECT_NEAR(glm::distance(transform(0, 1), glm::vec2(3.25F, 0.5F)), 0, 1e-6);
  EXPECT_EQ(record.texture_uv_sets, 1U);
}

TEST_F(Gltf, NormalMapsGetTangents) {
  GltfFile file;
  const int image = png(file, {0.5F, 0.5F, 1, 1});
  Json triangle = file.triangle();
  triangle["attributes"]["NORMAL"] = file.vec3({0, 0, 1, 0, 0, 1, 0, 0, 1});
  triangle["attributes"]["TEXCOORD_0"] = file.vec2({0, 0, 0, 1, 1, 0});  // u along +Y
  triangle["material"] = 0;
  file.node({{"mesh", file.mesh(triangle)}});
  file.json["materials"] = Json::array({{{"normalTexture", {{"index", texture(file, image)}, {"scale", 0.5}}}}});
  const Scene scene = load(file);
  EXPECT_EQ(scene.materials.at(0).record.normal_scale, 0.5F);
  const HeddleVertex& vertex = scene.meshes.at(0).vertices[0];
  EXPECT_NEAR(vertex.tangent[1], 1, 1e-6);
  // v grows along +X, so up in the image is -X, which is cross(normal, tangent): turned, but not mirrored.
  EXPECT_EQ(vertex.tangent[3], 1.0F);
}

TEST_F(Gltf, CamerasStandWhereTheirNodesAre) {
  GltfFile file;
  file.json["cameras"] = Json::array(
      {{{"type", "perspective"}, {"perspective", {{"yfov", 0.8}, {"znear", 0.2}, {"aspectRatio", 3}}}},
       {{"type", "orthographic"}, {"orthographic", {{"xmag", 2}, {"ymag", 1.5}, {"znear", 0.5}, {"zfar", 9}}}}});
  const double half = std::sqrt(0.5);
  file.node({{"camera", 0}, {"translation", {1, 2, 3}}, {"rotation", {0, half, 0, half}}, {"scale", {4, 4, 4}}});
  file.node({{"camera", 1}, {"name", "plan"}});
  const Scene scene = load(file);
  ASSERT_EQ(scene.cameras.size(), 2U);
  EXPECT_EQ(scene.camera, 0U) << "a scene without cameras uses the file's first";
  const heddle_camera& record = scene.cameras[0].record;
  EXPECT_EQ(record.position[2], 3);
  EXPECT_NEAR(record.rotation[1], half, 1e-12);
  EXPECT_NEAR(record.rotation[3], half, 1e-12);
  EXPECT_EQ(record.vertical_angle, 0.8);
  EXPECT_EQ(record.near_distance, 0.2);
  EXPECT_EQ(record.aspect, 0) << "the frame's shape decides";
  EXPECT_EQ(scene.cameras[1].name, "plan");
  EXPECT_EQ(scene.cameras[1].record.is_orthographic, 1U);
  EXPECT_EQ(scene.cameras[1].record.vertical_angle, 1.5);
  EXPECT_EQ(scene.cameras[1].record.far_distance, 9);
}

TEST_F(Gltf, PunctualLightsKeepTheirUnits) {
  GltfFile file;
  file.json["extensionsUsed"] = {"KHR_lights_punctual"};
  file.json["extensions"]["KHR_lights_punctual"]["lights"] =
      Json::array({{{"type", "directional"}, {"color", {1, 0.5, 0.25}}, {"intensity", 100}, {"name", "sun"}},
                   {{"type", "point"}, {"range", 7}},
                   {{"type", "spot"}, {"intensity", 3}, {"spot", {{"innerConeAngle", 0.1}, {"outerConeAngle", 0.4}}}}});
  for (int light = 0; light < 3; ++light) {
    const double half = std::sqrt(0.5);
    file.node({{"translation", {light, 0, 1}},
               {"rotation", {-half, 0, 0, half}},  // -Z turns to -Y
               {"scale", {3, 3, 3}},
               {"extensions", {{"KHR_lights_punctual", {{"light", light}}}}}});
  }
  const Scene scene = load(file);
  ASSERT_EQ(scene.lights.size(), 3U);
  const HeddleLight& sun = scene.lights[0].record;
  EXPECT_EQ(scene.lights[0].name, "sun");
  EXPECT_EQ(sun.type, HEDDLE_LIGHT_DIRECTIONAL);
  EXPECT_EQ(sun.intensity[1], 50);
  EXPECT_NEAR(sun.direction[1], -1, 1e-6);
  EXPECT_EQ(sun.range, 0);
  EXPECT_EQ(sun.flags, HEDDLE_LIGHT_CASTS_SHADOW);
  EXPECT_EQ(scene.lights[1].record.type, HEDDLE_LIGHT_POINT);
  EXPECT_EQ(scene.lights[1].record.range, 7);
  EXPECT_EQ(scene.lights[1].record.intensity[2], 1);
  EXPECT_EQ(scene.lights[1].position, glm::dvec3(1, 0, 1));
  EXPECT_EQ(scene.lights[2].record.cos_inner, std::cos(0.1F));
  EXPECT_NEAR(scene.lights[2].record.cos_outer, std::cos(0.4), 1e-7);
  EXPECT_EQ(scene.lights[2].record.id, 2U);
}

TEST_F(Gltf, UnknownExtensionsInUseAreListed) {
  GltfFile file;
  file.node({{"mesh", file.mesh(file.triangle())}});
  file.json["extensionsUsed"] = {"KHR_materials_ior", "EXT_not_yet"};
  EXPECT_THAT(load(file).ignored_extensions, testing::ElementsAre("EXT_not_yet"));
}

TEST_F(Gltf, SecondFileComesBehindTheFirst) {
  GltfFile file;
  const int image = png(file, {0, 0, 0, 1});
  Json triangle = file.triangle();
  triangle["material"] = 0;
  file.json["materials"] =
      Json::array({{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture(file, image)}}}}}}});
  file.node({{"mesh", file.mesh(triangle)}});
  const std::filesystem::path path = save(file.glb());
  Scene scene;
  load_gltf(scene, path);
  const std::uint64_t revision = scene.content_revision;
  load_gltf(scene, path);
  EXPECT_NE(scene.content_revision, revision);
  ASSERT_EQ(scene.instances.size(), 2U);
  EXPECT_EQ(scene.instances[1].mesh, 1U);
  EXPECT_EQ(scene.meshes[1].material, 1U);
  EXPECT_EQ(scene.materials[1].record.id, 1U);
  EXPECT_EQ(scene.materials[1].textures[0], 1U);
}

TEST_F(Gltf, TextFilesFindBuffersBesideThem) {
  GltfFile file;
  file.node({{"mesh", file.mesh(file.triangle())}});
  Json json = file.json;
  json["buffers"] = Json::array({{{"byteLength", file.binary.size()}, {"uri", "data%20of%20a.bin"}}});
  save(file.binary, "data of a.bin");
  Scene scene;
  load_gltf(scene, save(json.dump(), "a.gltf"));
  EXPECT_EQ(scene.meshes.at(0).indices.size(), 3U);
}

TEST_F(Gltf, EveryTextureKeepsItsOwnTransform) {
  GltfFile file;
  const int image = png(file, {1, 1, 1, 1});
  Json triangle = file.triangle();
  triangle["material"] = 0;
  file.node({{"mesh", file.mesh(triangle)}});
  const int used = texture(file, image);
  const auto info = [&](double scale, double offset) {
    return Json{{"index", used},
                {"extensions", {{"KHR_texture_transform", {{"scale", {scale, 1}}, {"offset", {offset, 0}}}}}}};
  };
  file.json["materials"] = Json::array(
      {{{"pbrMetallicRoughness", {{"baseColorTexture", info(2, 0.1)}, {"metallicRoughnessTexture", info(3, 0.2)}}},
        {"normalTexture", info(4, 0.3)},
        {"occlusionTexture", {{"index", used}}},
        {"emissiveTexture", info(6, 0.5)}}});
  const Scene scene = load(file);
  EXPECT_THAT(scene.warnings, testing::IsEmpty());
  const HeddleMaterial& record = scene.materials.at(0).record;
  const std::array<float, 5> scales = {2, 3, 4, 1, 6}, offsets = {0.1F, 0.2F, 0.3F, 0, 0.5F};
  for (std::uint32_t i = 0; i < HEDDLE_TEXTURE_COUNT; ++i) {
    EXPECT_EQ(texture_transform(record, i).matrix[0], scales[i]) << i;
    EXPECT_EQ(texture_transform(record, i).offset[0], offsets[i]) << i;
  }
}

TEST(TextureTransform, OfZerosIsTheBaseColours) {
  HeddleMaterial record{};
  set_texture_transform(record, HEDDLE_TEXTURE_BASE_COLOR, {{0, 2, 3, 0}, {4, 5}});
  EXPECT_EQ(texture_transform(record, HEDDLE_TEXTURE_EMISSIVE).matrix[1], 2);
  EXPECT_EQ(texture_transform(record, HEDDLE_TEXTURE_EMISSIVE).offset[1], 5);
  set_texture_transform(record, HEDDLE_TEXTURE_EMISSIVE, {{1, 0, 0, 1}, {6, 0}});
  EXPECT_EQ(texture_transform(record, HEDDLE_TEXTURE_EMISSIVE).offset[0], 6);
  EXPECT_EQ(texture_transform(record, HEDDLE_TEXTURE_NORMAL).offset[0], 4);
}

TEST_F(Gltf, SamplersKeepTheirFilters) {
  struct Case {
    int minified, magnified;
    std::uint32_t filter;
  };
  const std::vector<Case> cases = {
      {0, 0, 0},
      {9987, 9729, 0},
      {9987, 9728, HEDDLE_FILTER_NEAREST_MAGNIFIED},
      {9728, 9728, HEDDLE_FILTER_NEAREST_MAGNIFIED | HEDDLE_FILTER_NEAREST_MINIFIED | HEDDLE_FILTER_FINEST_LEVEL},
      {9729, 9729, HEDDLE_FILTER_FINEST_LEVEL},
      {9984, 9729, HEDDLE_FILTER_NEAREST_MINIFIED | HEDDLE_FILTER_NEAREST_LEVEL},
      {9985, 9729, HEDDLE_FILTER_NEAREST_LEVEL},
      {9986, 9729, HEDDLE_FILTER_NEAREST_MINIFIED}};
  for (const Case& expected : cases) {
    GltfFile file;
    Json sampler = Json::object();
    if (expected.minified != 0) {
      sampler = {{"minFilter", expected.minified}, {"magFilter", expected.magnified}};
    }
    file.json["samplers"] = Json::array({sampler});
    Json triangle = file.triangle();
    triangle["material"] = 0;
    file.node({{"mesh", file.mesh(triangle)}});
    const int used = texture(file, png(file, {1, 1, 1, 1}), 0);
    file.json["materials"] = Json::array({{{"emissiveTexture", {{"index", used}}}}});
    EXPECT_EQ(load(file).textures.at(0).filter, expected.filter) << expected.minified << " " << expected.magnified;
  }
}

TEST_F(Gltf, MaterialsOutOfRangeAreBroughtIntoItAndSaid) {
  GltfFile file;
  Json triangle = file.triangle();
  triangle["material"] = 0;
  file.node({{"mesh", file.mesh(triangle)}});
  file.json["materials"] = Json::array(
      {{{"name", "odd"},
        {"pbrMetallicRoughness", {{"metallicFactor", -1}, {"roughnessFactor", 7}, {"baseColorFactor", {1, 2, 0, 1}}}},
        {"extensions",
         {{"KHR_materials_ior", {{"ior", 0.5}}}, {"KHR_materials_transmission", {{"transmissionFactor", 3}}}}}}});
  Scene scene = load(file);
  EXPECT_EQ(scene.materials[0].record.roughness, 1);
  EXPECT_EQ(scene.materials[0].record.metalness, 0);
  EXPECT_EQ(scene.materials[0].record.ior, 1);
  EXPECT_THAT(scene.warnings,
              testing::ElementsAre("material 'odd': its base colour is 2, out of range: 1 used",
                                   "material 'odd': its metalness is -1, out of range: 0 used",
                                   "material 'odd': its roughness is 7, out of range: 1 used",
                                   "material 'odd': its index of refraction is 0.5, out of range: 1 used",
                                   "material 'odd': its transmission is 3, out of range: 1 used"));
  file.json["materials"][0] = {{"name", "mirror"}, {"extensions", {{"KHR_materials_ior", {{"ior", 0}}}}}};
  scene = load(file);
  EXPECT_EQ(scene.materials[0].record.ior, 1.5F);
  EXPECT_THAT(scene.warnings,
              testing::ElementsAre("material 'mirror': its index of refraction is 0, which reflects all "
                                   "light and is not known here: 1.5 used"));
}

TEST_F(Gltf, QuantizedPositionsAreReadFromEveryKindOfInteger) {
  struct Kind {
    int type;
    bool normalized;
    float one;  // what the largest number becomes
  };
  for (const Kind& kind : {Kind{kByte, false, 127}, Kind{kByte, true, 1}, Kind{kUnsignedByte, false, 255},
                           Kind{kUnsignedByte, true, 1}, Kind{kShort, false, 32767}, Kind{kShort, true, 1},
                           Kind{kUnsignedShort, false, 65535}, Kind{kUnsignedShort, true, 1}}) {
    GltfFile file;
    const auto triangle = [&]<typename Value>(Value largest) {
      return file.accessor(kind.type, "VEC3", 3, std::vector<Value>{0, 0, 0, largest, 0, 0, 0, largest, 0},
                           kind.normalized);
    };
    const int positions = kind.type == kByte           ? triangle(std::numeric_limits<std::int8_t>::max())
                          : kind.type == kUnsignedByte ? triangle(std::numeric_limits<std::uint8_t>::max())
                          : kind.type == kShort        ? triangle(std::numeric_limits<std::int16_t>::max())
                                                       : triangle(std::numeric_limits<std::uint16_t>::max());
    file.node({{"mesh", file.mesh({{"attributes", {{"POSITION", positions}}}})}});
    file.json["extensionsUsed"] = file.json["extensionsRequired"] = {"KHR_mesh_quantization"};
    EXPECT_THAT(corners(load(file).meshes.at(0)),
                testing::ElementsAre(glm::vec3(0), glm::vec3(kind.one, 0, 0), glm::vec3(0, kind.one, 0)))
        << kind.type << kind.normalized;
  }
}

TEST_F(Gltf, SeparateAndEmbeddedFilesAreTheSameScene) {
  GltfFile file;
  file.node({{"mesh", file.mesh(file.triangle())}});
  Scene separate, embedded;
  Json whole = file.json;
  std::filesystem::create_directory(folder_ / "data of it");
  std::ofstream(folder_ / "data of it" / "a.bin", std::ios::binary) << file.binary;
  whole["buffers"] = Json::array({{{"byteLength", file.binary.size()}, {"uri", "data%20of%20it/a.bin"}}});
  load_gltf(separate, save(whole.dump(), "a.gltf"));
  // Base64 by hand: three bytes are four letters.
  constexpr const char* kLetters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string padded = file.binary, letters;
  padded.resize((padded.size() + 2) / 3 * 3);
  for (std::size_t i = 0; i < padded.size(); i += 3) {
    const auto byte = [&](std::size_t k) {
      return static_cast<std::uint32_t>(static_cast<unsigned char>(padded[i + k]));
    };
    const std::uint32_t word = byte(0) << 16 | byte(1) << 8 | byte(2);
    for (int shift = 18; shift >= 0; shift -= 6) {
      letters += kLetters[word >> shift & 63U];
    }
  }
  whole["buffers"] =
      Json::array({{{"byteLength", padded.size()}, {"uri", "data:application/octet-stream;base64," + letters}}});
  load_gltf(embedded, save(whole.dump(), "b.gltf"));
  const Scene packed = load(file);
  for (const Scene* scene : {&separate, &embedded}) {
    EXPECT_EQ(corners(scene->meshes.at(0)), corners(packed.meshes.at(0)));
  }
}

TEST_F(Gltf, UnknownExtensionsAreNamedAndLeftOut) {
  GltfFile file;
  Json triangle = file.triangle();
  triangle["extensions"]["KHR_materials_variants"]["mappings"] = Json::array({{{"material", 0}}});
  file.node({{"mesh", file.mesh(triangle)}});
  file.json["extensionsUsed"] = {"KHR_materials_variants", "KHR_materials_ior"};
  const Scene scene = load(file);
  EXPECT_EQ(scene.instances.size(), 1U);
  EXPECT_THAT(scene.ignored_extensions, testing::ElementsAre("KHR_materials_variants"));
}

}  // namespace
}  // namespace heddle::scene
