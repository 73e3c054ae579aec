// SPDX-License-Identifier: Apache-2.0
// A grid of (NoL along x, perceptual roughness along y) -> what surface_material answers there.
#include "pass.glsl"
#include "role/surface_material.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_values()))) return;
  vec2 uv = (vec2(pixel) + 0.5) / vec2(size_values());
  SurfacePoint point = SurfacePoint(params.base_color, params.metalness, uv.y, params.ior);
  vec3 N = vec3(0.0, 0.0, 1.0);
  vec3 V = vec3(sqrt(1.0 - params.n_dot_v * params.n_dot_v), 0.0, params.n_dot_v);
  float sine = sqrt(1.0 - uv.x * uv.x);
  vec3 L = vec3(sine * cos(params.azimuth), sine * sin(params.azimuth), uv.x);
  vec3 answer = params.answer == 3u ? surface_material_environment(point, N, V, vec3(3.14159265), vec3(1.0))
                                    : surface_material_lobe(point, N, V, L, params.answer);
  if (params.answer == 0u) answer = surface_material(point, N, V, L);
  imageStore(values, pixel, vec4(answer, 1.0));
}
