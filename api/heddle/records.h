// SPDX-License-Identifier: Apache-2.0
// The records that the host, plugins and shaders share, defined once: C11, C++ and GLSL read this file.
// Metres, seconds, radians; linear Rec.709 float; right-handed, +Y up; a view looks along its -Z; Vulkan clip space,
// reversed depth, infinite far plane. `_rel`: world axes, relative to the frame's origin (the main camera's position,
// float64 on the CPU), so that large worlds keep float32 precision near the viewer.
// Every vec3 is followed by one scalar, so std140, std430 and C agree; sizes are multiples of 16.
#ifndef HEDDLE_RECORDS_H
#define HEDDLE_RECORDS_H

#ifdef VULKAN
#define HEDDLE_FLOAT(name) float name;
#define HEDDLE_FLOAT2(name) vec2 name;
#define HEDDLE_FLOAT3(name) vec3 name;
#define HEDDLE_FLOAT4(name) vec4 name;
#define HEDDLE_UINT(name) uint name;
#define HEDDLE_UINT2(name) uvec2 name;
#define HEDDLE_UINT4(name) uvec4 name;
#define HEDDLE_MAT4(name) mat4 name;
#define HEDDLE_BEGIN_RECORD(name) struct name {
#define HEDDLE_END_RECORD(name) };
#else
#include <stdint.h>
#define HEDDLE_FLOAT(name) float name;
#define HEDDLE_FLOAT2(name) float name[2];
#define HEDDLE_FLOAT3(name) float name[3];
#define HEDDLE_FLOAT4(name) float name[4];
#define HEDDLE_UINT(name) uint32_t name;
#define HEDDLE_UINT2(name) uint32_t name[2];
#define HEDDLE_UINT4(name) uint32_t name[4];
#define HEDDLE_MAT4(name) float name[16]; /* column-major, as GLSL */
#define HEDDLE_BEGIN_RECORD(name) typedef struct name {
#define HEDDLE_END_RECORD(name) } name;
#endif

// --- HeddleView: how positions become pixels. 368 bytes. -------------------------------------------------------------
// Perspective: position_view = (ndc.x * half_size.x * d, -ndc.y * half_size.y * d, -d), d = distance along the axis,
// ndc taken without jitter; half_size = tangents of the half angles. Orthographic: half_size in metres, no factor d.
HEDDLE_BEGIN_RECORD(HeddleView)
HEDDLE_MAT4(clip_from_rel)          // position_rel -> clip, jitter included
HEDDLE_MAT4(rel_from_clip)          // its inverse, inverted in float64
HEDDLE_MAT4(view_from_rel)          // rigid: position_rel -> view space
HEDDLE_MAT4(rel_from_view)          // its inverse
HEDDLE_MAT4(previous_clip_from_rel) // last frame's view, unjittered; takes this frame's position_rel of a static point
HEDDLE_FLOAT2(half_size)
HEDDLE_FLOAT(near_distance)         // metres; perspective: clip.z = near_distance, clip.w = d, so depth = near/d
HEDDLE_UINT(is_orthographic)        // 1: clip.w = 1 and depth is 1 at near_distance, 0 at far_distance
HEDDLE_UINT2(extent)                // pixels
HEDDLE_FLOAT2(jitter)               // pixels, added to the raster position
HEDDLE_FLOAT(lod_bias)              // levels, added where the scene's textures are sampled; a view of n samples a pixel may
HEDDLE_UINT(reserved0_)             // go down to -log2(n) / 2
HEDDLE_UINT2(reserved1_)
HEDDLE_END_RECORD(HeddleView)

