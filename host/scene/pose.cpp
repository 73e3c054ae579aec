// SPDX-License-Identifier: Apache-2.0
// A time -> instances, lights, cameras and bent meshes of the scene where its rigs put them.
#include "scene/pose.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "diagnostics.hpp"
#include "scene/geometry.hpp"

namespace heddle::scene {
namespace {

/// One bent mesh, computed and not yet the scene's.
struct Bent {
  DeformedVertices vertices;
  glm::dvec3 origin{0.0};
  bool has_joints = false;
};

Bent bend(const Scene& scene, const Rig& rig, const Rig::Pose& pose, const Deformation& deformation) {
  Bent bent;
  std::vector<glm::dmat4> joints;
  if (deformation.skin != HEDDLE_NONE) {
    joints = rig.joint_matrices(rig.skins[deformation.skin], pose);
    bent.origin = skin_origin(joints);
    bent.has_joints = true;
  }
  bent.vertices = deform(deformation, pose.weights[deformation.node], joints, bent.origin,
                         scene.meshes[deformation.mesh].indices, rig.file);
  return bent;
}

void add(std::array<glm::dvec3, 2>& bounds, const glm::dvec3& point) {
  bounds = {glm::min(bounds[0], point), glm::max(bounds[1], point)};
}

}  // namespace

bool set_shape(const DeformedVertices& bent, Deformation& deformation, Mesh& mesh) {
  if (mesh.shape == mesh.previous_shape) {
    mesh.previous_vertices.swap(mesh.vertices);
    mesh.vertices = mesh.previous_vertices;  // what does not bend stays: coordinates, colours
  }
  ++mesh.shape;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    HeddleVertex& vertex = mesh.vertices[i];
    const glm::vec4 tangent = bent.tangents.empty() ? glm::vec4(any_tangent(bent.normals[i]), 1.0F) : bent.tangents[i];
    for (int k = 0; k < 3; ++k) {
      vertex.position[k] = bent.positions[i][k];
      vertex.normal[k] = bent.normals[i][k];
      vertex.tangent[k] = tangent[k];
    }
    vertex.tangent[3] = tangent.w;
    mesh.bounds[0] = i == 0 ? bent.positions[i] : glm::min(mesh.bounds[0], bent.positions[i]);
    mesh.bounds[1] = i == 0 ? bent.positions[i] : glm::max(mesh.bounds[1], bent.positions[i]);
  }
  // Joints that mirror turn triangles over; the list's winding has to say front.
  bool is_changed = false;
  deformation.is_turned.resize(mesh.indices.size() / 3, 0);
  for (std::size_t i = 0; i < deformation.is_turned.size(); ++i) {
    const std::uint8_t turned = bent.is_mirrored[mesh.indices[i * 3]];
    if (turned != deformation.is_turned[i]) {
      std::swap(mesh.indices[i * 3 + 1], mesh.indices[i * 3 + 2]);
      deformation.is_turned[i] = turned;
      is_changed = true;
    }
  }
  return is_changed;
}

void place_light(Light& light, const glm::dmat4& scene_from_node) {
  light.position = glm::dvec3(scene_from_node[3]);
  const glm::dmat3 rotation = rotation_part(scene_from_node);
  for (int i = 0; i < 3; ++i) {
    light.record.direction[i] = static_cast<float>(-rotation[2][i]);
    light.record.tangent[i] = static_cast<float>(rotation[0][i]);
  }
}

std::size_t Scene::animation_count() const {
  return std::accumulate(rigs.begin(), rigs.end(), std::size_t{0},
                         [](std::size_t sum, const Rig& rig) { return sum + rig.animations.size(); });
}

void Scene::set_time(double seconds) {
  if (seconds == time) {
    return;
  }
  pose_rigs(seconds);
  time = seconds;
}

void Scene::use_animation(std::uint32_t id, bool loops) {
  const auto choose = [&](std::vector<std::pair<std::uint32_t, bool>> choices) {
    for (std::size_t i = 0; i < rigs.size(); ++i) {
      std::swap(rigs[i].animation, choices[i].first);
      std::swap(rigs[i].loops, choices[i].second);
    }
    return choices;
  };
  std::vector<std::pair<std::uint32_t, bool>> choices;
  std::uint32_t first = 0;
  for (const Rig& rig : rigs) {
    const auto count = static_cast<std::uint32_t>(rig.animations.size());
    const bool is_meant = id != HEDDLE_NONE && id >= first && id - first < count;
    choices.emplace_back(id == HEDDLE_NONE ? HEDDLE_NONE
                         : is_meant        ? id - first
                                           : rig.animation,
                         is_meant ? loops : rig.loops);
    first += count;
  }
  const auto before = choose(std::move(choices));
  try {
    pose_rigs(time);
  } catch (...) {
    choose(before);
    throw;
  }
}

