// SPDX-License-Identifier: Apache-2.0
// Keys -> properties -> places of nodes -> bent vertices, all in float64.
#include "scene/rig.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "diagnostics.hpp"
#include "scene/geometry.hpp"

namespace heddle::scene {
namespace {

glm::dquat quaternion(const double* xyzw) {
  return {xyzw[3], xyzw[0], xyzw[1], xyzw[2]};
}

glm::dquat unit_or_identity(const glm::dquat& q) {
  const double length = glm::length(q);
  return length > 0 && std::isfinite(length) ? q / length : glm::dquat(1, 0, 0, 0);
}

/// The angle comes from sums and differences, not from an arc cosine: that loses half of the digits where keys are
/// close.
glm::dquat slerp(const glm::dquat& from, const glm::dquat& towards, double share) {
  const glm::dquat to = glm::dot(from, towards) < 0 ? -towards : towards;
  const double angle = 2.0 * std::atan2(glm::length(to - from), glm::length(to + from));
  const double sine = std::sin(angle);
  if (sine == 0) {
    return from;
  }
  return unit_or_identity(from * (std::sin((1 - share) * angle) / sine) + to * (std::sin(share * angle) / sine));
}

void store(const glm::dquat& q, std::span<double> out) {
  out[0] = q.x;
  out[1] = q.y;
  out[2] = q.z;
  out[3] = q.w;
}

glm::dmat4 local_matrix(const RigNode& node, const glm::dvec3& translation, const glm::dquat& rotation,
                        const glm::dvec3& scale) {
  if (node.has_matrix) {
    return node.matrix;
  }
  glm::dmat4 matrix = glm::mat4_cast(unit_or_identity(rotation));
  for (int i = 0; i < 3; ++i) {
    matrix[i] *= scale[i];
  }
  matrix[3] = glm::dvec4(translation, 1.0);
  return matrix;
}

[[noreturn]] void fail(const std::string& file, std::string message) {
  throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError, {file, 0, 0}, std::move(message), "", "", ""});
}

bool is_finite(const glm::dmat4& matrix) {
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) {
      if (!std::isfinite(matrix[column][row])) {
        return false;
      }
    }
  }
  return true;
}

/// rest + sum of weighted differences.
template <typename Vectors>
glm::dvec3 morphed(const glm::dvec3& rest, const Deformation& mesh, std::span<const double> weights, Vectors vectors,
                   std::size_t vertex) {
  glm::dvec3 sum = rest;
  for (std::size_t i = 0; i < std::min(weights.size(), mesh.targets.size()); ++i) {
    const std::vector<glm::vec3>& differences = mesh.targets[i].*vectors;
    if (weights[i] != 0 && !differences.empty()) {
      sum += weights[i] * glm::dvec3(differences[vertex]);
    }
  }
  return sum;
}

glm::dmat4 blended_joints(const Deformation& mesh, std::span<const glm::dmat4> joints, std::size_t vertex,
                          const std::string& file) {
  glm::dmat4 blended(0.0);
  double sum = 0;
  for (std::size_t i = 0; i < mesh.influence.per_vertex; ++i) {
    const double weight = mesh.influence.weights[vertex * mesh.influence.per_vertex + i];
    const std::uint32_t joint = mesh.influence.joints[vertex * mesh.influence.per_vertex + i];
    if (weight == 0) {
      continue;
    }
    if (joint >= joints.size()) {
      throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                               {file, 0, 0},
                                               fmt::format("{}: a vertex names a joint that does not exist", mesh.name),
                                               fmt::format("{}", joint),
                                               fmt::format("less than {}", joints.size()),
                                               ""});
    }
    blended += joints[joint] * weight;
    sum += weight;
  }
  // Weights of 8 bits do not sum to 1 exactly; a vertex without any follows the first joint.
  return sum > 0 ? blended / sum : joints.front();
}

glm::dvec3 unit_or(const glm::dvec3& vector, const glm::dvec3& otherwise) {
  const double length = glm::length(vector);
  return length > 0 && std::isfinite(length) ? vector / length : otherwise;
}

}  // namespace

