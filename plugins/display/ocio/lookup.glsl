// SPDX-License-Identifier: Apache-2.0
// Tables of a colour transform in one buffer, looked up as textures would be: clamped, texel centres at (i + 0.5) / size.
// Weights are float32; those of samplers may have 8 bits.
// Needs   vec4 lookup[]
#ifndef HEDDLE_OCIO_LOOKUP_GLSL
#define HEDDLE_OCIO_LOOKUP_GLSL

vec4 lookup_2d(int first, ivec2 size, vec2 uv) {
  vec2 at = clamp(uv * vec2(size) - 0.5, vec2(0.0), vec2(size - 1));
  ivec2 a = ivec2(at);
  ivec2 b = min(a + 1, size - 1);
  vec2 t = at - vec2(a);
  return mix(mix(lookup[first + a.y * size.x + a.x], lookup[first + a.y * size.x + b.x], t.x),
             mix(lookup[first + b.y * size.x + a.x], lookup[first + b.y * size.x + b.x], t.x), t.y);
}

vec4 lookup_2d_nearest(int first, ivec2 size, vec2 uv) {
  ivec2 a = clamp(ivec2(uv * vec2(size)), ivec2(0), size - 1);
  return lookup[first + a.y * size.x + a.x];
}

int lookup_index(int first, int size, ivec3 at) { return first + (at.z * size + at.y) * size + at.x; }

vec4 lookup_3d(int first, int size, vec3 uvw) {
  vec3 at = clamp(uvw * float(size) - 0.5, vec3(0.0), vec3(float(size - 1)));
  ivec3 a = ivec3(at);
  ivec3 b = min(a + 1, ivec3(size - 1));
  vec3 t = at - vec3(a);
  vec4 low = mix(mix(lookup[lookup_index(first, size, a)], lookup[lookup_index(first, size, ivec3(b.x, a.yz))], t.x),
                 mix(lookup[lookup_index(first, size, ivec3(a.x, b.y, a.z))],
                     lookup[lookup_index(first, size, ivec3(b.xy, a.z))], t.x),
                 t.y);
  vec4 high = mix(mix(lookup[lookup_index(first, size, ivec3(a.xy, b.z))],
                      lookup[lookup_index(first, size, ivec3(b.x, a.y, b.z))], t.x),
                  mix(lookup[lookup_index(first, size, ivec3(a.x, b.yz))], lookup[lookup_index(first, size, b)], t.x),
                  t.y);
  return mix(low, high, t.z);
}

vec4 lookup_3d_nearest(int first, int size, vec3 uvw) {
  return lookup[lookup_index(first, size, clamp(ivec3(uvw * float(size)), ivec3(0), ivec3(size - 1)))];
}

// In the tetrahedron of a cell that holds the point: four nodes instead of eight, and greys stay on the diagonal.
// Source  Kasson, Nin, Plouffe and Hafner 1995, "Performing color space conversions with three-dimensional linear
//         interpolation"
// at: position in nodes, [0, size - 1]
vec3 lookup_tetrahedral(int first, int size, vec3 at) {
  ivec3 a = min(ivec3(at), ivec3(size - 2));
  vec3 t = at - vec3(a);
  bool x_first = t.x >= t.y && t.x >= t.z;
  bool y_first = !x_first && t.y >= t.z;
  bool x_last = t.x < t.y && t.x < t.z;
  bool y_last = !x_last && t.y < t.z;
  ivec3 step_most = x_first ? ivec3(1, 0, 0) : y_first ? ivec3(0, 1, 0) : ivec3(0, 0, 1);
  ivec3 step_least = x_last ? ivec3(1, 0, 0) : y_last ? ivec3(0, 1, 0) : ivec3(0, 0, 1);
  float most = max(t.x, max(t.y, t.z));
  float least = min(t.x, min(t.y, t.z));
  float middle = dot(t, vec3(1.0)) - most - least;
  return (1.0 - most) * lookup[lookup_index(first, size, a)].rgb +
         (most - middle) * lookup[lookup_index(first, size, a + step_most)].rgb +
         (middle - least) * lookup[lookup_index(first, size, a + 1 - step_least)].rgb +
         least * lookup[lookup_index(first, size, a + 1)].rgb;
}

#endif
