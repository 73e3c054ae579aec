// SPDX-License-Identifier: Apache-2.0
// The sky in a pixel's direction, whatever stands before it. README, equation (1).
// in      depth, normal_geometric, camera
// out     image  rgb cd/m^2, a 1
#include "pass.glsl"
#include "role/sky.glsl"
#include "view.glsl"

vec4 answer_background(vec3 direction) { return vec4(sky_radiance(direction), 1.0); }

vec4 answer(vec3 position_rel, vec3 normal) { return answer_background(-direction_to_view(camera, position_rel)); }

#include "function_image.glsl"
