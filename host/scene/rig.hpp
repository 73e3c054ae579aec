// SPDX-License-Identifier: Apache-2.0
// What moves in a loaded file: nodes, animations, skins and morph targets. A rig poses the parts of a scene that it
// made at a time. Knows neither glTF nor a device.
#pragma once

#include <heddle/heddle.h>

#include <glm/glm.hpp>
#include <glm/gtc/quaternion.hpp>

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace heddle::scene {

/// Keys of one property of one node.
struct Channel {
  enum class Path : std::uint8_t { kTranslation, kRotation, kScale, kWeights };
  enum class Interpolation : std::uint8_t { kLinear, kStep, kCubicSpline };
  std::uint32_t node = 0;
  Path path = Path::kTranslation;
  Interpolation interpolation = Interpolation::kLinear;
  std::uint32_t width = 3;     // numbers a key: 3, 4 (rotation: x y z w) or one a morph target
  std::vector<double> times;   // seconds, never decreasing, at least one
  std::vector<double> values;  // `width` a key; cubic spline: in-tangent, value and out-tangent of each key
};

/// The property at a time, `width` numbers; before the first key and after the last it is theirs. Rotations are turned
/// by slerp the shorter way, and come out with length 1. Cubic splines are Hermite (glTF 2.0, appendix C.5).
void sample(const Channel& channel, double time, std::span<double> out);

struct Animation {
  std::string name;
  std::vector<Channel> channels;
  double duration = 0;  // last key of all channels
};

struct RigNode {
  std::string name;
  std::uint32_t parent = HEDDLE_NONE;
  bool has_matrix = false;  // then `matrix` counts, and no channel moves the node itself
  glm::dmat4 matrix{1.0};
  glm::dvec3 translation{0.0}, scale{1.0};
  glm::dquat rotation{1.0, 0.0, 0.0, 0.0};
  std::vector<double> weights;  // of morph targets, at rest
};

struct Skin {
  std::vector<std::uint32_t> joints;           // nodes
  std::vector<glm::dmat4> joint_from_binding;  // glTF's inverse bind matrices
};

/// What one morph target adds at weight 1; empty: nothing.
struct MorphTarget {
  std::vector<glm::vec3> positions, normals, tangents;
};

/// Joints of every vertex, with their weights.
struct Influence {
  std::vector<std::uint32_t> joints;  // `per_vertex` a vertex
  std::vector<float> weights;         // need not sum to 1
  std::size_t per_vertex = 0;         // 0: no joints
};

/// A mesh at rest, and what bends it: first morph targets, then joints.
struct Deformation {
  std::uint32_t mesh = 0;      // of the scene
  std::uint32_t instance = 0;  // of the scene: the only one that shows the mesh
  std::uint32_t node = 0;      // has the weights of the targets
  std::uint32_t skin = HEDDLE_NONE;
  std::string name;                                     // for messages
  bool has_flat_normals = false, has_tangents = false;  // has_tangents: given, not made
  std::vector<glm::vec3> positions, normals;            // of every vertex of the mesh
  std::vector<glm::vec4> tangents;                      // empty: any direction across the normal will do
  std::vector<MorphTarget> targets;
  Influence influence;
  std::vector<std::uint8_t> is_turned;  // by triangle: joints mirror it, and the mesh's indices say so
};

/// Vertices of a deformed mesh: unit normals, unit tangents with handedness.
struct DeformedVertices {
  std::vector<glm::vec3> positions, normals;
  std::vector<glm::vec4> tangents;  // as many as Deformation's
  std::vector<std::uint8_t> is_mirrored;
};

class Rig {
 public:
  /// Something of the scene that is where a node is.
  struct Attached {
    std::uint32_t node = 0, thing = 0;
  };
  std::string file;  // for messages
  std::vector<RigNode> nodes;
  std::vector<std::uint32_t> order;  // all nodes, parents first
  std::vector<Skin> skins;
  std::vector<Animation> animations;
  std::vector<Deformation> deformations;
  std::vector<Attached> instances, lights, cameras;  // what animations move as it is
  std::uint32_t animation = 0;                       // in use; HEDDLE_NONE: the rest pose
  bool loops = false;                                // after its end the animation begins again; else it holds

  struct Pose {
    std::vector<glm::dmat4> scene_from_node;
    std::vector<std::vector<double>> weights;  // of morph targets, by node
  };
  /// All nodes at a time. Throws Error(HEDDLE_BAD_INPUT) if a place is not finite.
  [[nodiscard]] Pose pose(double time) const;
  /// Places of a skin's joints, from the bind pose.
  [[nodiscard]] std::vector<glm::dmat4> joint_matrices(const Skin& skin, const Pose& pose) const;
  /// By node: whether any animation moves it, or changes its weights.
  [[nodiscard]] std::vector<std::uint8_t> moving_nodes() const;
  [[nodiscard]] std::vector<std::uint8_t> morphing_nodes() const;
};

/// Where the positions of a skinned mesh are relative to: whole metres near its first joint, so that large places stay
/// in float64.
glm::dvec3 skin_origin(std::span<const glm::dmat4> joints);

/// Bends in float64 and rounds once: a position is off by half a step of float32 at its distance from `origin`. Without
/// joints the result stays in object space and `origin` must be zero. Throws Error(HEDDLE_BAD_INPUT) with `file` if a
/// vertex leaves float32, or names a joint that is none.
DeformedVertices deform(const Deformation& rest, std::span<const double> weights, std::span<const glm::dmat4> joints,
                        const glm::dvec3& origin, std::span<const std::uint32_t> indices, const std::string& file);

/// Axes of a node made orthonormal and right-handed; looking along -Z stays, scale and shear go.
glm::dmat3 rotation_part(const glm::dmat4& matrix);
/// Puts the eye of a camera where a node is.
void place_camera(heddle_camera& camera, const glm::dmat4& scene_from_node);

}  // namespace heddle::scene