// --- HeddleLight: one light. 96 bytes. -------------------------------------------------------------------------------
// Fall-off is exactly 0 at and beyond `range` and outside a cone, wedge or box.
#define HEDDLE_LIGHT_DIRECTIONAL 0u // intensity in lux, at normal incidence
#define HEDDLE_LIGHT_POINT 1u       // intensity in candela
#define HEDDLE_LIGHT_SPOT 2u        // candela on the axis; glTF's angular fall-off between the two cosines
#define HEDDLE_LIGHT_SPHERE 3u      // emitter of `radius`; intensity in candela/m^2 (radiance)
#define HEDDLE_LIGHT_CAPSULE 4u     // point lights along a segment (nearest point lights): tangent, segment_length
#define HEDDLE_LIGHT_CONE 5u        // as spot, inside a sphere-capped cone; hard edge softened by cos_inner
#define HEDDLE_LIGHT_WEDGE 6u       // cone swept along the segment
#define HEDDLE_LIGHT_BOX 7u         // parallel light inside an oriented box, lux; fades over `radius` metres at its faces
#define HEDDLE_LIGHT_RECTANGLE 8u   // one-sided emitter, half_extent.xy along tangent and direction x tangent; radiance
#define HEDDLE_LIGHT_ENVIRONMENT 9u // the role `sky` answers for it; intensity scales it
#define HEDDLE_LIGHT_CASTS_SHADOW 1u
HEDDLE_BEGIN_RECORD(HeddleLight)
HEDDLE_FLOAT3(position_rel)   // centre; unused for directional and environment
HEDDLE_UINT(type)             // HEDDLE_LIGHT_*
HEDDLE_FLOAT3(direction)      // unit, the way the light travels (a sun overhead: 0,-1,0)
HEDDLE_FLOAT(range)           // metres; 0 = unlimited
HEDDLE_FLOAT3(intensity)      // linear Rec.709, in the unit of the type
HEDDLE_FLOAT(radius)          // metres: sphere, capsule; box: fade width. Directional: angular radius in radians
HEDDLE_FLOAT3(tangent)        // unit, normal to direction: segment, rectangle and box x axis
HEDDLE_FLOAT(segment_length)  // metres: capsule, wedge
HEDDLE_FLOAT3(half_extent)    // metres: rectangle xy; box xyz along tangent, direction x tangent, direction
HEDDLE_UINT(flags)            // HEDDLE_LIGHT_CASTS_SHADOW
HEDDLE_FLOAT(cos_inner)       // spot, cone, wedge
HEDDLE_FLOAT(cos_outer)
HEDDLE_UINT(id)               // stable while the scene lives; index in the scene's order
HEDDLE_UINT(texture)          // rectangle: 1 + its place in the scene's value `light_textures`; 0: none. The host's
HEDDLE_END_RECORD(HeddleLight)

// --- HeddleMaterial: glTF's metallic-roughness model. 224 bytes. -----------------------------------------------------
#define HEDDLE_ALPHA_OPAQUE 0u
#define HEDDLE_ALPHA_MASK 1u
#define HEDDLE_ALPHA_BLEND 2u
#define HEDDLE_MATERIAL_DOUBLE_SIDED 1u
#define HEDDLE_MATERIAL_UNLIT 2u
#define HEDDLE_TEXTURE_BASE_COLOR 0u         // sRGB colour, alpha
#define HEDDLE_TEXTURE_METALLIC_ROUGHNESS 1u // g roughness, b metalness, linear
#define HEDDLE_TEXTURE_NORMAL 2u             // tangent space, linear
#define HEDDLE_TEXTURE_OCCLUSION 3u          // r, linear
#define HEDDLE_TEXTURE_EMISSIVE 4u           // sRGB colour
#define HEDDLE_TEXTURE_COUNT 5u
#define HEDDLE_NO_TEXTURE 0xffffffffu
HEDDLE_BEGIN_RECORD(HeddleMaterial)
HEDDLE_FLOAT4(base_color)         // linear, alpha
HEDDLE_FLOAT3(emissive)           // candela/m^2: factor x strength
HEDDLE_FLOAT(alpha_cutoff)
HEDDLE_FLOAT(metalness)
HEDDLE_FLOAT(roughness)           // perceptual; alpha = roughness^2
HEDDLE_FLOAT(normal_scale)
HEDDLE_FLOAT(occlusion_strength)
HEDDLE_UINT(alpha_mode)           // HEDDLE_ALPHA_*
HEDDLE_UINT(flags)                // HEDDLE_MATERIAL_*
HEDDLE_FLOAT(ior)                 // 1.5 unless said; f0 = ((ior-1)/(ior+1))^2
HEDDLE_FLOAT(transmission)        // 0..1
HEDDLE_UINT4(texture_layer)       // layer in the bound 2D array of textures 0..3, or HEDDLE_NO_TEXTURE
HEDDLE_UINT(texture_layer_4)      // the same for texture 4
HEDDLE_UINT(texture_uv_sets)      // bit i: texture i uses uv1
HEDDLE_UINT(texture_group)        // which set of texture arrays is bound for it: draws are merged by it
HEDDLE_UINT(id)                   // index in the scene's order
HEDDLE_FLOAT4(uv_rotation_scale)  // KHR_texture_transform of texture 0: uv' = mat2(xy, zw) * uv + uv_offset
HEDDLE_FLOAT2(uv_offset)
HEDDLE_FLOAT2(reserved_)
HEDDLE_FLOAT4(uv_rotation_scale_1) // of textures 1 to 4; an application that leaves one of them zero means texture 0's
HEDDLE_FLOAT4(uv_rotation_scale_2)
HEDDLE_FLOAT4(uv_rotation_scale_3)
HEDDLE_FLOAT4(uv_rotation_scale_4)
HEDDLE_FLOAT4(uv_offset_1_2)       // of textures 1 (xy) and 2 (zw)
HEDDLE_FLOAT4(uv_offset_3_4)       // of textures 3 (xy) and 4 (zw)
HEDDLE_END_RECORD(HeddleMaterial)

