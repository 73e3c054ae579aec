// SPDX-License-Identifier: Apache-2.0
// A point -> the lights in its tile's list, then those that are in no list, four tried a step.
// in      lights, camera, tiling, tile_lists
// loops   one step for 1,024 lights, one for each word of 32 in which a light is met, one for each light met; lights in
//         no list: one for four. lavapipe grants an invocation 65,535, what the caller loops included
// state   cursor.x  pair of the tile's lists that comes next, while summary words are left
//               .y  summary words that were read
//               .z  first word that the summary in pending.z means
//               .w  next light to try of those in no list
//         pending   x bits of lights that are to be met, y the light of bit 0, z bits of words, w 0 column, 1 what shows
#include "light_volume.glsl"
#include "tiles.glsl"
#include "view.glsl"

// Lights beyond `lights` are the caller's own, of which nothing is known here.
bool may_reach(uint light, LightIterator iterator) {
  uint known = uint(lights.length());
  if (light >= iterator.end) return false;
  return light >= known || light_is_near(lights[light], iterator.position_rel);
}

LightIterator begin_lights(uint light_count, vec2 raster_px, vec3 position_rel) {
  LightIterator iterator = LightIterator(kBeforeFirstLight, light_count, position_rel, uvec4(0u), uvec4(0u));
  uint listed = listed_lights();
  float depth = depth_from_position_rel(camera, position_rel);
  bool is_seen = all(greaterThanEqual(raster_px, vec2(0.0))) && all(lessThan(raster_px, vec2(camera.extent))) &&
                 depth >= 0.0;
  if (listed == 0u || !is_seen) {
    iterator.cursor.y = summary_words();
    return iterator;
  }
  uvec2 tile = uvec2(raster_px) / tile_size();
  iterator.cursor.x = pairs_per_tile() * (tile.x + tiles_x() * tile.y);
  iterator.cursor.w = listed;
  float nearest = uintBitsToFloat(tile_lists[2u * iterator.cursor.x]);
  float farthest = uintBitsToFloat(tile_lists[2u * iterator.cursor.x + 1u]);
  iterator.pending.w = depth >= nearest && depth <= farthest ? 1u : 0u;
  return iterator;
}

bool next_light(inout LightIterator iterator) {
  while (iterator.pending.x == 0u) {
    if (iterator.pending.z != 0u) {  // the next word that is not 0
      uint word = iterator.cursor.z + uint(findLSB(iterator.pending.z));
      iterator.pending.z &= iterator.pending.z - 1u;
      uint pair = iterator.cursor.x + 1u + summary_words() + word;
      iterator.pending.x = tile_lists[2u * pair + iterator.pending.w];
      iterator.pending.y = 32u * word;
    } else if (iterator.cursor.y < summary_words()) {
      iterator.cursor.z = 32u * iterator.cursor.y;
      iterator.cursor.y += 1u;
      iterator.pending.z = tile_lists[2u * (iterator.cursor.x + iterator.cursor.y) + iterator.pending.w];
    } else {
      uint first = iterator.cursor.w;
      if (first >= iterator.end) return false;
      iterator.pending.y = first;
      iterator.pending.x = (may_reach(first, iterator) ? 1u : 0u) | (may_reach(first + 1u, iterator) ? 2u : 0u) |
                           (may_reach(first + 2u, iterator) ? 4u : 0u) | (may_reach(first + 3u, iterator) ? 8u : 0u);
      iterator.cursor.w = first + 4u;
    }
  }
  iterator.light = iterator.pending.y + uint(findLSB(iterator.pending.x));
  iterator.pending.x &= iterator.pending.x - 1u;
  return iterator.light < iterator.end;
}
