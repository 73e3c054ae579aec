// SPDX-License-Identifier: Apache-2.0
// The mean of the samples so far -> the radiance that later passes read, in the place of the last sample.
#include "pass.glsl"
#include "accumulator.glsl"

layout(push_constant) uniform Push { float white; } push;

void main() {
  radiance = from_accumulator(fetch_mean(ivec2(gl_FragCoord.xy)), constant_accumulator, push.white);
}
