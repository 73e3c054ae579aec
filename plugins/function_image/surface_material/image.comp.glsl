// SPDX-License-Identifier: Apache-2.0
// A pixel's material under every light -> radiance towards the camera, without shadows. README, equation (1).
// in      depth, normal_geometric, normal, base_color, material, camera, lights
// out     image  rgb cd/m^2, a 1; 0 where nothing is and where the material is unlit
// loops   one step a light
#include "pass.glsl"
#include "role/surface_material.glsl"
#include "facing.glsl"
#include "light.glsl"
#include "octahedral.glsl"
#include "view.glsl"

vec4 answer(vec3 position_rel, vec3 normal) {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  vec4 base = fetch_base_color(pixel);
  if (base.a < 0.5) return vec4(0.0, 0.0, 0.0, 1.0);  // unlit: nobody asks its material
  vec4 stored = fetch_material(pixel);
  SurfacePoint point = SurfacePoint(base.rgb, stored.r, stored.g, 1.0 + 2.0 * stored.a);
  vec3 V = direction_to_view(camera, position_rel);
  vec3 N = face_viewer(decode_octahedral(fetch_normal(pixel).xy), V);
  vec3 sum = vec3(0.0);
  for (uint i = 0u; i < uint(lights.length()); ++i) {
    LightArrival arrival = light_arrival(lights[i], position_rel);
    float NoL = dot(N, arrival.direction);
    if (NoL <= 0.0 || arrival.irradiance == vec3(0.0)) continue;
    sum += surface_material(point, N, V, arrival.direction) * arrival.irradiance * NoL;
  }
  return vec4(sum, 1.0);
}

vec4 answer_background(vec3 direction) { return vec4(0.0); }

#include "function_image.glsl"
