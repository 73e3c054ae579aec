// SPDX-License-Identifier: Apache-2.0
// What tests of techniques need to render: a host with the built plugins and the probe, procedural scenes in float64,
// graphs from text, and images. Everything goes through the C API.
#pragma once

#include <heddle/heddle.h>

#include <gtest/gtest.h>

#include <glm/glm.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

namespace rendering {

using glm::dmat4;
using glm::dquat;
using glm::dvec3;

inline constexpr double kPi = std::numbers::pi;

struct Image {
  std::uint32_t width = 0, height = 0, channels = 0;
  std::vector<float> pixels;
  [[nodiscard]] float at(std::uint32_t x, std::uint32_t y, std::uint32_t channel = 0) const {
    return pixels[(std::size_t{y} * width + x) * channels + channel];
  }
};

/// One host for all tests of an executable. It ends with the tests: when the process ends its driver may be gone.
class Host {
 public:
  static inline std::uint32_t flags = 0;  // HEDDLE_HOST_*, set before the first get()
  static Host& get() {
    if (!shared) shared.reset(new Host);
    return *shared;
  }
  heddle_host* handle = nullptr;
  std::vector<std::string> log;  // warnings and information, since clear()

  Host(const Host&) = delete;
  Host& operator=(const Host&) = delete;

 private:
  struct End : testing::Environment {
    void TearDown() override { shared.reset(); }
  };
  friend std::default_delete<Host>;
  static inline std::unique_ptr<Host> shared;
  static inline const auto* const end = testing::AddGlobalTestEnvironment(new End);

  Host() {
    const std::string path = HEDDLE_BUILD_DIR "/lib/heddle/plugins:" HEDDLE_BUILD_DIR "/tests/plugins";
    heddle_host_options options{};
    options.struct_size = sizeof options;
    options.flags = flags;
    options.plugin_path = path.c_str();
    options.log = [](void* user, std::uint32_t, const char* text) { static_cast<Host*>(user)->log.emplace_back(text); };
    options.log_user = this;
    if (heddle_create(&options, &handle) != HEDDLE_OK) {
      ADD_FAILURE() << heddle_error(nullptr);
      std::abort();
    }
  }
  ~Host() { heddle_destroy(handle); }
};

inline void check(heddle_status status) {
  ASSERT_EQ(status, HEDDLE_OK) << heddle_error(Host::get().handle);
}

class Scene {
 public:
  /// Everything that is added later moves by `offset`, metres.
  explicit Scene(const dvec3& offset = dvec3(0.0)) : offset_(offset) {
    check(heddle_scene_create(Host::get().handle, &handle));
    use_material(grey());
  }
  ~Scene() { heddle_scene_destroy(handle); }
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  /// Rough, dielectric, without textures.
  static HeddleMaterial grey() {
    HeddleMaterial record{};
    record.base_color[0] = record.base_color[1] = record.base_color[2] = 0.5F;
    record.base_color[3] = 1.0F;
    record.roughness = 1.0F;
    record.normal_scale = 1.0F;
    record.occlusion_strength = 1.0F;
    record.ior = 1.5F;
    record.alpha_cutoff = 0.5F;
    record.uv_rotation_scale[0] = record.uv_rotation_scale[3] = 1.0F;
    return record;
  }

  /// What is added later is made of it; textures are ids of heddle_scene_add_texture.
  void use_material(const HeddleMaterial& record, std::uint32_t base_color_texture = HEDDLE_NONE,
                    std::uint32_t normal_texture = HEDDLE_NONE) {
    heddle_material material{};
    material.struct_size = sizeof material;
    std::fill(std::begin(material.textures), std::end(material.textures), HEDDLE_NONE);
    material.textures[HEDDLE_TEXTURE_BASE_COLOR] = base_color_texture;
    material.textures[HEDDLE_TEXTURE_NORMAL] = normal_texture;
    material.record = record;
    check(heddle_scene_add_material(handle, nullptr, &material, &material_));
  }

  void add_box(const dvec3& low, const dvec3& high) {
    std::vector<float> positions;
    std::vector<std::uint32_t> indices;
    for (int axis = 0; axis < 3; ++axis) {
      for (const int side : {0, 1}) {
        const auto first = static_cast<std::uint32_t>(positions.size() / 3);
        for (int corner = 0; corner < 4; ++corner) {
          std::array<float, 3> p{};
          p[static_cast<std::size_t>(axis)] = side == 1 ? 0.5F : -0.5F;
          p[static_cast<std::size_t>((axis + 1) % 3)] = corner == 1 || corner == 2 ? 0.5F : -0.5F;
          p[static_cast<std::size_t>((axis + 2) % 3)] = corner >= 2 ? 0.5F : -0.5F;
          positions.insert(positions.end(), p.begin(), p.end());
        }
        for (const std::uint32_t i : {0U, 1U, 2U, 0U, 2U, 3U}) {
          // The other side is wound the other way.
          indices.push_back(first + (side == 1 ? i : 3U - i));
        }
      }
    }
    add_mesh(positions, {}, indices, glm::scale(glm::translate(dmat4(1.0), 0.5 * (low + high) + offset_), high - low));
  }

  /// A rectangle facing +Y.
  void add_floor(const dvec3& centre, double half_size) {
    const auto h = static_cast<float>(half_size);
    add_mesh({-h, 0, -h, -h, 0, h, h, 0, h, h, 0, -h}, {}, {0, 1, 2, 0, 2, 3},
             glm::translate(dmat4(1.0), centre + offset_));
  }

