// SPDX-License-Identifier: Apache-2.0
// Broken glTF files: each is an error that says what is wrong, the scene stays as it was, and nothing crashes.
#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "unit/scene/gltf_fixture.hpp"

namespace heddle::scene {
namespace {

using Json = nlohmann::json;
using testing::HasSubstr;

class GltfErrors : public GltfTest {
 protected:
  void SetUp() override {
    GltfTest::SetUp();
    file_.node({{"mesh", file_.mesh(file_.triangle())}});
    ASSERT_EQ(error_of(file_), "no error");
  }
  Json& primitive() { return file_.json["meshes"][0]["primitives"][0]; }
  Json& accessor(const char* attribute) {
    return file_.json["accessors"][primitive()["attributes"][attribute].get<std::size_t>()];
  }

  GltfFile file_;
};

TEST_F(GltfErrors, CutOffFilesAtEveryByte) {
  const std::string whole = file_.glb();
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_NE(error_of_bytes(whole.substr(0, size)), "no error") << size << " of " << whole.size() << " bytes";
  }
  EXPECT_EQ(error_of_bytes(whole.substr(0, 15)),
            "the binary glTF file is cut off\n"
            "  found:    15 bytes\n"
            "  expected: a header and a chunk, at least 20 bytes");
  EXPECT_EQ(error_of_bytes(whole.substr(0, whole.size() - 4)),
            "the binary glTF file is cut off\n  found:    " + std::to_string(whole.size() - 4) +
                " bytes\n  expected: " + std::to_string(whole.size()) + " bytes, as its header says");
}

TEST_F(GltfErrors, EveryByteOfTheContainersHeadersMayBeWrong) {
  const std::string whole = file_.glb();
  for (std::size_t at = 0; at < 20; ++at) {
    for (const char wrong : {'\0', '\x7f', '\xff'}) {
      std::string broken = whole;
      broken[at] = wrong;
      error_of_bytes(broken);  // some are harmless; none may crash
    }
  }
}

TEST_F(GltfErrors, EveryDigitOfTheJsonMayBeWrong) {
  const std::string whole = file_.glb();
  const std::size_t end = whole.find("BIN");
  for (std::size_t at = 20; at < end; ++at) {
    if (whole[at] >= '0' && whole[at] <= '9') {
      for (const char wrong : {'9', '-', '.'}) {
        std::string broken = whole;
        broken[at] = wrong;
        error_of_bytes(broken);
      }
    }
  }
}

TEST_F(GltfErrors, WrongChunks) {
  std::string broken = file_.glb();
  broken[12] = '\xff';
  broken[14] = '\xff';
  EXPECT_EQ(error_of_bytes(broken), "chunk 0 of the binary glTF file reaches beyond its end");
  broken = file_.glb();
  broken[16] = 'X';
  EXPECT_THAT(error_of_bytes(broken), HasSubstr("chunk 0 of the binary glTF file is of the wrong kind"));
  broken = file_.glb();
  broken[4] = 1;
  EXPECT_EQ(error_of_bytes(broken), "the binary glTF file has another version\n  found:    1\n  expected: 2");
}

TEST_F(GltfErrors, NoGltfAtAll) {
  EXPECT_THAT(error_of_bytes(""), HasSubstr("the file is no valid glTF"));
  EXPECT_THAT(error_of_bytes("solid cube"), HasSubstr("the file is no valid glTF"));
  EXPECT_THAT(error_of_bytes("[1, 2]"), HasSubstr("the file is no valid glTF"));
  EXPECT_THAT(error_of_bytes(R"({"asset": {"version": "1.0"}})"), HasSubstr("another version of glTF"));
  Scene scene;
  EXPECT_THROW(load_gltf(scene, folder_ / "none.glb"), Error);
  EXPECT_THROW(load_gltf(scene, folder_), Error);
}

TEST_F(GltfErrors, DeepNestingIsRefusedBeforeItIsParsed) {
  std::string deep = R"({"asset": {"version": "2.0"}, "extras": )";
  deep += std::string(100000, '[') + std::string(100000, ']') + "}";
  EXPECT_EQ(error_of_bytes(deep), "the JSON is nested too deeply\n  expected: at most 64 levels");
  // Brackets in strings are no nesting.
  EXPECT_EQ(error_of_bytes(R"({"asset": {"version": "2.0", "copyright": "\"[[[)" + std::string(500, '[') + "\"}}"),
            "no error");
}

TEST_F(GltfErrors, RequiredExtensionsAreNamed) {
  file_.json["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  EXPECT_THAT(error_of(file_, HEDDLE_UNSUPPORTED),
              HasSubstr("the file requires the extension 'KHR_draco_mesh_compression'"));
}

TEST_F(GltfErrors, IndicesOutOfRange) {
  primitive()["indices"] = file_.indices({0, 1, 3});
  EXPECT_EQ(error_of(file_),
            "primitive 0 of mesh 0 '': an index is out of range\n  found:    3 at 2\n  expected: less than 3");
}

TEST_F(GltfErrors, IncompleteTriangles) {
  primitive()["indices"] = file_.indices({0, 1, 2, 0});
  EXPECT_THAT(error_of(file_), HasSubstr("a triangle is incomplete\n  found:    4 indices"));
}

TEST_F(GltfErrors, AccessorsBeyondTheirViews) {
  accessor("POSITION")["count"] = 4;
  EXPECT_EQ(error_of(file_),
            "POSITION of primitive 0 of mesh 0 '': the accessor reaches beyond buffer view 0\n"
            "  found:    48 bytes at 0 of 36");
  accessor("POSITION")["count"] = 3;
  accessor("POSITION")["byteOffset"] = 4;
  EXPECT_THAT(error_of(file_), HasSubstr("36 bytes at 4 of 36"));
  accessor("POSITION")["byteOffset"] = 4294967292U;
  EXPECT_NE(error_of(file_), "no error");
  accessor("POSITION").erase("byteOffset");
  accessor("POSITION")["count"] = 4000000000U;
  EXPECT_NE(error_of(file_), "no error");
}

TEST_F(GltfErrors, ViewsBeyondTheirBuffers) {
  file_.json["bufferViews"][0]["byteLength"] = 100000;
  EXPECT_THAT(error_of(file_), HasSubstr("buffer view 0 reaches beyond its buffer"));
  file_.json["bufferViews"][0]["byteLength"] = 36;
  file_.json["bufferViews"][0]["byteOffset"] = 100000;
  EXPECT_THAT(error_of(file_), HasSubstr("buffer view 0 reaches beyond its buffer"));
  file_.json["bufferViews"][0]["buffer"] = 7;
  EXPECT_NE(error_of(file_), "no error");
}

TEST_F(GltfErrors, ImagesBeyondTheirBuffers) {
  file_.json["images"] = Json::array({{{"bufferView", 0}, {"mimeType", "image/png"}}});
  file_.json["textures"] = Json::array({{{"source", 0}}});
  file_.json["materials"] = Json::array({{{"emissiveTexture", {{"index", 0}}}}});
  primitive()["material"] = 0;
  EXPECT_THAT(error_of_bytes(file_.glb()), HasSubstr("the image is of no known kind"));
  const std::vector<std::uint8_t> bytes(16, 0);
  const int view = file_.view(bytes.data(), bytes.size());
  file_.json["bufferViews"][static_cast<std::size_t>(view)]["byteLength"] = 1000000;
  file_.json["images"][0]["bufferView"] = view;
  EXPECT_THAT(error_of(file_), HasSubstr("buffer view 2 reaches beyond its buffer"));
  file_.json["images"][0] = {{"uri", "none.png"}};
  EXPECT_THAT(error_of(file_), HasSubstr("image 0 'none.png' cannot be read"));
}

TEST_F(GltfErrors, MissingBuffers) {
  file_.json["buffers"] = Json::array({{{"byteLength", 36}, {"uri", "none.bin"}}});
  EXPECT_EQ(error_of(file_),
            "the file names 'none.bin', which is not there\n  expected: a file beside " + (folder_ / "a.glb").string());
  file_.json["buffers"] = Json::array({{{"byteLength", 36000}}});
  EXPECT_THAT(error_of(file_), HasSubstr("the file is no valid glTF"));
  file_.json["buffers"] = Json::array();
  EXPECT_NE(error_of(file_), "no error");
}

TEST_F(GltfErrors, NumbersThatAreNotFinite) {
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    GltfFile file;
    Json triangle = file.triangle();
    triangle["attributes"]["POSITION"] = file.vec3({0, 0, 0, 1, bad, 0, 0, 1, 0});
    file.node({{"mesh", file.mesh(triangle)}});
    EXPECT_THAT(error_of(file),
                HasSubstr("POSITION of primitive 0 of mesh 0 '': a number is not finite\n  found:    "));
    EXPECT_THAT(error_of(file), HasSubstr("in element 1 of accessor 2"));
  }
}