void sample(const Channel& channel, double time, std::span<double> out) {
  const std::size_t width = channel.width, keys = channel.times.size();
  const bool is_cubic = channel.interpolation == Channel::Interpolation::kCubicSpline;
  const std::size_t stride = is_cubic ? 3 * width : width;
  // part: 0 in-tangent, 1 value, 2 out-tangent.
  const auto key = [&](std::size_t index, std::size_t part) {
    return channel.values.data() + index * stride + (is_cubic ? part * width : 0);
  };
  const auto after = std::upper_bound(channel.times.begin(), channel.times.end(), time);
  const auto next = static_cast<std::size_t>(after - channel.times.begin());
  const bool is_rotation = channel.path == Channel::Path::kRotation;
  if (next == 0 || next == keys || channel.interpolation == Channel::Interpolation::kStep) {
    std::copy_n(key(next == 0 ? 0 : next - 1, 1), width, out.begin());
  } else {
    const double step = channel.times[next] - channel.times[next - 1];  // above 0: `time` lies in it
    const double t = (time - channel.times[next - 1]) / step;
    if (is_cubic) {
      const double t2 = t * t, t3 = t2 * t;
      for (std::size_t i = 0; i < width; ++i) {
        out[i] = (2 * t3 - 3 * t2 + 1) * key(next - 1, 1)[i] + step * (t3 - 2 * t2 + t) * key(next - 1, 2)[i] +
                 (3 * t2 - 2 * t3) * key(next, 1)[i] + step * (t3 - t2) * key(next, 0)[i];
      }
    } else if (is_rotation) {
      store(slerp(unit_or_identity(quaternion(key(next - 1, 1))), unit_or_identity(quaternion(key(next, 1))), t), out);
    } else {
      for (std::size_t i = 0; i < width; ++i) {
        out[i] = (1 - t) * key(next - 1, 1)[i] + t * key(next, 1)[i];
      }
    }
  }
  if (is_rotation) {
    store(unit_or_identity(quaternion(out.data())), out);
  }
}

Rig::Pose Rig::pose(double time) const {
  struct Local {
    glm::dvec3 translation, scale;
    glm::dquat rotation;
  };
  std::vector<Local> locals;
  Pose result;
  locals.reserve(nodes.size());
  result.weights.reserve(nodes.size());
  for (const RigNode& node : nodes) {
    locals.push_back({node.translation, node.scale, node.rotation});
    result.weights.push_back(node.weights);
  }
  if (animation < animations.size()) {
    const Animation& chosen = animations[animation];
    const double duration = chosen.duration;
    const double local_time =
        loops && duration > 0 && (time < 0 || time > duration) ? time - duration * std::floor(time / duration) : time;
    for (const Channel& channel : chosen.channels) {
      Local& local = locals[channel.node];
      std::array<double, 4> value{};
      switch (channel.path) {
        case Channel::Path::kTranslation:
          sample(channel, local_time, value);
          local.translation = {value[0], value[1], value[2]};
          break;
        case Channel::Path::kScale:
          sample(channel, local_time, value);
          local.scale = {value[0], value[1], value[2]};
          break;
        case Channel::Path::kRotation:
          sample(channel, local_time, value);
          local.rotation = quaternion(value.data());
          break;
        case Channel::Path::kWeights:
          result.weights[channel.node].resize(channel.width);
          sample(channel, local_time, result.weights[channel.node]);
          break;
      }
    }
  }
  result.scene_from_node.resize(nodes.size());
  for (const std::uint32_t index : order) {
    const RigNode& node = nodes[index];
    const Local& local = locals[index];
    glm::dmat4& matrix = result.scene_from_node[index];
    matrix = local_matrix(node, local.translation, local.rotation, local.scale);
    if (node.parent != HEDDLE_NONE) {
      matrix = result.scene_from_node[node.parent] * matrix;
    }
    if (!is_finite(matrix)) {
      fail(file, fmt::format("node {} '{}': its place in the scene is not finite", index, node.name));
    }
  }
  return result;
}

std::vector<glm::dmat4> Rig::joint_matrices(const Skin& skin, const Pose& pose) const {
  std::vector<glm::dmat4> matrices(skin.joints.size());
  for (std::size_t i = 0; i < matrices.size(); ++i) {
    matrices[i] = pose.scene_from_node[skin.joints[i]] * skin.joint_from_binding[i];
    if (!is_finite(matrices[i])) {
      fail(file, fmt::format("joint {} (node {} '{}'): its place is not finite", i, skin.joints[i],
                             nodes[skin.joints[i]].name));
    }
  }
  return matrices;
}

std::vector<std::uint8_t> Rig::moving_nodes() const {
  std::vector<std::uint8_t> is_moving(nodes.size(), 0);
  for (const Animation& each : animations) {
    for (const Channel& channel : each.channels) {
      if (channel.path != Channel::Path::kWeights) {
        is_moving[channel.node] = 1;
      }
    }
  }
  for (const std::uint32_t index : order) {
    if (const std::uint32_t parent = nodes[index].parent; parent != HEDDLE_NONE && is_moving[parent] != 0) {
      is_moving[index] = 1;
    }
  }
  return is_moving;
}

std::vector<std::uint8_t> Rig::morphing_nodes() const {
  std::vector<std::uint8_t> is_morphing(nodes.size(), 0);
  for (const Animation& each : animations) {
    for (const Channel& channel : each.channels) {
      if (channel.path == Channel::Path::kWeights) {
        is_morphing[channel.node] = 1;
      }
    }
  }
  return is_morphing;
}

