// SPDX-License-Identifier: Apache-2.0
// One sample of each pixel -> what blending makes means of: the sample times its weight, and the weight. README
// equation (12). The first of them is not blended, so it has the buffers whatever was there.
// in   radiance  cd/m^2
// out  mean      sample times weight, in the accumulator's scale; 0 where it is NaN or Inf
//      weight    0 where it is NaN or Inf
// push white     cd/m^2
#include "pass.glsl"
#include "running_mean.glsl"
#include "accumulator.glsl"

layout(push_constant) uniform Push { float white; } push;

void main() {
  vec4 value = fetch_radiance(ivec2(gl_FragCoord.xy));
  bool is_sample = is_finite(value);
  float value_weight = 0.0;
  if (is_sample) value_weight = constant_weighting == 1u ? compressed_weight(value.rgb, push.white) : 1.0;
  // Stores that round to the nearest would make Inf of what is too large, and Inf stays.
  if (constant_accumulator == kRgba16f) value = clamp(value, vec4(-kLargestHalf), vec4(kLargestHalf));
  mean = is_sample ? value_weight * to_accumulator(value, constant_accumulator, push.white) : vec4(0.0);
  weight = vec4(value_weight);
}
