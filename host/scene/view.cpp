// SPDX-License-Identifier: Apache-2.0
// Camera, frame shape and origin -> the view record of the shaders, composed in float64 and rounded once.
#include <algorithm>
#include <cmath>

#include "scene/scene.hpp"

namespace heddle::scene {
namespace {

struct Projection {
  glm::dmat4 clip_from_view{0.0};
  glm::dmat4 view_from_clip{0.0};
  glm::dvec2 half_size{1.0};
  double near_distance = kDefaultNear;
};

/// clip = (x / half_size.x, -y / half_size.y, near, d) for perspective, d = -z; the y axis of Vulkan's clip space
/// points down. Both directions are written out: a numeric inverse would lose digits where near is small.
Projection make_projection(const heddle_camera& camera, double frame_aspect) {
  Projection projection;
  const double aspect = camera.aspect > 0 ? camera.aspect : frame_aspect;
  const double near = camera.near_distance > 0 ? camera.near_distance : kDefaultNear;
  const bool is_orthographic = camera.is_orthographic != 0;
  const double half_height = is_orthographic ? camera.vertical_angle : std::tan(0.5 * camera.vertical_angle);
  const glm::dvec2 half(half_height * aspect, half_height);
  glm::dmat4& to = projection.clip_from_view;
  glm::dmat4& from = projection.view_from_clip;
  to[0][0] = 1.0 / half.x;
  to[1][1] = -1.0 / half.y;
  from[0][0] = half.x;
  from[1][1] = -half.y;
  if (is_orthographic) {
    const double far = camera.far_distance > near ? camera.far_distance : std::max(kDefaultFar, near * 2);
    // depth = (far + z) / (far - near): 1 at near, 0 at far.
    to[2][2] = 1.0 / (far - near);
    to[3][2] = far / (far - near);
    to[3][3] = 1.0;
    from[2][2] = far - near;
    from[3][2] = -far;
    from[3][3] = 1.0;
  } else {
    to[3][2] = near;          // clip.z
    to[2][3] = -1.0;          // clip.w
    from[3][2] = -1.0;        // z = -clip.w
    from[2][3] = 1.0 / near;  // w = clip.z / near
  }
  projection.half_size = half;
  projection.near_distance = near;
  return projection;
}

/// Rotation of a camera as a matrix; a quaternion of length 0 is no rotation.
glm::dmat3 rotation_of(const heddle_camera& camera) {
  const double* q = camera.rotation;
  const glm::dquat quaternion(q[3], q[0], q[1], q[2]);
  const double length = glm::length(quaternion);
  return length > 0 ? glm::mat3_cast(quaternion / length) : glm::dmat3(1.0);
}

struct Rigid {
  glm::dmat4 view_from_rel{1.0}, rel_from_view{1.0};
};

/// The camera's place relative to the origin is the only difference of large numbers, and it is made first, in float64.
Rigid make_rigid(const heddle_camera& camera, const glm::dvec3& origin) {
  const glm::dmat3 rotation = rotation_of(camera);
  const glm::dvec3 position_rel = glm::dvec3(camera.position[0], camera.position[1], camera.position[2]) - origin;
  Rigid rigid;
  rigid.rel_from_view = glm::dmat4(rotation);
  rigid.rel_from_view[3] = glm::dvec4(position_rel, 1.0);
  rigid.view_from_rel = glm::dmat4(glm::transpose(rotation));
  rigid.view_from_rel[3] = glm::dvec4(-(glm::transpose(rotation) * position_rel), 1.0);
  return rigid;
}

void store(const glm::dmat4& matrix, float (&out)[16]) {
  for (int i = 0; i < 16; ++i) {
    // Adding 0 turns -0 into 0, so that equal matrices are equal in bytes.
    out[i] = static_cast<float>(matrix[i / 4][i % 4]) + 0.0F;
  }
}

}  // namespace

HeddleView make_view(const heddle_camera& camera, std::uint32_t width, std::uint32_t height, const glm::dvec3& origin,
                     const heddle_camera* previous) {
  const double frame_aspect = static_cast<double>(std::max(width, 1U)) / static_cast<double>(std::max(height, 1U));
  const Projection projection = make_projection(camera, frame_aspect);
  const Rigid rigid = make_rigid(camera, origin);
  HeddleView view{};
  store(projection.clip_from_view * rigid.view_from_rel, view.clip_from_rel);
  store(rigid.rel_from_view * projection.view_from_clip, view.rel_from_clip);
  store(rigid.view_from_rel, view.view_from_rel);
  store(rigid.rel_from_view, view.rel_from_view);
  const heddle_camera& before = previous != nullptr ? *previous : camera;
  store(make_projection(before, frame_aspect).clip_from_view * make_rigid(before, origin).view_from_rel,
        view.previous_clip_from_rel);
  view.half_size[0] = static_cast<float>(projection.half_size.x);
  view.half_size[1] = static_cast<float>(projection.half_size.y);
  view.near_distance = static_cast<float>(projection.near_distance);
  view.is_orthographic = camera.is_orthographic != 0 ? 1 : 0;
  view.extent[0] = width;
  view.extent[1] = height;
  return view;
}

}  // namespace heddle::scene
