// SPDX-License-Identifier: Apache-2.0
// A glTF file -> meshes, instances, lights and cameras of a scene, all or nothing.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "scene/gltf_materials.hpp"
#include "scene/gltf_meshes.hpp"

namespace heddle::scene {
namespace gltf {
namespace {

glm::dmat4 local_matrix(const Document& document, std::size_t index) {
  const tinygltf::Node& node = document.model.nodes[index];
  const auto check = [&](const std::vector<double>& values, std::size_t size, const char* name) {
    if (!values.empty() && values.size() != size) {
      document.fail(fmt::format("node {} '{}': its {} has the wrong length", index, node.name, name),
                    fmt::format("{}", values.size()), fmt::format("{}", size));
    }
    if (!std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); })) {
      document.fail(fmt::format("node {} '{}': its {} is not finite", index, node.name, name));
    }
    return !values.empty();
  };
  glm::dmat4 matrix(1.0);
  if (check(node.matrix, 16, "matrix")) {
    for (int i = 0; i < 16; ++i) {
      matrix[i / 4][i % 4] = node.matrix[static_cast<std::size_t>(i)];
    }
    if (matrix[0][3] != 0 || matrix[1][3] != 0 || matrix[2][3] != 0 || matrix[3][3] != 1) {
      document.fail(fmt::format("node {} '{}': its matrix is not affine", index, node.name),
                    fmt::format("last row {}, {}, {}, {}", matrix[0][3], matrix[1][3], matrix[2][3], matrix[3][3]),
                    "0, 0, 0, 1");
    }
    return matrix;
  }
  if (check(node.rotation, 4, "rotation")) {
    const glm::dquat rotation(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]);
    const double length = glm::length(rotation);
    matrix = length > 0 ? glm::mat4_cast(rotation / length) : matrix;
  }
  if (check(node.scale, 3, "scale")) {
    for (int i = 0; i < 3; ++i) {
      matrix[i] *= node.scale[static_cast<std::size_t>(i)];
    }
  }
  if (check(node.translation, 3, "translation")) {
    matrix[3] = glm::dvec4(node.translation[0], node.translation[1], node.translation[2], 1.0);
  }
  return matrix;
}

/// Places of all nodes, parents first; fails where the nodes are no forest.
std::vector<glm::dmat4> node_matrices(const Document& document) {
  const std::vector<tinygltf::Node>& nodes = document.model.nodes;
  std::vector<std::uint8_t> has_parent(nodes.size(), 0);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (const int child : nodes[i].children) {
      if (child < 0 || static_cast<std::size_t>(child) >= nodes.size()) {
        document.fail(fmt::format("node {} '{}' has the child {}, which does not exist", i, nodes[i].name, child),
                      fmt::format("{} nodes", nodes.size()));
      }
      if (std::exchange(has_parent[static_cast<std::size_t>(child)], std::uint8_t{1}) != 0) {
        document.fail(fmt::format("node {} '{}' has two parents", child, nodes[static_cast<std::size_t>(child)].name));
      }
    }
  }
  std::vector<glm::dmat4> matrices(nodes.size(), glm::dmat4(1.0));
  std::vector<std::size_t> pending;
  std::size_t reached = 0;
  for (std::size_t i = nodes.size(); i-- > 0;) {
    if (has_parent[i] == 0) {
      matrices[i] = local_matrix(document, i);
      pending.push_back(i);
    }
  }
  while (!pending.empty()) {
    const std::size_t node = pending.back();
    pending.pop_back();
    ++reached;
    for (const int child : nodes[node].children) {
      const auto index = static_cast<std::size_t>(child);
      matrices[index] = matrices[node] * local_matrix(document, index);
      for (int column = 0; column < 4; ++column) {
        if (!std::isfinite(glm::dot(matrices[index][column], glm::dvec4(1.0)))) {
          document.fail(fmt::format("node {} '{}': its place in the scene is not finite", child,
                                    document.model.nodes[index].name));
        }
      }
      pending.push_back(index);
    }
  }
  // With one parent each, what no root reaches runs in a circle.
  if (reached != nodes.size()) {
    document.fail("the nodes contain a cycle", fmt::format("{} of {} nodes have a root", reached, nodes.size()),
                  "a tree");
  }
  return matrices;
}

