// SPDX-License-Identifier: Apache-2.0
// Every light at a pixel's point -> how much of what arrives is let through. README, equation (1).
// in      depth, normal_geometric, camera, lights
// out     image  r visibility, 0 to 1; 1 where no light arrives and where nothing is
// loops   one step a light
#include "pass.glsl"
#include "role/shadow.glsl"
#include "light.glsl"

vec4 answer(vec3 position_rel, vec3 normal) {
  float arriving = 0.0, open = 0.0;
  for (uint i = 0u; i < uint(lights.length()); ++i) {
    LightArrival arrival = light_arrival(lights[i], position_rel);
    float irradiance = luminance(arrival.irradiance) * max(dot(normal, arrival.direction), 0.0);
    // What faces away is in its own shadow, and no technique is asked for that.
    if (irradiance <= 0.0) continue;
    arriving += irradiance;
    open += (lights[i].flags & HEDDLE_LIGHT_CASTS_SHADOW) != 0u ? irradiance * shadow(i, position_rel, normal) : irradiance;
  }
  return vec4(arriving > 0.0 ? open / arriving : 1.0, 0.0, 0.0, 0.0);
}

vec4 answer_background(vec3 direction) { return vec4(1.0, 0.0, 0.0, 0.0); }

#include "function_image.glsl"
