// SPDX-License-Identifier: Apache-2.0
// Visibility of a directional light at a point: the finest cascade that holds it, blended into the next one towards its
// border.
// Source  Engel 2006, "Cascaded Shadow Maps", ShaderX5; Zhang, Sun, Xu, Lun 2006, "Parallel-split shadow maps for large-scale
//         virtual environments"; README equations (1) to (4)
// in      lights, light_cascades (LightCascades in cascades.hpp: x first map, y maps, z blend, w filter radius in texels),
//         shadow_views (7 vec4 a map, LookupView in depth_maps.hpp), kernel (xy: taps in filter radii, z:
//         metres that shadows reach), atlas (reversed depth)
// loops   over cascades (<= 8) and, twice, taps (<= 64)

#include "depth_map.glsl"

// Where shadows begin to fade, as a fraction of `distance`.
const float kFadeStart = 0.9;

DepthMap load_map(uint index) {
  uint i = index * kVectorsPerDepthMap;
  return unpack_depth_map(vec4[kVectorsPerDepthMap](shadow_views[i], shadow_views[i + 1u], shadow_views[i + 2u],
                                                    shadow_views[i + 3u], shadow_views[i + 4u], shadow_views[i + 5u],
                                                    shadow_views[i + 6u]));
}

// Lookups in one cascade. filter_radius: texels of the map.
float cascade_visibility(DepthMap map, vec3 position_rel, vec3 normal, float filter_radius) {
  float light_distance = length(position_rel - map.eye_rel);
  vec4 place = depth_map_lookup(map, position_rel, normal, filter_radius, map.texel_size, light_distance);
  float texel_uv = 1.0 / float(size_atlas().x);
  uint taps = uint(kernel.length());
  float sum = 0.0;
  for (uint i = 0u; i < taps; ++i) {
    sum += compare_atlas(depth_map_tap(map, place.xy, kernel[i].xy, filter_radius, texel_uv), map.layer, place.z);
  }
  return place.w > 0.0 ? sum / float(max(taps, 1u)) : 1.0;
}

float shadow(uint light, vec3 position_rel, vec3 normal) {
  if (light >= uint(light_cascades.length())) return 1.0;
  uvec4 slot = light_cascades[light];
  if (slot.y == 0u) return 1.0;
  if (dot(normal, -lights[light].direction) <= 0.0) return 0.0;
  float blend = uintBitsToFloat(slot.z);
  float filter_radius = uintBitsToFloat(slot.w);

  // The finest cascade that holds the point, and the next coarser one that does.
  uint first = slot.y;
  uint second = slot.y;
  float edge = 0.0;
  for (uint i = 0u; i < slot.y; ++i) {
    DepthMap map = load_map(slot.x + i);
    vec4 clip = map.clip_from_rel * vec4(position_rel, 1.0);
    float at = depth_map_edge(map, clip);
    if (at > 1.0 || clip.z < 0.0) continue;
    if (first < slot.y) {
      second = i;
      break;
    }
    first = i;
    edge = at;
  }
  if (first == slot.y) return 1.0;
  // README equation (4): 0 up to the blended part, 1 at the border. Where no coarser one holds the point, nothing blends.
  float along = clamp((edge - 1.0 + blend) / max(blend, 1e-6), 0.0, 1.0);
  float weight = second < slot.y ? along * along * (3.0 - 2.0 * along) : 0.0;
  float visibility = cascade_visibility(load_map(slot.x + first), position_rel, normal, filter_radius);
  if (weight > 0.0) {
    float coarser = cascade_visibility(load_map(slot.x + second), position_rel, normal, filter_radius);
    visibility = mix(visibility, coarser, weight);
  }
  float fade = clamp((length(position_rel) / kernel[0].z - kFadeStart) / (1.0 - kFadeStart), 0.0, 1.0);
  return mix(visibility, 1.0, fade);
}
