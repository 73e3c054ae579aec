// SPDX-License-Identifier: Apache-2.0
// The sRGB transfer function and its inverse, exact branches, for values in [0, 1].
// Source  IEC 61966-2-1:1999
#ifndef HEDDLE_SHARED_SRGB_GLSL
#define HEDDLE_SHARED_SRGB_GLSL

vec3 srgb_from_linear(vec3 linear) {
  vec3 curve = 1.055 * pow(max(linear, vec3(0.0031308)), vec3(1.0 / 2.4)) - 0.055;
  return mix(curve, 12.92 * linear, lessThanEqual(linear, vec3(0.0031308)));
}

vec3 linear_from_srgb(vec3 encoded) {
  vec3 curve = pow((max(encoded, vec3(0.04045)) + 0.055) / 1.055, vec3(2.4));
  return mix(curve, encoded / 12.92, lessThanEqual(encoded, vec3(0.04045)));
}

#endif
