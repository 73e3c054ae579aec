// SPDX-License-Identifier: Apache-2.0
// A ray against the boxes and triangles of a tree that bvh.hpp made. Pure, also compiled as C++ by tests; whoever has the tree walks it, because only
// its own text sees its buffers:
//   node = 0; while (node < count) { if it misses the box: node = escape; else { test the leaf's triangles; ++node; } }
// Source  Smits 1998, "Efficiency Issues for Ray Tracing" (escape instead of a stack); Woop, Benthin and Wald 2013,
//         "Watertight Ray/Triangle Intersection", JCGT 2(1); Ize 2013, "Robust BVH Ray Traversal", JCGT 2(2);
//         Pharr, Jakob and Humphreys 2016, "Physically Based Rendering", section 3.9 (bounds of rounding)
#ifndef HEDDLE_SHARED_BVH_GLSL
#define HEDDLE_SHARED_BVH_GLSL

// Half a unit in the last place of float32 near 1, and what n roundings come to: gamma_n of Pharr et al.
const float kBvhUlp = 5.9604645e-8;
const float kBvhGamma2 = 2.0 * kBvhUlp * (1.0 + 4.0 * kBvhUlp);
const float kBvhGamma3 = 3.0 * kBvhUlp * (1.0 + 6.0 * kBvhUlp);
const float kBvhGamma5 = 5.0 * kBvhUlp * (1.0 + 10.0 * kBvhUlp);
// Least slope of a ray against an axis: the inverse stays finite, and times any distance below 1e18 m too.
const float kBvhLeastSlope = 1e-20;

struct BvhRay {
  vec3 origin;     // metres, in the tree's frame
  vec3 direction;  // unit
  float reach;     // metres: what lies at or beyond it is not met; finite
  vec3 inverse;    // of the direction, finite
  uint axis;       // the direction's largest component, 0 to 2
  vec3 shear;      // takes the direction to that axis: (x/z, y/z, 1/z) of the turned direction
};

// Cyclically, so that what was `axis` is z.
vec3 bvh_turned(vec3 v, uint axis) {
  return axis == 0u ? vec3(v.y, v.z, v.x) : axis == 1u ? vec3(v.z, v.x, v.y) : v;
}

float bvh_inverse(float slope) {
  return 1.0 / (abs(slope) > kBvhLeastSlope ? slope : slope < 0.0 ? -kBvhLeastSlope : kBvhLeastSlope);
}

BvhRay bvh_ray(vec3 origin, vec3 direction, float reach) {
  vec3 size = abs(direction);
  uint axis = size.x >= size.y && size.x >= size.z ? 0u : size.y >= size.z ? 1u : 2u;
  vec3 turned = bvh_turned(direction, axis);
  return BvhRay(origin, direction, reach,
                vec3(bvh_inverse(direction.x), bvh_inverse(direction.y), bvh_inverse(direction.z)), axis,
                vec3(turned.x / turned.z, turned.y / turned.z, 1.0 / turned.z));
}

// Never false where the exact ray touches the box: Ize's factor covers the roundings.
bool bvh_meets_box(BvhRay ray, vec3 low, vec3 high) {
  vec3 a = (low - ray.origin) * ray.inverse, b = (high - ray.origin) * ray.inverse;
  vec3 enter = min(a, b), leave = max(a, b) * (1.0 + 2.0 * kBvhGamma3);
  float first = max(max(enter.x, enter.y), max(enter.z, 0.0));
  float last = min(min(leave.x, leave.y), min(leave.z, ray.reach));
  return first <= last;
}

struct BvhHit {
  bool is_hit;
  float distance;  // metres
  vec2 weights;    // of the second and the third corner
};

float bvh_largest(float a, float b, float c) { return max(max(abs(a), abs(b)), abs(c)); }

// Both sides. Of triangles that share an edge a ray meets at least one: what it passes exactly through counts for both.
// `uncertain`: metres by which the corners may be off. A triangle that lies, by that and by what rounding does to the
// distance, perhaps not before the origin is not met: nothing shadows the surface that it is part of.
BvhHit bvh_meet_triangle(BvhRay ray, vec3 corner_a, vec3 corner_b, vec3 corner_c, float uncertain) {
  vec3 a = bvh_turned(corner_a - ray.origin, ray.axis);
  vec3 b = bvh_turned(corner_b - ray.origin, ray.axis);
  vec3 c = bvh_turned(corner_c - ray.origin, ray.axis);
  // precise: neighbours that share an edge must find the same number for it, with the sign turned.
  precise float ax = a.x - ray.shear.x * a.z, ay = a.y - ray.shear.y * a.z;
  precise float bx = b.x - ray.shear.x * b.z, by = b.y - ray.shear.y * b.z;
  precise float cx = c.x - ray.shear.x * c.z, cy = c.y - ray.shear.y * c.z;
  precise float u = cx * by - cy * bx;
  precise float v = ax * cy - ay * cx;
  precise float w = bx * ay - by * ax;
  precise float sum = u + v + w;
  bool is_inside = !((u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0)) && sum != 0.0;
  float inverse_sum = is_inside ? 1.0 / sum : 0.0;
  float az = ray.shear.z * a.z, bz = ray.shear.z * b.z, cz = ray.shear.z * c.z;
  float distance = (u * az + v * bz + w * cz) * inverse_sum;

  // Pharr et al., equation (3.14) and the code that follows it.
  float size_x = bvh_largest(ax, bx, cx), size_y = bvh_largest(ay, by, cy), size_z = bvh_largest(az, bz, cz);
  float delta_z = kBvhGamma3 * size_z;
  float delta_x = kBvhGamma5 * (size_x + size_z), delta_y = kBvhGamma5 * (size_y + size_z);
  float delta_e = 2.0 * (kBvhGamma2 * size_x * size_y + delta_y * size_x + delta_x * size_y);
  float size_e = bvh_largest(u, v, w);
  float delta = 3.0 * (kBvhGamma3 * size_e * size_z + delta_e * size_z + delta_z * size_e) * abs(inverse_sum);
  // Corners that are off by `uncertain` move the plane by no more; along the ray it is that over the cosine between ray
  // and normal, which is |sum| |z of the direction| / |normal|.
  float normal_length = length(cross(corner_b - corner_a, corner_c - corner_a));
  delta += uncertain * normal_length * abs(inverse_sum * ray.shear.z);
  return BvhHit(is_inside && distance > delta && distance < ray.reach, distance, vec2(v, w) * inverse_sum);
}

#endif
