// SPDX-License-Identifier: Apache-2.0
// The means of weighted samples and of their weights, which blending made -> the radiance that later passes read, in the
// place of the last sample.
#include "pass.glsl"
#include "accumulator.glsl"

layout(push_constant) uniform Push { float white; } push;

void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 value = mean_of_blended(fetch_mean(pixel), fetch_weight(pixel).r);
  radiance = from_accumulator(value, constant_accumulator, push.white);
}
