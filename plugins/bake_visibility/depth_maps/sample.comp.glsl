// SPDX-License-Identifier: Apache-2.0
// A slice of directions with a depth map each -> sums of every element. README equations (1) to (5).
// in      elements, directions, depth_maps (a layer a direction of the slice)
// inout   sums       of the elements from first_element up to element_count
// threads 64, one an element: no atomics, so the order of every sum is fixed
// loops   at most 64 directions a slice
#include "pass.glsl"
#include "depth_test.glsl"

layout(local_size_x = BAKE_GROUP_SIZE) in;
layout(push_constant) uniform Push { BakePush push; };

void main() {
  uint element = push.first_element + gl_GlobalInvocationID.x;
  if (element >= push.element_count) return;
  vec4 position = elements[BAKE_VECTORS_PER_ELEMENT * element];
  vec4 normal = elements[BAKE_VECTORS_PER_ELEMENT * element + 1u];
  vec4 facing = elements[BAKE_VECTORS_PER_ELEMENT * element + 2u];
  int side = size_depth_maps().x;
  // The slice by itself first: what is added to the long sums is as large as they are, or nearly (H10).
  vec4 slice = vec4(0.0);
  vec4 bent = vec4(0.0);
  for (uint i = 0u; i < push.direction_count; ++i) {
    uint at = BAKE_VECTORS_PER_DIRECTION * (push.first_direction + i);
    vec4 direction = directions[at + 3u];
    float h = cosine(normal, direction);
    if (!(h > 0.0)) continue;
    slice.x += h;
    float slope = cosine(facing, direction);
    if (!(slope > 0.0)) continue;
    ivec2 texel = ivec2(texel_of(project(directions[at], position), side),
                        texel_of(project(directions[at + 1u], position), side));
    bool is_in = min(texel.x, texel.y) >= 0 && max(texel.x, texel.y) < side;
    bool is_free = true;
    if (is_in) {
      float bias = depth_bias(slope, push.bias_slope, push.bias_constant, push.bias_limit);
      is_free = is_open(project(directions[at + 2u], position), fetch_depth_maps(texel, int(i)).x, bias,
                        push.depth_steps);
      slice.z += 1.0;
    }
    if (is_free) {
      slice.y += h;
      bent.xyz += h * direction.xyz;
    }
  }
  sums[BAKE_VECTORS_PER_SUM * element] += slice;
  sums[BAKE_VECTORS_PER_SUM * element + 1u] += bent;
}
