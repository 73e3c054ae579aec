// SPDX-License-Identifier: Apache-2.0
// The sample's number -> 1000 + k / 1024, k in 0..1023 shuffled: exact in float32, as is the sum of many in float64.
#include "pass.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(push_constant) uniform Push { uint index; } push;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_radiance()))) return;
  uint k = (push.index * 7919u + uint(pixel.x) * 131u) % 1024u;
  imageStore(radiance, pixel, vec4(1000.0 + float(k) / 1024.0));
}
