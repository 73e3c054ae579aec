// SPDX-License-Identifier: Apache-2.0
// How a tile's lists lie in `tile_lists`: pairs of words, the first of each for the whole column of space behind the
// tile, the second for the part of it between the depths that the tile shows. README, "Method".
//   pair 0                    bits of the least and greatest depth; least > greatest: nothing is shown
//   pairs 1 to blocks         bit i: word i of the lights is not 0
//   the rest                  bit i: light i
// After pass.glsl, or in a function's text: reads `tiling` (Tiling in pass.cpp) and `tile_lists`.

uint tiles_x() { return tiling[0].x; }
uint tiles_y() { return tiling[0].y; }
uint tile_size() { return tiling[0].z; }         // pixels
uint pairs_per_tile() { return tiling[0].w; }
uint listed_lights() { return tiling[1].x; }     // lights from here on are in no list
uint summary_words() { return tiling[1].y; }     // pairs that say which words are not 0

// Depths of a tile are widened by this, relative: positions go through depth and back in float32.
const float kDepthSlack = 1e-5;
