// SPDX-License-Identifier: Apache-2.0
// Where a texture is asked for and how far that moves from pixel to pixel -> texel, level and taps: one text for all
// techniques of texture_source, so that they differ in where texels come from and in nothing else. Pure functions.
// Source  Mittring 2008, "Advanced Virtual Texture Topics" (explicit level, addressing from unwrapped derivatives);
//         Heckbert 1989, "Fundamentals of Texture Mapping and Image Warping", section 3 (axes of the footprint)
#ifndef HEDDLE_SHARED_TEXTURE_FOOTPRINT_GLSL
#define HEDDLE_SHARED_TEXTURE_FOOTPRINT_GLSL

const uint kAddressWrap = 0u;
const uint kAddressMirror = 1u;
const uint kAddressClamp = 2u;

const uint kFilterNearest = 0u;
const uint kFilterBilinear = 1u;
const uint kFilterTrilinear = 2u;

// The largest float below 1.
const float kBelowOne = 0.99999994;

// A place in a texture: the texel of level 0, and where in it, 0 to below 1. Integers keep what one float32 of the whole
// texture would lose.
struct TexturePlace {
  ivec2 texel;
  vec2 within;
  vec2 direction;  // -1 where the texture is seen mirrored
};

// A texel's index brought into a level of `extent` texels, a power of two.
int address_texel(int i, int extent, uint mode) {
  if (mode == kAddressClamp) return i < 0 ? 0 : i >= extent ? extent - 1 : i;
  if (mode == kAddressMirror) {
    int folded = i & (2 * extent - 1);
    return folded >= extent ? 2 * extent - 1 - folded : folded;
  }
  return i & (extent - 1);
}

// uv of a chart that begins at texel `first` and spans chart_size (a power of two, so that the product is exact).
// Coordinates that are no numbers, or so large that texels have no integers, count as 0.
TexturePlace texture_place(vec2 uv, ivec2 first, float chart_size, int extent, uint mode) {
  vec2 t = uv * chart_size;
  if (!(abs(t.x) < 1073741824.0)) t.x = 0.0;
  if (!(abs(t.y) < 1073741824.0)) t.y = 0.0;
  vec2 whole = floor(t);
  ivec2 asked = ivec2(int(whole.x) + first.x, int(whole.y) + first.y);
  ivec2 texel = ivec2(address_texel(asked.x, extent, mode), address_texel(asked.y, extent, mode));
  // Exact, but just below a texel's side it would round to 1.
  vec2 within = vec2(min(t.x - whole.x, kBelowOne), min(t.y - whole.y, kBelowOne));
  vec2 direction = vec2(1.0, 1.0);
  if (mode == kAddressClamp) {
    // Beyond the last texel's middle there is nothing but it.
    if (asked.x < 0) within.x = 0.0;
    if (asked.y < 0) within.y = 0.0;
    if (asked.x >= extent) within.x = kBelowOne;
    if (asked.y >= extent) within.y = kBelowOne;
  } else if (mode == kAddressMirror) {
    if ((asked.x & extent) != 0) {
      within.x = min(1.0 - within.x, kBelowOne);
      direction.x = -1.0;
    }
    if ((asked.y & extent) != 0) {
      within.y = min(1.0 - within.y, kBelowOne);
      direction.y = -1.0;
    }
  }
  return TexturePlace(texel, within, direction);
}

// The same place in level `level`: its texel, exactly, and where in that, to half a unit of a float below 1.
TexturePlace place_in_level(TexturePlace place, int level) {
  int below = (1 << level) - 1;
  float scale = 1.0 / float(1 << level);
  float x = (float(place.texel.x & below) + place.within.x) * scale;
  float y = (float(place.texel.y & below) + place.within.y) * scale;
  return TexturePlace(ivec2(place.texel.x >> level, place.texel.y >> level),
                      vec2(min(x, kBelowOne), min(y, kBelowOne)), place.direction);
}

// What a pixel covers, in texels of level 0: an ellipse.
struct TextureFootprint {
  vec2 major;    // along its long axis, as long as that
  float lambda;  // level at which a tap covers one texel
  int taps;      // along the long axis
};

// dx, dy: texels of level 0 from pixel to pixel. With one tap the longer of both counts, as it does in hardware; with
// more, the exact axes of the ellipse. Level 0 where there is no derivative; `coarsest` where it is no number.
TextureFootprint texture_footprint(vec2 dx, vec2 dy, int most_taps, int coarsest) {
  float p = dx.x * dx.x + dy.x * dy.x;
  float q = dx.x * dx.y + dy.x * dy.y;
  float r = dx.y * dx.y + dy.y * dy.y;
  if (!(p + r < 1e30)) return TextureFootprint(vec2(0.0), float(coarsest), 1);
  if (!(p + r > 1e-30)) return TextureFootprint(vec2(0.0), -64.0, 1);
  if (most_taps <= 1) {
    float longer = max(dx.x * dx.x + dx.y * dx.y, dy.x * dy.x + dy.y * dy.y);
    return TextureFootprint(vec2(0.0), 0.5 * log2(max(longer, 1e-30)), 1);
  }
  float half_difference = 0.5 * (p - r);
  float a = sqrt(0.5 * (p + r) + sqrt(half_difference * half_difference + q * q));
  float determinant = abs(dx.x * dy.y - dx.y * dy.x);
  float c = determinant / a;
  // Of the two forms of the eigenvector, that which does not cancel.
  vec2 axis = p >= r ? vec2(a * a - r, q) : vec2(q, a * a - p);
  float longest = max(abs(axis.x), abs(axis.y));
  axis = longest > 0.0 ? axis / longest : vec2(1.0, 0.0);
  axis /= sqrt(axis.x * axis.x + axis.y * axis.y);
  float rho = max(c, a / float(most_taps));
  int taps = int(min(ceil(a / rho - 1e-3), float(most_taps)));
  return TextureFootprint(axis * a, log2(max(rho, 1e-15)), taps < 1 ? 1 : taps);
}

// The level that a tap is taken from. bias 0 rounds up, never finer than the pixel asks for; 0.5 to the nearest; 1 down.
int footprint_level(float lambda, float bias, int coarsest) {
  return int(clamp(ceil(lambda - bias), 0.0, float(coarsest)));
}

// Of `taps` along the long axis, where tap i is from the middle, in texels of `level`.
vec2 tap_offset(TextureFootprint footprint, vec2 direction, int i, int level) {
  float along = (float(i) + 0.5) / float(footprint.taps) - 0.5;
  return footprint.major * direction * (along / float(1 << level));
}

// How many taps a border of so many texels has room for: the outermost lies (taps - 1) / 2 steps of rho texels from the
// middle, and its own filter reaches half a texel further. rho is at most 1 if levels are rounded up, 2 if down.
int taps_within_border(int taps, float border, float rho) {
  float most = floor(2.0 * (border - 0.5) / rho + 1.0 + 1e-4);
  return int(clamp(most, 1.0, float(taps)));
}

#endif
