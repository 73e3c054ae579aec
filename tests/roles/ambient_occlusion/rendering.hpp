// SPDX-License-Identifier: Apache-2.0
// Scenes of meshes and a camera -> visibility images, through the C API alone.
#pragma once

#include "shapes.hpp"

#include <heddle/heddle.h>

#include <gtest/gtest.h>
#include <glm/gtc/quaternion.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace rendering {

struct Image {
  std::uint32_t width = 0, height = 0, channels = 0;
  std::vector<float> pixels;

  [[nodiscard]] float at(std::uint32_t x, std::uint32_t y) const {
    return pixels[(static_cast<std::size_t>(y) * width + x) * channels];
  }
  [[nodiscard]] float least() const { return *std::min_element(pixels.begin(), pixels.end()); }
  [[nodiscard]] float greatest() const { return *std::max_element(pixels.begin(), pixels.end()); }
};

inline double rmse(const Image& a, const Image& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    const double d = static_cast<double>(a.pixels[i]) - static_cast<double>(b.pixels[i]);
    sum += d * d;
  }
  return std::sqrt(sum / static_cast<double>(a.pixels.size()));
}

inline double greatest_difference(const Image& a, const Image& b) {
  double most = 0.0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    most = std::max(most, std::abs(static_cast<double>(a.pixels[i]) - static_cast<double>(b.pixels[i])));
  }
  return most;
}

struct Camera {
  glm::dvec3 position{0.0};
  glm::dvec3 target{0.0, 0.0, -1.0};
  double vertical_angle = 1.0;
  double near_distance = 0.01;
  bool is_orthographic = false;
};

/// Each mesh with one normal a vertex, smooth or flat.
struct Shape {
  shapes::Mesh mesh;
  std::vector<glm::vec3> normals;
};

inline Shape flat(const shapes::Mesh& mesh) {
  Shape shape;
  for (const glm::uvec3& t : mesh.indices) {
    const glm::vec3 p0 = mesh.positions[t.x];
    const glm::vec3 p1 = mesh.positions[t.y];
    const glm::vec3 p2 = mesh.positions[t.z];
    const glm::vec3 normal(
        glm::normalize(glm::cross(glm::dvec3(p1) - glm::dvec3(p0), glm::dvec3(p2) - glm::dvec3(p0))));
    const auto base = static_cast<std::uint32_t>(shape.mesh.positions.size());
    shape.mesh.positions.insert(shape.mesh.positions.end(), {p0, p1, p2});
    shape.mesh.indices.emplace_back(base, base + 1, base + 2);
    shape.normals.insert(shape.normals.end(), 3, normal);
  }
  return shape;
}

/// Of the library, the plugins as the build made them and the default device. Ends with the tests: when the process ends
/// its driver may be gone.
struct SharedHost : testing::Environment {
  static inline heddle_host* made = nullptr;
  void TearDown() override {
    if (made != nullptr) heddle_destroy(made);
    made = nullptr;
  }
};
inline const auto* const shared_host = testing::AddGlobalTestEnvironment(new SharedHost);

inline heddle_host* host() {
  if (SharedHost::made != nullptr) return SharedHost::made;
  heddle_host_options options{};
  options.struct_size = sizeof options;
  options.plugin_path = HEDDLE_BUILD_DIR "/lib/heddle/plugins";
  options.cache_path = HEDDLE_BUILD_DIR "/test-cache";
  if (heddle_create(&options, &SharedHost::made) != HEDDLE_OK) {
    ADD_FAILURE() << heddle_error(nullptr);
  }
  return SharedHost::made;
}

inline void require(heddle_status status) {
  ASSERT_EQ(status, HEDDLE_OK) << heddle_error(host());
}

