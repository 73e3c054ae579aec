// SPDX-License-Identifier: Apache-2.0
// The equations of occlusion by point samples, README (1) to (9): pure functions, also compiled as C++ by the tests.
#ifndef HEDDLE_SSAO_GLSL
#define HEDDLE_SSAO_GLSL

// The values of choices, in the order of pass.cpp.
const uint kFalloffNone = 0u;
const uint kFalloffLinear = 1u;
const uint kFalloffPower = 2u;
const uint kFalloffQuadratic = 3u;
const uint kFalloffCurve = 4u;
const uint kHemisphereFlip = 0u;
const uint kHemisphereBasis = 1u;
const uint kRandomizeReflect = 0u;
const uint kRandomizeRotate = 1u;
const uint kDepthPoint = 0u;
const uint kDepthMean = 1u;
const uint kDepthMax = 2u;
const uint kDepthMin = 3u;
const uint kDepthCheckerboard = 4u;
const uint kDepthMedian = 5u;
const uint kBlurSeparable = 0u;
const uint kBlurSquare = 1u;
const uint kBlurPlain = 2u;
const uint kLimitRadius = 0u;
const uint kLimitSamples = 1u;

// Stands for "no surface" in the reduced depth: finite, because bilinear fetches would make NaN of Inf - Inf.
const float kNoSurface = 1e30;
const float kNoSurfaceHalf = 65504.0;

// A sample set's share of the curve (3), metres.
struct OcclusionCurve {
  float full;   // depth difference up to which a sample is occluded fully
  float range;  // ... from which on it is not occluded at all
  float power;
};

// Equation (1). The length stays; a zero vector r, as coarse formats may hold, leaves the sample as it is.
vec3 reflect_offset(vec3 offset, vec3 r) {
  return offset - 2.0 * dot(offset, r) * r / max(dot(r, r), 1e-12);
}

// The rival of (1): rotation by a quaternion, normalized here.
vec3 rotate_offset(vec3 offset, vec4 quaternion) {
  vec4 q = quaternion * inversesqrt(max(dot(quaternion, quaternion), 1e-12));
  vec3 axis = vec3(q);
  return offset + 2.0 * cross(axis, cross(axis, offset) + q.w * offset);
}

// Equation (2): the half of the samples that lies inside the surface is mirrored out of it.
vec3 flip_offset(vec3 offset, vec3 n) { return dot(offset, n) < 0.0 ? -offset : offset; }

// The rival of (2): samples of the hemisphere around +Z, in a basis around n turned by r.
vec3 basis_offset(vec3 offset, vec3 n, vec3 r) {
  vec3 across = r - n * dot(n, r);
  vec3 other = abs(n.x) < 0.5 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0);
  across = dot(across, across) > 1e-6 ? across : other - n * dot(n, other);
  vec3 tangent = normalize(across);
  return offset.x * tangent + offset.y * cross(n, tangent) + offset.z * n;
}

// Piecewise linear through seven even nodes over [0, 1]; the last one is 0.
float curve_at(float x, vec3 near, vec3 far) {
  float at = clamp(x, 0.0, 1.0) * 6.0;
  vec3 hat_near = max(vec3(0.0), 1.0 - abs(at - vec3(0.0, 1.0, 2.0)));
  vec3 hat_far = max(vec3(0.0), 1.0 - abs(at - vec3(3.0, 4.0, 5.0)));
  return dot(near, hat_near) + dot(far, hat_far);
}

// Equation (3): how much a sample is occluded that lies `behind` metres behind the visible surface.
float occlusion(uint falloff, float behind, OcclusionCurve curve, vec3 near, vec3 far) {
  if (!(behind > 0.0)) return 0.0;
  float full = min(curve.full, curve.range);
  if (falloff == kFalloffNone) return behind <= curve.range ? 1.0 : 0.0;
  if (falloff == kFalloffPower && behind <= full) return 1.0;
  if (behind >= curve.range) return 0.0;
  float left = 1.0 - behind / curve.range;
  if (falloff == kFalloffLinear) return left;
  if (falloff == kFalloffCurve) return curve_at(behind / curve.range, near, far);
  if (falloff == kFalloffQuadratic) {
    float x = behind / max(full, 1e-3 * curve.range);
    return 1.0 / (1.0 + x * x);
  }
  return pow(clamp((curve.range - behind) / (curve.range - full), 0.0, 1.0), max(curve.power, 1e-3));
}

// Equation (4): the occluder of a sample above the tangent plane is above that plane, as is the whole line from the
// sample to the eye. What the image shows below it stands in for another place: a neighbouring pixel of a slope.
// The slack covers what rounding of 16-bit normals and float32 positions feigns.
bool is_above_plane(vec3 to_surface, vec3 n, float depth) {
  const float kSlackPerLength = 1.0 / 1024.0;
  const float kSlackPerDepth = 1.0 / 1048576.0;
  return dot(to_surface, n) > kSlackPerLength * sqrt(dot(to_surface, to_surface)) + kSlackPerDepth * depth;
}

// Equation (5): by what a radius is scaled so that it covers at most most_px pixels.
float footprint_scale(float radius_px, float most_px) { return min(1.0, most_px / max(radius_px, 1e-6)); }

// The rival of (5): as many times the samples as the footprint is too wide, at most four.
int samples_for_footprint(int samples, float radius_px, float most_px) {
  return samples * int(clamp(ceil(radius_px / most_px), 1.0, 4.0));
}

// The pixel that a pixel of an image reduced by `divisor` stands for.
ivec2 representative(ivec2 reduced, int divisor, ivec2 size) {
  return min(reduced * divisor + divisor / 2, size - 1);
}

// Of four depths the farther one of the middle two: always one that is there.
float median_depth(vec4 depths) {
  float low_a = min(depths.x, depths.y), high_a = max(depths.x, depths.y);
  float low_b = min(depths.z, depths.w), high_b = max(depths.z, depths.w);
  return max(min(high_a, high_b), max(low_a, low_b));
}

// Equation (6)
float gaussian(float x, float sigma) { return exp(-0.5 * x * x / (sigma * sigma)); }

// Equation (7): whether a neighbour belongs to the surface of the pixel: its distance off the pixel's plane, or by the
// depth alone.
float is_same_plane(vec3 offset, vec3 n, float tolerance) { return abs(dot(offset, n)) <= tolerance ? 1.0 : 0.0; }
float is_same_depth(float difference, float tolerance) { return abs(difference) <= tolerance ? 1.0 : 0.0; }
float is_same_normal(vec3 a, vec3 b, float least_cosine) { return dot(a, b) >= least_cosine ? 1.0 : 0.0; }

// Of equation (9): smooth, unlike (7), because a hard edge would show as a step of the reduced pixels. off_plane is in
// units of what a reduced pixel cannot tell apart.
float same_surface(float off_plane, float cosine) {
  float x = min(abs(off_plane), 1000.0);  // x^4 and its inverse stay in range
  float facing = max(cosine, 0.05);
  return facing * facing / (1.0 + x * x * x * x);
}

#endif
