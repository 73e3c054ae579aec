// SPDX-License-Identifier: Apache-2.0
// The equations of horizon-based occlusion, README (1) to (8): pure functions, also compiled as C++ by the tests.
// A slice is the half plane pair through a surface point that holds the view direction v (unit, to the eye) and a
// direction t, unit and normal to v. n is the surface's unit normal, n_v = dot(n, v) > 0, n_t = dot(n, t).
// Elevations are angles above the tangent plane within one side of a slice, handed around as (sine, cosine).
#ifndef HEDDLE_GTAO_GLSL
#define HEDDLE_GTAO_GLSL
#include "constants.glsl"

// Angle in [0, pi] of the unit vector (cosine, sine), sine >= 0. Half angles keep the argument of the arc tangent in
// [0, 1]: Abramowitz and Stegun 1964, equation 4.4.49, error 2e-8, doubled here; relative error 1e-6 down to 0.
// Own, because the arc functions of some drivers are off by 2e-4 and their error would not be small beside occlusion.
float angle_from(float sine, float cosine) {
  float t = sine / (1.0 + abs(cosine));
  float s = t * t;
  float series =
      1.0 +
      s * (-0.3333314528 +
           s * (0.1999355085 +
                s * (-0.1420889944 +
                     s * (0.1065626393 +
                          s * (-0.0752896400 + s * (0.0429096138 + s * (-0.0161657367 + s * 0.0028662257)))))));
  float angle = 2.0 * t * series;
  return cosine < 0.0 ? kPi - angle : angle;
}

// Equation (4): cosine-weighted measure of the directions of one side of a slice between the tangent plane and an
// elevation beta, the integral of dot(n, w) |sin(angle to v)|: (beta n_t - sin(beta) (n_t cos(beta) - n_v sin(beta))) / 2.
float occluded_arc(float n_v, float n_t, vec2 elevation) {
  float beta = angle_from(elevation.x, elevation.y);
  return 0.5 * (beta * n_t - elevation.x * (n_t * elevation.y - n_v * elevation.x));
}

// Equation (5): the same of both sides together up to v, all that a slice can lose. Its mean over all slices is 1.
float open_arcs(float n_v, float n_t) {
  float projected = sqrt(n_v * n_v + n_t * n_t);
  return n_v + abs(n_t) * angle_from(abs(n_t) / projected, n_v / projected);
}

// Equation (3): elevation of a sample, `offset` away from the point, in the slice through the sample itself. Samples lie
// at centres of pixels, so beside the slice that asked for them: measured against that slice's tangent a steep plane
// would occlude itself, measured against their own it never does.
vec2 sample_elevation(vec3 offset, vec3 n, vec3 v) {
  vec3 across = cross(v, offset);
  float cosine = dot(cross(n, offset), across) * inversesqrt(dot(across, across));
  float sine = dot(n, offset);
  return vec2(sine, cosine) * inversesqrt(sine * sine + cosine * cosine);
}

// No elevation reaches beyond v itself, which is open: the eye saw the point.
vec2 clamp_to_view(vec2 elevation, float n_v, float n_t) {
  float scale = inversesqrt(n_v * n_v + n_t * n_t);
  vec2 limit = vec2(n_v, -n_t) * scale;
  return elevation.y < limit.y ? limit : elevation;
}

// Equation (2): weight of an occluder; falloff 0 none, 1 linear. 0 from `radius` on.
float occlusion_weight(uint falloff, float distance_squared, float radius) {
  float d = sqrt(distance_squared);
  float inside = d < radius ? 1.0 : 0.0;
  return falloff == 0u ? inside : inside * (1.0 - d / radius);
}

// 0 .. 15, each once in every 4x4 pixels and spread in every 2x2: Bayer's ordered dither matrix (Bayer 1973).
uint tile_index(ivec2 pixel) {
  uvec2 p = uvec2(pixel) & 3u;
  uint a = p.x ^ p.y;
  return ((a & 1u) << 3u) | ((p.y & 1u) << 2u) | (a & 2u) | (p.y >> 1u);
}

// (rotation of the slices, offset of the steps), each in (0, 1): the 16 pixels of a tile are a Hammersley set.
vec2 tile_noise(ivec2 pixel) {
  uint i = tile_index(pixel);
  uint reversed = ((i & 1u) << 3u) | ((i & 2u) << 1u) | ((i & 4u) >> 1u) | (i >> 3u);
  return (vec2(float(i), float(reversed)) + 0.5) / 16.0;
}

// Pixels from the centre to step `index`: the squares of an even spacing (nearer occluders fill more of the
// hemisphere), never the centre pixel itself.
float step_distance(int index, int steps, float offset, float length_px) {
  float a = (float(index) + offset) / float(steps);
  return 1.0 + (length_px - 1.0) * a * a;
}

// Weights 1/2 1 1 1 1/2: together with its mirror image each of four successive pixels counts once, so 5x5 pixels hold
// every pixel of the noise's tile with one weight, and the window has no shift.
float denoise_weight(int offset_x, int offset_y) {
  return (abs(offset_x) == 2 ? 0.5 : 1.0) * (abs(offset_y) == 2 ? 0.5 : 1.0);
}

// Whether a neighbour, `offset` away, belongs to the plane of the pixel: 1 on it, 0 from one pixel's size off it.
float plane_weight(vec3 offset, vec3 n, float pixel_size) {
  return max(0.0, 1.0 - abs(dot(offset, n)) / pixel_size);
}

#endif
