// SPDX-License-Identifier: Apache-2.0
// Sums over a row of subdivision tables -> the vertex (plugins/shared/subdivision_tables.hpp).
#ifndef HEDDLE_SHARED_SUBDIVISION_VERTEX_GLSL
#define HEDDLE_SHARED_SUBDIVISION_VERTEX_GLSL
#include <heddle/records.h>

// Unit vector, or zero. Scaled first: squares of small vectors would be flushed to zero.
vec3 subdivision_unit(vec3 v) {
  float largest = max(abs(v.x), max(abs(v.y), abs(v.z)));
  return largest > 0.0 ? normalize(v / largest) : vec3(0.0);
}

// head, tail: a corner (row with the turn of the bitangent, colour, uv0; uv1, direction of the tangent along t1 and t2).
// position: m, object space; t1, t2: of any length.
HeddleVertex subdivision_vertex(uvec4 head, uvec4 tail, vec3 position, vec3 t1, vec3 t2) {
  vec3 u1 = subdivision_unit(t1);
  vec3 u2 = subdivision_unit(t2);
  vec3 normal = subdivision_unit(cross(u1, u2));
  if (normal == vec3(0.0)) normal = vec3(0.0, 1.0, 0.0);  // collapsed to less than a plane
  vec2 direction = uintBitsToFloat(tail.zw);
  vec3 tangent = direction.x * t1 + direction.y * t2;
  tangent = subdivision_unit(tangent - dot(tangent, normal) * normal);
  // Across the normal, by the axis that it is farthest from.
  if (tangent == vec3(0.0)) tangent = subdivision_unit(cross(normal, abs(normal.x) < 0.6 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0)));

  HeddleVertex vertex;
  vertex.position = position;
  vertex.u0 = uintBitsToFloat(head.z);
  vertex.normal = normal;
  vertex.v0 = uintBitsToFloat(head.w);
  vertex.tangent = vec4(tangent, (head.x & 0x80000000u) != 0u ? -1.0 : 1.0);
  vertex.color = head.y;
  vertex.u1 = uintBitsToFloat(tail.x);
  vertex.v1 = uintBitsToFloat(tail.y);
  vertex.reserved_ = 0.0;
  return vertex;
}

#endif
