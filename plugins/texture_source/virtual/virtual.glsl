// SPDX-License-Identifier: Apache-2.0
// A place and its footprint -> texels of the tiles that are resident, and a note of the tile that is wanted. README
// equations (1) to (6).
// in   virtual_materials  two uvec4 a material: first cell, n | address << 8 | texture << 16, chart's size (float bits),
//                         1 if it is virtual, 3 if texels sit on whole numbers; first texel of the chart
//      virtual_state      tile, its logarithm, border, slots in a row; spacing, offset x, offset y of the pixels that ask;
//                         1 / fade time, the fade's clock
//      tile_table, tile_cache, slot_births
// out  requests           texture | level << 16, x | y << 16
// One loop, of params.anisotropy steps, twice with filter trilinear.
#include "tile_table.glsl"

vec3 cached(uint entry_bits, TexturePlace place, TextureFootprint footprint, float centre) {
  TileEntry entry = unpack_entry(entry_bits);
  CachePlace at = cache_place(entry, place, int(virtual_layout.x), int(virtual_layout.z));
  // (7) The sampler has texels' centres at halves. Texel and part stay apart where one texel is meant.
  if (params.filtering == kFilterNearest) return fetch_tile_cache(at.texel + ivec2(at.within + centre)).rgb;
  vec2 middle = vec2(at.texel) + at.within + centre;
  vec2 per_texel = 1.0 / vec2(size_tile_cache());
  vec3 sum = vec3(0.0);
  for (int i = 0; i < footprint.taps; ++i)
    sum += sample_tile_cache((middle + tap_offset(footprint, place.direction, i, entry.level)) * per_texel).rgb;
  return sum / float(footprint.taps);
}

// (5) A tile that has just come is faded in over its parent, which is resident as long as it is.
vec3 virtual_level(uvec4 head, TexturePlace place, TextureFootprint footprint, int level) {
  int n = int(head.y & 255u);
  float centre = (head.w & 2u) != 0u ? 0.5 : 0.0;
  uint entry = tile_table[head.x + cell_of(n, level, place.texel >> (level + int(virtual_layout.y)))];
  vec3 color = cached(entry, place, footprint, centre);
  TileEntry unpacked = unpack_entry(entry);
  float age = virtual_time.y - slot_births[uint(unpacked.slot.y) * virtual_layout.w + uint(unpacked.slot.x)];
  float weight = clamp(age * virtual_time.x, 0.0, 1.0);
  int coarser = unpacked.level + 1;
  if (weight < 1.0 && coarser <= n) {
    uint parent = tile_table[head.x + cell_of(n, coarser, place.texel >> (coarser + int(virtual_layout.y)))];
    color = mix(cached(parent, place, footprint, centre), color, weight);
  }
  return color;
}

vec3 texture_source(uint material, vec2 uv, vec2 uv_dx, vec2 uv_dy, vec2 raster_px, vec3 otherwise) {
  if (2u * material + 1u >= uint(virtual_materials.length())) return otherwise;
  uvec4 head = virtual_materials[2u * material];
  if (head.w == 0u) return otherwise;
  uvec4 chart = virtual_materials[2u * material + 1u];
  int n = int(head.y & 255u);
  float chart_size = uintBitsToFloat(head.z);
  TexturePlace place =
      texture_place(uv, ivec2(chart.xy), chart_size, int(virtual_layout.x) << n, head.y >> 8u & 255u);
  bool is_trilinear = params.filtering == kFilterTrilinear;
  float bias = is_trilinear ? 1.0 : params.bias;
  float border = float(virtual_layout.z) - ((head.w & 2u) != 0u ? 0.5 : 0.0);
  int taps = taps_within_border(params.filtering == kFilterNearest ? 1 : params.anisotropy, border, exp2(bias));
  TextureFootprint footprint = texture_footprint(uv_dx * chart_size, uv_dy * chart_size, taps, n);
  int level = footprint_level(footprint.lambda, bias, n);
  // (6) One pixel of each square asks, another one in each frame; none has the offset that stands for no square.
  uvec2 pixel = uvec2(max(raster_px, vec2(0.0)));
  if ((pixel & (virtual_query.x - 1u)) == virtual_query.yz) {
    uvec2 wanted = uvec2(place.texel >> (level + int(virtual_layout.y)));
    append_requests(uvec2(head.y >> 16u | uint(level) << 16u, wanted.x | wanted.y << 16u));
  }
  vec3 color = virtual_level(head, place, footprint, level);
  if (is_trilinear && level < n) {
    float share = clamp(footprint.lambda - float(level), 0.0, 1.0);
    if (share > 0.0) color = mix(color, virtual_level(head, place, footprint, level + 1), share);
  }
  return color;
}
