// SPDX-License-Identifier: Apache-2.0
// Lookups in depth maps: a normal offset in place of a depth bias, then taps over a disk that stay in the map's own part
// of the atlas. Pure.
// Source  Williams 1978, "Casting curved shadows on curved surfaces"; Reeves, Salesin, Cook 1987, "Rendering antialiased
//         shadows with depth maps"; the offset is equation (1) of plugins/shadow/shadow_map/README.md
#ifndef HEDDLE_SHARED_DEPTH_MAP_GLSL
#define HEDDLE_SHARED_DEPTH_MAP_GLSL

#include "normal_offset.glsl"

// LookupView in depth_maps.hpp.
const uint kVectorsPerDepthMap = 7u;
struct DepthMap {
  mat4 clip_from_rel;
  vec3 axis;         // the way the map looks, unit
  float texel_size;  // metres; perspective: metres at distance 1 along the axis
  vec3 eye_rel;
  float guard;       // width of the border, in ndc, that only filters may read
  vec2 tile_centre;  // uv of the layer
  float tile_half;   // of the tile's side, uv
  int layer;
};

DepthMap unpack_depth_map(vec4 v[kVectorsPerDepthMap]) {
  return DepthMap(mat4(v[0], v[1], v[2], v[3]), v[4].xyz, v[4].w, v[5].xyz, v[5].w, v[6].xy, v[6].z, int(v[6].w));
}

// 0 on the map's axis, 1 at the border that lookups do not enter. `clip` of an orthographic map.
float depth_map_edge(DepthMap map, vec4 clip) { return max(abs(clip.x), abs(clip.y)) / (1.0 - map.guard); }

// Where to look: xyz in ndc, w 1 if the map holds it, else 0 and the rest means nothing. filter_radius: texels;
// texel_size: metres, at the point; light_distance: metres.
// Without a branch: what calls this may depend on parameters, and lavapipe 22.3 looks for uniforms in the conditions of
// branches and writes past its own table for the fourth block and later ones.
vec4 depth_map_lookup(DepthMap map, vec3 position_rel, vec3 normal, float filter_radius, float texel_size,
                      float light_distance) {
  float along = dot(normal, map.axis);
  float across = sqrt(max(1.0 - along * along, 0.0));
  float offset = normal_offset(filter_radius, texel_size, across, length(position_rel) + light_distance);
  vec4 clip = map.clip_from_rel * vec4(position_rel + normal * offset, 1.0);
  vec3 ndc = clip.xyz / max(clip.w, 1e-30);
  bool is_covered = all(bvec2(clip.w > 0.0, max(abs(ndc.x), abs(ndc.y)) <= 1.0));
  return is_covered ? vec4(ndc.xy, max(ndc.z, 0.0), 1.0) : vec4(0.0);
}

// uv in the layer of one tap of the kernel: what would leave the tile reads its outermost texels.
vec2 depth_map_tap(DepthMap map, vec2 ndc, vec2 tap, float filter_radius, float texel_uv) {
  float inside = map.tile_half - 0.5 * texel_uv;
  return map.tile_centre + clamp(ndc * map.tile_half + tap * (filter_radius * texel_uv), -inside, inside);
}

#endif
