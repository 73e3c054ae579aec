// SPDX-License-Identifier: Apache-2.0
// Points of a cage -> vertices of the refined surface: each is one sum of weights over points, whatever its level.
// Source  Brainerd 2016, "Catmull-Clark Subdivision Surfaces", GPU Pro 7: factorised subdivision tables; README (11)
// in      corners     two uvec4 each: row with the turn of the bitangent, colour, uv0, uv1, direction of the tangent
//         rows        first influence, number of influences
//         influences  point, and the bits of its weights for the place and two tangents
//         points      positions of the cage, object space, m; last frame's behind them
// out     vertices    HeddleVertex; where the cage bends, last frame's behind them
// threads 64, one a vertex
//
// Rows that share a place have the same weights for it, over rising points: `precise` makes their sums the same in every
// bit, so that surfaces have no holes. Loops: one, of at most as many turns as the cage has points in reach.
#include "pass.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push {
  uint first_corner, count;  // of the object
  uint first_row;            // its rows count from here
  uint first_point;          // and its points from here
  uint first_vertex;         // where its vertices go
  uint previous_point;       // steps to last frame's points; 0: the cage has not bent
  uint previous_vertex;      // steps to last frame's vertices
} push;

// Unit vector, or zero. Scaled first: squares of small vectors would be flushed to zero.
vec3 unit(vec3 v) {
  float largest = max(abs(v.x), max(abs(v.y), abs(v.z)));
  return largest > 0.0 ? normalize(v / largest) : vec3(0.0);
}

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= push.count) return;
  uint corner = push.first_corner + i;
  uvec4 head = corners[2u * corner];
  uvec4 tail = corners[2u * corner + 1u];
  uvec2 row = rows[push.first_row + (head.x & 0x7fffffffu)];
  precise vec3 position = vec3(0.0);
  precise vec3 previous = vec3(0.0);
  vec3 t1 = vec3(0.0);
  vec3 t2 = vec3(0.0);
  for (uint k = 0u; k < row.y; ++k) {
    uvec4 influence = influences[row.x + k];
    uint point = push.first_point + influence.x;
    vec3 at = points[point].xyz;
    precise vec3 term = uintBitsToFloat(influence.y) * at;
    position += term;
    precise vec3 previous_term = uintBitsToFloat(influence.y) * points[point + push.previous_point].xyz;
    previous += previous_term;
    t1 += uintBitsToFloat(influence.z) * at;
    t2 += uintBitsToFloat(influence.w) * at;
  }
  vec3 u1 = unit(t1);
  vec3 u2 = unit(t2);
  vec3 normal = unit(cross(u1, u2));
  if (normal == vec3(0.0)) normal = vec3(0.0, 1.0, 0.0);  // collapsed to less than a plane
  vec2 direction = uintBitsToFloat(tail.zw);
  vec3 tangent = direction.x * t1 + direction.y * t2;
  tangent = unit(tangent - dot(tangent, normal) * normal);
  // Across the normal, by the axis that it is farthest from.
  if (tangent == vec3(0.0)) tangent = unit(cross(normal, abs(normal.x) < 0.6 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0)));

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
  vertices[push.first_vertex + i] = vertex;
  if (push.previous_point != 0u) {
    vertex.position = previous;
    vertices[push.first_vertex + push.previous_vertex + i] = vertex;
  }
}
