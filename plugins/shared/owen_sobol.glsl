// SPDX-License-Identifier: Apache-2.0
// Number of a point -> the point of the first two Sobol dimensions, scrambled. Pure, also compiled as C++ by tests.
// Source  Sobol 1967; Owen 1995 (nested uniform scrambling); Burley 2020, "Practical Hash-based Owen Scrambling", JCGT 9(4),
//         with the multipliers of Vegdahl 2021, "Building a Better LK Hash"; PCG: Jarzynski and Olano 2020, "Hash Functions
//         for GPU Rendering", JCGT 9(3)
#ifndef HEDDLE_SHARED_OWEN_SOBOL_GLSL
#define HEDDLE_SHARED_OWEN_SOBOL_GLSL

// Three words, of which each bit of the answer depends on all (pcg3d).
uvec3 mix_words(uvec3 v) {
  v = v * 1664525u + 1013904223u;
  v.x += v.y * v.z;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v ^= v >> 16u;
  v.x += v.y * v.z;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  return v;
}

// A bit changes only those below it: the scrambling of all, by a hash of `seed`.
uint scramble_owen(uint bits, uint seed) {
  bits = bitfieldReverse(bits);
  bits ^= bits * 0x3d20adeau;
  bits += seed;
  bits *= (seed >> 16u) | 1u;
  bits ^= bits * 0x05526c56u;
  bits ^= bits * 0x53a22864u;
  return bitfieldReverse(bits);
}

// The second dimension belongs to x + 1: its matrix is Pascal's triangle modulo 2, whose entry (i, j) is 1 where the bits
// of i are among those of j (Lucas 1878), so five folds do it.
uint sobol_second(uint index) {
  index ^= (index >> 1u) & 0x55555555u;
  index ^= (index >> 2u) & 0x33333333u;
  index ^= (index >> 4u) & 0x0f0f0f0fu;
  index ^= (index >> 8u) & 0x00ff00ffu;
  index ^= (index >> 16u) & 0x0000ffffu;
  return bitfieldReverse(index);
}

// In [0, 1)^2: the middle of one of 2^23 intervals, as fine as float32 tells apart.
vec2 owen_sobol_point(uint index, uvec2 seed) {
  uvec2 bits = uvec2(scramble_owen(bitfieldReverse(index), seed.x), scramble_owen(sobol_second(index), seed.y));
  return (vec2(bits >> 9u) + 0.5) * 1.1920929e-7;
}

#endif