/// Nodes of the file's scene, in depth-first order of the file.
std::vector<std::size_t> shown_nodes(const Document& document) {
  const tinygltf::Model& model = document.model;
  std::vector<std::size_t> pending;
  if (model.scenes.empty()) {
    std::vector<std::uint8_t> has_parent(model.nodes.size(), 0);
    for (const tinygltf::Node& node : model.nodes) {
      for (const int child : node.children) {
        has_parent[static_cast<std::size_t>(child)] = 1;
      }
    }
    for (std::size_t i = model.nodes.size(); i-- > 0;) {
      if (has_parent[i] == 0) {
        pending.push_back(i);
      }
    }
  } else {
    const int chosen = std::max(model.defaultScene, 0);
    if (static_cast<std::size_t>(chosen) >= model.scenes.size()) {
      document.fail(fmt::format("the file's scene is {}, which does not exist", chosen),
                    fmt::format("{} scenes", model.scenes.size()));
    }
    const std::vector<int>& roots = model.scenes[static_cast<std::size_t>(chosen)].nodes;
    for (auto root = roots.rbegin(); root != roots.rend(); ++root) {
      if (*root < 0 || static_cast<std::size_t>(*root) >= model.nodes.size()) {
        document.fail(fmt::format("the file's scene has the node {}, which does not exist", *root),
                      fmt::format("{} nodes", model.nodes.size()));
      }
      pending.push_back(static_cast<std::size_t>(*root));
    }
  }
  std::vector<std::uint8_t> is_shown(model.nodes.size(), 0);
  std::vector<std::size_t> shown;
  while (!pending.empty()) {
    const std::size_t node = pending.back();
    pending.pop_back();
    if (std::exchange(is_shown[node], std::uint8_t{1}) != 0) {
      document.fail(fmt::format("node {} '{}' is in the scene twice", node, model.nodes[node].name));
    }
    shown.push_back(node);
    const std::vector<int>& children = model.nodes[node].children;
    for (auto child = children.rbegin(); child != children.rend(); ++child) {
      pending.push_back(static_cast<std::size_t>(*child));
    }
  }
  return shown;
}

/// Axes of a node made orthonormal and right-handed; looking along -Z stays, scale and shear go.
glm::dmat3 rotation_part(const glm::dmat4& matrix) {
  const auto unit_or = [](const glm::dvec3& vector, const glm::dvec3& otherwise) {
    const double length = glm::length(vector);
    return length > 0 ? vector / length : otherwise;
  };
  const glm::dvec3 z = unit_or(glm::dvec3(matrix[2]), {0, 0, 1});
  const glm::dvec3 helper = std::abs(z.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0);
  const glm::dvec3 x = unit_or(glm::cross(glm::dvec3(matrix[1]), z), unit_or(glm::cross(helper, z), {1, 0, 0}));
  return {x, glm::cross(z, x), z};
}

class FileImport {
 public:
  explicit FileImport(Document document, Scene& scene)
      : document_(std::move(document)), scene_(scene), materials_(document_, scene) {}

  void run() {
    const std::vector<glm::dmat4> matrices = node_matrices(document_);
    for (const std::size_t node : shown_nodes(document_)) {
      import_mesh(node, matrices);
      import_light(node, matrices[node]);
      import_camera(node, matrices[node]);
    }
    materials_.decode_textures();
    scene_.warnings = std::move(document_.warnings);
    scene_.ignored_extensions = std::move(document_.ignored_extensions);
  }

