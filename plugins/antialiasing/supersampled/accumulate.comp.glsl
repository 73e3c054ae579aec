// SPDX-License-Identifier: Apache-2.0
// One sample of each pixel -> the mean of all samples so far.
// in      radiance  cd/m^2; NaN and Inf are left out
// in, out mean, residual, count  the running mean in two floats, and how many samples are in it
// push    index     number of the sample; 0 begins a new mean
// threads 8x8, one a pixel
#include "pass.glsl"
#include "running_mean.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(push_constant) uniform Push { uint index; } push;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_mean()))) return;
  RunningMean sum = RunningMean(vec4(0.0), vec4(0.0), 0.0);
  if (push.index > 0u) sum = RunningMean(imageLoad(mean, pixel), imageLoad(residual, pixel), imageLoad(count, pixel).r);
  sum = add_sample(sum, fetch_radiance(pixel), 1.0);
  imageStore(mean, pixel, sum.high);
  imageStore(residual, pixel, sum.low);
  imageStore(count, pixel, vec4(sum.weight));
}
