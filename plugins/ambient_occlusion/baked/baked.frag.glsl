// SPDX-License-Identifier: Apache-2.0
// The surface that the gbuffer shows, and what was baked for it -> visibility. README equations (1) and (2).
// in      surface; places (for each instance the three rows of object_from_rel); baked_instances, baked_triangles,
//         baked_lattice, baked_values: plugins/shared/baked_visibility.hpp
// out     visibility   1 where nothing was baked
#include "pass.glsl"

// Of instance `first` on; 1 beyond what there is.
float value_at(uint index) {
  return index < uint(baked_values.length()) ? uintBitsToFloat(baked_values[index].x) : 1.0;
}

// Between the three points of a triangle's lattice around a point.
float from_lattice(uvec4 head, uint triangle) {
  uvec4 t0 = baked_triangles[4u * triangle], t1 = baked_triangles[4u * triangle + 1u];
  uvec4 t2 = baked_triangles[4u * triangle + 2u], t3 = baked_triangles[4u * triangle + 3u];
  vec3 a = uintBitsToFloat(uvec3(t1.w, t2.xy)), b = uintBitsToFloat(uvec3(t2.zw, t3.x));
  vec3 c = uintBitsToFloat(t3.yzw);
  uint object = surface.object;
  vec4 point = vec4(surface.position_rel, 1.0);
  vec3 p = vec3(dot(places[3u * object], point), dot(places[3u * object + 1u], point),
                dot(places[3u * object + 2u], point)) - a;
  // Barycentric coordinates of the foot of p on the triangle's plane.
  vec3 e1 = b - a, e2 = c - a, n = cross(e1, e2);
  float area = dot(n, n);
  vec2 uv = area > 0.0 ? vec2(dot(cross(p, e2), n), dot(cross(e1, p), n)) / area : vec2(0.0);
  uint resolution = t0.y;
  vec2 at = max(uv, vec2(0.0)) * float(resolution);
  at *= min(1.0, float(resolution) / max(at.x + at.y, 1e-30));
  // The cell, whose far corner lies outside of the triangle along its third edge.
  vec2 cell = min(floor(at), vec2(resolution - 1u));
  if (cell.x + cell.y > float(resolution - 1u)) cell.x = float(resolution - 1u) - cell.y;
  vec2 f = clamp(at - cell, vec2(0.0), vec2(1.0));
  bool is_upper = f.x + f.y > 1.0 && cell.x + cell.y < float(resolution - 1u);
  uint i = uint(cell.x), j = uint(cell.y);
  uint row = t0.x + j * (resolution + 1u) - (j * max(j, 1u) - j) / 2u;  // lattice_row
  uint next = row + resolution + 1u - j;
  uint first = head.y;
  float v10 = value_at(first + baked_lattice[row + i + 1u]), v01 = value_at(first + baked_lattice[next + i]);
  if (is_upper) {
    float v11 = value_at(first + baked_lattice[next + i + 1u]);
    return v11 + (1.0 - f.x) * (v01 - v11) + (1.0 - f.y) * (v10 - v11);
  }
  float v00 = value_at(first + baked_lattice[row + i]);
  return v00 + f.x * (v10 - v00) + f.y * (v01 - v00);
}

// Bilinear, within the instance's own tile.
float from_texels(uvec4 head, uvec4 tile) {
  vec2 size = vec2(tile.xy);
  vec2 at = (tile.z == 1u ? surface.uv1 : surface.uv0) * size - 0.5;
  at = clamp(at, vec2(0.0), size - 1.0);
  uvec2 low = uvec2(at), high = min(low + 1u, tile.xy - 1u);
  vec2 f = at - vec2(low);
  float top = mix(value_at(head.y + low.y * tile.x + low.x), value_at(head.y + low.y * tile.x + high.x), f.x);
  float bottom = mix(value_at(head.y + high.y * tile.x + low.x), value_at(head.y + high.y * tile.x + high.x), f.x);
  return mix(top, bottom, f.y);
}

void main() {
  const uint kLattice = 1u, kTexels = 2u;
  visibility = vec4(1.0);
  uint object = surface.object;
  if (2u * object + 1u >= uint(baked_instances.length())) return;
  uvec4 head = baked_instances[2u * object], tile = baked_instances[2u * object + 1u];
  if (head.x == kLattice && uint(gl_PrimitiveID) < head.w) {
    visibility = vec4(clamp(from_lattice(head, head.z + uint(gl_PrimitiveID)), 0.0, 1.0));
  } else if (head.x == kTexels) {
    visibility = vec4(clamp(from_texels(head, tile), 0.0, 1.0));
  }
}
