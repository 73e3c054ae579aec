// SPDX-License-Identifier: Apache-2.0
// A glTF file -> meshes, instances, lights and cameras of a scene, all or nothing.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "scene/gltf_components.hpp"
#include "scene/gltf_materials.hpp"
#include "scene/gltf_meshes.hpp"
#include "scene/gltf_rig.hpp"
#include "scene/pose.hpp"

namespace heddle::scene {
namespace gltf {
namespace {

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

// What an instance costs with its names and places, and a vertex with the attributes that it is made of: what the
// structures hold, rounded up.
constexpr std::uint64_t kInstanceBytes = 512, kVertexBytes = 256;

class FileImport {
 public:
  explicit FileImport(Document document, Scene& scene)
      : document_(std::move(document)), scene_(scene), materials_(document_, scene), components_(document_, scene) {}

  void run() {
    rig_ = import_rig(document_);
    is_moving_ = rig_.moving_nodes();
    is_morphing_ = rig_.morphing_nodes();
    rig_.animation = HEDDLE_NONE;
    rest_ = rig_.pose(0);
    const std::vector<std::size_t> shown = shown_nodes(document_);
    for (std::size_t i = 0; i < shown.size(); ++i) {
      // Textures take the other half.
      document_.report("reading the nodes", 0.5 * static_cast<double>(i) / static_cast<double>(shown.size()));
      const std::size_t node = shown[i];
      const auto instance = static_cast<std::uint32_t>(scene_.instances.size());
      const auto light = static_cast<std::uint32_t>(scene_.lights.size());
      import_mesh(node);
      import_light(node, rest_.scene_from_node[node]);
      import_camera(node, rest_.scene_from_node[node]);
      components_.import_node(node, instance, light);
    }
    components_.import_materials(materials_.ids());
    components_.import_scene();
    components_.throw_if_any();
    materials_.decode_textures();
    scene_.warnings = std::move(document_.warnings);
    scene_.ignored_extensions = std::move(document_.ignored_extensions);
    if (!rig_.animations.empty()) {
      scene_.rigs.push_back(std::move(rig_));
      scene_.use_animation(0, false);
      scene_.settle();
    }
  }

 private:
  void import_mesh(std::size_t index) {
    const tinygltf::Node& node = document_.model.nodes[index];
    if (node.mesh < 0) {
      return;
    }
    if (static_cast<std::size_t>(node.mesh) >= document_.model.meshes.size()) {
      document_.fail(fmt::format("node {} '{}' shows mesh {}, which does not exist", index, node.name, node.mesh),
                     fmt::format("{} meshes", document_.model.meshes.size()));
    }
    const auto mesh = static_cast<std::size_t>(node.mesh);
    const std::size_t primitives = document_.model.meshes[mesh].primitives.size();
    const std::uint32_t skin = node.skin < 0 ? HEDDLE_NONE : import_skin(document_, node.skin, rig_, skin_ids_);
    for (std::size_t i = 0; i < primitives; ++i) {
      document_.spend(kInstanceBytes, fmt::format("node {} '{}'", index, node.name));
      Instance instance;
      instance.name = node.name.empty() ? fmt::format("node {}", index) : node.name;
      instance.scene_from_object = rest_.scene_from_node[index];
      instance.mesh = skin == HEDDLE_NONE && is_morphing_[index] == 0
                          ? shared_mesh(mesh, i, index)
                          : own_mesh(mesh, i, index, skin, instance.scene_from_object);
      if (instance.mesh == HEDDLE_NONE) {
        continue;
      }
      instance.previous_scene_from_object = instance.scene_from_object;
      const auto id = static_cast<std::uint32_t>(scene_.instances.size());
      if (is_moving_[index] != 0 && !is_skinned_[instance.mesh]) {
        rig_.instances.push_back({static_cast<std::uint32_t>(index), id});
      }
      scene_.instances.push_back(std::move(instance));
    }
  }

