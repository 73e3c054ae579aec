// SPDX-License-Identifier: Apache-2.0
// A surface and its textures, every light, the environment -> radiance towards the camera.
// in      surface, material and textures; visibility  ambient occlusion, nearest
//         camera, lights
// out     radiance  rgb cd/m^2, a 1
// params  precision  0 float16, 1 float32
#include "pass.glsl"
#include "constants.glsl"
#include "shade_surface.glsl"
#include "surface_sample.glsl"
#include "view.glsl"

void main() {
  HeddleMaterial properties = materials[surface.material];
  SurfaceSample s = sample_surface(properties);
  if (is_hole(properties, s.alpha)) discard;
  vec3 sum;
  if (s.is_unlit) {
    sum = clamp(s.base_color, 0.0, 1.0);
  } else {
    vec3 V = direction_to_view(camera, surface.position_rel);
    float open = clamp(fetch_visibility(ivec2(gl_FragCoord.xy)).r, 0.0, 1.0) * clamp(s.occlusion, 0.0, 1.0);
    sum = s.emissive + shade_surface(surface_point(s), gl_FragCoord.xy, surface.position_rel,
                                     normal_towards_viewer(s.normal, V), s.normal_geometric, V, open);
  }
  radiance = vec4(clamp(sum, 0.0, params.precision_ == 0u ? kMaxHalf : kMaxFloat), 1.0);
}
