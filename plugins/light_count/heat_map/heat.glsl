// SPDX-License-Identifier: Apache-2.0
// A number of lights -> a colour that eyes can order. Pure. README, "Method".
#ifndef HEDDLE_HEAT_MAP_HEAT_GLSL
#define HEDDLE_HEAT_MAP_HEAT_GLSL

// Red, the end of the scale: bins in a ratio of 1.5 come to 1.5^16.
const float kHeatMost = 656.8408;

// 0 black, 1 blue, 5 cyan, 26 green, 130 yellow, kHeatMost red, above white; even steps of the logarithm.
vec3 heat(uint count) {
  if (count == 0u) return vec3(0.0);
  float t = log2(float(count)) / log2(kHeatMost);
  if (t > 1.0) return vec3(1.0);
  return clamp(vec3(4.0 * t - 2.0, min(4.0 * t, 4.0 - 4.0 * t), 2.0 - 4.0 * t), 0.0, 1.0);
}

#endif
