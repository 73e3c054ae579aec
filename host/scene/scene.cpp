// SPDX-License-Identifier: Apache-2.0
// Questions to a scene: bounds, the camera that renders, features, a description.
#include "scene/scene.hpp"
#include "json.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>

namespace heddle::scene {
namespace {

// The made-up camera: from the front (+Z), a little from the right and from above, with the angle of a 50 mm lens.
constexpr double kDefaultAzimuth = 0.5;    // radians
constexpr double kDefaultElevation = 0.3;  // radians
constexpr double kDefaultAngle = 0.7;      // radians, vertical

bool is_textured(const Material& material) {
  return std::any_of(material.textures.begin(), material.textures.end(),
                     [](std::uint32_t texture) { return texture != HEDDLE_NONE; });
}

bool is_emissive(const Material& material) {
  const float* emissive = material.record.emissive;
  return emissive[0] > 0 || emissive[1] > 0 || emissive[2] > 0;
}

heddle_camera framing_camera(const std::array<glm::dvec3, 2>& bounds, double aspect) {
  const glm::dvec3 center = 0.5 * (bounds[0] + bounds[1]);
  const double half_diagonal = 0.5 * glm::distance(bounds[0], bounds[1]);
  const double radius = half_diagonal > 0 ? half_diagonal : 1.0;
  const double half_vertical = 0.5 * kDefaultAngle;
  const double half_horizontal = std::atan(std::tan(half_vertical) * aspect);
  const double distance = radius / std::sin(std::min(half_vertical, half_horizontal));
  const glm::dvec3 towards_camera(std::sin(kDefaultAzimuth) * std::cos(kDefaultElevation), std::sin(kDefaultElevation),
                                  std::cos(kDefaultAzimuth) * std::cos(kDefaultElevation));
  const glm::dquat rotation =
      glm::angleAxis(kDefaultAzimuth, glm::dvec3(0, 1, 0)) * glm::angleAxis(-kDefaultElevation, glm::dvec3(1, 0, 0));
  heddle_camera camera{};
  camera.struct_size = sizeof camera;
  const glm::dvec3 position = center + towards_camera * distance;
  for (int i = 0; i < 3; ++i) {
    camera.position[i] = position[i];
  }
  camera.rotation[0] = rotation.x;
  camera.rotation[1] = rotation.y;
  camera.rotation[2] = rotation.z;
  camera.rotation[3] = rotation.w;
  camera.vertical_angle = kDefaultAngle;
  // Nothing of the scene is nearer than this; a hundredth of it would waste depth's digits on empty space.
  camera.near_distance = 0.5 * (distance - radius);
  return camera;
}

Json json_of(const glm::dvec3& vector) {
  return {vector.x, vector.y, vector.z};
}

/// What was written, as it is written: words of choices, true and false.
Json describe(const Component& component) {
  Json properties = Json::object();
  std::size_t first = 0;
  for (std::size_t i = 0; i < component.type->properties.size(); ++i) {
    const ComponentProperty& property = component.type->properties[i];
    const double value = component.values[first];
    if ((component.written >> i & 1U) != 0) {
      Json& json = properties[property.name];
      if (property.type == PropertyType::kBool) {
        json = value != 0;
      } else if (property.type == PropertyType::kInt) {
        json = static_cast<std::int64_t>(value);
      } else if (property.type == PropertyType::kChoice) {
        json = property.choices.at(static_cast<std::size_t>(value));
      } else if (property.count() == 3) {
        json = {value, component.values[first + 1], component.values[first + 2]};
      } else {
        json = value;
      }
    }
    first += property.count();
  }
  return {{"name", component.type->name},
          {"on", to_word(component.owner)},
          {"id", component.id},
          {"properties", properties}};
}

}  // namespace

std::uint64_t Scene::new_revision() {
  // Two to the 32 changes of one scene fit between two revisions handed out here.
  static std::atomic<std::uint64_t> last{0};
  return last += std::uint64_t{1} << 32;
}

bool Scene::settle() {
  bool has_moved = false;
  for (Instance& instance : instances) {
    has_moved |= instance.previous_scene_from_object != instance.scene_from_object;
    instance.previous_scene_from_object = instance.scene_from_object;
  }
  for (Mesh& mesh : meshes) {
    has_moved |= mesh.previous_shape != mesh.shape;
    mesh.previous_shape = mesh.shape;
  }
  motion_revision += has_moved ? 1 : 0;
  return has_moved;
}

void Scene::begin_frame(const void* graph) {
  if (std::find(seen_by.begin(), seen_by.end(), graph) != seen_by.end()) begin_move();
}

void Scene::end_frame(const void* graph) {
  seen_by.push_back(graph);
}

void Scene::begin_move() {
  if (seen_by.empty()) return;
  settle();
  seen_by.clear();
}

std::array<glm::dvec3, 2> Scene::bounds() const {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  std::array<glm::dvec3, 2> bounds = {glm::dvec3(kInfinity), glm::dvec3(-kInfinity)};
  for (const Instance& instance : instances) {
    const Mesh& mesh = meshes.at(instance.mesh);
    if (mesh.vertices.empty()) {
      continue;
    }
    // Interval arithmetic on the box: each column adds its smaller and larger end.
    const glm::dmat4& matrix = instance.scene_from_object;
    glm::dvec3 low(matrix[3]), high(matrix[3]);
    for (int axis = 0; axis < 3; ++axis) {
      const glm::dvec3 a = glm::dvec3(matrix[axis]) * static_cast<double>(mesh.bounds[0][axis]);
      const glm::dvec3 b = glm::dvec3(matrix[axis]) * static_cast<double>(mesh.bounds[1][axis]);
      low += glm::min(a, b);
      high += glm::max(a, b);
    }
    bounds = {glm::min(bounds[0], low), glm::max(bounds[1], high)};
  }
  if (bounds[0].x > bounds[1].x) {
    return {glm::dvec3(0.0), glm::dvec3(0.0)};
  }
  return bounds;
}

heddle_camera Scene::active_camera(std::uint32_t width, std::uint32_t height) const {
  const double aspect = static_cast<double>(std::max(width, 1U)) / static_cast<double>(std::max(height, 1U));
  heddle_camera active = camera < cameras.size() ? cameras[camera].record : framing_camera(reach(), aspect);
  active.struct_size = sizeof active;
  active.aspect = active.aspect > 0 ? active.aspect : aspect;
  // What the camera does not say follows from the scene's size: a scene of a centimetre is not cut away. Reversed float
  // depth has the same relative precision however near the plane is.
  const std::array<glm::dvec3, 2>& box = reach();
  const double diagonal = glm::distance(box[0], box[1]);
  if (!(active.near_distance > 0)) {
    active.near_distance = diagonal > 0 ? std::min(kDefaultNear, diagonal * kNearOfDiagonal) : kDefaultNear;
  }
  if (active.is_orthographic != 0 && !(active.far_distance > 0)) {
    const glm::dvec3 eye(active.position[0], active.position[1], active.position[2]);
    const double farthest = glm::length(glm::max(glm::abs(box[0] - eye), glm::abs(box[1] - eye)));
    // Twice: techniques may make surfaces that stand out of the box.
    active.far_distance = diagonal > 0 ? std::max(2.0 * farthest, 2.0 * active.near_distance) : kDefaultFar;
  }
  return active;
}

std::vector<std::string> Scene::features() const {
  std::vector<std::uint8_t> is_shown(materials.size(), 0);
  bool has_surfaces = false;
  for (const Instance& instance : instances) {
    const Mesh& mesh = meshes.at(instance.mesh);
    if (!mesh.indices.empty()) {
      has_surfaces = true;
      is_shown.at(mesh.material) = 1;
    }
  }
  bool masked = false, blended = false, emissive = false, double_sided = false, textures_used = false;
  for (std::size_t i = 0; i < materials.size(); ++i) {
    if (is_shown[i] != 0) {
      const Material& material = materials[i];
      masked |= material.record.alpha_mode == HEDDLE_ALPHA_MASK;
      blended |= is_blended(material.record);
      emissive |= is_emissive(material);
      double_sided |= (material.record.flags & HEDDLE_MATERIAL_DOUBLE_SIDED) != 0;
      textures_used |= is_textured(material);
    }
  }
  std::vector<std::string> names;
  const auto add = [&](bool is_there, const char* name) {
    if (is_there) {
      names.emplace_back(name);
    }
  };
  add(has_surfaces, "surfaces");
  add(!lights.empty(), "lights");
  add(masked, "masked");
  add(blended, "blended");
  add(emissive, "emissive");
  add(double_sided, "double_sided");
  add(textures_used, "textures");
  add(environment.has_value(), "environment");
  for (std::string& name : components.names()) {
    names.push_back(std::move(name));
  }
  return names;
}

std::string Scene::describe_json() const {
  std::uint64_t triangles = 0, stored_triangles = 0, vertices = 0, texture_bytes = 0;
  for (const Mesh& mesh : meshes) {
    stored_triangles += mesh.indices.size() / 3;
    vertices += mesh.vertices.size();
  }
  for (const Instance& instance : instances) {
    triangles += meshes.at(instance.mesh).indices.size() / 3;
  }
  for (const Texture& texture : textures) {
    texture_bytes += texture.rgba.size();
  }
  const std::array<glm::dvec3, 2> box = bounds();
  Json json;
  json["counts"] = {{"textures", textures.size()}, {"materials", materials.size()},
                    {"meshes", meshes.size()},     {"instances", instances.size()},
                    {"lights", lights.size()},     {"cameras", cameras.size()},
                    {"triangles", triangles},      {"stored_triangles", stored_triangles},
                    {"vertices", vertices},        {"texture_bytes", texture_bytes}};
  json["bounds"] = {json_of(box[0]), json_of(box[1])};
  json["camera"] = camera < cameras.size() ? Json(camera) : Json(nullptr);
  json["cameras"] = names_of(cameras);
  json["lights"] = names_of(lights);
  json["materials"] = names_of(materials);
  json["animations"] = Json::array();
  for (const Rig& rig : rigs) {
    for (std::size_t i = 0; i < rig.animations.size(); ++i) {
      json["animations"].push_back(
          {{"name", rig.animations[i].name}, {"duration", rig.animations[i].duration}, {"in_use", rig.animation == i}});
    }
  }
  json["components"] = Json::array();
  for (const Component& component : components.all()) {
    json["components"].push_back(describe(component));
  }
  json["time"] = time;
  json["features"] = features();
  json["warnings"] = warnings;
  json["ignored_extensions"] = ignored_extensions;
  // Names come from files: what is no UTF-8 in them is replaced, not an error.
  return write_json(json, 2);
}

}  // namespace heddle::scene
