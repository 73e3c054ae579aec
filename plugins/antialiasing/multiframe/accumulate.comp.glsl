// SPDX-License-Identifier: Apache-2.0
// One sample of each pixel -> the mean of all samples so far.
// in      radiance  cd/m^2; NaN and Inf are left out
// in, out mean      running mean, in the accumulator's format and scale
//         residual  what `mean` lacks; float32_pair alone, else of one texel and not touched
//         weight    of all samples in it
// push    index     number of the sample; 0 begins a new mean, whatever is there
//         white     cd/m^2
// threads 8x8, one a pixel
#include "pass.glsl"
#include "running_mean.glsl"
#include "accumulator.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(push_constant) uniform Push { uint index; float white; } push;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_mean()))) return;
  bool is_pair = constant_accumulator == kFloat32Pair;
  RunningMean sum = RunningMean(vec4(0.0), vec4(0.0), 0.0);
  if (push.index > 0u) {
    sum.high = imageLoad(mean, pixel);
    if (is_pair) sum.low = imageLoad(residual, pixel);
    sum.weight = imageLoad(weight, pixel).r;
  }
  vec4 value = fetch_radiance(pixel);
  float value_weight = 1.0;
  if (constant_weighting == 1u && is_finite(value)) value_weight = compressed_weight(value.rgb, push.white);
  if (is_finite(value)) value = to_accumulator(value, constant_accumulator, push.white);
  sum = add_sample(sum, value, value_weight);
  imageStore(mean, pixel, round_stored(sum.high, constant_accumulator, constant_rounding));
  if (is_pair) imageStore(residual, pixel, sum.low);
  imageStore(weight, pixel, vec4(sum.weight));
}
