// SPDX-License-Identifier: Apache-2.0
// Flying a camera: looking and moving in float64, so that a step of a millimetre holds 100 km from the origin. +Y is
// up.
#pragma once

#include <heddle/heddle.h>

#include <array>
#include <string>

namespace heddle::view {

/// Turns about the vertical axis by `left` and upwards by `up`, in radians. Looking ends straight up and straight down;
/// whatever roll the camera has stays.
void look(heddle_camera& camera, double left, double up);
/// Moves by metres along the camera's own right and forward, and along the scene's vertical.
void move(heddle_camera& camera, double right, double up, double forward);
/// Takes the roll out: the horizon is level.
void level(heddle_camera& camera);

struct Axes {
  std::array<double, 3> right, up, forward;
};
Axes axes_of(const heddle_camera& camera);

/// The camera as a [[camera]] of a scene overlay, with all digits. Overlays know no roll: it is lost.
std::string overlay_text(const heddle_camera& camera, const std::string& name);

}  // namespace heddle::view
