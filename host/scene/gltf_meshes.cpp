// SPDX-License-Identifier: Apache-2.0
// glTF primitives -> triangle lists at rest.
#include "scene/gltf_meshes.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace heddle::scene::gltf {
namespace {

/// Corners in the order of drawing -> a triangle list with the winding of the mode.
std::vector<std::uint32_t> to_triangles(const Document& document, int mode, std::vector<std::uint32_t> corners,
                                        std::string_view what) {
  const std::size_t count = corners.size();
  if (mode == TINYGLTF_MODE_TRIANGLES) {
    if (count % 3 != 0) {
      document.fail(fmt::format("{}: a triangle is incomplete", what), fmt::format("{} indices", count),
                    "a multiple of three");
    }
    return corners;
  }
  std::vector<std::uint32_t> triangles;
  triangles.reserve(count < 3 ? 0 : (count - 2) * 3);
  for (std::size_t i = 0; i + 2 < count; ++i) {
    std::array<std::uint32_t, 3> triangle = {corners[i], corners[i + 1], corners[i + 2]};
    if (mode == TINYGLTF_MODE_TRIANGLE_FAN) {
      triangle = {corners[i + 1], corners[i + 2], corners[0]};
    } else if (i % 2 == 1) {
      triangle = {corners[i], corners[i + 2], corners[i + 1]};
    }
    // Strips are joined by triangles without area.
    if (triangle[0] != triangle[1] && triangle[1] != triangle[2] && triangle[0] != triangle[2]) {
      triangles.insert(triangles.end(), triangle.begin(), triangle.end());
    }
  }
  return triangles;
}

/// FB_ngon_encoding: triangles that follow each other and begin with the same corner are one face.
std::vector<std::uint32_t> find_faces(const std::vector<std::uint32_t>& triangles) {
  std::vector<std::uint32_t> sizes;
  for (std::size_t i = 0; i < triangles.size(); i += 3) {
    // Fans go on along the edge that the last triangle left.
    const bool continues = i > 0 && triangles[i] == triangles[i - 3] && triangles[i + 1] == triangles[i - 1];
    if (continues) {
      ++sizes.back();
    } else {
      sizes.push_back(3);
    }
  }
  return sizes;
}

class PrimitiveReader {
 public:
  PrimitiveReader(const Document& document, const tinygltf::Primitive& source, std::string what)
      : document_(document), source_(source), what_(std::move(what)) {}

  [[nodiscard]] const std::string& what() const { return what_; }
  [[nodiscard]] int accessor(const std::string& attribute) const {
    const auto found = source_.attributes.find(attribute);
    return found == source_.attributes.end() ? -1 : found->second;
  }
  [[nodiscard]] std::string name(const std::string& attribute) const { return attribute + " of " + what_; }

  /// An attribute, empty if absent; every attribute has as many elements as there are positions.
  template <typename Vector>
  std::vector<Vector> read(const std::string& attribute, std::size_t vertices) const {
    const int index = accessor(attribute);
    if (index < 0) {
      return {};
    }
    std::vector<Vector> values = read_vectors<Vector>(document_, index, name(attribute));
    check_count(attribute, values.size(), vertices);
    return values;
  }

  /// Three or four components; alpha is 1 where it is absent.
  std::vector<glm::vec4> read_colors(std::size_t vertices) const {
    const int index = accessor("COLOR_0");
    if (index < 0) {
      return {};
    }
    const auto& accessors = document_.model.accessors;
    const bool has_alpha = static_cast<std::size_t>(index) >= accessors.size() ||
                           accessors[static_cast<std::size_t>(index)].type != TINYGLTF_TYPE_VEC3;
    if (has_alpha) {
      return read<glm::vec4>("COLOR_0", vertices);
    }
    const std::vector<glm::vec3> values = read<glm::vec3>("COLOR_0", vertices);
    std::vector<glm::vec4> colors(values.size());
    std::transform(values.begin(), values.end(), colors.begin(),
                   [](const glm::vec3& rgb) { return glm::vec4(rgb, 1.0F); });
    return colors;
  }

  void check_count(const std::string& attribute, std::size_t count, std::size_t vertices) const {
    if (count != vertices) {
      document_.fail(fmt::format("{}: there are more or fewer than positions", name(attribute)),
                     fmt::format("{}", count), fmt::format("{}", vertices));
    }
  }

  Influence read_influence(std::size_t vertices) const {
    Influence influence;
    for (int set = 0; accessor(fmt::format("JOINTS_{}", set)) >= 0; ++set) {
      const std::string joints_name = fmt::format("JOINTS_{}", set), weights_name = fmt::format("WEIGHTS_{}", set);
      if (accessor(weights_name) < 0) {
        document_.fail(fmt::format("{}: {} has no {}", what_, joints_name, weights_name));
      }
      const auto joints = read_unsigned(document_, accessor(joints_name), 4, name(joints_name));
      const auto weights = read_floats(document_, accessor(weights_name), 4, name(weights_name));
      check_count(joints_name, joints.size() / 4, vertices);
      check_count(weights_name, weights.size() / 4, vertices);
      append(influence, joints, weights, vertices);
    }
    return influence;
  }

