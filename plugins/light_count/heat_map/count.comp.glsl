// SPDX-License-Identifier: Apache-2.0
// A pixel's point -> how many lights lighting meets there, and how many of them reach it.
// in      depth, camera, lights
// out     count  r met, g reaching
//         color  heat map of r
// loops   one step a light that is met
#include "pass.glsl"
#include "role/light_assignment.glsl"
#include "heat.glsl"
#include "light.glsl"
#include "view.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_count()))) return;
  float depth_here = fetch_depth(pixel).r;
  uint met = 0u, reaching = 0u;
  if (!is_background(depth_here)) {
    vec3 position_rel = position_rel_from_depth(camera, pixel_center(pixel), depth_here);
    LightIterator iterator = begin_lights(uint(lights.length()), pixel_center(pixel), position_rel);
    while (next_light(iterator)) {
      ++met;
      reaching += any(notEqual(light_arrival(lights[iterator.light], position_rel).irradiance, vec3(0.0))) ? 1u : 0u;
    }
  }
  imageStore(count, pixel, vec4(float(met), float(reaching), 0.0, 0.0));
  imageStore(color, pixel, vec4(heat(met), 1.0));
}