// --- HeddleEnvironment: head of the scene's value `environment`; behind it width x height vec4 texels. 32 bytes. ------
// Equirectangular, top row (+Y) first, -Z in the middle, +X to the right of it; linear Rec.709, the fourth component 1.
HEDDLE_BEGIN_RECORD(HeddleEnvironment)
HEDDLE_FLOAT4(rotation) // unit quaternion x y z w, scene from image
HEDDLE_FLOAT(scale)     // cd/m^2 of a texel's 1
HEDDLE_UINT(width)      // texels; 0: the scene has none
HEDDLE_UINT(height)
HEDDLE_UINT(revision)   // from 1; differs where texels may differ
HEDDLE_END_RECORD(HeddleEnvironment)

// --- HeddleLightTexture: a head of the scene's value `light_textures`. 16 bytes, as a vec4 whose bits are read. ----------
// The value is an array of vec4: first a head for each texture, then the texels of all, linear Rec.709, the fourth
// component 1. A texture is a chain of levels, each half as wide and high as the one before, rounded up, down to 1x1; a
// level's texel is the mean over the area that it covers. Top row first.
HEDDLE_BEGIN_RECORD(HeddleLightTexture)
HEDDLE_UINT(first) // element of the value with the first texel of level 0
HEDDLE_UINT(width) // texels of level 0
HEDDLE_UINT(height)
HEDDLE_UINT(level_count)
HEDDLE_END_RECORD(HeddleLightTexture)

// --- HeddleInstance: one placed mesh, as the GPU sees it this frame. 160 bytes. --------------------------------------
HEDDLE_BEGIN_RECORD(HeddleInstance)
HEDDLE_MAT4(rel_from_object)          // position_rel = rel_from_object * position; translation made in float64
HEDDLE_MAT4(previous_rel_from_object) // last frame's place relative to THIS frame's origin
HEDDLE_UINT(material)
HEDDLE_UINT(object)                   // id of the scene's instance
HEDDLE_UINT(flags)                    // HEDDLE_SURFACE_*
HEDDLE_UINT(flip)                     // 1: the transform mirrors (negative determinant), so front faces are clockwise
HEDDLE_UINT(previous_vertex)          // plus a vertex's index (modulo 2^32): the same vertex in the last frame; 0: it is
HEDDLE_UINT(reserved0_)               // where it was, in its object
HEDDLE_UINT(reserved1_)
HEDDLE_UINT(reserved2_)
HEDDLE_END_RECORD(HeddleInstance)
#define HEDDLE_SURFACE_OPAQUE 1u
#define HEDDLE_SURFACE_MASKED 2u
#define HEDDLE_SURFACE_BLENDED 4u // alpha below 1, or light passes through: what is behind shows
#define HEDDLE_SURFACE_CASTS_SHADOW 8u
#define HEDDLE_SURFACE_DOUBLE_SIDED 16u

// --- HeddleVertex: 64 bytes, object space. ---------------------------------------------------------------------------
HEDDLE_BEGIN_RECORD(HeddleVertex)
HEDDLE_FLOAT3(position) // metres
HEDDLE_FLOAT(u0)
HEDDLE_FLOAT3(normal)   // unit
HEDDLE_FLOAT(v0)
HEDDLE_FLOAT4(tangent)  // unit; w = handedness, bitangent = w * cross(normal, tangent)
HEDDLE_UINT(color)      // rgba8 unorm, linear, multiplies base colour
HEDDLE_FLOAT(u1)
HEDDLE_FLOAT(v1)
HEDDLE_FLOAT(reserved_)
HEDDLE_END_RECORD(HeddleVertex)

#endif
