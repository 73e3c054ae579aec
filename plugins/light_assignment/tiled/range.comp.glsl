// SPDX-License-Identifier: Apache-2.0
// Depth -> the range of depths in each tile; empties the tile's lists. A work group a tile.
// in      depth, camera, tiling
// out     tile_lists  pair 0 of each tile, all else 0
// loops   tile^2 / 64 + (2 pairs_per_tile) / 64: 64 + 66 at most
#include "pass.glsl"
#include "tiles.glsl"
#include "constants.glsl"

layout(local_size_x = 64) in;

shared uint least, greatest;  // bits of positive floats order as the floats do

void main() {
  uint i = gl_LocalInvocationID.x;
  uvec2 tile = gl_WorkGroupID.xy;
  uint size = tile_size();
  if (i == 0u) {
    least = floatBitsToUint(kMaxFloat);
    greatest = 0u;
  }
  barrier();
  if (has_depth) {
    uint own_least = floatBitsToUint(kMaxFloat), own_greatest = 0u;
    for (uint k = i; k < size * size; k += 64u) {
      ivec2 pixel = ivec2(tile * size + uvec2(k % size, k / size));
      if (any(greaterThanEqual(pixel, ivec2(camera.extent)))) continue;
      float depth = fetch_depth(pixel).r;
      // Background, NaN and what lies behind the camera have no part in it.
      if (!(depth >= 0.0 && depth <= kMaxFloat)) continue;
      own_least = min(own_least, floatBitsToUint(max(depth, 0.0)));
      own_greatest = max(own_greatest, floatBitsToUint(max(depth, 0.0)));
    }
    atomicMin(least, own_least);
    atomicMax(greatest, own_greatest);
  }
  barrier();
  uint pairs = pairs_per_tile();
  uint first = 2u * pairs * (tile.x + tiles_x() * tile.y);
  bool is_shown = least <= greatest;
  float nearest = uintBitsToFloat(least) * (1.0 - kDepthSlack);
  float farthest = min(uintBitsToFloat(greatest) * (1.0 + kDepthSlack), kMaxFloat);
  for (uint k = i; k < 2u * pairs; k += 64u) {
    uint word = 0u;
    if (k == 0u) word = floatBitsToUint(is_shown ? nearest : 1.0);
    if (k == 1u) word = floatBitsToUint(is_shown ? farthest : 0.0);
    tile_lists[first + k] = word;
  }
}