TEST_F(GltfErrors, AttributesOfOtherLengths) {
  primitive()["attributes"]["NORMAL"] = file_.vec3({0, 0, 1});
  EXPECT_EQ(error_of(file_),
            "NORMAL of primitive 0 of mesh 0 '': there are more or fewer than positions\n"
            "  found:    1\n  expected: 3");
  primitive()["attributes"]["NORMAL"] = file_.vec2({0, 0});
  EXPECT_THAT(error_of(file_), HasSubstr("has the wrong number of components\n  found:    2\n  expected: 3"));
}

TEST_F(GltfErrors, ReferencesToNothing) {
  const auto wrong = [&](const char* pointer, int value) {
    GltfFile broken = file_;
    broken.json[Json::json_pointer(pointer)] = value;
    return error_of(broken);
  };
  EXPECT_THAT(wrong("/nodes/0/mesh", 5), HasSubstr("node 0 '' shows mesh 5, which does not exist"));
  EXPECT_THAT(wrong("/nodes/0/camera", 5), HasSubstr("node 0 '' has camera 5, which does not exist"));
  EXPECT_THAT(wrong("/nodes/0/skin", 5), HasSubstr("there is no skin 5"));
  EXPECT_THAT(wrong("/nodes/0/children/0", 5), HasSubstr("node 0 '' has the child 5, which does not exist"));
  EXPECT_THAT(wrong("/scene", 3), HasSubstr("the file's scene is 3, which does not exist"));
  EXPECT_THAT(wrong("/scenes/0/nodes/0", 9), HasSubstr("the file's scene has the node 9, which does not exist"));
  EXPECT_THAT(wrong("/meshes/0/primitives/0/material", 2), HasSubstr("there is no material 2"));
  EXPECT_THAT(wrong("/meshes/0/primitives/0/attributes/POSITION", 77), HasSubstr("there is no accessor 77"));
  EXPECT_NE(wrong("/meshes/0/primitives/0/indices", 77), "no error");
  EXPECT_THAT(wrong("/accessors/0/bufferView", 77), HasSubstr("there is no buffer view 77"));
  EXPECT_THAT(wrong("/meshes/0/primitives/0/mode", 9), HasSubstr("has an unknown mode"));
}

