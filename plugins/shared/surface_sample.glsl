// SPDX-License-Identifier: Apache-2.0
// The interpolated `surface` and the textures of its material -> what is at this point. For shaders of kind
// HEDDLE_SHADER_SURFACES that call texture_source, after pass.glsl: it reads `surface`, `materials` and the five texture
// arrays.
// Source  Khronos 2021, "glTF 2.0 Specification", sections 3.9 and 3.7.2; KHR_texture_transform; Mikkelsen 2008,
//         "Simulation of Wrinkled Surfaces Revisited" (tangent frames: neither vector is normalized before the sum)
#ifndef HEDDLE_SHARED_SURFACE_SAMPLE_GLSL
#define HEDDLE_SHARED_SURFACE_SAMPLE_GLSL
#include "role/texture_source.glsl"
#include "surface_point.glsl"
#include "view.glsl"

struct SurfaceSample {
  vec3 base_color;        // linear Rec.709, vertex colour in it
  float alpha;
  vec3 normal;            // unit, world axes, normal map in it, towards the side that is seen
  float metalness;
  vec3 normal_geometric;  // of the triangle itself, towards the viewer
  float roughness;        // perceptual
  vec3 emissive;          // cd/m^2
  float occlusion;        // 1 open; of the material's texture
  float ior;
  bool is_unlit;
};

// How far the texture coordinates move from pixel to pixel; taken outside of any branch, and from the interpolated ones
// alone: what helper invocations load from buffers is 0 on some drivers, so transformed ones have no derivatives there.
struct SurfaceFootprint {
  vec2 uv0_dx, uv0_dy, uv1_dx, uv1_dy;
};

// The view's bias makes it as much smaller or larger as takes all textures that many levels. Without one, by bits, as it
// is.
SurfaceFootprint surface_footprint() {
  float scale = view.lod_bias == 0.0 ? 1.0 : exp2(view.lod_bias);
  return SurfaceFootprint(scale * dFdx(surface.uv0), scale * dFdy(surface.uv0), scale * dFdx(surface.uv1),
                          scale * dFdy(surface.uv1));
}

// `matrix` and `offset` are the texture's own KHR_texture_transform.
vec4 sample_material(sampler2DArray textures, HeddleMaterial material, SurfaceFootprint footprint, uint slot, uint layer,
                     vec4 matrix, vec2 offset) {
  bool uses_uv1 = (material.texture_uv_sets & (1u << slot)) != 0u;
  mat2 m = mat2(matrix.xy, matrix.zw);
  vec2 uv = m * (uses_uv1 ? surface.uv1 : surface.uv0) + offset;
  return textureGrad(textures, vec3(uv, float(layer)), m * (uses_uv1 ? footprint.uv1_dx : footprint.uv0_dx),
                     m * (uses_uv1 ? footprint.uv1_dy : footprint.uv0_dy));
}

// Role texture_source has the last word on the colour, not on alpha: depth-only drawings test that without it.
vec4 surface_base_color(HeddleMaterial material, SurfaceFootprint footprint) {
  vec4 texel = vec4(1.0);
  uint layer = material.texture_layer[HEDDLE_TEXTURE_BASE_COLOR];
  if (layer != HEDDLE_NO_TEXTURE)
    texel = sample_material(texture_base_color, material, footprint, HEDDLE_TEXTURE_BASE_COLOR, layer,
                            material.uv_rotation_scale, material.uv_offset);
  bool uses_uv1 = (material.texture_uv_sets & (1u << HEDDLE_TEXTURE_BASE_COLOR)) != 0u;
  mat2 m = mat2(material.uv_rotation_scale.xy, material.uv_rotation_scale.zw);
  texel.rgb = texture_source(material.id, m * (uses_uv1 ? surface.uv1 : surface.uv0) + material.uv_offset,
                             m * (uses_uv1 ? footprint.uv1_dx : footprint.uv0_dx),
                             m * (uses_uv1 ? footprint.uv1_dy : footprint.uv0_dy), gl_FragCoord.xy, texel.rgb);
  return material.base_color * surface.color * texel;
}

// True where an alpha-masked material has a hole: discard there.
bool is_hole(HeddleMaterial material, float alpha) {
  return material.alpha_mode == HEDDLE_ALPHA_MASK && alpha < material.alpha_cutoff;
}

