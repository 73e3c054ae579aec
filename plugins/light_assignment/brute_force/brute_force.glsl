// SPDX-License-Identifier: Apache-2.0
// Every light -> those whose ball of reach holds the point, four tried a step.
// in      lights
// loops   one step for four lights and one for each that is met: of 65,535 that lavapipe grants an invocation, 65,536
//         lights take 16,384, and what the caller does with those that are met the rest
// state   cursor.x  next light to try
//         pending   x bits of lights that are to be met, y the light of bit 0
#include "light_volume.glsl"

// Lights beyond `lights` are the caller's own, of which nothing is known here.
bool may_reach(uint light, LightIterator iterator) {
  uint known = uint(lights.length());
  if (light >= iterator.end) return false;
  return light >= known || light_is_near(lights[light], iterator.position_rel);
}

LightIterator begin_lights(uint light_count, vec2 raster_px, vec3 position_rel) {
  return LightIterator(kBeforeFirstLight, light_count, position_rel, uvec4(0u), uvec4(0u));
}

bool next_light(inout LightIterator iterator) {
  while (iterator.pending.x == 0u) {
    uint first = iterator.cursor.x;
    if (first >= iterator.end) return false;
    iterator.pending.y = first;
    iterator.pending.x = (may_reach(first, iterator) ? 1u : 0u) | (may_reach(first + 1u, iterator) ? 2u : 0u) |
                         (may_reach(first + 2u, iterator) ? 4u : 0u) | (may_reach(first + 3u, iterator) ? 8u : 0u);
    iterator.cursor.x = first + 4u;
  }
  iterator.light = iterator.pending.y + uint(findLSB(iterator.pending.x));
  iterator.pending.x &= iterator.pending.x - 1u;
  return true;
}
