// SPDX-License-Identifier: Apache-2.0
// Real files, where a folder of them is given: HEDDLE_GLTF_FOLDER. Every one loads whole or not at all, also cut off.
#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <iostream>

#include "json.hpp"
#include "scene/upload.hpp"
#include "unit/scene/gltf_fixture.hpp"

namespace heddle::scene {
namespace {

class Assets : public GltfTest {
 protected:
  void SetUp() override {
    const char* folder = std::getenv("HEDDLE_GLTF_FOLDER");
    if (folder == nullptr || *folder == '\0') {
      GTEST_SKIP() << "HEDDLE_GLTF_FOLDER names no folder with glTF files";
    }
    GltfTest::SetUp();
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
      if (entry.path().extension() == ".glb" || entry.path().extension() == ".gltf") {
        files_.push_back(entry.path());
      }
    }
    std::sort(files_.begin(), files_.end());
    ASSERT_FALSE(files_.empty());
  }
  void TearDown() override {
    if (!folder_.empty()) {
      GltfTest::TearDown();
    }
  }

  std::vector<std::filesystem::path> files_;
};

TEST_F(Assets, EveryFileLoadsAndIsSound) {
  for (const std::filesystem::path& file : files_) {
    SCOPED_TRACE(file.filename().string());
    const auto start = std::chrono::steady_clock::now();
    Scene scene;
    ASSERT_NO_THROW(load_gltf(scene, file));
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    EXPECT_FALSE(scene.instances.empty());
    for (const Mesh& mesh : scene.meshes) {
      EXPECT_EQ(mesh.indices.size() % 3, 0U);
      for (const std::uint32_t index : mesh.indices) {
        ASSERT_LT(index, mesh.vertices.size());
      }
      for (const HeddleVertex& vertex : mesh.vertices) {
        const glm::vec3 tangent(vertex.tangent[0], vertex.tangent[1], vertex.tangent[2]);
        ASSERT_NEAR(glm::length(normal_of(vertex)), 1, 1e-5);
        ASSERT_NEAR(glm::length(tangent), 1, 1e-5);
        ASSERT_EQ(std::abs(vertex.tangent[3]), 1);
      }
    }
    for (const Texture& texture : scene.textures) {
      EXPECT_EQ(texture.rgba.size(), std::size_t{4} * texture.width * texture.height);
    }
    const Json json = parse_json(scene.describe_json());
    Snapshot snapshot;
    EXPECT_EQ(snapshot.update(scene).triangle_count, json["counts"]["triangles"]);
    std::cout << file.filename().string() << ": " << took.count() << " s, " << write_json(json["counts"]) << ", bounds "
              << write_json(json["bounds"]) << ", " << write_json(json["warnings"])
              << write_json(json["ignored_extensions"]) << '\n';
  }
}

TEST_F(Assets, SmallFilesCutOffAnywhereAreErrors) {
  for (const std::filesystem::path& file : files_) {
    if (file.extension() != ".glb" || std::filesystem::file_size(file) > 16384) {
      continue;
    }
    std::ifstream stream(file, std::ios::binary);
    const std::string whole((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
    for (std::size_t size = 0; size < whole.size(); size += 64) {
      EXPECT_NE(error_of_bytes(whole.substr(0, size)), "no error") << file << " at " << size;
    }
  }
}

}  // namespace
}  // namespace heddle::scene
