// SPDX-License-Identifier: Apache-2.0
// The cube of mean radiance and the brightest texels -> radiance averaged over GGX lobes, a cube for each roughness.
// README equations (2) to (5).
// in      mean_radiance  cube with mips, without what `brightest` holds; brightest  a list a level: direction, irradiance
// out     specular       layer 6 level + face; level i has roughness (i + 1) / levels
// threads 8x8x1, one a texel; loops over `samples` (<= 4096) and the level's brightest (<= 1024)
#include "pass.glsl"
#include "cube.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec3 texel = ivec3(gl_GlobalInvocationID);
  ivec2 size = size_specular();
  if (texel.x >= size.x || texel.y >= size.y) return;
  vec2 p = (vec2(texel.xy) + 0.5) * 2.0 / vec2(size) - 1.0;
  mat3 basis = basis_around(normalize(cube_direction(texel.z % 6, p)));
  float roughness = float(texel.z / 6 + 1) / float(params.levels);
  float alpha = roughness * roughness;
  uint count = uint(params.samples);
  // A texel of the finest mip is 4 pi / 6 n^2 steradians.
  float finest = float(size_mean_radiance().x);
  float texels_per_steradian = finest * finest * (6.0 / (4.0 * 3.14159265358979324));

  vec3 sum = vec3(0.0);
  float weights = 0.0;
  for (uint i = 0u; i < count; ++i) {
    vec2 u = hammersley(i, count);
    float NoH2 = (1.0 - u.x) / (1.0 + (alpha * alpha - 1.0) * u.x);
    float NoL = 2.0 * NoH2 - 1.0;
    if (NoL <= 0.0) continue;
    float sine = sqrt(max(1.0 - NoL * NoL, 0.0));
    float angle = 6.28318530717958648 * u.y;
    vec3 L = basis * vec3(sine * cos(angle), sine * sin(angle), NoL);
    // (4) The share of the sphere that this sample stands for.
    float lod = 0.5 * log2(texels_per_steradian / (float(count) * pdf_mirror_lobe(NoL, alpha)));
    sum += NoL * textureLod(mean_radiance, L, max(lod, 0.0)).rgb;
    weights += NoL;
  }
  sum /= max(weights, 1e-6);

  // (5) What is too bright for samples, each exactly.
  float scale = 1.0 / mean_NoL(alpha);
  int level = texel.z / 6;
  for (uint i = brightest_first[level]; i < brightest_first[level + 1]; ++i) {
    float NoL = dot(brightest[2u * i].xyz, basis[2]);
    sum += brightest[2u * i + 1u].rgb * (pdf_mirror_lobe(NoL, alpha) * max(NoL, 0.0) * scale);
  }
  imageStore(specular, texel, vec4(sum, 1.0));
}