 private:
  static void append(Influence& influence, const std::vector<std::uint32_t>& joints, const std::vector<float>& weights,
                     std::size_t vertices) {
    const std::size_t before = influence.per_vertex;
    Influence merged;
    merged.per_vertex = before + 4;
    for (std::size_t vertex = 0; vertex < vertices; ++vertex) {
      for (std::size_t i = 0; i < merged.per_vertex; ++i) {
        const bool is_old = i < before;
        const std::size_t from = is_old ? vertex * before + i : vertex * 4 + i - before;
        merged.joints.push_back(is_old ? influence.joints[from] : joints[from]);
        merged.weights.push_back(is_old ? influence.weights[from] : weights[from]);
      }
    }
    influence = std::move(merged);
  }

  const Document& document_;
  const tinygltf::Primitive& source_;
  std::string what_;
};

/// What a morph target adds to positions, normals and tangents.
MorphTarget read_target(const Document& document, const std::map<std::string, int>& target, std::string_view what,
                        std::size_t vertices) {
  const auto read = [&](const char* name) {
    const auto found = target.find(name);
    if (found == target.end()) {
      return std::vector<glm::vec3>();
    }
    const std::string described = fmt::format("morph target's {} of {}", name, what);
    std::vector<glm::vec3> differences = read_vectors<glm::vec3>(document, found->second, described);
    if (differences.size() != vertices) {
      document.fail(fmt::format("{}: there are more or fewer than positions", described),
                    fmt::format("{}", differences.size()), fmt::format("{}", vertices));
    }
    return differences;
  };
  return {read("POSITION"), read("NORMAL"), read("TANGENT")};
}

}  // namespace

std::optional<Primitive> read_primitive(Document& document, std::size_t mesh, std::size_t index, bool with_targets) {
  const tinygltf::Mesh& owner = document.model.meshes.at(mesh);
  const tinygltf::Primitive& source = owner.primitives.at(index);
  const PrimitiveReader reader(document, source, fmt::format("primitive {} of mesh {} '{}'", index, mesh, owner.name));
  if (source.mode < TINYGLTF_MODE_POINTS || source.mode > TINYGLTF_MODE_TRIANGLE_FAN) {
    document.fail(fmt::format("{} has an unknown mode", reader.what()), fmt::format("{}", source.mode), "0 to 6");
  }
  if (source.mode < TINYGLTF_MODE_TRIANGLES) {
    document.warn(fmt::format("{} is made of {}, which are not drawn", reader.what(),
                              source.mode == TINYGLTF_MODE_POINTS ? "points" : "lines"));
    return std::nullopt;
  }
  if (reader.accessor("POSITION") < 0) {
    document.warn(fmt::format("{} has no positions and is not drawn", reader.what()));
    return std::nullopt;
  }

  Primitive primitive;
  Attributes& attributes = primitive.attributes;
  attributes.positions = read_vectors<glm::vec3>(document, reader.accessor("POSITION"), reader.name("POSITION"));
  const std::size_t vertices = attributes.positions.size();
  attributes.normals = reader.read<glm::vec3>("NORMAL", vertices);
  attributes.tangents = reader.read<glm::vec4>("TANGENT", vertices);
  attributes.uvs[0] = reader.read<glm::vec2>("TEXCOORD_0", vertices);
  attributes.uvs[1] = reader.read<glm::vec2>("TEXCOORD_1", vertices);
  attributes.colors = reader.read_colors(vertices);
  primitive.influence = reader.read_influence(vertices);

  std::vector<std::uint32_t> corners;
  if (source.indices >= 0) {
    corners = read_unsigned(document, source.indices, 1, "indices of " + reader.what());
    const auto bad = std::find_if(corners.begin(), corners.end(), [&](std::uint32_t i) { return i >= vertices; });
    if (bad != corners.end()) {
      document.fail(fmt::format("{}: an index is out of range", reader.what()),
                    fmt::format("{} at {}", *bad, bad - corners.begin()), fmt::format("less than {}", vertices));
    }
  } else {
    corners.resize(vertices);
    for (std::size_t i = 0; i < vertices; ++i) {
      corners[i] = static_cast<std::uint32_t>(i);
    }
  }
  attributes.indices = to_triangles(document, source.mode, std::move(corners), reader.what());
  if (source.mode == TINYGLTF_MODE_TRIANGLES && source.extensions.contains("FB_ngon_encoding")) {
    primitive.face_sizes = find_faces(attributes.indices);
  }

  for (std::size_t i = 0; with_targets && i < source.targets.size(); ++i) {
    primitive.targets.push_back(read_target(document, source.targets[i], reader.what(), vertices));
  }
  return primitive;
}

}  // namespace heddle::scene::gltf