  void add_sphere(const dvec3& centre, double radius, std::uint32_t rings = 128) {
    std::vector<float> positions;
    std::vector<float> normals;
    std::vector<std::uint32_t> indices;
    const std::uint32_t sectors = 2 * rings;
    for (std::uint32_t i = 0; i <= rings; ++i) {
      for (std::uint32_t j = 0; j <= sectors; ++j) {
        const double theta = kPi * i / rings;
        const double phi = 2.0 * kPi * j / sectors;
        for (const double x : {std::sin(theta) * std::sin(phi), std::cos(theta), std::sin(theta) * std::cos(phi)}) {
          normals.push_back(static_cast<float>(x));
          positions.push_back(static_cast<float>(radius * x));
        }
        if (i == rings || j == sectors) continue;
        const std::uint32_t a = i * (sectors + 1) + j;
        const std::uint32_t b = a + sectors + 1;
        for (const std::uint32_t index : {a, b, b + 1, a, b + 1, a + 1}) indices.push_back(index);
      }
    }
    add_mesh(positions, normals, indices, glm::translate(dmat4(1.0), centre + offset_));
  }

  void add_light(HeddleLight record, const dvec3& position = dvec3(0.0)) {
    heddle_light light{};
    light.struct_size = sizeof light;
    for (int i = 0; i < 3; ++i) light.position[i] = position[i] + offset_[i];
    light.record = record;
    std::uint32_t id = 0;
    check(heddle_scene_add_light(handle, nullptr, &light, &id));
  }

  /// A perspective camera; `vertical_angle` in radians.
  void look(const dvec3& from, const dvec3& at, double vertical_angle = 1.0) {
    heddle_camera camera{};
    camera.struct_size = sizeof camera;
    const dvec3 forward = glm::normalize(at - from);
    const dquat rotation = glm::quatLookAt(forward, std::abs(forward.y) < 0.99 ? dvec3(0, 1, 0) : dvec3(0, 0, -1));
    for (int i = 0; i < 3; ++i) camera.position[i] = from[i] + offset_[i];
    camera.rotation[0] = rotation.x;
    camera.rotation[1] = rotation.y;
    camera.rotation[2] = rotation.z;
    camera.rotation[3] = rotation.w;
    camera.vertical_angle = vertical_angle;
    std::uint32_t id = 0;
    check(heddle_scene_add_camera(handle, nullptr, &camera, &id));
    check(heddle_scene_use_camera(handle, id));
  }

  /// The matrix holds no offset of the scene: add it where it is wanted.
  void add_mesh(const std::vector<float>& positions, const std::vector<float>& normals,
                const std::vector<std::uint32_t>& indices, const dmat4& scene_from_object,
                const std::vector<float>& uvs = {}) {
    heddle_mesh mesh{};
    mesh.struct_size = sizeof mesh;
    mesh.vertex_count = static_cast<std::uint32_t>(positions.size() / 3);
    mesh.index_count = static_cast<std::uint32_t>(indices.size());
    mesh.positions = positions.data();
    mesh.normals = normals.empty() ? nullptr : normals.data();
    mesh.uv0 = uvs.empty() ? nullptr : uvs.data();
    mesh.indices = indices.data();
    std::uint32_t id = 0;
    check(heddle_scene_add_mesh(handle, nullptr, &mesh, material_, &id));
    check(heddle_scene_add_instance(handle, nullptr, id, &scene_from_object[0][0], &id));
  }

  heddle_scene* handle = nullptr;

 private:
  dvec3 offset_;
  std::uint32_t material_ = 0;
};

class Graph {
 public:
  explicit Graph(const std::string& text, const std::vector<std::string>& settings = {}) {
    std::vector<const char*> list;
    for (const std::string& setting : settings) list.push_back(setting.c_str());
    check(heddle_graph_parse(Host::get().handle, text.c_str(), "test.toml", HEDDLE_SOURCE_DIR "/scripts/graphs",
                             list.data(), static_cast<std::uint32_t>(list.size()), &handle));
  }
  ~Graph() { heddle_graph_destroy(handle); }
  Graph(const Graph&) = delete;
  Graph& operator=(const Graph&) = delete;

  void keep(const char* port) { check(heddle_graph_keep(handle, port)); }
  void set(const std::string& setting) { check(heddle_graph_set(handle, setting.c_str())); }
  void render(Scene& scene) { check(heddle_render(handle, scene.handle, nullptr)); }
  Image read(const char* port = nullptr, std::uint32_t layer = 0) {
    heddle_image image{};
    image.struct_size = sizeof image;
    check(heddle_read(handle, port, layer, 0, &image));
    Image out{image.width, image.height, image.channels, {}};
    if (image.pixels != nullptr) {
      out.pixels.assign(image.pixels, image.pixels + std::size_t{image.width} * image.height * image.channels);
    }
    return out;
  }
  Image image(Scene& scene) {
    render(scene);
    return read();
  }
  heddle_graph* handle = nullptr;
};

inline HeddleLight light(std::uint32_t type, const dvec3& direction = dvec3(0, -1, 0), double intensity = 1.0) {
  HeddleLight record{};
  record.type = type;
  record.flags = HEDDLE_LIGHT_CASTS_SHADOW;
  const dvec3 d = glm::normalize(direction);
  const dvec3 tangent = glm::normalize(glm::cross(d, std::abs(d.y) < 0.9 ? dvec3(0, 1, 0) : dvec3(0, 0, 1)));
  for (int i = 0; i < 3; ++i) {
    record.direction[i] = static_cast<float>(d[i]);
    record.tangent[i] = static_cast<float>(tangent[i]);
    record.intensity[i] = static_cast<float>(intensity);
  }
  record.cos_inner = 0.9F;
  record.cos_outer = 0.6F;
  return record;
}

inline std::string text_of(const dvec3& v) {
  return "[" + std::to_string(v.x) + ", " + std::to_string(v.y) + ", " + std::to_string(v.z) + "]";
}

}  // namespace rendering
