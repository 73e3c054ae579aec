// SPDX-License-Identifier: Apache-2.0
// An element, a direction and a depth map's texel -> whether the direction is open. Pure, and compiled as C++ too: the
// pipeline that compares on the CPU gives the same bits (so literals are float32 in both). README equations (3) to (5).
#ifndef HEDDLE_BAKE_DEPTH_TEST_GLSL
#define HEDDLE_BAKE_DEPTH_TEST_GLSL
#include "params.h"

// Clip coordinates of a position, by a row of the matrix that the map was drawn with.
float project(vec4 row, vec4 position) {
  precise float sum = row.x * position.x + row.y * position.y;
  sum = sum + row.z * position.z;
  sum = sum + row.w;
  return sum;
}

float cosine(vec4 normal, vec4 direction) {
  precise float sum = normal.x * direction.x + normal.y * direction.y;
  sum = sum + normal.z * direction.z;
  return sum;
}

// The texel of a map of `side` texels that a clip coordinate falls into; outside of the map: -1 or `side`.
int texel_of(float clip, int side) {
  precise float texel = (clip * 0.5f + 0.5f) * float(side);
  texel = floor(texel);
  return int(texel < -1.0f ? -1.0f : (texel > float(side) ? float(side) : texel));
}

// h: N.s > 0, N of the surface itself. Reversed depth: nearer to the light is larger.
float depth_bias(float h, float slope, float constant_part, float limit) {
  precise float rest = 1.0f - h * h;
  precise float tangent = sqrt(rest > 0.0f ? rest : 0.0f) / h;
  if (limit > 0.0f && tangent > limit) tangent = limit;
  precise float bias = slope * tangent + constant_part;
  return bias;
}

bool is_open(float element_depth, float map_depth, float bias, float steps) {
  precise float stored = map_depth;
  if (steps > 0.0f) {
    // Not floor(x + 0.5): with 24 bits of steps the sum has no room for a half.
    precise float scaled = map_depth * steps;
    float whole = floor(scaled);
    stored = (scaled - whole >= 0.5f ? whole + 1.0f : whole) / steps;
  }
  precise float reach = element_depth + bias;
  return reach >= stored;
}

// A weight as the ramp holds it: 8 bits, in halves of 4.
int weight_code(float h) {
  return int(floor(h * 255.0f + 0.5f));
}

#endif
