// SPDX-License-Identifier: Apache-2.0
// Directions <-> places in the sky's images. A sky is mirrored in the plane through zenith and sun, so the images hold
// half of it: x is the angle from the sun's azimuth, 0 to pi. Pure functions.
#ifndef HEDDLE_SKY_MAPPING_GLSL
#define HEDDLE_SKY_MAPPING_GLSL
#include "atmosphere.glsl"

// x: angle from the sun's azimuth, [0, pi]; y: elevation, [-pi/2, pi/2].
vec2 sky_angles(vec3 direction, float sun_azimuth) {
  float sine = sin(sun_azimuth);
  float cosine = cos(sun_azimuth);
  // Azimuth 0 is -Z, pi/2 is +X.
  float along = direction.x * sine - direction.z * cosine;
  float across = abs(direction.x * cosine + direction.z * sine);
  // acos and asin of the driver are off by 4e-4, which the fine rows at the horizon would show.
  return vec2(atan(across, along), atan(direction.y, length(vec2(direction.x, direction.z))));
}

// In the sun's frame: the sun's azimuth is -Z.
vec3 sky_direction(vec2 angles) {
  return vec3(sin(angles.x) * cos(angles.y), sin(angles.y), -cos(angles.x) * cos(angles.y));
}

// The image of radiance: the upper half of its rows is the sky, the lower half the ground, each with rows that get
// denser towards the horizon (Hillaire 2020, section 5.3). x: [0, 1]; y: signed, negative on the ground; never mixed.
// `horizon`: elevation of the horizon, <= 0.
vec2 sky_map_coordinate(vec2 angles, float horizon, vec2 size) {
  bool is_ground = angles.y < horizon;
  float side = is_ground ? -1.0 : 1.0;
  float span = 0.5 * kSkyPi - side * horizon;
  float row = sqrt(clamp(abs(angles.y - horizon) / max(span, 1e-6), 0.0, 1.0));
  float half_rows = 0.5 * size.y;
  float y = (0.5 + row * (half_rows - 1.0) + (0.5 - 0.5 * side) * half_rows) / size.y;
  return vec2(table_coordinate(angles.x / kSkyPi, size.x), y);
}
// xy: angles of a texel; z: 1 where it is ground.
vec3 sky_map_angles(ivec2 texel, float horizon, vec2 size) {
  float half_rows = 0.5 * size.y;
  bool is_ground = float(texel.y) >= half_rows;
  float row = table_fraction(float(texel.y) - (is_ground ? half_rows : 0.0), half_rows);
  float span = is_ground ? 0.5 * kSkyPi + horizon : 0.5 * kSkyPi - horizon;
  float elevation = horizon + (is_ground ? -1.0 : 1.0) * row * row * span;
  return vec3(table_fraction(float(texel.x), size.x) * kSkyPi, elevation, is_ground ? 1.0 : 0.0);
}

// The filtered images have no edge at the horizon; rows are denser there in the specular one (fine = true).
vec2 filtered_coordinate(vec2 angles, bool fine, vec2 size) {
  float e = angles.y / (0.5 * kSkyPi);
  float row = fine ? 0.5 + 0.5 * sign(e) * sqrt(abs(e)) : 0.5 + 0.5 * e;
  return vec2(table_coordinate(angles.x / kSkyPi, size.x), table_coordinate(row, size.y));
}
vec2 filtered_angles(ivec2 texel, bool fine, vec2 size) {
  float e = 2.0 * table_fraction(float(texel.y), size.y) - 1.0;
  return vec2(table_fraction(float(texel.x), size.x), 0.5 * (fine ? e * abs(e) : e)) * kSkyPi;
}

// Layer i of the specular image holds alpha = ((i + 1) / kSpecularLayers)^2; alpha 0 is the radiance itself.
const float kSpecularLayers = 7.0;
float specular_level(float alpha) { return kSpecularLayers * sqrt(clamp(alpha, 0.0, 1.0)); }
float specular_alpha(float layer) { return (layer + 1.0) * (layer + 1.0) / (kSpecularLayers * kSpecularLayers); }

#endif
