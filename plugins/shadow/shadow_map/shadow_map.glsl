// SPDX-License-Identifier: Apache-2.0
// Visibility of a light at a point, looked up in the light's depth maps: normal offset, then percentage-closer filtering.
// Source  Williams 1978, "Casting curved shadows on curved surfaces"; Reeves, Salesin, Cook 1987, "Rendering antialiased
//         shadows with depth maps"; the offset is README equation (1)
// in      lights, light_views (LightViews in views.hpp: x first view, y views, z kLayout*, w filter radius in texels),
//         shadow_views (6 vec4 a view, ShadowView in views.hpp), kernel (xy: taps in filter radii), atlas (reversed depth, a layer a view)
// loops   over cascades (<= 4) and taps (<= 64)

#include "normal_offset.glsl"

const uint kLayoutCascades = 1u;  // = views.hpp Layout
const uint kLayoutSpot = 2u;
const uint kLayoutCube = 3u;
const uint kLayoutBox = 4u;
const uint kVectorsPerView = 6u;
// Where the shadow of a directional light begins to fade, as a fraction of `distance`.
const float kFadeStart = 0.9;

struct ShadowMapView {
  mat4 clip_from_rel;
  vec3 axis;        // the way the view looks, unit
  float texel_size; // metres; perspective: metres at distance 1 along the axis
  vec3 eye_rel;
  float guard;      // width of the border, in ndc, that only filters may read
};

ShadowMapView load_shadow_map_view(uint index) {
  uint i = index * kVectorsPerView;
  ShadowMapView view;
  view.clip_from_rel = mat4(shadow_views[i], shadow_views[i + 1u], shadow_views[i + 2u], shadow_views[i + 3u]);
  view.axis = shadow_views[i + 4u].xyz;
  view.texel_size = shadow_views[i + 4u].w;
  view.eye_rel = shadow_views[i + 5u].xyz;
  view.guard = shadow_views[i + 5u].w;
  return view;
}

// Index of the cube face (+X, -X, +Y, -Y, +Z, -Z) that a direction falls on.
uint cube_face(vec3 direction) {
  vec3 size = abs(direction);
  if (size.x >= size.y && size.x >= size.z) return direction.x >= 0.0 ? 0u : 1u;
  if (size.y >= size.z) return direction.y >= 0.0 ? 2u : 3u;
  return direction.z >= 0.0 ? 4u : 5u;
}

float filtered_visibility(uint layer, vec3 ndc, float filter_radius) {
  vec2 uv = ndc.xy * 0.5 + 0.5;
  float radius_uv = filter_radius / float(size_atlas().x);
  uint taps = uint(kernel.length());
  float sum = 0.0;
  for (uint i = 0u; i < taps; ++i) {
    sum += compare_atlas(uv + kernel[i].xy * radius_uv, int(layer), max(ndc.z, 0.0));
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
  uint index = slot.x;
  ShadowMapView view = load_shadow_map_view(index);

  vec3 from_light = position_rel - view.eye_rel;
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
  float texel_size = view.texel_size;
  if (layout_kind == kLayoutCascades) {
    // The finest cascade that holds the point and what the filter reads around it.
    uint chosen = slot.y;
    for (uint i = 0u; i < slot.y; ++i) {
      ShadowMapView candidate = load_shadow_map_view(slot.x + i);
      vec4 clip = candidate.clip_from_rel * vec4(position_rel, 1.0);
      if (max(abs(clip.x), abs(clip.y)) <= 1.0 - candidate.guard) {
        chosen = i;
        view = candidate;
        break;
      }
    }
    if (chosen == slot.y) return 1.0;
    index = slot.x + chosen;
    texel_size = view.texel_size;
    fade = clamp((length(position_rel) / params.distance - kFadeStart) / (1.0 - kFadeStart), 0.0, 1.0);
  } else if (layout_kind == kLayoutSpot) {
    texel_size *= max(dot(from_light, view.axis), 0.0);
  } else if (layout_kind == kLayoutCube) {
    vec3 size = abs(from_light);
    texel_size *= max(size.x, max(size.y, size.z));
  }

  if (layout_kind == kLayoutCube) {
    // The face of the point itself, also for the lookup: the offset is made for this face's plane, and the guard holds
    // lookups that it moves across the seam.
    index = slot.x + cube_face(from_light);
    view = load_shadow_map_view(index);
  }
  float along = dot(normal, view.axis);
  float normal_across = sqrt(max(1.0 - along * along, 0.0));
  float offset =
      normal_offset(filter_radius, texel_size, normal_across, length(position_rel) + light_distance);
  vec3 lookup = position_rel + normal * offset;
  // No branch from here on: the lookup depends on parameters, and lavapipe 22.3 looks for uniforms in the conditions of
  // branches and writes past its own table for the fourth block and later ones.
  vec4 clip = view.clip_from_rel * vec4(lookup, 1.0);
  vec3 ndc = clip.xyz / max(clip.w, 1e-30);
  bool is_covered = all(bvec2(clip.w > 0.0, max(abs(ndc.x), abs(ndc.y)) <= 1.0));
  float visibility = mix(filtered_visibility(index, is_covered ? ndc : vec3(0.0), filter_radius), 1.0, fade);
  return is_covered ? visibility : 1.0;
}