 private:
  void import_mesh(std::size_t index, const std::vector<glm::dmat4>& matrices) {
    const tinygltf::Node& node = document_.model.nodes[index];
    if (node.mesh < 0) {
      return;
    }
    if (static_cast<std::size_t>(node.mesh) >= document_.model.meshes.size()) {
      document_.fail(fmt::format("node {} '{}' shows mesh {}, which does not exist", index, node.name, node.mesh),
                     fmt::format("{} meshes", document_.model.meshes.size()));
    }
    const auto mesh = static_cast<std::size_t>(node.mesh);
    const tinygltf::Mesh& source = document_.model.meshes[mesh];
    const std::vector<double>& weights = node.weights.empty() ? source.weights : node.weights;
    std::vector<glm::dmat4> joints;
    if (node.skin >= 0) {
      joints = joint_matrices(document_, node.skin, matrices);
    }
    for (std::size_t i = 0; i < source.primitives.size(); ++i) {
      glm::dmat4 scene_from_object = matrices[index];
      const std::uint32_t id =
          joints.empty() ? shared_mesh(mesh, i, weights) : skinned_mesh(mesh, i, weights, joints, scene_from_object);
      if (id == HEDDLE_NONE) {
        continue;
      }
      Instance instance;
      instance.name = node.name.empty() ? fmt::format("node {}", index) : node.name;
      instance.mesh = id;
      instance.scene_from_object = instance.previous_scene_from_object = scene_from_object;
      scene_.instances.push_back(std::move(instance));
    }
  }

  /// Meshes without joints are made once, however many nodes show them.
  std::uint32_t shared_mesh(std::size_t mesh, std::size_t primitive, const std::vector<double>& weights) {
    const auto [entry, is_new] = meshes_.try_emplace({mesh, primitive, weights}, HEDDLE_NONE);
    if (is_new) {
      if (std::optional<Primitive> read = read_primitive(document_, mesh, primitive, weights)) {
        entry->second = add(mesh, primitive, std::move(*read));
      }
    }
    return entry->second;
  }

  /// The node's own place does not count for skinned meshes: the joints place the vertices in the scene. Large
  /// translations stay in float64, in the instance.
  std::uint32_t skinned_mesh(std::size_t mesh, std::size_t index, const std::vector<double>& weights,
                             const std::vector<glm::dmat4>& joints, glm::dmat4& scene_from_object) {
    std::optional<Primitive> primitive = read_primitive(document_, mesh, index, weights);
    if (!primitive) {
      return HEDDLE_NONE;
    }
    if (primitive->influence.per_vertex == 0) {
      document_.warn(fmt::format("primitive {} of mesh {} '{}' is skinned but has no joints: its node places it", index,
                                 mesh, document_.model.meshes[mesh].name));
      return add(mesh, index, std::move(*primitive));
    }
    const glm::dvec3 origin = glm::round(glm::dvec3(joints.front()[3]));
    apply_skin(document_, joints, origin, *primitive);
    scene_from_object = glm::dmat4(1.0);
    scene_from_object[3] = glm::dvec4(origin, 1.0);
    return add(mesh, index, std::move(*primitive));
  }

  std::uint32_t add(std::size_t mesh, std::size_t index, Primitive primitive) {
    if (primitive.attributes.indices.empty()) {
      return HEDDLE_NONE;
    }
    const tinygltf::Mesh& source = document_.model.meshes[mesh];
    const std::uint32_t material = materials_.import(source.primitives[index].material);
    std::string name = source.name.empty() ? fmt::format("mesh {}", mesh) : source.name;
    if (source.primitives.size() > 1) {
      name += fmt::format(".{}", index);
    }
    const Material& look = scene_.materials[material];
    std::uint32_t tangent_uv_set = HEDDLE_NONE;
    if (look.textures[HEDDLE_TEXTURE_NORMAL] != HEDDLE_NONE) {
      tangent_uv_set = (look.record.texture_uv_sets >> HEDDLE_TEXTURE_NORMAL) & 1U;
    }
    scene_.meshes.push_back(build_mesh(std::move(name), material, std::move(primitive.attributes), tangent_uv_set));
    return static_cast<std::uint32_t>(scene_.meshes.size() - 1);
  }

