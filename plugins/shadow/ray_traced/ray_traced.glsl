// SPDX-License-Identifier: Apache-2.0
// Visibility of a light at a point, by rays through the scene's triangles: README equations (1) to (7).
// Source  Whitted 1980, "An Improved Illumination Model for Shaded Display"; Cook, Porter and Carpenter 1984, "Distributed
//         Ray Tracing"; the walk: bvh.glsl
// in      lights, camera; bvh_nodes, bvh_triangles, bvh_masks, ray_frame (casters.hpp); shadow_settings_light
// out     cut_short  the light at which an invocation had no steps left
// loops   rays of an area light (<= 4096), each through at most all nodes, each leaf's triangles (<= 4). All calls of an
//         invocation share kMostSteps of them: lavapipe ends loops after 65,535, silently, and counts an inner loop's end
// No branch depends on a uniform block (ray_frame holds the parameters): lavapipe 22.3 looks for uniforms in conditions,
// and writes past its own table for the fourth block and later ones.
#include "bvh.glsl"
#include "owen_sobol.glsl"
#include "light_points.glsl"

// The callers' own loops (lights, textures of lights, cascades) have the other 9,535.
const uint kMostSteps = 56000u;
// (7) What the point may be off its surface, twice: half the subpixel grid of 1/256 px that vertices are rounded to,
// along both axes; float32 depth that was rounded a few times; positions as far away as the tree's.
const float kPixelError = 1.0 / 128.0;
const float kDepthError = 9.5367432e-7;      // 2^-20
const float kCoordinateError = 4.7683716e-7; // 8 half units in the last place

uint steps_taken = 0u;  // by this invocation, in all calls
bool is_cut_short = false;

// Whether an alpha mask has surface there: its bit of the micro-triangle, rows along the third corner's weight.
bool is_surface(uint mask, vec2 weights) {
  uint side = 1u << (mask >> 28u);
  vec2 at = clamp(weights, 0.0, 1.0) * float(side);
  uint row = min(uint(at.y), side - 1u), column = min(uint(at.x), side - 1u - row);
  vec2 rest = at - vec2(column, row);
  uint is_upper = rest.x + rest.y > 1.0 && row + column + 1u < side ? 1u : 0u;
  uint bit = row * (2u * side - row) + 2u * column + is_upper;
  return (bvh_masks[(mask & 0x0fffffffu) - 1u + (bit >> 5u)] >> (bit & 31u) & 1u) != 0u;
}

// 1 free, 0 blocked; steps_taken is beyond kMostSteps where it is not known.
float ray_visibility(vec3 origin, vec3 direction, float reach) {
  BvhRay ray = bvh_ray(origin, direction, reach);
  uint count = uint(bvh_nodes.length()) / 2u;
  bool is_blocked = false;
  for (uint node = 0u; node < count && !is_blocked && steps_taken <= kMostSteps; steps_taken += 2u) {
    uvec4 low = bvh_nodes[2u * node], high = bvh_nodes[2u * node + 1u];
    bool meets = bvh_meets_box(ray, uintBitsToFloat(low.xyz), uintBitsToFloat(high.xyz));
    uint triangle = high.w >> 3u;
    uint end = meets ? triangle + (high.w & 7u) : triangle;
    for (; triangle < end && !is_blocked; ++triangle, ++steps_taken) {
      uvec4 a = bvh_triangles[3u * triangle], b = bvh_triangles[3u * triangle + 1u], c = bvh_triangles[3u * triangle + 2u];
      BvhHit hit = bvh_meet_triangle(ray, uintBitsToFloat(a.xyz), uintBitsToFloat(b.xyz), uintBitsToFloat(c.xyz),
                                     uintBitsToFloat(a.w));
      is_blocked = hit.is_hit && (b.w == 0u || is_surface(b.w, hit.weights));
    }
    node = meets ? node + 1u : low.w;
  }
  return is_blocked ? 0.0 : 1.0;
}

float shadow(uint light, vec3 position_rel, vec3 normal) {
  if (light >= uint(lights.length()) || bvh_nodes.length() == 0) return 1.0;
  HeddleLight source = lights[light];
  if (source.type == HEDDLE_LIGHT_ENVIRONMENT || (source.flags & HEDDLE_LIGHT_CASTS_SHADOW) == 0u) return 1.0;
  LightArrival arrival = light_arrival(source, position_rel);
  bool is_area = has_extent(source);
  // Behind the surface; at the light itself and beyond its range there is nothing to shadow.
  bool has_place = source.type != HEDDLE_LIGHT_DIRECTIONAL && source.type != HEDDLE_LIGHT_BOX;
  if (has_place && (arrival.distance <= 0.0 || (source.range > 0.0 && arrival.distance >= source.range))) return 1.0;
  if (source.type == HEDDLE_LIGHT_RECTANGLE && dot(position_rel - source.position_rel, source.direction) <= 0.0)
    return 1.0;
  if (!is_area && dot(normal, arrival.direction) <= 0.0) return 0.0;

  HeddleShadowSettings settings = fetch_shadow_settings_light(source.id);
  bool is_own = (settings.written & HeddleShadowSettings_near_distance) != 0u;
  float near_distance = is_own ? settings.near_distance : ray_frame[2].y;
  float pixel = 2.0 * camera.half_size.y / float(camera.extent.y) *
                mix(length(position_rel), 1.0, float(camera.is_orthographic));
  vec3 position = position_rel + ray_frame[0].xyz;
  float lift = kPixelError * pixel + kDepthError * length(position_rel) +
               kCoordinateError * bvh_largest(position.x, position.y, position.z);
  vec3 start = position_rel + lift * normal;
  vec3 origin = start + ray_frame[0].xyz;
  float far = distance(origin, ray_frame[1].xyz) + ray_frame[1].w;

  uvec3 seed = mix_words(floatBitsToUint(position_rel) ^ uvec3(light, floatBitsToUint(ray_frame[0].w), 0u));
  uint samples = is_area ? uint(ray_frame[2].x) : 1u;
  float sum = 0.0, weights = 0.0;
  uint i = 0u;
  for (; i < samples && steps_taken <= kMostSteps; ++i, steps_taken += 2u) {
    LightRay ray = light_ray(source, start, normal, near_distance, far, owen_sobol_point(i, seed.xy));
    if (ray.weight <= 0.0) continue;
    float visibility = ray.reach > 0.0 ? ray_visibility(origin, ray.direction, ray.reach) : 1.0;
    // A ray without end says nothing, unless it is the only one: then nothing was met so far.
    if (steps_taken > kMostSteps && weights > 0.0) break;
    sum += ray.weight * visibility;
    weights += ray.weight;
  }
  if (steps_taken > kMostSteps && !is_cut_short) {
    is_cut_short = true;
    append_cut_short(light);
  }
  if (steps_taken > kMostSteps && weights <= 0.0) return 1.0;
  return weights > 0.0 ? sum / weights : 0.0;
}
