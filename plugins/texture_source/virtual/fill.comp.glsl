// SPDX-License-Identifier: Apache-2.0
// Tiles that came or went -> every cell of the table below them. An edit is a tile and the entry for all of its cells in
// its own and all finer levels; the host orders edits from coarse to fine, one dispatch a level.
// in   tile_edits  first cell of the texture's table, n | level << 8, x | y << 16, entry
// out  tile_table
// threads 256 x 1, one a cell (x, z) of an edit (y)
#include "pass.glsl"
#include "tile_table.glsl"

layout(local_size_x = 256) in;

const uint kGroupsInRow = 32768u;  // as the host dispatches them; what is beyond goes on in z

layout(push_constant) uniform Push {
  uint first;  // edit
} push;

void main() {
  uvec4 edit = tile_edits[push.first + gl_WorkGroupID.y];
  int n = int(edit.y & 255u), level = int(edit.y >> 8u);
  // Cells from the tile's own level down: 1, 4, 16, ...; those of depth d begin at (4^d - 1) / 3.
  uint i = (gl_WorkGroupID.z * kGroupsInRow + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
  if (i >= ((4u << uint(2 * level)) - 1u) / 3u) return;
  int depth = findMSB(3u * i + 1u) / 2;
  uint j = i - ((1u << uint(2 * depth)) - 1u) / 3u;
  ivec2 corner = ivec2(edit.z & 65535u, edit.z >> 16u) << depth;
  ivec2 inside = ivec2(j & ((1u << uint(depth)) - 1u), j >> uint(depth));
  tile_table[edit.x + cell_of(n, level - depth, corner + inside)] = edit.w;
}
