// SPDX-License-Identifier: Apache-2.0
// Occlusion of two sets, perhaps of fewer pixels -> visibility of every pixel.
// Source  Filion and McNaughton 2008, "Effects & Techniques": the darker of the sets; Kopf, Cohen, Lischinski and
//         Uyttendaele 2007, "Joint Bilateral Upsampling"; README equations (8) and (9)
// in      depth, normal_geometric  of the pixels
//         noisy                    layer push.source; x, y occlusion of the sets
// out     visibility               r16   1 open, 0 closed; 1 where there is no surface
// loops   2 x 2
#include "pass.glsl"
#include "octahedral.glsl"
#include "view.glsl"
#include "ssao.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(push_constant) uniform Push { int source; } push;

vec3 normal_view(ivec2 full) { return mat3(camera.view_from_rel) * decode_octahedral(fetch_normal_geometric(full).xy); }

// The four pixels of the reduced image around this one, by distance and by how well they lie on its surface. Weights fall
// off fast but never to 0: where none lies on the surface, as around thin things, all four share, and no block shows.
vec2 upsampled(ivec2 pixel, float depth) {
  vec3 position = position_view_from_depth(camera, pixel_center(pixel), depth);
  vec3 n = normal_view(pixel);
  float divisor = float(constant_evaluate_divisor);
  float tolerance = pixel_size_at_depth(camera, depth) * divisor;
  vec2 place = (vec2(pixel - constant_evaluate_divisor / 2)) / divisor;
  ivec2 first = ivec2(floor(place));
  vec2 sum = vec2(0.0);
  float weights = 0.0;
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 2; ++x) {
      ivec2 reduced = first + ivec2(x, y);
      vec2 tent = max(vec2(0.0), 1.0 - abs(place - vec2(reduced)));
      reduced = clamp(reduced, ivec2(0), size_noisy() - 1);
      ivec2 full = representative(reduced, constant_evaluate_divisor, size_depth());
      float full_depth = fetch_depth(full).x;
      if (is_background(full_depth)) continue;
      vec3 offset = position_view_from_depth(camera, pixel_center(full), full_depth) - position;
      float weight = tent.x * tent.y * same_surface(dot(offset, n) / tolerance, dot(n, normal_view(full)));
      sum += weight * fetch_noisy(reduced, push.source).xy;
      weights += weight;
    }
  }
  return weights > 0.0 ? sum / weights : vec2(0.0);
}

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_visibility()))) return;
  float depth = fetch_depth(pixel).x;
  if (is_background(depth)) {
    imageStore(visibility, pixel, vec4(1.0));
    return;
  }
  vec2 both = constant_evaluate_divisor > 1 ? upsampled(pixel, depth) : fetch_noisy(pixel, push.source).xy;
  float open = clamp(1.0 - max(both.x, both.y), 0.0, 1.0);
  imageStore(visibility, pixel, vec4(open > 0.0 ? pow(open, params.contrast) : 0.0));
}
