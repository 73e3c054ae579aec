// SPDX-License-Identifier: Apache-2.0
// The mean of all samples -> the radiance that later passes read, in the place of the last sample.
#include "pass.glsl"

void main() {
  radiance = fetch_mean(ivec2(gl_FragCoord.xy));
}
