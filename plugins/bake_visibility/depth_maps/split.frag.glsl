// SPDX-License-Identifier: Apache-2.0
// One direction and its depth map -> weight and sample of every element, each as two halves of 4 bits that an 8-bit
// target can add up. README equation (6).
// in      elements, directions, depth_maps
// out     target  r, g: upper and lower half of the weight; b, a: of the sample; each at most 15 of 255
#include "pass.glsl"
#include "depth_test.glsl"

layout(push_constant) uniform Push { BakePush push; };

void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  uint element = uint(pixel.y) * BAKE_TARGET_WIDTH + uint(pixel.x);
  target = vec4(0.0);
  if (element >= push.element_count) return;
  vec4 position = elements[BAKE_VECTORS_PER_ELEMENT * element];
  uint at = BAKE_VECTORS_PER_DIRECTION * push.first_direction;
  float h = cosine(elements[BAKE_VECTORS_PER_ELEMENT * element + 1u], directions[at + 3u]);
  if (!(h > 0.0)) return;
  int side = size_depth_maps().x;
  ivec2 texel = ivec2(texel_of(project(directions[at], position), side),
                      texel_of(project(directions[at + 1u], position), side));
  bool is_in = min(texel.x, texel.y) >= 0 && max(texel.x, texel.y) < side;
  float slope = cosine(elements[BAKE_VECTORS_PER_ELEMENT * element + 2u], directions[at + 3u]);
  bool is_free = slope > 0.0;
  if (is_free && is_in) {
    float bias = depth_bias(slope, push.bias_slope, push.bias_constant, push.bias_limit);
    is_free = is_open(project(directions[at + 2u], position), fetch_depth_maps(texel, int(push.layer)).x, bias,
                      push.depth_steps);
  }
  int code = weight_code(h);
  vec2 halves = vec2(code / 16, code % 16) / 255.0;
  target = vec4(halves, is_free ? halves : vec2(0.0));
}