class Scene {
 public:
  Scene() { require(heddle_scene_create(host(), &scene_)); }
  ~Scene() { heddle_scene_destroy(scene_); }
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  /// Everything is double-sided and white. `unit` scales, then `offset` moves (in float64).
  void add(const Shape& shape, double unit = 1.0, const glm::dvec3& offset = glm::dvec3(0.0)) {
    heddle_material material{};
    material.struct_size = sizeof material;
    std::fill(std::begin(material.textures), std::end(material.textures), HEDDLE_NONE);
    std::fill(std::begin(material.record.base_color), std::end(material.record.base_color), 1.0F);
    material.record.roughness = 1.0F;
    material.record.ior = 1.5F;
    material.record.normal_scale = 1.0F;
    material.record.flags = HEDDLE_MATERIAL_DOUBLE_SIDED;
    material.record.uv_rotation_scale[0] = 1.0F;
    material.record.uv_rotation_scale[3] = 1.0F;
    std::uint32_t material_id = 0;
    require(heddle_scene_add_material(scene_, nullptr, &material, &material_id));
    heddle_mesh mesh{};
    mesh.struct_size = sizeof mesh;
    mesh.vertex_count = static_cast<std::uint32_t>(shape.mesh.positions.size());
    mesh.index_count = static_cast<std::uint32_t>(shape.mesh.indices.size() * 3);
    mesh.positions = &shape.mesh.positions.front().x;
    mesh.normals = &shape.normals.front().x;
    mesh.indices = &shape.mesh.indices.front().x;
    std::uint32_t mesh_id = 0;
    require(heddle_scene_add_mesh(scene_, nullptr, &mesh, material_id, &mesh_id));
    const double matrix[16] = {unit, 0, 0, 0, 0, unit, 0, 0, 0, 0, unit, 0, offset.x, offset.y, offset.z, 1};
    std::uint32_t instance = 0;
    require(heddle_scene_add_instance(scene_, nullptr, mesh_id, matrix, &instance));
  }

  void look(const Camera& camera, double unit = 1.0, const glm::dvec3& offset = glm::dvec3(0.0)) {
    const glm::dvec3 direction = glm::normalize(camera.target - camera.position);
    const glm::dvec3 up = std::abs(direction.y) > 0.99 ? glm::dvec3(0, 0, -1) : glm::dvec3(0, 1, 0);
    const glm::dquat rotation = glm::quatLookAt(direction, up);
    heddle_camera record{};
    record.struct_size = sizeof record;
    record.is_orthographic = camera.is_orthographic ? 1 : 0;
    for (int i = 0; i < 3; ++i) {
      record.position[i] = unit * camera.position[i] + offset[i];
    }
    record.rotation[0] = rotation.x;
    record.rotation[1] = rotation.y;
    record.rotation[2] = rotation.z;
    record.rotation[3] = rotation.w;
    record.vertical_angle = camera.is_orthographic ? unit * camera.vertical_angle : camera.vertical_angle;
    record.near_distance = unit * camera.near_distance;
    record.far_distance = camera.is_orthographic ? unit * 1000.0 : 0.0;
    std::uint32_t id = 0;
    require(heddle_scene_add_camera(scene_, nullptr, &record, &id));
    require(heddle_scene_use_camera(scene_, id));
  }

  [[nodiscard]] heddle_scene* raw() const { return scene_; }

 private:
  heddle_scene* scene_ = nullptr;
};

/// gbuffer and one technique of ambient occlusion; `params` are lines "params.radius = 1".
class Graph {
 public:
  Graph(const std::string& technique, std::uint32_t size, const std::string& params,
        const std::string& output = "ao.visibility") {
    const std::string text = "extent = [" + std::to_string(size) + ", " + std::to_string(size) + "]\noutput = \"" +
                             output +
                             "\"\n[[pass]]\nname = \"gbuffer\"\nrole = \"gbuffer\"\ntechnique = \"raster\"\n"
                             "[[pass]]\nname = \"ao\"\nrole = \"ambient_occlusion\"\ntechnique = \"" +
                             technique + "\"\n" + params + "\n";
    require(heddle_graph_parse(host(), text.c_str(), "test.toml", ".", nullptr, 0, &graph_));
  }
  ~Graph() { heddle_graph_destroy(graph_); }
  Graph(const Graph&) = delete;
  Graph& operator=(const Graph&) = delete;

  void set(const std::string& setting) { require(heddle_graph_set(graph_, setting.c_str())); }
  void keep(const char* port) { require(heddle_graph_keep(graph_, port)); }

  Image render(const Scene& scene, const char* port = nullptr, std::uint64_t seed = 0) {
    heddle_render_options options{};
    options.struct_size = sizeof options;
    options.seed = seed;
    require(heddle_render(graph_, scene.raw(), &options));
    return read(port);
  }
  Image read(const char* port) {
    heddle_image image{};
    image.struct_size = sizeof image;
    require(heddle_read(graph_, port, 0, 0, &image));
    Image made{image.width, image.height, image.channels, {}};
    made.pixels.assign(image.pixels,
                       image.pixels + static_cast<std::size_t>(image.width) * image.height * image.channels);
    return made;
  }
  [[nodiscard]] std::string stats() const {
    const char* json = "";
    require(heddle_stats(graph_, &json));
    return json;
  }

 private:
  heddle_graph* graph_ = nullptr;
};

}  // namespace rendering
