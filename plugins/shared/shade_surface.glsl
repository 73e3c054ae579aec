// SPDX-License-Identifier: Apache-2.0
// A surface point, every light and the environment -> radiance towards the viewer: one text for all passes that light
// surfaces, so that they agree. After pass.glsl of a shader that has the ports `lights` and `light_textures` and calls
// light_assignment, surface_material, shadow and sky. Equations (1) to (9) of lighting/deferred's README.
// One iteration a light that light_assignment lets it meet (without a technique of that role every light), and for one
// with a texture up to 450 more: 32 taps, each past up to 11 levels. A driver that ends loops after 65,535 iterations
// (lavapipe) allows 65,535 of them less what the shadow techniques loop: with 32 taps a
// light, 1985 lights.
#ifndef HEDDLE_SHARED_SHADE_SURFACE_GLSL
#define HEDDLE_SHARED_SHADE_SURFACE_GLSL
#include "role/light_assignment.glsl"
#include "role/surface_material.glsl"
#include "role/shadow.glsl"
#include "role/sky.glsl"
#include "area_light.glsl"
#include "light.glsl"

// The narrowest lobe that area lights widen: surface_material clamps alpha there as well.
const float kShadeMinimumAlpha = 1e-3;

// (1) A light without size, or with one that only widens the lobe (the sun's disc).
vec3 shade_point_light(HeddleLight light, LightArrival arrival, SurfacePoint point, vec3 N, vec3 V) {
  if (light.type == HEDDLE_LIGHT_DIRECTIONAL && light.radius > 0.0) {
    float sine = sin(min(light.radius, kHalfPi));
    float alpha = max(point.roughness * point.roughness, kShadeMinimumAlpha);
    float VoH = sqrt(max(0.5 + 0.5 * dot(V, arrival.direction), 0.0));
    point.roughness = min(sqrt(alpha * inversesqrt(widening(alpha, sine * sine, VoH))), 1.0);
  }
  return surface_material(point, N, V, arrival.direction) * arrival.irradiance *
         max(dot(N, arrival.direction), 0.0);
}

// (9) A rectangle's texture: its mean around uv (top row first) over a part `face_size` of the whole, between two levels.
vec3 fetch_light_texture(uint texture_number, vec2 uv, vec2 face_size) {
  uvec4 head = floatBitsToUint(light_textures[texture_number - 1u]);  // HeddleLightTexture
  uint first = head.x;
  uvec2 size = head.yz;
  vec2 texels = face_size * vec2(size);
  float lod = min(log2(max(max(texels.x, texels.y), 1.0)), float(head.w - 1u));
  uint level = uint(lod);
  for (uint i = 0u; i < level; ++i) {
    first += size.x * size.y;
    size = max(size >> 1u, uvec2(1u));
  }
  vec3 mean[2];
  for (uint i = 0u; i < 2u; ++i) {
    vec2 at = clamp(uv * vec2(size) - 0.5, vec2(0.0), vec2(size - 1u));
    uvec2 low = uvec2(at);
    uvec2 high = min(low + 1u, size - 1u);
    vec2 t = at - vec2(low);
    // a + (b - a) t: of equals exactly the same.
    vec3 a = light_textures[first + low.y * size.x + low.x].rgb, b = light_textures[first + low.y * size.x + high.x].rgb;
    vec3 c = light_textures[first + high.y * size.x + low.x].rgb, d = light_textures[first + high.y * size.x + high.x].rgb;
    vec3 above = a + (b - a) * t.x, below = c + (d - c) * t.x;
    mean[i] = above + (below - above) * t.y;
    if (level + 1u < head.w) {
      first += size.x * size.y;
      size = max(size >> 1u, uvec2(1u));
    }
  }
  return mean[0] + (mean[1] - mean[0]) * (lod - float(level));
}

struct FaceMeans {
  vec3 diffuse, specular;
};

// What the two lobes see of a rectangle's texture, as factors of its intensity; 1 without a texture. Each lobe's part of
// the face in 4 x 4 cells, each weighed by what its middle sends into the lobe.
FaceMeans face_means(HeddleLight light, vec3 position_rel, SurfacePoint point, vec3 N, vec3 V, vec3 L, float alpha) {
  FaceView view = face_view(light, position_rel, N);
  vec2 half_extent = light.half_extent.xy;
  FaceBox boxes[2] = FaceBox[2](face_box(view, brightest_on_face(view), half_extent, 1.5),
                                specular_face_box(light, view, L, alpha));
  vec3 y_axis = light_bitangent(light);
  vec3 means[2] = vec3[2](vec3(1.0), vec3(1.0));
  vec3 sum = vec3(0.0), low = vec3(kMaxFloat), high = vec3(0.0);
  float weights = 0.0;
  // A loop, so that lights without a texture pass over it.
  uint taps = light.texture != 0u ? 32u : 0u;
  for (uint i = 0u; i < taps; ++i) {
    uint lobe = i >> 4u;
    vec2 size = (boxes[lobe].high - boxes[lobe].low) * 0.25;
    vec2 q = boxes[lobe].low + size * (vec2(i & 3u, (i >> 2u) & 3u) + 0.5);
    vec3 offset = vec3(q - view.foot, view.height);
    float distance_squared = max(dot(offset, offset), 1e-30);
    vec3 local = offset * inversesqrt(distance_squared);
    vec3 L_tap = local.x * light.tangent + local.y * y_axis - local.z * light.direction;
    float NoL = max(dot(N, L_tap), 0.0);
    float sent = lobe == 0u ? NoL : NoL * luminance(surface_material_lobe(point, N, V, L_tap, 2u));
    // Over the plane's nearest point: a number without unit. What lies below the horizon on the whole is a plain mean.
    float weight = sent * local.z * (view.height * view.height / distance_squared) + 1e-12;
    vec2 uv = vec2(0.5, 0.5) + vec2(0.5, -0.5) * q / half_extent;
    vec3 texel = fetch_light_texture(light.texture, uv, size / (2.0 * half_extent));
    sum += weight * texel;
    weights += weight;
    low = min(low, texel);
    high = max(high, texel);
    if ((i & 15u) == 15u) {
      means[lobe] = clamp(sum / weights, low, high);  // of equals exactly the same
      sum = vec3(0.0);
      low = vec3(kMaxFloat);
      high = vec3(0.0);
      weights = 0.0;
    }
  }
  return FaceMeans(means[0], means[1]);
}

