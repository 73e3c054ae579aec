// SPDX-License-Identifier: Apache-2.0
// The lights that light_assignment lets a pixel's point meet -> what arrives from them. README, equation (1).
// in      depth, normal_geometric, camera, lights
// out     image  r lx; 0 where nothing is
// loops   one step a light that is met
#include "pass.glsl"
#include "role/light_assignment.glsl"
#include "light.glsl"

vec4 answer(vec3 position_rel, vec3 normal) {
  float arriving = 0.0;
  LightIterator iterator = begin_lights(uint(lights.length()), vec2(gl_GlobalInvocationID.xy) + 0.5, position_rel);
  while (next_light(iterator)) arriving += luminance(light_arrival(lights[iterator.light], position_rel).irradiance);
  return vec4(arriving, 0.0, 0.0, 0.0);
}

vec4 answer_background(vec3 direction) { return vec4(0.0); }

#include "function_image.glsl"
