// SPDX-License-Identifier: Apache-2.0
// Numbers that more than one shader needs, each with its parents.
#ifndef HEDDLE_SHARED_CONSTANTS_GLSL
#define HEDDLE_SHARED_CONSTANTS_GLSL

const float kPi = 3.14159265358979324;         // circumference / diameter
const float kTwoPi = 6.28318530717958648;      // 2 kPi
const float kHalfPi = 1.57079632679489662;     // kPi / 2
const float kInversePi = 0.318309886183790672; // 1 / kPi: albedo of a Lambertian surface to its BRDF
const float kMaxFloat = 3.40282346638528860e38;  // (2 - 2^-23) 2^127, the largest finite float32
const float kMaxHalf = 65504.0;                // (2 - 2^-10) 2^15, the largest finite float16

// +Inf, as `depth` holds it where there is no surface. A function: 1/0 is no constant expression everywhere.
float positive_infinity() { return uintBitsToFloat(0x7f800000u); }

// Rec.709 luminance of linear Rec.709 colour (ITU-R BT.709-6, 2015, item 3.2).
float luminance(vec3 color) { return dot(color, vec3(0.2126, 0.7152, 0.0722)); }

#endif