  /// Meshes that do not bend are made once for equal morph weights, however many nodes show them.
  std::uint32_t shared_mesh(std::size_t mesh, std::size_t index, std::size_t node) {
    const std::vector<double>& weights = rig_.nodes[node].weights;
    const auto [entry, is_new] = meshes_.try_emplace({mesh, index, weights}, HEDDLE_NONE);
    if (is_new) {
      const bool is_morphed = std::any_of(weights.begin(), weights.end(), [](double weight) { return weight != 0; });
      if (std::optional<Primitive> primitive = read_primitive(document_, mesh, index, is_morphed)) {
        Deformation unused;
        entry->second = add(mesh, index, std::move(*primitive), weights, {}, unused);
      }
    }
    return entry->second;
  }

  /// A mesh for this node alone. The node's own place does not count for skinned meshes: the joints place the vertices
  /// in the scene. Large translations stay in float64, in the instance.
  std::uint32_t own_mesh(std::size_t mesh, std::size_t index, std::size_t node, std::uint32_t skin,
                         glm::dmat4& scene_from_object) {
    const std::vector<double>& weights = rig_.nodes[node].weights;
    const bool is_morphed = is_morphing_[node] != 0 ||
                            std::any_of(weights.begin(), weights.end(), [](double weight) { return weight != 0; });
    std::optional<Primitive> primitive = read_primitive(document_, mesh, index, is_morphed);
    if (!primitive) {
      return HEDDLE_NONE;
    }
    std::vector<glm::dmat4> joints;
    bool bends = is_morphing_[node] != 0;
    if (skin != HEDDLE_NONE && primitive->influence.per_vertex == 0) {
      document_.warn(fmt::format("primitive {} of mesh {} '{}' is skinned but has no joints: its node places it", index,
                                 mesh, document_.model.meshes[mesh].name));
    } else if (skin != HEDDLE_NONE) {
      document_.spend(rig_.skins[skin].joints.size() * sizeof(glm::dmat4), "joints of a skin");
      joints = rig_.joint_matrices(rig_.skins[skin], rest_);
      const std::vector<std::uint32_t>& nodes = rig_.skins[skin].joints;
      bends |= std::any_of(nodes.begin(), nodes.end(), [&](std::uint32_t joint) { return is_moving_[joint] != 0; });
      scene_from_object = glm::dmat4(1.0);
      scene_from_object[3] = glm::dvec4(skin_origin(joints), 1.0);
    }
    Deformation deformation;
    deformation.node = static_cast<std::uint32_t>(node);
    deformation.skin = joints.empty() ? HEDDLE_NONE : skin;
    deformation.instance = static_cast<std::uint32_t>(scene_.instances.size());
    const std::uint32_t id = add(mesh, index, std::move(*primitive), weights, joints, deformation);
    if (id == HEDDLE_NONE) {
      return id;
    }
    is_skinned_[id] = !joints.empty();
    if (bends) {
      deformation.mesh = id;
      scene_.meshes[id].shape = scene_.meshes[id].previous_shape = 1;
      rig_.deformations.push_back(std::move(deformation));
    }
    return id;
  }

