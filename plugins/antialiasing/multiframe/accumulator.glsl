// SPDX-License-Identifier: Apache-2.0
// What an accumulator can hold of a mean, and what a sample weighs in it. Pure functions; README equations (7) to (9) and (12).
#ifndef MULTIFRAME_ACCUMULATOR_GLSL
#define MULTIFRAME_ACCUMULATOR_GLSL

// The parameter `accumulator`.
const uint kRgba8 = 0u;
const uint kRgba16f = 1u;
const uint kRgba16 = 2u;
const uint kRgba32f = 3u;
const uint kFloat32Pair = 4u;
// The parameter `rounding`.
const uint kTruncate = 1u;

const float kLargestHalf = 65504.0;
const float kSmallestNormalHalf = 6.103515625e-05;   // 2^-14
const float kSmallestHalf = 5.9604644775390625e-08;  // 2^-24

// To 11 bits of precision, by the bits; below the normal numbers to multiples of the smallest. Nearest: ties to even.
float round_half(float value, uint rounding) {
  float magnitude = min(abs(value), kLargestHalf);
  if (magnitude < kSmallestNormalHalf) {
    float steps = magnitude / kSmallestHalf;
    return sign(value) * kSmallestHalf * (rounding == kTruncate ? floor(steps) : roundEven(steps));
  }
  uint bits = floatBitsToUint(magnitude);
  if (rounding != kTruncate) bits += 0xfffu + (bits >> 13 & 1u);
  return sign(value) * min(uintBitsToFloat(bits & 0xffffe000u), kLargestHalf);
}

float round_unorm(float value, float steps, uint rounding) {
  float scaled = clamp(value, 0.0, 1.0) * steps;
  return (rounding == kTruncate ? floor(scaled) : roundEven(scaled)) / steps;
}

// Equation (8). Stores then change nothing, whichever way a driver rounds.
vec4 round_stored(vec4 value, uint accumulator, uint rounding) {
  vec4 stored = value;
  for (int i = 0; i < 4; ++i) {
    if (accumulator == kRgba8) stored[i] = round_unorm(value[i], 255.0, rounding);
    if (accumulator == kRgba16) stored[i] = round_unorm(value[i], 65535.0, rounding);
    if (accumulator == kRgba16f) stored[i] = round_half(value[i], rounding);
  }
  return stored;
}

// Equation (7). What integers hold is radiance over white, clipped.
vec4 to_accumulator(vec4 radiance, uint accumulator, float white) {
  if (accumulator != kRgba8 && accumulator != kRgba16) return radiance;
  return clamp(vec4(radiance.rgb / white, radiance.a), 0.0, 1.0);
}
vec4 from_accumulator(vec4 stored, uint accumulator, float white) {
  if (accumulator != kRgba8 && accumulator != kRgba16) return stored;
  return vec4(stored.rgb * white, stored.a);
}

// Equation (12): what was blended are means of samples times weights, and of weights; of samples left out both are 0.
vec4 mean_of_blended(vec4 weighted, float weight) {
  return weight > 0.0 ? weighted / weight : vec4(0.0);
}

// Equation (9), Karis 2014: what is white weighs half of what is black. Never 0: white is at least 1e-5.
float compressed_weight(vec3 radiance, float white) {
  return 1.0 / (1.0 + clamp(dot(radiance, vec3(0.2126, 0.7152, 0.0722)), 0.0, 1e30) / white);
}

#endif
