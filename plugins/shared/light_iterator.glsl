// SPDX-License-Identifier: Apache-2.0
// The state of the role light_assignment's iterator: where a walk over the lights of a point stands.
//   LightIterator iterator = begin_lights(uint(lights.length()), raster_px, position_rel);
//   while (next_light(iterator)) { ... lights[iterator.light] ... }
#ifndef HEDDLE_SHARED_LIGHT_ITERATOR_GLSL
#define HEDDLE_SHARED_LIGHT_ITERATOR_GLSL

// Before the first step: the index that the next one follows.
const uint kBeforeFirstLight = 0xffffffffu;

struct LightIterator {
  uint light;         // index into the caller's `lights`, after next_light has answered true
  uint end;           // number of the caller's lights
  vec3 position_rel;  // the point
  uvec4 cursor;       // the technique's own: where in its lists it stands ...
  uvec4 pending;      // ... and what it has read of them and not given out
};

#endif
