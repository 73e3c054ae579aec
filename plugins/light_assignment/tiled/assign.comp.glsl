// SPDX-License-Identifier: Apache-2.0
// Lights -> bits in the lists of the tiles that they reach. A work group a light and slice of the image.
// in      lights, camera, tiling; push.groups_x work groups in a row
// out     tile_lists  bits are set, in any order
// loops   (tiles_x + tiles_y) / 64 to find the rectangle of tiles, then tiles / (64 slices) times 2 `steps`: with the
//         65,536 tiles of a slice and 32 steps 32,768 + 1,024 of the 65,535 that lavapipe grants an invocation
#include "pass.glsl"
#include "tiles.glsl"
#include "light_volume.glsl"
#include "view.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
  uint groups_x;
} push;

shared uint from_x, to_x, from_y, to_y;  // the rectangle, to: one beyond

// From y and to y of a row are from low to high: rows count downwards, y points up.
vec2 column_bounds(uint column) {
  vec2 px = vec2(float(column * tile_size()), float(min((column + 1u) * tile_size(), camera.extent.x)));
  return vec2(ndc_from_raster(camera, vec2(px.x, 0.0)).x, ndc_from_raster(camera, vec2(px.y, 0.0)).x) *
         camera.half_size.x;
}
vec2 row_bounds(uint row) {
  vec2 px = vec2(float(row * tile_size()), float(min((row + 1u) * tile_size(), camera.extent.y)));
  return vec2(ndc_from_raster(camera, vec2(0.0, px.y)).y, ndc_from_raster(camera, vec2(0.0, px.x)).y) *
         -camera.half_size.y;
}

bool misses_strip(LightVolume volume, bool is_row, vec2 bounds) {
  bool is_orthographic = camera.is_orthographic != 0u;
  return light_is_beyond(volume, is_orthographic, is_row, bounds.x, 1.0) ||
         light_is_beyond(volume, is_orthographic, is_row, bounds.y, -1.0);
}

void set_bit(uint pair_of_tile, uint light, uint which) {
  uint word = light / 32u;
  atomicOr(tile_lists[2u * (pair_of_tile + 1u + summary_words() + word) + which], 1u << (light & 31u));
  atomicOr(tile_lists[2u * (pair_of_tile + 1u + word / 32u) + which], 1u << (word & 31u));
}

void main() {
  uint i = gl_LocalInvocationID.x;
  uint light = gl_WorkGroupID.x + push.groups_x * gl_WorkGroupID.y;
  if (light >= listed_lights()) return;
  LightVolume volume = light_volume(lights[light], camera);
  if (volume.kind == kLightReachesNothing) return;
  bool is_everywhere = volume.kind == kLightReachesAll;
  vec2 depths = is_everywhere ? vec2(0.0, kLightUnlimited) : light_depths(volume);
  if (depths.y < 0.0) return;  // wholly behind the camera
  if (i == 0u) {
    from_x = tiles_x();
    from_y = tiles_y();
    to_x = to_y = 0u;
  }
  barrier();
  for (uint k = i; k < tiles_x(); k += 64u) {
    if (!is_everywhere && misses_strip(volume, false, column_bounds(k))) continue;
    atomicMin(from_x, k);
    atomicMax(to_x, k + 1u);
  }
  for (uint k = i; k < tiles_y(); k += 64u) {
    if (!is_everywhere && misses_strip(volume, true, row_bounds(k))) continue;
    atomicMin(from_y, k);
    atomicMax(to_y, k + 1u);
  }
  barrier();
  if (from_x >= to_x || from_y >= to_y) return;

  uint width = to_x - from_x;
  uint count = width * (to_y - from_y);
  for (uint k = i + 64u * gl_WorkGroupID.z; k < count; k += 64u * gl_NumWorkGroups.z) {
    uvec2 tile = uvec2(from_x + k % width, from_y + k / width);
    uint pair = pairs_per_tile() * (tile.x + tiles_x() * tile.y);
    FrustumCell cell;
    cell.bounds = vec4(column_bounds(tile.x), row_bounds(tile.y));
    cell.near_distance = max(depths.x, 0.0);
    cell.far_distance = depths.y;
    cell.is_orthographic = camera.is_orthographic != 0u;
    if (!is_everywhere && light_misses_cell(volume, cell, uint(params.steps))) continue;
    set_bit(pair, light, 0u);

    float nearest = uintBitsToFloat(tile_lists[2u * pair]), farthest = uintBitsToFloat(tile_lists[2u * pair + 1u]);
    if (!(nearest <= depths.y && farthest >= depths.x && nearest <= farthest)) continue;
    cell.near_distance = max(cell.near_distance, nearest);
    cell.far_distance = min(cell.far_distance, farthest);
    if (!is_everywhere && light_misses_cell(volume, cell, uint(params.steps))) continue;
    set_bit(pair, light, 1u);
  }
}