glm::dvec3 skin_origin(std::span<const glm::dmat4> joints) {
  return joints.empty() ? glm::dvec3(0.0) : glm::round(glm::dvec3(joints.front()[3]));
}

DeformedVertices deform(const Deformation& rest, std::span<const double> weights, std::span<const glm::dmat4> joints,
                        const glm::dvec3& origin, std::span<const std::uint32_t> indices, const std::string& file) {
  const std::size_t count = rest.positions.size();
  const bool is_skinned = rest.influence.per_vertex > 0 && !joints.empty();
  DeformedVertices bent;
  bent.positions.resize(count);
  bent.normals.resize(count);
  bent.tangents.resize(rest.tangents.size());
  bent.is_mirrored.assign(count, 0);
  std::vector<glm::dvec3> exact(rest.has_flat_normals ? count : 0);

  for (std::size_t vertex = 0; vertex < count; ++vertex) {
    glm::dvec3 position = morphed(rest.positions[vertex], rest, weights, &MorphTarget::positions, vertex);
    // Directions of rest: a sum of differences may be zero, and says nothing then.
    glm::dvec3 normal = unit_or(morphed(rest.normals[vertex], rest, weights, &MorphTarget::normals, vertex),
                                glm::dvec3(rest.normals[vertex]));
    glm::dvec3 tangent(0.0);
    float turn = 1;
    if (!rest.tangents.empty()) {
      const glm::dvec3 own(rest.tangents[vertex]);
      turn = rest.tangents[vertex].w;
      tangent = unit_or(morphed(own, rest, weights, &MorphTarget::tangents, vertex), own);
    }
    if (is_skinned) {
      const glm::dmat4 blended = blended_joints(rest, joints, vertex, file);
      const glm::dmat3 linear(blended);
      position = glm::dvec3(blended * glm::dvec4(position, 1.0)) - origin;
      normal = unit_or(normal_matrix(linear) * normal, normal);
      tangent = unit_or(linear * tangent, tangent);
      bent.is_mirrored[vertex] = glm::determinant(linear) < 0 ? 1 : 0;
      turn = bent.is_mirrored[vertex] != 0 ? -turn : turn;
    }
    bent.positions[vertex] = glm::vec3(position);
    const glm::vec3& rounded = bent.positions[vertex];
    if (!std::isfinite(rounded.x) || !std::isfinite(rounded.y) || !std::isfinite(rounded.z)) {
      fail(file, fmt::format("{}: vertex {} is moved beyond float32", rest.name, vertex));
    }
    if (rest.has_flat_normals) {
      exact[vertex] = position;
    }
    bent.normals[vertex] = glm::vec3(normal);
    if (!rest.tangents.empty()) {
      bent.tangents[vertex] = glm::vec4(glm::vec3(tangent), turn);
    }
  }

  // Flat normals belong to the bent triangles, whose corners are vertices of their own.
  for (std::size_t i = 0; rest.has_flat_normals && i + 2 < indices.size(); i += 3) {
    const std::uint32_t a = indices[i], b = indices[i + 1], c = indices[i + 2];
    const bool swaps = (bent.is_mirrored[a] != 0) != (i / 3 < rest.is_turned.size() && rest.is_turned[i / 3] != 0);
    const glm::dvec3 cross = glm::cross(exact[b] - exact[a], exact[c] - exact[a]);
    const glm::vec3 normal(unit_or(swaps ? -cross : cross, glm::dvec3(0, 1, 0)));
    bent.normals[a] = bent.normals[b] = bent.normals[c] = normal;
  }
  // Tangents that were made lie across the normal; given ones are the author's.
  for (std::size_t vertex = 0; !rest.has_tangents && vertex < bent.tangents.size(); ++vertex) {
    const glm::dvec3 normal = bent.normals[vertex], tangent(bent.tangents[vertex]);
    const glm::dvec3 across = unit_or(tangent - normal * glm::dot(normal, tangent), any_tangent(bent.normals[vertex]));
    bent.tangents[vertex] = glm::vec4(glm::vec3(across), bent.tangents[vertex].w);
  }
  return bent;
}

glm::dmat3 rotation_part(const glm::dmat4& matrix) {
  const glm::dvec3 z = unit_or(glm::dvec3(matrix[2]), {0, 0, 1});
  const glm::dvec3 helper = std::abs(z.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0);
  const glm::dvec3 x = unit_or(glm::cross(glm::dvec3(matrix[1]), z), unit_or(glm::cross(helper, z), {1, 0, 0}));
  return {x, glm::cross(z, x), z};
}

void place_camera(heddle_camera& camera, const glm::dmat4& scene_from_node) {
  const glm::dquat rotation = glm::normalize(glm::quat_cast(rotation_part(scene_from_node)));
  for (int i = 0; i < 3; ++i) {
    camera.position[i] = scene_from_node[3][i];
  }
  store(rotation, camera.rotation);
}

}  // namespace heddle::scene
