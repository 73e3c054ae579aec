// SPDX-License-Identifier: Apache-2.0
// Texels of cubes to directions, and the GGX lobe around a mirror direction: pure functions, no bindings.
#ifndef HEDDLE_SKY_ENVIRONMENT_MAP_CUBE_GLSL
#define HEDDLE_SKY_ENVIRONMENT_MAP_CUBE_GLSL

// Of a point (s, t) in [-1, 1]^2 of a face in Vulkan's order, t down; not normalized.
vec3 cube_direction(int face, vec2 p) {
  if (face == 0) return vec3(1.0, -p.y, -p.x);
  if (face == 1) return vec3(-1.0, -p.y, p.x);
  if (face == 2) return vec3(p.x, 1.0, p.y);
  if (face == 3) return vec3(p.x, -1.0, -p.y);
  if (face == 4) return vec3(p.x, -p.y, 1.0);
  return vec3(-p.x, -p.y, -1.0);
}

// Point i of n in [0, 1)^2, never 0 in x.
vec2 hammersley(uint i, uint n) {
  return vec2((float(i) + 0.5) / float(n), float(bitfieldReverse(i) >> 8) * (1.0 / 16777216.0));
}

// Duff et al. 2017, "Building an Orthonormal Basis, Revisited": columns x, y across the unit `axis`, z.
mat3 basis_around(vec3 axis) {
  float s = axis.z >= 0.0 ? 1.0 : -1.0;
  float a = -1.0 / (s + axis.z);
  float b = axis.x * axis.y * a;
  return mat3(vec3(1.0 + s * axis.x * axis.x * a, s * b, -s * axis.x), vec3(b, s + axis.y * axis.y * a, -axis.y), axis);
}

// (2) Density per steradian of light directions at a cosine NoL to N = V, their half vectors drawn from D NoH.
float pdf_mirror_lobe(float NoL, float alpha) {
  // NoH^2 = (1 + NoL) / 2; 1 - NoH^2 directly, which cancels where the lobe is narrow.
  float sin2 = 0.5 * max(1.0 - NoL, 0.0), cos2 = 1.0 - sin2;
  float k = alpha / max(sin2 + alpha * alpha * cos2, 1e-20);
  return k * k * (0.25 / 3.14159265358979324);
}

// (3) The lobe's mean of NoL: the integral of (1 - (2 + k) u) / (1 + k u) over u in [0, 1 / (2 + k)], k = alpha^2 - 1.
float mean_NoL(float alpha) {
  float k = alpha * alpha - 1.0;
  // Near alpha = 1 the two terms cancel: the series, fitted to 2e-5.
  if (k > -0.05) return 0.25 + k * (-1.0 / 6.0 + k * 0.1146);
  return (2.0 * (1.0 + k) / k * log(1.0 + k / (2.0 + k)) - 1.0) / k;
}

#endif
