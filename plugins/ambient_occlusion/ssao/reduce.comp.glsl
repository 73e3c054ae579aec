// SPDX-License-Identifier: Apache-2.0
// Depth -> the depth that samples look at: a divisor-th of the pixels a side, without Inf.
// Source  Filion and McNaughton 2008, "Effects & Techniques": reduced so that scattered fetches stay in the cache
// in      depth          r32f  distance along the view axis, metres; +inf where there is no surface
// out     reduced_depth  r32f or r16f  the same; kNoSurface where there is none
// params  depth_divisor, depth_filter, depth_format
// loops   4 x 4
#include "pass.glsl"
#include "ssao.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

float depth_at(ivec2 pixel) { return min(fetch_depth(min(pixel, size_depth() - 1)).x, kNoSurface); }

float filtered(ivec2 texel) {
  int divisor = params.depth_divisor;
  ivec2 first = texel * divisor;
  ivec2 last = first + divisor - 1;
  if (constant_depth_filter == kDepthPoint || divisor == 1) {
    return depth_at(representative(texel, divisor, size_depth()));
  }
  if (constant_depth_filter == kDepthMedian) {
    return median_depth(vec4(depth_at(first), depth_at(ivec2(last.x, first.y)), depth_at(ivec2(first.x, last.y)),
                             depth_at(last)));
  }
  float least = kNoSurface;
  float most = 0.0;
  float sum = 0.0;
  float count = 0.0;
  for (int y = 0; y < divisor; ++y) {
    for (int x = 0; x < divisor; ++x) {
      ivec2 pixel = first + ivec2(x, y);
      if (any(greaterThanEqual(pixel, size_depth()))) continue;
      float depth = depth_at(pixel);
      least = min(least, depth);
      most = max(most, depth);
      sum += depth;
      count += 1.0;
    }
  }
  if (constant_depth_filter == kDepthMean) return sum / count;
  bool is_least = constant_depth_filter == kDepthMin ||
                  (constant_depth_filter == kDepthCheckerboard && ((texel.x ^ texel.y) & 1) != 0);
  return is_least ? least : most;
}

void main() {
  ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(texel, size_reduced_depth()))) return;
  float depth = filtered(texel);
  // Rounded to the nearest here: stores to 16 bits may truncate, which brings every surface half a step nearer.
  if (constant_depth_format != 0u) depth = unpackHalf2x16(packHalf2x16(vec2(min(depth, kNoSurfaceHalf)))).x;
  imageStore(reduced_depth, texel, vec4(depth));
}
