// SPDX-License-Identifier: Apache-2.0
// Points of a parallelogram or a sphere -> what `shadow` answers; r: visibility.
#include "pass.glsl"
#include "role/shadow.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_values()))) return;
  vec2 uv = (vec2(pixel) + 0.5) / vec2(size_values());
  vec3 position_rel = params.corner + uv.x * params.edge_u + uv.y * params.edge_v;
  vec3 normal = params.normal;
  if (params.shape == 1u) {
    float elevation = (0.5 - uv.y) * 3.14159265358979324;
    float azimuth = uv.x * 6.28318530717958648;
    normal = vec3(sin(azimuth) * cos(elevation), sin(elevation), -cos(azimuth) * cos(elevation));
    position_rel = params.corner + length(params.edge_u) * normal;
  }
  imageStore(values, pixel, vec4(shadow(uint(params.light), position_rel, normal), 0.0, 0.0, 1.0));
}