void Scene::pose_rigs(double seconds) {
  // All is computed before anything is changed: what cannot be posed leaves the scene as it was.
  std::vector<Rig::Pose> poses;
  std::vector<std::vector<Bent>> bents(rigs.size());
  for (std::size_t i = 0; i < rigs.size(); ++i) {
    poses.push_back(rigs[i].pose(seconds));
    for (const Deformation& deformation : rigs[i].deformations) {
      bents[i].push_back(bend(*this, rigs[i], poses[i], deformation));
    }
  }
  begin_move();
  bool has_moved = false, is_rewired = false;
  for (std::size_t i = 0; i < rigs.size(); ++i) {
    Rig& rig = rigs[i];
    const std::vector<glm::dmat4>& places = poses[i].scene_from_node;
    for (const Rig::Attached& attached : rig.instances) {
      instances[attached.thing].scene_from_object = places[attached.node];
    }
    for (const Rig::Attached& attached : rig.lights) {
      place_light(lights[attached.thing], places[attached.node]);
    }
    for (const Rig::Attached& attached : rig.cameras) {
      place_camera(cameras[attached.thing].record, places[attached.node]);
    }
    for (std::size_t k = 0; k < rig.deformations.size(); ++k) {
      Deformation& deformation = rig.deformations[k];
      is_rewired |= set_shape(bents[i][k].vertices, deformation, meshes[deformation.mesh]);
      if (bents[i][k].has_joints) {
        glm::dmat4& place = instances[deformation.instance].scene_from_object;
        place = glm::dmat4(1.0);
        place[3] = glm::dvec4(bents[i][k].origin, 1.0);
      }
    }
    has_moved |= !rig.instances.empty() || !rig.deformations.empty();
  }
  motion_revision += has_moved ? 1 : 0;
  content_revision += is_rewired ? 1 : 0;
}

const Scene::Extent& Scene::extent() const {
  std::vector<std::uint32_t> chosen;
  for (const Rig& rig : rigs) {
    chosen.push_back(rig.animation);
  }
  const std::uint64_t motion = rigs.empty() ? motion_revision : 0;
  const bool is_known = extent_ && extent_->content_revision == content_revision &&
                        extent_->motion_revision == motion && extent_->instances == instances.size() &&
                        extent_->animations == chosen;
  if (!is_known) {
    std::vector<double> sizes;
    for (const Instance& instance : instances) {
      const Mesh& mesh = meshes.at(instance.mesh);
      if (mesh.vertices.empty()) continue;
      const glm::dvec3 size = glm::dvec3(mesh.bounds[1]) - glm::dvec3(mesh.bounds[0]);
      sizes.push_back(glm::length(glm::dmat3(instance.scene_from_object) * size));
    }
    const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
    if (!sizes.empty()) std::nth_element(sizes.begin(), middle, sizes.end());
    extent_ = Extent{content_revision,  motion,       instances.size(),
                     std::move(chosen), find_reach(), sizes.empty() ? 0.0 : *middle};
  }
  return *extent_;
}

std::array<glm::dvec3, 2> Scene::find_reach() const {
  constexpr int kMoments = 9;  // of each animation: a walk's strides and a turn's extremes lie within a few per cent
  std::array<glm::dvec3, 2> total = bounds();
  const bool is_empty = std::all_of(instances.begin(), instances.end(),
                                    [&](const Instance& instance) { return meshes[instance.mesh].vertices.empty(); });
  if (rigs.empty() || is_empty) {
    return total;
  }
  // Independent of where things are now: what moves counts at the moments alone.
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  total = {glm::dvec3(kInfinity), glm::dvec3(-kInfinity)};
  std::vector<std::uint8_t> is_moving(instances.size(), 0);
  const auto add_box = [&](const std::array<glm::vec3, 2>& box, const glm::dmat4& place) {
    for (int corner = 0; corner < 8; ++corner) {
      const glm::dvec3 point(box[corner & 1].x, box[(corner >> 1) & 1].y, box[corner >> 2].z);
      add(total, glm::dvec3(place * glm::dvec4(point, 1.0)));
    }
  };
  const auto add_moment = [&](const Rig& rig, double moment) {
    const Rig::Pose pose = rig.pose(moment);
    for (const Rig::Attached& attached : rig.instances) {
      const Mesh& mesh = meshes[instances[attached.thing].mesh];
      if (mesh.shape == 0 && !mesh.vertices.empty()) {
        add_box(mesh.bounds, pose.scene_from_node[attached.node]);
      }
    }
    for (const Deformation& deformation : rig.deformations) {
      const Bent bent = bend(*this, rig, pose, deformation);
      glm::dmat4 place = bent.has_joints ? glm::dmat4(1.0) : pose.scene_from_node[deformation.node];
      if (bent.has_joints) {
        place[3] = glm::dvec4(bent.origin, 1.0);
      }
      for (const glm::vec3& position : bent.vertices.positions) {
        add(total, glm::dvec3(place * glm::dvec4(position, 1.0)));
      }
    }
  };
  for (const Rig& rig : rigs) {
    const double duration = rig.animation < rig.animations.size() ? rig.animations[rig.animation].duration : 0.0;
    for (const Deformation& deformation : rig.deformations) {
      is_moving[deformation.instance] = 1;
    }
    for (const Rig::Attached& attached : rig.instances) {
      is_moving[attached.thing] = 1;
    }
    for (int moment = 0; moment < (duration > 0 ? kMoments : 1); ++moment) {
      try {
        add_moment(rig, duration * moment / (kMoments - 1));
      } catch (const Error&) {
        // What cannot be posed at that moment cannot be seen then either.
      }
    }
  }
  for (std::size_t i = 0; i < instances.size(); ++i) {
    const Mesh& mesh = meshes[instances[i].mesh];
    if (is_moving[i] == 0 && !mesh.vertices.empty()) {
      add_box(mesh.bounds, instances[i].scene_from_object);
    }
  }
  if (total[0].x > total[1].x) {
    total = bounds();
  }
  return total;
}

}  // namespace heddle::scene
