// SPDX-License-Identifier: Apache-2.0
// README equation (1): how far along the normal a lookup moves, so that no texel that the filter reads lies in front of
// the receiver's own plane. Pure.
#ifndef HEDDLE_SHADOW_MAP_NORMAL_OFFSET_GLSL
#define HEDDLE_SHADOW_MAP_NORMAL_OFFSET_GLSL

// A bilinear lookup reads texel centres up to one texel away in x and in y.
const float kBilinearReach = 1.4142136;
// Interpolated normals differ from the facets that were drawn: sine of the largest difference that stays free of acne.
const float kFacetSine = 0.1;
// Rounding of positions and depths, relative to the distances that went into them: a few float32 steps.
const float kRoundingSlack = 1e-6;
// Vertices are rounded to 1/256 texel when they are drawn, which tilts small triangles.
const float kSnapSlack = 1.02;

// Metres. filter_radius: texels; texel_size: metres; across: length of the normal's part in the map's plane, 0..1;
// rounding_distance: metres from the frame's origin and from the light.
float normal_offset(float filter_radius, float texel_size, float across, float rounding_distance) {
  float reach = filter_radius + kBilinearReach;
  return kSnapSlack * reach * texel_size * min(across + kFacetSine, 1.0) + kRoundingSlack * rounding_distance;
}

#endif
