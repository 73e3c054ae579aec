// SPDX-License-Identifier: Apache-2.0
// A vertex of the refined surface, wherever it is drawn: one sum of weights over points of its cage.
// Source  Brainerd 2016, "Catmull-Clark Subdivision Surfaces", GPU Pro 7: factorised subdivision tables; equation (11) of
//         subdivision/catmull_clark
// in      corners     two uvec4 each: row with the turn of the bitangent, colour, uv0, uv1, direction of the tangent
//         rows        first influence, number of influences, steps to last frame's points
//         influences  point, and the bits of its weights for the place and two tangents
//         points      positions of the cage, object space, m; last frame's behind them
//
// Rows that share a place have the same weights for it, over rising points: `precise` makes their sums the same in every
// bit, so that surfaces have no holes. Loops: one, of at most as many turns as the cage has points in reach.
#include "subdivision_vertex.glsl"

HeddleVertex surface_vertex(uint index, out vec3 previous_position) {
  uvec4 head = corners[2u * index];
  uvec4 tail = corners[2u * index + 1u];
  uvec4 row = rows[head.x & 0x7fffffffu];
  precise vec3 position = vec3(0.0);
  precise vec3 previous = vec3(0.0);
  vec3 t1 = vec3(0.0);
  vec3 t2 = vec3(0.0);
  for (uint k = 0u; k < row.y; ++k) {
    uvec4 influence = influences[row.x + k];
    vec3 at = points[influence.x].xyz;
    precise vec3 term = uintBitsToFloat(influence.y) * at;
    position += term;
    precise vec3 previous_term = uintBitsToFloat(influence.y) * points[influence.x + row.z].xyz;
    previous += previous_term;
    t1 += uintBitsToFloat(influence.z) * at;
    t2 += uintBitsToFloat(influence.w) * at;
  }
  previous_position = previous;
  return subdivision_vertex(head, tail, position, t1, t2);
}
