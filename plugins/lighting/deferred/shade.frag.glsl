// SPDX-License-Identifier: Apache-2.0
// The gbuffer at a pixel, every light, the environment -> radiance towards the camera. README equations (1) to (6).
// in      depth, normal, normal_geometric, base_color, material, emissive, visibility   gbuffer and occlusion, nearest
//         camera, lights
// out     radiance  rgb cd/m^2, a 1 where there is a surface
// params  precision  0 float16, 1 float32
#include "pass.glsl"
#include "octahedral.glsl"
#include "shade_surface.glsl"
#include "view.glsl"

void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  float depth_here = fetch_depth(pixel).r;
  if (is_background(depth_here)) {
    vec3 background = sky_radiance(view_ray(camera, gl_FragCoord.xy));
    radiance = vec4(clamp(background, 0.0, params.precision_ == 0u ? kMaxHalf : kMaxFloat), 0.0);
    return;
  }
  vec3 position_rel = position_rel_from_depth(camera, gl_FragCoord.xy, depth_here);
  vec3 V = direction_to_view(camera, position_rel);
  vec3 N = normal_towards_viewer(decode_octahedral(fetch_normal(pixel).xy), V);
  vec3 normal = decode_octahedral(fetch_normal_geometric(pixel).xy);

  vec4 base = fetch_base_color(pixel);
  vec4 stored = fetch_material(pixel);
  vec3 sum = fetch_emissive(pixel).rgb;
  if (base.a < 0.5) {
    sum += base.rgb;
  } else {
    SurfacePoint point = SurfacePoint(base.rgb, stored.r, stored.g, 1.0 + 2.0 * stored.a);
    float open = clamp(fetch_visibility(pixel).r, 0.0, 1.0) * stored.b;
    sum += shade_surface(point, gl_FragCoord.xy, position_rel, N, normal, V, open);
  }
  radiance = vec4(clamp(sum, 0.0, params.precision_ == 0u ? kMaxHalf : kMaxFloat), 1.0);
}
