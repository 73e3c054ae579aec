// SPDX-License-Identifier: Apache-2.0
// Directions around a normal, evenly spread by a density: Hammersley points through the cosine and the GGX lobe.
#ifndef HEDDLE_SKY_FILTER_GLSL
#define HEDDLE_SKY_FILTER_GLSL

// Point i of n in [0, 1)^2, never 0 in x.
vec2 hammersley(uint i, uint n) {
  return vec2((float(i) + 0.5) / float(n), float(bitfieldReverse(i) >> 8) * (1.0 / 16777216.0));
}

// Vector with cosine `cosine` to the unit `axis`. Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
vec3 around(vec3 axis, float cosine, float turn) {
  float s = axis.z >= 0.0 ? 1.0 : -1.0;
  float a = -1.0 / (s + axis.z);
  float b = axis.x * axis.y * a;
  vec3 tangent = vec3(1.0 + s * axis.x * axis.x * a, s * b, -s * axis.x);
  vec3 bitangent = vec3(b, s + axis.y * axis.y * a, -axis.y);
  float sine = sqrt(max(1.0 - cosine * cosine, 0.0));
  float angle = 6.28318530717958648 * turn;
  return tangent * (sine * cos(angle)) + bitangent * (sine * sin(angle)) + axis * cosine;
}

// Cosine of a half vector to the normal, drawn from D_GGX times that cosine. Walter et al. 2007, equation (35).
float ggx_half_cosine(float alpha, float u) { return sqrt((1.0 - u) / (1.0 + (alpha * alpha - 1.0) * u)); }

#endif