// (2) to (5) A sphere or rectangle: its exact irradiance on the diffuse lobe, a representative point on the specular.
vec3 shade_area_light(HeddleLight light, LightArrival arrival, vec3 position_rel, SurfacePoint point, vec3 N, vec3 V) {
  vec3 irradiance = light_irradiance(light, arrival, position_rel, N);
  float NoC = dot(N, arrival.direction);
  // Diffuse light comes from the part above the horizon: its middle is never below.
  vec3 L_diffuse = NoC > 0.01 ? arrival.direction : normalize(arrival.direction + N * (0.01 - NoC));
  vec3 sum = surface_material_lobe(point, N, V, L_diffuse, 1u) * irradiance;
  vec3 center = light.position_rel - position_rel;
  vec3 R = reflect(-V, N);
  vec3 L = light.type == HEDDLE_LIGHT_SPHERE
               ? nearest_on_sphere(center, light.radius, R)
               : nearest_on_rectangle(center, light.tangent, light_bitangent(light), light.half_extent.xy, R);
  float facing = luminance(arrival.irradiance) / max(luminance(light.intensity), 1e-20);
  float VoH = sqrt(max(0.5 + 0.5 * dot(V, L), 0.0));
  float alpha = max(point.roughness * point.roughness, kShadeMinimumAlpha);
  float scale = widening(alpha, sin_squared_of_form_factor(facing), VoH);
  FaceMeans means = face_means(light, position_rel, point, N, V, L, alpha);
  return sum * means.diffuse +
         surface_material_lobe(point, N, V, L, 2u) * arrival.irradiance * (scale * max(dot(N, L), 0.0)) * means.specular;
}

// (6) Whence the light of a lobe comes on the whole: rough ones look away from the mirror direction R, to the normal.
vec3 dominant_direction(vec3 N, vec3 R, float alpha) {
  float smoothness = max(1.0 - alpha, 0.0);
  return normalize(mix(N, R, smoothness * (sqrt(smoothness) + alpha)));
}

// Interpolated and mapped normals may turn away from the viewer, a surface that is seen does not: the nearest that does
// not, either. A little more than edge-on, so that its own rounding, 1e-7, does not turn it away again: the BRDF is 0 there.
vec3 normal_towards_viewer(vec3 N, vec3 V) {
  const float kEdgeOn = 1e-6;
  float NoV = dot(N, V);
  return NoV < kEdgeOn ? normalize(N + V * (kEdgeOn - NoV)) : N;
}

// Reflected radiance towards V, cd/m^2, without emission. `raster_px`: where the camera sees position_rel. `normal`: the
// geometric one, for shadows. `open`: share of the environment that is not occluded.
vec3 shade_surface(SurfacePoint point, vec2 raster_px, vec3 position_rel, vec3 N, vec3 normal, vec3 V, float open) {
  vec3 sum = vec3(0.0);
  LightIterator iterator = begin_lights(uint(lights.length()), raster_px, position_rel);
  while (next_light(iterator)) {
    uint i = iterator.light;
    HeddleLight light = lights[i];
    LightArrival arrival = light_arrival(light, position_rel);
    if (all(equal(arrival.irradiance, vec3(0.0)))) continue;
    bool has_area = light.type == HEDDLE_LIGHT_SPHERE || light.type == HEDDLE_LIGHT_RECTANGLE;
    if (!has_area && dot(N, arrival.direction) <= 0.0) continue;
    float lit = (light.flags & HEDDLE_LIGHT_CASTS_SHADOW) != 0u ? shadow(i, position_rel, normal) : 1.0;
    sum += lit * (has_area ? shade_area_light(light, arrival, position_rel, point, N, V)
                           : shade_point_light(light, arrival, point, N, V));
  }
  float alpha = max(point.roughness * point.roughness, kShadeMinimumAlpha);
  vec3 specular = sky_specular(dominant_direction(N, reflect(-V, N), alpha), alpha);
  return sum + open * surface_material_environment(point, N, V, sky_irradiance(N), specular);
}

#endif
