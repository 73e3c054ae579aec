// SPDX-License-Identifier: Apache-2.0
// A place and its footprint -> texels of the whole texture, filtered in float32. README equations (1) to (3).
// in   resident_materials  two uvec4 a material: texture, log2 of its extent | address << 8, chart's size (float
//                          bits), 1 if it is one, 3 if texels sit on whole numbers; first texel of the chart, last level
//      texture_0 ... texture_3
// One loop, of params.anisotropy steps, twice with filter trilinear.
#include "texture_footprint.glsl"

vec3 fetch_level(uint number, ivec2 texel, int level) {
  if (number == 0u) return texelFetch(texture_0, texel, level).rgb;
  if (number == 1u) return texelFetch(texture_1, texel, level).rgb;
  if (number == 2u) return texelFetch(texture_2, texel, level).rgb;
  return texelFetch(texture_3, texel, level).rgb;
}

struct ResidentTexture {
  uint number;
  int extent;
  uint mode;
  float centre;  // of a texel, from its lower corner
};

// (1) Level `level` at the place moved by `offset` texels of it: whole texels as integers, the rest as a float.
vec3 sample_level(ResidentTexture t, TexturePlace place, vec2 offset, int level) {
  int extent = t.extent >> level;
  TexturePlace local = place_in_level(place, level);
  vec2 texel = local.within + offset;
  texel += params.filtering == kFilterNearest ? 0.5 - t.centre : -t.centre;
  vec2 whole = floor(texel);
  ivec2 first = local.texel + ivec2(whole);
  ivec2 a = ivec2(address_texel(first.x, extent, t.mode), address_texel(first.y, extent, t.mode));
  if (params.filtering == kFilterNearest) return fetch_level(t.number, a, level);
  ivec2 b = ivec2(address_texel(first.x + 1, extent, t.mode), address_texel(first.y + 1, extent, t.mode));
  vec2 w = texel - whole;
  vec3 top = mix(fetch_level(t.number, a, level), fetch_level(t.number, ivec2(b.x, a.y), level), w.x);
  vec3 bottom = mix(fetch_level(t.number, ivec2(a.x, b.y), level), fetch_level(t.number, b, level), w.x);
  return mix(top, bottom, w.y);
}

// (2) The mean of the taps.
vec3 resident_level(ResidentTexture t, TexturePlace place, TextureFootprint footprint, int level) {
  vec3 sum = vec3(0.0);
  for (int i = 0; i < footprint.taps; ++i)
    sum += sample_level(t, place, tap_offset(footprint, place.direction, i, level), level);
  return sum / float(footprint.taps);
}

vec3 texture_source(uint material, vec2 uv, vec2 uv_dx, vec2 uv_dy, vec2 raster_px, vec3 otherwise) {
  if (2u * material + 1u >= uint(resident_materials.length())) return otherwise;
  uvec4 head = resident_materials[2u * material];
  if (head.w == 0u) return otherwise;
  uvec4 chart = resident_materials[2u * material + 1u];
  ResidentTexture t = ResidentTexture(head.x, 1 << int(head.y & 255u), head.y >> 8u, (head.w & 2u) != 0u ? 0.0 : 0.5);
  float chart_size = uintBitsToFloat(head.z);
  TexturePlace place = texture_place(uv, ivec2(chart.xy), chart_size, t.extent, t.mode);
  // Levels end where virtual ones do, at one tile.
  int coarsest = int(chart.z);
  bool is_trilinear = params.filtering == kFilterTrilinear;
  int taps = params.filtering == kFilterNearest ? 1 : params.anisotropy;
  TextureFootprint footprint = texture_footprint(uv_dx * chart_size, uv_dy * chart_size, taps, coarsest);
  int level = footprint_level(footprint.lambda, is_trilinear ? 1.0 : params.bias, coarsest);
  vec3 color = resident_level(t, place, footprint, level);
  // (3)
  if (is_trilinear && level < coarsest) {
    float share = clamp(footprint.lambda - float(level), 0.0, 1.0);
    if (share > 0.0) color = mix(color, resident_level(t, place, footprint, level + 1), share);
  }
  return color;
}
