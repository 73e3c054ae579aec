// SPDX-License-Identifier: Apache-2.0
// A point of a surface after textures: what the role surface_material shades.
#ifndef HEDDLE_SHARED_SURFACE_POINT_GLSL
#define HEDDLE_SHARED_SURFACE_POINT_GLSL

struct SurfacePoint {
  vec3 base_color;  // linear Rec.709, [0, 1]
  float metalness;  // [0, 1]
  float roughness;  // perceptual, [0, 1]; alpha = roughness^2
  float ior;        // of the dielectric part; f0 = ((ior - 1) / (ior + 1))^2
};

#endif