  /// Adds a mesh, bent as the file rests; `deformation` receives what it takes to bend it otherwise.
  std::uint32_t add(std::size_t mesh, std::size_t index, Primitive primitive, std::span<const double> weights,
                    std::span<const glm::dmat4> joints, Deformation& deformation) {
    Attributes& attributes = primitive.attributes;
    if (attributes.indices.empty()) {
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
    // Flat normals and split tangents make at most a vertex of every corner.
    const std::size_t bound = std::max(attributes.positions.size(), attributes.indices.size());
    document_.spend(bound * (kVertexBytes + primitive.targets.size() * sizeof(glm::vec3[3]) +
                             primitive.influence.per_vertex * sizeof(std::uint64_t)),
                    fmt::format("mesh '{}'", name));
    const std::array<float, 4> uv_matrix = texture_transform(look.record, HEDDLE_TEXTURE_NORMAL).matrix;
    const auto id = static_cast<std::uint32_t>(scene_.meshes.size());
    is_skinned_.push_back(false);
    if (joints.empty() && primitive.targets.empty()) {
      scene_.meshes.push_back(build_mesh(std::move(name), material, std::move(attributes), tangent_uv_set, uv_matrix));
      scene_.meshes.back().face_sizes = std::move(primitive.face_sizes);
      return id;
    }
    deformation.name = fmt::format("primitive {} of mesh {} '{}'", index, mesh, source.name);
    deformation.has_flat_normals = attributes.normals.empty();
    deformation.has_tangents = !attributes.normals.empty() && !attributes.tangents.empty();
    attributes.sources.resize(attributes.positions.size());
    std::iota(attributes.sources.begin(), attributes.sources.end(), 0U);
    complete(attributes, tangent_uv_set, uv_matrix);
    follow(primitive, deformation);
    Mesh made = pack(std::move(name), material, std::move(attributes));
    const glm::dvec3 origin = skin_origin(joints);
    set_shape(deform(deformation, weights, joints, origin, made.indices, document_.file), deformation, made);
    made.shape = 0;
    made.previous_vertices = {};
    made.face_sizes = std::move(primitive.face_sizes);
    scene_.meshes.push_back(std::move(made));
    return id;
  }

  /// The arrays of a primitive in the order of its completed vertices.
  static void follow(const Primitive& primitive, Deformation& deformation) {
    const Attributes& attributes = primitive.attributes;
    deformation.positions = attributes.positions;
    deformation.normals = attributes.normals;
    deformation.tangents = attributes.tangents;
    const std::vector<std::uint32_t>& sources = attributes.sources;
    const auto spread = [&](const std::vector<glm::vec3>& values) {
      std::vector<glm::vec3> followed;
      followed.reserve(values.empty() ? 0 : sources.size());
      for (std::size_t i = 0; !values.empty() && i < sources.size(); ++i) {
        followed.push_back(values[sources[i]]);
      }
      return followed;
    };
    for (const MorphTarget& target : primitive.targets) {
      deformation.targets.push_back({spread(target.positions), spread(target.normals), spread(target.tangents)});
    }
    const Influence& given = primitive.influence;
    Influence& made = deformation.influence;
    made.per_vertex = given.per_vertex;
    for (const std::uint32_t source : sources) {
      const auto first = static_cast<std::ptrdiff_t>(source * given.per_vertex);
      const auto last = first + static_cast<std::ptrdiff_t>(given.per_vertex);
      made.joints.insert(made.joints.end(), given.joints.begin() + first, given.joints.begin() + last);
      made.weights.insert(made.weights.end(), given.weights.begin() + first, given.weights.begin() + last);
    }
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
    place_light(light, matrix);
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
    for (int i = 0; i < 3; ++i) {
      const auto channel = static_cast<std::size_t>(i);
      const double color = channel < source.color.size() ? source.color[channel] : 1.0;
      record.intensity[i] = static_cast<float>(color * source.intensity);
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
    if (is_moving_[index] != 0) {
      rig_.lights.push_back({static_cast<std::uint32_t>(index), record.id});
    }
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
    place_camera(record, matrix);
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
    if (is_moving_[index] != 0) {
      rig_.cameras.push_back({static_cast<std::uint32_t>(index), static_cast<std::uint32_t>(scene_.cameras.size())});
    }
    scene_.cameras.push_back(std::move(camera));
  }

  Document document_;
  Scene& scene_;
  MaterialImport materials_;
  ComponentImport components_;
  Rig rig_;
  Rig::Pose rest_;
  std::vector<std::uint8_t> is_moving_, is_morphing_;  // by node, in any animation
  std::vector<std::uint32_t> skin_ids_;                // of the rig, by skin of the file
  std::vector<bool> is_skinned_;                       // by mesh: joints place it
  std::map<std::tuple<std::size_t, std::size_t, std::vector<double>>, std::uint32_t> meshes_;
};

}  // namespace
}  // namespace gltf

void load_gltf(Scene& scene, const std::filesystem::path& file, const LoadLimits& limits) {
  Scene loaded;
  loaded.time = scene.time;
  loaded.components.catalog = scene.components.catalog;
  gltf::Document document = gltf::open_document(file, limits);
  loaded.files = document.files;
  gltf::FileImport(std::move(document), loaded).run();
  merge(scene, std::move(loaded));
}

}  // namespace heddle::scene
