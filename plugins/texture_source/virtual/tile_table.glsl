// SPDX-License-Identifier: Apache-2.0
// A place in a virtual texture -> its cell in the table; the cell's entry -> where in the cache its texel is. Pure
// functions; README equations (1) to (4).
// Source  Mittring 2008, "Advanced Virtual Texture Topics": indirection texture with levels, integer entries
#ifndef HEDDLE_TILE_TABLE_GLSL
#define HEDDLE_TILE_TABLE_GLSL
#include "texture_footprint.glsl"

// (1) Cells before those of `level` in the table of a texture with 2^n tiles a side: levels lie one behind the other,
// the finest first. Exact for n <= 14.
uint cells_before(int n, int level) {
  return ((1u << uint(2 * n + 2)) - (1u << uint(2 * (n - level) + 2))) / 3u;
}

uint cell_of(int n, int level, ivec2 tile) {
  return cells_before(n, level) + (uint(tile.y) << uint(n - level)) + uint(tile.x);
}

// (2) An entry: slot 8 + 8 bits, level of the tile that is there 4 bits. Integers, so that nothing is rounded.
struct TileEntry {
  ivec2 slot;
  int level;
};

TileEntry unpack_entry(uint entry) {
  return TileEntry(ivec2(int(entry & 255u), int(entry >> 8u & 255u)), int(entry >> 16u & 15u));
}

uint pack_entry(uint slot_x, uint slot_y, uint level) { return slot_x | slot_y << 8u | level << 16u; }

// (3) Where in the cache the place is: the texel, exactly, and where in it.
struct CachePlace {
  ivec2 texel;
  vec2 within;
};

CachePlace cache_place(TileEntry entry, TexturePlace place, int tile, int border) {
  TexturePlace local = place_in_level(place, entry.level);
  int pitch = tile + 2 * border;
  return CachePlace(ivec2(entry.slot.x * pitch + border + (local.texel.x & (tile - 1)),
                          entry.slot.y * pitch + border + (local.texel.y & (tile - 1))),
                    local.within);
}

#endif
