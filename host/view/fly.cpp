// SPDX-License-Identifier: Apache-2.0
#include "view/fly.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace heddle::view {

namespace {

// Straight up and down have no horizon: a hair's breadth is kept from them, far below a pixel.
constexpr double kSteepest = std::numbers::pi / 2 - 1e-6;

struct Quaternion {
  double x, y, z, w;
};

Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y, a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
          a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w, a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z};
}

void set(heddle_camera& camera, Quaternion q) {
  // Thousands of small turns leave the unit sphere by one rounding each.
  const double length = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  camera.rotation[0] = q.x / length;
  camera.rotation[1] = q.y / length;
  camera.rotation[2] = q.z / length;
  camera.rotation[3] = q.w / length;
}

Quaternion rotation_of(const heddle_camera& camera) {
  return {camera.rotation[0], camera.rotation[1], camera.rotation[2], camera.rotation[3]};
}

double pitch_of(const Axes& axes) {
  return std::atan2(axes.forward[1], std::hypot(axes.forward[0], axes.forward[2]));
}

}  // namespace

Axes axes_of(const heddle_camera& camera) {
  const auto [x, y, z, w] = rotation_of(camera);
  return {{1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)},
          {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)},
          {-2 * (x * z + y * w), -2 * (y * z - x * w), -(1 - 2 * (x * x + y * y))}};
}

void look(heddle_camera& camera, double left, double up) {
  // About the horizontal axis across the view, which a roll leaves where it is.
  const Axes axes = axes_of(camera);
  const double pitch = pitch_of(axes);
  const double turn = std::clamp(pitch + up, std::min(pitch, -kSteepest), std::max(pitch, kSteepest)) - pitch;
  const double run = std::hypot(axes.forward[0], axes.forward[2]);
  double across_x = axes.right[0], across_z = axes.right[2];
  if (run > 1e-9) {
    across_x = -axes.forward[2] / run;
    across_z = axes.forward[0] / run;
  }
  const double s = std::sin(turn / 2);
  const Quaternion pitched = product({across_x * s, 0, across_z * s, std::cos(turn / 2)}, rotation_of(camera));
  set(camera, product({0, std::sin(left / 2), 0, std::cos(left / 2)}, pitched));
}

void move(heddle_camera& camera, double right, double up, double forward) {
  const Axes axes = axes_of(camera);
  for (std::size_t i = 0; i < 3; ++i) camera.position[i] += right * axes.right[i] + forward * axes.forward[i];
  camera.position[1] += up;
}

void level(heddle_camera& camera) {
  const Axes axes = axes_of(camera);
  const double run = std::hypot(axes.forward[0], axes.forward[2]);
  // Looking straight up or down, what points up in the picture is where the view was heading.
  const double sign = axes.forward[1] > 0 ? -1.0 : 1.0;
  const double yaw =
      run > 1e-9 ? std::atan2(-axes.forward[0], -axes.forward[2]) : std::atan2(-sign * axes.up[0], -sign * axes.up[2]);
  const double pitch = pitch_of(axes);
  set(camera, product({0, std::sin(yaw / 2), 0, std::cos(yaw / 2)}, {std::sin(pitch / 2), 0, 0, std::cos(pitch / 2)}));
}

std::string overlay_text(const heddle_camera& camera, const std::string& name) {
  const Axes axes = axes_of(camera);
  std::array<double, 3> target{};
  for (std::size_t i = 0; i < 3; ++i) target[i] = camera.position[i] + axes.forward[i];
  std::string escaped;
  for (const char c : name) {
    if (c == '"' || c == '\\') escaped += '\\';
    escaped += c;
  }
  // A number of TOML without a point is an integer, which the overlay takes as well.
  std::string text =
      fmt::format("[[camera]]\nname = \"{}\"\nposition = [{}, {}, {}]\ntarget = [{}, {}, {}]\n", escaped,
                  camera.position[0], camera.position[1], camera.position[2], target[0], target[1], target[2]);
  text += fmt::format("{} = {}\n", camera.is_orthographic != 0 ? "orthographic_half_height" : "vertical_angle",
                      camera.vertical_angle);
  if (camera.near_distance > 0) text += fmt::format("near = {}\n", camera.near_distance);
  return text;
}

}  // namespace heddle::view