// The facet's normal, towards the viewer. In perspective 1/w, in parallel projection the depth is an affine function q of
// the place in the image, whatever the triangle's size, also where helper invocations lie beyond its plane's horizon: its
// gradient is the plane. With x, y the place per metre of depth (parallel: in metres), y up,
//   n = (-dq/dx, -dq/dy, q - x dq/dx - y dq/dy)          parallel: (dq/dx, dq/dy, 1)
// Rounding of q by 2^-24, twice, over the pixel's size per metre turns it by 1e-4 at most in images up to 2000 px high.
// Taken outside of any branch.
vec3 surface_normal_geometric() {
  float parallel = float(view.is_orthographic);
  float q = mix(gl_FragCoord.w, depth_from_position_rel(view, surface.position_rel), parallel);
  vec2 per_pixel = 2.0 * view.half_size / vec2(view.extent);
  vec2 gradient = vec2(dFdx(q), -dFdy(q)) / per_pixel;
  vec2 xy = position_view_from_depth(view, gl_FragCoord.xy, 1.0).xy;
  vec3 n = mix(vec3(-gradient, q - dot(gradient, xy)), vec3(gradient, 1.0), parallel);
  // Scaled first: 1/w may be so small that its square is 0.
  n /= max(max(abs(n.x), abs(n.y)), max(abs(n.z), 1e-37));
  return normalize(mat3(view.rel_from_view) * n);
}

// The back of a surface shows the same bumps from behind: the whole normal turns, not only its base.
vec3 surface_normal(HeddleMaterial material, SurfaceFootprint footprint) {
  vec3 normal = surface.normal;
  uint layer = material.texture_layer[HEDDLE_TEXTURE_NORMAL];
  if (layer != HEDDLE_NO_TEXTURE && dot(surface.tangent.xyz, surface.tangent.xyz) > 0.0) {
    vec3 bump = sample_material(texture_normal, material, footprint, HEDDLE_TEXTURE_NORMAL, layer,
                                material.uv_rotation_scale_2, material.uv_offset_1_2.zw).xyz * 2.0 - 1.0;
    bump.xy *= material.normal_scale;
    vec3 bitangent = surface.tangent.w * cross(surface.normal, surface.tangent.xyz);
    normal = bump.x * surface.tangent.xyz + bump.y * bitangent + bump.z * surface.normal;
  }
  normal /= max(length(normal), 1e-20);
  return gl_FrontFacing ? normal : -normal;
}

SurfaceSample sample_surface(HeddleMaterial material) {
  SurfaceSample s;
  SurfaceFootprint footprint = surface_footprint();
  vec4 base = surface_base_color(material, footprint);
  s.base_color = base.rgb;
  s.alpha = base.a;
  s.metalness = material.metalness;
  s.roughness = material.roughness;
  uint layer = material.texture_layer[HEDDLE_TEXTURE_METALLIC_ROUGHNESS];
  if (layer != HEDDLE_NO_TEXTURE) {
    vec4 texel =
        sample_material(texture_metallic_roughness, material, footprint, HEDDLE_TEXTURE_METALLIC_ROUGHNESS, layer,
                        material.uv_rotation_scale_1, material.uv_offset_1_2.xy);
    s.roughness *= texel.g;
    s.metalness *= texel.b;
  }
  s.normal_geometric = surface_normal_geometric();
  s.normal = surface_normal(material, footprint);
  s.occlusion = 1.0;
  layer = material.texture_layer[HEDDLE_TEXTURE_OCCLUSION];
  if (layer != HEDDLE_NO_TEXTURE) {
    float texel = sample_material(texture_occlusion, material, footprint, HEDDLE_TEXTURE_OCCLUSION, layer,
                                  material.uv_rotation_scale_3, material.uv_offset_3_4.xy).r;
    s.occlusion = 1.0 + material.occlusion_strength * (texel - 1.0);
  }
  s.emissive = material.emissive;
  layer = material.texture_layer_4;
  if (layer != HEDDLE_NO_TEXTURE)
    s.emissive *= sample_material(texture_emissive, material, footprint, HEDDLE_TEXTURE_EMISSIVE, layer,
                                  material.uv_rotation_scale_4, material.uv_offset_3_4.zw).rgb;
  s.ior = material.ior;
  s.is_unlit = (material.flags & HEDDLE_MATERIAL_UNLIT) != 0u;
  return s;
}

// What surface_material shades, in its ranges: textures times factors and vertex colours may leave them.
SurfacePoint surface_point(SurfaceSample s) {
  return SurfacePoint(clamp(s.base_color, 0.0, 1.0), clamp(s.metalness, 0.0, 1.0), clamp(s.roughness, 0.0, 1.0),
                      max(s.ior, 1.0));
}

#endif
