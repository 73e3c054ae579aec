// SPDX-License-Identifier: Apache-2.0
// Makes small glTF files by hand: buffers grow by accessors, the JSON is edited at will, then written as .glb.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "scene/scene.hpp"

namespace heddle::scene {

inline constexpr int kFloat = 5126, kByte = 5120, kUnsignedByte = 5121, kShort = 5122, kUnsignedShort = 5123,
                     kUnsignedInt = 5125;

class GltfFile {
 public:
  nlohmann::json json = {{"asset", {{"version", "2.0"}}}, {"scene", 0}};
  std::string binary;

  GltfFile() { json["scenes"] = nlohmann::json::array({{{"nodes", nlohmann::json::array()}}}); }

  /// A buffer view with these bytes; its index.
  int view(const void* data, std::size_t size) {
    binary.resize((binary.size() + 3) / 4 * 4);
    json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", size}});
    binary.append(static_cast<const char*>(data), size);
    return static_cast<int>(json["bufferViews"].size() - 1);
  }
  template <typename Value>
  int accessor(int component_type, const char* type, std::size_t components, const std::vector<Value>& values,
               bool normalized = false) {
    nlohmann::json made = {{"bufferView", view(values.data(), values.size() * sizeof(Value))},
                           {"componentType", component_type},
                           {"type", type},
                           {"count", values.size() / components}};
    if (normalized) {
      made["normalized"] = true;
    }
    json["accessors"].push_back(made);
    return static_cast<int>(json["accessors"].size() - 1);
  }
  int floats(const char* type, std::size_t components, const std::vector<float>& values) {
    return accessor(kFloat, type, components, values);
  }
  int vec3(const std::vector<float>& values) { return floats("VEC3", 3, values); }
  int vec2(const std::vector<float>& values) { return floats("VEC2", 2, values); }
  int indices(const std::vector<std::uint16_t>& values) { return accessor(kUnsignedShort, "SCALAR", 1, values); }

  /// A mesh of one primitive.
  int mesh(nlohmann::json primitive) {
    json["meshes"].push_back({{"primitives", nlohmann::json::array({std::move(primitive)})}});
    return static_cast<int>(json["meshes"].size() - 1);
  }
  /// A node at the root of the scene.
  int node(nlohmann::json made) {
    json["nodes"].push_back(std::move(made));
    const int index = static_cast<int>(json["nodes"].size() - 1);
    json["scenes"][0]["nodes"].push_back(index);
    return index;
  }
  /// A right triangle in the xy plane, counter-clockwise from +Z: primitive with POSITION and indices.
  nlohmann::json triangle() {
    return {{"attributes", {{"POSITION", vec3({0, 0, 0, 1, 0, 0, 0, 1, 0})}}}, {"indices", indices({0, 1, 2})}};
  }

  [[nodiscard]] std::string glb() const {
    nlohmann::json whole = json;
    std::string padded = binary;
    padded.resize((padded.size() + 3) / 4 * 4);
    if (!padded.empty() && !whole.contains("buffers")) {
      whole["buffers"] = nlohmann::json::array({{{"byteLength", padded.size()}}});
    }
    std::string text = whole.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::string file = "glTF";
    const auto word = [&file](std::size_t value) {
      const auto narrow = static_cast<std::uint32_t>(value);
      file.append(reinterpret_cast<const char*>(&narrow), 4);
    };
    word(2);
    word(12 + 8 + text.size() + (padded.empty() ? 0 : 8 + padded.size()));
    word(text.size());
    word(0x4E4F534A);
    file += text;
    if (!padded.empty()) {
      word(padded.size());
      word(0x004E4942);
      file += padded;
    }
    return file;
  }
};

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
