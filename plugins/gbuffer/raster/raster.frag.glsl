// SPDX-License-Identifier: Apache-2.0
// The nearest surface at a pixel -> its data in seven images.
// in      surface, material and textures
// out     depth metres; normal, normal_geometric octahedral, world axes; base_color linear, a 1 lit 0 unlit;
//         material metalness, roughness, occlusion, (ior - 1) / 2; emissive cd/m^2; motion pixels
// params  precision  0 packed, 1 float32
#include "pass.glsl"
#include "octahedral.glsl"
#include "surface_sample.glsl"
#include "view.glsl"

// Previous minus current position in the image, neither jittered; 0 where the point was behind the camera. Both are
// rounded alike, in the same steps: what stands still has moved by exactly 0.
vec2 motion_px() {
  precise vec4 before = view.previous_clip_from_rel * vec4(surface.previous_position_rel, 1.0);
  if (before.w <= 0.0) return vec2(0.0);
  precise vec4 now = view.clip_from_rel * vec4(surface.position_rel, 1.0);
  precise vec2 previous_px = before.xy / before.w * (0.5 * vec2(view.extent));
  precise vec2 current_px = now.xy / now.w * (0.5 * vec2(view.extent));
  return clamp(previous_px - current_px + view.jitter, -kMaxHalf, kMaxHalf);
}

void main() {
  HeddleMaterial properties = materials[surface.material];
  SurfaceSample s = sample_surface(properties);
  if (is_hole(properties, s.alpha)) discard;
  // 1/w is interpolated once; the position would be once more divided.
  float distance = view.is_orthographic != 0u ? depth_from_position_rel(view, surface.position_rel)
                                              : 1.0 / gl_FragCoord.w;
  depth = vec4(distance, 0.0, 0.0, 1.0);
  normal = vec4(encode_octahedral(s.normal), 0.0, 1.0);
  normal_geometric = vec4(encode_octahedral(s.normal_geometric), 0.0, 1.0);
  base_color = vec4(clamp(s.base_color, 0.0, 1.0), s.is_unlit ? 0.0 : 1.0);
  material = vec4(clamp(vec4(s.metalness, s.roughness, s.occlusion, 0.5 * (s.ior - 1.0)), 0.0, 1.0));
  emissive = vec4(s.is_unlit ? vec3(0.0) : min(s.emissive, params.precision_ == 0u ? kMaxHalf : kMaxFloat), 1.0);
  motion = vec4(motion_px(), 0.0, 1.0);
}