TEST_F(GltfErrors, NodesInACircle) {
  file_.json["nodes"] = Json::array({{{"children", {1}}}, {{"children", {0}}}});
  EXPECT_EQ(error_of(file_), "the nodes contain a cycle\n  found:    0 of 2 nodes have a root\n  expected: a tree");
  file_.json["nodes"] = Json::array({{{"children", {0}}}});
  EXPECT_THAT(error_of(file_), HasSubstr("the nodes contain a cycle"));
  file_.json["nodes"] = Json::array({{{"children", {2}}}, {{"children", {2}}}, Json::object()});
  EXPECT_THAT(error_of(file_), HasSubstr("node 2 '' has two parents"));
  file_.json["nodes"] = Json::array({Json::object()});
  file_.json["scenes"][0]["nodes"] = {0, 0};
  EXPECT_THAT(error_of(file_), HasSubstr("node 0 '' is in the scene twice"));
}

TEST_F(GltfErrors, LongChainsOfNodesDoNotOverflowTheStack) {
  Json nodes = Json::array();
  for (int i = 0; i < 50000; ++i) {
    nodes.push_back({{"children", {i + 1}}});
  }
  nodes.push_back({{"mesh", 0}});
  file_.json["nodes"] = nodes;
  EXPECT_EQ(error_of(file_), "no error");
}

TEST_F(GltfErrors, MatricesThatAreNone) {
  file_.json["nodes"][0]["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2};
  EXPECT_THAT(error_of(file_), HasSubstr("node 0 '': its matrix is not affine\n  found:    last row 0, 0, 0, 2"));
  file_.json["nodes"][0]["matrix"] = {1, 0, 0};
  EXPECT_NE(error_of(file_), "no error");
  file_.json["nodes"][0].erase("matrix");
  file_.json["nodes"][0]["scale"] = {1e308, 1, 1};
  file_.json["nodes"][0]["children"] = {1};
  file_.json["nodes"].push_back({{"scale", {1e308, 1, 1}}});
  EXPECT_THAT(error_of(file_), HasSubstr("its place in the scene is not finite"));
}

TEST_F(GltfErrors, SparsePartsOutOfRange) {
  const std::vector<std::uint16_t> places = {3};
  const std::vector<float> values = {5, 6, 7};
  accessor("POSITION")["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", file_.view(places.data(), 2)}, {"componentType", kUnsignedShort}}},
      {"values", {{"bufferView", file_.view(values.data(), 12)}}}};
  EXPECT_THAT(error_of(file_), HasSubstr("a sparse index of the accessor is out of range\n  found:    3"));
  accessor("POSITION")["sparse"]["count"] = 2;
  EXPECT_THAT(error_of(file_), HasSubstr("the accessor reaches beyond buffer view"));
  accessor("POSITION")["sparse"]["count"] = -1;
  EXPECT_NE(error_of(file_), "no error");
}

