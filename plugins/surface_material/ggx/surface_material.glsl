// SPDX-License-Identifier: Apache-2.0
// A surface point and directions -> how much of the light is reflected. Equations (1) to (9) of README.md.
// Source  Walter et al. 2007 (GGX); Heitz 2014 (height-correlated Smith); Schlick 1994; Kulla and Conty 2017 (the energy that
//         single scattering loses)
// reads   albedo_table  rg32f  129 x 128  written once by this technique; layout in albedo_map.hpp
// constant_multiple_scattering: a compile-time constant
// pow(x, 1/3) is off by 34 ulp on some drivers, which moves a column by 1e-4 of one.
#include "constants.glsl"
#include "surface_point.glsl"

const float kMinimumAlpha = 1e-3;               // albedo_map.hpp
const float kMinimumRoughness = 0.0316227766;   // sqrt(kMinimumAlpha)
const float kAngleScale = 3.0;                  // albedo_map.hpp
const vec2 kTableCells = vec2(127.0, 127.0);
const vec2 kTableTexels = vec2(129.0, 128.0);

// (1) D |NxH|^2 instead of 1 - NoH^2, which cancels in float32 where the lobe is narrow.
float D_GGX(float NoH, float NxH_squared, float alpha) {
  float a = NoH * alpha;
  float k = alpha / max(NxH_squared + a * a, 1e-20);
  return k * k * kInversePi;
}

// (2) G2 / (4 NoL NoV). Finite at NoV = 0; the bound only acts where both cosines are below 1e-9.
float V_SmithGGXCorrelated(float NoV, float NoL, float alpha) {
  float a2 = alpha * alpha;
  float view = NoL * sqrt(a2 + NoV * NoV * (1.0 - a2));
  float light = NoV * sqrt(a2 + NoL * NoL * (1.0 - a2));
  return 0.5 / max(view + light, 1e-12);
}

float power5(float x) {
  float x2 = x * x;
  return x2 * x2 * x;
}

float table_row(float roughness) {
  return sqrt(max(roughness - kMinimumRoughness, 0.0) / (1.0 - kMinimumRoughness));
}

// (4) x: 1 - E, y: E_schlick.
vec2 directional_albedo(float cosine, float roughness) {
  float k = kAngleScale * roughness * roughness;
  vec2 cell = vec2(pow(cosine * (1.0 + k) / (cosine + k), 1.0 / 3.0), table_row(roughness)) * kTableCells;
  vec2 stored = sample_albedo_table((cell + 0.5) / kTableTexels).xy;
  return vec2(stored.x, stored.y + (1.0 - stored.x) * power5(1.0 - cosine));
}

// (5) the same, averaged over the hemisphere.
vec2 average_albedo(float roughness) {
  vec2 cell = vec2(kTableTexels.x - 1.0, table_row(roughness) * kTableCells.y);
  return sample_albedo_table((cell + 0.5) / kTableTexels).xy;
}

// (6) Share of the lost energy that comes out after more bounces, when each reflects F on average.
vec3 multiple_scattering_share(vec3 f0, float average_loss) {
  vec3 F_average = (20.0 * f0 + 1.0) / 21.0;
  return F_average * F_average * (1.0 - average_loss) / (1.0 - F_average * average_loss);
}

// (8) Directional albedo of the dielectric's specular lobe, bounces included: what is not left for diffuse.
float dielectric_albedo(vec2 albedo, float f0, float share) {
  return f0 * (1.0 - albedo.x) + (1.0 - f0) * albedo.y + share * albedo.x;
}

float f0_from_ior(float ior) {
  float r = (ior - 1.0) / (ior + 1.0);
  return r * r;
}

vec3 surface_material_lobe(SurfacePoint point, vec3 N, vec3 V, vec3 L, uint lobe) {
  float NoL = dot(N, L);
  float NoV = dot(N, V);
  if (NoL <= 0.0 || NoV < 0.0) return vec3(0.0);
  NoL = min(NoL, 1.0);
  NoV = min(NoV, 1.0);
  float roughness = clamp(point.roughness, kMinimumRoughness, 1.0);
  float f0_dielectric = f0_from_ior(point.ior);
  vec2 albedo_view = directional_albedo(NoV, roughness);
  vec2 albedo_light = directional_albedo(NoL, roughness);
  vec2 average = average_albedo(roughness);
  float share_dielectric = multiple_scattering_share(vec3(f0_dielectric), average.x).x;
  vec3 sum = vec3(0.0);
  if (lobe != 1u) {
    vec3 H = V + L;
    H /= max(length(H), 1e-20);
    vec3 NxH = cross(N, H);
    float alpha = roughness * roughness;
    vec3 f0 = mix(vec3(f0_dielectric), point.base_color, point.metalness);
    vec3 F_Schlick = f0 + (1.0 - f0) * power5(1.0 - clamp(dot(V, H), 0.0, 1.0));
    sum = F_Schlick * (D_GGX(clamp(dot(N, H), 0.0, 1.0), dot(NxH, NxH), alpha) *
                       V_SmithGGXCorrelated(NoV, NoL, alpha));
    if (constant_multiple_scattering) {  // (7)
      vec3 share = mix(vec3(share_dielectric), multiple_scattering_share(point.base_color, average.x), point.metalness);
      sum += share * (albedo_view.x * albedo_light.x * kInversePi / max(average.x, 1e-7));
    }
  }
  if (lobe != 2u) {  // (9)
    float left_view = 1.0 - dielectric_albedo(albedo_view, f0_dielectric, share_dielectric);
    float left_light = 1.0 - dielectric_albedo(albedo_light, f0_dielectric, share_dielectric);
    float left_average = 1.0 - dielectric_albedo(average, f0_dielectric, share_dielectric);
    sum += point.base_color * ((1.0 - point.metalness) * kInversePi * max(left_view, 0.0) * max(left_light, 0.0) /
                               max(left_average, 1e-6));
  }
  return sum;
}

vec3 surface_material(SurfacePoint point, vec3 N, vec3 V, vec3 L) {
  return surface_material_lobe(point, N, V, L, 0u);
}

// The lobes' albedos times what arrives: exact under uniform light. The bounces and diffuse see all of the hemisphere.
vec3 surface_material_environment(SurfacePoint point, vec3 N, vec3 V, vec3 irradiance, vec3 specular_radiance) {
  float NoV = clamp(dot(N, V), 0.0, 1.0);
  float roughness = clamp(point.roughness, kMinimumRoughness, 1.0);
  float f0_dielectric = f0_from_ior(point.ior);
  vec3 f0 = mix(vec3(f0_dielectric), point.base_color, point.metalness);
  vec2 albedo = directional_albedo(NoV, roughness);
  vec2 average = average_albedo(roughness);
  float share_dielectric = multiple_scattering_share(vec3(f0_dielectric), average.x).x;
  vec3 specular = f0 * (1.0 - albedo.x) + (1.0 - f0) * albedo.y;
  float left = max(1.0 - dielectric_albedo(albedo, f0_dielectric, share_dielectric), 0.0);
  vec3 broad = point.base_color * ((1.0 - point.metalness) * left);
  if (constant_multiple_scattering) {
    vec3 share = mix(vec3(share_dielectric), multiple_scattering_share(point.base_color, average.x), point.metalness);
    broad += share * albedo.x;
  }
  return specular * specular_radiance + broad * irradiance * kInversePi;
}
