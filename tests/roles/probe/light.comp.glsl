// SPDX-License-Identifier: Apache-2.0
// Points of a parallelogram -> what plugins/shared/light.glsl says of a light there.
#include "pass.glsl"
#include "light.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_values()))) return;
  vec2 uv = (vec2(pixel) + 0.5) / vec2(size_values());
  vec3 position_rel = params.corner + uv.x * params.edge_u + uv.y * params.edge_v;
  HeddleLight light = lights[params.light];
  LightArrival arrival = light_arrival(light, position_rel);
  vec4 answer = vec4(light_irradiance(light, arrival, position_rel, params.normal), arrival.distance);
  if (params.answer == 1u) answer = vec4(arrival.irradiance, arrival.distance);
  if (params.answer == 2u) answer = vec4(arrival.direction, arrival.distance);
  imageStore(values, pixel, answer);
}
