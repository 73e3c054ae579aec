// SPDX-License-Identifier: Apache-2.0
// Loads hand-made glTF files in a folder of the test's own, and catches what is said of broken ones.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "scene/scene.hpp"
#include "unit/scene/gltf_file.hpp"

namespace heddle::scene {

/// A folder of its own for each test.
class GltfTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("heddle_gltf_test_" + std::to_string(getpid()) + "_" +
                                                        testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path save(const std::string& bytes, const char* name = "a.glb") const {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return folder_ / name;
  }
  Scene load(const GltfFile& file) const {
    Scene scene;
    load_gltf(scene, save(file.glb()));
    return scene;
  }
  /// The message without the file's name; "no error" if there is none. The scene must be as before.
  std::string error_of_bytes(const std::string& bytes, heddle_status status = HEDDLE_BAD_INPUT,
                             const char* name = "a.glb") const {
    const std::filesystem::path file = save(bytes, name);
    Scene scene;
    const std::string before = scene.describe_json();
    const std::uint64_t revision = scene.content_revision;
    try {
      load_gltf(scene, file);
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), status) << error.what();
      EXPECT_EQ(scene.describe_json(), before);
      EXPECT_EQ(scene.content_revision, revision);
      // Either the file itself is meant, or a part of it: "a.glb: image 0 'x': error: ...".
      const std::string text = error.what(), whole = file.string() + ": error: ", part = file.string() + ": ";
      EXPECT_EQ(text.substr(0, part.size()), part);
      return text.substr(text.starts_with(whole) ? whole.size() : std::min(part.size(), text.size()));
    }
    return "no error";
  }
  std::string error_of(const GltfFile& file, heddle_status status = HEDDLE_BAD_INPUT) const {
    return error_of_bytes(file.glb(), status);
  }

  std::filesystem::path folder_;
};

inline glm::vec3 position_of(const HeddleVertex& vertex) {
  return {vertex.position[0], vertex.position[1], vertex.position[2]};
}
inline glm::vec3 normal_of(const HeddleVertex& vertex) {
  return {vertex.normal[0], vertex.normal[1], vertex.normal[2]};
}

}  // namespace heddle::scene