  void import_light(std::size_t index, const glm::dmat4& matrix) {
    const tinygltf::Node& node = document_.model.nodes[index];
    const double number = extension_number(node.extensions, "KHR_lights_punctual", "light", -1.0);
    if (number < 0) {
      return;
    }
    if (number >= static_cast<double>(document_.model.lights.size())) {
      document_.fail(fmt::format("node {} '{}' has light {}, which does not exist", index, node.name, number),
                     fmt::format("{} lights", document_.model.lights.size()));
    }
    const tinygltf::Light& source = document_.model.lights[static_cast<std::size_t>(number)];
    Light light;
    light.name = !source.name.empty() ? source.name : !node.name.empty() ? node.name : fmt::format("light {}", number);
    light.position = glm::dvec3(matrix[3]);
    HeddleLight& record = light.record;
    if (source.type == "directional") {
      record.type = HEDDLE_LIGHT_DIRECTIONAL;
    } else if (source.type == "point") {
      record.type = HEDDLE_LIGHT_POINT;
    } else if (source.type == "spot") {
      record.type = HEDDLE_LIGHT_SPOT;
    } else {
      document_.fail(fmt::format("light '{}' is of an unknown type", light.name), source.type,
                     "directional, point or spot");
    }
    const glm::dmat3 rotation = rotation_part(matrix);
    for (int i = 0; i < 3; ++i) {
      const auto channel = static_cast<std::size_t>(i);
      const double color = channel < source.color.size() ? source.color[channel] : 1.0;
      record.intensity[i] = static_cast<float>(color * source.intensity);
      record.direction[i] = static_cast<float>(-rotation[2][i]);
      record.tangent[i] = static_cast<float>(rotation[0][i]);
      if (!(record.intensity[i] >= 0) || !std::isfinite(record.intensity[i])) {
        document_.fail(fmt::format("light '{}': its colour times intensity is negative or not finite", light.name));
      }
    }
    record.range = static_cast<float>(std::max(source.range, 0.0));
    record.flags = HEDDLE_LIGHT_CASTS_SHADOW;
    if (record.type == HEDDLE_LIGHT_SPOT) {
      const double outer = std::clamp(source.spot.outerConeAngle, 0.0, 0.5 * std::numbers::pi);
      const double inner = std::clamp(source.spot.innerConeAngle, 0.0, outer);
      record.cos_inner = static_cast<float>(std::cos(inner));
      record.cos_outer = static_cast<float>(std::cos(outer));
    }
    record.id = static_cast<std::uint32_t>(scene_.lights.size());
    scene_.lights.push_back(std::move(light));
  }

  /// The aspect of the file is left to the frame: it would stretch images of another shape.
  void import_camera(std::size_t index, const glm::dmat4& matrix) {
    const tinygltf::Node& node = document_.model.nodes[index];
    if (node.camera < 0) {
      return;
    }
    if (static_cast<std::size_t>(node.camera) >= document_.model.cameras.size()) {
      document_.fail(fmt::format("node {} '{}' has camera {}, which does not exist", index, node.name, node.camera),
                     fmt::format("{} cameras", document_.model.cameras.size()));
    }
    const tinygltf::Camera& source = document_.model.cameras[static_cast<std::size_t>(node.camera)];
    Camera camera;
    camera.name = !source.name.empty() ? source.name : !node.name.empty() ? node.name : fmt::format("node {}", index);
    heddle_camera& record = camera.record;
    record.struct_size = sizeof record;
    const glm::dquat rotation = glm::normalize(glm::quat_cast(rotation_part(matrix)));
    for (int i = 0; i < 3; ++i) {
      record.position[i] = matrix[3][i];
    }
    record.rotation[0] = rotation.x;
    record.rotation[1] = rotation.y;
    record.rotation[2] = rotation.z;
    record.rotation[3] = rotation.w;
    record.is_orthographic = source.type == "orthographic" ? 1 : 0;
    if (record.is_orthographic != 0) {
      record.vertical_angle = std::abs(source.orthographic.ymag);
      record.near_distance = std::max(source.orthographic.znear, 0.0);
      record.far_distance = source.orthographic.zfar;
    } else {
      record.vertical_angle = source.perspective.yfov;
      record.near_distance = source.perspective.znear;
    }
    const bool is_valid = std::isfinite(record.vertical_angle) && record.vertical_angle > 0 &&
                          (record.is_orthographic != 0 || record.vertical_angle < std::numbers::pi);
    if (!is_valid) {
      document_.fail(fmt::format("camera '{}' has no proper angle or size", camera.name),
                     fmt::format("{}", record.vertical_angle), "greater than 0, and less than pi for perspective");
    }
    scene_.cameras.push_back(std::move(camera));
  }