TEST_F(GltfErrors, AccessorsWithoutDataMayNotClaimAllMemory) {
  accessor("POSITION").erase("bufferView");
  accessor("POSITION")["count"] = 1000000000;
  EXPECT_THAT(error_of(file_), HasSubstr("an accessor without data claims too many elements"));
}

TEST_F(GltfErrors, MaterialsAndLights) {
  primitive()["material"] = 0;
  file_.json["materials"] = Json::array({{{"name", "m"}, {"alphaMode", "CLIP"}}});
  EXPECT_EQ(error_of(file_),
            "material 'm' has an unknown alpha mode\n  found:    CLIP\n  expected: OPAQUE, MASK or BLEND");
  file_.json["materials"] = Json::array({{{"emissiveTexture", {{"index", 3}}}}});
  EXPECT_THAT(error_of(file_), HasSubstr("there is no texture 3"));
  file_.json["textures"] = Json::array({{{"source", 4}}});
  file_.json["materials"] = Json::array({{{"emissiveTexture", {{"index", 0}}}}});
  EXPECT_THAT(error_of(file_), HasSubstr("texture 0 shows image 4, which does not exist"));
  file_.json.erase("materials");
  primitive().erase("material");
  file_.json["nodes"][0]["extensions"]["KHR_lights_punctual"]["light"] = 2;
  EXPECT_THAT(error_of(file_), HasSubstr("node 0 '' has light 2, which does not exist"));
  file_.json["nodes"][0]["extensions"]["KHR_lights_punctual"]["light"] = 0;
  file_.json["extensions"]["KHR_lights_punctual"]["lights"] = Json::array({{{"type", "candle"}}});
  EXPECT_THAT(error_of(file_), HasSubstr("light 'light 0' is of an unknown type\n  found:    candle"));
}

TEST_F(GltfErrors, Cameras) {
  file_.json["nodes"][0]["camera"] = 0;
  file_.json["cameras"] = Json::array({{{"type", "perspective"}, {"perspective", {{"yfov", 4}, {"znear", 0.1}}}}});
  EXPECT_THAT(error_of(file_), HasSubstr("camera 'node 0' has no proper angle or size"));
}

TEST_F(GltfErrors, FilesOutsideOfTheFoldersAreNotTouched) {
  std::ofstream(folder_.parent_path() / (folder_.filename().string() + ".bin"), std::ios::binary)
      << std::string(36, '\0');
  const std::string outside = "../" + folder_.filename().string() + ".bin";
  const auto expected = [&](const std::string& name) {
    return "the file names a file outside of its folder: '" + name +
           "'\n  expected: files beside it or below\n"
           "  help:     if you trust it, load it with HEDDLE_LOAD_TRUSTED, or with --trust-files on the command";
  };
  file_.json["buffers"] = Json::array({{{"byteLength", 36}, {"uri", outside}}});
  file_.json["accessors"][1]["bufferView"] = 0;
  file_.json["accessors"][1]["componentType"] = kUnsignedInt;
  EXPECT_EQ(error_of(file_), expected(outside));
  // A link is followed before the question is asked.
  std::filesystem::create_symlink("/etc/passwd", folder_ / "link.bin");
  file_.json["buffers"][0]["uri"] = "link.bin";
  EXPECT_EQ(error_of(file_), expected("link.bin"));
  file_.json["buffers"][0]["uri"] = "%2e%2e/" + folder_.filename().string() + ".bin";
  EXPECT_EQ(error_of(file_), expected(outside));
  // Trusted files may.
  file_.json["buffers"][0]["uri"] = outside;
  Scene scene;
  LoadLimits trusted;
  trusted.leaves_folder = true;
  EXPECT_NO_THROW(load_gltf(scene, save(file_.glb()), trusted));
  std::filesystem::remove(folder_.parent_path() / (folder_.filename().string() + ".bin"));
}

