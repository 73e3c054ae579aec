// SPDX-License-Identifier: Apache-2.0
// Makes small glTF files by hand: buffers grow by accessors, the JSON is edited at will, then written as .glb.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

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

}  // namespace heddle::scene
