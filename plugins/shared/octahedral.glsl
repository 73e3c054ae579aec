// SPDX-License-Identifier: Apache-2.0
// Unit vectors as two numbers in [-1, 1] and back, through the octahedron |x| + |y| + |z| = 1 unfolded along +Z.
// Source  Meyer et al. 2010, "On Floating-Point Normal Vectors"; Cigolle et al. 2014, "A Survey of Efficient
//         Representations for Independent Unit Vectors", section 3
// The six axes come back exactly, also through snorm formats. Divisions: inversesqrt is 1.5 ulp on some drivers.
#ifndef HEDDLE_SHARED_OCTAHEDRAL_GLSL
#define HEDDLE_SHARED_OCTAHEDRAL_GLSL

vec2 encode_octahedral(vec3 direction) {
  vec2 p = direction.xy / (abs(direction.x) + abs(direction.y) + abs(direction.z));
  vec2 folded = (1.0 - abs(p.yx)) * mix(vec2(-1.0), vec2(1.0), greaterThanEqual(p, vec2(0.0)));
  return direction.z < 0.0 ? folded : p;
}

// Any xy in [-1, 1]^2 gives a unit vector; (0, 0) is +Z.
vec3 decode_octahedral(vec2 encoded) {
  vec3 v = vec3(encoded, 1.0 - abs(encoded.x) - abs(encoded.y));
  float fold = max(-v.z, 0.0);
  v.xy -= fold * mix(vec2(-1.0), vec2(1.0), greaterThanEqual(v.xy, vec2(0.0)));
  return v / sqrt(dot(v, v));
}

#endif
