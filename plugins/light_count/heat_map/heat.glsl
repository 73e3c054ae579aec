// SPDX-License-Identifier: Apache-2.0
// A number of lights -> a colour that eyes can order. Pure. README, "Method".
#ifndef HEDDLE_HEAT_MAP_HEAT_GLSL
#define HEDDLE_HEAT_MAP_HEAT_GLSL

// Each step is a ratio of 1.5; bins begin at 1, 2, 3, 4, 6, 9, 13 ... lights.
const float kHeatSteps = 16.0;

// 0 black, then blue, green, yellow, red, white: the bins in order.
vec3 heat(uint count) {
  if (count == 0u) return vec3(0.0);
  float t = clamp(log2(float(count)) / (kHeatSteps * 0.5849625), 0.0, 1.0);  // log2(1.5)
  vec3 rising = clamp(vec3(4.0 * t - 1.0, 4.0 * t, 4.0 * t - 3.0), 0.0, 1.0);
  vec3 falling = clamp(vec3(1.0, 4.0 - 4.0 * t, 1.0), 0.0, 1.0);
  vec3 color = rising * falling;
  color.b = max(color.b, clamp(1.0 - 4.0 * t, 0.0, 1.0));
  return t >= 1.0 ? vec3(1.0) : color;
}

#endif
