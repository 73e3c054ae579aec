// SPDX-License-Identifier: Apache-2.0
// A parallelogram of uv -> what texture_source answers; -1 where there is no such texture.
#include "pass.glsl"
#include "role/texture_source.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_values()))) return;
  // Rounded once each, so that a test can do the same.
  precise vec2 along = float(pixel.x) * params.edge_u.xy;
  precise vec2 down = float(pixel.y) * params.edge_v.xy;
  precise vec2 uv = params.corner.xy + along + down;
  vec3 answer = texture_source(uint(params.material), uv, params.footprint * params.edge_u.xy,
                               params.footprint * params.edge_v.xy, vec2(pixel) + 0.5, vec3(-1.0));
  imageStore(values, pixel, vec4(answer, 1.0));
}