  Document document_;
  Scene& scene_;
  MaterialImport materials_;
  std::map<std::tuple<std::size_t, std::size_t, std::vector<double>>, std::uint32_t> meshes_;
};

template <typename Element>
void append(std::vector<Element>& to, std::vector<Element>& from) {
  to.insert(to.end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
}

/// Moves a loaded scene behind another: indices shift, and nothing here can fail but memory.
void merge(Scene& scene, Scene loaded) {
  const auto textures = static_cast<std::uint32_t>(scene.textures.size());
  const auto materials = static_cast<std::uint32_t>(scene.materials.size());
  const auto meshes = static_cast<std::uint32_t>(scene.meshes.size());
  const auto lights = static_cast<std::uint32_t>(scene.lights.size());
  for (Material& material : loaded.materials) {
    for (std::uint32_t& texture : material.textures) {
      texture += texture == HEDDLE_NONE ? 0 : textures;
    }
    material.record.id += materials;
  }
  for (Mesh& mesh : loaded.meshes) {
    mesh.material += materials;
  }
  for (Instance& instance : loaded.instances) {
    instance.mesh += meshes;
  }
  for (Light& light : loaded.lights) {
    light.record.id += lights;
  }
  scene.textures.reserve(scene.textures.size() + loaded.textures.size());
  scene.materials.reserve(scene.materials.size() + loaded.materials.size());
  scene.meshes.reserve(scene.meshes.size() + loaded.meshes.size());
  scene.instances.reserve(scene.instances.size() + loaded.instances.size());
  scene.lights.reserve(scene.lights.size() + loaded.lights.size());
  scene.cameras.reserve(scene.cameras.size() + loaded.cameras.size());
  scene.warnings.reserve(scene.warnings.size() + loaded.warnings.size());
  scene.ignored_extensions.reserve(scene.ignored_extensions.size() + loaded.ignored_extensions.size());
  if (scene.cameras.empty() && !loaded.cameras.empty()) {
    scene.camera = 0;
  }
  append(scene.textures, loaded.textures);
  append(scene.materials, loaded.materials);
  append(scene.meshes, loaded.meshes);
  append(scene.instances, loaded.instances);
  append(scene.lights, loaded.lights);
  append(scene.cameras, loaded.cameras);
  append(scene.warnings, loaded.warnings);
  for (std::string& extension : loaded.ignored_extensions) {
    if (std::find(scene.ignored_extensions.begin(), scene.ignored_extensions.end(), extension) ==
        scene.ignored_extensions.end()) {
      scene.ignored_extensions.push_back(std::move(extension));
    }
  }
  scene.content_revision = Scene::new_revision();
  scene.motion_revision = Scene::new_revision();
}

}  // namespace
}  // namespace gltf

void load_gltf(Scene& scene, const std::filesystem::path& file) {
  Scene loaded;
  gltf::FileImport(gltf::open_document(file), loaded).run();
  gltf::merge(scene, std::move(loaded));
}

}  // namespace heddle::scene
