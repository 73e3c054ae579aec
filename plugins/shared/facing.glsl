// SPDX-License-Identifier: Apache-2.0
// Normals that interpolation turned away from the eye. A pure function, also compiled as C++ by tests.
#ifndef HEDDLE_SHARED_FACING_GLSL
#define HEDDLE_SHARED_FACING_GLSL

// Bends a unit normal until it is seen edge-on at least; v is the unit direction to the eye.
vec3 face_viewer(vec3 n, vec3 v) {
  const float kEdgeOn = 1e-3;
  float n_v = dot(n, v);
  return n_v < kEdgeOn ? normalize(n + v * (kEdgeOn - n_v)) : n;
}

#endif