TEST_F(GltfErrors, FoldersAndDevicesAreNoBuffers) {
  std::filesystem::create_directory(folder_ / "sub");
  file_.json["buffers"] = Json::array({{{"byteLength", 36}, {"uri", "sub"}}});
  EXPECT_EQ(error_of(file_),
            "the file names 'sub', which is not there\n  expected: a file beside " + (folder_ / "a.glb").string());
}

TEST_F(GltfErrors, BrokenDataUrisAreQuotedInShort) {
  file_.json["buffers"] =
      Json::array({{{"byteLength", 36}, {"uri", "data:application/octet-stream;base64," + std::string(100000, '!')}}});
  const std::string message = error_of(file_);
  EXPECT_THAT(message, HasSubstr("the file is no valid glTF\n  found:    Failed to decode 'uri' : data:application"));
  EXPECT_LT(message.size(), 300U);
}

class GltfLimits : public GltfTest {
 protected:
  std::string refused(const GltfFile& file, std::uint64_t bytes) const {
    Scene scene;
    LoadLimits limits;
    limits.bytes = bytes;
    try {
      load_gltf(scene, save(file.glb()), limits);
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), HEDDLE_BAD_INPUT);
      const std::string text = error.what(), prefix = (folder_ / "a.glb").string() + ": error: ";
      return text.substr(std::min(prefix.size(), text.size()));
    }
    return "no error";
  }
};

TEST_F(GltfLimits, SmallFilesThatUnfoldAreStoppedBeforeTheyDo) {
  // 2000 nodes that each show a mesh of 2000 primitives: four million instances from a few kilobytes.
  GltfFile file;
  const Json triangle = file.triangle();
  Json primitives = Json::array();
  for (int i = 0; i < 2000; ++i) {
    primitives.push_back(triangle);
  }
  file.json["meshes"] = Json::array({{{"primitives", primitives}}});
  for (int i = 0; i < 2000; ++i) {
    file.node({{"mesh", 0}});
  }
  const std::string message = refused(file, 64ULL << 20);
  EXPECT_THAT(message, testing::StartsWith("node "));
  EXPECT_EQ(message.substr(std::min(message.find(':'), message.size())),
            ": the file needs more memory than it may\n  expected: at most 64 MiB in all\n"
            "  help:     if you trust it, load it with HEDDLE_LOAD_TRUSTED, or with --trust-files on the command");
}

TEST_F(GltfLimits, AccessorsCountEveryTimeTheyAreRead) {
  GltfFile file;
  file.json["accessors"].push_back({{"componentType", kFloat}, {"type", "VEC3"}, {"count", 1U << 20}});
  Json primitives = Json::array();
  for (int i = 0; i < 50; ++i) {
    primitives.push_back({{"attributes", {{"POSITION", 0}}}, {"indices", file.indices({0, 1, 2})}});
  }
  file.json["meshes"] = Json::array({{{"primitives", primitives}}});
  file.node({{"mesh", 0}});
  EXPECT_THAT(refused(file, 512ULL << 20), HasSubstr(": the file needs more memory than it may"));
}

TEST_F(GltfLimits, JsonCountsWhatTheParserMakesOfIt) {
  GltfFile file;
  for (int i = 0; i < 100000; ++i) {
    file.json["nodes"].push_back(Json::object());
  }
  EXPECT_THAT(refused(file, 64ULL << 20), HasSubstr("the JSON: the file needs more memory than it may"));
}

TEST_F(GltfLimits, ImagesAreAskedForTheirSizeFirst) {
  // A PNG's header that claims 16384 x 16384 pixels; no pixels follow.
  GltfFile file;
  const std::string png(
      "\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\x40\0\0\0\x40\0\x08\x06\0\0\0\xa9\xc8\x10\x84"
      "\0\0\0\0IDAT\x35\xaf\x06\x1e",
      45);
  file.json["images"] = Json::array({{{"bufferView", file.view(png.data(), png.size())}, {"mimeType", "image/png"}}});
  file.json["textures"] = Json::array({{{"source", 0}}});
  file.json["materials"] = Json::array({{{"emissiveTexture", {{"index", 0}}}}});
  Json triangle = file.triangle();
  triangle["material"] = 0;
  file.node({{"mesh", file.mesh(triangle)}});
  EXPECT_THAT(refused(file, 64ULL << 20), HasSubstr("16384 x 16384 pixels, of at most 167"));
}

}  // namespace
}  // namespace heddle::scene
