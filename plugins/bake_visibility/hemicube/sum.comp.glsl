// SPDX-License-Identifier: Apache-2.0
// Depth of five faces an element -> how much of its cosine-weighted hemisphere is open. README equation (1).
// in      elements (those that are asked), weights (of each pixel of a tile), depth_maps (a layer an element of the slice)
// inout   sums     of the slice's elements, 0 before
// threads 64, one work group an element: partial sums meet in a fixed order
// loops   3 side^2 / 64 pixels, at most 3072
#include "pass.glsl"
#include "params.h"

layout(local_size_x = HEMICUBE_GROUP_SIZE) in;
layout(push_constant) uniform Push { HemicubePush push; };
shared vec4 partial[HEMICUBE_GROUP_SIZE];  // open weight times direction; open weight
shared float partial_weight[HEMICUBE_GROUP_SIZE];

// Through a pixel's centre, in the element's axes: hemicube.hpp's faces.
vec3 direction_of(ivec2 pixel, int side) {
  float step = 2.0 / float(side);
  float x = -1.0 + (float(pixel.x) + 0.5) * step;
  if (pixel.y < side) return normalize(vec3(-x, 1.0 - (float(pixel.y) + 0.5) * step, 1.0));
  int row = pixel.y - side, face = row / (side / 2);
  float z = 1.0 - (float(row - face * (side / 2)) + 0.5) * step;
  vec2 forward = vec2(face == 0 ? 1.0 : (face == 2 ? -1.0 : 0.0), face == 1 ? 1.0 : (face == 3 ? -1.0 : 0.0));
  vec2 right = vec2(forward.y, -forward.x);
  return normalize(vec3(forward + x * right, z));
}

void main() {
  uint layer = gl_WorkGroupID.x, lane = gl_LocalInvocationID.x;
  uint element = push.first_element + layer;
  int side = int(push.side);
  uint first = HEMICUBE_VECTORS_PER_ELEMENT * element;
  vec3 facing = vec3(elements[first].w, elements[first + 1u].w, elements[first + 2u].w);
  vec4 open = vec4(0.0);
  float weight = 0.0;
  for (uint i = lane; i < 3u * push.side * push.side; i += HEMICUBE_GROUP_SIZE) {
    ivec2 pixel = ivec2(i % push.side, i / push.side);
    float w = weights[i];
    weight += w;
    // 0 is what the maps were cleared to: nothing is in the way, however far.
    vec3 direction = direction_of(pixel, side);
    if (fetch_depth_maps(pixel, int(layer)).x == 0.0 && dot(direction, facing) > 0.0) open += w * vec4(direction, 1.0);
  }
  partial[lane] = open;
  partial_weight[lane] = weight;
  barrier();
  for (uint stride = HEMICUBE_GROUP_SIZE / 2u; stride > 0u; stride /= 2u) {
    if (lane < stride) {
      partial[lane] += partial[lane + stride];
      partial_weight[lane] += partial_weight[lane + stride];
    }
    barrier();
  }
  if (lane > 0u) return;
  vec4 sum = partial[0];
  vec3 bent = sum.x * elements[first].xyz + sum.y * elements[first + 1u].xyz + sum.z * elements[first + 2u].xyz;
  sums[HEMICUBE_VECTORS_PER_SUM * element] += vec4(partial_weight[0], sum.w, 0.0, 0.0);
  sums[HEMICUBE_VECTORS_PER_SUM * element + 1u] += vec4(bent, 0.0);
}
