// SPDX-License-Identifier: Apache-2.0
// A blended surface, every light, the environment -> what it adds and what it lets through. README equations (1) to (4).
// in      surface, material and textures; camera, lights
// out     radiance       rgb cd/m^2 that the surface itself sends, times its coverage; a coverage
//         radiance_tint  rgb share of what is behind that shows; a 1 - coverage
#include "pass.glsl"
#include "constants.glsl"
#include "shade_surface.glsl"
#include "surface_sample.glsl"
#include "view.glsl"

layout(push_constant) uniform Push {
  float largest;  // finite value of radiance's format
} push;

// (3) Share of light that the specular layer leaves to what is below: a black dielectric shows that layer alone.
float left_by_specular(SurfacePoint point, vec3 N, vec3 V) {
  point.base_color = vec3(0.0);
  point.metalness = 0.0;
  return clamp(1.0 - surface_material_environment(point, N, V, vec3(kPi), vec3(1.0)).r, 0.0, 1.0);
}

void main() {
  HeddleMaterial properties = materials[surface.material];
  SurfaceSample s = sample_surface(properties);
  // Only BLEND means coverage: an opaque or masked material that transmits covers all that it does not leave open.
  bool is_covering = properties.alpha_mode != HEDDLE_ALPHA_BLEND;
  float coverage = is_covering ? 1.0 : clamp(s.alpha, 0.0, 1.0);
  if (is_hole(properties, s.alpha) || coverage == 0.0) discard;
  vec3 sum;
  vec3 through = vec3(0.0);
  if (s.is_unlit) {
    sum = clamp(s.base_color, 0.0, 1.0);
  } else {
    SurfacePoint point = surface_point(s);
    vec3 V = direction_to_view(camera, surface.position_rel);
    vec3 N = normal_towards_viewer(s.normal, V);
    float transmission = clamp(properties.transmission, 0.0, 1.0) * (1.0 - point.metalness);
    if (transmission > 0.0) {
      through = transmission * point.base_color * left_by_specular(point, N, V);  // (2)
      point.base_color *= 1.0 - transmission;                                     // (4)
    }
    sum = s.emissive + shade_surface(point, gl_FragCoord.xy, surface.position_rel, N, s.normal_geometric, V,
                                     clamp(s.occlusion, 0.0, 1.0));
  }
  // (1) Infinity times the next layer's tint of 0 would be NaN.
  radiance = vec4(clamp(coverage * sum, 0.0, push.largest), coverage);
  radiance_tint = vec4(coverage * through + (1.0 - coverage), 1.0 - coverage);
}
