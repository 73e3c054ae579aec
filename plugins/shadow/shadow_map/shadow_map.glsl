// SPDX-License-Identifier: Apache-2.0
// Visibility of a light at a point, looked up in the light's depth maps: normal offset, then percentage-closer filtering.
// Source  Williams 1978, "Casting curved shadows on curved surfaces"; Reeves, Salesin, Cook 1987, "Rendering antialiased
//         shadows with depth maps"; the offset is README equation (1)
// in      lights, light_views (LightViews in views.hpp: x first map, y maps, z kLayout*, w filter radius in texels),
//         shadow_views (7 vec4 a map, LookupView in depth_maps.hpp), kernel (xy: taps in filter radii, z:
//         metres that shadows reach), atlas (reversed depth)
// loops   over cascades (<= 4) and taps (<= 64)

#include "depth_map.glsl"

const uint kLayoutCascades = 1u;  // = views.hpp Layout
const uint kLayoutSpot = 2u;
const uint kLayoutCube = 3u;
const uint kLayoutBox = 4u;
// Where the shadow of a directional light begins to fade, as a fraction of `distance`.
const float kFadeStart = 0.9;

DepthMap load_map(uint index) {
  uint i = index * kVectorsPerDepthMap;
  return unpack_depth_map(vec4[kVectorsPerDepthMap](shadow_views[i], shadow_views[i + 1u], shadow_views[i + 2u],
                                                    shadow_views[i + 3u], shadow_views[i + 4u], shadow_views[i + 5u],
                                                    shadow_views[i + 6u]));
}

// Index of the cube face (+X, -X, +Y, -Y, +Z, -Z) that a direction falls on.
uint cube_face(vec3 direction) {
  vec3 size = abs(direction);
  if (size.x >= size.y && size.x >= size.z) return direction.x >= 0.0 ? 0u : 1u;
  if (size.y >= size.z) return direction.y >= 0.0 ? 2u : 3u;
  return direction.z >= 0.0 ? 4u : 5u;
}

float filtered_visibility(DepthMap map, vec3 ndc, float filter_radius) {
  float texel_uv = 1.0 / float(size_atlas().x);
  uint taps = uint(kernel.length());
  float sum = 0.0;
  for (uint i = 0u; i < taps; ++i) {
    sum += compare_atlas(depth_map_tap(map, ndc.xy, kernel[i].xy, filter_radius, texel_uv), map.layer, ndc.z);
  }
  return sum / float(max(taps, 1u));
}

float shadow(uint light, vec3 position_rel, vec3 normal) {
  if (light >= uint(light_views.length())) return 1.0;
  uvec4 slot = light_views[light];
  if (slot.y == 0u) return 1.0;
  uint layout_kind = slot.z;
  float filter_radius = uintBitsToFloat(slot.w);
  bool is_parallel = layout_kind == kLayoutCascades || layout_kind == kLayoutBox;
  HeddleLight source = lights[light];
  DepthMap map = load_map(slot.x);

  vec3 from_light = position_rel - map.eye_rel;
  float light_distance = length(from_light);
  bool is_segment = source.type == HEDDLE_LIGHT_CAPSULE || source.type == HEDDLE_LIGHT_WEDGE;
  bool has_extent = is_segment || source.type == HEDDLE_LIGHT_SPHERE || source.type == HEDDLE_LIGHT_RECTANGLE;
  vec3 L = -source.direction;
  if (!is_parallel) {
    // At the light itself there is nothing between; at and beyond the range there is no light.
    float range = source.range + (is_segment ? 0.5 * source.segment_length : 0.0);
    if (light_distance <= 0.0 || (source.range > 0.0 && light_distance >= range)) return 1.0;
    L = -from_light / light_distance;
  }
  if (!has_extent && dot(normal, L) <= 0.0) return 0.0;

  float fade = 0.0;
  float texel_size = map.texel_size;
  if (layout_kind == kLayoutCascades) {
    // The finest cascade that holds the point and what the filter reads around it.
    uint chosen = slot.y;
    for (uint i = 0u; i < slot.y; ++i) {
      DepthMap candidate = load_map(slot.x + i);
      if (depth_map_edge(candidate, candidate.clip_from_rel * vec4(position_rel, 1.0)) <= 1.0) {
        chosen = i;
        map = candidate;
        break;
      }
    }
    if (chosen == slot.y) return 1.0;
    texel_size = map.texel_size;
    fade = clamp((length(position_rel) / kernel[0].z - kFadeStart) / (1.0 - kFadeStart), 0.0, 1.0);
  } else if (layout_kind == kLayoutSpot) {
    texel_size *= max(dot(from_light, map.axis), 0.0);
  } else if (layout_kind == kLayoutCube) {
    vec3 size = abs(from_light);
    texel_size *= max(size.x, max(size.y, size.z));
  }

  if (layout_kind == kLayoutCube) {
    // The face of the point itself, also for the lookup: the offset is made for this face's plane, and the guard holds
    // lookups that it moves across the seam.
    map = load_map(slot.x + cube_face(from_light));
  }
  vec4 place = depth_map_lookup(map, position_rel, normal, filter_radius, texel_size, light_distance);
  float visibility = filtered_visibility(map, place.xyz, filter_radius);
  return place.w > 0.0 ? mix(visibility, 1.0, fade) : 1.0;
}
